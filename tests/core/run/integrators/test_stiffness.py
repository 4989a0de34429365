"""A run with tiny steps due to stiffness raises a StiffnessError, and no other run does."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, StepSizeError, StiffnessError, WallTimeError

from ....support.mechanisms import body, empty
from ....support.refusals import refuses
from ....support.same_run import assert_same_run

EXPLICIT = ["dop853", "dopri5"]
# Error of a rate by power iteration, and of an oscillation rate by its plane.
RATE = 0.05


def on_a_rail(**parts):
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "slide", 1.0)
    return pn.Scene(model, **parts)


def pulled(viscous, **friction):
    law = pn.JointFriction("slide", viscous=viscous, **friction)
    return on_a_rail(laws=[law], actuation=lambda t, q, v: [1.0])


@pytest.mark.parametrize("method", EXPLICIT)
@pytest.mark.parametrize("rtol", [1e-3, 1e-8, 1e-12])
@pytest.mark.parametrize("viscous", [1e6, 1e9, 1e12])
def test_stiff_damping_ends_with_its_name_and_rate(method, rtol, viscous):
    with pytest.raises(StiffnessError) as caught:
        pn.simulate(pulled(viscous), 1.0, method=method, rtol=rtol)
    error = caught.value
    assert re.match(
        r'joint "slide" is stiff at t = [-+.0-9e]+ s: its motion relaxes at [+.0-9e]+ 1/s, and an explicit '
        r"method needs equally short steps, too many to reach the end; check its damping, stiffness and "
        r'inertia, use method="Radau", or allow the steps with max_steps; the trajectory up to this time is '
        r"in error\.trajectory$",
        str(error),
    )
    assert error.joint == "slide"
    assert error.rate == pytest.approx(viscous, rel=RATE)
    assert len(error.trajectory) > 100
    assert error.trajectory.t[-1] <= error.time


@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
def test_the_named_method_gets_through(method):
    run = pn.simulate(pulled(1e11), 1.0, method=method)
    assert run.v[-1, 0] == pytest.approx(1e-11, abs=1e-13)
    assert run.stats.steps < 500


@pytest.mark.parametrize("damping_ratio", [1.0, 0.2])
def test_a_stiff_spring_that_is_damped(damping_ratio):
    omega = 1e7
    spring = pn.JointSpring("slide", omega**2, damping=2.0 * damping_ratio * omega)
    with pytest.raises(StiffnessError) as caught:
        pn.simulate(on_a_rail(forces=[spring], v0=[1.0]), 1.0)
    assert caught.value.rate == pytest.approx(omega, rel=0.5 if damping_ratio == 1.0 else RATE)


def test_the_stiff_joint_of_several():
    """The inertia of a finger is a millionth of its damping; the other end of the arm has a loop."""
    model, joint = empty(), 0
    for k, mass in enumerate([2.0, 1.0, 0.5]):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.4 if k else 0.0]))
        joint = body(model, joint, pin.JointModelRY(), f"arm{k}", mass, place=place, lever=(0.0, 0.0, -0.2))
    body(model, joint, pin.JointModelRX(), "finger", 1e-6, lever=(0.0, 1e-3, 0.0))
    laws = [pn.JointFriction(name, viscous=0.1) for name in ("arm0", "arm1", "arm2", "finger")]
    with pytest.raises(StiffnessError) as caught:
        pn.simulate(pn.Scene(model, laws=laws, q0=[1.0, 0.5, 0.2, 0.1]), 1.0)
    assert caught.value.joint == "finger"
    run = pn.simulate(pn.Scene(model, laws=laws, q0=[1.0, 0.5, 0.2, 0.1]), 1.0, method="Radau", rtol=1e-6)
    assert run.t[-1] == 1.0


def test_pr2_with_the_damping_of_its_wheels():
    """A robot of 36 freedoms with one damping rate of 1e11 1/s, as a file in use has it."""
    pr2 = pn.load("pr2")
    name = "r_gripper_l_finger_joint"
    joint = pr2.model.joints[pr2.model.getJointId(name)]
    laws = [law for law in pr2.laws if law.joint != name]
    M = pin.crba(pr2.model, pr2.model.createData(), pr2.q0)
    laws.append(pn.JointFriction(name, viscous=1e11 * float(M[joint.idx_v, joint.idx_v])))
    scene = pn.Scene(pr2.model, laws=laws, q0=pr2.q0, v0=pr2.v0)
    with pytest.raises(StiffnessError) as caught:
        pn.simulate(scene, 1.0)
    assert caught.value.joint == name
    run = pn.simulate(scene, 1.0, method="Radau", rtol=1e-5, atol=1e-7)
    assert run.t[-1] == 1.0
    assert run.stats.evaluations < 30000


def test_stiff_friction_that_crowds_its_events():
    """Slip below all tolerances turns at every step; the time stepping that bridges it must be stable."""
    with pytest.raises(StiffnessError):
        pn.simulate(pulled(1e11, coulomb=0.1), 1.0, v=[1.0])


def test_a_force_that_leaps_is_not_stiff():
    """A force with a million jumps a second crowds events; a sticking element beside it keeps sticking."""
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "slide", 1.0)
    body(model, 0, pin.JointModelPY(), "beside", 1.0)
    friction = pn.JointFriction("slide", coulomb=0.5)
    leap = pn.UserLaw(lambda t, q, v, lam: np.array([0.0, -1.0 if v[1] > 0.0 else 0.0]))
    alone, both = (
        pn.simulate(
            pn.Scene(model, laws=laws, actuation=lambda t, q, v: [np.sin(3e6 * t), 0.0]), 1e-3, atol=1e-12
        )
        for laws in ([friction], [friction, leap])
    )
    assert any(event.kind == "chatter" for event in both.events)
    assert both.v[-1, 1] == 0.0
    assert both.v[-1, 0] == pytest.approx(alone.v[-1, 0], abs=1e-9)


def test_rollout_tells_of_it_too():
    scene = pulled(1e9)
    with pytest.raises(StiffnessError) as caught:
        pn.rollout(scene, np.zeros((2, 1)), np.array([[0.0], [1.0]]), 1.0)
    assert caught.value.index is not None


def test_a_run_that_was_resumed_stops_at_the_same_step(tmp_path):
    path = tmp_path / "run.npz"

    scene = pulled(1e8)
    with pytest.raises(StiffnessError) as whole:
        pn.simulate(scene, 1.0)
    calls = 0

    def torque(t, q, v):
        nonlocal calls
        calls += 1
        if calls == 8000:
            raise KeyboardInterrupt
        return [1.0]

    stopped = on_a_rail(laws=scene.laws, actuation=torque)
    with pytest.raises(pn.RunInterrupted):
        pn.simulate(stopped, 1.0, checkpoint=path, checkpoint_interval=0.0)
    with pytest.raises(StiffnessError) as resumed:
        pn.resume(path, stopped)
    assert resumed.value.time == whole.value.time
    assert_same_run(whole.value.trajectory, resumed.value.trajectory)


# --- The number of steps ------------------------------------------------------------------------------------


def test_the_steps_that_a_run_may_take():
    scene = pn.load("four_bar")
    free = pn.simulate(scene, 1.0)
    enough = pn.simulate(scene, 1.0, max_steps=free.stats.steps)
    assert_same_run(free, enough)
    with pytest.raises(StepSizeError) as caught:
        pn.simulate(scene, 1.0, max_steps=free.stats.steps - 1)
    assert not isinstance(caught.value, StiffnessError)
    assert str(caught.value).startswith(
        f"the run has taken all of its max_steps = {free.stats.steps - 1} steps by t = "
    )
    assert caught.value.trajectory.stats.steps == free.stats.steps - 1
    with pytest.raises(StepSizeError, match="max_steps = 3 steps"):
        pn.simulate(scene, 1.0, method="BDF", max_steps=3)


@pytest.mark.slow
def test_a_stiff_run_that_may_take_its_steps():
    run = pn.simulate(pulled(3e5), 2.0, max_steps=np.inf, output_dt=1.0)
    assert run.stats.steps > 9e4
    assert run.v[-1, 0] == pytest.approx(1.0 / 3e5, rel=1e-3)
    with pytest.raises(StiffnessError):
        pn.simulate(pulled(1e5), 1.0, max_steps=1200)


@pytest.mark.parametrize("wrong", [0, -1, 2.5, True, "many", float("nan")])
def test_a_wrong_number_of_steps(wrong):
    with refuses("simulate: max_steps must be", InputError):
        pn.simulate(pulled(1.0), 1.0, max_steps=wrong)


# --- Slow runs of fast motions ---------------------------------------------------------------------


def beam(links: int = 30, damping: float = 0.0) -> pn.Scene:
    """A cantilever of 1 m in links with springs: its fastest mode swings a thousand times its first."""
    model, joint, length = empty(), 0, 1.0 / links
    about = length**3 / 12.0
    for k in range(links):
        place = pin.SE3(np.eye(3), np.array([length if k else 0.0, 0.0, 0.0]))
        inertia, lever = np.diag([1e-6, about, about]), np.array([0.5 * length, 0.0, 0.0])
        joint = body(
            model, joint, pin.JointModelRY(), f"j{k}", length, place=place, inertia=inertia, lever=lever
        )
    stiffness = 100.0 / length
    return pn.Scene(
        model, forces=[pn.JointSpring(f"j{k}", stiffness, damping=damping * stiffness) for k in range(links)]
    )


def test_a_stiff_beam_says_within_a_second_what_it_follows():
    with (
        pytest.warns(RuntimeWarning, match=r'simulate: from t = .* s on joint "j\d+" swings at') as told,
        pytest.raises(WallTimeError) as caught,
    ):
        pn.simulate(beam(), 10.0, max_wall=1.0)
    assert len(told) == 1
    assert 'damp them and use method="Radau"' in str(told[0].message)
    assert told[0].filename == __file__
    assert str(told[0].message).removeprefix("simulate: ") in caught.value.trajectory.notes
    rate = float(re.search(r"at ([-+.0-9e]+) rad/s", str(told[0].message))[1])
    scene = beam()
    M = pin.crba(scene.model, scene.model.createData(), scene.q0)
    fastest = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, 3000.0 * np.eye(30))).real.max())
    assert 0.3 * fastest < rate < 1.1 * fastest


def test_a_damped_beam_goes_through_by_the_method_that_is_named():
    scene = beam(damping=1e-3)
    with pytest.raises(StiffnessError, match='use method="Radau"'):
        pn.simulate(scene, 1.0)
    run = pn.simulate(scene, 1.0, method="Radau", rtol=1e-4, atol=1e-6)
    assert run.stats.steps < 1000


def test_what_is_allowed_by_max_steps_is_not_told(recwarn):
    with pytest.raises(StepSizeError):
        pn.simulate(beam(), 10.0, max_steps=3000)
    assert not [w for w in recwarn if "swings" in str(w.message)]


# --- No false alarm -----------------------------------------------------------------------------------------


def swings():
    """Return motions with little or no damping: step sizes follow the motion at any tolerance."""
    pendulum = empty()
    joint = body(pendulum, 0, pin.JointModelRY(), "a", 1.0, lever=(0.0, 0.0, -0.5))
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    body(pendulum, joint, pin.JointModelRY(), "b", 1.0, place=place, lever=(0.0, 0.0, -0.5))
    four_bar = pn.load("four_bar")
    return {
        "spring": on_a_rail(forces=[pn.JointSpring("slide", 1e6)], v0=[1.0]),
        "lightly damped": on_a_rail(forces=[pn.JointSpring("slide", 1e6, damping=20.0)], v0=[1.0]),
        "pendulum": pn.Scene(pendulum, q0=[2.0, 1.0]),
        "loop": pn.Scene(four_bar.model, constraints=four_bar.constraints, q0=four_bar.q0, v0=four_bar.v0),
        "disk": pn.load("rolling_disk"),
    }


@pytest.mark.parametrize("method", EXPLICIT)
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-12])
@pytest.mark.parametrize("name", list(swings()))
def test_what_swings_is_not_stiff(method, rtol, name):
    with pytest.raises(StepSizeError, match="the run has taken all of its max_steps = 2500 steps") as caught:
        pn.simulate(swings()[name], 1e5, method=method, rtol=rtol, atol=0.01 * rtol, max_steps=2500)
    assert not isinstance(caught.value, StiffnessError)


@pytest.mark.stress
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("name", [name for name, _ in pn.robots()])
def test_robots_run_without_alarm(name, rtol):
    run = pn.simulate(
        pn.load(name), 10.0 if name != "andrews_squeezer" else 0.03, rtol=rtol, atol=0.01 * rtol
    )
    assert run.stats.steps < 1e5
