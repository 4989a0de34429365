"""Instants and runs against dense mechanics that share no algorithm with the core, nor with Pinocchio."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.dense import DenseScene
from oracles.dense_friction import friction_motion
from oracles.differences import consistent
from oracles.solutions import KKT

from ...support.mechanisms import TIGHT, dof
from ...support.random_mechanisms import mechanism
from ...support.random_trees import state, tree
from ...support.row_cases import ROBOTS, kept
from ...support.seeds import seeds

# Rounding of sums over bodies in another order.
ROUNDING = 1e-12
# Difference of runs at tolerances of 1e-12 and 1e-13: a hundred steps with error growth in a fraction of a
# second.
SAME = 1e-9
# Friction runs restart at every event, whose time has the error of the tolerance.
SAME_ACROSS_EVENTS = 1e-8


def assert_same_instant(scene, q, v, t):
    """Assert M, F and the acceleration; C is the core's, which friction_conditions checks."""
    runner = scene._compiled.program.runner()
    raw = runner.solve(q, v, t)
    dense = DenseScene(scene, lambda t, q, v: raw.C)
    M, F, _, _ = dense.terms(t, q, v)
    rest, _ = pn.Scene(scene.model)._compiled.program.runner().terms(q, v)
    size = np.abs(F).max() + np.abs(dense.terms(t, q, 0.0 * v)[1]).max()
    np.testing.assert_allclose(rest.reshape(M.shape), M, rtol=0, atol=ROUNDING * np.abs(M).max())
    np.testing.assert_allclose(raw.F, F, rtol=0, atol=ROUNDING * size)
    a = dense.acceleration(t, q, v)[0]
    in_play = np.abs(a).max() + np.abs(np.linalg.solve(M, F + raw.C)).max()
    np.testing.assert_allclose(raw.a, a, rtol=0, atol=KKT * in_play)


@pytest.mark.parametrize("name", ROBOTS)
def test_instants_of_robots(name):
    rng = np.random.default_rng(1)
    scene = kept(pn.load(name))
    for t, speed in ((0.0, 0.0), (0.0, 1.0), (0.4, 3.0)):
        assert_same_instant(scene, *consistent(scene, rng, t, speed), t)


@pytest.mark.parametrize("seed", seeds(range(60)))
def test_instants_of_random_mechanisms(seed):
    print("seed", seed)
    m = mechanism(seed)
    assert_same_instant(m.scene, m.q, m.v, 0.0)


def smooth(scene):
    """Return the scene without its laws."""
    what = ("constraints", "contacts", "forces", "actuation", "q0", "v0")
    return pn.Scene(scene.model, **{key: getattr(scene, key) for key in what})


def assert_same_run(scene, q, v, duration):
    run = pn.simulate(scene, duration, q=q, v=v, **TIGHT)
    expected = DenseScene(scene).motion(q, v, np.array([0.5 * duration, duration]))
    moved = np.abs(pin.difference(scene.model, q, expected[-1])).max()
    assert moved > 1e3 * SAME
    gap = pin.difference(scene.model, expected[-1], run.q[-1])
    np.testing.assert_allclose(gap, 0.0, rtol=0, atol=SAME * (1.0 + moved))


DURATIONS = {
    "andrews_squeezer": 0.005,
    "delta": 0.02,
    "solo12_standing": 0.05,
    "solo12_dropped": 0.05,
    "belt_oscillator": 1.0,
}


@pytest.mark.parametrize("name", ROBOTS)
def test_runs_of_robots_without_friction(name):
    scene = smooth(kept(pn.load(name)))
    q, v = scene.project(*scene.initial_state())
    if name in ("panda_settling", "worm_drive", "loaded_joint", "solo12_standing", "delta"):
        v = scene.project(q, v + np.linspace(-1.0, 1.0, scene.model.nv))[1]
    assert_same_run(scene, q, v, DURATIONS.get(name, 0.2))


@pytest.mark.parametrize("seed", seeds(range(16)))
def test_runs_of_random_mechanisms_without_friction(seed):
    print("seed", seed)
    m = mechanism(seed)
    assert_same_run(smooth(m.scene), m.q, m.v, 0.1)


@pytest.mark.parametrize("seed", range(6))
def test_runs_of_random_trees_with_constant_friction(seed):
    """Joints stick and slip; the dense motion enumerates all modes at each event."""
    print("seed", seed)
    rng = np.random.default_rng(seed)
    n = 2 + seed % 3
    kinds = rng.choice(["revolute x", "revolute unaligned", "prismatic y", "helical unaligned"], n)
    model = tree(list(kinds), rng)
    q, v = state(model, rng)
    coulomb, viscous = rng.uniform(0.5, 3.0, n), rng.uniform(0.0, 0.2, n)
    laws = [pn.JointFriction(f"j{k}", coulomb=coulomb[k], viscous=viscous[k]) for k in range(n)]
    scene = pn.Scene(model, laws=laws)
    assert [dof(scene, f"j{k}") for k in range(n)] == list(range(n))
    times = np.array([0.25, 0.5])
    problem = SimpleNamespace(q0=q, v0=v, coulomb=coulomb, viscous=viscous, times=times)
    expected = friction_motion(DenseScene(pn.Scene(model)), problem, 0.01)
    run = pn.simulate(scene, times[-1], q=q, v=v, output_dt=times[0], **TIGHT)
    assert run.events
    found = run.q[np.searchsorted(run.t, times - 1e-12)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=SAME_ACROSS_EVENTS)
