"""Contacts with wide gaps are skipped without missing a touch."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support import random_trees
from ....support.mechanisms import GRAVITY, body, empty, frame, hinge
from ....support.same_run import assert_same_run
from ....support.seeds import seeds

INSTANT = 1e-9  # relative error of a time


def flying(contacts, q0, v0, gravity=GRAVITY):
    """Return a point of 1 kg that moves along the world axes, and a fixed target."""
    model = empty((0.0, 0.0, -gravity))
    joint = body(model, 0, pin.JointModelTranslation(), "point", 1.0)
    frame(model, "tip", joint)
    frame(model, "target", 0)
    return pn.Scene(model, contacts=contacts, q0=q0, v0=v0)


def first(run, kind="impact"):
    return next((e.time for e in run.events if e.kind == kind), None)


@pytest.mark.parametrize("height", [1e-3, 1.0, 1e2, 1e4])
@pytest.mark.parametrize("speed", [-300.0, 0.0, 50.0])
def test_a_fall_ends_on_the_floor(height, speed):
    """Other contacts with wide gaps have no effect."""
    floor = pn.PointContact("tip")
    others = [pn.PointContact("tip", height=-1e5 * (k + 1), name=f"below {k}") for k in range(5)]
    scene = flying([*others, floor], [0.0, 0.0, height], [0.0, 0.0, speed])
    ends = (speed + np.sqrt(speed**2 + 2.0 * GRAVITY * height)) / GRAVITY
    run = pn.simulate(scene, 1.5 * ends)
    assert first(run) == pytest.approx(ends, rel=INSTANT)


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4"])
@pytest.mark.parametrize("miss", [-1e-6, 1e-6])
def test_a_fast_point_grazes_a_small_ball(method, miss):
    """The ball has a diameter of 1 mm and 100 m distance; the point has 1 km/s."""
    radius = 0.5e-3
    ball = pn.SphereContact("target", "tip", radius)
    scene = flying([ball], [-100.0, radius + miss, 0.0], [1e3, 0.0, 0.0], gravity=0.0)
    more = {"dt": 1e-3} if method == "rk4" else {}
    run = pn.simulate(scene, 0.2, method=method, **more)
    if miss > 0.0:
        assert run.events == []
    else:
        ends = (100.0 - np.sqrt(radius**2 - (radius + miss) ** 2)) / 1e3
        assert first(run) == pytest.approx(ends, rel=INSTANT)


def test_a_long_arm_comes_round():
    """The tip is far from the plane most of the time, and touches it once in each turn."""
    model = empty((0.0, 0.0, 0.0))
    arm = body(model, 0, hinge(0, 1, 0), "arm", 1.0, inertia=np.eye(3))
    frame(model, "tip", arm, pin.SE3(np.eye(3), np.array([10.0, 0.0, 0.0])))
    frame(model, "near", arm, pin.SE3(np.eye(3), np.array([1e-3, 0.0, 0.0])))
    plane = -9.999
    contacts = [pn.PointContact(name, height=plane, restitution=1.0) for name in ("near", "tip")]
    run = pn.simulate(pn.Scene(model, contacts=contacts, v0=[1.0]), 30.0)
    strikes = [e.time for e in run.events if e.kind == "impact"]
    there = np.arcsin(-plane / 10.0)
    assert strikes[0] == pytest.approx(there, rel=INSTANT)
    np.testing.assert_allclose(np.diff(strikes), np.pi + 2.0 * there, rtol=INSTANT)


def far_shapes(count):
    """Return a ball over a floor, and `count` other shapes that stay far away."""
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    ball = body(model, 0, pin.JointModelFreeFlyer(), "ball", 1.0, inertia=0.02 * np.eye(3))
    shapes = [coal.Sphere(0.25), coal.Box(0.5, 0.4, 0.3), coal.Cylinder(0.2, 0.4), coal.Cone(0.2, 0.4)]
    geometry.addGeometryObject(pin.GeometryObject("ball", ball, pin.SE3.Identity(), coal.Sphere(0.1)))
    geometry.addGeometryObject(pn.ground("floor"))
    contacts = [pn.GeometryContact("ball", "floor", mu=0.5, restitution=0.6)]
    for k in range(count):
        at = pin.SE3(np.eye(3), np.array([3.0 + k % 20, float(k // 20), 0.3]))
        geometry.addGeometryObject(pin.GeometryObject(f"far {k}", 0, at, shapes[k % len(shapes)]))
        contacts.append(pn.GeometryContact("ball", f"far {k}", mu=0.5))
    start = {"q0": [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], "v0": [0.3, 0.0, 0.0, 1.0, 2.0, 3.0]}
    return pn.Scene(model, contacts=contacts, collision_model=geometry, **start)


@pytest.mark.parametrize("count", [4, 40, 400])
def test_pairs_that_are_far_change_no_bit(count):
    """The motion of the ball is bitwise the same without the far shapes."""
    alone, among = (pn.simulate(far_shapes(k), 3.0) for k in (0, count))
    np.testing.assert_array_equal(alone.t, among.t)
    np.testing.assert_array_equal(alone.q, among.q)
    np.testing.assert_array_equal(alone.v, among.v)
    assert [(e.time, e.kind) for e in alone.events] == [(e.time, e.kind) for e in among.events]
    assert alone.stats.steps == among.stats.steps


def test_resumed_among_far_ones(kept, tmp_path):
    """A run among far shapes that is resumed in flight or at rest is bitwise the same."""
    path, scene = tmp_path / "run", far_shapes(40)
    alone = pn.simulate(scene, 2.0)
    assert_same_run(alone, pn.simulate(scene, 2.0, checkpoint=path, checkpoint_interval=0.0))
    states = list(kept)
    for k in np.linspace(0, len(states) - 1, 12).astype(int):
        path.write_bytes(states[k])
        assert_same_run(alone, pn.resume(path, scene, checkpoint_interval=1e9))


KINDS = ("revolute y", "revolute unaligned", "prismatic z", "helical x", "planar", "spherical", "free flyer",
         "translation", "universal", "endless z")  # fmt: skip
TIMES = np.linspace(0.0, 1.5, 3001)  # sample times of the oracle [s]
ALIKE = 1e-6  # difference of two runs at a tolerance of 1e-9 [m or rad]


def random_contacts(model, q, rng, count):
    """Return points, balls and stops around a tree with small or wide gaps, and the gaps by Pinocchio."""
    data = model.createData()
    names = [f.name for f in model.frames if f.name.endswith("tip")]
    index = model.getFrameId

    def height(a, b, n, at):
        def gap(data, q):
            A, B = data.oMf[index(a)], (data.oMf[index(b)] if b else pin.SE3.Identity())
            return (B.rotation @ n) @ (A.translation - B.translation) - at

        return gap

    def apart(a, b, size):
        return lambda data, q: (
            np.linalg.norm(data.oMf[index(a)].translation - data.oMf[index(b)].translation) - size
        )

    pin.framesForwardKinematics(model, data, q)
    contacts, gaps = [], []
    for k in range(count):
        wide = float(10.0 ** rng.uniform(-3.0, 1.5))
        a, b = rng.choice(names, 2, replace=False)
        kind = rng.integers(4)
        if kind == 0 or kind == 1:
            n = rng.standard_normal(3)
            n /= np.linalg.norm(n)
            b = b if kind == 1 else None
            at = height(a, b, n, 0.0)(data, q) - wide
            contacts.append(pn.PointContact(a, plane=b, normal=tuple(n), height=at, mu=0.3, name=f"c{k}"))
            n = np.array(contacts[-1].normal)
            gaps.append(height(a, b, n, at))
        elif kind == 2:
            size = apart(a, b, 0.0)(data, q) - min(wide, 0.1)
            if size <= 0.0:
                continue
            contacts.append(pn.SphereContact(a, b, size, mu=0.3, name=f"c{k}"))
            gaps.append(apart(a, b, size))
        else:
            joint = int(rng.integers(1, model.njoints))
            if model.joints[joint].nq != 1:
                continue
            at = model.joints[joint].idx_q
            contacts.append(pn.JointLimit(model.names[joint], upper=q[at] + wide, lower=-1e3, name=f"c{k}"))
            gaps.append(lambda data, q, at=at, stop=q[at] + wide: stop - q[at])
    return contacts, gaps


@pytest.mark.parametrize("seed", seeds(range(16), count=5))
def test_the_first_of_many_touches(seed):
    """The first touch agrees with the motion without contacts, sampled each 0.5 ms: no gap closes before
    the first touch, and one closes there.
    """
    rng = np.random.default_rng(seed)
    model = random_trees.tree(rng.choice(KINDS, int(rng.integers(2, 6))).tolist(), rng, gravity=False)
    q, v = random_trees.state(model, rng, speed=float(10.0 ** rng.uniform(-1.0, 1.0)), spread=0.5)
    contacts, gaps = random_contacts(model, q, rng, 30)
    tight = {"q": q, "v": v, "rtol": 1e-9, "atol": 1e-9}
    free = pn.simulate(pn.Scene(model), TIMES[-1], record="dense", **tight)
    data = model.createData()

    def widths(t):
        states = free.at(t).q
        out = np.empty((len(states), len(gaps)))
        for row, state in zip(out, states, strict=True):
            pin.framesForwardKinematics(model, data, state)
            row[:] = [gap(data, state) for gap in gaps]
        return out

    below = (widths(TIMES) < 0.0).any(axis=1)
    end = TIMES[int(below.argmax())] if below.any() else TIMES[-1]
    try:
        run = pn.simulate(pn.Scene(model, contacts=contacts), end, **tight)
    except pn.RunError as error:  # the motion after the touch is not tested
        run = error.trajectory
    touch = first(run)
    assert (touch is not None) or not below.any()
    if touch is not None:
        assert not below[touch - INSTANT > TIMES].any()
        assert np.abs(widths([touch])).min() < ALIKE


def tied(away):
    """Return two bodies on slides with a rod between them, at a distance from the origin, and one foot."""
    model = empty()
    for name, x in (("foot", 0.0), ("head", 0.5)):
        here = pin.SE3(np.eye(3), np.array([away + x, 0.0, 0.0]))
        joint = body(model, 0, pin.JointModelPZ(), f"slide of {name}", 1.0, place=here)
        frame(model, name, joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.6 * x])))
    rod = pn.Distance("foot", "head", length=float(np.hypot(0.5, 0.3)))
    return pn.Scene(model, constraints=[rod], contacts=[pn.PointContact("foot")])


@pytest.mark.parametrize("speed", [0.0, -0.5])
@pytest.mark.parametrize("away", [0.0, 100.0])
def test_what_touches_at_the_start_does_not_depend_on_runs_before(away, speed):
    """An initial gap within 1e-10 of the distance from the origin is closed, whatever ran before."""
    gap = 0.5e-10 * max(1.0, away)
    scene = tied(away)
    assert scene.solve([gap, gap], [0.0, 0.0]).closed.all()
    first, again = (pn.simulate(scene, 0.1, q=[gap, gap], v=[speed, speed]) for _ in range(2))
    assert_same_run(first, again)
    assert_same_run(first, pn.simulate(tied(away), 0.1, q=[gap, gap], v=[speed, speed]))
    assert first.closed[-1].all()
    assert [(e.time, e.kind) for e in first.events] == [(0.0, "impact")] * (speed < 0.0)
