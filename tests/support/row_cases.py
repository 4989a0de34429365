"""Scenes with each kind of constraint: random trees, and the robots of the package."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from pin_nonideal.description.contacts import PointContact

from .mechanisms import again
from .random_trees import AXIS, add, attach, place_of, three_trees

ROBOTS = [name for name, _ in pn.robots()]


def kept(scene):
    """Return the scene with bilateral contacts without friction, whose rows act in any state.

    Friction of bilateral contacts under tension may leave no solution.
    """

    def closed(c):
        unkept = isinstance(c, PointContact) and c.unilateral
        return dataclasses.replace(c, unilateral=False, mu=0.0) if unkept else c

    contacts = [closed(c) for c in scene.contacts]
    return scene if contacts == list(scene.contacts) else again(scene, contacts=contacts)


def _meeting(rng, one, other):
    """Return three trees, with a frame "meet" of the body of `other` at the initial tip of `one`."""
    model, q = three_trees(rng)
    attach(model, "meet", model.getJointId(other), q, place_of(model, q, f"{one} tip"))
    return model, q


def _anchor(make, one, other):
    def build(rng):
        model, q = _meeting(rng, one, other)
        return pn.Scene(model, constraints=[make(f"{one} tip", "meet")], q0=q)

    return build


def _ground(make, one):
    def build(rng):
        model, q = three_trees(rng)
        return pn.Scene(model, constraints=[make(f"{one} tip")], q0=q)

    return build


def _distance(length, one="a3 tip", other="b2 tip"):
    def build(rng):
        model, q = three_trees(rng)
        now = np.linalg.norm(place_of(model, q, one).translation - place_of(model, q, other).translation)
        return pn.Scene(model, constraints=[pn.Distance(one, other, length=length(now))], q0=q)

    return build


def _joints(*constraints):
    def build(rng):
        model, q = three_trees(rng)
        return pn.Scene(model, constraints=list(constraints), q0=q)

    return build


def _disk(axis):
    return lambda frame, plane: pn.Rolling(frame, 0.3, axis=axis, plane=plane)


def _leaning(axis):
    """Return the height of a disk's center for the normal of the plane in the axes of the disk."""
    return lambda normal: 0.3 * np.linalg.norm(np.cross(normal, axis)) / np.linalg.norm(axis)


def _contact(radius):
    return lambda frame, plane: PointContact(frame, plane=plane, radius=radius, unilateral=False)


def _on_plane(make, body, plane, height):
    """Return a frame of `body` at a height over a plane (z of frame "plane" of a body or of the world).

    The height is a number, or a function of the plane's normal in the axes of the frame.
    """

    def build(rng):
        model, q = three_trees(rng)
        here = place_of(model, q, f"{body} tip")
        name = None if plane is None else "plane"
        turn = here.rotation.T if plane is None else pin.rpy.rpyToMatrix(0.2, 0.3, -0.1)
        above = height(turn[:, 2]) if callable(height) else height
        if plane is None:
            base = model.joints[1].idx_q  # lift the floating base of the tree
            q[base : base + 3] += (above - here.translation[2]) * model.jointPlacements[1].rotation[2]
        else:
            turned = pin.SE3(here.rotation @ turn, here.translation)
            below = turned * pin.SE3(np.eye(3), np.array([0.4, -0.2, -above]))
            attach(model, name, model.getJointId(plane), q, below)
        thing = make(f"{body} tip", name)
        key = "contacts" if isinstance(thing, PointContact) else "constraints"
        return pn.Scene(model, q0=q, **{key: [thing]})

    return build


def _user(rng):
    """Return a constraint of a frame's origin to a sphere with a fixed center and a time-dependent radius."""
    model = pin.Model()
    add(model, "root", "free flyer", 0, rng)
    add(model, "arm", "revolute unaligned", 1, rng)
    q = pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv))
    center = place_of(model, q, "arm tip").translation - np.array([0.6, 0.0, 0.8])
    frame, axes = model.getFrameId("arm tip"), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def radius(t):
        return 1.0 + 0.1 * np.sin(3 * t), 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)

    def residual(t, q):
        d = place_of(model, q, "arm tip").translation - center
        return [0.5 * (d @ d - radius(t)[0] ** 2)]

    def rows(t, q, v, data):
        J = pin.getFrameJacobian(model, data, frame, axes)[:3]
        d = data.oMf[frame].translation - center
        u = J @ v
        drift = pin.getFrameClassicalAcceleration(model, data, frame, axes).linear
        r, dr, ddr = radius(t)
        return (d @ J)[None, :], [dr**2 + r * ddr - u @ u - d @ drift]

    return pn.Scene(model, constraints=[pn.UserConstraint(rows, 1, residual=residual)], q0=q)


def _wobble(t):
    return (0.3 + 0.2 * np.sin(2.0 * t), 0.4 * np.cos(2.0 * t), -0.8 * np.sin(2.0 * t))


