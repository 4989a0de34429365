"""Tension events of bilateral contacts and wheels, against a linear program."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.hyperstatic import constraint_force, largest_least_load, minimum_norm, pressing_rows

from ....support.mechanisms import GRAVITY, assert_close, body, empty, frame
from ....support.seeds import seeds

# Rounding of loads: products of a dozen numbers and a least-squares solution.
ROUNDING = 1e-9
# Error of the time at which a load is zero, by the tolerance of a step.
INSTANT = 1e-8


def kinds(run):
    return [event.kind for event in run.events]


# --- Feet ---------------------------------------------------------------------------------------------------


def stance(seed, mu=0.0, wrench=None):
    """Return a body on three to eight feet in a plane, under a wrench that grows until the body tips."""
    rng = np.random.default_rng(seed)
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "body", 10.0, inertia=0.3 * np.eye(3))
    n = int(rng.integers(3, 9))
    angles = (
        np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
        if n > 4
        else 2.0 * np.pi * (np.arange(n) + rng.uniform()) / n
    )
    feet = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(0.2, 0.4, (n, 1))
    if n > 4:
        feet[:3] = 0.35 * np.column_stack([np.cos([0.0, 2.1, 4.2]), np.sin([0.0, 2.1, 4.2])])
    for k, (x, y) in enumerate(feet):
        frame(model, f"foot{k}", joint, pin.SE3(np.eye(3), np.array([x, y, -0.1])))
    way = rng.uniform(-np.pi, np.pi)
    push = [0.0, 0.0, rng.uniform(-20.0, 20.0), 12.0 * np.cos(way), 12.0 * np.sin(way), 0.0]
    q = pin.neutral(model)
    q[2] = 0.1
    contacts = [pn.PointContact(f"foot{k}", mu=mu, unilateral=False) for k in range(n)]
    force = pn.Wrench("body", wrench or (lambda t: [t * x for x in push]))
    return pn.Scene(model, contacts=contacts, forces=[force], q0=q)


def check_instant(scene, run):
    """Check that the first tension event is at the end of feasible compressive loads by a linear program."""
    pulls = [event.time for event in run.events if event.kind == "pull"]
    pressing = pressing_rows(scene)
    margin = [
        largest_least_load(*constraint_force(scene, q, v, t), pressing)
        for q, v, t in zip(run.q, run.v, run.t, strict=True)
    ]
    size = np.abs(run.lam).max()
    if not pulls:
        assert min(margin) > -ROUNDING * size
        return False
    first = pulls[0]
    here = int(np.argmin(np.abs(run.t - first)))
    before = run.t < first - INSTANT
    assert (np.array(margin)[before] > 0.0).all()
    at_rest, v = run.q[here], run.v[here]
    assert abs(largest_least_load(*constraint_force(scene, at_rest, v, first), pressing)) < 1e-6 * size
    rate = [
        largest_least_load(*constraint_force(scene, at_rest, v, first + h), pressing)
        for h in (-INSTANT, INSTANT)
    ]
    assert rate[0] > -1e-12 * size
    assert rate[1] < 1e-12 * size
    for k in np.flatnonzero(run.t < first - INSTANT):
        A, force = constraint_force(scene, run.q[k], run.v[k], run.t[k])
        assert_close(run.lam[k], minimum_norm(A, force), 1e-5 * size)
    return True


@pytest.mark.parametrize("seed", seeds([*range(15), 941]))
def test_feet_pull_when_no_sharing_lets_them_all_press(seed):
    scene = stance(seed)
    assert check_instant(scene, pn.simulate(scene, 6.0, record="forces", output_dt=0.2))


@pytest.mark.stress
@pytest.mark.parametrize("block", range(10))
def test_many_stances(block):
    failed, pulled = [], 0
    for seed in range(100 * block, 100 * (block + 1)):
        scene = stance(seed)
        try:
            pulled += check_instant(scene, pn.simulate(scene, 6.0, record="forces", output_dt=0.2))
        except AssertionError as error:
            failed.append((seed, str(error)[:200]))
    assert not failed
    assert pulled >= 90  # in some cases the growing load is compressive


@pytest.mark.parametrize(
    "method", [{}, {"method": "dopri5"}, {"method": "rk4", "dt": 0.01}, {"method": "moreau", "dt": 0.01}]
)
def test_a_table_tips_over_two_of_its_legs(method):
    """Tension begins when the resultant leaves the table, at a known time, despite equal initial loads."""
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "table", 10.0, inertia=0.3 * np.eye(3))
    corners = [(0.3, 0.2), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2)]
    for k, (x, y) in enumerate(corners):
        frame(model, f"leg{k}", joint, pin.SE3(np.eye(3), np.array([x, y, -0.1])))
    q = pin.neutral(model)
    q[2] = 0.1
    scene = pn.Scene(
        model,
        contacts=[pn.PointContact(f"leg{k}", unilateral=False) for k in range(4)],
        forces=[pn.Wrench("table", lambda t: [0.0, 0.0, 0.0, 6.0 * t, 10.0 * t, 0.0])],
        q0=q,
    )
    run = pn.simulate(scene, 4.0, record="forces", output_dt=0.01, **method)
    weight = 10.0 * GRAVITY
    instant = min(0.3 * weight / 10.0, 0.2 * weight / 6.0)  # the resultant is at (My, -Mx) / weight
    pulls = [event for event in run.events if event.kind == "pull"]
    late = 0.01 if method.get("method") == "moreau" else INSTANT
    assert -INSTANT < pulls[0].time - instant < late
    # The resultant moves toward +x, so the other two legs have tension.
    assert {event.element for event in pulls[:2]} == {"PointContact(leg2)", "PointContact(leg3)"}
    assert_close(run.lam[0], weight / 4.0, 1e-9)


# --- Wheels -------------------------------------------------------------------------------------------------


def cart(force):
    """Return a cart on four rolling wheels, with a force high above its center."""
    model = empty()
    frame_joint = body(
        model,
        0,
        pin.JointModelFreeFlyer(),
        "cart",
        20.0,
        lever=(0.0, 0.0, 0.3),
        inertia=np.diag([1.0, 1.0, 1.0]),
    )
    frame(model, "hook", frame_joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])))
    for k, (x, y) in enumerate([(0.4, 0.3), (0.4, -0.3), (-0.4, -0.3), (-0.4, 0.3)]):
        place = pin.SE3(np.eye(3), np.array([x, y, 0.0]))
        body(model, frame_joint, pin.JointModelRY(), f"wheel{k}", 1.0, place=place, inertia=0.005 * np.eye(3))
    q = pin.neutral(model)
    q[2] = 0.1
    return pn.Scene(
        model,
        constraints=[pn.Rolling(f"wheel{k}", 0.1, axis="y") for k in range(4)],
        forces=[pn.Wrench("hook", force)],
        q0=q,
    )


@pytest.mark.parametrize("side", [0.0, 0.3])
def test_wheels_pull_when_the_cart_must_rear_up(side):
    scene = cart(lambda t: [100.0 * t, 60.0 * side * t, 0.0, 0.0, 0.0, 0.0])
    run = pn.simulate(scene, 4.0, record="forces", output_dt=0.1)
    assert check_instant(scene, run)
    assert all(event.element.startswith("Rolling") for event in run.events)


def test_a_wheel_alone_reports_its_pull():
    """A lift of 30 N/s balances the weight of 1 kg after g/30."""
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "ball", 1.0, inertia=0.01 * np.eye(3))
    assert joint == 1
    scene = pn.Scene(
        model,
        constraints=[pn.Rolling("ball", 0.1)],
        forces=[pn.Wrench("ball", lambda t: [0.0, 0.0, 30.0 * t, 0.0, 0.0, 0.0])],
        q0=[0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0],
    )
    run = pn.simulate(scene, 1.0)
    assert kinds(run) == ["pull"]
    assert_close(run.events[0].time, GRAVITY / 30.0, 1e-9)
