"""Sample cases: all robots, every kind of description, and random mechanisms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from pin_nonideal.description.actuation import EffortLimits, HoldPosition, SampledControl, Table

from . import loops
from .cases import Case, case_of
from .loops import at
from .mechanisms import body, empty, frame
from .random_mechanisms import mechanism
from .random_places import places
from .random_trees import tree
from .row_cases import TREES

DURATIONS = {
    "andrews_squeezer": 0.005,
    "solo12_dropped": 0.4,
    "loaded_joint": 3.5,
    "worm_drive": 4.5,
    "belt_oscillator": 2.0,
    "panda_settling": 0.5,
    "rough_four_bar": 1.0,
}
FALLING = frozenset({"equilibrium"})  # a free body has no equilibrium, and the search is slow
CUBE = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-0.2, 0.2)]
RUBS: dict[str, Any] = {"mu": 0.5, "restitution": 0.3, "name": "it"}


def robot(name: str) -> Case:
    more: dict[str, Any] = {"N": 3} if name == "n_four_bar" else {}
    duration = DURATIONS.get(name, 0.3)
    # These robots have no equilibrium, and `equilibrium` searches for minutes.
    skips = frozenset({"equilibrium"} if name in ("rolling_disk", "slider_crank") else ())
    return case_of(
        pn.load(name, **more), name, duration=duration, dt=min(1e-3, duration / 300.0), skips=skips
    )


# --- Contacts -------------------------------------------------------------------------------------------


def slid(joint: Any) -> tuple[pin.Model, int]:
    """Return a body of 1 kg with frames "body" and "far", and a frame "base" of the world."""
    model = empty()
    k = body(
        model, 0, joint, "floating", 1.0, lever=(0.01, -0.02, 0.0), inertia=np.diag([0.01, 0.012, 0.015])
    )
    frame(model, "body", k)
    frame(model, "far", k, at((0.2, 0.1, 0.05), (0.3, -0.2, 0.1)))
    frame(model, "base", 0, pin.SE3.Identity())
    return model, k


def _gap(t: float, q: Any, v: Any, data: Any) -> tuple[Any, Any]:
    """Return height and row of a body with its position as coordinates."""
    return np.array([[0.0, 0.0, 1.0]]), np.zeros(1)


TOUCHES: dict[type, Callable[[], Any]] = {
    pn.PointContact: lambda: pn.PointContact(
        "body", radius=0.1, height=0.2, torsional=0.01, rolling=0.002, **RUBS
    ),
    pn.SphereContact: lambda: pn.SphereContact("body", "base", 0.1, 0.2, **RUBS),
    pn.CapsuleContact: lambda: pn.CapsuleContact(
        "body",
        "base",
        ((0.0, -0.2, 0.0), (0.0, 0.2, 0.0)),
        ((-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)),
        0.1,
        0.2,
        **RUBS,
    ),
    pn.BoxContact: lambda: pn.BoxContact("body", "base", (2.0, 2.0, 0.4), 0.1, **RUBS),
    pn.EllipsoidContact: lambda: pn.EllipsoidContact("body", (0.4, 0.2, 0.1), height=0.2, **RUBS),
    pn.HullContact: lambda: pn.HullContact("body", "base", CUBE, 0.1, **RUBS),
    pn.CylinderContact: lambda: pn.CylinderContact(
        "body", "base", length=0.4, below=1.0, radius1=0.1, **RUBS
    ),
    pn.RimContact: lambda: pn.RimContact(
        "body", "base", CUBE, 0.09, 0.01, rpy=(0.5 * np.pi, 0.0, 0.0), **RUBS
    ),
    pn.RevolvedContact: lambda: pn.RevolvedContact(
        "body", "base", (0.18, 0.0, 0.1), (0.4, 1.0, 1.0), 0.01, **RUBS
    ),
    pn.JointLimit: lambda: pn.JointLimit("floating", lower=0.3, restitution=0.3, name="it"),
    pn.UserContact: lambda: pn.UserContact(
        _gap, gap=lambda t, q: q[2] - 0.3, directions=lambda t, q: np.eye(3)[:2], **RUBS
    ),
}


def touching(kind: type) -> Case:
    """Return the case of a body that falls by 1 cm on a fixed shape, collides and slides."""
    joint = {pn.JointLimit: pin.JointModelPZ, pn.UserContact: pin.JointModelTranslation}.get(
        kind, pin.JointModelFreeFlyer
    )()
    model, _ = slid(joint)
    q, v = pin.neutral(model), np.zeros(model.nv)
    q[min(2, model.nq - 1)] = 0.31
    v[:3] = (0.2, 0.1, 0.0)[: model.nv]
    if model.nv == 6:
        v[5] = 0.5
    scene = pn.Scene(model, contacts=[TOUCHES[kind]()], q0=q, v0=v, name=kind.__name__)
    return case_of(scene, duration=0.15)


def feet_on_ramp(mu: float) -> Case:
    """Return the case of a body on four feet on a ramp, sticking or sliding, with redundant loads."""
    model, k = slid(pin.JointModelFreeFlyer())
    model.gravity = pin.Motion(np.array([2.5, 1.0, -9.2]), np.zeros(3))
    q, feet = pin.neutral(model), []
    q[2] = 0.05
    for x, y in ((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)):
        frame(model, f"foot {x} {y}", k, at((x, y, -0.05)))
        feet.append(pn.PointContact(f"foot {x} {y}", mu=mu))
    return case_of(pn.Scene(model, contacts=feet, q0=q, name=f"feet on a ramp, mu {mu}"), duration=0.3)


# --- Laws, forces and drives ----------------------------------------------------------------------------


def arm(**more: Any) -> pn.Scene:
    """Return two revolute joints and a slide, at an angle to gravity."""
    model = tree(
        ["revolute x", "revolute unaligned", "prismatic y"], np.random.default_rng(5), parents=range(3)
    )
    frame(model, "post", 0, at((1.0, 0.5, 0.2)))
    start = {"q0": np.array([0.3, -0.4, 0.1]), "v0": np.array([1.0, -0.7, 0.3])}
    return pn.Scene(model, **(start | more))


def _swing(t: float, q: Any, v: Any) -> Any:
    return np.array([0.5 * np.sin(3.0 * t), -0.2, 1.0 + 0.1 * v[1]])


LAWS: dict[type, Callable[[], Any]] = {
    pn.JointFriction: lambda: pn.JointFriction(
        "j1",
        coulomb=0.1,
        mu=0.2,
        radius=0.03,
        span=0.3,
        viscous=0.01,
        static_ratio=1.3,
        stribeck_velocity=0.1,
    ),
    pn.SigmoidFriction: lambda: pn.SigmoidFriction("j0", 0.4, 5.0, 0.1),
    pn.LuGre: lambda: pn.LuGre("j2", 300.0, 1.0, 0.4, stribeck_velocity=0.1),
    pn.Drag: lambda: pn.Drag("j2 tip", 0.3, 1.7),
    pn.UserLaw: lambda: pn.UserLaw(
        lambda t, q, v, r: -0.1 * v * (1.0 + 0.01 * np.linalg.norm(r.wrench("j0")[:3]))
    ),
    pn.UserFriction: lambda: pn.UserFriction(
        lambda t, q: np.array([1.0, -0.5, 0.0]),
        lambda t, q, v, r: 0.1 + 0.01 * np.linalg.norm(r.wrench("j1")[:3]),
    ),
}
FORCES: dict[type, Callable[[], Any]] = {
    pn.SpringDamper: lambda: pn.SpringDamper("j2 tip", "post", 30.0, 0.5, 0.4),
    pn.JointSpring: lambda: pn.JointSpring("j2", 50.0, 0.1, 0.3),
    pn.Wrench: lambda: pn.Wrench("j2 tip", lambda t: [np.sin(t), 1.0, 0.3, 0.1 * t, 0.2, -0.1]),
    pn.UserForce: lambda: pn.UserForce(lambda t, q, v: np.array([-q[0], 0.1 * v[1], np.cos(t)])),
}
DRIVES: dict[str, Callable[[], Any]] = {
    "torques": lambda: np.array([0.3, -0.2, 1.0]),
    "function": lambda: _swing,
    "SampledControl": lambda: SampledControl(_swing, 0.02),
    "HoldPosition": lambda: HoldPosition(20.0, 1.0),
    "Table": lambda: Table([0.0, 0.1, 0.2], [[0.0, 0.0, 0.0], [1.0, -0.5, 2.0], [0.0, 0.0, 0.0]]),
    "EffortLimits": lambda: EffortLimits(HoldPosition(20.0, 1.0), effort=[1.0, 0.5, 2.0]),
}
MOTIONS: dict[str, Callable[[], Any]] = {
    "Constant": lambda: pn.constant(0.3),
    "Sinusoid": lambda: pn.sinusoid(0.3, 4.0, 0.5, 0.1),
    "Polynomial": lambda: pn.polynomial([0.3, 0.5, -1.0, 2.0]),
    "Spline": lambda: pn.spline([0.0, 0.05, 0.12, 0.2], [0.3, 0.35, 0.2, 0.3]),
    "function": lambda: lambda t: (0.3 * np.cos(t), -0.3 * np.sin(t), -0.3 * np.cos(t)),
}
STARTS: dict[str, Callable[[], Any]] = {
    "Polynomial": lambda: pn.polynomial([0.3, 0.0, 0.0, 2.0]),
    "Spline": lambda: pn.spline([0.05, 0.2], [0.3, 0.4]),
    "held": lambda: pn.constant(0.3),
}


def _random(make: Callable[[int], Any], name: str, seed: int, rests: bool = False, **more: Any) -> Case:
    made = make(seed)
    scene = made if isinstance(made, pn.Scene) else made.scene
    case = case_of(scene, f"{name} {seed}", **more)
    if rests:  # a drawn velocity would leave only its rounding
        case = replace(case, drawn=((scene.q0, np.zeros(scene.model.nv)),))
    return (
        case
        if made is scene
        else replace(case, q0=made.q, v0=made.v, drawn=((made.q, made.v), *case.states[1:]))
    )


# --- All of them ----------------------------------------------------------------------------------------

Maker = Callable[[], Case]


def kinds() -> dict[str, Maker]:
    """Return sample robots and kinds of descriptions, by name."""
    made: dict[str, Maker] = {f"robot {name}": lambda name=name: robot(name) for name, _ in pn.robots()}
    for name, build in TREES.items():
        made[f"rows of {name}"] = lambda name=name, build=build: case_of(
            build(np.random.default_rng(3)), name, duration=0.1, skips=FALLING
        )
    for kind in TOUCHES:
        made[f"touching {kind.__name__}"] = lambda kind=kind: touching(kind)
    for mu in (0.2, 0.6):
        made[f"feet on a ramp, mu {mu}"] = lambda mu=mu: feet_on_ramp(mu)
    for group, key, table in (("law", "laws", LAWS), ("force", "forces", FORCES)):
        for kind, d in table.items():
            made[f"{group} {kind.__name__}"] = lambda d=d, key=key: case_of(arm(**{key: [d()]}), duration=0.3)
    for name, d in DRIVES.items():
        made[f"drive {name}"] = lambda d=d: case_of(arm(actuation=d()), duration=0.3)
    for name, f in MOTIONS.items():
        made[f"motion {name}"] = lambda f=f: case_of(
            arm(constraints=[pn.PrescribedMotion("j0", f(), name="drive")]), duration=0.25
        )
    for name, f in STARTS.items():
        made[f"started with friction {name}"] = lambda f=f: case_of(
            arm(
                constraints=[pn.PrescribedMotion("j0", f(), name="drive")],
                laws=[pn.JointFriction("j0", coulomb=0.5)],
                v0=[0.0, -0.7, 0.3],
            ),
            duration=0.25,
            onset=1e-3,
        )
    return made


def random_cases(count: int) -> dict[str, Maker]:
    """Return random mechanisms by seed, `count` of each family."""
    families: dict[str, tuple[Callable[[int], Any], dict[str, Any]]] = {
        "mechanism": (mechanism, {"duration": 0.3}),
        "places": (places, {"duration": 0.2}),
        "chain": (loops.chain, {"duration": 0.3}),
        "Bennett": (loops.bennett, {"duration": 3.0}),
        "side rods": (loops.side_rods, {"duration": 2.0}),
        "driven Cardan": (lambda seed: loops.cardan(seed + 3), {"duration": 1.0, "outputs": 100}),
        "free Cardan": (lambda seed: loops.cardan(seed, driven=False), {"duration": 0.3, "dt": 2e-4}),
        "drive": (loops.drive, {"duration": 20.0}),
        "drive with caster": (lambda seed: loops.drive(seed, caster=True), {"duration": 10.0}),
        "linkage": (loops.linkage, {"duration": 0.5}),
        "started loop": (loops.started_loop, {"duration": 1.0, "rests": True, "onset": 1e-3}),
        "ball loop": (loops.ball_loop, {"duration": 1.5, "outputs": 300}),
        "cart": (loops.cart, {"duration": 6.0}),
    }
    return {
        f"{name} {seed}": lambda name=name, make=make, seed=seed, more=more: _random(make, name, seed, **more)
        for name, (make, more) in families.items()
        for seed in range(count)
    }
