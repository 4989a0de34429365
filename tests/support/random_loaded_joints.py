"""One to three random joints in motion with load-dependent friction.

The joints are drawers (|m| over a span), journals (radial, bending and axial load), plain hinges and ball
joints in a tree, or hinge anchors between floating bodies.  Coefficients range from dry bearings to the
Painleve paradox.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from .mechanisms import GRAVITY, body, frame


def random_scene(rng, kind=None):
    """Return a scene and a state (q, v) in which every friction element slips.

    Args:
        rng: numpy.random.Generator.
        kind: "tree" or "anchors"; None for a random choice.
    """
    kind = kind or rng.choice(["tree", "tree", "tree", "anchors"])
    count = int(rng.choice([1, 1, 2, 2, 3]))
    model = pin.Model()
    if rng.random() < 0.3:
        model.gravity = pin.Motion(np.zeros(6))
    else:
        model.gravity = pin.Motion(GRAVITY * _unit(rng), np.zeros(3))
    scene = (_tree if kind == "tree" else _anchored)(rng, model, count)
    for _ in range(100):
        v = rng.normal(size=model.nv) * 10.0 ** rng.uniform(-1.0, 0.7)
        q, v = scene.project(_configuration(rng, scene) if kind == "tree" else scene.q0, v)
        if np.abs(v).max() > 1e-2:
            return scene, q, v
    raise AssertionError("no motion was found")


def _unit(rng, n=3):
    x = rng.normal(size=n)
    return x / np.linalg.norm(x)


def _configuration(rng, scene):
    return pin.integrate(scene.model, pin.neutral(scene.model), rng.uniform(-2.0, 2.0, scene.model.nv))


def _place(rng):
    return pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3) * 0.5)


def _inertial(rng):
    spread = rng.uniform(0.2, 1.0, 3) * 10.0 ** rng.uniform(-3.0, 0.0)
    turn = pin.exp3(rng.normal(size=3))
    principal = np.diag(spread[[0, 1, 2]] + spread[[1, 2, 0]])
    return {
        "mass": float(rng.uniform(0.2, 3.0)),
        "lever": rng.normal(size=3) * 10.0 ** rng.uniform(-1.0, 0.4),
        "inertia": turn @ principal @ turn.T,
    }


def _rubbing(rng, joint, kind):
    """Return JointFriction of a kind of bearing."""
    law = {"mu": float(10.0 ** rng.uniform(-1.5, 0.4))}
    if kind != "drawer":
        law["radius"] = float(10.0 ** rng.uniform(-1.5, 0.0))
    if kind in ("drawer", "journal") and rng.random() < 0.8:
        law["span"] = float(10.0 ** rng.uniform(-0.7, 0.5))
    if kind == "journal" and rng.random() < 0.7:
        law["axial_radius"] = float(10.0 ** rng.uniform(-1.5, 0.0))
    if rng.random() < 0.3:
        law["coulomb"] = float(rng.uniform(0.0, 2.0))
    if rng.random() < 0.2:
        law |= {
            "static_ratio": float(rng.uniform(1.0, 2.0)),
            "stribeck_velocity": float(rng.uniform(0.1, 2.0)),
        }
    return pn.JointFriction(joint, **law, name=f"friction of {joint}")


def _tree(rng, model, count):
    kinds = rng.choice(["drawer", "journal", "hinge", "ball"], size=count, p=[0.3, 0.35, 0.15, 0.2])
    joints = list(kinds) + ["free"] * int(rng.integers(0, 3))
    rng.shuffle(joints)
    made = {
        "drawer": lambda: pin.JointModelPrismaticUnaligned(_unit(rng)),
        "journal": lambda: pin.JointModelRevoluteUnaligned(_unit(rng)),
        "hinge": lambda: pin.JointModelRY(),
        "ball": lambda: pin.JointModelSpherical(),
        "free": lambda: pin.JointModelRX() if rng.random() < 0.5 else pin.JointModelPZ(),
    }
    laws, forces, index = [], [], 0
    for k, kind in enumerate(joints):
        parent = index
        while parent and rng.random() < 0.25:  # branch by branch: Pinocchio's crba requires this order
            parent = model.parents[parent]
        name = f"{kind}{k}"
        index = body(model, parent, made[kind](), name, place=_place(rng), **_inertial(rng))
        if kind != "free":
            laws.append(_rubbing(rng, name, kind))
        if rng.random() < 0.6:
            frame(model, f"hook{k}", index, _place(rng))
            forces.append(pn.Wrench(f"hook{k}", list(rng.normal(size=6) * 10.0 ** rng.uniform(-0.5, 1.5))))
    return pn.Scene(model, laws=laws, forces=forces)


def _anchored(rng, model, count):
    """Return a chain of floating bodies, each attached to the previous body by a hinge anchor."""
    laws, anchors, forces, place = [], [], [], _place(rng)
    frame(model, "hinge of world", 0, place)
    last = "hinge of world"
    q0 = []
    for k in range(count):
        index = body(model, 0, pin.JointModelFreeFlyer(), f"body{k}", **_inertial(rng))
        here = _place(rng)  # placement of the hinge in the body
        frame(model, f"pin{k}", index, here)
        at = (
            place
            * pin.SE3(pin.utils.rotate("z", float(rng.uniform(-2.0, 2.0))), np.zeros(3))
            * here.inverse()
        )
        q0.append(pin.SE3ToXYZQUAT(at))
        anchors.append(pn.HingeAnchor(f"pin{k}", last, axis="z", name=f"anchor{k}"))
        laws.append(_rubbing(rng, f"anchor{k}", "journal"))
        if rng.random() < 0.6:
            frame(model, f"hook{k}", index, _place(rng))
            forces.append(pn.Wrench(f"hook{k}", list(rng.normal(size=6) * 10.0 ** rng.uniform(-0.5, 1.5))))
        socket = _place(rng)
        frame(model, f"socket{k}", index, socket)
        last, place = f"socket{k}", at * socket
    return pn.Scene(model, constraints=anchors, laws=laws, forces=forces, q0=np.concatenate(q0))
