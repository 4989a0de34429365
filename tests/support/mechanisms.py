"""Small mechanisms built joint by joint, for tests against closed forms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from pin_nonideal.scene.scene import scene_states

GRAVITY = 9.81
# Step control at which runs of a hundred steps stay well within 1e-10 of their closed forms.
TIGHT = {"rtol": 1e-12, "atol": 1e-13}
TIGHTER = {"rtol": 1e-13, "atol": 1e-14}


def empty(gravity=(0.0, 0.0, -GRAVITY)):
    """Return a model without joints."""
    model = pin.Model()
    model.gravity = pin.Motion(np.array(gravity, dtype=float), np.zeros(3))
    return model


def body(model, parent, joint, name, mass, *, place=None, lever=(0.0, 0.0, 0.0), inertia=None):
    """Add a joint, its frame and its body (default: point mass), and return the joint's index."""
    index = model.addJoint(parent, joint, pin.SE3.Identity() if place is None else place, name)
    about_center = np.zeros((3, 3)) if inertia is None else np.asarray(inertia, dtype=float)
    Y = pin.Inertia(mass, np.array(lever, dtype=float), about_center)
    model.appendBodyToJoint(index, Y, pin.SE3.Identity())
    model.addJointFrame(index)
    return index


def frame(model, name, joint, place=None):
    """Add a frame fixed to the body of a joint, or to the world (joint 0)."""
    placement = pin.SE3.Identity() if place is None else place
    model.addFrame(pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME), False)


def hinge(x, y, z):
    """Return a revolute joint about an axis."""
    return pin.JointModelRevoluteUnaligned(np.array([x, y, z], dtype=float))


def point_mass(axes="XYZ", mass=1.0, gravity=(0.0, 0.0, -GRAVITY)):
    """Return a point mass "mass" on slides along world axes, named in lower case, and a frame "origin"."""
    model = empty(gravity)
    joint = 0
    for axis in axes:
        joint = model.addJoint(joint, getattr(pin, f"JointModelP{axis}")(), pin.SE3.Identity(), axis.lower())
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    frame(model, "mass", joint)
    frame(model, "origin", 0)
    return model


def planar(mass, inertia, corners, gravity=(0.0, 0.0, -GRAVITY)):
    """Return a planar body in the x-z plane, with frames "c0", "c1", ... at its corners."""
    model = empty(gravity)
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    joint = body(model, joint, pin.JointModelPZ(), "z", 0.0)
    joint = body(model, joint, pin.JointModelRY(), "turn", mass, inertia=inertia * np.eye(3))
    for k, (x, z) in enumerate(corners):
        frame(model, f"c{k}", joint, pin.SE3(np.eye(3), np.array([x, 0.0, z])))
    return model


def at(run, *kinds):
    """Return the times of events of these kinds."""
    return np.array([event.time for event in run.events if event.kind in kinds])


def decades(rng, low, high):
    """Return a random number with a uniform logarithm."""
    return 10.0 ** rng.uniform(np.log10(low), np.log10(high))


def dof(scene, joint):
    """Return the index of a one-dof joint in v (and in q, if all joints have one dof)."""
    return int(scene.model.idx_vs[scene.model.getJointId(joint)])


def sample(run, t):
    """Return the index of the sample at a time, which must exist."""
    index = int(np.argmin(np.abs(run.t - t)))
    assert abs(run.t[index] - t) < 1e-12 * max(1.0, t)
    return index


def at_events(run):
    """Return the indices of the samples at the events, in order."""
    return [int(np.flatnonzero(run.t == event.time)[0]) for event in run.events]


def assert_close(value, reference, tolerance):
    np.testing.assert_allclose(value, reference, rtol=0.0, atol=tolerance)


def again(scene, **changes):
    """Return a new scene with some of its arguments changed."""
    names = ("constraints", "laws", "contacts", "forces", "actuation", "q0", "v0", "name", "terms")
    made = pn.Scene(scene.model, **{**{name: getattr(scene, name) for name in names}, **changes})
    if not {"q0", "v0"} & set(changes):
        scene_states(made).held = scene_states(scene).held
    return made
