"""Random arguments: every public function accepts them, or raises an error that names the argument."""

from __future__ import annotations

import inspect
import io

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import strategies as st
from PIL import Image

import pin_nonideal as pn
from pin_nonideal.errors import PinNonidealError
from pin_nonideal.visualization import rendering

from .fuzzing import few_and_many, for_all, junk, result_or_named_error

DESCRIPTIONS = [
    pn.BoxContact, pn.CapsuleContact, pn.CylinderContact, pn.Distance, pn.Drag, pn.EffortLimits,
    pn.EllipsoidContact, pn.FrameAnchor, pn.GeometryContact, pn.HullContact,
    pn.HingeAnchor, pn.HoldPosition, pn.JointCoupling, pn.JointFriction, pn.JointLimit, pn.JointSpring,
    pn.KnifeEdge, pn.LuGre, pn.PointAnchor, pn.PointContact, pn.PrescribedMotion, pn.RevolvedContact,
    pn.RimContact, pn.Rolling,
    pn.SampledControl, pn.SigmoidFriction, pn.SphereContact, pn.SpringDamper, pn.Table,
    pn.TrackTrajectory,
    pn.UserConstraint, pn.UserContact, pn.UserForce, pn.UserFriction, pn.UserLaw, pn.Wrench,
    pn.box_contacts,
]  # fmt: skip
TIMES = [pn.constant, pn.polynomial, pn.sinusoid, pn.spline]
# Arguments of a scene for each description.
PLACES = {
    "constraints": ("Distance", "FrameAnchor", "HingeAnchor", "JointCoupling", "KnifeEdge", "PointAnchor",
                    "PrescribedMotion", "Rolling", "UserConstraint"),
    "laws": ("Drag", "JointFriction", "LuGre", "SigmoidFriction", "UserFriction", "UserLaw"),
    "contacts": ("GeometryContact", "JointLimit", "PointContact", "SphereContact",
                 "BoxContact", "CapsuleContact", "CylinderContact", "EllipsoidContact", "HullContact",
                 "RevolvedContact", "RimContact", "UserContact", "box_contacts"),
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


def shapes(model):
    """A ball at the coupler's tip and the ground."""
    frame = model.frames[model.getFrameId("coupler_tip")]
    ball = pin.GeometryObject("ball", frame.parentJoint, frame.placement, coal.Sphere(0.02))
    collision = pin.GeometryModel()
    collision.addGeometryObject(ball)
    collision.addGeometryObject(pn.ground(height=-1.0))
    return collision


GOOD = {
    "joint": ["crank_joint"], "joint1": ["crank_joint"], "joint2": ["rocker_joint"], "frame": ["coupler_tip"],
    "frame1": ["coupler_tip"], "frame2": ["rocker_tip"], "axes": ["xz"], "axis": ["y"],
    "actuation": [
        np.ones(3), pn.SampledControl(lambda *_: np.ones(3), 0.01),
        [{"crank_joint": 1.0}, pn.HoldPosition({"rocker_joint": 1.0}, {"rocker_joint": 0.1})],
    ],
    "effort": [0.1], "ratio": [2.0], "size": [1, 2], "value": [np.ones(6)],
    "function": [pn.constant(0.1), lambda *_: np.zeros(3), lambda *_: (np.zeros((1, 3)), [0.0])],
    "radius": [0.1], "coulomb": [0.1], "coefficient": [1.0], "exponent": [1.0], "stiffness": [10.0],
    "interpolation": ["hold"], "feedforward": ["none", "gravity", "rnea", "constrained"],
    "period": [0.01], "kp": [1.0], "kd": [0.1], "times": [[0.0, 1.0]], "values": [np.zeros((2, 3))],
    "direction": [lambda t, q: [1.0, 0.0, 0.0]], "limit": [lambda t, q, v, r: 0.1], "length": [0.5],
    "damping": [0.1], "phi1": [0.2], "phi2": [5.0],
    "radius1": [1e-3], "radius2": [1e-3],
    "segment1": [((0.0, 0.0, 0.0), (0.0, 0.0, 0.1))], "segment2": [((0.0, 0.0, 0.0), (0.1, 0.0, 0.1))],
    "geometry1": ["ball"], "geometry2": ["ground"], "mu": [0.3], "restitution": [0.5], "lower": [-50.0],
    "semiaxes": [(0.1, 0.1, 0.0)], "points": [np.vstack([np.zeros(3), 0.01 * np.eye(3)])], "below": [0.1],
    "delay": [0.015], "delay_samples": [2], "initial": [np.ones(3)],
    "rim": [0.01], "solid1": [(0.01, 0.01, 0.01)], "solid2": [(0.0, 0.02, 0.02)],
}  # fmt: skip
ROW = {"function": [lambda *_: (np.zeros((1, 3)), [0.0])], "size": [1]}
GAP = {
    "function": [lambda *_: ([[1.0, 0.0, 0.0]], [0.0])], "gap": [lambda t, q: q[0] + 50.0],
    "directions": [lambda t, q: [[0.0, 1.0, 0.0]]],
}  # fmt: skip
BOX = {"size": [[0.01, 0.02, 0.03]], "frame2": ["universe"]}
CAN = {"length": [0.01], "below": [0.01], "frame2": ["universe"], "xyz": [(0.0, 0.0, -9.0)]}
TRACK = {
    "q": [{"crank_joint": [1.0, 1.1]}, np.zeros((2, 3))], "v": [{"crank_joint": [0.0, 0.1]}, None],
    "joints": [["crank_joint"], None],
}  # fmt: skip
GOOD_TIMES = {
    "value": [0.1], "coefficients": [[1.0, 2.0]], "amplitude": [0.1], "omega": [2.0],
    "times": [[0.0, 1.0, 2.0]], "values": [[0.0, 1.0, 0.5]],
}  # fmt: skip


@few_and_many
@pytest.mark.parametrize("kind", DESCRIPTIONS, ids=lambda kind: kind.__name__)
def test_descriptions(kind, scene, examples):
    """A description is refused when it is made, or by the scene, or by the run."""
    own = {pn.UserConstraint: ROW, pn.UserContact: GAP, pn.box_contacts: BOX, pn.BoxContact: BOX}
    own[pn.CylinderContact] = CAN
    own[pn.TrackTrajectory] = TRACK
    good = GOOD | own.get(kind, {})

    def check(data):
        made = result_or_named_error(lambda: kind(**drawn(data, kind, good)))
        if made is None:
            return None
        place = next((key for key, names in PLACES.items() if kind.__name__ in names), "actuation")
        parts = {place: made if place == "actuation" or isinstance(made, list) else [made]}
        parts |= {"q0": scene.q0, "collision_model": shapes(scene.model)}
        whole = result_or_named_error(lambda: pn.Scene(scene.model, **parts))
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
    """Random values, except durations beyond a short run."""
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
    good = {
        "scene": [scene], "q": [np.array([q, q])], "v": [np.array([v, v])], "method": ["dop853", "dopri5"],
        "jobs": [1, 2, -1], "parameters": [{"crank_joint": {"mass": [1.0, 2.0]}}],
    }  # fmt: skip

    def check(data):
        arguments = drawn(data, pn.rollout, good)
        arguments["duration"] = data.draw(st.one_of(st.just(1e-3), without(junk)), label="duration")
        return result_or_named_error(lambda: pn.rollout(**arguments))

    for_all(check, st.data(), examples=examples)


@few_and_many
@pytest.mark.parametrize("method", ["solve", "acceleration", "project", "step"])
def test_one_instant(method, scene, examples):
    q, v = scene.initial_state()
    good = {"q": [q], "v": [v], "t": [0.0], "tau": [np.ones(3)], "modes": [[1, -1]], "dt": [1e-3]}
    good |= {"method": ["rk4"]} if method == "step" else {}
    function = getattr(scene, method)
    for_all(
        lambda data: result_or_named_error(lambda: function(**drawn(data, function, good))),
        st.data(),
        examples=examples,
    )


@few_and_many
def test_steppers(scene, examples):
    q, v = scene.initial_state()
    good = {
        "period": [1e-3],
        "q": [q],
        "v": [v],
        "tau": [np.ones(3)],
        "dt": [5e-4],
        "method": ["rk4", "dop853"],
    }

    def check(data):
        made = result_or_named_error(lambda: scene.stepper(**drawn(data, scene.stepper, good)))
        if made is None:
            return None
        result_or_named_error(lambda: made.reset(**drawn(data, made.reset, good)))
        tau = data.draw(st.one_of(st.just(np.ones(3)), junk), label="tau of the step")
        return result_or_named_error(lambda: made.step(tau))

    for_all(check, st.data(), examples=examples)


@pytest.mark.parametrize("solve", [pn.solve, pn.solve_details])
@few_and_many
def test_plain_arrays(solve, examples):
    good = {
        "M": [np.eye(3)],
        "F": [np.ones(3)],
        "A": [np.ones((1, 3))],
        "b": [np.zeros(1)],
        "C": [np.ones(3)],
    }
    for_all(
        lambda data: result_or_named_error(lambda: solve(**drawn(data, solve, good))),
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
    monkeypatch.chdir(tmp_path)  # a file with a random name is written here
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


STATICS = [pn.equilibrium, pn.inverse_dynamics, pn.rest]


@few_and_many
@pytest.mark.parametrize("function", STATICS, ids=lambda f: f.__name__)
def test_statics(function, scene, examples):
    q, v = scene.initial_state()
    good = {
        "scene": [scene], "q": [q, None, {"crank_joint": 1.0}], "v": [v], "a": [scene.acceleration(q, v)],
        "tau": [np.ones(3), {"crank_joint": 0.1}], "t": [0.0], "starts": [1],
        "actuated": [["crank_joint"]], "bounds": [(-10.0, 10.0)],
    }  # fmt: skip
    if function is pn.inverse_dynamics:
        good["q"] = [q]
    for_all(
        lambda data: result_or_named_error(lambda: function(**drawn(data, function, good))),
        st.data(),
        examples=examples,
    )


@few_and_many
def test_cones(examples):
    good = {
        "W": [np.eye(3), np.ones((3, 3))], "w0": [np.array([-1.0, 0.3, 0.0])], "mu": [0.5, [0.5]],
        "dims": [None, 3, [3]], "limits": [()], "start": [None, np.zeros(3)],
    }  # fmt: skip
    for_all(
        lambda data: result_or_named_error(
            lambda: pn.cone_complementarity(**drawn(data, pn.cone_complementarity, good))
        ),
        st.data(),
        examples=2 * examples,
    )


@few_and_many
@pytest.mark.parametrize("function", [pn.geometry_contacts, pn.ground_contacts], ids=lambda f: f.__name__)
def test_contacts_of_geometry(function, scene, examples):
    good = {
        "model": [scene.model], "collision_model": [shapes(scene.model)], "links": [["crank"], None],
        "ground": ["ground", pn.ground()], "adjacent": [True, False],
    }  # fmt: skip
    for_all(
        lambda data: result_or_named_error(lambda: function(**drawn(data, function, good))),
        st.data(),
        examples=examples,
    )


@few_and_many
@pytest.mark.parametrize("function", [pn.free_body, pn.ground], ids=lambda f: f.__name__)
def test_bodies_and_ground(function, examples):
    def check(data):
        good = {
            "model": [pin.Model()], "name": ["box"], "shape": [coal.Box(0.1, 0.2, 0.3), coal.Sphere(0.1)],
            "density": [1e3], "place": [pin.SE3.Identity(), (0.0, 0.0, 1.0)], "color": [(1.0, 0.5, 0.0)],
            "collision_model": [pin.GeometryModel()], "visual_model": [pin.GeometryModel()], "normal": ["z"],
        }  # fmt: skip
        return result_or_named_error(lambda: function(**drawn(data, function, good)))

    for_all(check, st.data(), examples=examples)


@few_and_many
@pytest.mark.parametrize("function", [pn.sweep_grid, pn.sweep_samples], ids=lambda f: f.__name__)
def test_parameters_of_sweeps(function, examples):
    good = {"n": [4], "seed": [0, 1]}
    ranges = st.one_of(st.just((0.0, 1.0)), st.just([1, 2, 3]), junk)

    def check(data):
        arguments = drawn(data, function, good) if function is pn.sweep_samples else {}
        named = data.draw(st.dictionaries(st.sampled_from(["mu", "mass"]), ranges, max_size=2))
        return result_or_named_error(lambda: function(**arguments, **named))

    for_all(check, st.data(), examples=2 * examples)


@few_and_many
def test_stores(scene, examples, tmp_path):
    kept = pn.sweep(pn.load, [{"name": "loaded_joint"}], 1e-3, jobs=1, store=tmp_path / "store")
    folders = st.one_of(st.sampled_from([kept.folder, str(kept.folder)]), junk)
    for_all(lambda folder: result_or_named_error(lambda: pn.Sweep(folder)), folders, examples=examples)


@few_and_many
def test_render(scene, examples, tmp_path, monkeypatch):
    """Arguments are checked before a browser starts; here the browser returns one fixed picture."""
    picture = io.BytesIO()
    Image.new("RGB", (2, 2)).save(picture, "PNG")

    async def pictures(page, size, times, kind):
        return [picture.getvalue()] * len(times)

    monkeypatch.setattr(rendering, "_pictures", pictures)
    monkeypatch.chdir(tmp_path)
    good = {"run": [pn.simulate(scene, 1e-3)], "path": [str(tmp_path / "still.png"), "a.gif"], "time": [5e-4]}
    for_all(
        lambda data: result_or_named_error(lambda: pn.render(**drawn(data, pn.render, good))),
        st.data(),
        examples=2 * examples,
    )


def test_the_public_names_are_all_drawn():
    """A new public function is fuzzed, or is one of these."""
    drawn_by_lot = {x.__name__ for x in (*DESCRIPTIONS, *TIMES, *STATICS)}
    drawn_by_lot |= {
        "simulate",
        "rollout",
        "solve",
        "solve_details",
        "Scene",
        "load",
        "resume",
        "replay",
        "plot",
        "sweep",
    }
    drawn_by_lot |= {
        "cone_complementarity",
        "free_body",
        "geometry_contacts",
        "ground",
        "ground_contacts",
        "sweep_grid",
        "sweep_samples",
        "Sweep",
        "render",
    }
    plain = {
        "ConeResiduals",
        "ConeSolution",
        "Equilibrium",
        "Event",
        "FrameRecord",
        "HoldingTorque",
        "InverseDynamics",
        "ContactPoints",
        "ContactRecord",
        "JointRecord",
    }
    plain |= {
        "RunArrays",
        "Stepper",
        "LawRecord",
        "ProjectionReport",
        "Rest",
        "Stats",
        "Trajectory",
        "Solution",
        "SolutionDetails",
        "robots",
    }
    told = {
        n
        for n in pn.__all__
        if isinstance(getattr(pn, n), type) and issubclass(getattr(pn, n), (PinNonidealError, Warning))
    }
    assert set(pn.__all__) == drawn_by_lot | plain | told
