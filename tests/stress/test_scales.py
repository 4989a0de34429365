"""Masses, lengths and rows of very unequal size."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.rods import rods

from ..support.mechanisms import empty
from .measure import at_most, finite, ledger, linkage

TIGHT = {"rtol": 1e-12, "atol": 1e-13}
# Energy error at these tolerances after several hundred steps.
CLOSED = 1e-8
# Positions of bodies as large as R are known to R eps, and their residuals to a few hundred times that.
CLOSURE = 1e-13
# Copies and other scales of rows are the same constraint: they differ by rounding only.
SAME_MOTION = 1e-10


@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("heavy", ["crank", "rocker"])
def test_mass_ratios_in_a_loop(ratio, heavy):
    masses = np.array([1.0, np.sqrt(ratio), ratio]) / np.sqrt(ratio)
    masses = masses if heavy == "rocker" else masses[::-1]
    scene = linkage((0.4, 1.0, 0.8, 1.1), [-1.2, 1.3, 1.5], [1.0, 0.0, 0.0], masses)
    run = pn.simulate(scene, 2.0, record="energy", rtol=1e-10, atol=1e-12)
    at_most("energy balance", ledger(run), CLOSED)
    at_most("violation [m]", run.violation.max(), CLOSURE)


@pytest.mark.parametrize("ratio", [1e4, 1e8])
def test_a_light_pendulum_on_a_heavy_one_moves_as_on_a_wall(ratio):
    """The heavy body hardly feels the light one: its motion is that without it, up to the mass ratio."""
    alone = pn.Scene(rods([1.0], [1.0]), q0=[0.4])
    both = pn.Scene(rods([1.0, 1.0], [1.0, 1.0 / ratio]), q0=[0.4, 0.9])
    options = {"output_dt": 0.1, **TIGHT}
    gap = np.abs(pn.simulate(both, 2.0, **options).q[:, 0] - pn.simulate(alone, 2.0, **options).q[:, 0]).max()
    at_most("difference [rad]", gap, 20.0 / ratio + 1e-10)


@pytest.mark.parametrize("speed", [1e8, 1e12, 1e16])
def test_a_joint_driven_slowly_beside_fast_ones_asks_for_no_more_steps(speed):
    """The velocity of the slow joint has the rounding of the fast joints, far above its tolerance."""
    scene = pn.load("five_bar")
    one = np.ones(scene.model.nv)
    slow, fast = (pn.simulate(scene, 0.5 / s, v=s * one) for s in (1e7, speed))
    np.testing.assert_allclose(fast.q[-1], slow.q[-1], atol=1e-5)  # drag takes a part of 1e-6 of the slow one
    print(f"{fast.stats.steps} steps, {slow.stats.steps} at 1e7 rad/s")
    assert fast.stats.steps <= slow.stats.steps + 2


def windows(lengths):
    """Four-bars of several sizes in one scene."""
    model, constraints = empty(), []
    for k, size in enumerate(lengths):
        rods(np.array([0.4, 1.0, 0.8]) * size, name=f"w{k} ", model=model)
        constraints.append(pn.PointAnchor(f"w{k} tip", axes="xz", name=f"window {k}"))
    return pn.Scene(model, constraints=constraints, q0=np.tile([-1.2, 1.3, 1.5], len(lengths)))


def test_lengths_from_a_tenth_of_a_millimeter_to_ten_kilometers():
    sizes = [1e-4, 1e-2, 1.0, 1e2, 1e4]
    run = pn.simulate(windows(sizes), 0.05, record="energy", rtol=1e-11, atol=1e-12)
    at_most("energy balance", ledger(run), CLOSED)
    at_most("violation over the largest length", run.violation.max() / max(sizes), CLOSURE)
    data = run.scene.model.createData()
    pin.framesForwardKinematics(run.scene.model, data, run.q[-1])
    start = run.scene.model.createData()
    pin.framesForwardKinematics(run.scene.model, start, run.q[0])
    for k, size in enumerate(sizes):  # each window to its own scale
        i = run.scene.model.getFrameId(f"w{k} tip")
        gap = np.abs(data.oMf[i].translation - start.oMf[i].translation)[[0, 2]].max()
        at_most(f"gap of window {k} over its size", gap / size, 1e-9)


def test_each_size_moves_as_it_does_alone():
    """Mechanisms of different size are independent: a window of 0.1 mm beside one of 10 km moves as alone."""
    alone, together = windows([1e-4]), windows([1e-4, 1e4])
    options = {"output_dt": 1e-3, **TIGHT}
    gap = pn.simulate(together, 0.02, **options).q[:, :3] - pn.simulate(alone, 0.02, **options).q
    at_most("difference [rad]", np.abs(gap).max(), 1e-9)


@pytest.mark.parametrize(
    "lengths", [[1e4, 1e2, 1.0, 1e-2, 1e-4], [1e-4, 1e-2, 1.0, 1e2, 1e4], [10.0, 1.0, 1e-3]]
)
def test_a_chain_from_crane_to_finger(lengths):
    """A small link far out has an inertia below the rounding of M: a right run, or an error with a name."""
    try:
        run = pn.simulate(pn.Scene(rods(lengths), q0=np.full(len(lengths), 0.3)), 1.0, record="energy")
    except (pn.SingularMassError, pn.StepSizeError) as error:
        print(f"{type(error).__name__}: {error}")
        assert max(lengths) / min(lengths) > 1e5
    else:
        finite(run)
        at_most("energy balance", ledger(run), 1e-7)


# --- Copies and scales of rows -----------------------------------------------------------------------------

LENGTHS, Q0, V0 = (0.4, 1.0, 0.8, 1.1), [-1.2, 1.3, 1.5], [1.0, 0.0, 0.0]
GRID = {"output_dt": 0.05, **TIGHT}


@pytest.fixture(scope="module")
def plain():
    return pn.simulate(linkage(LENGTHS, Q0, V0), 1.0, **GRID)


def with_constraints(make):
    scene = linkage(LENGTHS, Q0, V0)
    q0, v0 = scene.initial_state()
    return pn.Scene(scene.model, constraints=make(scene), q0=q0, v0=v0)


def assert_same_motion(run, plain):
    at_most("difference of q [rad]", np.abs(run.q - plain.q).max(), SAME_MOTION)
    at_most("difference of v [rad/s]", np.abs(run.v - plain.v).max(), SAME_MOTION)


@pytest.mark.parametrize("copies", range(2, 21))
def test_copies_of_a_loop(copies, plain):
    loop = linkage(LENGTHS, Q0, V0).constraints[0]
    names = [f"loop {k}" for k in range(copies)]
    scene = with_constraints(lambda _: [dataclasses.replace(loop, name=name) for name in names])
    assert_same_motion(pn.simulate(scene, 1.0, **GRID), plain)


def closure(scene, scale, name="own"):
    """The loop of a linkage as a user's rows, row by row times `scale`."""
    model = scene.model
    data, tip = model.createData(), model.getFrameId("jtip")
    pinned = np.array([LENGTHS[3], 0.0])
    scale = np.asarray(scale) * np.ones(2)

    def rows(q, v):
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data)
        pin.updateFramePlacements(model, data)
        axes = pin.LOCAL_WORLD_ALIGNED
        A = pin.getFrameJacobian(model, data, tip, axes)[[0, 2]]
        drift = pin.getFrameClassicalAcceleration(model, data, tip, axes).linear[[0, 2]]
        return scale[:, None] * A, -scale * drift

    def residual(t, q):
        pin.framesForwardKinematics(model, data, q)
        return scale * (data.oMf[tip].translation[[0, 2]] - pinned)

    return pn.UserConstraint(
        lambda t, q, v, _: rows(q, v),
        2,
        residual=residual,
        rate=lambda t, q, v: rows(q, v)[0] @ v,
        name=name,
    )


