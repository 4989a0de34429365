"""Random mechanisms by seed: friction in couplings, ball anchors and joints of several velocities."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from .random_trees import attach, place_of, tree

SINGLE = ("revolute x", "revolute unaligned", "prismatic y", "helical z", "endless z")
SEVERAL = ("universal", "planar", "translation", "spherical", "free flyer")
WIDE = 0.07  # radius for rotations [m]
MOVES = 1e-9  # least speed, if all coordinates begin with 1 rad/s or 1 m/s


@dataclass
class Places:
    """Scene with a consistent initial state, as `Mechanism`, with loads of the elements.

    Attributes:
        scene: the scene.
        q: configuration, (nq,).
        v: velocity on the constraints, (nv,).
        slips: maps the name of each element to a function (data, v) -> slip velocity.
        places: argument of `Conditions`.
    """

    scene: pn.Scene = None
    q: np.ndarray = None
    v: np.ndarray = None
    slips: dict = field(default_factory=dict)
    places: dict = field(default_factory=dict)


def places(seed):
    """Return the mechanism of a seed: the first one of its draws that can move."""
    for further in range(100):
        made = _drawn(seed, np.random.default_rng([seed, further] if further else seed))
        if np.abs(made.scene.project(made.q, np.ones_like(made.v))[1]).max() > MOVES:
            return made
    raise AssertionError("no mechanism with a freedom")


def _drawn(seed, rng):
    """Return a mechanism, whose constraints may leave no freedom."""
    closed = bool(rng.random() < 0.4)
    kinds = [*rng.choice(SINGLE, rng.integers(2, 4)), *rng.choice(SEVERAL[:-1], rng.integers(1, 3))]
    rng.shuffle(kinds)
    if rng.random() < 0.15:
        kinds[0] = "free flyer"
    model = tree(kinds, rng, parents=range(len(kinds)) if closed else None)
    q = pin.integrate(model, pin.neutral(model), rng.normal(0.0, 0.7, model.nv))
    constraints = []
    single = [model.names[j] for j in range(1, model.njoints) if model.joints[j].nv == 1]
    if len(single) > 1:
        one, two = rng.choice(single, 2, replace=False)
        ratio = rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.0)
        constraints.append(pn.JointCoupling(str(one), str(two), ratio=ratio, name="mesh"))
        q = pn.Scene(model, constraints=constraints).project(q)[0]
    if closed:
        tip = f"j{len(kinds) - 1} tip"
        attach(model, "ground", 0, q, place_of(model, q, tip))
        constraints.append(pn.PointAnchor(tip, "ground", name="ball"))
    model.gravity = pin.Motion(rng.normal(0.0, 6.0, 3), np.zeros(3))
    made, laws = Places(), []
    for j in range(1, model.njoints):
        if rng.random() < 0.8:
            laws.append(_in_joint(made, model, j, rng, closed))
    for c in constraints:
        laws.append(_in_coupling(made, model, c, rng) if c.name == "mesh" else _in_ball(made, model, c, rng))
    made.scene = pn.Scene(model, constraints=constraints, laws=laws, q0=q, name=f"places {seed}")
    v = rng.normal(0.0, 2.0, model.nv) * (rng.random() < 0.7)
    made.q, made.v = made.scene.project(q, v)
    made.slips = {name: made.slips[name] for name in made.scene.element_names}
    return made


def _dry(rng):
    return {
        "coulomb": rng.exponential(0.2),
        "static_ratio": rng.choice([1.0, rng.uniform(1.0, 1.6)]),
        "stribeck_velocity": rng.choice([None, rng.uniform(0.02, 0.5)]),
        "viscous": rng.exponential(0.05) * (rng.random() < 0.3),
        "reaction": str(rng.choice(["total", "total", "total", "ideal"])),
    }


def _in_joint(made, model, j, rng, closed):
    """Add a law to a joint; the oracle has the loads of one-dof joints."""
    kind, first, nv = model.joints[j].shortname(), model.joints[j].idx_v, model.joints[j].nv
    law = f"law {model.names[j]}"
    span = None if closed else rng.choice([None, rng.uniform(0.3, 1.0)])  # ball torque loads adjacent joints
    bearing = {"mu": rng.uniform(0.02, 0.2), "radius": rng.uniform(0.005, 0.04), "span": span}
    lever = 0.0 if span is None else 1.0 / span

    def element(part, dofs, load=None, length=1.0):
        name = f"{law} {part}" if part else law
        made.slips[name] = lambda data, v: length * v[dofs]
        if load is not None:
            made.places[name] = (law, load)

    if nv == 1 or kind == "JointModelSpherical":
        element("", slice(first, first + nv))
    elif kind == "JointModelUniversal":
        for k in range(2):

            def load(instant, wrenches, k=k):
                axis = _axes(model, j, instant.q)[k]
                f = wrenches[j]
                radial, bending = (np.linalg.norm(x - (x @ axis) * axis) for x in (f.linear, f.angular))
                return bearing["mu"] * bearing["radius"] * (radial + lever * bending)

            element(f"axis {k + 1}", slice(first + k, first + k + 1), load)
    elif kind == "JointModelPlanar":

        def load(instant, wrenches):
            f = wrenches[j]
            return bearing["mu"] * (abs(f.linear[2]) + lever * np.linalg.norm(f.angular[:2]))

        bearing["radius"] = WIDE
        element("sliding", slice(first, first + 2), load)
        element("turning", slice(first + 2, first + 3), load, WIDE)
    else:
        bearing = {}
        if kind == "JointModelFreeFlyer":
            bearing = {"radius": WIDE}
            element("sliding", slice(first, first + 3), lambda *_: 0.0)
            element("turning", slice(first + 3, first + 6), lambda *_: 0.0, WIDE)
        else:
            element("", slice(first, first + 3), lambda *_: 0.0)
    return pn.JointFriction(model.names[j], **bearing, **_dry(rng), name=law)


def _axes(model, j, q):
    """Return the axes of a universal joint in its frame."""
    data = model.joints[j].createData()
    model.joints[j].calc(data, q)
    return np.asarray(data.S)[3:].T


def _in_coupling(made, model, c, rng):
    """Add thread friction: fractions a = tan p tan l and b = tan p / tan l of the flank force."""
    d1, d2 = (model.joints[model.getJointId(joint)].idx_v for joint in (c.joint1, c.joint2))
    lead, flank, mu = rng.uniform(0.5, 1.1), rng.uniform(0.0, 0.5), rng.uniform(0.01, 0.06)
    rough = mu / np.cos(flank)
    a, b = rough * np.tan(lead), rough / np.tan(lead)
    row = np.zeros(model.nv)
    row[d1], row[d2] = a / (a + b) / c.ratio, b / (a + b)
    made.slips["law mesh"] = lambda data, v: np.array([row @ v])
    made.places["law mesh"] = ("law mesh", lambda instant, _: (a + b) * abs(c.ratio * instant.lam[0]))
    return pn.JointFriction(
        "mesh", mu=mu, lead_angle=lead, pressure_angle=flank, **_dry(rng), name="law mesh"
    )


def _in_ball(made, model, c, rng):
    """Add friction mu radius |lam| to a ball anchor that closes a loop."""
    frames = [model.getFrameId(f) for f in (c.frame1, c.frame2)]
    mu, radius = rng.uniform(0.02, 0.2), rng.uniform(0.005, 0.04)

    def slip(data, v):
        one, two = (pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[3:] @ v for f in frames)
        return one - two

    made.slips["law ball"] = slip
    made.places["law ball"] = ("law ball", lambda instant, _: mu * radius * np.linalg.norm(instant.lam[-3:]))
    return pn.JointFriction("ball", mu=mu, radius=radius, **_dry(rng), name="law ball")
