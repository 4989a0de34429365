"""Modes at rest under load, against every combination of modes with a scan of the loads."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import pin_nonideal as pn
from oracles.rest_modes import CloseError, RestingTree
from oracles.stance import Stance

from ..support.mechanisms import GRAVITY, empty, frame
from ..support.random_loaded_trees import loaded_tree
from ..support.seeds import seeds
from ..support.standing import plate, star

# Near a fold of the solutions at rest, forces have half of the digits.
MOTION = 1e-7
# Error of the time of slip onset, and residual of the optimizer's conditions [N or N^2].
GIVE_WAY = 1e-6
CONVERGED = 1e-6
# Normal force below which a foot is about to lift [N].
PRESSED = 1e-3


def stickiest(solutions):
    """Return the solution whose sticking set contains all others, or None."""
    stuck = [frozenset(np.flatnonzero(np.equal(modes, 0))) for modes, _ in solutions]
    for k, own in enumerate(stuck):
        if all(own > other for i, other in enumerate(stuck) if i != k):
            return solutions[k]
    return None


def check(seed, joints):
    """Compare the number of motions with the scan; return it, or None if the scan is inconclusive."""
    model, laws, q, tau = loaded_tree(seed, joints)
    tree, rest = RestingTree(model, laws, q, tau), np.zeros(model.nv)
    try:
        solutions = tree.solutions()
    except CloseError:
        return None
    scene, best = pn.Scene(model, laws=laws), stickiest(solutions)
    if best is None:
        with pytest.raises(pn.FrictionParadoxError):
            scene.solve(q, rest, tau=tau)
        return len(solutions)
    s = scene.solve(q, rest, tau=tau)
    assert tuple(s.modes) == best[0]
    assert s.unique is (len(solutions) == 1)
    expected = tree.a0 + tree.response @ best[1]
    np.testing.assert_allclose(s.a, expected, rtol=0.0, atol=MOTION * (1.0 + np.abs(tree.a0).max()))
    return len(solutions)


@pytest.mark.parametrize("count", [10, pytest.param(300, marks=pytest.mark.slow)])
def test_one_loaded_joint(count):
    """Drawers and journals, loaded up to and beyond the paradox."""
    counts = [check(seed, 1) for seed in range(count)]
    assert counts.count(1) > 0.4 * count


@pytest.mark.parametrize("seed", seeds(range(20), count=3))
def test_two_loaded_joints(seed):
    check(seed, 2)


@pytest.mark.stress
def test_many_loaded_joints():
    counts = [check(seed, 1) for seed in range(10_000)] + [check(seed, 2) for seed in range(1000)]
    print({k: counts.count(k) for k in set(counts)})
    assert counts.count(0) == 0  # at rest forces within continuous limits always suffice for some motion
    assert counts.count(3) > 10


def block_on_feet(points, wrench, at, mu, static_ratio=1.0):
    """A body that stands on feet, pulled by a wrench (t -> force, moment) at a point."""
    model = empty()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "block")
    inertia = pin.Inertia(10.0, np.zeros(3), 0.3 * np.eye(3))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    for k, point in enumerate(points):
        frame(model, f"foot{k}", joint, pin.SE3(np.eye(3), np.array(point)))
    frame(model, "pull", joint, pin.SE3(np.eye(3), np.array(at)))
    q = pin.neutral(model)
    q[2] = -points[0][2]
    contacts = [
        pn.PointContact(f"foot{k}", mu=mu, static_ratio=static_ratio, unilateral=False)
        for k in range(len(points))
    ]
    return pn.Scene(model, contacts=contacts, forces=[pn.Wrench("pull", wrench)], q0=q)


def random_stance(seed, static_ratio):
    """A body on three to six feet with a growing pull, and the load that no friction holds."""
    rng = np.random.default_rng(seed)
    count, height = int(rng.integers(3, 7)), rng.uniform(0.05, 0.4)
    turns = (
        np.sort(rng.uniform(0.0, 2.0 * np.pi, count)) if seed % 2 else 2.0 * np.pi * np.arange(count) / count
    )
    reach = rng.uniform(0.2, 0.5, count)
    feet = np.column_stack([reach * np.cos(turns), reach * np.sin(turns), np.full(count, -height)])
    mu, couple = rng.uniform(0.2, 0.6), np.array([0.0, 0.0, rng.uniform(-5.0, 5.0)])
    way = rng.uniform(0.0, 2.0 * np.pi)
    load = 60.0 * np.array([np.cos(way), np.sin(way), 0.0])
    at = feet[0] * (seed % 3 == 0)
    scene = block_on_feet(feet, lambda t: [*(load * t), *(couple * t)], at, mu, static_ratio)
    return scene, Stance(feet, 10.0 * GRAVITY, static_ratio * mu, load, at, couple)


def check_stance(seed, static_ratio, beyond):
    """Check that slip begins at the optimal load, and that the run continues; return None if a foot would
    lift.

    A foot that is kept and pulls rubs as if it pressed: with it the optimum is another, and several motions
    are possible.
    """
    scene, stance = random_stance(seed, static_ratio)
    time, normals, lacks = stance.gives_way(1.0)
    if normals.min() < PRESSED or lacks > CONVERGED:
        return None
    try:
        run = pn.simulate(scene, time + beyond)
    except pn.FrictionParadoxError as several:
        run = several.trajectory
        if not any(event.kind == "pull" for event in run.events):
            onset = stance.plate(stance.mu).onset(run.t[-1])
            kinetic = stance.mu / static_ratio
            if len(stance.plate(kinetic).sharings(run.t[-1], 0.0, 0.0, onset, kinetic)) < 2:
                raise
            return None
    if any(event.kind == "pull" and event.time < time for event in run.events):
        return None
    first = min(event.time for event in run.events if event.kind == "slip")
    assert first == pytest.approx(time, rel=GIVE_WAY)
    return run.stats.steps


@pytest.mark.parametrize("seed", seeds(range(12), count=3))
def test_stances(seed):
    check_stance(seed, 1.15, 0.01)


@pytest.mark.parametrize("seed", [34, 97, 538])
def test_what_gives_way_before_another_event_of_the_same_step(seed):
    """A kept foot begins to pull within the step: by then the feet slip already."""
    assert check_stance(seed, 1.15, 1.0)


def test_feet_that_the_others_hold_stick_as_slip_begins():
    assert check_stance(812, 1.0, 1.0)


@pytest.mark.stress
@pytest.mark.parametrize("static_ratio", [1.0, 1.15])
def test_many_stances(static_ratio):
    steps = [check_stance(seed, static_ratio, 1.0) for seed in range(1000)]
    told = [count for count in steps if count is not None]
    print(len(told), "stances, steps at most", max(told), "and in the middle", np.median(told))
    assert len(told) > 300


def pulse(seed):
    """Feet under a push of 5 to 63 ms beyond their limits, with the time of slip onset and a later time."""
    rng = np.random.default_rng(seed)
    feet, mu = star(int(rng.integers(3, 6)), 0.1), 0.5
    peak, length, part = rng.uniform(0.3, 2.0), 10.0 ** rng.uniform(-2.3, -1.2), rng.uniform(1.02, 2.0)
    way, most = rng.uniform(0.0, 2.0 * np.pi), mu * part * 10.0 * GRAVITY

    def wrench(t):
        size = most * np.exp(-(((t - peak) / length) ** 2))
        return np.array([size * np.cos(way), size * np.sin(way), 0.0, 0.0, 0.0, 0.0])

    scene, oracle = plate(feet, mu, wrench, [0.0, 0.0, -0.1], unilateral=bool(rng.random() < 0.5))
    begins = brentq(lambda t: oracle.excess(t)[0], peak - 5.0 * length, peak, xtol=1e-12)
    return scene, begins, peak + 10.0 * length


@pytest.mark.parametrize(
    "seed", [10, 13, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (21, 23, 32, 52, 58))]
)
def test_a_push_within_a_step_at_rest(seed):
    """Elements that stick at the end of the step have slipped inside it."""
    scene, begins, after = pulse(seed)
    run = pn.simulate(scene, after)
    first = min(event.time for event in run.events if event.kind == "slip")
    assert first == pytest.approx(begins, rel=GIVE_WAY)


def test_four_feet_give_way_together():
    """A star of feet is pulled at one foot: all feet stick until slip onset."""
    star = [(0.3 * np.cos(x), 0.3 * np.sin(x), -0.3) for x in np.arange(4) * np.pi / 2]
    scene = block_on_feet(star, lambda t: [0.0, 60.0 * t, 0.0, 0.0, 0.0, 0.0], star[0], 0.5)
    run = pn.simulate(scene, 0.6)
    slips = [event.time for event in run.events if event.kind == "slip"]
    assert slips
    before = scene.solve(*scene.project(), min(slips) - 1e-9)
    assert (before.modes == 0).all()
