"""Events by functions of the user, located as those of friction are; a callback between steps; wall time."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn

from ....support.refusals import refuses

G = 9.81
METHODS = {"dop853": {}, "dopri5": {}, "rk4": {"dt": 0.01}, "Radau": {}, "LSODA": {}}


def falling(v0=5.0):
    """A ball thrown up: height v0 t - g t^2 / 2."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "height")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return pn.Scene(model, v0=[v0])


def swinging():
    model = pin.Model()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "swing")
    model.appendBodyToJoint(
        1, pin.Inertia(1.0, np.array([0.0, 0.0, -1.0]), np.zeros((3, 3))), pin.SE3.Identity()
    )
    return pn.Scene(model, q0=[2.0])


def event(function, terminal=False, direction=0):
    function.terminal, function.direction = terminal, direction
    return function


@pytest.mark.parametrize("method", METHODS)
def test_zeros_of_a_parabola(method):
    """The height passes 1 m upward and downward at the closed-form times, to 1e-12 s, by every method."""
    run = pn.simulate(falling(), 1.2, method=method, events=[lambda t, q, v: q[0] - 1.0], **METHODS[method])
    root = np.sqrt(25.0 - 2.0 * G)
    expected = np.array([(5.0 - root) / G, (5.0 + root) / G])
    tolerance = 1e-12 if method in ("dop853", "dopri5", "rk4") else 1e-7
    np.testing.assert_allclose(run.user_events[0].t, expected, rtol=0, atol=tolerance)
    np.testing.assert_allclose(run.user_events[0].q[:, 0], 1.0, rtol=0, atol=1e-12)
    assert run.user_events[0].name == "<lambda>"
    assert [(e.kind, e.element) for e in run.events] == [("user", "<lambda>")] * 2
    assert np.isin(run.user_events[0].t, run.t).all()


def test_against_the_period_of_a_pendulum():
    """A pendulum passes its lowest point at odd quarters of the period, by the elliptic integral K(sin 1)."""
    from scipy.special import ellipk

    quarter = ellipk(np.sin(1.0) ** 2) / np.sqrt(G)
    run = pn.simulate(swinging(), 20.0, rtol=1e-13, atol=1e-14, events=[lambda t, q, v: q[0]])
    times = run.user_events[0].t
    np.testing.assert_allclose(times, quarter * (2.0 * np.arange(len(times)) + 1.0), rtol=0, atol=2e-12)


@pytest.mark.parametrize("direction", [-1, 0, 2.5])
@pytest.mark.parametrize("terminal", [False, True, 1, 3])
def test_direction_and_terminal_are_those_of_solve_ivp(direction, terminal):
    scene = swinging()
    ours = event(lambda t, q, v: q[0] - 0.3, terminal, direction)
    theirs = event(lambda t, y: y[0] - 0.3, terminal, direction)
    run = pn.simulate(scene, 6.0, rtol=1e-10, atol=1e-12, events=[ours])
    reference = solve_ivp(
        lambda t, y: [y[1], -G * np.sin(y[0])],
        (0.0, 6.0),
        [2.0, 0.0],
        "DOP853",
        rtol=1e-12,
        atol=1e-12,
        events=theirs,
    )
    np.testing.assert_allclose(run.user_events[0].t, reference.t_events[0], rtol=0, atol=1e-8)
    assert run.t[-1] == pytest.approx(reference.t[-1], abs=1e-8)


def test_a_dip_inside_a_step_is_met():
    """At order 8 free flight is one step; the height above 1.2 m passes twice inside it."""
    run = pn.simulate(falling(), 1.0, events=[lambda t, q, v: q[0] - 1.2])
    root = np.sqrt(25.0 - 2.4 * G)
    np.testing.assert_allclose(run.user_events[0].t, [(5.0 - root) / G, (5.0 + root) / G], rtol=0, atol=1e-12)


def test_events_at_one_time_are_all_told():
    def low(t, q, v):
        return q[0] - 1.0

    def also(t, q, v):
        return 1e6 * (1.0 - q[0])

    run = pn.simulate(falling(), 0.5, events=[low, also])
    first, second = run.user_events
    assert (first.name, second.name) == ("low", "also")
    np.testing.assert_allclose(first.t, second.t, rtol=0, atol=1e-12)
    assert len(first.t) == len(second.t) == 1


def test_scales_do_not_matter():
    for scale in (1e-12, 1.0, 1e12):
        run = pn.simulate(swinging(), 3.0, rtol=1e-12, atol=1e-13, events=[lambda t, q, v, s=scale: s * q[0]])
        plain = pn.simulate(swinging(), 3.0, rtol=1e-12, atol=1e-13, events=[lambda t, q, v: q[0]])
        np.testing.assert_allclose(run.user_events[0].t, plain.user_events[0].t, rtol=0, atol=1e-12)


def test_a_value_that_starts_at_zero_is_no_event():
    assert len(pn.simulate(falling(), 0.5, events=[lambda t, q, v: q[0]]).user_events[0].t) == 0
    back = pn.simulate(falling(), 1.5, events=[lambda t, q, v: q[0]]).user_events[0].t
    np.testing.assert_allclose(back, [10.0 / G], rtol=0, atol=1e-12)


