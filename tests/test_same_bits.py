"""The bits of a motion follow from scene, state and method, not from what ran before or what is recorded."""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn

from .random_mechanisms import mechanism
from .row_cases import ROBOTS
from .same_run import assert_same_run

EVERYTHING = ("a", "forces", "energy", "power")
METHODS = [{}, {"method": "rk4", "dt": 2e-3}, {"method": "moreau", "dt": 2e-3}]
SECONDS = 0.05


def ended(scene, **options):
    """A run, as far as it came."""
    try:
        return pn.simulate(scene, SECONDS, **options)
    except pn.PinNonidealError as error:
        return error.trajectory


def assert_same_motion(one, other):
    """States and events; what was recorded of them may differ."""
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
@pytest.mark.parametrize("seed", range(24))
def test_random_mechanisms(seed, options):
    print("seed", seed)
    m = mechanism(seed)
    assert_nothing_but_the_start_matters(m.scene, mechanism(seed).scene, m.q, m.v, options)


@pytest.mark.parametrize("seed", range(24))
def test_evaluations(seed):
    """Of one state, after any other, and with everything that a solution tells beside the acceleration."""
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
