"""terms="pinocchio" against terms="core": evaluations, runs and workspaces."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import pin_nonideal as pn
from oracles.differences import consistent, rows_at
from pin_nonideal.errors import InputError

from ..support.mechanisms import again
from ..support.random_mechanisms import mechanism
from ..support.refusals import refuses
from ..support.row_cases import ROBOTS, TREES
from ..support.same_run import assert_same_run
from ..support.seeds import seeds

# One evaluation: sums of a few dozen products in another order, relative to the size of the quantity.
ROUNDING = 1e-12
# The same along a run, grown by the motion, and through solutions of linear systems.
ALONG = 1e-9
EVERYTHING = ("a", "forces", "energy", "power")


def assert_close(found, expected, tolerance, size=0.0, what=""):
    size = max(size, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * size, err_msg=what)


def assert_same_evaluation(scene, q, v):
    other = again(scene, terms="pinocchio")
    one, two = scene._compiled.program.runner(), other._compiled.program.runner()
    still = np.abs(one.terms(q, np.zeros_like(v))[1]).max(initial=0.0)
    for x, y, size in zip(two.terms(q, v), one.terms(q, v), (0.0, still), strict=True):
        assert_close(x, y, ROUNDING, size)
    A, b, phi, rate = rows_at(scene, one, q, v, 0.3)
    reach, speed = 1.0 + np.abs(A).max(initial=0.0), 1.0 + np.abs(v).max()
    sizes = (reach, reach * speed**2, reach, reach * speed)
    for x, y, size in zip(rows_at(other, two, q, v, 0.3), (A, b, phi, rate), sizes, strict=True):
        assert_close(x, y, ROUNDING, size)
    assert other.dropped == scene.dropped
    expected, found = scene.solve(q, v), other.solve(q, v)
    np.testing.assert_array_equal(found.modes, expected.modes)
    for key in ("a", "F_ideal", "F_nonideal", "lam"):
        force = np.abs(expected.F_ideal).max() + np.abs(expected.F_nonideal).max() if key[0] == "F" else 0.0
        assert_close(getattr(found, key), getattr(expected, key), ALONG, force, key)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_in_one_evaluation(name):
    scene = pn.load(name)
    rng = np.random.default_rng(5)
    for q, v in [scene.initial_state(), *(consistent(scene, rng, 0.0, speed) for speed in (0.3, 3.0))]:
        assert_same_evaluation(scene, q, v)


@pytest.mark.parametrize("kind", TREES)
def test_every_kind_of_constraint_in_one_evaluation(kind):
    rng = np.random.default_rng(len(kind))
    scene = TREES[kind](rng)
    assert_same_evaluation(scene, *consistent(scene, rng, 0.0))


def assert_same_motion(one, two):
    """States at the outputs, forces, ledger and events of two runs."""
    np.testing.assert_allclose(two.t, one.t, rtol=0, atol=ALONG)
    for key in ("q", "v"):
        assert_close(getattr(two, key), getattr(one, key), ALONG, 1.0, key)
    forces = np.abs(one.F_ideal).max() + np.abs(one.F_nonideal).max()
    for key in ("F_ideal", "F_nonideal"):
        assert_close(getattr(two, key)[-1], getattr(one, key)[-1], 100 * ALONG, forces, key)
    size = np.abs(one.energy["kinetic"]).max() + np.ptp(one.energy["potential"])
    for key in one.energy:
        assert_close(np.diff(two.energy[key]), np.diff(one.energy[key]), 10 * ALONG, size, key)
    assert [(e.kind, e.element) for e in two.events] == [(e.kind, e.element) for e in one.events]
    for first, second in zip(one.events, two.events, strict=True):
        assert abs(first.time - second.time) < 10 * ALONG


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_along_a_run(name):
    scene = pn.load(name)
    duration = 0.01 if name == "andrews_squeezer" else 0.1
    # A hold in free fall stands still to rounding, which then decides on steps; the tolerance bounds the gap.
    options = {"output_dt": duration / 5, "record": EVERYTHING, "rtol": 1e-10, "atol": 1e-12}
    assert_same_motion(
        *(pn.simulate(s, duration, **options) for s in (scene, again(scene, terms="pinocchio")))
    )


@pytest.mark.parametrize("method", ["dop853", "rk4", "moreau"])
# 9 magnifies the last bit of v to 3e-9 by itself, and 11 has no solution by moreau.
@pytest.mark.parametrize("seed", seeds([*range(9), 10, 12]))
def test_random_mechanisms_with_friction_along_a_run(seed, method):
    m = mechanism(seed)
    options = {"output_dt": 0.02, "record": EVERYTHING, "method": method}
    options |= {"rtol": 1e-12, "atol": 1e-13} if method == "dop853" else {"dt": 1e-3}
    assert_same_motion(
        *(pn.simulate(s, 0.1, q=m.q, v=m.v, **options) for s in (m.scene, again(m.scene, terms="pinocchio")))
    )


def test_a_batch_is_its_runs_and_has_a_replay(tmp_path):
    scene = pn.load("solo12_standing", terms="pinocchio")
    rng = np.random.default_rng(7)
    states = [consistent(scene, rng, 0.0, 0.1) for _ in range(3)]
    q, v = (np.array(part) for part in zip(*states, strict=True))
    batch = pn.rollout(scene, q, v, 0.02, jobs=2)
    for k, run in enumerate(batch):
        assert_same_run(run, pn.simulate(scene, 0.02, q=q[k], v=v[k]))
    assert pn.replay(batch[0], tmp_path / "run.html")


def test_a_run_goes_on_with_the_provider_it_began_with(tmp_path):
    path = tmp_path / "run"
    scene = pn.load("rough_four_bar", terms="pinocchio")
    alone = pn.simulate(scene, 0.1, record=EVERYTHING, checkpoint=path, checkpoint_interval=0.0)
    resumed = pn.resume(path)
    assert_same_run(alone, resumed)
    assert resumed.scene.terms == "pinocchio"
    with refuses('resume: the scene must be the one that "', InputError):
        pn.resume(path, pn.load("rough_four_bar"))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_workspaces_keep_no_second_derivatives():
    """A pinocchio::Data has 4 nv^3 numbers of them, 55 MB each here. The allocator may retain one set."""

    def resident():
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    for terms in ("core", "pinocchio"):
        scene = pn.load("n_four_bar", N=59, terms=terms)
        assert scene.model.nv == 119
        before = resident()
        kept = [scene._compiled.program.runner() for _ in range(8)]
        assert resident() - before < 2.5 * 55.0
        del kept
