"""Bodies between two pads: they fall freely without friction, and slip out of a gripper with friction."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY
from ...support.seeds import seeds

PAD = (0.1, 0.2, 0.1)  # edges of a pad [m]
# A gap of rounding turns a body that leaves a pad. This is its largest effect on the position [m].
POSITION = 1e-7
# Boxes whose upper corners pass the edges of the pads one after the other by rounding. Capsules whose
# contacts press each other by rounding shortly before they leave the pads. A box that slides through a step
# of time stepping at the edges.
NARROW = (3, 11, 23, 54)
KINDS = ("box", "capsule", "ball")


def shape(draw: np.random.Generator, kind: str) -> tuple[coal.CollisionGeometry, float, float]:
    """Return a shape, its width between the pads and its height [m]."""
    if kind == "box":
        edges = draw.uniform(0.04, 0.12, 3)
        return coal.Box(*edges), edges[0], edges[2]
    radius = draw.uniform(0.02, 0.05)
    if kind == "ball":
        return coal.Sphere(radius), 2.0 * radius, 2.0 * radius
    length = draw.uniform(0.05, 0.12)
    return coal.Capsule(radius, length), 2.0 * radius, length + 2.0 * radius


@pytest.mark.parametrize("pads", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", seeds([*range(40), 54], always=NARROW, count=4))
def test_bodies_fall_freely_beside_pads_without_friction(seed: int, kind: str, pads: int) -> None:
    """The contacts have no load, so their edges change nothing."""
    draw = np.random.default_rng(seed)
    geometry, width, _ = shape(draw, kind)
    model, shapes = pin.Model(), pin.GeometryModel()
    model.gravity.linear[:] = 0.0, 0.0, -GRAVITY
    pn.free_body(model, "body", geometry, mass=1.0, collision_model=shapes)
    for k in range(pads):
        place = np.array([(1 - 2 * k) * (width + PAD[0]) / 2.0, 0.0, 0.0])
        shapes.addGeometryObject(pin.GeometryObject(f"pad{k}", 0, pin.SE3(np.eye(3), place), coal.Box(*PAD)))
    contacts = [pn.GeometryContact("body", f"pad{k}") for k in range(pads)]
    start = np.array([0.0, draw.uniform(-0.08, 0.08), draw.uniform(-0.02, 0.02)]) * (seed % 2)
    scene = pn.Scene(model, contacts=contacts, collision_model=shapes, q0=[*start, 0.0, 0.0, 0.0, 1.0])
    run = pn.simulate(scene, 0.4, max_wall=20.0)
    fall = start - [0.0, 0.0, 0.5 * GRAVITY * 0.4**2]
    np.testing.assert_allclose(run.q[-1, :3], fall, atol=POSITION)
    assert "chatter" not in {e.kind for e in run.events}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", seeds([*range(40), 54], always=NARROW, count=4))
def test_bodies_slip_out_of_a_gripper(seed: int, kind: str) -> None:
    """Pads press with a force P; the body falls with g - 2 mu P / m until it reaches their edges."""
    draw, mu = np.random.default_rng(seed), 0.4
    geometry, width, height = shape(draw, kind)
    mass = draw.uniform(0.2, 1.0)
    press = draw.uniform(0.3, 0.8) * mass * GRAVITY / (2.0 * mu)
    model, shapes = pin.Model(), pin.GeometryModel()
    model.gravity.linear[:] = 0.0, 0.0, -GRAVITY
    contacts: list[object] = []
    for k, side in enumerate((1.0, -1.0)):
        place = pin.SE3(np.eye(3), np.array([side * (width + PAD[0]) / 2.0, 0.0, 0.0]))
        joint = model.addJoint(0, pin.JointModelPX(), place, f"slide{k}")
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(0.3, *PAD), pin.SE3.Identity())
        model.addJointFrame(joint)
        shapes.addGeometryObject(pin.GeometryObject(f"pad{k}", joint, pin.SE3.Identity(), coal.Box(*PAD)))
        stop = {"lower": -0.4 * width} if side > 0.0 else {"upper": 0.4 * width}
        contacts += [pn.GeometryContact("body", f"pad{k}", mu=mu), pn.JointLimit(f"slide{k}", **stop)]
    pn.free_body(model, "body", geometry, mass=mass, collision_model=shapes)
    tau = np.array([-press, press, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    scene = pn.Scene(model, contacts=contacts, collision_model=shapes, actuation=tau)
    run = pn.simulate(scene, 0.6, max_wall=20.0)
    assert run.t[-1] == 0.6
    rate = GRAVITY - 2.0 * mu * press / mass
    out = np.sqrt((PAD[2] + height) / rate) if kind == "box" else np.sqrt(PAD[2] / rate)
    held = run.t < 0.5 * min(0.6, out)
    assert held.sum() > 1
    np.testing.assert_allclose(run.q[held, 4], -0.5 * rate * run.t[held] ** 2, atol=POSITION)
    assert run.q[-1, 4] < run.q[held, 4].min()
