"""Delayed sampled control, against a double integrator in discrete time."""

from __future__ import annotations

import pickle
import threading

import numpy as np
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError

from ...support.random_trees import tree
from ...support.refusals import refuses
from ...support.same_run import assert_same_run

PERIOD, STEPS = 0.02, 40
START = (0.3, -0.1)
KP, KD = 20.0, 3.0
EXACT = 1e-10  # steps of a constant force are exact up to rounding


def slide(mass=2.0):
    """One mass on a level rail: a double integrator."""
    import pinocchio as pin

    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return model


def servo(t, q, v):
    return -KP * q - KD * v


def scene(limit=None, **delay):
    control = pn.SampledControl(servo, PERIOD, **delay)
    drive = control if limit is None else pn.EffortLimits(control, limit)
    return pn.Scene(slide(), actuation=drive, q0=[START[0]], v0=[START[1]])


def oracle(samples, initial=0.0, start=START, mass=2.0, limit=np.inf):
    """Position and velocity at t0 + k period under the force u_(k - samples)."""
    (x, v), asked, states = start, [], [start]
    for k in range(STEPS):
        asked.append(-KP * x - KD * v)
        force = initial if k < samples else asked[k - samples]
        a = min(max(force, -limit), limit) / mass
        x, v = x + PERIOD * v + 0.5 * PERIOD**2 * a, v + PERIOD * a
        states.append((x, v))
    return np.array(states)


def states(run):
    return np.column_stack([run.q[run.grid], run.v[run.grid]])


DELAYS = [
    ({"delay_samples": 1}, 1, 0.0),
    ({"delay_samples": 3, "initial": [0.7]}, 3, 0.7),
    ({"delay": 3 * PERIOD}, 3, 0.0),
    ({"delay": 2.1 * PERIOD, "initial": {"slide": -0.4}}, 3, -0.4),
    ({"delay": 0.1 * PERIOD}, 1, 0.0),
    ({"delay_samples": 100, "initial": [0.2]}, 100, 0.2),
    ({"initial": [5.0]}, 0, 0.0),
]
METHODS = [
    {},
    {"method": "dopri5"},
    {"method": "rk4", "dt": PERIOD / 2},
    {"method": "rk4", "dt": 0.7 * PERIOD},
]


@pytest.mark.parametrize("options", METHODS, ids=str)
@pytest.mark.parametrize(("delay", "samples", "initial"), DELAYS, ids=str)
def test_a_delayed_servo_follows_its_discrete_time_law(delay, samples, initial, options):
    made, wanted = scene(**delay), oracle(samples, initial)
    runs = [pn.simulate(made, STEPS * PERIOD, output_dt=PERIOD, **options) for _ in range(2)]
    np.testing.assert_allclose(states(runs[0]), wanted, rtol=0.0, atol=EXACT)
    assert_same_run(*runs)  # the second run begins without samples of the first


def test_the_recorded_torque_is_the_delayed_one():
    made = scene(delay_samples=2, initial=[0.7])
    run = pn.simulate(made, STEPS * PERIOD, output_dt=PERIOD, record=("tau", "dense"))
    wanted = [0.7, 0.7, *(-KP * run.q[:-3, 0] - KD * run.v[:-3, 0])]
    middles = (np.arange(STEPS) + 0.5) * PERIOD
    inside = run.at(middles)
    np.testing.assert_allclose(inside.tau[:, 0], wanted, rtol=0.0, atol=EXACT)


def test_limits_clip_the_delayed_torque():
    made = scene(limit=1.5, delay_samples=2, initial=[4.0])
    run = pn.simulate(made, STEPS * PERIOD, output_dt=PERIOD)
    np.testing.assert_allclose(states(run), oracle(2, 4.0, limit=1.5), rtol=0.0, atol=EXACT)


