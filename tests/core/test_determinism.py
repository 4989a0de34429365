"""Determinism: scene, state and method define all bits of a motion, whatever ran before or is recorded."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import pin_nonideal as pn

from ..support.random_mechanisms import mechanism
from ..support.row_cases import ROBOTS
from ..support.same_run import assert_same_run
from ..support.seeds import seeds

EVERYTHING = ("a", "forces", "energy", "power")
METHODS = [{}, {"method": "rk4", "dt": 2e-3}, {"method": "moreau", "dt": 2e-3}]
SECONDS = 0.05


def ended(scene, **options):
    """Return a run, or the trajectory of a failed run."""
    try:
        return pn.simulate(scene, SECONDS, **options)
    except pn.PinNonidealError as error:
        return error.trajectory


def assert_same_motion(one, other):
    """Assert equal states and events; recorded fields may differ."""
    for key in ("t", "q", "v", "z", "modes"):
        np.testing.assert_array_equal(getattr(one, key), getattr(other, key), err_msg=key, strict=True)
    assert one.events == other.events


def assert_nothing_but_the_start_matters(scene, same_scene, q, v, options):
    start = {"q": q, "v": v, **options}
    first = ended(scene, **start)
    assert len(first) > 1
    ended(scene, q=first.q[-1], v=-first.v[-1], **options)
    scene.solve(first.q[-1], first.v[-1])
    assert_same_run(first, ended(scene, **start))
    assert_same_run(first, ended(same_scene, **start))
    assert_same_motion(first, ended(scene, **start, record=EVERYTHING))


@pytest.mark.parametrize("options", METHODS, ids=lambda o: o.get("method", "dop853"))
@pytest.mark.parametrize("name", ROBOTS)
def test_robots(name, options):
    scene = pn.load(name)
    assert_nothing_but_the_start_matters(scene, pn.load(name), *scene.initial_state(), options)


@pytest.mark.parametrize("options", METHODS, ids=lambda o: o.get("method", "dop853"))
@pytest.mark.parametrize("seed", seeds(range(24)))
def test_random_mechanisms(seed, options):
    print("seed", seed)
    m = mechanism(seed)
    assert_nothing_but_the_start_matters(m.scene, mechanism(seed).scene, m.q, m.v, options)


@pytest.mark.parametrize("seed", seeds(range(24)))
def test_evaluations(seed):
    """An evaluation does not depend on earlier states, nor on the other fields of a solution."""
    m, other = mechanism(seed), mechanism(seed)
    rng = np.random.default_rng(seed)
    tau = rng.standard_normal(m.scene.model.nv)
    fresh = m.scene.solve(m.q, m.v, tau=tau)
    for speed in (0.0, 3.0):
        other.scene.solve(*other.scene.project(m.q, speed * rng.standard_normal(len(m.v))), tau=-tau)
    again = other.scene.solve(m.q, m.v, tau=tau)
    for key in ("a", "F_ideal", "F_nonideal", "lam", "modes"):
        np.testing.assert_array_equal(getattr(again, key), getattr(fresh, key), err_msg=key)
    np.testing.assert_array_equal(other.scene.acceleration(m.q, m.v, tau), fresh.a)


@pytest.mark.parametrize("name", ["panda_friction", "four_bar", "belt_oscillator"])
def test_short_runs_keep_nothing_of_each_other(name):
    """Runs are independent of earlier or failed runs in the same workspace, on threads as well."""
    scene, fresh = pn.load(name), pn.load(name)
    short = {"method": "semi_implicit_euler", "dt": 1e-3, "progress": False}
    q, v = scene.initial_state()
    first = pn.simulate(scene, 0.005, q, v, **short)
    expected = [np.array(x) for x in (first.t, first.q, first.v)]

    def assert_expected(run):
        for x, y in zip((run.t, run.q, run.v), expected, strict=True):
            np.testing.assert_array_equal(x, y)

    with pytest.raises(pn.StepSizeError):
        pn.simulate(scene, 0.005, q, v, **short, max_steps=2)
    pn.simulate(scene, 0.005, q, 0.5 * v, **short)
    pn.simulate(scene, 0.005, q, v, **short, callback=lambda t, q, v: True)
    assert_expected(first)
    assert_expected(pn.simulate(fresh, 0.005, q, v, **short))
    with ThreadPoolExecutor(2) as pool:
        for run in pool.map(lambda _: pn.simulate(scene, 0.005, q, v, **short), range(50)):
            assert_expected(run)


def test_a_run_that_failed_leaves_a_clean_place():
    """The next run with the same options equals the run of a new scene."""
    calls = {"fails": True}

    def push(t, q, v):
        if calls["fails"] and t > 0.0025:
            raise ValueError("no torque")
        return -0.1 * v

    def made():
        robot = pn.load("four_bar")
        return pn.Scene(robot.model, constraints=robot.constraints, actuation=push, q0=robot.q0)

    scene, short = made(), {"method": "rk4", "dt": 1e-3}
    with pytest.raises(pn.UserFunctionError, match="no torque"):
        pn.simulate(scene, 0.005, **short)
    calls["fails"] = False
    assert_same_run(pn.simulate(scene, 0.005, **short), pn.simulate(made(), 0.005, **short))
