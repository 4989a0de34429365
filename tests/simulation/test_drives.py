"""Drives of a scene: tables that hold their torques, and lists of drives whose torques add."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

TIMES = np.array([0.1, 0.237, 0.3, 0.71])
VALUES = np.array([[1.0, 0.0], [-4.0, 2.0], [9.0, -3.0], [-2.0, 5.0]])
END = 1.0


def pendulum():
    """Two links that hang from the world, joints "shoulder" and "elbow"."""
    model = pin.Model()
    parent = 0
    for name, z in (("shoulder", 0.0), ("elbow", -1.0)):
        parent = model.addJoint(parent, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.0, 0.0, z])), name)
        inertia = pin.Inertia(1.0, np.array([0.1, 0.0, -0.5]), 0.1 * np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return model


def run(actuation, laws=(), duration=END, **options):
    return pn.simulate(
        pn.Scene(pendulum(), laws=laws, actuation=actuation), duration, progress=False, **options
    )


FRICTION = [
    pn.JointFriction("shoulder", coulomb=3.0, mu=0.1, radius=0.05),
    pn.JointFriction("elbow", coulomb=0.5, static_ratio=1.5),
]
METHODS = {
    "dop853": {"method": "dop853", "rtol": 1e-13, "atol": 1e-14},
    "dopri5": {"method": "dopri5", "rtol": 1e-13, "atol": 1e-14},
    "rk4": {"method": "rk4", "dt": 1e-3},
    "semi_implicit_euler": {"method": "semi_implicit_euler", "dt": 1e-3},
    "moreau": {"method": "moreau", "dt": 1e-3},
}


@pytest.mark.parametrize("laws", [(), FRICTION], ids=["smooth", "friction"])
@pytest.mark.parametrize("method", METHODS)
def test_a_held_table_is_a_sequence_of_constant_torques(method, laws):
    options = METHODS[method]
    whole = run(pn.Table(TIMES, VALUES, interpolation="hold"), laws, **options)
    stops = [*TIMES[1:], END]
    t, q, v = 0.0, np.zeros(2), np.zeros(2)
    for tau, stop in zip(VALUES, stops, strict=True):
        piece = run(tau, laws, stop - t, q=q, v=v, t0=t, **options)
        t, q, v = stop, piece.q[-1], piece.v[-1]
    np.testing.assert_allclose(whole.q[-1], q, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(whole.v[-1], v, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("times", [TIMES, [-0.4, 0.0, 0.5, 0.75]])
def test_steps_end_at_the_switching_times_and_the_next_torque_acts_there(times):
    one = run(pn.Table(times, VALUES, interpolation="hold"), record="tau", t0=-0.2)
    for switch, tau in zip(times[1:], VALUES[1:], strict=True):
        at = np.flatnonzero(one.t == switch)
        assert at.size >= 1
        np.testing.assert_array_equal(one.tau[at[-1]], tau)
        np.testing.assert_allclose(one.tau[at[0] - 1], VALUES[list(times).index(switch) - 1], atol=1e-14)
    np.testing.assert_array_equal(one.tau[0], VALUES[0])


def test_a_stepper_switches_at_the_ends_of_its_periods():
    table = pn.Table([0.0, 0.1, 0.2], [[1.0, 0.0], [-2.0, 0.5], [0.0, 0.0]], interpolation="hold")
    held = pn.Scene(pendulum(), actuation=table).stepper(0.1, method="rk4", dt=0.01)
    plain = pn.Scene(pendulum()).stepper(0.1, method="rk4", dt=0.01)
    for tau in ([1.0, 0.0], [-2.0, 0.5], [0.0, 0.0]):
        for a, b in zip(held.step(), plain.step(tau), strict=True):
            np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-13)


def test_a_held_table_of_one_sample_is_constant():
    np.testing.assert_array_equal(
        run(pn.Table([0.3], VALUES[:1], interpolation="hold")).q, run(pn.Table([0.3], VALUES[:1])).q
    )


def test_columns_by_name_are_the_columns_of_an_array():
    """Joints that a table does not name have no torque."""
    zero = np.zeros(len(TIMES))
    for interpolation in ("linear", "hold"):
        named = pn.Table(TIMES, {"elbow": VALUES[:, 1]}, interpolation=interpolation)
        plain = pn.Table(TIMES, np.column_stack([zero, VALUES[:, 1]]), interpolation=interpolation)
        one, other = run(named), run(plain)
        np.testing.assert_array_equal(one.q, other.q)
        np.testing.assert_array_equal(one.v, other.v)


def test_columns_of_a_structured_array_are_columns_by_name(tmp_path):
    """Such arrays come from numpy.genfromtxt(file, names=True)."""
    lines = [",".join(map(str, (t, *row))) for t, row in zip(TIMES, VALUES, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["t,shoulder,elbow", *lines]))
    log = np.genfromtxt(tmp_path / "log.csv", delimiter=",", names=True)
    columns = pn.Table(log["t"], log[["shoulder", "elbow"]])
    np.testing.assert_array_equal(run(columns).q, run(pn.Table(TIMES, VALUES)).q)


def test_a_table_of_too_few_columns_is_refused_with_the_form_by_name():
    with pytest.raises(pn.InputError, match=r"must have 2 columns \(nv\); got 1; give columns by joint name"):
        pn.Scene(pendulum(), actuation=pn.Table(TIMES, VALUES[:, :1]))


def test_methods_of_scipy_refuse_jumps():
    with pytest.raises(pn.InputError, match=r"Table needs one of the core's methods"):
        run(pn.Table(TIMES, VALUES, interpolation="hold"), method="BDF")


# --- lists of drives ----------------------------------------------------------------------------------------

SHOULDER = pn.HoldPosition({"shoulder": 20.0}, {"shoulder": 2.0}, q={"shoulder": 0.5})
PAIRS = {
    "constants": ([{"shoulder": 1.0}, {"elbow": -0.5}], [1.0, -0.5]),
    "hold positions": (
        [SHOULDER, pn.HoldPosition({"elbow": 5.0}, {"elbow": 1.0}, q={"elbow": -0.2})],
        pn.HoldPosition([20.0, 5.0], [2.0, 1.0], q=[0.5, -0.2]),
    ),
    "tables": (
        [pn.Table(TIMES, {"shoulder": VALUES[:, 0]}), pn.Table(TIMES, {"elbow": VALUES[:, 1]})],
        pn.Table(TIMES, VALUES),
    ),
    "held tables": (
        [
            pn.Table(TIMES, {"shoulder": VALUES[:, 0]}, interpolation="hold"),
            pn.Table(TIMES, {"elbow": VALUES[:, 1]}, interpolation="hold"),
        ],
        pn.Table(TIMES, VALUES, interpolation="hold"),
    ),
    "one drive": ([pn.Table(TIMES, VALUES)], pn.Table(TIMES, VALUES)),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_a_list_equals_one_drive_of_all_joints(pair):
    several, one = (run(actuation, record="tau") for actuation in PAIRS[pair])
    np.testing.assert_array_equal(several.t, one.t)
    np.testing.assert_array_equal(several.q, one.q)
    np.testing.assert_array_equal(several.tau, one.tau)


def test_tables_of_different_times_and_kinds_add():
    other = np.array([0.0, 0.4, 0.5])
    drives = [
        pn.Table(TIMES, {"shoulder": VALUES[:, 0]}, interpolation="hold"),
        pn.Table(other, {"elbow": [1.0, 3.0, -1.0]}),
    ]
    tau = run(drives, record="tau", output_dt=0.05)
    held = VALUES[np.maximum(np.searchsorted(TIMES, tau.t, side="right") - 1, 0), 0]
    np.testing.assert_allclose(tau.tau[:, 0], held, atol=1e-13)
    np.testing.assert_allclose(tau.tau[:, 1], np.interp(tau.t, other, [1.0, 3.0, -1.0]), atol=1e-13)
    assert set(other[1:]) | set(TIMES[1:]) <= set(run(drives).t)


def test_drives_of_different_kinds_add():
    """The sum of a table and a spring equals their sum in one function."""

    def both(t, q, v):
        return [20.0 * (0.5 - q[0]) - 2.0 * v[0], np.interp(t, TIMES, VALUES[:, 1])]

    drives = [SHOULDER, pn.Table(TIMES, {"elbow": VALUES[:, 1]})]
    several, one = (run(actuation, rtol=1e-11, atol=1e-12) for actuation in (drives, both))
    np.testing.assert_allclose(several.q[-1], one.q[-1], rtol=0.0, atol=1e-9)


BESIDE = {
    "spring": SHOULDER,
    "reference": pn.TrackTrajectory([0.0, 0.5, 0.9], {"shoulder": [0.0, 0.3, 0.1]}, kp=30.0, kd=3.0),
}


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("method", METHODS)
def test_steps_end_at_the_times_of_a_table_beside_another_drive(method, beside):
    """A held table in a list is a sequence of constant torques, also for methods of fixed steps."""
    options, drive = METHODS[method], BESIDE[beside]
    table = pn.Table(TIMES, {"elbow": VALUES[:, 1]}, interpolation="hold")
    whole = run([drive, table], **options)
    assert set(TIMES[1:]) <= set(whole.t)
    t, q, v = 0.0, np.zeros(2), np.zeros(2)
    for tau, stop in zip(VALUES[:, 1], [*TIMES[1:], END], strict=True):
        piece = run([drive, {"elbow": tau}], duration=stop - t, q=q, v=v, t0=t, **options)
        t, q, v = stop, piece.q[-1], piece.v[-1]
    np.testing.assert_allclose(whole.q[-1], q, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(whole.v[-1], v, rtol=0.0, atol=1e-9)


def test_steps_end_at_the_kinks_of_a_linear_table_beside_a_spring():
    """The recorded torque at each time is that of the table, on the grid of a fixed step too."""
    table = pn.Table(TIMES, {"elbow": VALUES[:, 1]})
    for options in ({}, {"method": "rk4", "dt": 0.05}, {"method": "moreau", "dt": 0.05}):
        one = run([SHOULDER, table], record="tau", **options)
        for time, value in zip(TIMES, VALUES[:, 1], strict=True):
            assert one.tau[np.flatnonzero(one.t == time)[0], 1] == value


def test_steps_end_where_a_reference_begins_and_ends_in_motion():
    times = np.array([0.1, 0.23, 0.4, 0.55])
    for v, expected in ((None, times[[0, -1]]), ([1.0, 0.5, -2.0, 1.0], times)):
        rates = None if v is None else {"shoulder": v}
        track = pn.TrackTrajectory(times, {"shoulder": [0.0, 0.3, 0.1, 0.2]}, rates, kp=30.0, kd=3.0)
        for drives in (track, [track, {"elbow": 1.0}]):
            one = run(drives, method="rk4", dt=0.04, record="tau")
            assert set(expected) <= set(one.t)
        at = int(np.flatnonzero(one.t == 0.55)[-1])
        assert one.t[at + 1] - 0.55 < 1e-15
        if v is not None:  # the velocity of the reference falls to zero within one spacing
            np.testing.assert_allclose(one.tau[at, 0] - one.tau[at + 1, 0], 3.0 * v[-1], atol=1e-9)


# --- sampled controls in a list -----------------------------------------------------------------------------

PERIOD = 0.01
STEPS = PERIOD * np.arange(0, 100, 7)  # times of a log, also samples of the control
LOG = 3.0 * np.cos(5.0 * STEPS)


def speed(t, q, v):
    return {"shoulder": 2.0 * (1.0 - v[0]) - q[1]}


def log_in_function(t, q, v):
    """The sum of `speed` and of the log in one function of all joints."""
    k = max(int(np.searchsorted(STEPS, t + 1e-9, side="right")) - 1, 0)
    return {**speed(t, q, v), "elbow": LOG[k]}


def beside_log(t0=0.0, **delay):
    control = pn.SampledControl(speed, PERIOD, joints=["shoulder"], **delay)
    return [pn.Table(STEPS + t0, {"elbow": LOG}, interpolation="hold"), control]


@pytest.mark.parametrize("method", METHODS)
def test_a_held_table_beside_a_sampled_control_is_their_sum_in_one_function(method):
    one, other = (
        run(actuation, FRICTION, record="tau", **METHODS[method])
        for actuation in (beside_log(), pn.SampledControl(log_in_function, PERIOD))
    )
    for key in ("t", "q", "v", "tau"):
        np.testing.assert_array_equal(getattr(one, key), getattr(other, key))
    assert np.ptp(one.tau[:, 1]) > 4.0


def test_a_list_with_a_sampled_control_runs_by_each_way_of_running():
    """Runs of a rollout, of a stepper and of a checkpoint are the run of simulate."""
    scene = pn.Scene(pendulum(), actuation=beside_log())
    options = {"method": "rk4", "dt": PERIOD}
    whole = pn.simulate(scene, 0.5, progress=False, **options)
    q, v = scene.q0, scene.v0
    for each in pn.rollout(scene, [q, q], [v, v], 0.5, jobs=2, **options):
        np.testing.assert_array_equal(each.q, whole.q)
    stepper = scene.stepper(PERIOD, **options)
    for _ in range(50):
        stepper.step()
    np.testing.assert_allclose(stepper.q, whole.q[-1], rtol=0.0, atol=1e-12)


def test_samples_of_a_later_start_are_counted_from_there():
    later = pn.simulate(pn.Scene(pendulum(), actuation=beside_log(0.123)), END, t0=0.123, record="tau")
    now = run(beside_log(), record="tau")
    np.testing.assert_allclose(later.q[-1], now.q[-1], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("samples", [1, 3])
def test_one_control_of_a_list_has_a_delay(samples, tmp_path):
    """The late torque is that of an earlier sample, and the log beside it is not late."""
    drives = beside_log(delay_samples=samples, initial={"shoulder": 0.5})
    scene = pn.Scene(pendulum(), actuation=drives)
    one = pn.simulate(
        scene, END, progress=False, record="tau", output_dt=PERIOD / 2, method="rk4", dt=PERIOD / 2
    )
    middle = one.tau[np.flatnonzero(one.grid)[1::2]]
    at = np.flatnonzero(one.grid)[::2][:100]
    asked = np.array([speed(0.0, one.q[k], one.v[k])["shoulder"] for k in at])
    np.testing.assert_array_equal(middle[:samples, 0], 0.5)
    np.testing.assert_allclose(middle[samples:, 0], asked[:-samples], rtol=0.0, atol=1e-12)
    held = LOG[np.searchsorted(STEPS, PERIOD * np.arange(100) + 1e-9, side="right") - 1]
    np.testing.assert_array_equal(middle[:, 1], held)
    again = pn.simulate(
        scene, END, progress=False, record="tau", output_dt=PERIOD / 2, method="rk4", dt=PERIOD / 2
    )
    np.testing.assert_array_equal(again.tau, one.tau)


def test_controls_of_one_period_command_joints_of_their_own():
    arm = pn.SampledControl(speed, PERIOD, joints=["shoulder"])
    hand = pn.SampledControl(lambda t, q, v: [0.0, -q[1]], PERIOD, joints=["elbow"], name="hand")
    both = pn.SampledControl(lambda t, q, v: {**speed(t, q, v), "elbow": -q[1]}, PERIOD)
    np.testing.assert_array_equal(run([arm, hand, {}]).q, run(both).q)
    reference = {"elbow": [0.0, 0.3, 0.1]}
    track = pn.TrackTrajectory([0.0, 0.5, 0.9], reference, kp=30.0, kd=3.0, period=PERIOD)
    assert np.abs(run([arm, track]).joint("elbow").q).max() > 0.1


CONTROL = pn.SampledControl(speed, PERIOD, joints=["shoulder"], name="servo")


@pytest.mark.parametrize(
    ("drives", "message"),
    [
        (
            [CONTROL, pn.HoldPosition({"elbow": 1.0}, {"elbow": 1.0})],
            'SampledControl "servo" holds between samples of 0.01 s add only to torques of tables and to '
            "torques that change at these samples; got HoldPosition; give all drives one",
        ),
        (
            [CONTROL, pn.SampledControl(speed, 0.02, joints=["elbow"])],
            "got SampledControl with a period of 0.02 s; give all drives one period",
        ),
        ([CONTROL, {"shoulder": 1.0}], '"shoulder" is commanded by drive 0 (SampledControl "servo")'),
        (pn.SampledControl(speed, PERIOD, joints=["sholder"]), 'no joint "sholder"; nearest: "shoulder"'),
        (
            pn.SampledControl(speed, PERIOD, delay=0.1, initial=[1.0, 2.0], joints=["shoulder"]),
            'initial must hold no torque for joints that are not in joints; got 2 for "elbow"',
        ),
        (
            [
                pn.SampledControl(speed, PERIOD, delay=0.1, joints=[name], name=name)
                for name in ("shoulder", "elbow")
            ],
            "at most one SampledControl of a list may have a delay",
        ),
    ],
)
def test_errors_of_sampled_controls_in_a_list(drives, message):
    with pytest.raises((pn.InputError, pn.UnknownNameError)) as error:
        pn.Scene(pendulum(), actuation=drives)
    assert message in str(error.value)


def test_times_of_a_table_between_samples_are_refused_before_the_run():
    table = pn.Table([0.0, 0.02, 0.035], {"elbow": [1.0, 2.0, 3.0]}, interpolation="hold", name="log")
    scene = pn.Scene(pendulum(), actuation=[CONTROL, table])
    for act in (
        lambda: pn.simulate(scene, 1.0),
        lambda: pn.rollout(scene, [scene.q0], [scene.v0], 1.0),
        lambda: scene.stepper(0.1),
    ):
        with pytest.raises(
            pn.InputError, match=r'Table "log": times must be samples .*"servo".*got 0\.035 s'
        ):
            act()


KINKS = np.array([0.05, 0.112, 0.3, 0.303, 0.71])  # on the steps of METHODS, mostly between samples
RAMPS = 3.0 * np.array([0.0, 2.0, -1.0, 3.0, -2.0])


def two_arms():
    """Two links on the world, joints "shoulder" and "elbow", which do not act on each other."""
    model = pin.Model()
    for name, length in (("shoulder", 0.5), ("elbow", 0.3)):
        joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), name)
        inertia = pin.Inertia(1.0, np.array([0.1, 0.0, -length]), 0.1 * np.eye(3))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    return model


def own_speed(t, q, v):
    return {"shoulder": 6.0 * (1.0 - v[0]) - q[0]}


def beside_ramps(interpolation="linear", **delay):
    control = pn.SampledControl(own_speed, PERIOD, joints=["shoulder"], **delay)
    return [control, pn.Table(KINKS, {"elbow": RAMPS}, interpolation=interpolation)]


def of_arms(actuation, laws=FRICTION, **options):
    scene = pn.Scene(two_arms(), laws=laws, actuation=actuation)
    return pn.simulate(scene, END, progress=False, **options)


# Events of one arm shorten the steps of both, which changes motions by a method of order 1.
SEPARATE = [
    (method, laws)
    for method in METHODS
    for laws in ((), FRICTION)
    if not laws or method != "semi_implicit_euler"
]


@pytest.mark.parametrize(("method", "laws"), SEPARATE)
def test_a_linear_table_beside_a_sampled_control_moves_its_joints_as_alone(method, laws):
    """Each of two arms moves as if the other one had no drive, by every method of the core."""
    options = METHODS[method] | {"record": ("tau", "energy"), "output_dt": 0.05}
    drives = beside_ramps()
    both, *alone = (of_arms(actuation, laws, **options) for actuation in (drives, *drives))
    for dof, one in enumerate(alone):
        for key in ("q", "v", "tau"):
            ours, other = getattr(both, key)[both.grid, dof], getattr(one, key)[one.grid, dof]
            np.testing.assert_allclose(ours, other, rtol=0.0, atol=1e-9)
    work = [one.energy["actuation"][-1] for one in (both, *alone)]
    np.testing.assert_allclose(work[0], sum(work[1:]), rtol=0.0, atol=1e-9)
    if method in ("dop853", "dopri5", "rk4"):
        assert np.abs(both.energy["balance"]).max() < 1e-8
    assert np.ptp(both.q, axis=0).min() > 0.1


def test_steps_end_at_samples_and_at_kinks_and_the_torque_between_them_is_linear():
    one = of_arms(beside_ramps(), record="tau")
    assert set(KINKS) <= set(one.t)
    assert {PERIOD * k for k in range(1, 100)} <= set(one.t)
    np.testing.assert_allclose(one.tau[:, 1], np.interp(one.t, KINKS, RAMPS), rtol=0.0, atol=1e-12)
    periods = one.t / PERIOD
    inside = np.abs(periods - np.round(periods)) > 1e-6
    held = [one.tau[inside & (np.floor(periods) == k), 0] for k in range(100)]
    assert max(np.ptp(torques) for torques in held if torques.size) == 0.0


def test_a_table_beside_a_delayed_control_is_not_late():
    drives = beside_ramps(delay_samples=3, initial={"shoulder": 0.5})
    late, alone = of_arms(drives, record="tau"), of_arms(drives[0], record="tau")
    np.testing.assert_allclose(late.tau[:, 1], np.interp(late.t, KINKS, RAMPS), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(late.q[-1, 0], alone.q[-1, 0], rtol=0.0, atol=1e-8)


def test_ways_of_running_a_control_beside_a_linear_table():
    """Runs of a rollout and of a stepper are the run of simulate; a torque of the caller replaces all."""
    scene = pn.Scene(two_arms(), actuation=beside_ramps())
    options = {"method": "rk4", "dt": PERIOD}
    whole = pn.simulate(scene, 0.5, progress=False, **options)
    for each in pn.rollout(scene, [scene.q0] * 2, [scene.v0] * 2, 0.5, jobs=2, **options):
        np.testing.assert_array_equal(each.q, whole.q)
    stepper = scene.stepper(PERIOD, **options)
    for _ in range(50):
        stepper.step()
    np.testing.assert_allclose(stepper.q, whole.q[-1], rtol=0.0, atol=1e-12)
    plain, replaced = pn.Scene(two_arms()).stepper(PERIOD, **options), scene.stepper(PERIOD, **options)
    for _ in range(10):
        plain.step([1.0, 2.0])
        replaced.step([1.0, 2.0])
    np.testing.assert_allclose(replaced.q, plain.q, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("method", ["dop853", "rk4", "moreau"])
def test_torques_that_replace_a_sampled_control_act_past_its_samples(method):
    """Runs of a stepper and with a callback go on where the next sample would be."""
    options = {"method": method} | ({} if method == "dop853" else {"dt": PERIOD / 2})
    torque = [1.0, 2.0]
    driven, plain = (
        pn.Scene(two_arms(), actuation=a) for a in (pn.SampledControl(own_speed, PERIOD), torque)
    )
    steps, expected = driven.stepper(3.0 * PERIOD, **options), plain.stepper(3.0 * PERIOD, **options)
    for _ in range(4):
        steps.step(torque)
        expected.step()
    np.testing.assert_allclose(steps.q, expected.q, rtol=0.0, atol=1e-9)
    told = pn.simulate(driven, 0.1, callback=lambda t, q, v: torque, progress=False, **options)
    np.testing.assert_allclose(
        told.q[-1], pn.simulate(plain, 0.1, progress=False, **options).q[-1], rtol=0.0, atol=1e-7
    )


def test_limits_clip_a_table_beside_a_sampled_control_where_it_reaches_them():
    limited = pn.EffortLimits(beside_ramps(), effort={"elbow": 4.5})
    one = of_arms(limited, record="tau")
    at = [event.time for event in one.events if event.kind == "saturate"]
    assert np.abs(one.tau[:, 1]).max() <= 4.5
    first = np.interp(4.5, RAMPS[:2], KINKS[:2])
    assert abs(at[0] - first) < 1e-9


def test_a_scene_without_motion_waits_for_the_table():
    """An arm at rest at first is driven by a table whose torques begin later."""
    model = two_arms()
    model.gravity = pin.Motion.Zero()
    still = pn.SampledControl(lambda t, q, v: [0.0, 0.0], PERIOD, joints=["shoulder"])
    table = pn.Table([0.5, 0.9], {"elbow": [0.0, 1.0]})
    runs = [
        pn.simulate(pn.Scene(model, actuation=actuation), END, method=method, dt=dt, progress=False)
        for method, dt in (("dop853", None), ("moreau", 1e-3))
        for actuation in ([still, table], table)
    ]
    for both, alone in (runs[:2], runs[2:]):
        np.testing.assert_allclose(both.q[-1], alone.q[-1], rtol=0.0, atol=1e-9)
        assert both.q[-1, 1] > 1e-2


def test_a_held_and_a_linear_table_stand_beside_one_control():
    model = two_arms()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "third")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    held = pn.Table(STEPS, {"third": LOG}, interpolation="hold")
    scene = pn.Scene(model, actuation=[held, *beside_ramps()])
    one = pn.simulate(scene, END, record="tau", output_dt=PERIOD / 2, progress=False)
    np.testing.assert_allclose(one.tau[:, 1], np.interp(one.t, KINKS, RAMPS), rtol=0.0, atol=1e-12)
    middle = np.flatnonzero(one.grid)[1::2]
    k = np.searchsorted(STEPS, one.t[middle], side="right") - 1
    np.testing.assert_array_equal(one.tau[middle, 2], LOG[k])


def test_torques_of_joints_that_a_control_does_not_command_are_refused():
    wrong = pn.SampledControl(lambda t, q, v: [1.0, 2.0], PERIOD, joints=["shoulder"])
    with pytest.raises(pn.UserFunctionError, match='got 2 for "elbow"; add it to joints'):
        run(wrong)
    for joints, message in (([], "at least one joint"), ("elbow", "joints"), ([3], "joints")):
        with pytest.raises(pn.InputError, match=message):
            pn.SampledControl(speed, PERIOD, joints=joints)


def test_limits_of_one_drive_apply_to_its_joints():
    drives = [pn.EffortLimits(SHOULDER, effort=1.0), {"elbow": 3.0}]
    tau = run(drives, record="tau").tau
    assert np.abs(tau[:, 0]).max() == 1.0
    assert (tau[:, 1] == 3.0).all()
    around = run(pn.EffortLimits([SHOULDER, {"elbow": 3.0}], effort=1.0), record="tau").tau
    assert (around[:, 1] == 1.0).all()


def test_scenes_with_lists_are_described_copied_and_pickled():
    scene = pn.Scene(pendulum(), actuation=[SHOULDER, {"elbow": 3.0}])
    told = scene.describe()
    assert [drive["kind"] for drive in told.to_dict()["actuation"]["made_with"]["drives"]] == [
        "HoldPosition",
        "constant torques",
    ]
    assert "HoldPosition" in str(told)
    assert "actuation HoldPosition" in scene.report()
    expected = pn.simulate(scene, 0.1).q
    for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene)), scene.replace()):
        np.testing.assert_array_equal(pn.simulate(other, 0.1).q, expected)


@pytest.mark.parametrize(
    ("drives", "message"),
    [
        (
            [SHOULDER, {"shoulder": 1.0, "elbow": 2.0}],
            '"shoulder" is commanded by drive 0 (HoldPosition) and drive 1 (constant torques)',
        ),
        (
            [pn.HoldPosition(1.0, 1.0, name="stand"), pn.Table([0.0], {"elbow": [1.0]}, name="log")],
            '"elbow" is commanded by drive 0 (HoldPosition "stand") and drive 1 (Table "log")',
        ),
        ([lambda t, q, v: [0.0, 0.0], {"elbow": 1.0}], '"elbow" is commanded by drive 0 (function)'),
        (
            [pn.SampledControl(lambda t, q, v: [0.0, 0.0], 0.01), SHOULDER],
            '"shoulder" is commanded by drive 0 (SampledControl) and drive 1 (HoldPosition)',
        ),
        ([SHOULDER, {"elbo": 1.0}], 'actuation[1]: no joint "elbo"; nearest: "elbow"'),
        ([SHOULDER, None], "each entry of a list of drives must be a drive; entry 1 is None"),
        ([SHOULDER, [{"elbow": 1.0}]], "entry 1 is another list"),
        (
            pn.EffortLimits([{"elbow": 1.0}], 1.0),
            None,
        ),
    ],
)
def test_errors(drives, message):
    if message is None:
        with pytest.raises(pn.InputError, match="must be drives without effort limits"):
            pn.EffortLimits([drives, {"shoulder": 1.0}], 1.0)
        return
    with pytest.raises((pn.InputError, pn.UnknownNameError)) as error:
        pn.Scene(pendulum(), actuation=drives)
    assert message in str(error.value)


def test_an_interpolation_is_linear_or_hold():
    with pytest.raises(pn.InputError, match="Table: interpolation must be one of 'linear', 'hold'"):
        pn.Table([0.0], [[1.0]], interpolation="cubic")
