"""Bodies with slow slip onset, and their references from `oracles.slow_slip`."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import pin_nonideal as pn
from oracles.slow_slip import Ball, Plate

from .mechanisms import body, empty, frame

MASS, INERTIA = 10.0, 0.3  # plate [kg, kg m^2]
LEVER = 0.02  # mu radius of a ball joint [m]


def star(feet, height=0.3):
    """Return feet at equal spacing on a circle below the center of mass."""
    angle = np.arange(feet) * 2.0 * np.pi / feet
    return np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), np.full(feet, -height)])


def plate(feet, mu, wrench, at, ratio=1.0, unilateral=True, **more):
    """Return a body on feet, and its oracle."""
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "plate", MASS, inertia=INERTIA * np.eye(3))
    names = [f"foot {k}" for k in range(len(feet))]
    for name, place in zip([*names, "pulled"], [*feet, at], strict=True):
        frame(model, name, joint, pin.SE3(np.eye(3), np.array(place, dtype=float)))
    q0 = pin.neutral(model)
    q0[2] = -feet[0][2]
    contacts = [pn.PointContact(name, mu=mu, static_ratio=ratio, unilateral=unilateral) for name in names]
    scene = pn.Scene(model, contacts=contacts, forces=[pn.Wrench("pulled", wrench)], q0=q0, **more)
    return scene, Plate(feet, mu, wrench, at, MASS, INERTIA, pulls=not unilateral)


def planar_state(run):
    """Return x, y and angle of a plate and their rates in world axes, at the end of a run."""
    turn = Rotation.from_quat(run.q[-1, 3:7])
    return np.concatenate(
        [run.q[-1, :2], [turn.as_rotvec()[2]], turn.apply(run.v[-1, :3])[:2], run.v[-1, 5:]]
    )


def balls(links, ratio=1.0, pull=2.0):
    """Return a hanging chain of ball joints with load-dependent friction and a varying force at its end."""
    model, joint = empty(), 0
    for k in range(links):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3 * (k > 0)]))
        inertia, lever = 0.02 * np.eye(3), (0.02, 0.01, -0.15)
        joint = body(
            model,
            joint,
            pin.JointModelSpherical(),
            f"ball {k}",
            1.0,
            place=place,
            lever=lever,
            inertia=inertia,
        )
    frame(model, "end", joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3])))

    def wrench(t):
        return [pull * np.sin(t), pull * t * np.cos(2.0 * t), 0.0, 0.0, 0.0, 0.1 * pull * t]

    laws = [
        pn.JointFriction(f"ball {k}", mu=0.4, radius=LEVER / 0.4, static_ratio=ratio) for k in range(links)
    ]
    return pn.Scene(model, laws=laws, forces=[pn.Wrench("end", wrench)]), wrench


def ball():
    """Return one ball joint with a hanging body, and its oracle."""
    model = empty()
    inertia, lever = np.diag([0.02, 0.03, 0.015]), np.array([0.0, 0.0, -0.15])
    joint = body(model, 0, pin.JointModelSpherical(), "ball", 1.0, lever=lever, inertia=inertia)
    frame(model, "end", joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3])))

    def wrench(t):
        return [0.5 * t, 0.4 * t * np.cos(2.0 * t), 0.0, 0.0, 0.0, 0.1 * t]

    laws = [pn.JointFriction("ball", mu=0.4, radius=LEVER / 0.4)]
    scene = pn.Scene(model, laws=laws, forces=[pn.Wrench("end", wrench)])
    return scene, Ball(1.0, lever, inertia, LEVER, wrench, [0.0, 0.0, -0.3])
