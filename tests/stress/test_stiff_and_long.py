"""Stiff forces, long times, and tolerances from useless to impossible."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, StepSizeError

from ..support.mechanisms import body, empty, point_mass
from .measure import at_most, finite, ledger, linkage

long = pytest.mark.stress


def on_a_rail(**parts):
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "x", 1.0)
    return pn.Scene(model, **parts)


@pytest.mark.parametrize("stiffness", [1e4, 1e8, 1e12, 1e16])
def test_stiff_springs_swing_at_their_frequency(stiffness):
    """Ten periods of 1 m: cos(omega t), and the energy of the spring."""
    omega = np.sqrt(stiffness)
    scene = on_a_rail(forces=[pn.JointSpring("x", stiffness)], q0=[1.0])
    duration = 20.0 * np.pi / omega
    run = pn.simulate(scene, duration, rtol=1e-11, atol=1e-11 * np.array([1.0, omega]), record="energy")
    at_most("error over the amplitude", np.abs(run.q[:, 0] - np.cos(omega * run.t)).max(), 1e-8)
    at_most("energy balance over the spring's", np.abs(run.energy["balance"]).max() / (0.5 * stiffness), 1e-8)


def test_a_stiff_spring_in_a_loop():
    """A spring of 1e7 N/m across a four-bar holds it to micrometers, with the ledger closed."""
    scene = linkage((0.4, 1.0, 0.8, 1.1), [-1.2, 1.3, 1.5], [0.0, 0.0, 0.0])
    start = scene.initial_state()[0]
    spring = pn.JointSpring("j0", 1e7, rest=float(start[0]))
    held = pn.Scene(scene.model, constraints=scene.constraints, forces=[spring], q0=start, v0=scene.v0)
    run = pn.simulate(held, 0.05, record="energy", rtol=1e-10, atol=1e-14)
    at_most("way of the crank [rad]", np.ptp(run.q[:, 0]), 1e-4)
    assert np.ptp(run.q[:, 0]) > 1e-8  # it swings, and is not held by a row
    at_most("energy balance", ledger(run), 1e-8)


@pytest.mark.parametrize("viscous", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
def test_stiff_viscous_friction(viscous, method):
    """A pendulum in tar sinks as fast as its weight and the friction agree on."""
    model = empty()
    body(model, 0, pin.JointModelRY(), "j", 1.0, lever=(0.5, 0.0, 0.0))
    tar = pn.JointFriction("j", viscous=viscous)
    run = pn.simulate(pn.Scene(model, laws=[tar], v0=[10.0]), 1.0, method=method, output_dt=0.1)
    sinking = 9.81 * 0.5 * np.cos(run.q[-1, 0]) / viscous
    at_most(
        "speed beside the balance of weight and friction", abs(run.v[-1, 0] / sinking - 1.0), 1.0 / viscous
    )


@pytest.mark.parametrize("viscous", [1e2, pytest.param(1e4, marks=long)])
def test_stiff_viscous_friction_by_an_explicit_method(viscous):
    run = pn.simulate(
        on_a_rail(laws=[pn.JointFriction("x", viscous=viscous)], v0=[10.0]), 1.0, record="energy"
    )
    exact = 10.0 * np.exp(-viscous * run.t)
    at_most("error of v [m/s]", np.abs(run.v[:, 0] - exact).max(), 1e-7)
    at_most(
        "error of q [m]", np.abs(run.q[:, 0] - 10.0 / viscous * (1.0 - np.exp(-viscous * run.t))).max(), 1e-7
    )


# --- Long times ---------------------------------------------------------------------------------------------

DAY_AND_MORE = 1e5


def test_a_slow_swing_for_a_day():
    """An orbit of a point mass under a spring, 28 hours: phase and energy at the end."""
    omega = 0.05
    scene = pn.Scene(
        point_mass("XZ", gravity=(0.0, 0.0, 0.0)),
        forces=[pn.SpringDamper("mass", "origin", stiffness=omega**2)],
        q0=[1.0, 0.0],
        v0=[0.0, 0.5 * omega],
    )
    run = pn.simulate(scene, DAY_AND_MORE, rtol=1e-12, atol=1e-13, output_dt=1000.0, record="energy")
    exact = np.column_stack([np.cos(omega * run.t), 0.5 * np.sin(omega * run.t)])
    at_most("error of position [m]", np.abs(run.q - exact).max(), 1e-8)
    at_most("energy balance", ledger(run), 1e-9)


@pytest.mark.parametrize("duration", [200.0, pytest.param(DAY_AND_MORE, marks=long)])
def test_a_four_bar_turns_for_a_day(duration):
    scene = linkage((0.4, 1.0, 0.8, 1.1), [-1.2, 1.3, 1.5], [1.0, 0.0, 0.0])
    start = scene.initial_state()
    spun = pn.Scene(scene.model, constraints=scene.constraints, q0=start[0], v0=5.0 * start[1])
    run = pn.simulate(spun, duration, output_dt=duration / 100.0, record="energy")
    assert np.ptp(run.q[:, 0]) > duration  # it turns: more than a radian a second
    finite(run)
    # Angles are rounded by half the spacing of floats, 6e-11 at a million radians, which moves the end of the
    # chain by its distance from each joint: at most these [m].
    rounding = 0.5 * np.spacing(np.abs(run.q)) @ [1.1, 1.5, 0.8]
    at_most("violation beyond the rounding of angles [m]", (run.violation - rounding).max(), 1e-12)
    at_most("energy balance, a step", ledger(run) / run.stats.steps, 1e-8)


def test_a_brake_that_holds_for_a_day_costs_nothing():
    """Under a load below its limit it has not moved at all, and took a handful of steps."""
    model = empty()
    body(model, 0, pin.JointModelRY(), "j", 1.0, lever=(0.5, 0.0, 0.0))
    run = pn.simulate(pn.Scene(model, laws=[pn.JointFriction("j", coulomb=10.0)]), DAY_AND_MORE)
    assert (run.v == 0.0).all()
    assert (run.q == run.q[0]).all()
    at_most("steps", run.stats.steps, 100)


def test_time_far_from_zero():
    """A day is added to all times and nothing else changes, up to the rounding of time."""
    scene = pn.load("five_bar")
    period = 2.0 * np.pi / 4.0  # period of the drive
    shift = 60000 * period
    options = {"rtol": 1e-11, "atol": 1e-12, "output_dt": 0.1}
    here, there = (pn.simulate(scene, 1.0, t0=t0, **options) for t0 in (0.0, shift))
    at_most("difference [rad]", np.abs(here.q - there.q).max(), 1e4 * np.spacing(shift))


# --- Invalid tolerances and times ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "tolerances",
    [(1e-14, 1e-300), (1e-14, 1e-16), (1e-14, 0.0), (0.1, 1.0), (0.1, 1e3), (0.1, 1e300), (1e-8, 1e300)],
)
def test_tiny_and_huge_tolerances(tolerances):
    """Tolerances below rounding are met to rounding; whatever the tolerance, the loop stays closed."""
    rtol, atol = tolerances
    run = pn.simulate(pn.load("four_bar"), 0.2, rtol=rtol, atol=atol, record="energy")
    finite(run)
    at_most("violation [m]", run.violation.max(), 1e-12)
    at_most("energy balance", ledger(run), 1e-12 if max(tolerances) < 1e-12 else 1e-2)


def test_a_tolerance_that_no_step_meets():
    with pytest.raises(StepSizeError, match="the run makes no progress: after 20000 steps"):
        pn.simulate(pn.load("four_bar"), 0.2, rtol=0.0, atol=1e-300)


def test_a_run_that_would_never_end():
    """A spin of 1e60 rad/s takes 1e60 steps a second."""
    scene = pn.load("rolling_disk")
    with pytest.raises(
        StepSizeError, match=r"the run makes no progress: after 20000 steps it has reached t = "
    ) as e:
        pn.simulate(scene, 1.0, v=np.full(scene.model.nv, 1e60), output_dt=0.5)
    assert e.value.trajectory is not None


def test_a_time_beyond_all_numbers():
    message = "simulate: duration must be at least 100 times the spacing of floating-point times, "
    with pytest.raises(InputError, match=message):
        pn.simulate(pn.load("four_bar"), 1.7e308, t0=1.7e308)