def test_runs_that_start_where_others_end():
    """A run carries over nothing, also if it starts at the next sample of an earlier run."""
    made = scene(delay_samples=2)
    first = pn.simulate(made, PERIOD * 5)
    second = pn.simulate(
        made, STEPS * PERIOD, q=list(START[:1]), v=list(START[1:]), t0=5 * PERIOD, output_dt=PERIOD
    )
    assert first.t[-1] == second.t[0]
    np.testing.assert_allclose(states(second), oracle(2), rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("period", [PERIOD, PERIOD / 2])
def test_a_stepper_is_emptied_by_reset(period):
    made, wanted = scene(delay_samples=3, initial=[0.7]), oracle(3, 0.7)
    stepper = made.stepper(period, method="rk4")
    every = round(PERIOD / period)
    for start in (0.0, 0.0, 1.0):
        stepper.reset(np.array(START[:1]), np.array(START[1:]), start)
        for k in range(1, 20 * every):
            q, v = stepper.step()
            if k % every == 0:
                assert np.abs(np.append(q, v) - wanted[k // every]).max() <= EXACT


def test_steppers_advance_in_turns_and_in_other_threads():
    made, wanted = scene(delay_samples=3), oracle(3)
    steppers = [made.stepper(PERIOD, method="rk4") for _ in range(2)]
    ahead = steppers[1].step()
    for k in range(1, 10):
        found = []
        thread = threading.Thread(target=lambda found=found: found.append(steppers[0].step()))
        thread.start()
        thread.join()
        pn.simulate(made, 3 * PERIOD)
        assert np.abs(np.concatenate(found[0]) - wanted[k]).max() <= EXACT
    assert np.abs(np.concatenate(ahead) - wanted[1]).max() <= EXACT
    assert np.abs(np.concatenate(steppers[1].step()) - wanted[2]).max() <= EXACT


@pytest.mark.parametrize("threads", [1, 3])
def test_each_run_of_a_rollout_begins_without_samples(threads):
    made = scene(delay_samples=3, initial=[0.7])
    starts = np.linspace(-1.0, 1.0, 7)[:, None]
    options = {"output_dt": PERIOD, "jobs": threads}
    for _ in range(2):
        runs = pn.rollout(made, starts, -starts, STEPS * PERIOD, **options)
        arrays = pn.rollout(made, starts, -starts, STEPS * PERIOD, as_arrays=True, **options)
        for k, (x,) in enumerate(starts):
            wanted = oracle(3, 0.7, (x, -x))
            np.testing.assert_allclose(states(runs[k]), wanted, rtol=0.0, atol=EXACT)
            assert_same_run(
                runs[k], pn.simulate(made, STEPS * PERIOD, starts[k], -starts[k], output_dt=PERIOD)
            )
            np.testing.assert_array_equal(arrays.q[k], runs[k].q)
    heavy = pn.rollout(
        made, None, None, STEPS * PERIOD, parameters={"slide": {"mass": [1.0, 4.0]}}, output_dt=PERIOD
    )
    for run, mass in zip(heavy, (1.0, 4.0), strict=True):
        np.testing.assert_allclose(states(run), oracle(3, 0.7, mass=mass), rtol=0.0, atol=EXACT)


def test_runs_inside_a_controller_and_single_states_leave_the_samples_alone():
    """A controller may simulate its own scene, evaluate it and step it."""
    inner = []

    def predicts(t, q, v):
        if not inner:
            inner.append(True)
            pn.simulate(made, 2 * PERIOD, q, v)
            made.acceleration(q, v)
            made.step(q, v, None, PERIOD, method="rk4")
            inner.clear()
        return servo(t, q, v)

    control = pn.SampledControl(predicts, PERIOD, delay_samples=2, initial=[0.7])
    made = pn.Scene(slide(), actuation=control, q0=[START[0]], v0=[START[1]])
    run = pn.simulate(made, STEPS * PERIOD, output_dt=PERIOD)
    np.testing.assert_allclose(states(run), oracle(2, 0.7), rtol=0.0, atol=EXACT)


def test_single_states_and_steps_feel_the_initial_torque():
    made = scene(delay_samples=1, initial=[0.8])
    assert made.acceleration(made.q0, made.v0) == pytest.approx([0.4], rel=1e-15)
    q, v = made.step(made.q0, made.v0, None, PERIOD, method="rk4")
    assert np.append(q, v) == pytest.approx(oracle(1, 0.8)[1], abs=1e-14)


def test_functions_that_reuse_their_array():
    torque = np.zeros(1)

    def reuses(t, q, v):
        torque[:] = servo(t, q, v)
        return torque

    control = pn.SampledControl(reuses, PERIOD, delay_samples=3)
    made = pn.Scene(slide(), actuation=control, q0=[START[0]], v0=[START[1]])
    run = pn.simulate(made, STEPS * PERIOD, output_dt=PERIOD)
    np.testing.assert_allclose(states(run), oracle(3), rtol=0.0, atol=EXACT)


def test_a_run_resumes_with_the_samples_that_have_not_acted(tmp_path, monkeypatch):
    from pin_nonideal.simulation import checkpoint

    options = {"output_dt": PERIOD, "record": "tau"}
    alone = pn.simulate(scene(delay_samples=3, initial=[0.7]), STEPS * PERIOD, **options)
    kept, path, write = [], tmp_path / "run", checkpoint.Saver.__call__

    def keep(saver, state):
        write(saver, state)
        kept.append(path.read_bytes())

    monkeypatch.setattr(checkpoint.Saver, "__call__", keep)
    made = scene(delay_samples=3, initial=[0.7])
    assert_same_run(
        alone, pn.simulate(made, STEPS * PERIOD, **options, checkpoint=path, checkpoint_interval=0.0)
    )
    for state in kept[:: max(1, len(kept) // 6)]:
        path.write_bytes(state)
        assert_same_run(alone, pn.resume(path, made, checkpoint_interval=1e9))
    for other in (scene(delay_samples=4, initial=[0.7]), scene(delay_samples=3), scene()):
        with refuses("resume: the scene must be the one", InputError):
            pn.resume(path, other)


def test_a_delayed_control_travels():
    control = pn.SampledControl(servo, PERIOD, delay=0.05, initial={"slide": 1.0}, name="servo")
    again = pickle.loads(pickle.dumps(control))
    assert again == control
    assert again.delay_in_samples == 3
    model = tree(["revolute x", "revolute y"], np.random.default_rng(0))
    assert "delay_samples=2" in str(
        pn.Scene(model, actuation=pn.SampledControl(servo, 0.1, delay_samples=2)).describe()
    )


REFUSED = [
    ({"delay": -0.1}, "SampledControl: delay must not be negative; got -0.1"),
    ({"delay": "1 ms"}, "SampledControl: delay must be a number; got '1 ms'"),
    ({"delay_samples": 1.0}, "SampledControl: delay_samples must be an integer; got 1.0"),
    ({"delay_samples": -1}, "SampledControl: delay_samples must be at least 0; got -1"),
    (
        {"delay": 0.1, "delay_samples": 2},
        "SampledControl: the delay must be given once; got delay=0.1 s and delay_samples=2; "
        "leave one of them out",
    ),
    (
        {"delay": 1e300},
        "SampledControl: delay must be at most 1e+09 periods; got 1e+300 s with a period of 0.02 s",
    ),
    ({"initial": [np.nan]}, "SampledControl: initial must be finite; entry [0] is nan"),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED, ids=str)
def test_bad_delays_are_refused(arguments, message):
    with refuses(message, InputError):
        pn.SampledControl(servo, PERIOD, **arguments)


def test_initial_torques_must_fit_the_model():
    with refuses("SampledControl: initial must have shape (1,); got shape (2,)", InputError):
        scene(delay_samples=1, initial=[1.0, 2.0])