def test_beside_events_of_friction():
    """A block comes to rest at 0.5 s at 0.25 m; both user events are found beside the friction event."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = pn.Scene(model, laws=[pn.JointFriction("slide", coulomb=2.0)], v0=[1.0])
    places = [lambda t, q, v: q[0] - 0.16, lambda t, q, v: t - 0.5, lambda t, q, v: t - 0.75]
    run = pn.simulate(scene, 1.0, events=places)
    times = [record.t.tolist() for record in run.user_events]
    np.testing.assert_allclose(times, [[0.2], [0.5], [0.75]], rtol=0, atol=1e-12)
    kinds = [(e.kind, round(e.time, 9)) for e in run.events]
    assert ("stick", 0.5) in kinds
    assert run.q[-1, 0] == pytest.approx(0.25, abs=1e-13)


def test_time_stepping_tells_events_at_the_ends_of_its_steps():
    run = pn.simulate(
        falling(), 1.0, method="moreau", dt=1e-3, output_dt=0.1, events=[lambda t, q, v: q[0] - 1.0]
    )
    root = np.sqrt(25.0 - 2.0 * G)
    np.testing.assert_allclose(run.user_events[0].t, [(5.0 - root) / G, (5.0 + root) / G], rtol=0, atol=2e-3)


def test_events_and_a_file(tmp_path):
    run = pn.simulate(falling(), 1.2, events=[lambda t, q, v: q[0] - 1.0, "separate"], output_dt=0.5)
    assert len(run) == 4
    back = pn.Trajectory.load(run.save(tmp_path / "run.npz"))
    for key in ("t", "q", "v"):
        np.testing.assert_array_equal(getattr(back.user_events[0], key), getattr(run.user_events[0], key))
    assert back.user_events[0].q.shape == (2, 1)


def raising(t, q, v):
    raise ArithmeticError("no way")


@pytest.mark.parametrize(
    ("events", "error", "message"),
    [
        (3, pn.InputError, 'simulate: events must be functions (t, q, v) -> number, or "separate"; got 3'),
        (["apart"], pn.InputError, "got 'apart'"),
        (
            [event(lambda t, q, v: 1.0, direction="up")],
            pn.InputError,
            "direction must be a number, of which the sign",
        ),
        ([event(lambda t, q, v: 1.0, terminal=-1)], pn.InputError, "terminal must be at least 0; got -1"),
        (
            [event(lambda t, q, v: 1.0, terminal="yes")],
            pn.InputError,
            "terminal must be an integer; got 'yes'",
        ),
        (
            [lambda t, q, v: [1.0, 2.0]],
            pn.UserFunctionError,
            'event "<lambda>" must return shape (); got shape (2,)',
        ),
        (
            [lambda t, q, v: np.nan],
            pn.UserFunctionError,
            'event "<lambda>" must return finite numbers; got nan',
        ),
        (
            [lambda t, q, v: None],
            pn.UserFunctionError,
            'event "<lambda>" must return finite numbers; got nan',
        ),
        ([raising], pn.UserFunctionError, 'event "raising" raised ArithmeticError: no way (at t = 0 s)'),
    ],
)
@pytest.mark.parametrize("method", ["dop853", "Radau"])
def test_events_that_do_not_fit(events, error, message, method):
    with refuses(message, error):
        pn.simulate(falling(), 0.1, method=method, events=events)


# --- Between steps -----------------------------------------------------------------------------------------


def test_a_callback_may_stop():
    seen = []

    def until(t, q, v):
        seen.append((t, q.copy(), v.copy()))
        return v[0] < 0.0

    run = pn.simulate(falling(), 100.0, method="rk4", dt=0.01, output_dt=0.5, callback=until)
    assert run.t[-1] == pytest.approx(0.51)
    assert run.t[-1] == seen[-1][0]
    np.testing.assert_array_equal(run.q[-1], seen[-1][1])


def test_a_callback_may_change_torques():
    """From 0.5 s on the ball is pushed by 2 g: the velocity falls by g t, then rises."""

    def push(t, q, v):
        return [2.0 * G] if t >= 0.5 - 1e-12 else None

    run = pn.simulate(falling(0.0), 1.0, method="rk4", dt=0.1, callback=push, record="tau")
    np.testing.assert_allclose(run.v[:, 0], G * (np.abs(run.t - 0.5) - 0.5), rtol=0, atol=1e-12)
    assert run.tau[-1, 0] == 2.0 * G
    assert pn.simulate(falling(0.0), 0.5).v[-1, 0] == pytest.approx(-0.5 * G)


def test_callbacks_that_do_not_fit():
    for callback, error, message in (
        (3, pn.InputError, "simulate: callback must be a function (t, q, v); got 3"),
        (lambda t, q, v: [1.0, 2.0], pn.UserFunctionError, "callback must return shape (1,); got shape (2,)"),
        (raising, pn.UserFunctionError, "callback raised ArithmeticError: no way (at t = 0 s)"),
    ):
        with refuses(message, error):
            pn.simulate(falling(), 0.1, callback=callback)


def test_functions_are_in_no_checkpoint(tmp_path):
    words = "checkpoint cannot hold functions; leave out events and callback, or the checkpoint"
    for asked in ({"events": [lambda t, q, v: 1.0]}, {"callback": lambda t, q, v: None}):
        with refuses(words, pn.InputError):
            pn.simulate(falling(), 0.1, checkpoint=tmp_path / "run", **asked)
    with refuses('callback needs one of the core\'s methods; "Radau" runs in SciPy', pn.InputError):
        pn.simulate(falling(), 0.1, method="Radau", callback=lambda t, q, v: None)


def test_wall_time_ends_a_run_and_keeps_it():
    with pytest.raises(pn.WallTimeError) as stopped:
        pn.simulate(swinging(), 1e6, method="rk4", dt=1e-4, output_dt=0.01, max_wall=0.2)
    error = stopped.value
    assert "the run has taken its max_wall = 0.2 s of wall time by t = " in str(error)
    assert len(error.trajectory) > 1
    assert 0.1 < error.trajectory.stats.wall_s < 5.0
    with refuses("simulate: max_wall must be positive; got 0", pn.InputError):
        pn.simulate(swinging(), 1.0, max_wall=0)
    assert len(pn.simulate(swinging(), 0.1, max_wall=np.inf)) > 1
