"""What a user can pass wrong to a scene or a run: each gives a named error, in these words."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.contacts import PointContact
from pin_nonideal.errors import (
    InputError,
    SingularMassError,
    UnknownNameError,
)

from .random_trees import tree
from .small_robots import refuses

NAN, INF = float("nan"), float("inf")


def arm():
    model = tree(
        ["revolute x", "prismatic y", "spherical", "endless z", "free flyer"],
        np.random.default_rng(0),
        parents=[0, 1, 2, 3, 0],
    )
    model.name = "arm"
    return model


MODEL = arm()
Q, V = pin.neutral(MODEL), np.zeros(MODEL.nv)
FRAMES = '"universe", "j0 tip", "j1 tip", "j2 tip", "j3 tip", "j4 tip"'


def scaled(index, size, factor):
    q = Q.copy()
    q[index : index + size] *= factor
    return q


def with_entry(x, index, value):
    x = np.array(x, dtype=float)
    x[index] = value
    return x


# --- Scene -------------------------------------------------------------------------------------------------

UNKNOWN = {
    "frame": (
        {"constraints": [pn.PointAnchor("j0 tp", name="loop")]},
        'PointAnchor "loop": no frame "j0 tp" in model "arm"; nearest: "j0 tip"',
    ),
    "second frame": (
        {"constraints": [pn.PointAnchor("j0 tip", "moon", name="loop")]},
        f'PointAnchor "loop": no frame "moon" in model "arm"; known: {FRAMES}',
    ),
    "joint": (
        {"constraints": [pn.JointCoupling("j0", "j7", 1.0, name="gear")]},
        'JointCoupling "gear": no joint "j7" in model "arm"; nearest: "j4"',
    ),
    "moved joint": (
        {"constraints": [pn.PrescribedMotion("elbow", pn.constant(0.0), name="drive")]},
        'PrescribedMotion "drive": no joint "elbow" in model "arm"; known: "j0", "j1", "j2", "j3", "j4"',
    ),
    "knife": (
        {"constraints": [pn.KnifeEdge("j9 tip")]},
        'KnifeEdge(j9 tip): no frame "j9 tip" in model "arm"; nearest: "j4 tip"',
    ),
    "rubbing joint": (
        {"laws": [pn.JointFriction("j8", coulomb=1.0)]},
        'JointFriction(j8): no joint "j8" in model "arm"; nearest: "j4"',
    ),
    "rubbing anchor": (
        {
            "constraints": [pn.HingeAnchor("j0 tip", name="hinge")],
            "laws": [pn.JointFriction("hing", coulomb=1.0, name="rub")],
        },
        'JointFriction "rub": no joint or anchor "hing"; nearest: "hinge"',
    ),
    "drag": (
        {"laws": [pn.Drag("j9 tip", 1.0, name="air")]},
        'Drag "air": no frame "j9 tip" in model "arm"; nearest: "j4 tip"',
    ),
    "contact": (
        {"contacts": [PointContact("j9 tip", name="toe")]},
        'PointContact "toe": no frame "j9 tip" in model "arm"; nearest: "j4 tip"',
    ),
    "spring": (
        {"forces": [pn.SpringDamper("j0 tip", "hook", stiffness=1.0)]},
        f'SpringDamper: no frame "hook" in model "arm"; known: {FRAMES}',
    ),
    "joint spring": (
        {"forces": [pn.JointSpring("j9", 1.0)]},
        'JointSpring: no joint "j9" in model "arm"; nearest: "j4"',
    ),
    "wrench": (
        {"forces": [pn.Wrench("hook", [0.0] * 6, name="pull")]},
        f'Wrench "pull": no frame "hook" in model "arm"; known: {FRAMES}',
    ),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_unknown_names(case):
    keywords, message = UNKNOWN[case]
    with refuses(message, UnknownNameError):
        pn.Scene(MODEL, **keywords)


MISFITS = {
    "coupling of a ball joint": (
        {"constraints": [pn.JointCoupling("j0", "j2", 1.0)]},
        'JointCoupling(j0, j2): joint "j2" must have 1 degree of freedom; it has 3',
    ),
    "motion of a ball joint": (
        {"constraints": [pn.PrescribedMotion("j2", pn.constant(0.0))]},
        'PrescribedMotion(j2): joint "j2" must have 1 degree of freedom; it has 3',
    ),
    "friction of a floating base": (
        {"laws": [pn.JointFriction("j4", coulomb=1.0)]},
        'JointFriction(j4): joint "j4" must have 1 or 3 degrees of freedom; it has 6',
    ),
    "friction of a point anchor": (
        {
            "constraints": [pn.PointAnchor("j0 tip", name="ball")],
            "laws": [pn.JointFriction("ball", coulomb=1.0)],
        },
        'JointFriction(ball): "ball" is a PointAnchor, which has no axis to rub about; use a HingeAnchor',
    ),
    "constraint": (
        {"constraints": ["loop"]},
        "a constraint must be one of this package's or of Pinocchio's RigidConstraintModel, "
        "PointAnchorConstraintModel, FrameAnchorConstraintModel; got 'loop'",
    ),
    "constraints": (
        {"constraints": pn.JointCoupling("j0", "j1", 2.0)},
        "constraints must be a list; got JointCoupling(joint1='j0', joint2='j1', ratio=2.0, offset=0.0, "
        "name=None)",
    ),
    "contact": (
        {"contacts": [pn.KnifeEdge("j0 tip")]},
        "a contact must be a PointContact; got KnifeEdge(frame='j0 tip', axis=(0.0, 1.0, 0.0), name=None)",
    ),
    "force": ({"forces": [3]}, "a force must be SpringDamper, JointSpring, Wrench or UserForce; got 3"),
    "same names": (
        {"constraints": [pn.PointAnchor("j0 tip", name="a"), pn.PointAnchor("j1 tip", name="a")]},
        'names must be unique in a scene; "a" is used twice',
    ),
    "length zero": (
        {"constraints": [pn.Distance("j0 tip", "same", name="rod")]},
        'Distance "rod": the frames start at the same place; a distance must be positive',
    ),
    "actuation shape": ({"actuation": [1.0, 2.0]}, "actuation must have shape (12,); got shape (2,)"),
    "actuation nan": ({"actuation": with_entry(V, 3, NAN)}, "actuation must be finite; entry [3] is nan"),
    "actuation word": (
        {"actuation": "full"},
        "actuation must be an array of numbers of shape (12,); got 'full'",
    ),
    "table": (
        {"actuation": pn.Table([0.0, 1.0], [[1.0], [2.0]])},
        "Table: values must have 12 columns (nv); got 1",
    ),
    "gain": (
        {"actuation": pn.HoldPosition(np.ones(3), 1.0)},
        "HoldPosition: kp must have shape (12,); got shape (3,)",
    ),
    "gain of a ball joint": (
        {"actuation": pn.HoldPosition(np.ones(12), 1.0)},
        'HoldPosition: kp must be zero on joint "j2", whose configuration is no vector; '
        "drive it by a function",
    ),
    "held configuration": (
        {"actuation": pn.HoldPosition(1.0, 1.0, q=scaled(2, 4, 2.0))},
        'HoldPosition: q: the quaternion of joint "j2" must have length 1; got 2; normalize it',
    ),
    "q0 shape": ({"q0": [1.0]}, "q0 must have shape (15,); got shape (1,)"),
    "q0 nan": ({"q0": with_entry(Q, 0, NAN)}, "q0 must be finite; entry [0] is nan"),
    "v0 shape": ({"v0": [1.0]}, "v0 must have shape (12,); got shape (1,)"),
    "v0 inf": ({"v0": with_entry(V, 11, INF)}, "v0 must be finite; entry [11] is inf"),
    "picture": (
        {"visual_model": pin.Model()},
        "Scene: visual_model must be a pinocchio.GeometryModel; got Model",
    ),
    "name": ({"name": 3}, "Scene: name must be a name (a string); got 3"),
    "notes": ({"notes": 3}, "notes must be a list; got 3"),
    "licence": ({"licence": 3}, "Scene: licence must be a name (a string); got 3"),
}


@pytest.mark.parametrize("case", MISFITS)
def test_what_does_not_fit_the_model(case):
    keywords, message = MISFITS[case]
    model = MODEL.copy()
    model.addFrame(model.frames[model.getFrameId("j0 tip")])
    frame = model.frames[model.getFrameId("j0 tip")]
    model.addFrame(pin.Frame("same", frame.parentJoint, 0, frame.placement, pin.FrameType.OP_FRAME), False)
    with refuses(message, InputError):
        pn.Scene(model, **keywords)


def test_a_scene_needs_a_model():
    with refuses("Scene: model must be a pinocchio.Model; got str", InputError):
        pn.Scene("arm.urdf")


def spoil(**parts):
    """Two links of which something is wrong."""
    model = tree(["revolute x", "revolute y"], np.random.default_rng(1))
    if "inertia" in parts:
        model.inertias[2] = pin.Inertia(*parts["inertia"])
    if "gravity" in parts:
        model.gravity = pin.Motion(np.array([0.0, 0.0, parts["gravity"]]), np.zeros(3))
    if "armature" in parts:
        model.armature = np.array(parts["armature"])
    if "place" in parts:
        model.jointPlacements[1] = pin.SE3(np.eye(3), np.array([0.0, parts["place"], 0.0]))
    return model


BODIES = {
    "negative mass": (
        {"inertia": (-1.0, np.zeros(3), np.eye(3))},
        'Scene: the mass moved by joint "j1" must not be negative; got -1 kg',
    ),
    "mass": (
        {"inertia": (NAN, np.zeros(3), np.eye(3))},
        'Scene: the mass moved by joint "j1" must be finite; got nan',
    ),
    "center": (
        {"inertia": (1.0, np.array([0.0, INF, 0.0]), np.eye(3))},
        'Scene: the center of mass moved by joint "j1" must be finite; entry [1] is inf',
    ),
    "gravity": ({"gravity": NAN}, "Scene: the gravity of the model must be finite; entry [2] is nan"),
    "armature": (
        {"armature": [0.1, INF]},
        "Scene: the armature of the model must be finite; entry [1] is inf",
    ),
    "negative armature": (
        {"armature": [0.1, -2.0]},
        "Scene: the armature of the model must not be negative; got -2 kg m^2",
    ),
    "place": ({"place": NAN}, 'Scene: the place of joint "j0" must be finite; entry [1, 3] is nan'),
}


@pytest.mark.parametrize("case", BODIES)
def test_bodies_that_cannot_be(case):
    parts, message = BODIES[case]
    with refuses(message, InputError):
        pn.Scene(spoil(**parts))


@pytest.mark.parametrize("road", ["solve", "acceleration", "simulate"])
def test_a_body_without_mass(road):
    scene = pn.Scene(spoil(inertia=(0.0, np.zeros(3), np.zeros((3, 3)))))
    calls = {
        "solve": lambda: scene.solve(np.zeros(2), np.zeros(2)),
        "acceleration": lambda: scene.acceleration(np.zeros(2), np.zeros(2)),
        "simulate": lambda: pn.simulate(scene, 1.0),
    }
    message = (
        'the mass matrix must be positive definite; it is singular at joint "j1" (t = 0 s): '
        "give its body mass and inertia, or the joint an armature"
    )
    with refuses(message, SingularMassError):
        calls[road]()


# --- Unit lengths ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("q", "what"),
    [
        (scaled(2, 4, 1.1), 'the quaternion of joint "j2" must have length 1; got 1.1; normalize it'),
        (scaled(6, 2, 0.9), 'the (cos, sin) pair of joint "j3" must have length 1; got 0.9; normalize it'),
        (scaled(11, 4, 0.0), 'the quaternion of joint "j4" must have length 1; got 0; normalize it'),
    ],
)
def test_configurations_far_from_unit_length(q, what):
    scene = pn.Scene(MODEL)
    for call in (scene.solve, scene.acceleration, scene.project, lambda q, v: pn.simulate(scene, 0.1, q, v)):
        with refuses(f"q: {what}", InputError):
            call(q, V)
    with refuses(f"q0: {what}", InputError):
        pn.Scene(MODEL, q0=q)


def test_configurations_close_to_unit_length_are_normalized():
    scene = pn.Scene(MODEL)
    q = scaled(2, 4, 1.0 + 3e-7)
    np.testing.assert_allclose(scene.acceleration(q, V), scene.acceleration(Q, V), rtol=1e-12)
    assert np.linalg.norm(pn.simulate(scene, 0.01, q, V).q[0, 2:6]) == pytest.approx(1.0, abs=2e-16)


# --- One instant -------------------------------------------------------------------------------------------

STATES = {
    "q shape": ({"q": Q[:3]}, "q must have shape (15,); got shape (3,)"),
    "q matrix": ({"q": Q[None]}, "q must have shape (15,); got shape (1, 15)"),
    "q word": ({"q": "home"}, "q must be an array of numbers of shape (15,); got 'home'"),
    "q nan": ({"q": with_entry(Q, 0, NAN)}, "q must be finite; entry [0] is nan"),
    "v shape": ({"v": V[:3]}, "v must have shape (12,); got shape (3,)"),
    "v inf": ({"v": with_entry(V, 5, -INF)}, "v must be finite; entry [5] is -inf"),
    "t nan": ({"t": NAN}, "t must be finite; got nan"),
    "t word": ({"t": "now"}, "t must be a number; got 'now'"),
    "tau shape": ({"tau": [1.0]}, "tau must have shape (12,); got shape (1,)"),
    "tau nan": ({"tau": with_entry(V, 1, NAN)}, "tau must be finite; entry [1] is nan"),
}


@pytest.mark.parametrize("case", STATES)
@pytest.mark.parametrize("road", ["solve", "acceleration", "project"])
def test_states_that_do_not_fit(road, case):
    given, message = STATES[case]
    if road == "project" and "tau" in given:
        return
    with refuses(message, InputError):
        getattr(pn.Scene(MODEL), road)(**{"q": Q, "v": V, **given})


def test_lists_and_integers_are_fine():
    scene = pn.Scene(MODEL)
    expected = scene.acceleration(Q, V)
    np.testing.assert_array_equal(scene.acceleration(Q.tolist(), V.astype(int)), expected)
    np.testing.assert_allclose(scene.solve(Q.tolist(), V.astype(int)).a, expected, rtol=1e-13)


@pytest.mark.parametrize("modes", [[], [2], ["slip"], [1, 1], 1])
def test_modes_that_are_none(modes):
    scene = pn.Scene(MODEL, laws=[pn.JointFriction("j0", coulomb=1.0)])
    with refuses(f"modes must hold 1 numbers out of -1, 0, 1; got {modes}", InputError):
        scene.solve(Q, V, modes=modes)


# --- Runs --------------------------------------------------------------------------------------------------

METHODS = "'dop853', 'dopri5', 'rk4', 'semi_implicit_euler', 'moreau', 'Radau', 'BDF', 'LSODA'"
RUNS = {
    "duration zero": ({"duration": 0}, "simulate: duration must be positive; got 0"),
    "duration negative": ({"duration": -1.0}, "simulate: duration must be positive; got -1"),
    "duration nan": ({"duration": NAN}, "simulate: duration must be finite; got nan"),
    "duration inf": ({"duration": INF}, "simulate: duration must be finite; got inf"),
    "duration word": ({"duration": "long"}, "simulate: duration must be a number; got 'long'"),
    "t0": ({"t0": NAN}, "simulate: t0 must be finite; got nan"),
    "method": (
        {"method": "dop583"},
        f"simulate: method must be one of {METHODS}; got 'dop583'; nearest: \"dop853\"",
    ),
    "method far": ({"method": "verlet"}, f"simulate: method must be one of {METHODS}; got 'verlet'"),
    "method number": ({"method": 4}, f"simulate: method must be one of {METHODS}; got 4"),
    "rtol": ({"rtol": -1e-6}, "simulate: rtol must not be negative; got -1e-06"),
    "rtol nan": ({"rtol": NAN}, "simulate: rtol must be finite; got nan"),
    "atol": ({"atol": -1.0}, "simulate: atol must not be negative; got -1"),
    "atol shape": ({"atol": [1e-9]}, "simulate: atol must have shape (24,); got shape (1,)"),
    "atol entries": ({"atol": np.full(24, -2.0)}, "simulate: atol must not be negative; got -2"),
    "both zero": (
        {"rtol": 0, "atol": 0},
        "simulate: rtol and atol must not both be zero; set one of them",
    ),
    "dt": (
        {"dt": 0.1},
        'simulate: method "dop853" chooses its own steps; leave dt out, or set output_dt',
    ),
    "no dt": ({"method": "rk4"}, 'simulate: method "rk4" needs a step dt'),
    "dt zero": ({"method": "rk4", "dt": 0.0}, "simulate: dt must be positive; got 0"),
    "dt negative": ({"method": "moreau", "dt": -0.1}, "simulate: dt must be positive; got -0.1"),
    "dt nan": ({"method": "rk4", "dt": NAN}, "simulate: dt must be finite; got nan"),
    "fixed with rtol": (
        {"method": "rk4", "dt": 0.1, "rtol": 1e-6, "atol": 1e-6},
        'simulate: method "rk4" takes steps of the length dt; leave rtol and atol out',
    ),
    "output_dt": ({"output_dt": 0.0}, "simulate: output_dt must be positive; got 0"),
    "duration without steps": (
        {"duration": 1.0, "t0": 1e15},
        "simulate: duration must be at least 100 times the spacing of floating-point times, which is 0.12 s "
        "at t = 1e+15 s; got 1 s",
    ),
    "dt without end": (
        {"method": "rk4", "dt": 1e-300},
        "simulate: dt must be at least 100 times the spacing of floating-point times, which is 2.2e-16 s at "
        "t = 1 s; got 1e-300 s",
    ),
    "output_dt without end": (
        {"output_dt": 1e-300},
        "simulate: output_dt must be at least 100 times the spacing of floating-point times",
    ),
    "too many samples": (
        {"output_dt": 1e-9},
        "simulate: output_dt must leave at most 1e+08 samples; 1e-09 s leaves 1e+09; set a longer output_dt",
    ),
    "too many steps kept": (
        {"method": "rk4", "dt": 1e-9},
        "simulate: dt must leave at most 1e+08 samples; 1e-09 s leaves 1e+09; set a longer output_dt",
    ),
    "record": (
        {"record": "energi"},
        "simulate: record must be one of 'a', 'forces', 'energy', 'power'; got 'energi'; nearest: \"energy\"",
    ),
    "record list": ({"record": 3}, "simulate: record must be a list; got 3"),
    "progress": ({"progress": "bar"}, "simulate: progress must be one of True, False, None; got 'bar'"),
    "q": ({"q": [0.0]}, "q must have shape (15,); got shape (1,)"),
    "v": ({"v": with_entry(V, 0, NAN)}, "v must be finite; entry [0] is nan"),
}


@pytest.mark.parametrize("case", RUNS)
def test_runs_that_cannot_start(case):
    given, message = RUNS[case]
    with refuses(message, InputError):
        pn.simulate(pn.Scene(MODEL), **{"duration": 1.0, **given})


def test_a_period_without_end():
    control = pn.SampledControl(lambda t, q, v: np.zeros(MODEL.nv), 1e-300)
    with refuses("SampledControl: period must be at least 100 times the spacing", InputError):
        pn.simulate(pn.Scene(MODEL, actuation=control), 1.0)


def test_a_run_needs_a_scene():
    with refuses("simulate: scene must be a Scene; got Model", InputError):
        pn.simulate(MODEL, 1.0)
    with refuses("rollout: scene must be a Scene; got Model", InputError):
        pn.rollout(MODEL, (Q[None], V[None]), 1.0)


ROLLOUTS = {
    "no velocities": ({"v": None}, "rollout needs q, v and a duration: rollout(scene, q, v, duration)"),
    "no duration": ({"duration": None}, "rollout needs q, v and a duration: rollout(scene, q, v, duration)"),
    "one state": ({"q": Q, "v": V}, "rollout: q must have shape (n, 15); got shape (15,)"),
    "rows": (
        {"q": np.tile(Q, (2, 1))},
        "rollout: q and v must have as many rows; got 2 and 1",
    ),
    "threads": ({"threads": 0}, "rollout: threads must be at least 1; got 0"),
    "threads float": ({"threads": 1.5}, "rollout: threads must be an integer; got 1.5"),
    "method": ({"method": "Radau"}, 'rollout: method must be one of the core\'s; "Radau" runs in SciPy'),
    "length": (
        {"q": 0.5 * Q[None]},
        'q: the quaternion of joint "j2" must have length 1; got 0.5; normalize it',
    ),
}


@pytest.mark.parametrize("case", ROLLOUTS)
def test_rollouts_that_cannot_start(case):
    given, message = ROLLOUTS[case]
    with refuses(message, InputError):
        pn.rollout(pn.Scene(MODEL), **{"q": Q[None], "v": V[None], "duration": 0.1, **given})
