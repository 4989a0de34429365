"""A and b of every kind of constraint from frame Jacobians and accelerations, without the core.

Each kind has the analytic derivatives of its residual or rate.  The formulas hold for states on the
constraints, with zero residual.
"""

from __future__ import annotations

from functools import singledispatch

import numpy as np

import pin_nonideal as pn
from pin_nonideal.validation import axis_triad

from .frames import Frames

cross = np.cross


def skew(x):
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def rows(scene, q, v, t):
    """Return A, (m, nv), and b, (m,), of all constraints and contacts in the order of `lam`."""
    return rows_of_frames(scene, Frames(scene.model, q, v), t)


def rows_of_frames(scene, frames, t):
    """Return A and b of all constraints and contacts from the frames of any kinematics."""
    found = [of_kind(c, frames, t, scene) for c in (*scene.constraints, *scene.contacts)]
    A, b = [np.zeros((0, scene.model.nv))], [np.zeros(0)]
    for part, right in found:
        A.append(np.atleast_2d(part))
        b.append(np.atleast_1d(right))
    return np.vstack(A), np.concatenate(b)


def _relative(one, two):
    """Return Jacobian and bias (Jdot v) of the position of `one` in the axes of `two`."""
    d, u = one.p - two.p, one.u - two.u
    J = two.R.T @ (one.J - two.J + skew(d) @ two.Jw)
    drift = one.du - two.du - cross(two.dw, d) - 2.0 * cross(two.w, u) + cross(two.w, cross(two.w, d))
    return J, two.R.T @ drift


def _turning(one, two):
    """Return Jacobian and bias (Jdot v) of the relative angular velocity in the axes of `two`."""
    drift = one.dw - two.dw - cross(two.w, one.w - two.w)
    return two.R.T @ (one.Jw - two.Jw), two.R.T @ drift


@singledispatch
def of_kind(c, frames, t, scene):
    """Return A and b of one constraint or contact."""
    raise TypeError(f"no rows are known for {c!r}")


@of_kind.register
def _(c: pn.PointAnchor, frames, t, scene):
    held = ["xyz".index(axis) for axis in c.axes]
    J, drift = _relative(frames(c.frame1), frames(c.frame2))
    return J[held], -drift[held]


@of_kind.register
def _(c: pn.FrameAnchor, frames, t, scene):
    one, two = frames(c.frame1), frames(c.frame2)
    (J, drift), (Jw, turning) = _relative(one, two), _turning(one, two)
    return np.vstack([J, Jw]), -np.concatenate([drift, turning])


@of_kind.register
def _(c: pn.HingeAnchor, frames, t, scene):
    one, two = frames(c.frame1), frames(c.frame2)
    (J, drift), (Jw, turning) = _relative(one, two), _turning(one, two)
    axis = np.asarray(c.axis)
    if c.frame2 is None:
        axis = frames.at(scene.q0)(c.frame1).R @ axis
    across = np.array(axis_triad(tuple(axis))[:2])
    return np.vstack([J, across @ Jw]), -np.concatenate([drift, across @ turning])


@of_kind.register
def _(c: pn.Distance, frames, t, scene):
    one, two = frames(c.frame1), frames(c.frame2)
    if c.frame2 is None:  # world point at the initial position of frame1
        two.p = frames.at(scene.q0)(c.frame1).p
    d, u = one.p - two.p, one.u - two.u
    length = np.linalg.norm(d)
    n = d / length
    drift = n @ (one.du - two.du) + (u @ u - (n @ u) ** 2) / length
    return n @ (one.J - two.J), (c.length(t)[2] if callable(c.length) else 0.0) - drift


@of_kind.register
def _(c: pn.JointCoupling, frames, t, scene):
    row = np.zeros(scene.model.nv)
    row[frames.dof(c.joint1)], row[frames.dof(c.joint2)] = 1.0, -c.ratio
    return row, 0.0


@of_kind.register
def _(c: pn.PrescribedMotion, frames, t, scene):
    row = np.zeros(scene.model.nv)
    row[frames.dof(c.joint)] = 1.0
    return row, c.function(t)[2]


@of_kind.register
def _(c: pn.KnifeEdge, frames, t, scene):
    blade = frames(c.frame)
    across = blade.R @ np.asarray(c.axis)
    return across @ blade.J, -(across @ blade.du + cross(blade.w, across) @ blade.u)


@of_kind.register
def _(c: pn.Rolling, frames, t, scene):
    body, plane = frames(c.frame), frames(c.plane)
    directions = plane.R @ np.array(axis_triad(tuple(c.normal))).T  # t1, t2, n as columns
    n = directions[:, 2]
    down, turn = n, cross(plane.w, n)
    if c.axis is not None:  # down in the plane of the disk
        e = body.R @ np.asarray(c.axis)
        de, dn = cross(body.w, e), turn
        g, dg = n - (n @ e) * e, dn - (dn @ e + n @ de) * e - (n @ e) * de
        size = np.linalg.norm(g)
        down = g / size
        turn = (dg - (down @ dg) * down) / size
    arm, d_arm = -c.radius * down, -c.radius * turn  # from the center to the contact point
    other, d_other = body.p + arm - plane.p, body.u + d_arm - plane.u
    slip = body.u + cross(body.w, arm) - plane.u - cross(plane.w, other)
    drift = body.du + cross(body.dw, arm) + cross(body.w, d_arm)
    drift -= plane.du + cross(plane.dw, other) + cross(plane.w, d_other)
    J = body.J - skew(arm) @ body.Jw - plane.J + skew(other) @ plane.Jw
    return directions.T @ J, -directions.T @ (drift - cross(plane.w, slip))


@of_kind.register
def _(c: pn.PointContact, frames, t, scene):
    J, drift = _relative(frames(c.frame), frames(c.plane))
    n = np.asarray(c.normal)
    return n @ J, -n @ drift


@of_kind.register
def _(c: pn.UserConstraint, frames, t, scene):
    return c.function(t, frames.q, frames.v, frames.data)
