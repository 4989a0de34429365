"""TrackTrajectory: references, feedforwards and errors, beside splines of SciPy and laws by hand."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

import pin_nonideal as pn
from pin_nonideal.states.reference_motion import ReferenceMotion
from pin_nonideal.statics.closed_reference import ClosedReference

TIMES = np.array([0.0, 0.1, 0.25, 0.3, 0.45, 0.6])
TIGHT = {"rtol": 1e-10, "atol": 1e-12, "progress": False}


def arm():
    """Three links that hang from the world: "shoulder", "elbow" and a slider "rod"."""
    model = pin.Model()
    parent = 0
    for name, joint in (
        ("shoulder", pin.JointModelRY()),
        ("elbow", pin.JointModelRX()),
        ("rod", pin.JointModelPZ()),
    ):
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5])), name)
        inertia = pin.Inertia(1.0, np.array([0.1, 0.0, -0.2]), 0.1 * np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    model.armature = np.array([0.1, 0.0, 0.2])
    return model


def groups():
    """A floating base with a ball joint, an unbounded wheel and a plane."""
    model = pin.Model()
    parent = 0
    for name, joint in (
        ("root", pin.JointModelFreeFlyer()),
        ("ball", pin.JointModelSpherical()),
        ("wheel", pin.JointModelRUBZ()),
        ("sled", pin.JointModelPlanar()),
    ):
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array([0.0, 0.1, -0.3])), name)
        inertia = pin.Inertia(1.0, np.array([0.1, 0.0, -0.2]), 0.1 * np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return model


NAMES = ["shoulder", "elbow", "rod"]
Q = np.column_stack(
    [0.4 * np.sin(3.0 * TIMES), 0.3 * np.cos(4.0 * TIMES), 0.1 * TIMES + 0.05 * np.sin(9.0 * TIMES)]
)
BY_NAME = {name: Q[:, k] for k, name in enumerate(NAMES)}
SPLINE = CubicSpline(TIMES, Q)
NO_GAINS = {"kp": 0.0, "kd": 0.0}
GAINS = {"kp": 40.0, "kd": 4.0}


def torque(drive, model, t, q, v):
    """Return the torques of a drive, as the core receives them."""
    with_drive = pn.Scene(model, actuation=drive).solve(q, v, t).a
    M, b = pn.Scene(model).mass_matrix(q), pn.Scene(model).bias_forces(q, v)
    return M @ with_drive + b


@pytest.mark.parametrize("rates", ["none", "given"])
def test_inverse_dynamics_of_the_reference_reproduces_it_without_gains(rates):
    v = None if rates == "none" else SPLINE(TIMES, 1) + 0.1
    oracle = SPLINE if v is None else CubicHermiteSpline(TIMES, Q, v)
    drive = pn.TrackTrajectory(TIMES, Q, v, **NO_GAINS, feedforward="rnea")
    scene = pn.Scene(arm(), actuation=drive, q0=Q[0], v0=oracle(0.0, 1))
    run = pn.simulate(scene, TIMES[-1], **TIGHT)
    np.testing.assert_allclose(run.q, oracle(run.t), rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(run.v, oracle(run.t, 1), rtol=0.0, atol=1e-7)


def test_gains_bring_a_start_beside_the_reference_back_to_it():
    drive = pn.TrackTrajectory(TIMES, Q, kp=400.0, kd=40.0, feedforward="rnea")
    scene = pn.Scene(arm(), actuation=drive, q0=Q[0] + 0.02, v0=SPLINE(0.0, 1))
    run = pn.simulate(scene, TIMES[-1], progress=False)
    assert np.abs(run.q[-1] - Q[-1]).max() < 0.2 * np.abs(run.q[0] - Q[0]).max()


@pytest.mark.parametrize("feedforward", ["none", "gravity", "rnea"])
def test_the_law(feedforward):
    """tau = kp (q_r - q) + kd (v_r - v) + feedforward, at times inside and outside the samples."""
    model, t = arm(), 0.17
    rng = np.random.default_rng(1)
    q, v = rng.standard_normal(3), rng.standard_normal(3)
    drive = pn.TrackTrajectory(TIMES, Q, **GAINS, feedforward=feedforward)
    for t, (q_r, v_r, a_r) in (
        (0.17, [SPLINE(0.17, k) for k in range(3)]),
        (TIMES[-1], [SPLINE(TIMES[-1], k) for k in range(3)]),
        (-0.1, [Q[0], np.zeros(3), np.zeros(3)]),
        (0.9, [Q[-1], np.zeros(3), np.zeros(3)]),
    ):
        expected = 40.0 * (q_r - q) + 4.0 * (v_r - v)
        if feedforward == "gravity":
            expected += pn.Scene(model).bias_forces(q_r, np.zeros(3))
        if feedforward == "rnea":
            expected += pn.Scene(model).mass_matrix(q_r) @ a_r + pn.Scene(model).bias_forces(q_r, v_r)
        np.testing.assert_allclose(torque(drive, model, t, q, v), expected, rtol=0.0, atol=1e-9)


def test_one_sample_holds_a_configuration():
    drive = pn.TrackTrajectory([0.0], Q[:1], **GAINS, feedforward="gravity")
    run = pn.simulate(pn.Scene(arm(), actuation=drive, q0=Q[0]), 0.5, progress=False)
    np.testing.assert_allclose(run.q[-1], Q[0], rtol=0.0, atol=1e-12)


def test_joints_that_q_does_not_name_enter_with_their_present_state():
    """Shoulder and rod along the reference, the elbow by a spring: both add, and torques stay separate."""
    named = {name: BY_NAME[name] for name in ("shoulder", "rod")}
    drive = pn.TrackTrajectory(TIMES, named, **NO_GAINS, feedforward="rnea")
    model, t = arm(), 0.17
    q, v = np.array([0.3, -0.2, 0.1]), np.array([1.0, 2.0, -0.5])
    q_r, v_r, a_r = (np.array(SPLINE(t, k)) for k in range(3))
    q_r[1], v_r[1], a_r[1] = q[1], v[1], 0.0
    expected = pn.Scene(model).mass_matrix(q_r) @ a_r + pn.Scene(model).bias_forces(q_r, v_r)
    expected[1] = 0.7
    drives = [drive, {"elbow": 0.7}]
    np.testing.assert_allclose(torque(drives, model, t, q, v), expected, rtol=0.0, atol=1e-9)


# --- Lie groups ---------------------------------------------------------------------------------------------


def samples_of_groups(model, size=0.3):
    rng = np.random.default_rng(3)
    q = [pin.neutral(model)]
    for _ in TIMES[1:]:
        q.append(pin.integrate(model, q[-1], size * rng.standard_normal(model.nv)))
    return np.array(q)


@pytest.mark.parametrize("given", [False, True])
def test_a_reference_on_lie_groups_is_consistent(given):
    """v is the rate of q, a is the rate of v, and samples are met."""
    model = groups()
    q = samples_of_groups(model)
    v = np.random.default_rng(4).standard_normal((len(q), model.nv)) if given else None
    motion = ReferenceMotion(model, TIMES, q, v)
    for k, t in enumerate(TIMES):
        np.testing.assert_allclose(motion(t)[0], q[k], rtol=0.0, atol=1e-12)
        if given:
            np.testing.assert_allclose(motion(t)[1], v[k], rtol=0.0, atol=1e-9)
    for t in (0.03, 0.21, 0.5):
        before, at, after = (motion(t + d) for d in (-1e-5, 0.0, 1e-5))
        rate = pin.difference(model, before[0], after[0]) / 2e-5
        np.testing.assert_allclose(rate, at[1], rtol=0.0, atol=1e-6 * np.abs(rate).max())
        np.testing.assert_allclose((after[1] - before[1]) / 2e-5, at[2], atol=1e-6 * np.abs(at[2]).max())


def test_inverse_dynamics_reproduces_a_reference_on_lie_groups():
    model = groups()
    q = samples_of_groups(model, 0.1)
    motion = ReferenceMotion(model, TIMES, q)
    drive = pn.TrackTrajectory(TIMES, q, **NO_GAINS, feedforward="rnea", joints=list(model.names)[1:])
    start = motion(0.0)
    run = pn.simulate(
        pn.Scene(model, actuation=drive, q0=start[0], v0=start[1]), 0.3, progress=False, rtol=1e-9, atol=1e-10
    )
    for t, at in zip(run.t, run.q, strict=True):
        assert np.abs(pin.difference(model, at, motion(t)[0])).max() < 1e-6


def test_gains_act_on_the_difference_in_the_tangent_space():
    model = groups()
    q = samples_of_groups(model)
    drive = pn.TrackTrajectory([0.0], q[:1], kp={"ball": 3.0, "wheel": 2.0}, kd={"ball": 0.5})
    state, rate = q[2], np.ones(model.nv)
    expected = np.zeros(model.nv)
    error = pin.difference(model, state, q[0])
    expected[6:9] = 3.0 * error[6:9] - 0.5
    expected[9] = 2.0 * error[9]
    np.testing.assert_allclose(torque(drive, model, 0.0, state, rate), expected, rtol=0.0, atol=1e-8)


def test_angles_by_name_turn_an_unbounded_joint():
    model = groups()
    angles = np.array([0.1, 0.4, 0.9, 1.5, 2.4, 3.4])
    by_angle = pn.TrackTrajectory(TIMES, {"wheel": angles}, **GAINS)
    pairs = np.column_stack([np.cos(angles), np.sin(angles)])
    by_pair = pn.TrackTrajectory(TIMES, {"wheel": pairs}, **GAINS)
    state, rate = pin.neutral(model), np.zeros(model.nv)
    one, other = (torque(drive, model, 0.2, state, rate) for drive in (by_angle, by_pair))
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(
        one[9], 40.0 * CubicSpline(TIMES, angles)(0.2) + 4.0 * CubicSpline(TIMES, angles)(0.2, 1), atol=1e-9
    )


# --- names, samples, lists ----------------------------------------------------------------------------------


def states(drive, **options):
    run = pn.simulate(pn.Scene(arm(), actuation=drive, q0=Q[0]), 0.7, progress=False, **options)
    return run.q, run.v


def test_names_and_arrays_are_equal_to_the_bit():
    v = SPLINE(TIMES, 1)
    plain = pn.TrackTrajectory(
        TIMES, Q, v, kp=[40.0, 30.0, 20.0], kd=[4.0, 3.0, 2.0], feedforward="rnea", period=0.01
    )
    named = pn.TrackTrajectory(
        TIMES,
        dict(reversed(BY_NAME.items())),
        {name: v[:, k] for k, name in enumerate(NAMES)},
        kp={"rod": 20.0, "elbow": 30.0, "shoulder": 40.0},
        kd={"rod": 2.0, "elbow": 3.0, "shoulder": 4.0},
        feedforward="rnea",
        period=0.01,
    )
    for one, other in zip(states(plain), states(named), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_frame_of_pandas_is_a_table():
    """pandas is not needed: a stand-in of its module has the same items."""

    class DataFrame:
        def items(self):
            return BY_NAME.items()

    DataFrame.__module__ = "pandas.core.frame"
    one, other = (pn.TrackTrajectory(TIMES, q, **GAINS) for q in (DataFrame(), BY_NAME))
    np.testing.assert_array_equal(states(one)[0], states(other)[0])


def test_a_period_holds_the_torque_as_sampled_control_does():
    def law(t, q, v):
        inside = t <= TIMES[-1]
        q_r, v_r = (SPLINE(t), SPLINE(t, 1)) if inside else (Q[-1], np.zeros(3))
        return 40.0 * (q_r - q) + 4.0 * (v_r - v)

    drive = pn.TrackTrajectory(TIMES, Q, **GAINS, period=0.013)
    one, other = states(drive), states(pn.SampledControl(law, 0.013))
    np.testing.assert_allclose(one[0][-1], other[0][-1], rtol=0.0, atol=1e-9)
    run = pn.simulate(pn.Scene(arm(), actuation=drive, q0=Q[0]), 0.1, progress=False, record="tau")
    assert {0.013, 0.026} <= set(run.t)
    assert len(np.unique(run.tau[:, 0])) <= 9


def test_sampled_torques_add_to_constant_torques_and_to_those_of_the_same_period():
    shoulder, elbow, rod = (
        pn.TrackTrajectory(TIMES, {name: BY_NAME[name]}, **GAINS, period=0.01) for name in NAMES
    )
    whole = pn.TrackTrajectory(TIMES, BY_NAME, **GAINS, period=0.01)
    for one, other in zip(states([shoulder, elbow, rod]), states(whole), strict=True):
        np.testing.assert_array_equal(one, other)
    with_constant = pn.Scene(arm(), actuation=[shoulder, {"rod": 2.5}])
    tau = pn.simulate(with_constant, 0.1, progress=False, record="tau").tau
    assert (tau[:, 2] == 2.5).all()
    assert not tau[:, 1].any()
    for other in (
        pn.TrackTrajectory(TIMES, {"rod": BY_NAME["rod"]}, **GAINS, period=0.02),
        pn.HoldPosition({"rod": 1.0}, {"rod": 1.0}),
    ):
        with pytest.raises(pn.InputError, match="add only to torques of tables and to torques that change"):
            pn.Scene(arm(), actuation=[shoulder, other])


def test_limits_around_a_drive_clip_its_torque():
    drive = pn.EffortLimits(pn.TrackTrajectory(TIMES, Q + 1.0, **GAINS), effort=1.0)
    tau = pn.simulate(pn.Scene(arm(), actuation=drive), 0.1, progress=False, record="tau").tau
    assert np.abs(tau).max() == 1.0


def test_scenes_are_described_copied_and_pickled():
    drive = pn.TrackTrajectory(TIMES, BY_NAME, **GAINS, feedforward="rnea", name="log")
    scene = pn.Scene(arm(), actuation=drive)
    assert scene.describe().to_dict()["actuation"]["kind"] == "TrackTrajectory"
    assert "actuation log (TrackTrajectory)" in scene.report()
    expected = pn.simulate(scene, 0.1, progress=False).q
    for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        np.testing.assert_array_equal(pn.simulate(other, 0.1, progress=False).q, expected)


def test_a_checkpoint_continues_a_run(tmp_path):
    scene = pn.Scene(arm(), actuation=pn.TrackTrajectory(TIMES, Q, **GAINS, period=0.01), q0=Q[0])
    whole = pn.simulate(scene, 0.2, progress=False)
    pn.simulate(scene, 0.2, checkpoint=tmp_path / "run", progress=False)
    again = pn.resume(tmp_path / "run", scene=scene)
    np.testing.assert_array_equal(again.q[-1], whole.q[-1])


def test_runs_of_a_batch_and_methods_of_scipy():
    scene = pn.Scene(arm(), actuation=pn.TrackTrajectory(TIMES, Q, **GAINS), q0=Q[0])
    q = np.array([Q[0], Q[0] + 0.1])
    runs = pn.rollout(scene, q, np.zeros((2, 3)), 0.2, jobs=2)
    for start, run in zip(q, runs, strict=True):
        alone = pn.simulate(scene, 0.2, q=start, v=np.zeros(3), progress=False)
        np.testing.assert_array_equal(run.q[-1], alone.q[-1])
    with pytest.raises(pn.InputError, match="changes more than numbers"):
        pn.rollout(scene, None, None, 0.1, parameters={"actuation": {"kp": [1.0, 2.0]}})
    masses = pn.rollout(scene, None, None, 0.1, parameters={"rod": {"mass": [1.0, 2.0]}})
    np.testing.assert_allclose(masses[0].q[-1], pn.simulate(scene, 0.1, progress=False).q[-1], atol=1e-9)
    assert np.abs(masses[0].q[-1] - masses[1].q[-1]).max() > 1e-4
    near = pn.simulate(scene, 0.2, method="LSODA", progress=False)
    np.testing.assert_allclose(near.q[-1], pn.simulate(scene, 0.2, progress=False).q[-1], atol=1e-6)
    held = pn.Scene(arm(), actuation=pn.TrackTrajectory(TIMES, Q, **GAINS, period=0.01))
    with pytest.raises(pn.InputError, match=r"TrackTrajectory needs one of the core's methods"):
        pn.simulate(held, 0.2, method="LSODA", progress=False)


# --- loops --------------------------------------------------------------------------------------------------

CRANK = 1.0 + 2.0 * TIMES + 0.2 * np.sin(5.0 * TIMES)
CRANK_SPLINE = CubicSpline(TIMES, CRANK)


@pytest.fixture(scope="module")
def four_bar():
    return pn.load("four_bar")


def driven_by(drive, four_bar, laws=()):
    scene = four_bar.replace(actuation=drive, laws=laws)
    return pn.simulate(
        scene,
        0.3,
        q={"crank_joint": CRANK[0]},
        v={"crank_joint": float(CRANK_SPLINE(0.0, 1))},
        record=("tau", "energy"),
        rtol=1e-9,
        atol=1e-11,
        progress=False,
    )


@pytest.mark.parametrize("friction", [False, True])
def test_one_motor_drives_a_loop_along_its_reference(four_bar, friction):
    drive = pn.TrackTrajectory(TIMES, {"crank_joint": CRANK}, **NO_GAINS, feedforward="constrained")
    run = driven_by(drive, four_bar, four_bar.laws if friction else ())
    np.testing.assert_allclose(run.q[:, 0], CRANK_SPLINE(run.t), rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(run.v[:, 0], CRANK_SPLINE(run.t, 1), rtol=0.0, atol=1e-6)
    assert not run.tau[:, 1:].any()
    if not friction:  # the power of the motor is the rate of the energy
        energy = np.array([four_bar.energies(q, v)["total"] for q, v in zip(run.q, run.v, strict=True)])
        np.testing.assert_allclose(run.energy["actuation"], energy - energy[0], rtol=0.0, atol=1e-7)


def test_a_whole_configuration_is_put_onto_the_loop(four_bar):
    """Samples of all joints with rounding errors: the crank keeps its values, and the others follow."""
    closed = np.array([four_bar.project({"crank_joint": angle}, {"crank_joint": 0.0})[0] for angle in CRANK])
    noise = 1e-5 * np.random.default_rng(5).standard_normal(closed.shape)
    noise[:, 0] = 0.0
    gains = {"kp": {"crank_joint": 0.0}, "kd": {"crank_joint": 0.0}}
    whole = pn.TrackTrajectory(TIMES, closed + noise, **gains, feedforward="constrained")
    run = driven_by(whole, four_bar)
    np.testing.assert_allclose(run.q[:, 0], CRANK_SPLINE(run.t), rtol=0.0, atol=1e-7)


def test_samples_far_apart_stay_in_their_way_of_assembly(four_bar):
    """Between samples more than 0.7 rad apart, the loop is followed and does not snap through."""
    times = np.linspace(0.0, 3.0, 10)
    crank = 1.0 + 2.2 * times
    scene = four_bar.replace(actuation=None, laws=())
    q = np.tile(scene.project({"crank_joint": 1.0}, np.zeros(3))[0], (10, 1))
    q[:, 0] = crank
    crank_only = np.array([True, False, False])
    reference = ClosedReference(scene._compiled, times, q, None, crank_only, crank_only, "log")
    signs = set()
    for t in np.linspace(0.0, 3.0, 301):
        now = reference(t)[0]
        np.testing.assert_allclose(now[0], 1.0 + 2.2 * t, rtol=0.0, atol=1e-12)
        signs.add(np.sign(np.linalg.det(scene.jacobian("loop", now)[:, 1:])))
    assert len(signs) == 1


def test_two_motors_share_a_loop(four_bar):
    """More motors than freedoms: the reference keeps the crank, and both motors together move the loop."""
    closed = np.array([four_bar.project({"crank_joint": angle}, {"crank_joint": 0.0})[0] for angle in CRANK])
    q = {"crank_joint": CRANK, "rocker_joint": closed[:, 2]}
    drive = pn.TrackTrajectory(TIMES, q, **NO_GAINS, feedforward="constrained")
    scene = four_bar.replace(actuation=drive, laws=())
    on, rate = scene.project({"crank_joint": float(CRANK_SPLINE(0.1))}, {"crank_joint": 0.0})
    rate = scene.project(on, {"crank_joint": float(CRANK_SPLINE(0.1, 1))})[1]
    solution = scene.solve(on, rate, 0.1)
    found = pn.inverse_dynamics(scene, on, rate, solution.a, ["crank_joint", "rocker_joint"], t=0.1)
    assert found.tau[2] != 0.0
    kept = 0 if abs(solution.a[0] - CRANK_SPLINE(0.1, 2)) < 1e-5 else 2
    expected = CRANK_SPLINE if kept == 0 else CubicSpline(TIMES, closed[:, 2])
    np.testing.assert_allclose(solution.a[kept], expected(0.1, 2), rtol=1e-5)


def test_three_motors_of_a_delta_follow_their_references():
    robot = pn.load("delta")
    model, q0 = robot.model, robot.initial_state()[0]
    motors = ["motor0", "motor1", "motor2"]
    values = [model.idx_qs[model.getJointId(name)] for name in motors]
    dofs = [model.idx_vs[model.getJointId(name)] for name in motors]
    pace = dict(zip(motors, (0.2, 0.4, 0.6), strict=True))
    start = dict(zip(motors, q0[values], strict=True))
    drive = pn.TrackTrajectory(
        TIMES,
        {name: start[name] + pace[name] * TIMES**2 for name in motors},
        {name: 2.0 * pace[name] * TIMES for name in motors},
        **NO_GAINS,
        feedforward="constrained",
    )
    scene = robot.replace(actuation=drive, laws=())
    still = np.zeros(model.nv)
    run = pn.simulate(scene, 0.2, q=q0, v=still, record="tau", rtol=1e-9, progress=False)
    for name, value in zip(motors, values, strict=True):
        expected = start[name] + pace[name] * run.t**2
        np.testing.assert_allclose(run.q[:, value], expected, rtol=0.0, atol=1e-6)
    assert not np.delete(run.tau, dofs, axis=1).any()


def test_named_coordinates_that_the_constraints_do_not_admit_together_are_an_error():
    robot = pn.load("five_bar")  # a constraint drives motor1
    q = {"motor1": 2.2 + 0.0 * TIMES, "motor2": 0.9 + TIMES}
    drive = pn.TrackTrajectory(TIMES, q, **GAINS, feedforward="constrained")
    with pytest.raises(pn.InputError, match=r'q at t = 0.1 s opens "drive" by 0.02 .*free, 1 here$'):
        pn.simulate(robot.replace(actuation=drive), 0.1, progress=False)


def no_step(t, q, v):
    raise AssertionError("a step began")


def crank_motion(four_bar):
    """Configurations and velocities of the four-bar at the times, (nt, 3) each."""
    states = [
        four_bar.project({"crank_joint": angle}, {"crank_joint": float(CRANK_SPLINE(t, 1))})
        for t, angle in zip(TIMES, CRANK, strict=True)
    ]
    return np.array([q for q, _ in states]), np.array([v for _, v in states])


def as_given(samples, form):
    names = ("crank_joint", "coupler_joint", "rocker_joint")
    kept = {"array": None, "three names": (0, 1, 2), "two names": (0, 2)}[form]
    return samples if kept is None else {names[k]: samples[:, k] for k in kept}


@pytest.mark.parametrize(
    "form", ["two names", *(pytest.param(form, marks=pytest.mark.slow) for form in ("array", "three names"))]
)
@pytest.mark.parametrize("wrong", ["q", "v"])
def test_a_reference_that_opens_a_loop_is_refused_before_the_first_step(four_bar, form, wrong, tmp_path):
    """From the third sample on the rocker is off: the message names loop, size, time and remedy."""
    q, v = crank_motion(four_bar)
    off = {"q": q, "v": v}[wrong]
    off[2:, 2] += {"q": 0.05, "v": 2.0}[wrong]
    drive = pn.TrackTrajectory(
        TIMES, as_given(q, form), as_given(v, form), kp=1.0, kd=0.0, joints=["crank_joint"],
        feedforward="constrained",
    )  # fmt: skip
    scene = four_bar.replace(actuation=drive)
    state, path = {"q": q[0], "v": v[0]}, tmp_path / "run.checkpoint"
    gap = {"q": r"0\.0\d+ \(m or rad\)", "v": r"[01]\.\d+ \(m/s or rad/s\)"}[wrong]
    expected = rf'^TrackTrajectory: {wrong} at t = {TIMES[2]:g} s opens "loop" by {gap}, .* 1 here$'
    for begin in (
        lambda: pn.simulate(scene, 0.1, **state, callback=no_step, progress=False),
        lambda: pn.simulate(scene, 0.1, **state, checkpoint=path, progress=False),
        lambda: pn.rollout(scene, [state["q"]], [state["v"]], 0.1, failures="keep"),
    ):
        with pytest.raises(pn.InputError, match=expected):
            begin()
    assert not path.exists()


def test_velocities_of_differences_are_no_violation(four_bar):
    """numpy.gradient is of first order at the ends; the crank's velocity is kept, and the others follow."""
    q, _ = crank_motion(four_bar)
    drive = pn.TrackTrajectory(
        TIMES, q, np.gradient(q, TIMES, axis=0), **GAINS, joints=["crank_joint"], feedforward="constrained"
    )
    assert pn.simulate(four_bar.replace(actuation=drive), 0.02, q=q[0], progress=False).t[-1] == 0.02


