"""Drives beyond their effort limits: closed forms, events and errors."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn

from ..support.mechanisms import TIGHT, body, empty, hinge

SAME = 1e-9  # error of states and times at a tolerance of 1e-12


def slider(mass=2.0, effort=None):
    """A mass on a rail without gravity."""
    model = empty((0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "rail", mass)
    if effort is not None:
        model.upperEffortLimit[:], model.lowerEffortLimit[:] = effort, -effort
    return model


def told(run, kind):
    return [(event.time, event.element) for event in run.events if event.kind == kind]


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4"])
def test_a_ramp_is_cut(method):
    """u = 3 t under 6 N: v = 0.75 t^2 up to t = 2 s, then 3 + 3 (t - 2) (mass 2 kg)."""
    drive = pn.EffortLimits(lambda t, q, v: np.array([3.0 * t]), effort=6.0)
    scene = pn.Scene(slider(), actuation=drive)
    more = {"dt": 0.03} if method == "rk4" else TIGHT
    run = pn.simulate(scene, 5.0, method=method, **more)
    assert told(run, "saturate") == [(pytest.approx(2.0, abs=SAME), "rail")]
    assert not told(run, "desaturate")
    assert run.v[-1, 0] == pytest.approx(12.0, abs=SAME)


def test_a_wave_is_cut_and_given_again():
    """u = 2 sin t under 1 N: it is cut from asin(1/2) to pi - asin(1/2), and on the other side."""
    drive = pn.EffortLimits(lambda t, q, v: np.array([2.0 * np.sin(t)]), effort=[1.0])
    run = pn.simulate(pn.Scene(slider(), actuation=drive), 2.0 * np.pi, record=("energy",), **TIGHT)
    sixth = np.pi / 6.0
    assert [time for time, _ in told(run, "saturate")] == pytest.approx([sixth, 7.0 * sixth], abs=SAME)
    assert [time for time, _ in told(run, "desaturate")] == pytest.approx(
        [5.0 * sixth, 11.0 * sixth], abs=SAME
    )
    assert run.v[-1, 0] == pytest.approx(0.0, abs=SAME)
    assert np.abs(run.energy["balance"]).max() < SAME


@pytest.mark.parametrize("seed", range(6))
def test_motors_of_an_arm_beside_scipy(seed):
    """A pendulum of two links whose hold saturates: SciPy between the instants at which it does."""
    rng = np.random.default_rng(seed)
    model = empty()
    first = body(model, 0, hinge(0, 1, 0), "shoulder", 1.0, lever=(0.0, 0.0, -0.5))
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5]))
    body(model, first, hinge(0, 1, 0), "elbow", 0.7, lever=(0.0, 0.0, -0.4), place=place)
    most, target, q0 = rng.uniform(1.0, 4.0, 2), rng.uniform(-2.0, 2.0, 2), rng.uniform(-2.0, 2.0, 2)
    hold = pn.HoldPosition(kp=30.0, kd=3.0, q=target)
    data = model.createData()

    def asked(y):
        return 30.0 * (target - y[:2]) - 3.0 * y[2:]

    def rate(t, y):
        return np.r_[y[2:], pin.aba(model, data, y[:2], y[2:], np.clip(asked(y), -most, most))]

    def left(k):
        return lambda t, y: most[k] - abs(asked(y)[k])

    beside = solve_ivp(
        rate, (0.0, 2.0), np.r_[q0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13, max_step=2e-3,
        events=[left(0), left(1)],
    )  # fmt: skip
    scene = pn.Scene(model, actuation=pn.EffortLimits(hold, most), q0=q0)
    run = pn.simulate(scene, 2.0, **TIGHT)
    np.testing.assert_allclose(np.r_[run.q[-1], run.v[-1]], beside.y[:, -1], atol=1e-8)
    for k, joint in enumerate(("shoulder", "elbow")):
        ours = [e.time for e in run.events if e.element == joint]
        assert ours == pytest.approx(beside.t_events[k], abs=1e-7)


def test_limits_of_the_file_and_of_what_has_none():
    model = slider(effort=5.0)
    scene = pn.Scene(model, actuation=pn.EffortLimits([100.0]))
    assert scene.solve(scene.q0, scene.v0).a == pytest.approx([2.5], rel=1e-15)
    assert scene.acceleration(scene.q0, scene.v0, tau=[-100.0]) == pytest.approx([-2.5], rel=1e-15)
    for none in (0.0, np.inf, np.finfo(float).max):
        free = pn.Scene(slider(effort=none), actuation=pn.EffortLimits([100.0]))
        assert free.solve(free.q0, free.v0).a == pytest.approx([50.0], rel=1e-15)


def test_a_sampled_control_is_cut():
    """A control demands 10 N until 0.35 s and 1 N afterwards: the force is 4 N until the sample at 0.4 s."""
    control = pn.SampledControl(lambda t, q, v: np.array([10.0 if t < 0.35 else 1.0]), period=0.1)
    run = pn.simulate(pn.Scene(slider(), actuation=pn.EffortLimits(control, 4.0)), 1.0)
    assert run.v[-1, 0] == pytest.approx(0.5 * (4.0 * 0.4 + 1.0 * 0.6), abs=SAME)
    assert [time for time, _ in told(run, "desaturate")] == pytest.approx([0.4], abs=SAME)


def test_time_stepping_tells_at_the_end_of_a_step():
    drive = pn.EffortLimits(lambda t, q, v: np.array([3.0 * t]), effort=6.0)
    run = pn.simulate(pn.Scene(slider(), actuation=drive), 3.0, method="moreau", dt=1e-2)
    ((time, joint),) = told(run, "saturate")
    assert (joint, 2.0 < time <= 2.0 + 1e-2 + SAME) == ("rail", True)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (
            lambda: pn.EffortLimits(None),
            "EffortLimits: actuation must be drives without effort limits; got None",
        ),
        (lambda: pn.EffortLimits(pn.EffortLimits([1.0])), ".* without effort limits; got EffortLimits"),
        (lambda: pn.EffortLimits([1.0], -2.0), "EffortLimits: effort must not be negative; got -2"),
        (
            lambda: pn.Scene(slider(), actuation=pn.EffortLimits([1.0], [1.0, 2.0])),
            r"EffortLimits: effort must have shape \(1,\)",
        ),
    ],
)
def test_what_is_refused(made, message):
    with pytest.raises(pn.InputError, match=message):
        made()
