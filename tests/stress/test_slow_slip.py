"""Random stances up to slip onset and beyond; chains of ball joints."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import pin_nonideal as pn

from ..support.standing import balls, planar_state, plate
from .measure import at_most, ledger

long = pytest.mark.stress

LATEST = 200.0  # loads grow until then [s]
GIVES_WAY = 1e-6  # [s]: a separate program finds the optimum, to 1e-9 of the limits
WITHIN = 1e-4  # part of mu: a run ends where another motion comes in from infinite loads, before it is there
STEPS = {"stance": 2000, "balls": 3000}
HELD = 1e-9  # part of the largest slip below which a foot is held
BALANCE = 1e-6
SAME_TIME = 1e-9  # part of the time


def stance(seed, unilateral):
    """A plate on three to six feet around its center of mass, under a load that grows."""
    chosen = np.random.default_rng(seed)
    count, inside = int(chosen.integers(3, 7)), False
    while not inside:
        places = 0.3 * chosen.normal(size=(count, 2))
        inside = (ConvexHull(places).equations[:, 2] < -0.03).all()
    feet, mu = np.column_stack([places, np.full(count, -0.3)]), chosen.uniform(0.2, 0.8)
    first, growth, turning = chosen.normal(size=2), 15.0 * chosen.normal(size=2), 3.0 * chosen.normal()
    at = [*0.2 * chosen.normal(size=2), -0.3 + chosen.uniform(-0.05, 0.05)]

    def wrench(t):
        return np.array([*first + growth * t, 0.0, 0.0, 0.0, turning * t])

    return plate(feet, mu, wrench, at, unilateral=unilateral)


def sharings(oracle, run, instant, more):
    """Return loads of a motion at the end of the run if friction were larger by a part."""
    state = planar_state(run)
    slip = oracle.slip(state[2], state[3:])
    speed = np.linalg.norm(slip, axis=1)
    if speed.max() > 0.0:
        slips = speed > HELD * speed.max()
        directions = np.where(slips[:, None], slip / speed[:, None], np.nan)
    else:
        directions = oracle.onset(instant)
    return oracle.sharings(run.t[-1], state[2], state[5], directions, (1.0 + more) * oracle.mu)


@pytest.mark.parametrize("seeds", [range(3), [229, 1009], pytest.param(range(10, 1010), marks=long)])
def test_stances_give_way_in_time_and_in_few_steps(seeds):
    late, steps, evaluations, missing = [], [], [], [0.0]
    for seed in seeds:
        scene, oracle = stance(seed, unilateral=False)
        instant = oracle.give_way(LATEST)
        try:
            run = pn.simulate(scene, instant + 1.0)
        except (
            pn.FrictionParadoxError
        ) as stopped:  # a foot that is kept though it pulls may leave none, or several
            run = stopped.trajectory
            missing.append(1.0 - run.t[-1] / stopped.time)
            assert len(sharings(oracle, run, instant, WITHIN)) != 1
        first = next((event.time for event in run.events if event.kind == "slip"), run.t[-1])
        late.append(abs(first - instant))
        steps.append(run.stats.steps)
        evaluations.append(run.stats.evaluations)
    print(f"evaluations: {np.median(evaluations):.0f} in the middle, {max(evaluations)} at most")
    at_most("the instant of giving way [s]", max(late), GIVES_WAY)
    at_most("steps", max(steps), STEPS["stance"])
    at_most("part of the time before an error that is not shown", max(missing), SAME_TIME)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9, 12, 56])
def test_feet_that_cannot_pull_give_way_in_time(seed):
    """Once a foot is relieved, the least loads with which none pulls follow another law."""
    scene, oracle = stance(seed, unilateral=True)
    instant = oracle.give_way(LATEST)
    run = pn.simulate(scene, instant + 0.2, record="energy", output_dt=0.1)
    first = next(event.time for event in run.events if event.kind == "slip")
    at_most("the instant of giving way [s]", abs(first - instant), GIVES_WAY)
    at_most("steps", run.stats.steps, STEPS["stance"])
    at_most("energy balance", ledger(run), BALANCE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [463, 484])
def test_feet_rest_as_long_as_any_forces_hold_them(seed):
    """Feet lose their load while all feet rest: some could slip long before they must."""
    scene, oracle = stance(seed, unilateral=True)
    instant = oracle.give_way(LATEST)
    run = pn.simulate(scene, instant - GIVES_WAY)
    assert not any(event.kind == "slip" for event in run.events)
    assert np.abs(run.v).max() == 0.0
    assert not run.stats.steps > STEPS["stance"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [463, 484])
@pytest.mark.xfail(strict=True, reason="rest is found without the motion beside it, see limits.md")
def test_feet_that_rest_beside_another_motion_tell_of_it(seed):
    scene, oracle = stance(seed, unilateral=True)
    run = pn.simulate(scene, oracle.give_way(LATEST) - GIVES_WAY)
    assert any(event.kind == "several" for event in run.events)


@pytest.mark.parametrize(
    "seeds",
    [
        [370],
        pytest.param([330, 484, 533, 652, 756, 868], marks=pytest.mark.slow),
        pytest.param([1131], marks=pytest.mark.slow),
        pytest.param(range(300, 1300), marks=long),
    ],
)
def test_feet_that_cannot_pull_slide_on(seeds):
    """A foot that passes the center of rotation sticks again only if its share of the load allows it."""
    steps = []
    for seed in seeds:
        scene, oracle = stance(seed, unilateral=True)
        if oracle.excess(0.0)[0] > 0.0:
            instant = 0.0
        else:
            instant = oracle.give_way(LATEST) if oracle.excess(LATEST)[0] > 0.0 else LATEST
        steps.append(pn.simulate(scene, instant + 1.0).stats.steps)
    at_most("steps", max(steps), STEPS["stance"])


@pytest.mark.parametrize("seed", [15, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (12, 375))])
def test_a_motion_in_which_a_foot_would_not_hold_is_none(seed):
    """Other feet slip under these loads, and sticking feet would exceed their limits."""
    scene, oracle = stance(seed, unilateral=False)
    instant = oracle.give_way(LATEST)
    run = pn.simulate(scene, instant + 1.0)
    first = next(event.time for event in run.events if event.kind == "slip")
    at_most("the instant of giving way [s]", abs(first - instant), GIVES_WAY)


@pytest.mark.parametrize("links", [2, 6, pytest.param(20, marks=long)])
def test_chains_of_ball_joints(links):
    start = time.perf_counter()
    run = pn.simulate(balls(links)[0], 5.0, record="energy", output_dt=0.1)
    taken = time.perf_counter() - start
    print(
        f"{links} ball joints: {run.stats.evaluations} evaluations, {len(run.events)} events, {taken:.1f} s"
    )
    at_most("steps", run.stats.steps, STEPS["balls"])
    at_most("energy balance", ledger(run), BALANCE)
