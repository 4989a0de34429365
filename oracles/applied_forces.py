"""M and F of a scene: mass matrix and bias forces of Pinocchio, and applied forces by frame Jacobians."""

from __future__ import annotations

from functools import singledispatch

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from .frames import Frames


def mass_matrix(model, q):
    M = pin.crba(model, model.createData(), q, pin.Convention.WORLD)
    return np.triu(M) + np.triu(M, 1).T


def given_force(scene, q, v, t):
    """Compute F = tau + sum J^T f - nle(q, v), (nv,)."""
    bias = pin.nonLinearEffects(scene.model, scene.model.createData(), q, v)
    return applied_force(scene, Frames(scene.model, q, v), t) - bias


def applied_force(scene, frames, t):
    """Compute tau + sum J^T f from the frames of any kinematics, (nv,)."""
    force = torque(scene.actuation, scene, frames.q, frames.v, t)
    return sum((generalized(f, frames, t, scene) for f in scene.forces), start=force)


def torque(actuation, scene, q, v, t):
    """Return the actuation torques, (nv,)."""
    model = scene.model
    if actuation is None:
        return np.zeros(model.nv)
    if isinstance(actuation, pn.HoldPosition):
        kp, kd = (_gain(model, k) for k in (actuation.kp, actuation.kd))
        goal = scene.q0 if actuation.q is None else np.asarray(actuation.q)
        return kp * _difference(model, q, goal, kp) - kd * v
    if isinstance(actuation, pn.Table) and actuation.interpolation == "hold":
        return np.asarray(actuation.values)[max(np.searchsorted(actuation.times, t, side="right") - 1, 0)]
    if isinstance(actuation, pn.Table):
        return np.array([np.interp(t, actuation.times, column) for column in np.transpose(actuation.values)])
    if isinstance(actuation, pn.SampledControl):
        if actuation.delay_in_samples:  # a single state has no earlier samples
            return np.zeros(model.nv) if actuation.initial is None else np.array(actuation.initial)
        return np.asarray(actuation.function(t, q, v), dtype=float)
    return np.asarray(actuation(t, q, v) if callable(actuation) else actuation, dtype=float)


def _gain(model, gain):
    """Return gains, (nv,): a scalar gain applies to joints with one degree of freedom."""
    if np.ndim(gain):
        return np.asarray(gain, dtype=float)
    return np.concatenate([np.full(j.nv, gain if j.nv == 1 else 0.0) for j in list(model.joints)[1:]])


def _difference(model, q, goal, gain):
    """Return goal - q in the tangent space for joints with a gain, else zero."""
    found = np.zeros(model.nv)
    for joint in list(model.joints)[1:]:
        dofs = slice(joint.idx_v, joint.idx_v + joint.nv)
        if not gain[dofs].any():
            continue
        if joint.nq == joint.nv == 1:
            found[dofs] = goal[joint.idx_q] - q[joint.idx_q]
        else:
            found[dofs] = pin.difference(model, q, goal)[dofs]
    return found


@singledispatch
def generalized(force, frames, t, scene):
    """Return the generalized force of one applied force, (nv,)."""
    raise TypeError(f"no generalized force is known for {force!r}")


@generalized.register
def _(force: pn.SpringDamper, frames, t, scene):
    one, two = frames(force.frame1), frames(force.frame2)
    if force.frame2 is None:  # world point at the initial position of frame1
        two.p = frames.at(scene.q0)(force.frame1).p
    gap = one.p - two.p
    length = np.linalg.norm(gap)
    rate = gap @ (one.u - two.u) / length
    size = force.stiffness * (length - force.rest_length) + force.damping * rate
    return -(one.J - two.J).T @ (size * gap / length)


@generalized.register
def _(force: pn.JointSpring, frames, t, scene):
    joint = scene.model.joints[scene.model.getJointId(force.joint)]
    # An unbounded joint stores (cos, sin) of its angle. Springs of the tests rotate by less than half a turn.
    angle = frames.q[joint.idx_q]
    if joint.nq == 2:
        angle = np.arctan2(frames.q[joint.idx_q + 1], angle)
    size = force.stiffness * (angle - force.rest) + force.damping * frames.v[joint.idx_v]
    return -size * np.eye(scene.model.nv)[joint.idx_v]


@generalized.register
def _(force: pn.Wrench, frames, t, scene):
    frame = frames(force.frame)
    wrench = np.asarray(force.value(t) if callable(force.value) else force.value, dtype=float)
    return frame.J.T @ wrench[:3] + frame.Jw.T @ wrench[3:]


@generalized.register
def _(force: pn.UserForce, frames, t, scene):
    return np.asarray(force.function(t, frames.q, frames.v), dtype=float)