SCALES = {
    "small": [[1e-6, 1e-6]],
    "large": [[1e6, 1e6]],
    "small and large": [[1e-6, 1e6]],
    "unequal copies": [[1e-6, 1e-3], [1e6, 1.0]],
    "ten": [[10.0**k, 10.0**-k] for k in range(-5, 5)],
}


@pytest.mark.parametrize("case", SCALES)
def test_scales_of_rows(case, plain):
    own = [(scale, f"own {k}") for k, scale in enumerate(SCALES[case])]
    scene = with_constraints(lambda s: [closure(s, scale, name) for scale, name in own])
    assert_same_motion(pn.simulate(scene, 1.0, **GRID), plain)


def test_scaled_copies_beside_the_loop_itself(plain):
    scene = with_constraints(
        lambda s: [s.constraints[0], closure(s, 1e-6, "small"), closure(s, 1e6, "large")]
    )
    assert_same_motion(pn.simulate(scene, 1.0, **GRID), plain)


def test_copies_that_are_found_only_in_the_run_leave_friction_a_load():
    """Copies given as functions are found at the first step, before the evaluation of the laws."""
    robot = pn.load("four_bar")
    names = [f"own {k}" for k in range(3)]
    frames = [robot.model.getFrameId(n) for n in ("coupler_tip", "rocker_tip")]
    data = robot.model.createData()

    def rows(t, q, v, _):
        pin.forwardKinematics(robot.model, data, q, v, np.zeros(robot.model.nv))
        pin.computeJointJacobians(robot.model, data)
        pin.updateFramePlacements(robot.model, data)
        axes = pin.LOCAL_WORLD_ALIGNED
        A = [pin.getFrameJacobian(robot.model, data, f, axes)[[0, 2]] for f in frames]
        drift = [pin.getFrameClassicalAcceleration(robot.model, data, f, axes).linear[[0, 2]] for f in frames]
        return A[0] - A[1], drift[1] - drift[0]

    def made(constraints):
        return pn.Scene(
            robot.model,
            constraints=constraints,
            laws=robot.laws,
            actuation=robot.actuation,
            q0=robot.initial_state()[0],
            v0=robot.initial_state()[1],
        )

    def rate(t, q, v):
        return rows(t, q, v, None)[0] @ v

    alone = made([pn.UserConstraint(rows, 2, rate=rate, name="own")])
    copies = made([pn.UserConstraint(rows, 2, rate=rate, name=name) for name in names])
    options = {"output_dt": 0.01, **TIGHT}
    gap = pn.simulate(copies, 0.1, **options).q - pn.simulate(alone, 0.1, **options).q
    at_most("difference of q [rad]", np.abs(gap).max(), SAME_MOTION)
