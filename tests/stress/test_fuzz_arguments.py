"""Arguments drawn by lot: every public function takes them, or refuses them by name."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from hypothesis import strategies as st

import pin_nonideal as pn
from pin_nonideal.errors import PinNonidealError

from .fuzzing import few_and_many, for_all, junk, result_or_named_error

DESCRIPTIONS = [
    pn.Distance, pn.Drag, pn.FrameAnchor, pn.HingeAnchor, pn.HoldPosition, pn.JointCoupling, pn.JointFriction,
    pn.JointSpring, pn.KnifeEdge, pn.LuGre, pn.PointAnchor, pn.PointContact, pn.PrescribedMotion, pn.Rolling,
    pn.SampledControl, pn.SigmoidFriction, pn.SpringDamper, pn.Table, pn.UserConstraint, pn.UserForce,
    pn.UserFriction, pn.UserLaw, pn.Wrench,
]  # fmt: skip
TIMES = [pn.constant, pn.polynomial, pn.sinusoid, pn.spline]
# Where a description belongs in a scene.
PLACES = {
    "constraints": ("Distance", "FrameAnchor", "HingeAnchor", "JointCoupling", "KnifeEdge", "PointAnchor",
                    "PrescribedMotion", "Rolling", "UserConstraint"),
    "laws": ("Drag", "JointFriction", "LuGre", "SigmoidFriction", "UserFriction", "UserLaw"),
    "contacts": ("PointContact",),
    "forces": ("JointSpring", "SpringDamper", "UserForce", "Wrench"),
}  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    return pn.load("four_bar")


def drawn(data, function, good):
    """Arguments of a function: good ones and defaults where there are some, but for a few that just come."""
    arguments = {}
    parameters = inspect.signature(function).parameters
    keys = [k for k, p in parameters.items() if p.kind is not p.VAR_KEYWORD and k != "self"]
    spoiled = data.draw(st.sets(st.sampled_from(keys), max_size=2), label="spoiled")
    for key in keys:
        choices = [st.sampled_from(good[key])] if key in good else []
        if parameters[key].default is not inspect.Parameter.empty:
            choices.append(st.just(parameters[key].default))
        take = junk if key in spoiled or not choices else st.one_of(*choices)
        arguments[key] = data.draw(take, label=key)
    return arguments


GOOD = {
    "joint": ["crank_joint"], "joint1": ["crank_joint"], "joint2": ["rocker_joint"], "frame": ["coupler_tip"],
    "frame1": ["coupler_tip"], "frame2": ["rocker_tip"], "axes": ["xz"], "axis": ["y"],
    "ratio": [2.0], "size": [1, 2], "value": [np.ones(6)],
    "function": [pn.constant(0.1), lambda *_: np.zeros(3), lambda *_: (np.zeros((1, 3)), [0.0])],
    "radius": [0.1], "coulomb": [0.1], "coefficient": [1.0], "exponent": [1.0], "stiffness": [10.0],
    "period": [0.01], "kp": [1.0], "kd": [0.1], "times": [[0.0, 1.0]], "values": [np.zeros((2, 3))],
    "direction": [lambda t, q: [1.0, 0.0, 0.0]], "limit": [lambda t, q, v, r: 0.1], "length": [0.5],
    "damping": [0.1], "phi1": [0.2], "phi2": [5.0],
}  # fmt: skip
ROW = {"function": [lambda *_: (np.zeros((1, 3)), [0.0])], "size": [1]}
GOOD_TIMES = {
    "value": [0.1], "coefficients": [[1.0, 2.0]], "amplitude": [0.1], "frequency": [2.0],
    "times": [[0.0, 1.0, 2.0]], "values": [[0.0, 1.0, 0.5]],
}  # fmt: skip


@few_and_many
@pytest.mark.parametrize("kind", DESCRIPTIONS, ids=lambda kind: kind.__name__)
def test_descriptions(kind, scene, examples):
    """A description is refused when it is made, or by the scene, or by the run."""
    good = GOOD | (ROW if kind is pn.UserConstraint else {})

    def check(data):
        made = result_or_named_error(lambda: kind(**drawn(data, kind, good)))
        if made is None:
            return None
        place = next((key for key, names in PLACES.items() if kind.__name__ in names), "actuation")
        parts = {place: made if place == "actuation" else [made]}
        q0 = scene.q0
        whole = result_or_named_error(lambda: pn.Scene(scene.model, q0=q0, **parts))
        if whole is not None:
            return result_or_named_error(lambda: pn.simulate(whole, 1e-4, method="rk4", dt=5e-5))
        return None

    for_all(check, st.data(), examples=max(4, examples // 4))


@few_and_many
@pytest.mark.parametrize("kind", TIMES, ids=lambda kind: kind.__name__)
def test_functions_of_time(kind, examples):
    def check(data):
        made = result_or_named_error(lambda: kind(**drawn(data, kind, GOOD_TIMES)))
        if made is not None:
            for t in (0.0, -1.0, 1e300):
                assert len(made(t)) == 3
        return made

    for_all(check, st.data(), examples=examples)


def without(values, *unwanted):
    """Values drawn by lot that are not a length of time beyond a short run."""
    return values.filter(
        lambda x: not (isinstance(x, (int, float)) and x > 1e-2) and not isinstance(x, unwanted)
    )


@few_and_many
def test_simulate(scene, examples, tmp_path):
    good = {
        "scene": [scene],
        "method": ["dop853", "dopri5", "rk4", "moreau", "semi_implicit_euler", "LSODA"],
        "dt": [1e-3, None],
        "output_dt": [1e-3],
        "record": ["a", ("forces", "energy"), "lam"],
        "checkpoint": [tmp_path / "run"],
        "progress": [False],
    }

    def check(data):
        arguments = drawn(data, pn.simulate, good)
        arguments["duration"] = data.draw(st.one_of(st.just(1e-3), without(junk)), label="duration")
        if arguments["checkpoint"] is not None:
            arguments["checkpoint"] = tmp_path / "run"  # not to any file that comes
        return result_or_named_error(lambda: pn.simulate(**arguments))

    for_all(check, st.data(), examples=2 * examples)


@few_and_many
def test_rollout(scene, examples):
    q, v = scene.initial_state()
    pair = (np.array([q, q]), np.array([v, v]))
    good = {"scene": [scene], "q": [pair], "method": ["dop853", "dopri5"], "threads": [1, 2]}

    def check(data):
        arguments = drawn(data, pn.rollout, good)
        arguments["duration"] = data.draw(st.one_of(st.just(1e-3), without(junk)), label="duration")
        return result_or_named_error(lambda: pn.rollout(**arguments))

    for_all(check, st.data(), examples=examples)


@few_and_many
@pytest.mark.parametrize("method", ["solve", "acceleration", "project"])
def test_one_instant(method, scene, examples):
    q, v = scene.initial_state()
    good = {"q": [q], "v": [v], "t": [0.0], "tau": [np.ones(3)], "modes": [[1, -1]]}
    function = getattr(scene, method)
    for_all(
        lambda data: result_or_named_error(lambda: function(**drawn(data, function, good))),
        st.data(),
        examples=examples,
    )


@few_and_many
def test_plain_arrays(examples):
    good = {
        "M": [np.eye(3)],
        "F": [np.ones(3)],
        "A": [np.ones((1, 3))],
        "b": [np.zeros(1)],
        "C": [np.ones(3)],
    }
    for_all(
        lambda data: result_or_named_error(lambda: pn.solve(**drawn(data, pn.solve, good))),
        st.data(),
        examples=examples,
    )


@few_and_many
def test_scene(scene, examples):
    good = {
        "model": [scene.model], "constraints": [scene.constraints], "laws": [scene.laws], "contacts": [[]],
        "forces": [[]], "actuation": [scene.actuation], "q0": [scene.q0], "v0": [scene.v0],
    }  # fmt: skip
    for_all(
        lambda data: result_or_named_error(lambda: pn.Scene(**drawn(data, pn.Scene, good))),
        st.data(),
        examples=examples,
    )


@few_and_many
def test_load(examples):
    names = st.one_of(st.sampled_from(["four_bar", "n_four_bar", "panda", "no such robot", ".", "/"]), junk)
    parameters = st.dictionaries(
        st.sampled_from(
            ["N", "m", "L", "g", "speed", "free_flyer", "package_dirs", "merge_ball_joints", "x"]
        ),
        junk.filter(lambda x: not (isinstance(x, (int, float)) and x > 10)),
        max_size=2,
    )

    def check(name, given):
        return result_or_named_error(lambda: pn.load(name, **given))

    for_all(check, names, parameters, examples=examples)


@few_and_many
@pytest.mark.parametrize("function", [pn.resume, pn.replay, pn.plot, pn.sweep], ids=lambda f: f.__name__)
def test_the_other_functions(function, scene, examples, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a file that comes of a name drawn by lot lands here
    run = pn.simulate(scene, 1e-3)
    good = {
        "scene": [scene],
        "run": [run],
        "path": [str(tmp_path / "file.html")],
        "duration": [1e-3],
        "make": [pn.load],
        "parameters": [[{"name": "loaded_joint"}]],
        "jobs": [1],
    }
    if function is pn.resume:
        pn.simulate(scene, 1e-3, checkpoint=tmp_path / "run")
        good["path"] = [str(tmp_path / "run")]
    for_all(
        lambda data: result_or_named_error(lambda: function(**drawn(data, function, good))),
        st.data(),
        examples=examples,
    )


def test_the_public_names_are_all_drawn():
    """A new public function is fuzzed, or is one of these."""
    drawn_by_lot = {x.__name__ for x in (*DESCRIPTIONS, *TIMES)}
    drawn_by_lot |= {"simulate", "rollout", "solve", "Scene", "load", "resume", "replay", "plot", "sweep"}
    plain = {"Event", "LawRecord", "Stats", "Trajectory", "Solution", "robots"}
    errors = {
        n
        for n in pn.__all__
        if isinstance(getattr(pn, n), type) and issubclass(getattr(pn, n), PinNonidealError)
    }
    assert set(pn.__all__) == drawn_by_lot | plain | errors
