"""Runs that cannot go on: contradictions, loops that do not close, functions that fail, interruptions."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import (
    InconsistentConstraintsError,
    InputError,
    LoopClosureError,
    NonFiniteError,
    StepSizeError,
)

from ..support.random_trees import add, tree
from ..support.refusals import refuses

# --- Constraints that cannot be met ------------------------------------------------------------------------


def chain():
    model = tree(["revolute x", "prismatic y", "revolute z"], np.random.default_rng(0), parents=[0, 1, 2])
    model.name = "chain"
    return model


def drives(first, second, joint="j0"):
    motions = [pn.PrescribedMotion(joint, f, name=n) for n, f in (("one", first), ("two", second))]
    return pn.Scene(chain(), constraints=motions)


def test_drives_that_ask_for_two_places():
    """The projection returns the place between both demands."""
    message = (
        'loop "one" does not close: gap 0.5; loop "two" does not close: gap 0.5 after several starts; '
        "check the lengths and frames, or start nearer"
    )
    with refuses(message, LoopClosureError) as caught:
        pn.simulate(drives(pn.constant(0.0), pn.constant(1.0)), 1.0)
    assert caught.value.gaps == pytest.approx({"one": 0.5, "two": 0.5})


# A gap beyond this part of the scene's size ends the run [m].
OPEN = 1e-9

ROD = [("dop853", {}), ("rk4", {"dt": 0.01}), ("moreau", {"dt": 0.01}), ("Radau", {})]


@pytest.mark.parametrize(("method", "options"), ROD)
def test_a_rod_that_shrinks_to_less_than_nothing(method, options):
    model = pin.Model()
    bob = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "bob")
    model.appendBodyToJoint(bob, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("bob", bob, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    rod = pn.Distance("bob", "universe", pn.polynomial([1.0, -1.0]), name="rod")
    scene = pn.Scene(model, constraints=[rod], q0=[0.0, 0.0, -1.0])
    with refuses('loop "rod" has opened by t = ', LoopClosureError) as caught:
        pn.simulate(scene, 2.0, method=method, record="energy", **options)
    error = caught.value
    assert error.gaps["rod"] > OPEN
    assert error.time > error.trajectory.t[-1] > 0.0
    assert error.trajectory.violation.max() < OPEN
    assert len(error.trajectory.energy["total"]) == len(error.trajectory.q) == len(error.trajectory)
    assert "all constraints: check lengths and drives; the trajectory up to this time" in str(error)


def over_the_top():
    """The rocker of a crank-rocker driven at a constant rate, which cannot go around: it locks on the way."""
    start = pn.load("four_bar")
    turn = pn.polynomial([start.q0[2], start.v0[2]])
    drive = pn.PrescribedMotion("rocker_joint", turn, name="drive")
    return pn.Scene(start.model, constraints=[*start.constraints, drive], q0=start.q0, v0=start.v0)


@pytest.mark.parametrize("method", ["rk4", "moreau", "semi_implicit_euler"])
def test_a_drive_that_pulls_a_loop_apart(method):
    with refuses('loop "loop" has opened by t = 0.29 s: ', LoopClosureError) as caught:
        pn.simulate(over_the_top(), 1.0, method=method, dt=0.01)
    assert caught.value.trajectory.t[-1] == pytest.approx(0.28)
    assert caught.value.trajectory.violation.max() < 1e-12


@pytest.mark.parametrize("method", ["dop853", "dopri5"])
def test_small_steps_end_where_a_mechanism_locks(method):
    """There the velocity of the crank grows without bound, which the step size may notice before the gap."""
    with pytest.raises((LoopClosureError, StepSizeError)) as caught:
        pn.simulate(over_the_top(), 1.0, method=method)
    assert caught.value.time - caught.value.trajectory.t[-1] < 1e-6
    assert 0.28 < caught.value.time < 0.29
    assert caught.value.trajectory.violation.max() < OPEN


@pytest.mark.parametrize("method", ["dop853", "Radau"])
def test_a_run_off_its_constraints_is_refused(method, monkeypatch):
    """With a tolerance of zero, the first sample of a closed loop with rounding counts as open."""
    scene = pn.load("four_bar")
    residual = pn.simulate(scene, 0.2, method=method).violation
    first = int((residual > 0.0).argmax())
    monkeypatch.setattr("pin_nonideal.simulation.results.MAX_RESIDUAL", 0.0)
    with refuses('loop "loop" has opened by t = ', LoopClosureError) as caught:
        pn.simulate(scene, 0.2, method=method)
    assert caught.value.gaps == {"loop": pytest.approx(residual[first], abs=1e-15)}
    assert len(caught.value.trajectory) == first


def test_a_model_that_cannot_move():
    with refuses('simulate: "post" has no joint that moves; there is nothing to simulate', InputError):
        pn.simulate(pn.Scene(pin.Model(), name="post"), 1.0)


def test_drives_that_ask_for_two_velocities():
    message = 'no velocity satisfies the constraints at t = 0.00 s: "two" violates its rate by 1.0e+00'
    with refuses(message, InconsistentConstraintsError):
        pn.simulate(drives(pn.polynomial([0.0, 1.0]), pn.constant(0.0)), 1.0)


def test_drives_that_ask_for_two_accelerations():
    scene = drives(pn.polynomial([0.0, 0.0, 1.0]), pn.constant(0.0))
    message = 'constraints "two" and "one" contradict each other: residual 2.0e+00 m/s^2 at t = 0.00 s; '
    message += "leave one of them out, or give both the same motion"
    for call in (scene.solve, scene.acceleration):
        with refuses(message, InconsistentConstraintsError):
            call(np.zeros(3), np.zeros(3))
    with refuses(
        f"{message}; the trajectory up to this time is in error.trajectory", InconsistentConstraintsError
    ):
        pn.simulate(scene, 1.0)


def test_drives_that_part_in_mid_run():
    """Two constraints are equal until t = 0.5 s. Equality at one instant must not remove either."""

    def parting(t):
        s = max(t - 0.5, 0.0)
        return (s**3, 3.0 * s**2, 6.0 * s)

    with pytest.raises(
        InconsistentConstraintsError, match='constraints "two" and "one" contradict each'
    ) as caught:
        pn.simulate(drives(parting, pn.constant(0.0)), 1.0)
    assert caught.value.time == pytest.approx(0.5, abs=1e-2)
    assert 0.4 < caught.value.trajectory.t[-1] < 0.6


def test_rows_of_one_constraint_that_contradict():
    A = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    own = pn.UserConstraint(lambda t, q, v, data: (A, [0.0, 1.0]), 2, name="own")
    message = 'constraint "own" contradicts itself: residual 1.0e+00 m/s^2 at t = 0.00 s'
    with refuses(message, InconsistentConstraintsError):
        pn.Scene(chain(), constraints=[own]).solve(np.zeros(3), np.zeros(3))


def test_a_row_that_moves_nothing_and_asks_for_something():
    model = pn.load("four_bar").model  # moves in x and z only
    model.addFrame(
        pin.Frame("beside", 0, 0, pin.SE3(np.eye(3), np.array([0.0, 0.2, 0.0])), pin.FrameType.OP_FRAME)
    )
    message = (
        'loop "side" does not close: gap 0.2 in row 0, a direction in which no joint moves; '
        "correct the placement of the frames"
    )
    with refuses(message, LoopClosureError):
        pn.Scene(model, constraints=[pn.PointAnchor("coupler_tip", "beside", axes="y", name="side")])


def test_a_rod_that_is_too_long():
    model = tree(["revolute x", "revolute y"], np.random.default_rng(2), parents=[0, 1])
    scene = pn.Scene(model, constraints=[pn.Distance("j0 tip", "j1 tip", length=50.0, name="rod")])
    message = 'loop "rod" does not close: gap 50 after several starts'
    for call in (scene.project, scene.initial_state, lambda: pn.simulate(scene, 1.0)):
        with pytest.raises(LoopClosureError, match=message) as caught:
            call()
        assert caught.value.gaps["rod"] > 40.0


def test_a_rod_that_grows_too_long():
    """At full stretch no motion exists. The run ends there and keeps its samples."""
    model = tree(["revolute x", "revolute x"], np.random.default_rng(1), parents=[0, 1])
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([0.3, 0.4]))
    ends = (data.oMf[model.getFrameId(f"j{k} tip")].translation for k in (0, 1))
    now = float(np.linalg.norm(np.subtract(*ends)))
    rod = pn.Distance("j0 tip", "j1 tip", length=pn.polynomial([now, 1.0]), name="rod")
    with pytest.raises(
        StepSizeError, match=r'constraint "rod" is in a singular position at t = 0\.'
    ) as caught:
        pn.simulate(pn.Scene(model, q0=[0.3, 0.4], constraints=[rod]), 1.0)
    assert str(caught.value).endswith(
        ", such as full stretch or a dead point, where its rows become dependent and the motion ends or is "
        "not determined; drive another joint, or stay away from the position; the trajectory up to this time "
        "is in error.trajectory"
    )
    run = caught.value.trajectory
    assert len(run) > 5
    assert run.violation.max() < 1e-9


@pytest.mark.parametrize("method", ["dop853", pytest.param("Radau", marks=pytest.mark.slow)])
def test_a_rocker_that_is_driven_through_its_dead_point(method):
    """Looser tolerances do not help there, so the message names the constraints of the position instead."""
    scene = pn.load("four_bar")
    q, _ = scene.project({"crank_joint": 1.0})
    motor = pn.PrescribedMotion("rocker_joint", pn.polynomial([q[2], 1.0]), name="motor")
    driven = scene.replace(add_constraints=[motor], actuation=None, laws=())
    message = r'constraints "loop" and "motor" are in a singular position at t = 0\.927'
    with pytest.raises(StepSizeError, match=message) as caught:
        pn.simulate(driven, 3.0, q=q, method=method)
    assert "rtol" not in str(caught.value)
    assert caught.value.time == pytest.approx(0.92721, abs=1e-5)


# --- Motions that run away ---------------------------------------------------------------------------------


def test_an_acceleration_that_is_not_finite():
    scene = pn.Scene(chain(), forces=[pn.UserForce(lambda t, q, v: 1e308 * np.ones(3))])
    message = "acceleration is not finite at t = 0 s"
    with refuses(message, NonFiniteError):
        scene.solve(np.zeros(3), np.zeros(3))
    hint = "; check the last samples for a force, stiffness or function that grows without bound"
    with refuses(f"{message}{hint}; the trajectory up to this time is in error.trajectory", NonFiniteError):
        pn.simulate(scene, 1.0)


def test_a_velocity_that_grows_beyond_all_bounds():
    model = pin.Model()
    add(model, "p", "prismatic x", 0, np.random.default_rng(0))
    model.gravity = pin.Motion.Zero()
    # Trial steps may overshoot far, and a user's function that overflows would raise another error.
    scene = pn.Scene(model, forces=[pn.UserForce(lambda t, q, v: np.minimum(v, 1e100) ** 3)], v0=[1.0])
    with pytest.raises(StepSizeError, match=r"the step size fell below rounding at t = 0\.") as caught:
        pn.simulate(scene, 10.0)
    mass = model.inertias[1].mass
    assert caught.value.time == pytest.approx(mass / 2.0, rel=1e-6)  # v' = v^3 / m ends there
    assert caught.value.trajectory.v[-1, 0] > 1e3


def test_a_step_too_long_for_its_spring():
    """Fixed steps beyond the stability limit double the motion until it overflows."""
    model = tree(["prismatic y"], np.random.default_rng(0))
    scene = pn.Scene(model, forces=[pn.JointSpring("j0", 1e8)], v0=[1.0])
    with pytest.raises(
        NonFiniteError, match=r"acceleration is not finite at t = \d\.\d+ s: the motion overflows"
    ) as caught:
        pn.simulate(scene, 10.0, method="rk4", dt=0.01)
    run = caught.value.trajectory
    assert 2 < len(run) < 200
    assert np.isfinite(run.v).all()
