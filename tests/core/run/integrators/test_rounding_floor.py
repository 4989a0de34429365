"""Rounding floor of step control: no step meets a tolerance below the rounding of accelerations."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn
from oracles.long_recursion import LongTree

from ....support.mechanisms import body, empty
from ....support.same_run import assert_same_run

# Bounds of a sample of rounding relative to the largest of a run.
FAR_BELOW, FAR_ABOVE = 0.01, 20.0
# Number of steps after which a run uses its rounding floor (run/rounding.cpp).
MANY_STEPS = 20_000


def arm_with_a_finger(finger: float, reach: float = 10.0) -> pin.Model:
    """Return an arm whose inertias about one point keep (finger / reach)^2 of their digits."""
    model = empty()
    heavy, light = np.diag([1.0, 80.0, 80.0]), np.diag([1e-10] * 3)
    arm = body(
        model, 0, pin.JointModelRY(), "arm", 10.0, inertia=heavy, lever=np.array([0.5 * reach, 0.0, 0.0])
    )
    place = pin.SE3(np.eye(3), np.array([reach, 0.0, 0.0]))
    lever = np.array([0.5 * finger, 0.0, 0.0])
    body(model, arm, pin.JointModelRY(), "finger", 1e-3, place=place, lever=lever, inertia=light)
    return model


START = {"q": np.array([0.1, 0.2]), "v": np.zeros(2)}


def in_long_double(model: pin.Model, duration: float, rtol: float):
    """Integrate by SciPy's DOP853 with accelerations of negligible rounding."""
    tree, nv = LongTree(model), model.nv

    def rate(t, y):
        return np.concatenate([y[nv:], np.asarray(tree.acceleration(y[:nv], y[nv:], np.zeros(nv)), float)])

    start = np.concatenate([START["q"], START["v"]])
    return solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=rtol, atol=rtol)


@pytest.mark.parametrize("method", ["dop853", "dopri5"])
def test_tolerances_below_rounding_cost_no_more_steps(method):
    model = arm_with_a_finger(1e-3)
    runs = {
        rtol: pn.simulate(
            pn.Scene(model), 0.3, **START, method=method, rtol=rtol, atol=rtol, max_steps=2 * MANY_STEPS
        )
        for rtol in (1e-8, 1e-10, 1e-12, 1e-14)
    }
    for run in runs.values():
        told = f"limited by rounding: {run.stats.limited_by_rounding} of {run.stats.steps} steps"
        assert (told in str(run)) == (run.stats.limited_by_rounding > 0)
    assert runs[1e-14].stats.limited_by_rounding > 0
    # Without a floor all runs except the first take more than 100,000 steps.
    assert max(run.stats.steps for run in runs.values()) < 1.5 * MANY_STEPS


def test_steps_are_those_of_accelerations_without_rounding():
    model = arm_with_a_finger(1e-3)
    exact = in_long_double(model, 0.1, 1e-10)
    run = pn.simulate(pn.Scene(model), 0.1, **START, rtol=1e-10, atol=1e-10)
    # The tolerance is far below rounding, and noise changes step sizes.
    assert run.stats.steps < MANY_STEPS + 5.0 * (exact.t.size - 1)
    # The error is bounded by the effect of rounding of a over this time.
    largest = np.abs(run.v).max()
    assert np.abs(run.v[-1] - exact.y[2:, -1]).max() < 100.0 * run.stats.rounding * largest


@pytest.mark.parametrize("finger", [1e-1, 1e-2, 1e-3])
def test_the_rounding_told_is_that_of_the_accelerations(finger):
    model = arm_with_a_finger(finger)
    scene, tree = pn.Scene(model), LongTree(model)
    asked = {"method": "dopri5", "rtol": 1e-12, "atol": 1e-12, "max_steps": MANY_STEPS + 500}
    with pytest.raises(pn.StepSizeError) as stopped:
        pn.simulate(scene, 200.0, **START, **asked)
    run = stopped.value.trajectory
    actual = 0.0
    for q, v in zip(run.q[-500::10], run.v[-500::10], strict=True):
        exact = np.asarray(tree.acceleration(q, v, np.zeros(2)), float)
        actual = max(actual, np.abs(scene.acceleration(q, v) - exact).max() / np.abs(exact).max())
    assert FAR_BELOW * actual < run.stats.rounding < FAR_ABOVE * actual


@pytest.mark.parametrize("name", ["four_bar", "panda", "solo12_standing"])
def test_ordinary_runs_are_not_limited(name):
    run = pn.simulate(pn.load(name), 1.0, rtol=1e-10)
    assert run.stats.limited_by_rounding == 0
    assert run.stats.rounding < 1e-9
    assert "limited by rounding" not in str(run)


@pytest.mark.slow
def test_a_resumed_run_is_limited_alike(tmp_path):
    model, path, calls = arm_with_a_finger(1e-3), tmp_path / "run.npz", 0

    def torque(t, q, v):
        nonlocal calls
        calls += 1
        if calls == 15_000:
            raise KeyboardInterrupt
        return [0.0, 0.0]

    asked = {**START, "rtol": 1e-12, "atol": 1e-12, "output_dt": 0.1}
    scene = pn.Scene(model, actuation=torque)
    with pytest.raises(pn.RunInterrupted):
        pn.simulate(scene, 0.2, checkpoint=path, checkpoint_interval=0.01, **asked)
    again = pn.resume(path, scene)
    whole = pn.simulate(scene, 0.2, **asked)
    assert_same_run(again, whole)
    assert whole.stats.limited_by_rounding > 0
