"""Dense output run.at at the order of the steps, and samples on the requested grid."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.trajectory.dense_output import inside_steps

from ....support.refusals import refuses

ORDERS = {"dop853": 8, "dopri5": 5, "rk4": 4}
FIELDS = ("q", "v", "a", "F_ideal", "F_nonideal", "lam", "tau", "violation", "modes", "limits")


def pendulum():
    """Return two links with large swings."""
    model = pin.Model()
    joint, place = 0, pin.SE3.Identity()
    for name in ("upper", "lower"):
        joint = model.addJoint(joint, pin.JointModelRY(), place, name)
        model.appendBodyToJoint(
            joint, pin.Inertia(1.0, np.array([0, 0, -0.5]), 0.1 * np.eye(3)), pin.SE3.Identity()
        )
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    return pn.Scene(model, q0={"upper": 2.0, "lower": 1.0})


@pytest.mark.parametrize("points", [4, 8, 13])
def test_the_polynomial_goes_through_its_points(points):
    part = np.concatenate(
        [np.linspace(0.0, 1.0, 7), 0.5 * (1.0 - np.cos(np.pi * np.arange(points) / (points - 1)))]
    )
    place = 0.5 * (1.0 - np.cos(np.pi * np.arange(points) / (points - 1)))
    powers = np.arange(points)
    states = np.stack([np.full((points, points), 7.0), place[:, None] ** powers])
    values = inside_steps(states, np.ones(part.size, dtype=np.int64), part)
    np.testing.assert_allclose(values, part[:, None] ** powers, rtol=0, atol=1e-14)


def error_between(scene, method, length, exact, times):
    """Return the largest error between the steps of a run with this step size."""
    if method == "rk4":
        run = pn.simulate(scene, times[-1], method=method, dt=length, record="dense")
    else:  # adaptive steps: the step size follows from their number
        run = pn.simulate(scene, times[-1], method=method, rtol=length, atol=length, record="dense")
    found = run.at(times)
    error = max(np.abs(found.q - exact.q).max(), np.abs(found.v - exact.v).max())
    return error, (times[-1]) / run.stats.steps


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4"])
def test_order_between_the_steps(method):
    """The error of dop853 decreases with the eighth power of the step, between steps as well."""
    scene, times = pendulum(), np.linspace(0.03, 2.0, 41)
    exact = pn.simulate(scene, times[-1], rtol=1e-13, atol=1e-14, record="dense").at(times)
    lengths = {"dop853": (1e-5, 1e-9), "dopri5": (1e-4, 1e-8), "rk4": (0.04, 0.005)}[method]
    (coarse, h), (fine, smaller) = (error_between(scene, method, x, exact, times) for x in lengths)
    order = np.log(coarse / fine) / np.log(h / smaller)
    assert order > ORDERS[method] - 0.7, (order, coarse, fine)


def test_errors_between_the_steps_are_those_of_the_steps():
    scene = pendulum()
    exact = pn.simulate(scene, 2.0, rtol=1e-13, atol=1e-14, record="dense")
    run = pn.simulate(scene, 2.0, rtol=1e-8, atol=1e-8, record="dense")
    at_steps = np.abs(run.q - exact.at(run.t).q).max()
    inside = np.concatenate(
        [t0 + (t1 - t0) * np.linspace(0.1, 0.9, 9) for t0, t1 in zip(run.t, run.t[1:], strict=False)]
    )
    between = np.abs(run.at(inside).q - exact.at(inside).q).max()
    assert between < 3.0 * at_steps


def test_dense_output_changes_nothing():
    for name in ("rough_four_bar", "four_bar"):
        plain = pn.simulate(pn.load(name), 0.5, record=("energy", "forces"))
        dense = pn.simulate(pn.load(name), 0.5, record=("energy", "forces", "dense"))
        for key in ("t", "q", "v"):
            np.testing.assert_array_equal(getattr(dense, key), getattr(plain, key), err_msg=key)
        np.testing.assert_allclose(dense.lam, plain.lam, rtol=1e-12, atol=1e-12)
        assert dense.events == plain.events


@pytest.mark.parametrize(
    "method", ["dop853", "dopri5", "rk4", "Radau", "BDF", "LSODA", "semi_implicit_euler", "moreau"]
)
def test_samples_by_every_method_are_those_of_the_run(method):
    """Dense output equals the run at its samples, with all records, and meets constraints between them."""
    scene = pn.load("rough_four_bar")
    dt = None if method not in ("rk4", "semi_implicit_euler", "moreau") else 0.005
    record = ("a", "forces", "energy", "reactions", "power", "dense")
    run = pn.simulate(scene, 0.3, method=method, dt=dt, record=record, rtol=None if dt else 1e-7)
    ends = [e.time for e in run.events]
    near = 1.5 * dt if method == "moreau" else 1e-9  # time stepping changes its modes inside its steps
    smooth = np.array([min((abs(t - e) for e in ends), default=1.0) > near for t in run.t])
    again = run.at(run.t)
    for key in FIELDS:
        tolerance = 1e-6 * max(1.0, np.abs(getattr(run, key)).max())
        np.testing.assert_allclose(
            getattr(again, key)[smooth], getattr(run, key)[smooth], rtol=0, atol=tolerance, err_msg=key
        )
    for key, values in run.energy.items():
        np.testing.assert_allclose(again.energy[key], values, rtol=0, atol=1e-7, err_msg=key)
    between = run.at(np.linspace(0.0, 0.3, 50))
    assert between.violation.max() < 1e-9


def test_one_time_gives_one_sample():
    run = pn.simulate(pn.load("four_bar"), 0.2, record=("forces", "energy", "dense"))
    sample, several = run.at(0.1), run.at([0.1, 0.15])
    assert sample.t == 0.1
    assert sample.q.shape == (run.scene.model.nq,)
    np.testing.assert_array_equal(sample.lam, several.lam[0])
    assert sample.energy["total"] == several.energy["total"][0]
    assert abs(sample.energy["balance"]) < 1e-8  # balance from the start of the run
    assert len(several) == 2
    assert len(run.at([])) == 0


def test_held_torques_are_those_of_the_step():
    """Dense output does not call a sampled controller and returns the torque of the step."""
    calls = []

    def control(t, q, v):
        calls.append(t)
        return np.array([np.floor(10.0 * t + 1e-9), 0.0])

    scene = pendulum()
    driven = pn.Scene(scene.model, actuation=pn.SampledControl(control, 0.1), q0=scene.q0)
    run = pn.simulate(driven, 1.0, record=("tau", "dense"))
    asked = len(calls)
    sampled = run.at([0.05, 0.25, 0.95])
    assert len(calls) == asked
    np.testing.assert_array_equal(sampled.tau[:, 0], [0.0, 2.0, 9.0])


def test_at_an_event_the_step_behind_it_is_taken():
    """A block slides to rest and sticks."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = pn.Scene(model, laws=[pn.JointFriction("slide", coulomb=2.0)], v0=[1.0])
    run = pn.simulate(scene, 1.0, record=("a", "dense"))
    stop = run.events[0].time
    assert stop == pytest.approx(0.5, abs=1e-14)
    before, at, after = run.at(stop - 1e-3), run.at(stop), run.at(stop + 1e-3)
    np.testing.assert_allclose([before.v[0], before.a[0]], [2e-3, -2.0], rtol=1e-9)
    assert at.v[0] == 0.0
    assert (at.a[0], after.v[0], after.a[0], after.modes[0]) == (0.0, 0.0, 0.0, 0)


