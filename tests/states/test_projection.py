"""The nearest consistent state from far away: beside SciPy's optimizers, in any unit, with copies."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.nearest_closure import distance, nearest_by_search

from ..support.mechanisms import again, body, empty, frame, point_mass
from ..support.seeds import seeds

# Two distances of the same closure: the optimizer's own tolerance.
SAME_DISTANCE = 1e-6
# The same closure in another unit, or with duplicate rows [rad, or part of the length].
SAME = 1e-9


def loop(seed, scale=1.0, copies=1, rows="one"):
    """A random chain whose tip is held to a place that it can reach, and a configuration far from there."""
    rng = np.random.default_rng(seed)
    model, joint = empty(), 0
    n = int(rng.integers(3, 7))
    planar = bool(rng.uniform() < 0.5)
    for k in range(n):
        axis = np.array([0.0, 1.0, 0.0]) if planar else rng.standard_normal(3)
        place = np.array([1.0, 0.0, 0.0]) if planar else rng.standard_normal(3)
        place *= scale * rng.uniform(0.3, 1.0) / np.linalg.norm(place)
        slide = not planar and k and rng.uniform() < 0.2
        kind = pin.JointModelPrismaticUnaligned if slide else pin.JointModelRevoluteUnaligned
        inertia = scale**2 * np.diag(rng.uniform(0.01, 0.1, 3))
        lever = scale * rng.uniform(-0.2, 0.2, 3)
        start = pin.SE3(np.eye(3), place if k else np.zeros(3))
        joint = body(
            model,
            joint,
            kind(axis / np.linalg.norm(axis)),
            f"j{k}",
            rng.uniform(0.5, 2.0),
            place=start,
            lever=lever,
            inertia=inertia,
        )
    place = np.array([0.5, 0.0, 0.0]) if planar else rng.uniform(-0.5, 0.5, 3)
    frame(model, "tip", joint, pin.SE3(np.eye(3), scale * place))
    unit = np.array([scale if "PrismaticU" in j.shortname() else 1.0 for j in list(model.joints)[1:]])
    closed = pin.integrate(model, pin.neutral(model), unit * rng.uniform(-2.0, 2.0, n))
    data = model.createData()
    pin.framesForwardKinematics(model, data, closed)
    pinned = data.oMf[model.getFrameId("tip")].translation.copy()
    frame(model, "pin", 0, pin.SE3(np.eye(3), pinned))
    data = model.createData()  # with room for the new frame
    said = [
        pn.PointAnchor("tip", "pin", axes="xz" if planar else "xyz", name=f"loop{k}") for k in range(copies)
    ]
    if rows == "user":
        said.append(user_rows(model, pinned, 1e3))
    q = pin.integrate(model, closed, unit * rng.uniform(-1.0, 1.0, n) * rng.choice([0.1, 0.5, 1.5]))

    def residual(q):
        pin.framesForwardKinematics(model, data, q)
        return (data.oMf[model.getFrameId("tip")].translation - pinned)[[0, 2] if planar else [0, 1, 2]]

    return pn.Scene(model, constraints=said), q, residual, unit


def user_rows(model, pinned, factor):
    """The anchor once more as a user's rows, in another scale: a copy that only the run can find."""
    data, tip = model.createData(), model.getFrameId("tip")

    def rows(t, q, v, given):
        A = pin.getFrameJacobian(model, given, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        drift = pin.getFrameClassicalAcceleration(model, data, tip, pin.LOCAL_WORLD_ALIGNED).linear
        return factor * A, -factor * drift

    def residual(t, q):
        pin.framesForwardKinematics(model, data, q)
        return factor * (data.oMf[tip].translation - pinned)

    return pn.UserConstraint(rows, 3, residual=residual, name="again")


def check(seed):
    """No start of the optimizer ends nearer; other units and copies of rows end at the same place."""
    scene, q, residual, unit = loop(seed)
    on, _, report = scene.project(q, report=True)
    assert np.abs(residual(on)).max() < 1e-12
    found = distance(scene.model, q, on)
    assert report.distance == pytest.approx(found, rel=1e-9)
    least, _ = nearest_by_search(scene.model, q, residual)
    if report.nearest:
        assert found <= least * (1.0 + SAME_DISTANCE)
    for scale in (1e-3, 1e3):
        other, q_other, _, unit_other = loop(seed, scale)
        moved = other.project(q_other)[0]
        np.testing.assert_allclose(moved / unit_other, on / unit, rtol=0, atol=SAME)
    for twice in (loop(seed, copies=2), loop(seed, rows="user")):
        np.testing.assert_allclose(twice[0].project(q)[0] / unit, on / unit, rtol=0, atol=SAME)
    return report.nearest


# Seed 77: the nearest closure is a third nearer than the one next to the start.
@pytest.mark.parametrize("seed", seeds([*range(12), 77], always=[77], count=4))
def test_random_loops(seed):
    check(seed)


@pytest.mark.stress
@pytest.mark.parametrize("block", range(10))
def test_many_random_loops(block):
    failed, known = [], 0
    for seed in range(100 * block, 100 * (block + 1)):
        try:
            known += check(seed)
        except AssertionError as error:
            failed.append((seed, str(error)[:200]))
    assert not failed
    assert known > 95


def triangle(scale=1.0, mass=1.0):
    """A point mass on slides, a rod from the origin: the nearest place lies on the line to the origin."""
    model = point_mass("XZ", mass=mass)
    return pn.Scene(model, constraints=[pn.Distance("mass", "origin", length=scale, name="rod")])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_point_moves_straight_onto_its_circle(scale):
    scene = triangle(scale)
    for angle in np.linspace(0.1, 6.0, 7):
        place = 0.3 * scale * np.array([np.cos(angle), np.sin(angle)])
        on, _, report = scene.project(place, report=True)
        np.testing.assert_allclose(on, place / 0.3, rtol=1e-9)
        assert report.distance == pytest.approx(0.7 * scale, rel=1e-9)
        assert report.nearest
        assert report.gap == pytest.approx(0.7 * scale)
        name, move = report.coordinate, (on - place)[["x", "z"].index(report.coordinate)]
        assert name in ("x", "z")
        assert report.moved == pytest.approx(move)
        assert abs(move) == pytest.approx(np.abs(on - place).max())


def test_a_crest_is_left_downhill():
    """At the end of the long axis of an ellipse the distance is stationary, and not the least."""
    model = point_mass("XZ")

    def rows(t, q, v, data):
        return [[q[0] / 2.0, 2.0 * q[1]]], [-(v[0] ** 2 / 2.0 + 2.0 * v[1] ** 2)]

    ellipse = pn.UserConstraint(rows, 1, residual=lambda t, q: [q[0] ** 2 / 4.0 + q[1] ** 2 - 1.0])
    scene = pn.Scene(model, constraints=[ellipse], q0=[2.0, 0.0])
    # Beyond the ends' centers of curvature, 1.5 from the middle, the crest is on the near side too.
    on, _, report = scene.project([0.2, 0.0], report=True)
    x = 0.2 * 4.0 / 3.0
    np.testing.assert_allclose(np.abs(on), [x, np.sqrt(1.0 - x * x / 4.0)], atol=1e-9)
    assert report.nearest
    assert report.distance == pytest.approx(np.hypot(x - 0.2, on[1]))


def test_what_meets_the_constraints_is_not_moved():
    scene = pn.load("four_bar")
    q, v, report = scene.project(report=True)
    np.testing.assert_array_equal(q, scene.q0)
    assert dataclasses.asdict(report) == {
        "distance": 0.0,
        "coordinate": "",
        "moved": 0.0,
        "gap": report.gap,
        "iterations": 0,
        "nearest": True,
        "held": ("crank_joint", "coupler_joint", "rocker_joint"),
        "velocity_distance": 0.0,
        "velocity_coordinate": "",
        "velocity_changed": 0.0,
        "held_velocities": ("crank_joint", "coupler_joint", "rocker_joint"),
    }
    assert report.gap < 1e-15
    assert len(scene.project(q, v)) == 2


MOVED = (
    "the initial configuration did not satisfy the constraints and was moved onto them: "
    '"rocker_joint" by 1.29 rad, the others by less; Scene.project(report=True) returns details'
)


def test_a_run_tells_that_its_start_was_moved(tmp_path):
    scene = pn.load("four_bar")
    far = [2.5, 2.5, 2.5]
    with pytest.warns(RuntimeWarning, match="was moved onto them") as told:
        run = pn.simulate(scene, 0.01, q=far, v=np.zeros(3))
    assert str(told[0].message) == f"simulate: {MOVED}"
    assert run.notes == [MOVED]
    assert f"note: {MOVED}" in str(run)
    assert pn.Trajectory.load(run.save(tmp_path / "run")).notes == [MOVED]
    assert [one.notes for one in pn.rollout(scene, [scene.q0, far], np.zeros((2, 3)), 0.01)] == [[], [MOVED]]
    assert f"note: {MOVED}" in again(scene, q0=far, v0=np.zeros(3)).report()
    assert pn.simulate(scene, 0.01, q=scene.q0).notes == []
    assert pn.simulate(again(scene, q0=far, v0=np.zeros(3)), 0.01).notes == [MOVED]


def test_a_loop_that_does_not_close_by_a_hair_of_a_small_mechanism():
    """A part in a million of the length is a gap, however short the length."""
    for scale in (1e-4, 1.0, 1e4):
        model = empty()
        joint = body(model, 0, pin.JointModelRY(), "arm", 1.0, lever=(scale, 0.0, 0.0))
        frame(model, "tip", joint, pin.SE3(np.eye(3), np.array([scale, 0.0, 0.0])))
        frame(model, "pin", 0, pin.SE3(np.eye(3), np.array([scale * (1.0 + 1e-6), 0.0, 0.0])))
        scene = pn.Scene(model, constraints=[pn.PointAnchor("tip", "pin", axes="xz", name="loop")])
        with pytest.raises(pn.LoopClosureError, match='loop "loop" does not close'):
            scene.project()


@pytest.mark.parametrize("seed", range(6))
def test_a_slide_that_a_row_hardly_moves_changes_no_search(seed):
    """A slider-crank on a turned mount: one row of the loop depends on the slide by rounding only."""

    def slider_crank(turn):
        model = empty()
        crank = body(model, 0, pin.JointModelRY(), "crank", 1.0, place=turn, inertia=0.01 * np.eye(3))
        rod = body(model, crank, pin.JointModelRY(), "rod", 1.0, place=at(0.2), inertia=0.01 * np.eye(3))
        frame(model, "tip", rod, at(0.5))
        piston = body(model, 0, pin.JointModelPX(), "piston", 1.0, place=turn, inertia=0.01 * np.eye(3))
        frame(model, "pin", piston)
        loop = pn.PointAnchor("tip", "pin", axes="xz", name="loop")
        return pn.Scene(model, constraints=[loop])

    def at(x):
        return pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))

    start = np.array([0.7, -0.9, 0.3])
    turn = pin.SE3(pin.exp3(np.random.default_rng(seed).normal(size=3)), np.zeros(3))
    expected = slider_crank(pin.SE3.Identity()).project(q=start)[0]
    np.testing.assert_allclose(slider_crank(turn).project(q=start)[0], expected, rtol=0.0, atol=1e-8)
