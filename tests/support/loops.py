"""Overconstrained and driven mechanisms, by seed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from .mechanisms import body, empty, frame, hinge
from .random_trees import attach, place_of, tree

ROD = np.diag([2e-4, 5e-3, 5e-3])


def at(x: Any, rpy: Any = (0.0, 0.0, 0.0)) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(x, dtype=float))


def bennett(seed: int) -> pn.Scene:
    """Bennett linkage: four hinges with link lengths and twists a, alpha, b, beta, sin alpha/a = sin beta/b.

    The linkage moves with constant tan(th1/2) tan(th2/2), although six rows constrain three joints.
    """
    rng = np.random.default_rng(seed)
    alpha, beta, a = rng.uniform(0.4, 1.2), rng.uniform(1.5, 2.5), rng.uniform(0.2, 0.5)
    b = a * np.sin(beta) / np.sin(alpha)
    links = [at((a, 0, 0), (alpha, 0, 0)), at((b, 0, 0), (beta, 0, 0))] * 2
    model, joint, place = empty((0.0, 0.0, 0.0)), 0, pin.SE3.Identity()
    for k, link in enumerate(links[:3]):
        lever = 0.5 * link.translation
        joint = body(
            model,
            joint,
            pin.JointModelRZ(),
            f"hinge{k}",
            rng.uniform(0.5, 2.0),
            place=place,
            lever=lever,
            inertia=0.01 * np.eye(3),
        )
        place = link
    frame(model, "tip", joint, links[2])
    frame(model, "ground", 0, links[3].inverse())
    th1 = rng.uniform(0.5, 2.0)
    q = min(
        (
            np.array([th1, 2.0 * np.arctan(K / np.tan(0.5 * th1)), -th1])
            for ratio in [np.sin(0.5 * (beta + alpha)) / np.sin(0.5 * (beta - alpha))]
            for K in (ratio, -ratio, 1.0 / ratio, -1.0 / ratio)
        ),
        key=lambda x: np.linalg.norm(
            pin.log6(place_of(model, x, "tip").actInv(place_of(model, x, "ground"))).linear
        ),
    )
    v = np.array([3.0, 0.0, 0.0])
    loop = pn.HingeAnchor("tip", "ground", axis="z", name="loop")
    return pn.Scene(model, constraints=[loop], q0=q, v0=v, name=f"Bennett {seed}")


def side_rods(seed: int) -> pn.Scene:
    """Wheels coupled by parallel rods of one length, with redundant rods, through their dead centers."""
    rng = np.random.default_rng(seed)
    wheels, radius = int(rng.integers(3, 5)), rng.uniform(0.1, 0.3)
    model, anchors = empty((0.0, 0.0, 0.0)), []
    places = np.cumsum(rng.uniform(0.4, 0.8, wheels))
    joints = []
    for k in range(wheels):
        place = at((places[k], 0.0, 0.0))
        joints.append(
            body(model, 0, pin.JointModelRY(), f"wheel{k}", 2.0, place=place, inertia=0.05 * np.eye(3))
        )
        frame(model, f"pin{k}", joints[-1], at((radius, 0.0, 0.0)))
        if k == 0:  # branch by branch, as Pinocchio's algorithms need
            end = at((radius, 0.0, 0.0))
            rod = body(model, joints[0], pin.JointModelRY(), "rod", 1.0, place=end, inertia=ROD)
    for k in range(1, wheels):
        frame(model, f"eye{k}", rod, at((places[k] - places[0], 0.0, 0.0)))
        anchors.append(pn.PointAnchor(f"eye{k}", f"pin{k}", name=f"rod {k}"))
    q = np.full(wheels + 1, 0.7)
    q[model.joints[rod].idx_q] = -0.7
    v = np.sign(q) * 5.0
    return pn.Scene(model, constraints=anchors, q0=q, v0=v, name=f"side rods {seed}")


def cardan(seed: int, driven: bool = True) -> pn.Scene:
    """Two Cardan joints in series with parallel or mirrored outer shafts."""
    rng = np.random.default_rng(seed)
    bend = rng.uniform(0.1, 0.6)
    m = np.array([np.cos(bend), np.sin(bend), 0.0])
    out = (
        np.array([1.0, 0.0, 0.0])
        if rng.random() < 0.5
        else np.array([np.cos(2 * bend), np.sin(2 * bend), 0.0])
    )
    pins = [(0.0, 0.0, 1.0), (-m[1], m[0], 0.0), (-m[1], m[0], 0.0), (0.0, 0.0, 1.0)]
    model = empty((0.0, 0.0, -9.81) if rng.random() < 0.5 else (0.0, 0.0, 0.0))

    def solid() -> dict[str, Any]:
        """Return the inertia of a cross or a shaft, with light bodies between heavy bodies."""
        lever = (10.0 ** rng.uniform(-2.0, 0.0), 0.0, 0.0)
        return {
            "mass": 10.0 ** rng.uniform(-3.0, 1.0),
            "lever": lever,
            "inertia": 10.0 ** rng.uniform(-8.0, -1.0) * np.eye(3),
        }

    joint = body(model, 0, hinge(1, 0, 0), "input", **solid())
    first, second = np.array([0.2, 0.0, 0.0]), np.array([0.2, 0.0, 0.0]) + 0.5 * m  # the crosses
    at_bearing = rng.random() < 0.5  # location of the loop closure
    places = [at(first), pin.SE3.Identity(), at(0.5 * m), pin.SE3.Identity()][: 4 if at_bearing else 2]
    for k, place in enumerate(places):
        joint = body(model, joint, hinge(*pins[k]), f"pin{k}", place=place, **solid())
    if at_bearing:
        frame(model, "shaft", joint, at(0.2 * out))
        frame(model, "bearing", 0, at(second + 0.2 * out))
        axis = out
    else:
        frame(model, "shaft", joint, at(0.5 * m))
        joint = body(model, 0, hinge(*out), "output", place=at(second), **solid())
        joint = body(model, joint, hinge(*pins[3]), "pin3", **solid())
        frame(model, "bearing", joint)
        axis = np.array(pins[2])
    held: list[Any] = [pn.HingeAnchor("shaft", "bearing", axis=tuple(axis), name="bearing")]
    rate = rng.uniform(20.0, 80.0)
    if driven:
        held.append(pn.PrescribedMotion("input", pn.polynomial([0.0, rate]), name="drive"))
    return pn.Scene(model, constraints=held, v0=np.eye(5)[0] * rate, name=f"Cardan {seed}")


def drive(seed: int, caster: bool = False) -> pn.Scene:
    """Robot on two driven rolling wheels, and optionally a caster."""
    rng = np.random.default_rng(seed)
    radius, half = rng.uniform(0.05, 0.15), rng.uniform(0.1, 0.3)
    model, held = empty(), []
    base = body(
        model, 0, pin.JointModelPlanar(), "base", 5.0, place=at((0.0, 0.0, radius)), inertia=0.1 * np.eye(3)
    )
    for side, y in (("left", half), ("right", -half)):
        wheel = body(
            model, base, pin.JointModelRY(), side, 0.5, place=at((0.0, y, 0.0)), inertia=2e-3 * np.eye(3)
        )
        frame(model, f"{side} wheel", wheel)
        held.append(pn.Rolling(f"{side} wheel", radius, axis="y", name=f"{side} rolls"))
        held.append(
            pn.PrescribedMotion(side, pn.polynomial([0.0, rng.uniform(0.5, 4.0)]), name=f"{side} motor")
        )
    if caster:
        swivel = body(
            model,
            base,
            pin.JointModelRZ(),
            "swivel",
            0.2,
            place=at((0.3, 0.0, 0.0)),
            inertia=1e-3 * np.eye(3),
        )
        wheel = body(
            model,
            swivel,
            pin.JointModelRY(),
            "roller",
            0.2,
            place=at((-0.06, 0.0, -0.5 * radius)),
            inertia=1e-3 * np.eye(3),
        )
        frame(model, "caster wheel", wheel)
        held.append(pn.Rolling("caster wheel", 0.5 * radius, axis="y", name="caster rolls"))
    v = np.zeros(model.nv)
    for c in held:
        if isinstance(c, pn.PrescribedMotion):
            v[model.joints[model.getJointId(c.joint)].idx_v] = c.function(0.0)[1]
    return pn.Scene(model, constraints=held, v0=v, name=f"drive {seed}")


def linkage(seed: int = 0) -> pn.Scene:
    """Crank-rocker in a vertical plane with a spatial anchor, one row of which is zero."""
    rng = np.random.default_rng(seed)
    lengths = [0.1, 0.3, 0.25] if seed == 0 else rng.uniform(0.2, 0.4, 3)
    model, joint = empty(), 0
    for k, name in enumerate(("crank", "coupler")):
        place = pin.SE3.Identity() if k == 0 else at((lengths[0], 0.0, 0.0))
        lever = (0.5 * lengths[k], 0.0, 0.0)
        joint = body(
            model, joint, hinge(0, -1, 0), name, (0.5, 1.0)[k], place=place, lever=lever, inertia=ROD
        )
    frame(model, "coupler_tip", joint, at((lengths[1], 0.0, 0.0)))
    lever = (0.5 * lengths[2], 0.0, 0.0)
    joint = body(
        model, 0, hinge(0, -1, 0), "rocker", 0.8, place=at((0.3, 0.0, 0.0)), lever=lever, inertia=ROD
    )
    frame(model, "rocker_tip", joint, at((lengths[2], 0.0, 0.0)))
    kinds = (pn.PointAnchor, lambda *f, name: pn.HingeAnchor(*f, axis="y", name=name))
    q = [1.0, -0.5, 1.5]
    loop = kinds[seed % 2]("coupler_tip", "rocker_tip", name="loop")
    return pn.Scene(model, constraints=[loop], q0=q, v0=np.zeros(3), name=f"linkage {seed}")


def started_loop(seed: int, rough: bool = True, stop: float | None = None) -> pn.Scene:
    """A planar four-bar in a turned plane with friction in all hinges, whose crank a drive moves from rest.

    Args:
        seed: seed of lengths, placement, friction and motion.
        rough: whether there is friction.
        stop: time at which the drive stops [s].
    """
    rng = np.random.default_rng(seed)
    model = empty()
    place = at(rng.standard_normal(3), rng.uniform(-1.0, 1.0, 3))
    # Grashof's condition: the crank turns fully.
    crank, coupler, rocker, base = 0.2, *rng.uniform(0.8, 1.0, 3)
    bar = {"inertia": 0.02 * np.eye(3)}
    first = body(model, 0, pin.JointModelRZ(), "crank", 1.0, place=place, lever=(0.1, 0.0, 0.0), **bar)
    second = body(model, first, pin.JointModelRZ(), "coupler", 1.0, place=at((crank, 0.0, 0.0)), **bar)
    pivot = place * at((base, 0.0, 0.0))
    third = body(model, 0, pin.JointModelRZ(), "rocker", 1.0, place=pivot, lever=(0.3, 0.0, 0.0), **bar)
    frame(model, "coupler tip", second, at((coupler, 0.0, 0.0)))
    frame(model, "rocker tip", third, at((rocker, 0.0, 0.0)))
    laws = [
        pn.JointFriction(name, coulomb=rng.uniform(0.01, 0.1), mu=0.1, radius=0.02, span=0.1)
        for name in ("crank", "coupler", "rocker")
    ]
    laws.append(pn.JointFriction("loop", mu=0.1, radius=0.02, span=0.1))
    # No hinge is at rest to first order, as the closing one is while the crank lies along the base.
    start, jerk = rng.uniform(0.5, 2.5), rng.uniform(3.0, 12.0)
    motion: Any = pn.polynomial([start, 0.0, 0.0, jerk / 6.0])
    if stop is not None:
        motion = pn.spline([0.2 * stop, stop], [start, start + 0.1 * jerk])
    driven = pn.PrescribedMotion("crank", motion, name="drive")
    closing = pn.HingeAnchor("coupler tip", "rocker tip", axis="z", name="loop")
    scene = pn.Scene(
        model, constraints=[closing, driven], laws=laws if rough else [], name=f"started loop {seed}"
    )
    return scene.replace(q0=scene.project([start, 1.0 - start, 2.0], np.zeros(3))[0])


def ball_loop(seed: int) -> pn.Scene:
    """Spatial crank, coupler and rocker; the closing ball joint has load-dependent friction."""
    rng = np.random.default_rng(seed)
    model = empty()
    turned = at((0.0, 0.0, 0.0), rng.uniform(-0.5, 0.5, 3))
    crank = body(model, 0, pin.JointModelRZ(), "crank", 1.0, place=turned, lever=(0.1, 0.0, 0.0), inertia=ROD)
    coupler = body(
        model,
        crank,
        pin.JointModelSpherical(),
        "coupler",
        0.7,
        place=at((0.2, 0.0, 0.0)),
        lever=(0.25, 0.01, 0.0),
        inertia=0.01 * np.eye(3),
    )
    frame(model, "coupler_tip", coupler, at((0.5, 0.0, 0.0)))
    turned = at((0.5, 0.1, 0.1), rng.uniform(-0.5, 0.5, 3))
    rocker = body(
        model, 0, pin.JointModelRX(), "rocker", 1.0, place=turned, lever=(0.0, 0.0, 0.2), inertia=ROD
    )
    frame(model, "rocker_tip", rocker, at((0.0, 0.0, 0.4)))
    mu = rng.uniform(0.5, 1.0)
    laws = [
        pn.JointFriction("ball", mu=mu, radius=0.1, static_ratio=rng.choice([1.0, 1.3]), name="ball rubs")
    ]
    laws.append(pn.JointFriction("crank", viscous=0.05, name="grease"))
    ball = pn.PointAnchor("coupler_tip", "rocker_tip", name="ball")
    v = rng.normal(0.0, 3.0, model.nv)
    return pn.Scene(
        model, constraints=[ball], laws=laws, q0=pin.neutral(model), v0=v, name=f"ball loop {seed}"
    )


def cart(seed: int) -> pn.Scene:
    """Slow pendulum on a cart that a clamped spline moves by 0.3 m within a short time."""
    rng = np.random.default_rng(seed)
    model = empty()
    joint = body(model, 0, pin.JointModelPX(), "cart", 1.0, inertia=0.01 * np.eye(3))
    length = rng.uniform(0.5, 5.0)
    body(
        model, joint, pin.JointModelRY(), "pendulum", 1.0, lever=(0.0, 0.0, -length), inertia=0.01 * np.eye(3)
    )
    begin, within = rng.uniform(1.0, 3.0), 10.0 ** rng.uniform(-2.0, 0.0)
    move = pn.spline([begin, begin + within], [0.0, 0.3])
    held = [pn.PrescribedMotion("cart", move, name="drive")]
    return pn.Scene(model, constraints=held, q0=[0.0, 0.1], name=f"cart {seed}")


def chain(seed: int) -> pn.Scene:
    """Spatial chain closed by an anchor of any kind, without friction."""
    rng = np.random.default_rng(seed)
    kinds = [
        str(k)
        for k in rng.choice(["revolute x", "revolute unaligned", "prismatic y", "helical z", "universal"], 8)
    ]
    model = tree(kinds, rng, parents=range(len(kinds)))
    q = pin.integrate(model, pin.neutral(model), rng.normal(0.0, 0.7, model.nv))
    tip = f"j{len(kinds) - 1} tip"
    attach(model, "ground", 0, q, place_of(model, q, tip))
    kind = (pn.PointAnchor, pn.FrameAnchor, pn.HingeAnchor)[seed % 3]
    v = rng.normal(0.0, 1.0, model.nv)
    return pn.Scene(
        model, constraints=[kind(tip, "ground", name="closure")], q0=q, v0=v, name=f"chain {seed}"
    )