def test_a_file_keeps_dense_output(tmp_path):
    run = pn.simulate(pn.load("rough_four_bar"), 0.2, record=("lam", "dense"))
    back = pn.Trajectory.load(run.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(back.dense.states, run.dense.states)
    again = back.dense.at(run.scene._compiled, np.array([0.1]), "pendulum")
    np.testing.assert_array_equal(again["lam"], run.at([0.1]).lam)


def test_what_at_refuses():
    run = pn.simulate(pendulum(), 0.2, record="dense")
    with refuses("at: t must lie in the run, which took 0 to 0.2 s; got 0.3 s", pn.InputError):
        run.at([0.1, 0.3])
    with refuses("at: t must lie in the run, which took 0 to 0.2 s; got -1 s", pn.InputError):
        run.at(-1.0)
    with refuses("at: t must be finite; got nan", pn.InputError):
        run.at(np.nan)
    with refuses('at(t) needs a run with record="dense"', pn.InputError):
        pn.simulate(pendulum(), 0.01).at(0.0)
    with refuses('at: the scene "four_bar" is not the one of the run', pn.InputError):
        run.dense.at(pn.load("four_bar")._compiled, np.array([0.1]), "four_bar")


# --- The grid ----------------------------------------------------------------------------------------------


def sliding():
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    push = lambda t, q, v: np.array([3.0 * np.sin(5.0 * t)])  # noqa: E731
    return pn.Scene(model, laws=[pn.JointFriction("slide", coulomb=1.0)], actuation=push, v0=[1.0])


@pytest.mark.parametrize(("duration", "output_dt"), [(3.0, 0.1), (3.0, 0.7), (1.0, 1.0), (2.0, 5.0)])
@pytest.mark.parametrize("method", ["dop853", "rk4", "moreau"])
def test_the_grid_is_marked_and_can_be_had_alone(method, duration, output_dt):
    step = {} if method == "dop853" else {"dt": 0.01}
    run = pn.simulate(sliding(), duration, t0=0.3, output_dt=output_dt, method=method, **step)
    alone = pn.simulate(
        sliding(), duration, t0=0.3, output_dt=output_dt, method=method, events="separate", record="a", **step
    )
    times = [0.3 + k * output_dt for k in range(1 + int(duration / output_dt + 1e-9))]
    times += [] if abs(times[-1] - duration - 0.3) < 1e-9 else [duration + 0.3]
    np.testing.assert_allclose(run.t[run.grid], times, rtol=0, atol=2e-12)
    np.testing.assert_allclose(alone.t, times, rtol=0, atol=1e-15)
    assert alone.grid.all()
    assert alone.a.shape == (len(times), 1)
    np.testing.assert_array_equal(alone.q, run.q[run.grid])
    assert alone.events == run.events
    assert run.events


def test_every_step_is_a_grid_without_an_output_dt():
    run = pn.simulate(sliding(), 1.0)
    assert run.grid.all()
    with refuses(
        'simulate: events="separate" needs an output_dt: without one, every step is a sample', pn.InputError
    ):
        pn.simulate(sliding(), 1.0, events="separate")
