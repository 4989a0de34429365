"""Contacts of boxes with spheres, capsules and boxes, against closed forms and Coal's distances."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.mechanisms import GRAVITY, body, empty, frame

# Height of resting corners with edges rounded by a thousandth of the box.
ROUNDED = 2e-3


def place(x=0.0, y=0.0, z=0.0, rpy=(0.0, 0.0, 0.0)):
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array([x, y, z]))


def pair(shape, fixed, at=None, mass=1.0, inertia=0.02, **more):
    """Return a free body of one shape, and another shape fixed in the world."""
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", mass, inertia=inertia * np.eye(3))
    frame(model, "middle", joint)
    geometry.addGeometryObject(pin.GeometryObject("thing", joint, pin.SE3.Identity(), shape))
    geometry.addGeometryObject(pin.GeometryObject("block", 0, at or place(), fixed))
    contact = pn.GeometryContact("thing", "block", **more)
    return pn.Scene(model, contacts=[contact], collision_model=geometry)


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize(
    ("shape", "height"),
    [(coal.Sphere(0.1), 0.1), (coal.Capsule(0.1, 0.4), 0.3), (coal.Box(0.2, 0.3, 0.4), 0.2)],
)
def test_lands_on_top(shape, height, order):
    scene = pair(shape, coal.Box(1.0, 1.2, 0.4), mu=0.5)
    if order:
        contact = pn.GeometryContact("block", "thing", mu=0.5)
        scene = pn.Scene(scene.model, contacts=[contact], collision_model=scene.collision_model)
    run = pn.simulate(scene, 0.4, q=[0.05, -0.03, 0.3 + height, 0, 0, 0, 1], record="forces")
    first = next(event for event in run.events if event.kind == "impact")
    assert first.time == pytest.approx(np.sqrt(0.2 / GRAVITY), abs=1e-10)
    assert run.q[-1, 2] == pytest.approx(0.2 + height, abs=1e-10)
    assert run.lam[-1].sum() == pytest.approx(GRAVITY, abs=1e-9)


def test_a_ball_rolls_down_a_block_and_off_its_edge():
    """On a slope of 0.2 rad the acceleration is 5/7 g sin; the ball leaves at the edge."""
    r, lean = 0.1, 0.2
    scene = pair(
        coal.Sphere(r), coal.Box(2.0, 1.0, 0.2), place(rpy=(0.0, lean, 0.0)), inertia=0.4 * r * r, mu=0.9
    )
    down, up = np.array([np.cos(lean), 0.0, -np.sin(lean)]), np.array([np.sin(lean), 0.0, np.cos(lean)])
    start = -0.5 * down + (0.1 + r) * up
    run = pn.simulate(scene, 2.0, q=[*start, 0, 0, 0, 1])
    on_top = 0.5 * 5.0 / 7.0 * GRAVITY * np.sin(lean)
    before = run.t < np.sqrt(1.5 / on_top)
    along = (run.q[before, :3] - start) @ down
    assert along == pytest.approx(on_top * run.t[before] ** 2, abs=1e-8)
    assert any(event.kind == "lift_off" for event in run.events)
    assert run.q[-1, 2] < -1.0


@pytest.mark.parametrize("mu", [0.2, 0.4])
def test_a_box_on_a_leaning_box(mu):
    """At 0.3 rad the box slides if tan 0.3 > mu, else it sticks."""
    lean = 0.3
    scene = pair(coal.Box(0.2, 0.2, 0.1), coal.Box(2.0, 1.0, 0.2), place(rpy=(0.0, lean, 0.0)), mu=mu)
    up = np.array([np.sin(lean), 0.0, np.cos(lean)])
    q = [*(0.15 * up), *pin.Quaternion(pin.rpy.rpyToMatrix(0.0, lean, 0.0)).coeffs()]
    now = scene.solve(np.array(q), np.zeros(6))
    slides = max(0.0, GRAVITY * (np.sin(lean) - mu * np.cos(lean)))
    assert now.a[0] == pytest.approx(slides, abs=1e-10)
    run = pn.simulate(scene, 0.5, q=q)
    moved = (run.q[-1, :3] - q[:3]) @ np.array([np.cos(lean), 0.0, -np.sin(lean)])
    assert moved == pytest.approx(0.125 * slides, abs=1e-9)


def test_a_long_box_rests_across_the_edges_of_a_narrow_one():
    """Edges cross: four contact points carry the box, none of them a corner of the upper box."""
    scene = pair(coal.Box(1.0, 0.1, 0.1), coal.Box(0.3, 1.0, 0.2), mu=0.5)
    run = pn.simulate(scene, 1.0, q=[0.02, 0.0, 0.15, 0, 0, 0, 1], record="forces")
    assert np.abs(run.v[-1]).max() < 1e-12
    assert run.q[-1, 2] == pytest.approx(0.15, abs=1e-10)
    assert run.lam[-1].sum() == pytest.approx(GRAVITY, abs=1e-9)


@pytest.mark.parametrize("reach", [-1.0, 1.0])
def test_a_box_tips_over_the_edge(reach):
    """The center is slightly inside or outside of the support."""
    scene = pair(coal.Box(0.4, 0.2, 0.1), coal.Box(1.0, 1.0, 0.2), mu=0.5)
    q = [0.5 + reach * ROUNDED, 0.0, 0.15, 0, 0, 0, 1]
    now = scene.solve(np.array(q), np.zeros(6))
    assert (abs(now.a[4]) > 1e-6) is np.bool_(reach > 0.0)


def distance(run, k, shape, fixed):
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    at = pin.XYZQUATToSE3(run.q[k])
    one = coal.Transform3s(at.rotation, at.translation)
    return coal.distance(shape, one, fixed, coal.Transform3s(), request, result)


@pytest.mark.parametrize("seed", range(9))
def test_tumbling_bodies_do_not_enter_a_box(seed):
    """Penetration stays below 1e-8 m by Coal's distance of boxes without their rounding."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.1, 0.5, 3)
    shape = (coal.Sphere(0.1), coal.Capsule(0.06, 0.3), coal.Box(*size))[seed % 3]
    fixed, r = np.array([0.6, 0.5, 0.4]), 0.0
    scene = pair(shape, coal.Box(*fixed), mu=0.4, restitution=0.4)
    if isinstance(shape, coal.Box):
        r = 1e-3 * min(*size, *fixed)
        shape = coal.Box(*(size - 2.0 * r))
    solid = coal.Box(*(fixed - 2.0 * r))
    toward = rng.normal(size=3)
    toward /= np.linalg.norm(toward)
    turn = pin.Quaternion(pin.exp3(rng.normal(size=3)))
    v = np.concatenate([turn.toRotationMatrix().T @ (6.0 * toward), rng.normal(size=3) * 4.0])
    run = pn.simulate(scene, 0.4, q=np.concatenate([-1.5 * toward, turn.coeffs()]), v=v, output_dt=0.002)
    assert any(event.kind == "impact" for event in run.events)
    assert min(distance(run, k, shape, solid) for k in range(len(run.t))) > 2.0 * r - 1e-8


def test_bad_rounding():
    with pytest.raises(pn.InputError, match="rounding must be less than half the least edge"):
        pair(coal.Box(0.2, 0.3, 0.4), coal.Box(1.0, 1.0, 1.0), rounding=0.1)
    with pytest.raises(pn.InputError, match="each edge of size must be longer than twice radius2"):
        pn.BoxContact("a", "b", (0.1, 0.2, 0.3), 0.1, 0.06)
