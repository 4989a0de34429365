"""Rollouts with parameters for each run, compared with separate scenes, and the failures of single runs."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import GRAVITY, body, empty, frame
from ..support.refusals import refuses
from ..support.same_run import assert_same_run

N = 3
LAWS = {
    "rub": pn.JointFriction("a", coulomb=0.1, mu=0.2, radius=0.05, viscous=0.02, name="rub"),
    "curve": pn.SigmoidFriction("b", 0.2, 5.0, 0.1, name="curve"),
    "bristle": pn.LuGre("c", stiffness=1e3, damping=2.0, coulomb=0.1, stribeck_velocity=0.1, name="bristle"),
    "air": pn.Drag("tip", 0.3, 2.0, name="air"),
}
FORCES = {
    "rod": pn.SpringDamper("tip", None, stiffness=20.0, damping=0.5, rest_length=0.1, name="rod"),
    "coil": pn.JointSpring("b", 3.0, rest=0.2, damping=0.1, name="coil"),
    "push": pn.Wrench("tip", [1.0, 0.0, 2.0, 0.0, 0.1, 0.0], name="push"),
}
HOLD = pn.HoldPosition(kp=5.0, kd=0.5)


def chain():
    """Three links about crossed axes, with a frame at the end."""
    model = empty((0.0, 0.0, -GRAVITY))
    joint = 0
    for name, kind in (("a", pin.JointModelRY()), ("b", pin.JointModelRX()), ("c", pin.JointModelRY())):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3 if joint else 0.0]))
        joint = model.addJoint(joint, kind, place, name)
        inertia = pin.Inertia(1.0, np.array([0.0, 0.01, -0.15]), np.diag([0.02, 0.03, 0.01]))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    frame(model, "tip", joint, pin.SE3(np.eye(3), np.array([0.05, 0.0, -0.3])))
    return model


def scene_of(model=None, laws=LAWS, forces=FORCES, actuation=HOLD):
    return pn.Scene(
        model or chain(), laws=list(laws.values()), forces=list(forces.values()), actuation=actuation,
        q0=[0.4, 0.3, -0.2], v0=[1.0, 0.0, -0.5],
    )  # fmt: skip


def with_fields(parts, name, given, k):
    return parts | {name: replace(parts[name], **{key: values[k] for key, values in given.items()})}


FIELDS = {
    "rub": {"mu": [0.1, 0.2, 0.5], "coulomb": [0.1, 0.3, 0.1], "viscous": [0.02, 0.1, 0.3]},
    "curve": {"phi1": [0.1, 0.2, 0.4], "phi2": [5.0, 1.0, 9.0], "phi3": [0.1, 0.0, -0.1]},
    "bristle": {"stiffness": [1e3, 2e3, 500.0], "coulomb": [0.1, 0.2, 0.3], "stiction": [0.3] * 3},
    "air": {"coefficient": [0.3, 1.0, 3.0], "exponent": [2.0, 1.5, 1.0]},
    "rod": {"stiffness": [20.0, 10.0, 0.0], "damping": [0.5, 0.0, 0.1], "rest_length": [0.1, 0.2, 0.3]},
    "coil": {"stiffness": [1.0, 2.0, 3.0], "rest": [0.0, 0.1, 0.2]},
    "push": {"value": np.arange(18.0).reshape(3, 6)},
}


@pytest.mark.parametrize("name", FIELDS)
def test_fields_of_laws_and_forces(name):
    runs = pn.rollout(scene_of(), None, None, 0.1, parameters={name: FIELDS[name]}, jobs=2, record="energy")
    for k, run in enumerate(runs):
        laws = with_fields(LAWS, name, FIELDS[name], k) if name in LAWS else LAWS
        forces = with_fields(FORCES, name, FIELDS[name], k) if name in FORCES else FORCES
        alone = pn.simulate(scene_of(laws=laws, forces=forces), 0.1, record="energy")
        assert_same_run(run, alone)
    assert len({run.q[-1].tobytes() for run in runs}) == N


def test_gains_torques_and_gravity():
    gains = {"kp": [[1.0] * 3, [2.0] * 3, [3.0] * 3], "kd": [0.1, 0.2, 0.3]}
    for k, run in enumerate(pn.rollout(scene_of(), None, None, 0.1, parameters={"actuation": gains})):
        hold = pn.HoldPosition(kp=gains["kp"][k], kd=gains["kd"][k])
        assert_same_run(run, pn.simulate(scene_of(actuation=hold), 0.1))
    torques = np.arange(9.0).reshape(3, 3)
    pulled = scene_of(actuation=torques[1])
    for tau, run in zip(
        torques, pn.rollout(pulled, None, None, 0.1, parameters={"actuation": torques}), strict=True
    ):
        assert_same_run(run, pn.simulate(scene_of(actuation=tau), 0.1))
    gravity = np.array([[0.0, 0.0, -GRAVITY], [0.0, 0.0, -1.6], [1.0, 0.0, 0.0]])
    for g, run in zip(
        gravity, pn.rollout(scene_of(), None, None, 0.1, parameters={"gravity": gravity}), strict=True
    ):
        model = chain()
        model.gravity.linear = g
        assert_same_run(run, pn.simulate(scene_of(model), 0.1))


@pytest.mark.parametrize("key", ["mass", "inertia"])
def test_masses(key):
    own = chain().inertias[2]
    masses = [0.5, 1.0, 4.0]
    bodies = [pin.Inertia(m, own.lever, own.inertia * (m / own.mass)) for m in masses]
    if key == "inertia":
        bodies = [pin.Inertia(m, m * own.lever, own.inertia) for m in masses]
        given = np.array([one.toDynamicParameters() for one in bodies])
        bodies = [pin.Inertia.FromDynamicParameters(one) for one in given]
    parameters = {"b": {key: masses if key == "mass" else given}}
    runs = pn.rollout(scene_of(), None, None, 0.1, parameters=parameters, record="energy")
    for one, run in zip(bodies, runs, strict=True):
        model = chain()
        model.inertias[2] = one
        assert_same_run(run, pn.simulate(scene_of(model), 0.1, record="energy"))


def ball(mu=0.3, restitution=0.5, torsional=0.01):
    model = empty((0.0, 0.0, -GRAVITY))
    body(model, 0, pin.JointModelFreeFlyer(), "ball", 1.0, inertia=0.004 * np.eye(3))
    frame(model, "middle", 1, pin.SE3.Identity())
    touch = pn.PointContact(
        "middle", mu=mu, radius=0.1, restitution=restitution, torsional=torsional, name="floor"
    )
    return pn.Scene(model, contacts=[touch], q0=[0, 0, 0.2, 0, 0, 0, 1], v0=[1.0, 0, 0, 0, 0, 3.0])


def test_friction_and_restitution_of_contacts():
    given = {"mu": [0.1, 0.3, 0.9], "restitution": [0.0, 0.5, 0.9], "torsional": [0.01, 0.02, 0.05]}
    runs = pn.rollout(ball(), None, None, 0.5, parameters={"floor": given}, jobs=2)
    for k, run in enumerate(runs):
        assert_same_run(run, pn.simulate(ball(*(given[key][k] for key in given)), 0.5))


def test_starts_off_the_constraints_are_put_on_them_with_the_masses_of_their_run():
    scene = pn.load("four_bar")
    v = scene.v0 + np.array([0.3, -0.2, 0.1])
    masses = [0.5, 5.0]
    name = scene.model.names[2]
    runs = pn.rollout(scene, None, [v, v], 0.05, parameters={name: {"mass": masses}})
    for mass, run in zip(masses, runs, strict=True):
        model = scene.model.copy()
        own = model.inertias[2]
        model.inertias[2] = pin.Inertia(mass, own.lever, own.inertia * (mass / own.mass))
        other = pn.Scene(
            model, constraints=scene.constraints, laws=scene.laws, actuation=scene.actuation, q0=scene.q0
        )
        assert_same_run(run, pn.simulate(other, 0.05, q=scene.initial_state()[0], v=v))
    assert np.abs(runs[0].v[0] - runs[1].v[0]).max() > 1e-3


def fast(t, q, v):
    if v[0] > 5.0:
        raise ValueError("too fast")
    return 0.0 * v


def test_a_failure_leaves_the_other_runs():
    scene = scene_of(actuation=fast)
    v = np.array([[0.0] * 3, [9.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    kept = pn.rollout(scene, None, v, 0.05, failures="keep", jobs=2)
    assert isinstance(kept[1], pn.UserFunctionError)
    assert kept[1].index == 1
    for k in (0, 2):
        assert_same_run(kept[k], pn.simulate(scene, 0.05, v=v[k]))
    with pytest.raises(pn.UserFunctionError, match="too fast") as caught:
        pn.rollout(scene, None, v, 0.05)
    assert_same_run(caught.value.results[2], kept[2])
    assert caught.value.results[1] is caught.value


def test_a_start_that_cannot_be_closed_is_a_failure_of_its_run():
    scene = pn.load("four_bar")
    model = scene.model.copy()
    far = pn.Distance("coupler_tip", None, length=50.0)
    scene = pn.Scene(model, constraints=[far], q0=scene.q0)
    kept = pn.rollout(scene, np.tile(scene.q0, (2, 1)), np.zeros((2, 3)), 0.1, failures="keep")
    assert [type(each) for each in kept] == [pn.LoopClosureError] * 2
    assert [each.index for each in kept] == [0, 1]


def test_arrays_keep_starts_that_cannot_be_closed_apart():
    """A ball deep below the floor cannot be put on it; the other balls fall as they do alone."""
    scene = ball()
    q, v = scene.initial_state()
    starts = np.tile(q, (3, 1))
    starts[1, 2] = -50.0
    speeds = np.tile(v, (3, 1))
    lists = pn.rollout(scene, starts, speeds, 0.2, failures="keep")
    runs = pn.rollout(scene, starts, speeds, 0.2, failures="keep", as_arrays=True)
    assert list(runs.failures) == [1]
    assert str(runs.failures[1]) == str(lists[1])
    assert runs.samples.tolist() == [len(lists[0]), 0, len(lists[2])]
    for k in (0, 2):
        np.testing.assert_array_equal(runs.q[k, : runs.samples[k]], lists[k].q)
    assert np.isnan(runs.last[0][1]).all()
    assert np.isnan(runs.violation[1])
    with pytest.raises(type(lists[1]), match=re.escape(str(lists[1]))):
        pn.rollout(scene, starts, speeds, 0.2, as_arrays=True)


REFUSED = {
    "nobody": ({"rab": {"mu": [0.1] * N}}, 'no law, contact, force or joint "rab"; nearest: "rub"'),
    "no field": ({"rub": {"nu": [0.1] * N}}, '"rub": no field "nu"; nearest: "mu"'),
    "one number": ({"rub": {"mu": 0.1}}, '"rub": mu must be 3 values, one per run; got 0.1'),
    "too few": ({"rub": {"mu": [0.1]}}, '"rub": mu must be 3 values, one per run; got [0.1]'),
    "negative": (
        {"rub": {"mu": [0.1, -1.0, 0.1]}},
        'run 1: JointFriction "rub": mu must not be negative; got -1',
    ),
    "negative mass": ({"b": {"mass": [1.0, 1.0, -1.0]}}, "run 2 has a mass of -1 kg"),
    "no inertia": (
        {"b": {"inertia": [[1.0, *[0.0] * 3, 1, 0, 1, 0, 0, 1], [1.0, *[0.0] * 3, 1, 0, 1, 0, 0, -1]] * 2}},
        "inertia must have shape (3, 10); got shape (4, 10)",
    ),
    "negative inertia": (
        {"b": {"inertia": [[1.0, *[0.0] * 3, 1, 0, 1, 0, 0, z] for z in (1, -1, 1)]}},
        "run 1 has a mass of 1 kg and a least moment of -1 kg m^2",
    ),
    "ceases": (
        {"rub": {"viscous": [0.0, 0.1, 0.1]}},
        "changes more than numbers: parts of the scene would begin or cease to act; keep zeros zero",
    ),
    "elsewhere": ({"air": {"frame": ["tip", "a", "tip"]}}, "changes more than numbers"),
    "values": ({"rub": [0.1] * N}, '"rub" must be values by field of a description; got [0.1, 0.1, 0.1]'),
    "mass": ({"b": {"mass": [1.0, 0.0, 1.0]}}, '"b": masses and moments of inertia about'),
    "both": ({"b": {"mass": [1.0] * N, "inertia": np.ones((N, 10))}}, 'give "mass" or "inertia", not both'),
    "gravity": ({"gravity": [0.0] * N}, "rollout: gravity must have shape (3, 3); got shape (3,)"),
    "list": ([0.1], "rollout: parameters must be values by name; got [0.1]"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_parameter(case):
    given, message = REFUSED[case]
    with refuses(message, (pn.InputError, pn.UnknownNameError)):
        pn.rollout(scene_of(), np.tile([0.4, 0.3, -0.2], (N, 1)), None, 0.1, parameters=given)


def test_what_shapes_the_scene_is_no_parameter():
    touch = {"floor": {"radius": [0.1, 0.2]}}
    with refuses(
        '"floor": radius changes the structure of the scene and cannot differ between runs', pn.InputError
    ):
        pn.rollout(ball(), None, None, 0.1, parameters=touch)
    with refuses('record "dense" is not supported with parameters', pn.InputError):
        pn.rollout(scene_of(), None, None, 0.1, parameters={"rub": {"mu": [0.1]}}, record="dense")
    pinocchio = pn.Scene(chain(), terms="pinocchio")
    with refuses('"b": masses can differ between runs with terms="core" only', pn.InputError):
        pn.rollout(pinocchio, None, None, 0.1, parameters={"b": {"mass": [1.0]}})


def rail(**parts):
    """A body on a rail, with a frame at its center."""
    model = empty()
    body(model, 0, pin.JointModelPX(), "slide", 1.0, inertia=0.01 * np.eye(3))
    frame(model, "middle", 1, pin.SE3.Identity())
    return pn.Scene(model, **parts)


def constant(value, *_):
    return np.full(1, value)


def limit(value, *_):
    return value


def along(t, q):
    return np.ones(1)


def push(value, t):
    return [value, 0.0, 0.0, 0.0, 0.0, 0.0]


def ramp(rate, t):
    return rate * t, rate, 0.0


def held_row(value, t, q, v, data):
    return np.ones((1, 1)), np.full(1, value)


def functions(make):
    return [partial(make, value) for value in (1.0, 2.0, 3.0)]


REPLACED = {
    "force": ({"forces": [pn.UserForce(functions(constant)[0], name="it")]}, "it", "function", constant),
    "wrench": ({"forces": [pn.Wrench("middle", functions(push)[0], name="it")]}, "it", "value", push),
    "law": ({"laws": [pn.UserLaw(functions(constant)[0], name="it")]}, "it", "function", constant),
    "friction": ({"laws": [pn.UserFriction(along, functions(limit)[0], name="it")]}, "it", "limit", limit),
    "motion": (
        {"constraints": [pn.PrescribedMotion("slide", functions(ramp)[0], name="it")]},
        "it",
        "function",
        ramp,
    ),
    "constraint": (
        {"constraints": [pn.UserConstraint(functions(held_row)[0], 1, name="it")]},
        "it",
        "function",
        held_row,
    ),
    "control": (
        {"actuation": pn.SampledControl(functions(constant)[0], 0.01)},
        "actuation",
        "function",
        constant,
    ),
}


@pytest.mark.parametrize("case", REPLACED)
def test_functions_are_no_parameters(case):
    parts, name, field, make = REPLACED[case]
    scene = rail(**parts)
    with refuses(
        f'rollout: parameters: "{name}": {field} holds a function, which cannot differ between runs; sweep '
        "makes a scene for each",
        pn.InputError,
    ):
        pn.rollout(scene, None, None, 0.1, parameters={name: {field: functions(make)}})


def test_functions_inside_of_a_parameter_are_no_parameters():
    """A control within effort limits; the scene's own function may be repeated."""
    controls = [pn.SampledControl(function, 0.01) for function in functions(constant)]
    driven = rail(actuation=pn.EffortLimits(controls[0], 0.5))
    with refuses("actuation holds a function, which cannot differ between runs", pn.InputError):
        pn.rollout(driven, None, None, 0.1, parameters={"actuation": {"actuation": controls[1:2]}})
    own = functions(constant)[0]
    pushed = rail(forces=[pn.UserForce(own, name="it")])
    (run,) = pn.rollout(pushed, None, None, 0.1, parameters={"it": {"function": [own]}})
    assert run.q[-1] == pytest.approx([0.005], rel=1e-12)
