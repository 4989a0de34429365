"""Joints in loops that hold by static friction stay at rest in time steps while other bodies move."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.types import Array

GRAVITY, MASS = 9.81, 2.0
PIN = np.array([0.3, 0.02, 0.01])  # of each body, from its center of mass [m]


def pendulums(axis: Array, ratio: float, load: float, grounded: bool) -> pn.Scene:
    """Return two level bodies at hinge anchors: friction holds the first one, and the second one swings.

    Args:
        axis: axis of the hinges, (3,).
        ratio: static over kinetic friction.
        load: moment of gravity about the axis over kinetic friction.
        grounded: whether a third body lies on the ground.
    """
    model = pin.Model()
    for k in range(3 if grounded else 2):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"body{k}")
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(MASS, 0.1, 0.2, 0.3), pin.SE3.Identity())
        for name, parent, place in (("b", joint, PIN), ("w", 0, PIN + 2.0 * k * np.eye(3)[0])):
            place = pin.SE3(np.eye(3), place)
            model.addFrame(pin.Frame(f"{name}{k}", parent, 0, place, pin.FrameType.OP_FRAME))
    q = pin.neutral(model)
    q[[7 * k for k in range(model.nbodies - 1)]] = 2.0 * np.arange(model.nbodies - 1)
    moment = abs(axis @ np.cross(-PIN, [0.0, 0.0, -GRAVITY * MASS]))
    ground = [pn.PointContact("b2", height=PIN[2], mu=0.5)] if grounded else []
    if grounded:
        ground += [
            pn.PointContact("b2", offset=(x, y, 0.0), height=PIN[2], mu=0.5)
            for x, y in ((-0.6, 0.0), (-0.3, 0.4))
        ]
    return pn.Scene(
        model,
        constraints=[pn.HingeAnchor(f"w{k}", f"b{k}", axis=tuple(axis), name=f"hinge{k}") for k in range(2)],
        laws=[pn.JointFriction("hinge0", coulomb=moment / load, static_ratio=ratio)],
        contacts=ground,
        q0=q,
    )


@pytest.mark.parametrize("grounded", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_a_hinge_that_static_friction_holds(seed: int, grounded: bool) -> None:
    rng = np.random.default_rng(seed)
    axis, ratio = rng.standard_normal(3), rng.uniform(1.2, 3.0)
    load = rng.uniform(1.05, 0.97 * ratio)
    scene = pendulums(axis / np.linalg.norm(axis), ratio, load, grounded)
    run = pn.simulate(scene, 0.2, method="moreau", dt=1e-3)
    assert np.abs(run.q[-1, :7] - run.q[0, :7]).max() < 1e-12
    assert np.abs(run.q[-1, 7:14] - run.q[0, 7:14]).max() > 1e-3  # the other body swings
    assert not [event for event in run.events if event.kind == "slip"]


@pytest.mark.parametrize("grounded", [False, True])
def test_a_hinge_that_static_friction_does_not_hold(grounded: bool) -> None:
    scene = pendulums(np.array([0.0, 1.0, 0.0]), 1.5, 1.6, grounded)
    exact = pn.simulate(scene, 0.2, rtol=1e-10)
    run = pn.simulate(scene, 0.2, method="moreau", dt=1e-3)
    assert np.abs(exact.q[-1, :7] - exact.q[0, :7]).max() > 1e-2
    np.testing.assert_allclose(run.q[-1], exact.q[-1], atol=1e-4)
