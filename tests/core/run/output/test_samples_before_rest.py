"""Samples inside steps that end when slip with several components comes to rest, and work of friction."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.hung_body import HungBody

from ....support.mechanisms import body, frame
from ....support.standing import balls

DURATION = 1.5
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
PARTS = np.array([0.05, 0.3, 0.6, 0.9, 0.99])  # fractions of the step before rest
SPEED = 1e-7  # error of a sample, relative to the largest speed
INSTANT = 1e-8  # [s]
SHORT = 1e-5  # step size below which no uniform grid has a sample inside [s]
# The direction of slip is as exact as the slip itself; so are the forces and accelerations along it.
CLEAR, FORCE = 1e-4, 1e-6  # parts of the largest speed and acceleration
WORK = 1e-8  # part of the work of friction
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
# The slip of seed 109 turns so fast before it ends that no step reaches rest.
BY_DEFAULT = (0, 109)
SEEDS = [seed if seed in BY_DEFAULT else pytest.param(seed, marks=pytest.mark.stress) for seed in range(300)]
ANCHORED = pytest.mark.parametrize(
    "anchored", [pytest.param(False, id="joint", marks=pytest.mark.slow), pytest.param(True, id="anchor")]
)


def hung(seed, anchored):
    """A body on a rough ball joint or ball anchor, its start and its oracle."""
    rng = np.random.default_rng(seed)
    spread = 0.05 * rng.uniform(0.2, 1.0, 3)
    turn = pin.exp3(rng.normal(size=3))
    inertia = turn @ np.diag(spread[[0, 1, 2]] + spread[[1, 2, 0]]) @ turn.T
    mass, center = rng.uniform(0.5, 2.0), 0.2 * rng.normal(size=3)
    gravity, constant = rng.normal(0.0, 4.0, 3), 10.0 ** rng.uniform(0.3, 1.0)
    mu, radius = rng.uniform(0.05, 0.4), 0.05
    model = pin.Model()
    model.gravity = pin.Motion(gravity, np.zeros(3))
    joint = pin.JointModelFreeFlyer() if anchored else pin.JointModelSpherical()
    index = body(model, 0, joint, "body", mass, lever=center, inertia=inertia)
    frame(model, "pivot", index)
    frame(model, "ground", 0)
    law = pn.JointFriction("ball" if anchored else "body", coulomb=constant, mu=mu, radius=radius, name="rub")
    anchors = [pn.PointAnchor("pivot", "ground", name="ball")] if anchored else []
    place, w = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs(), rng.normal(0.0, 3.0, 3)
    q, v = (np.concatenate([np.zeros(3 * anchored), x]) for x in (place, w))
    scene = pn.Scene(model, constraints=anchors, laws=[law], q0=q, v0=v)
    oracle = HungBody(mass, center, inertia, gravity, constant, mu * radius)
    return scene, oracle, np.concatenate([place, w])


def step_before_rest(run):
    """Start and end of the step that ends as the first element comes to rest."""
    instant = next(event.time for event in run.events if event.kind == "stick")
    return run.dense.times[np.searchsorted(run.dense.times[:, 1], instant - 1e-14)]


@lru_cache(maxsize=4)
def at_rest(seed, anchored):
    """Return the same and the instant of rest or None, which the oracle finds in about a second."""
    scene, oracle, start = hung(seed, anchored)
    return scene, oracle, start, oracle.rest(start, DURATION)


def hung_until_rest(seed, anchored):
    """The same, or a skipped test if the body swings on."""
    scene, oracle, start, instant = at_rest(seed, anchored)
    if instant is None:
        pytest.skip("it swings on")
    return scene, oracle, start, instant


@ANCHORED
@pytest.mark.parametrize("seed", SEEDS)
def test_samples_before_a_rough_ball_rests_are_those_of_its_equations(seed, anchored):
    scene, oracle, start, instant = hung_until_rest(seed, anchored)
    run = pn.simulate(scene, instant + 0.01, record=("a", "dense"), **TIGHT)
    assert run.events[0].kind == "stick"
    assert run.events[0].time == pytest.approx(instant, abs=INSTANT)
    begin, end = step_before_rest(run)
    times = begin + PARTS * (end - begin)
    states = oracle.states(start, times)
    speed = np.abs(run.v).max()
    inside = run.at(times)
    np.testing.assert_allclose(inside.v[:, -3:], states[:, 4:], rtol=0, atol=SPEED * speed)
    a = np.array([oracle.rate(0.0, y)[4:] for y in states])
    clear = np.linalg.norm(states[:, 4:], axis=1) > CLEAR * speed
    np.testing.assert_allclose(inside.a[clear, -3:], a[clear], rtol=0, atol=FORCE * np.abs(a).max())


@ANCHORED
@pytest.mark.parametrize("seed", SEEDS)
def test_an_output_grid_does_not_change_the_run_before_a_rest(seed, anchored):
    scene, oracle, start, instant = hung_until_rest(seed, anchored)
    alone = pn.simulate(scene, instant + 0.01, record=("a", "dense"), **TIGHT)
    begin, end = step_before_rest(alone)
    if end - begin < SHORT:
        pytest.skip("the last step has no room for a grid")
    inside = begin + 0.6 * (end - begin)
    grid = inside / np.ceil(inside / (end - begin))
    run = pn.simulate(scene, instant + 0.01, record=("a", "dense"), output_dt=grid, **TIGHT)
    assert run.stats.steps == alone.stats.steps
    assert run.events == alone.events
    np.testing.assert_array_equal(run.dense.states, alone.dense.states)
    late = (run.t > begin) & (run.t < end)
    assert late.any()
    states = oracle.states(start, run.t[late])
    np.testing.assert_allclose(run.v[late, -3:], states[:, 4:], rtol=0, atol=SPEED * np.abs(run.v).max())


@ANCHORED
@pytest.mark.parametrize("seed", SEEDS)
def test_the_work_of_friction_is_the_integral_of_its_power(seed, anchored):
    scene, *_, instant = hung_until_rest(seed, anchored)
    run = pn.simulate(scene, instant + 0.01, record=("energy", "power", "dense"), **TIGHT)
    begin, end = run.dense.times.T
    times = begin[:, None] + 0.5 * (end - begin)[:, None] * (1.0 + NODES)
    power = run.at(times.ravel()).power["rub"].reshape(times.shape)
    quadrature = 0.5 * (end - begin) @ (power @ WEIGHTS)
    assert quadrature == pytest.approx(run.energy["rub"][-1], rel=WORK)


def test_samples_inside_steps_that_seek_directions_have_their_own():
    scene = balls(2)[0]
    run = pn.simulate(scene, 1.0, record=("a", "forces", "dense"), **TIGHT)
    sought = np.flatnonzero(run.dense.sought.any(axis=1))
    assert sought.size
    for begin, end in run.dense.times[sought[:: max(1, sought.size // 4)]]:
        time = begin + 0.4 * (end - begin)
        inside = run.at(time)
        there = pn.simulate(scene, time, record=("a", "forces"), **TIGHT)
        for name in ("a", "F_nonideal"):
            size = np.abs(getattr(run, name)).max()
            np.testing.assert_allclose(
                getattr(inside, name), getattr(there, name)[-1], rtol=0, atol=FORCE * size, err_msg=name
            )
