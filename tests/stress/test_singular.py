"""Passages through singular positions, and rows that nearly contradict."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.rods import rods
from pin_nonideal.errors import LoopClosureError, StepSizeError

from ..support.mechanisms import body, empty, frame
from .measure import at_most, ledger, linkage

CLOSED = 1e-8
# Residuals of a chain of meters after projection: a few hundred roundings.
CLOSURE = 1e-12
FINE = {"rtol": 1e-12, "atol": 1e-14, "record": "energy"}
long = pytest.mark.stress


def half_turns(q):
    """Return the number of half turns of an angle."""
    return int(np.ptp(q) / np.pi)


@pytest.mark.parametrize("speed", [1.0, 6.0])
@pytest.mark.parametrize("N", [1, 2, 4, 10, pytest.param(40, marks=long)])
def test_windows_that_fold_flat_each_half_turn(N, speed):
    run = pn.simulate(pn.load("n_four_bar", N=N, speed=speed), 10.0, **FINE)
    assert half_turns(run.q[:, 0]) >= 9
    at_most("energy balance", ledger(run), CLOSED)
    at_most("violation [m]", run.violation.max(), CLOSURE)


FLAT = {
    "parallelogram": ((0.5, 1.0, 0.5, 1.0), [-1.57, 1.57, 1.57], [8.0, -8.0, 8.0], 10),
    "long parallelogram": ((1.0, 0.6, 1.0, 0.6), [-1.0, 2.0, 1.5], [5.0, 0.0, 0.0], 10),
    "kite": ((1.0, 0.5, 0.5, 1.0), [-1.0, 1.2, 1.2], [6.0, 0.0, 0.0], 0),
    "no Grashof": ((0.6, 0.7, 0.8, 1.2), [-1.0, 1.0, 1.0], [5.0, 0.0, 0.0], 0),
}


@pytest.mark.parametrize("case", FLAT)
def test_four_bars_that_fold_flat(case):
    lengths, q0, v0, turns = FLAT[case]
    run = pn.simulate(linkage(lengths, q0, v0), 10.0, **FINE)
    assert half_turns(run.q[:, 0]) >= turns
    assert run.t[-1] == 10.0
    at_most("energy balance", ledger(run), CLOSED)
    at_most("violation [m]", run.violation.max(), CLOSURE)


def parallel_robot(*motions, v0=(0.0, 0.0, 0.0, 0.0), q0=(-2.0, 0.8, -1.14, -0.8)):
    """Two arms of two rods that share their tip: singular where the outer rods are in line."""
    model = rods([0.5, 0.5], name="a", start=(-0.3, 0.0, 0.0))
    rods([0.5, 0.5], name="b", start=(0.3, 0.0, 0.0), model=model)
    tip = pn.PointAnchor("atip", "btip", axes="xz", name="tip")
    return pn.Scene(model, constraints=[tip, *motions], q0=q0, v0=v0)


def outer_sine(q):
    """Sine of the angle between the outer rods."""
    return np.sin(q[:, 0] + q[:, 1] - q[:, 2] - q[:, 3])


@pytest.mark.parametrize("v0", [(0.0, 0.0, 0.0, 0.0), (4.0, 0.0, -1.0, 0.0)])
def test_a_parallel_robot_falls_through_its_singularity(v0):
    run = pn.simulate(parallel_robot(v0=v0), 10.0, **FINE)
    crossings = np.count_nonzero(np.diff(np.sign(outer_sine(run.q))))
    print(f"singular positions passed: {crossings}")
    assert crossings > 3
    at_most("energy balance", ledger(run), CLOSED)
    at_most("violation [m]", run.violation.max(), CLOSURE)


def motors(start, speed):
    """Both motors driven at a steady speed, away from each other when it is positive."""
    parts = (("a0", start[0], -speed), ("b0", start[2], speed))
    return [pn.PrescribedMotion(joint, pn.polynomial([x, u]), name=joint) for joint, x, u in parts]


def test_motors_that_stretch_a_parallel_robot_beyond_its_reach():
    """At full stretch the rows of drives and loop lose their rank and no motion goes on: an error by name."""
    start = parallel_robot().initial_state()[0]
    with pytest.raises((LoopClosureError, StepSizeError)) as caught:
        pn.simulate(parallel_robot(*motors(start, 1.0), q0=start), 3.0)
    print(caught.value)
    run = caught.value.trajectory
    # Full stretch: the elbows are two rods apart.
    elbows = np.abs(0.6 + 0.5 * np.cos(run.q[:, 2]) - 0.5 * np.cos(run.q[:, 0]))
    rise = 0.5 * np.abs(np.sin(run.q[:, 2]) - np.sin(run.q[:, 0]))
    at_most("elbows apart, over two rods", np.hypot(elbows, rise).max(), 1.0 + 1e-5)
    at_most("violation [m]", run.violation.max(), 1e-6)


def test_motors_that_fold_a_parallel_robot():
    """The other way round there is no end of reach: one turn of the motors, loop closed all along."""
    start = parallel_robot().initial_state()[0]
    run = pn.simulate(parallel_robot(*motors(start, -1.0), q0=start), 3.0)
    assert run.t[-1] == 3.0
    at_most("violation [m]", run.violation.max(), CLOSURE)


# --- Rows that nearly contradict ---------------------------------------------------------------------------

COUPLED = pn.JointCoupling("a", "b", 2.0, name="gear")


def geared(*more):
    model = empty()
    for name, reach in (("a", 0.5), ("b", 0.3)):
        body(model, 0, pin.JointModelRY(), name, 1.0, lever=(reach, 0.0, 0.0))
    return pn.Scene(model, constraints=[COUPLED, *more])


@pytest.mark.parametrize("gap", [1e-15, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6, 1e-3])
def test_gears_of_nearly_equal_ratio(gap):
    """One gear when the ratios are equal to rounding, at rest where both hold; nothing in between."""
    options = {"rtol": 1e-10, "atol": 1e-12, "output_dt": 0.1}
    free = pn.simulate(geared(), 1.0, **options)
    run = pn.simulate(geared(pn.JointCoupling("a", "b", 2.0 + gap, name="second gear")), 1.0, **options)
    still = np.abs(run.q).max() < 1e-12
    print(f"gap {gap:g}: {'at rest' if still else 'one gear'}, violation {run.violation.max():.1e}")
    if not still:
        at_most("difference [rad]", np.abs(run.q - free.q).max(), 10.0 * gap + 1e-10)
        at_most("violation [rad]", run.violation.max(), 10.0 * gap + 1e-12)
    assert still == (gap > 5e-10)  # the tolerance of rank


@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-6, 1e-3])
def test_anchors_at_nearly_the_same_place(gap):
    """A second pin beside the first: the same to rounding, or a loop that does not close."""
    robot = pn.load("n_four_bar", N=1)
    model = robot.model.copy()
    tip = model.frames[model.getFrameId("crank1_tip")]
    frame(model, "beside", tip.parentJoint, tip.placement * pin.SE3(np.eye(3), np.array([gap, 0.0, 0.0])))
    second = pn.PointAnchor("coupler0_tip", "beside", axes="xz", name="second")
    scene = pn.Scene(model, constraints=[robot.constraints[0], second], q0=robot.q0, v0=robot.v0)
    options = {"rtol": 1e-10, "atol": 1e-12, "output_dt": 0.1}
    if gap >= 1e-9:
        with pytest.raises(LoopClosureError) as caught:
            pn.simulate(scene, 2.0, **options)
        at_most("gap over the one that was made", caught.value.gaps["second"] / gap, 1.01)
        return
    run, one = pn.simulate(scene, 2.0, **options), pn.simulate(robot, 2.0, **options)
    at_most("difference [rad]", np.abs(run.q - one.q).max(), 10.0 * gap + 1e-10)