def test_a_reference_out_of_reach_of_the_loop_is_refused_before_the_first_step(four_bar):
    for rocker, time in ((1.6 + 4.0 * TIMES, r"0\.\d+"), (0.0 * TIMES, "0")):
        drive = pn.TrackTrajectory(TIMES, {"rocker_joint": rocker}, **GAINS, feedforward="constrained")
        expected = (
            rf'no configuration on the constraints has the reference at t = {time} s: "loop" stays open by 0'
        )
        with pytest.raises(pn.InputError, match=expected):
            pn.simulate(four_bar.replace(actuation=drive), 0.1, callback=no_step, progress=False)


# --- errors -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"times": [0.0, 0.0]}, "TrackTrajectory: times must increase; times[1] = 0 does not follow"),
        ({"times": []}, "TrackTrajectory: times must hold at least one sample; got none"),
        ({"times": [0.0, 1.0]}, "TrackTrajectory: q must have shape (2, n); got shape (6, 3)"),
        ({"q": {"elbow": [1.0]}}, 'TrackTrajectory: q of "elbow" must have shape (6,); got shape (1,)'),
        ({"q": np.where(Q[2, 1] == Q, np.nan, Q)}, "TrackTrajectory: q must be finite; entry [2, 1] is nan"),
        ({"v": Q[:3]}, "TrackTrajectory: v must have shape (6, n); got shape (3, 3)"),
        ({"v": {"elbow": TIMES}}, "TrackTrajectory: v must have the form of q, an array"),
        (
            {"q": BY_NAME, "v": {"elbow": TIMES}},
            'v must name the same joints as q; "rod" is in one of them only',
        ),
        ({"kp": -1.0}, "TrackTrajectory: kp must not be negative; got -1"),
        ({"feedforward": "gravityy"}, "TrackTrajectory: feedforward must be one of 'none', 'gravity'"),
        ({"period": 0.0}, "TrackTrajectory: period must be positive; got 0"),
        ({"joints": "elbow"}, "TrackTrajectory: joints must be a list; got 'elbow'"),
        ({"name": ""}, "TrackTrajectory: name must be a name; got an empty string"),
        ({"q": {"elbo": TIMES}}, 'TrackTrajectory: q: no joint "elbo"; nearest: "elbow"'),
        ({"q": Q[:, :2]}, "TrackTrajectory: q must have shape (6, 3); got shape (6, 2)"),
        ({"v": Q[:, :2]}, "TrackTrajectory: v must have 3 columns (nv); got 2"),
        ({"kp": [1.0]}, "TrackTrajectory: kp must have shape (3,); got shape (1,)"),
        ({"kd": {"elbo": 1.0}}, 'TrackTrajectory: kd: no joint "elbo"; nearest: "elbow"'),
        (
            {"q": {"elbow": TIMES}, "kp": {"rod": 1.0}},
            'TrackTrajectory: kp must name joints among the driven joints; got "rod"',
        ),
        (
            {"q": {"elbow": TIMES}, "joints": ["rod"]},
            'TrackTrajectory: joints must name joints among the joints of q; got "rod"',
        ),
        (
            {"kp": [0.0, 0.0, 0.0], "kd": {}},
            "TrackTrajectory: at least one joint must be driven; got none with a gain",
        ),
    ],
)
def test_errors(arguments, message):
    with pytest.raises((pn.InputError, pn.UnknownNameError)) as error:
        pn.Scene(arm(), actuation=pn.TrackTrajectory(**{"times": TIMES, "q": Q, **GAINS, **arguments}))
    assert message in str(error.value)


def test_a_loop_must_be_determined_and_hold_positions():
    rod = pn.JointCoupling("elbow", "shoulder", ratio=2.0)
    free = pn.TrackTrajectory(TIMES, {"elbow": TIMES}, **GAINS, feedforward="constrained")
    with pytest.raises(pn.InputError, match='leave "rod" free beside the joints that q names'):
        pn.simulate(pn.Scene(arm(), constraints=[rod], actuation=free), 0.1, progress=False)
    edge = pn.UserConstraint(lambda t, q, v, data: (np.array([[1.0, 0.0, 0.0]]), [0.0]), 1, name="edge")
    with pytest.raises(pn.InputError, match='"edge" constrains velocities only'):
        pn.Scene(arm(), constraints=[edge], actuation=free)
