"""Slip onset without a drop of the limit, and slow slip, with stiff slip directions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pin_nonideal as pn

from ....support.standing import ball, balls, planar_state, plate, star

# Error of a run at the default tolerance over several tenths of a second, and of the oracle: the oracle
# starts at a finite speed and has the tolerance 1e-9.
REACHED = 3e-8
# Evaluations from slip onset until an explicit method is stable again.
ONSET = 100
TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def three_feet(ratio=1.0, **more):
    def wrench(t):
        return np.array([0.0, 60.0 * t, 0.0, 0.0, 0.0, 5.0 * t])

    return plate(star(3), 0.5, wrench, [0, 0, -0.3], ratio, **more)


def evaluations_after(scene, instant, later):
    """Evaluations from just after an instant to a later time."""
    return pn.simulate(scene, later).stats.evaluations - pn.simulate(scene, instant + 1e-9).stats.evaluations


@pytest.mark.parametrize("times", [(0.01,), pytest.param((0.01, 0.1, 0.3), marks=pytest.mark.slow)], ids=len)
def test_three_feet_begin_to_slip_as_a_stiff_solver_has_it(times):
    scene, oracle = three_feet()
    instant = oracle.give_way(2.0)
    for later in times:
        run = pn.simulate(scene, instant + later)
        assert run.events[0].time == pytest.approx(instant, abs=1e-8)
        assert {event.kind for event in run.events} == {"slip"}
        np.testing.assert_allclose(planar_state(run), oracle.run(instant, later), rtol=0, atol=REACHED)
    assert evaluations_after(scene, instant, instant + 0.05) < ONSET


@pytest.mark.slow
def test_a_ball_joint_begins_to_slip_as_a_stiff_solver_has_it():
    scene, oracle = ball()
    turn = Rotation.identity()
    instant = oracle.give_way(turn, 0.1, 1.5)
    for later in (0.01, 0.1, 0.3):
        run = pn.simulate(scene, instant + later)
        assert [event.kind for event in run.events] == ["slip"]
        assert run.events[0].time == pytest.approx(instant, abs=1e-8)
        expected = oracle.run(turn, instant, later)
        state = np.concatenate([run.q[-1], run.v[-1]])
        state[:4] *= np.sign(state[3])
        np.testing.assert_allclose(state, expected, rtol=0, atol=REACHED)
    assert evaluations_after(scene, instant, instant + 0.05) < ONSET


@pytest.mark.parametrize(
    ("make", "duration"), [(lambda ratio: three_feet(ratio)[0], 1.0), (lambda ratio: balls(1, ratio)[0], 0.9)]
)
def test_a_static_ratio_of_one_is_the_limit_of_others(make, duration):
    """The difference decreases at least linearly with the ratio's distance from one."""

    def end(ratio):
        run = pn.simulate(make(ratio), duration, **TIGHT)
        return np.concatenate([run.q[-1], run.v[-1]])

    there = end(1.0)
    by_ratio = {excess: np.abs(end(1.0 + excess) - there).max() for excess in (1e-2, 1e-3, 1e-4, 1e-5)}
    errors = list(by_ratio.values())
    assert all(later < 0.15 * before for before, later in itertools.pairwise(errors)), by_ratio
    assert errors[-1] < 2e-9


@pytest.mark.parametrize("make", [lambda: three_feet()[0], lambda: balls(2)[0]])
def test_the_error_follows_the_tolerance(make):
    exact = pn.simulate(make(), 1.0, rtol=1e-13, atol=1e-15)
    for rtol in (1e-5, 1e-7, 1e-9, 1e-11):
        run = pn.simulate(make(), 1.0, rtol=rtol, atol=0.01 * rtol, output_dt=0.01)
        assert np.abs(run.q[-1] - exact.q[-1]).max() < 10.0 * rtol
        assert np.abs(run.v[-1] - exact.v[-1]).max() < 100.0 * rtol


@pytest.mark.parametrize("make", [lambda: three_feet()[0], lambda: balls(2)[0]])
def test_samples_inside_steps_are_as_good_as_their_ends(make):
    coarse, fine = (
        pn.simulate(make(), 1.0, output_dt=0.01, record=("a", "energy"), **s) for s in ({}, TIGHT)
    )
    common, one, other = np.intersect1d(np.round(coarse.t, 9), np.round(fine.t, 9), return_indices=True)
    assert len(common) > 90
    np.testing.assert_allclose(coarse.q[one], fine.q[other], rtol=0, atol=1e-7)
    np.testing.assert_allclose(coarse.v[one], fine.v[other], rtol=0, atol=1e-6)
    assert np.abs(coarse.energy["balance"]).max() < 1e-6
    assert np.abs(fine.energy["balance"]).max() < 1e-9


@pytest.mark.parametrize("method", ["dopri5", "rk4"])
def test_other_methods_begin_as_well(method):
    scene, _ = three_feet()
    run = pn.simulate(scene, 1.0, method=method, **({"dt": 2e-3} if method == "rk4" else {}))
    exact = pn.simulate(scene, 1.0, **TIGHT)
    assert run.stats.evaluations < 20000
    np.testing.assert_allclose(run.q[-1], exact.q[-1], rtol=0, atol=1e-6)


def test_slow_slip_that_never_rests_is_followed_in_long_steps():
    """A spring whose end moves in a circle drags a plate: friction turns the slip within a millisecond."""
    speed, rate, stiffness, damping = 2e-3, 2.0, 300.0, 30.0
    limit = 0.3 * 10.0 * 9.81

    def drag(t, q, v):
        turn = Rotation.from_quat(q[3:7])
        along = np.array([np.cos(rate * t), np.sin(rate * t), 0.0])
        ahead = (
            speed / rate * np.array([np.sin(rate * t), 1.0 - np.cos(rate * t), 0.0])
            + limit / stiffness * along
        )
        force = stiffness * (ahead - q[:3] * [1, 1, 0]) + damping * (speed * along - turn.apply(v[:3]))
        return np.concatenate([turn.inv().apply(force), np.zeros(3)])

    start = {"v0": [speed, 0, 0, 0, 0, 0], "unilateral": False}  # so that a stiff solver may follow
    scene, _ = plate(star(3), 0.3, np.zeros(6), np.zeros(3), actuation=drag, **start)
    run = pn.simulate(scene, 1.0)
    exact = pn.simulate(scene, 1.0, method="Radau", rtol=1e-10, atol=1e-13)
    assert run.events == exact.events == []
    assert run.stats.evaluations < 1500
    np.testing.assert_allclose(run.v[-1], exact.v[-1], rtol=0, atol=1e-7)


@pytest.mark.parametrize("links", [2, 6])
def test_a_chain_of_ball_joints_takes_few_steps(links):
    run = pn.simulate(balls(links)[0], 5.0 if links == 2 else 1.0, record="energy")
    assert run.stats.steps < 3000
    assert np.abs(run.energy["balance"]).max() < 1e-5