TREES = {
    "point between trees": _anchor(pn.PointAnchor, "a3", "b2"),
    "point inside a tree": _anchor(pn.PointAnchor, "a3", "a0"),
    "point to the ground": _ground(pn.PointAnchor, "b2"),
    "point along y": _anchor(lambda f, g: pn.PointAnchor(f, g, axes="y"), "a3", "c3"),
    "point across y": _anchor(lambda f, g: pn.PointAnchor(f, g, axes="xz"), "c3", "b2"),
    "frame between trees": _anchor(pn.FrameAnchor, "a3", "b2"),
    "frame to the ground": _ground(pn.FrameAnchor, "a1"),
    "hinge between trees": _anchor(pn.HingeAnchor, "a3", "b2"),
    "hinge about x": _anchor(lambda f, g: pn.HingeAnchor(f, g, axis="x"), "a3", "b1"),
    "hinge about a general axis": _anchor(lambda f, g: pn.HingeAnchor(f, g, axis=AXIS), "b2", "a2"),
    "hinge to the ground": _ground(lambda f: pn.HingeAnchor(f, axis=AXIS), "b2"),
    "distance": _distance(lambda now: None),
    "distance sinusoid": _distance(lambda now: pn.sinusoid(0.1 * now, 3.0, offset=now)),
    "distance polynomial": _distance(lambda now: pn.polynomial([now, 0.2, -0.1, 0.05])),
    "distance spline": _distance(
        lambda now: pn.spline([-1.0, 0.5, 1.0, 2.0], [now, 1.2 * now, now, 0.9 * now])
    ),
    "distance function": _distance(lambda now: lambda t: (now + 0.1 * t * t, 0.2 * t, 0.2)),
    "distance to the ground": _ground(lambda f: pn.Distance(f, length=0.4), "a3"),
    "coupling": _joints(pn.JointCoupling("a3", "b2", 0.7, 0.1)),
    "coupling of endless joints": _joints(pn.JointCoupling("c1", "a1", -1.5, 0.2)),
    "motion": _joints(pn.PrescribedMotion("a1", pn.sinusoid(0.4, 2.0, 0.3, 0.1))),
    "motion of an endless joint": _joints(pn.PrescribedMotion("c1", pn.polynomial([0.2, 4.0]))),
    "motion of a helical joint": _joints(pn.PrescribedMotion("c2", _wobble)),
    "knife edge": _joints(pn.KnifeEdge("b2 tip", axis=AXIS)),
    "disk on the ground": _on_plane(_disk(AXIS), "a0", None, _leaning(AXIS)),
    "sphere on the ground": _on_plane(_disk(None), "a0", None, 0.3),
    "disk on a moving plane": _on_plane(_disk("y"), "a3", "b2", _leaning((0.0, 1.0, 0.0))),
    "sphere on a moving plane": _on_plane(_disk(None), "a3", "b2", 0.3),
    "point on a moving plane": _on_plane(_contact(0.0), "a3", "b2", 0.0),
    "ball on a moving plane": _on_plane(_contact(0.2), "c3", "a3", 0.2),
    "ball on the ground": _on_plane(_contact(0.2), "a1", None, 0.2),
    "user": _user,
}


def parallel_cranks(radius=0.3, mass=1.0, **keywords):
    """Return a bar on three equal cranks in the x-z plane, closed by point anchors on x and z.

    One of the four rows is redundant while the cranks are parallel, which holds on the constraints only.
    """
    model = pin.Model()
    model.name = "parallel cranks"
    rod = pin.Inertia(mass, np.array([0.0, 0.0, radius / 2]), np.diag([1e-3, 1e-3, 1e-4]))
    bar = pin.Inertia(2.0 * mass, np.array([0.5, 0.0, 0.0]), np.diag([1e-4, 0.2, 0.2]))

    def frame(name, joint, x, z):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, z]))
        model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME))

    for k in range(3):
        place = pin.SE3(np.eye(3), np.array([0.5 * k, 0.0, 0.0]))
        joint = model.addJoint(0, pin.JointModelRY(), place, f"crank{k}")
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
        frame(f"tip{k}", joint, 0.0, radius)
        if k == 0:
            on_tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, radius]))
            joint = model.addJoint(joint, pin.JointModelRY(), on_tip, "bar")
            model.appendBodyToJoint(joint, bar, pin.SE3.Identity())
            frame("bar1", joint, 0.5, 0.0)
            frame("bar2", joint, 1.0, 0.0)
    anchors = [pn.PointAnchor(f"bar{k}", f"tip{k}", axes="xz", name=f"pin {k}") for k in (1, 2)]
    q, v = np.array([0.4, -0.4, 0.4, 0.4]), np.array([2.0, -2.0, 2.0, 2.0])
    return pn.Scene(model, constraints=anchors, q0=q, v0=v, **keywords)
