"""Torques, gains, limits and bounds may be given by joint name wherever a vector of joints is taken."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import coal
import numpy as np
import pandas as pd
import pinocchio as pin
import pytest

import pin_nonideal as pn

TIMES = np.array([0.0, 0.1, 0.3])


def model():
    """A floating base that carries an elbow and a ball joint."""
    model = pin.Model()
    inertia = pin.Inertia(1.0, np.array([0.1, 0.0, -0.2]), 0.1 * np.eye(3))
    parent = 0
    for name, joint in (
        ("root", pin.JointModelFreeFlyer()),
        ("elbow", pin.JointModelRY()),
        ("ball", pin.JointModelSpherical()),
        ("slide", pin.JointModelPZ()),
    ):
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array([0.0, 0.1, -0.3])), name)
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return model


@pytest.fixture(scope="module")
def robot():
    return model()


BY_NAME = {"elbow": 1.5, "ball": [0.1, 0.2, 0.3], "base": {"linear": [0.0, 0.0, 4.0]}}
AS_ARRAY = np.array([0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 1.5, 0.1, 0.2, 0.3, 0.0])


def last(scene, **options):
    run = pn.simulate(scene, 0.3, progress=False, **options)
    return run.q[-1], run.v[-1]


def assert_same(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("named", "plain"),
    [
        (BY_NAME, AS_ARRAY),
        (lambda t, q, v: {"elbow": 2.0 * t}, lambda t, q, v: [*np.zeros(6), 2.0 * t, 0.0, 0.0, 0.0, 0.0]),
        (
            pn.SampledControl(lambda t, q, v: {"slide": 1.0 + t}, 0.01),
            pn.SampledControl(lambda t, q, v: [*np.zeros(10), 1.0 + t], 0.01),
        ),
        (
            pn.HoldPosition({"elbow": 20.0, "slide": 30.0}, {"elbow": 1.0}, q={"elbow": 0.4}),
            pn.HoldPosition(
                [*np.zeros(6), 20.0, 0.0, 0.0, 0.0, 30.0],
                [*np.zeros(6), 1.0, 0.0, 0.0, 0.0, 0.0],
                q=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.4, 0.0, 0.0, 0.0, 1.0, 0.0],
            ),
        ),
        (
            pn.Table(TIMES, {"elbow": [0.0, 1.0, 2.0], "ball": np.outer(TIMES, [1.0, 2.0, 3.0])}),
            pn.Table(
                TIMES,
                np.column_stack(
                    [np.zeros((3, 6)), [0.0, 1.0, 2.0], np.outer(TIMES, [1.0, 2.0, 3.0]), np.zeros(3)]
                ),
            ),
        ),
        (
            pn.EffortLimits(AS_ARRAY, {"elbow": 0.7, "ball": [0.05, 0.1, 1.0]}),
            np.array([0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.7, 0.05, 0.1, 0.3, 0.0]),
        ),
    ],
    ids=["constant", "function", "sampled", "hold", "table", "effort"],
)
def test_actuation(robot, named, plain):
    one, other = (pn.Scene(robot, actuation=actuation) for actuation in (named, plain))
    for a, b in zip(last(one), last(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12)


def test_torques_of_single_evaluations_and_steps(robot):
    scene = pn.Scene(robot)
    q, v = scene.initial_state()
    assert_same([scene.solve(q, v, tau=BY_NAME).a], [scene.solve(q, v, tau=AS_ARRAY).a])
    assert_same([scene.acceleration(q, v, BY_NAME)], [scene.acceleration(q, v, AS_ARRAY)])
    assert_same(scene.step(q, v, BY_NAME, 1e-3), scene.step(q, v, AS_ARRAY, 1e-3))
    one, other = scene.stepper(0.01, tau=BY_NAME), scene.stepper(0.01, tau=AS_ARRAY)
    assert_same(one.step(), other.step())
    assert_same(one.step({"slide": 1.0}), other.step([*np.zeros(10), 1.0]))


def test_bounds_of_inverse_dynamics():
    scene = pn.load("four_bar")
    q, _ = scene.initial_state()
    still = np.zeros(3)
    pair = {"crank_joint": -50.0}, {"crank_joint": 50.0}
    by_name = pn.inverse_dynamics(scene, q, still, still, actuated=["crank_joint"], bounds=pair)
    plain = pn.inverse_dynamics(scene, q, still, still, actuated=["crank_joint"], bounds=([-50.0], [50.0]))
    np.testing.assert_array_equal(by_name.tau, plain.tau)
    pairs = {"crank_joint": (-50.0, 50.0)}
    in_pairs = pn.inverse_dynamics(scene, q, still, still, actuated=["crank_joint"], bounds=pairs)
    np.testing.assert_array_equal(in_pairs.tau, plain.tau)
    for wrong, message in (({"crank_joint": 50.0}, "pair"), ({"crank": (-1.0, 1.0)}, "crank")):
        with pytest.raises((pn.InputError, pn.UnknownNameError), match=message):
            pn.inverse_dynamics(scene, q, still, still, bounds=wrong)


def test_a_series_and_a_frame_of_pandas_are_tables():
    scene = pn.load("loaded_joint")
    joint = str(scene.model.names[1])
    q, v = pd.Series({joint: 0.4}), pd.Series({joint: -0.2})
    np.testing.assert_array_equal(
        scene.solve(q, v, tau=pd.Series({joint: 0.3})).a, scene.solve([0.4], [-0.2], tau=[0.3]).a
    )
    table = pn.Table([0.0, 1.0], pd.DataFrame({joint: [0.0, 1.0]}))
    np.testing.assert_array_equal(table.values[joint], [0.0, 1.0])
    limits = pn.EffortLimits(
        pn.HoldPosition(q=q, kp=pd.Series({joint: 1.0}), kd=0.1), effort=pd.DataFrame({joint: [2.0]})
    )
    scene = scene.replace(actuation=limits, q0=q)
    assert scene.q0[0] == 0.4
    for state in (q, pd.DataFrame({joint: [0.4]}).iloc[0]):
        run = pn.simulate(scene, 0.1, state, v, progress=False)
        np.testing.assert_array_equal([run.q[0, 0], run.v[0, 0]], [0.4, -0.2])
    assert pn.inverse_dynamics(scene, q, v, v).tau == pn.inverse_dynamics(scene, [0.4], [-0.2], [-0.2]).tau


def test_friction_of_joints_in_a_table_of_pandas():
    scene = pn.load("four_bar")
    names = [str(name) for name in scene.model.names][1:3]
    coulomb = pn.JointFriction.for_joints(scene, pd.Series([0.1, 0.2], index=names))
    assert [(law.joint, law.coulomb) for law in coulomb] == [(names[0], 0.1), (names[1], 0.2)]
    table = pd.DataFrame({name: {"coulomb": 0.1, "viscous": 0.01 * k} for k, name in enumerate(names, 1)})
    laws = pn.JointFriction.for_joints(scene, table)
    assert [(law.joint, law.coulomb, law.viscous) for law in laws] == [
        (names[0], 0.1, 0.01),
        (names[1], 0.1, 0.02),
    ]


@pytest.mark.parametrize("form", ["frame", "columns", "list"])
def test_states_of_a_rollout_by_joint_name(form):
    scene = pn.load("loaded_joint")
    joint, angles = str(scene.model.names[1]), [0.1, 0.2, 0.3]
    q = {
        "frame": pd.DataFrame({joint: angles}),
        "columns": {joint: np.array(angles)},
        "list": [{joint: angle} for angle in angles],
    }[form]
    named = pn.rollout(scene, q, None, 0.05)
    plain = pn.rollout(scene, np.array(angles)[:, None], None, 0.05)
    for one, other in zip(named, plain, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
    with pytest.raises(pn.InputError, match="columns of one length; got"):
        pn.rollout(scene, {joint: 0.1}, None, 0.05)


def test_a_stepper_starts_again_by_joint_name():
    scene = pn.load("loaded_joint")
    joint = str(scene.model.names[1])
    stepper = scene.stepper(1e-3)
    stepper.reset({joint: 0.3}, {joint: -0.1})
    assert (stepper.q[0], stepper.v[0]) == (0.3, -0.1)
    with pytest.raises(pn.UnknownNameError, match="Stepper: q: no joint"):
        stepper.reset({joint + "x": 0.3}, [0.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda m: pn.Scene(m, actuation={"elbo": 1.0}), 'actuation: no joint "elbo"; nearest: "elbow"'),
        (
            lambda m: pn.Scene(m, actuation=pn.Table([0.0], {"slid": [1.0]})),
            'Table: values: no joint "slid"; nearest: "slide"',
        ),
        (
            lambda m: pn.Scene(m, actuation=pn.HoldPosition({"bal": 1.0}, 0.0)),
            'HoldPosition: kp: no joint "bal"; nearest: "ball"',
        ),
        (
            lambda m: pn.Scene(m, actuation={"ball": [1.0, 2.0]}),
            'actuation of "ball" must have shape (3,); got shape (2,)',
        ),
        (
            lambda m: pn.HoldPosition({"elbow": -1.0}, 0.0),
            'HoldPosition: kp of "elbow" must not be negative; got -1',
        ),
        (
            lambda m: pn.Table([0.0, 1.0], {"elbow": [1.0]}),
            'Table: values of "elbow" must have shape (2,); got shape (1,)',
        ),
    ],
)
def test_errors_name_the_nearest_joint(robot, make, message):
    with pytest.raises((pn.InputError, pn.UnknownNameError)) as error:
        make(robot)
    assert message in str(error.value)


@pytest.mark.parametrize(
    "actuation",
    [
        {"box": 1.0},
        lambda t, q, v: {"box": 1.0},
        pn.SampledControl(lambda t, q, v: {"box": 1.0}, 0.005),
        pn.HoldPosition({"box": 1.0}, {"box": 0.0}),
    ],
)
def test_one_number_has_no_unit_for_a_joint_that_slides_and_turns(actuation):
    model = pin.Model()
    pn.free_body(model, "box", coal.Box(0.1, 0.1, 0.1), mass=1.0)
    with pytest.raises(
        pn.PinNonidealError, match=r'of "box" must have 6 numbers.*slide and others turn; got 1'
    ):
        pn.simulate(pn.Scene(model, actuation=actuation), 0.01)
    assert pn.simulate(pn.Scene(model, actuation={"box": 0.0}), 0.01).q.shape[1] == 7


def test_namespace_is_no_table():
    with pytest.raises(pn.InputError, match="actuation"):
        pn.Scene(model(), actuation=SimpleNamespace(elbow=1.0))


def test_descriptions_show_torques_and_gains_by_name(robot):
    told = pn.Scene(robot, actuation=BY_NAME).describe().to_dict()["actuation"]
    assert told == {"kind": "constant torques", "made_with": BY_NAME}
    held = pn.Scene(robot, actuation=pn.HoldPosition({"elbow": 20.0}, 1.0)).describe()
    assert held.to_dict()["actuation"]["made_with"]["kp"] == {"elbow": 20.0}
    assert "elbow" in str(held)


# --- cost ---------------------------------------------------------------------------------------------------


def python_calls(function):
    """Names of the Python functions that a call runs."""
    names = []

    def note(frame, event, argument):
        if event == "call":
            names.append(frame.f_code.co_name)

    sys.setprofile(note)
    try:
        function()
    finally:
        sys.setprofile(None)
    return names[1:]  # without the function itself


def test_arrays_take_no_part_in_names():
    """Calls with arrays run the same few Python functions as before there were names."""
    scene = pn.load("four_bar")
    q, v = scene.initial_state()
    tau, stepper = np.zeros(3), scene.stepper(1e-3, q, v)
    calls = {
        "acceleration": lambda: scene.acceleration(q, v, tau),
        "step": lambda: scene.step(q, v, tau, 1e-3),
        "stepper": lambda: stepper.step(tau),
    }
    for name, call in calls.items():
        call()
        names = python_calls(call)
        assert len(names) <= 6, (name, names)
        assert not {"by_name", "named_joint_values", "configuration", "velocity"} & set(names)


def test_each_run_of_a_rollout_costs_no_python():
    scene = pn.load("four_bar")
    q, v = scene.initial_state()

    def run(count):
        pn.rollout(scene, [q] * count, [v] * count, 1e-3, method="rk4", dt=1e-3, as_arrays=True)

    run(1)
    assert len(python_calls(lambda: run(50))) <= len(python_calls(lambda: run(2))) + 10
