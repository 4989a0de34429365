"""Dense output run.at at the order of the steps, and samples on the requested grid."""

from __future__ import annotations

import itertools

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.trajectory.dense_output import inside_steps

from ....support.refusals import refuses
from ....support.same_run import assert_same_run
from ....support.scenes import kinds

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


# --- Contacts that open -----------------------------------------------------------------------------------

CASES = kinds()
# Every kind of contact that opens.
OPENING = [name for name in CASES if name.startswith("touching")]
FALLING = [*OPENING, "robot solo12_dropped"]


def box_on_box():
    """Return a box that falls onto a box on the ground, slips, tips and opens corners."""
    model, shapes = pin.Model(), pin.GeometryModel()
    for k, (height, turn) in enumerate(((0.1, 0.0), (0.35, 0.1))):
        place = pin.SE3(pin.rpy.rpyToMatrix(turn, 0.5 * turn, turn), np.array([0.02 * k, 0.0, height]))
        shape = coal.Box(0.2, 0.2, 0.2)
        pn.free_body(model, f"box {k}", shape, mass=1.0, collision_model=shapes, place=place)
    contacts = pn.ground_contacts(model, shapes, ["box 0"], mu=0.5, restitution=0.2)
    contacts += pn.geometry_contacts(model, shapes, mu=0.4, restitution=0.2)
    v = np.zeros(12)
    v[6] = 0.3
    return pn.Scene(model, contacts=contacts, collision_model=shapes, v0=v)


def away_from(events, times, distance):
    return np.array([min((abs(t - e.time) for e in events), default=np.inf) > distance for t in times])


@pytest.mark.parametrize(
    ("name", "method"), [("boxes", "dop853"), *itertools.product(FALLING, ("dop853", "rk4"))]
)
def test_samples_between_the_steps_are_those_of_a_grid(name, method):
    case = None if name == "boxes" else CASES[name]()
    scene, duration = (box_on_box(), 0.3) if case is None else (case.scene, case.duration)
    options = {"rtol": 1e-9, "atol": 1e-11} if method == "dop853" else {"method": method, "dt": 2e-3}
    options |= {"record": ("forces", "energy"), "max_wall": 60.0}
    start = {} if case is None else {"q": case.q0, "v": case.v0}
    grid = pn.simulate(scene, duration, output_dt=duration / 57, **start, **options)
    options["record"] = ("forces", "energy", "dense")
    run = pn.simulate(scene, duration, **start, **options)
    assert run.events == grid.events
    assert run.events
    found, smooth = run.at(grid.t), away_from(run.events, grid.t, 1e-9)
    for key in ("q", "v", "lam", "F_nonideal", "closed", "modes"):
        one, other = getattr(found, key), getattr(grid, key)
        if one is not None:
            scale = np.abs(other).max() + 1e-12
            np.testing.assert_allclose(one[smooth], other[smooth], rtol=0, atol=1e-9 * scale, err_msg=key)
    for key in ("total", "impacts"):
        np.testing.assert_allclose(
            found.energy[key][smooth], grid.energy[key][smooth], rtol=0, atol=1e-9, err_msg=key
        )


@pytest.mark.parametrize("name", [*OPENING, "boxes"])
def test_time_steps_of_contacts_are_straight_lines_through_their_samples(name):
    case = None if name == "boxes" else CASES[name]()
    scene, duration = (box_on_box(), 0.3) if case is None else (case.scene, case.duration)
    start = {} if case is None else {"q": case.q0, "v": case.v0}
    run = pn.simulate(
        scene, duration, method="moreau", dt=1e-3, record=("forces", "energy", "dense"), **start
    )
    assert run.events
    again = run.at(run.t)
    np.testing.assert_allclose(again.q, run.q, rtol=0, atol=1e-9)
    # Samples satisfy the rates of contacts and sticking elements; ends of steps do to the scheme's order.
    np.testing.assert_allclose(again.v, run.v, rtol=0, atol=2e-3)
    np.testing.assert_allclose(again.energy["impacts"], run.energy["impacts"], rtol=0, atol=1e-12)
    middle = run.at(0.5 * (run.t[1:] + run.t[:-1]))
    np.testing.assert_allclose(middle.v, 0.5 * (run.v[1:] + run.v[:-1]), rtol=0, atol=2e-3)


def test_an_impact_lies_between_two_steps():
    """A ball falls from 0.2 m onto the ground and rebounds with half of its speed."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "height")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), 0.1 * np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("ball", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    contact = pn.PointContact("ball", radius=0.1, restitution=0.5, name="ground")
    run = pn.simulate(pn.Scene(model, contacts=[contact]), 0.4, q=[0.3], record=("forces", "energy", "dense"))
    strike, speed = np.sqrt(2.0 * 0.2 / 9.81), np.sqrt(2.0 * 0.2 * 9.81)
    assert run.events[0].time == pytest.approx(strike, abs=1e-12)
    before, after = run.at(strike - 1e-6), run.at(strike + 1e-6)
    assert before.v[0] == pytest.approx(-speed + 9.81e-6, abs=1e-12)
    assert after.v[0] == pytest.approx(0.5 * speed - 9.81e-6, abs=1e-12)
    assert (before.energy["impacts"], before.lam[0], after.lam[0]) == (0.0, 0.0, 0.0)
    assert after.energy["impacts"] == pytest.approx(-0.75 * 0.5 * speed**2, rel=1e-12)
    assert after.energy["balance"] == pytest.approx(0.0, abs=1e-12)


def test_dense_output_of_contacts_is_saved_and_resumed(kept, tmp_path):
    case, path = CASES["touching BoxContact"](), tmp_path / "run"
    options = {"record": ("forces", "energy", "dense"), "q": case.q0, "v": case.v0}
    alone = pn.simulate(case.scene, case.duration, **options)
    pn.simulate(case.scene, case.duration, **options, checkpoint=path, checkpoint_interval=0.0)
    path.write_bytes(kept[len(kept) // 2])
    assert_same_run(alone, pn.resume(path, case.scene))
    back, times = pn.Trajectory.load(alone.save(tmp_path / "run.npz"), scene=case.scene), [0.07, 0.1]
    np.testing.assert_array_equal(back.at(times).lam, alone.at(times).lam)


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
