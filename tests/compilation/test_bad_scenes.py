"""Invalid scenes raise named errors with exact messages."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description.contacts import PointContact
from pin_nonideal.errors import InputError, SingularMassError, UnknownNameError

from ..support.every_joint import INF, MODEL, NAN, Q, V, scaled, with_entry
from ..support.random_trees import tree
from ..support.refusals import refuses

FRAMES = '"universe", "j0 tip", "j1 tip", "j2 tip", "j3 tip", "j4 tip"'
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
        "a contact must be one of PointContact, JointLimit, SphereContact, CapsuleContact, BoxContact, "
        "EllipsoidContact, HullContact, CylinderContact, RimContact, RevolvedContact, "
        "UserContact; "
        "got KnifeEdge(frame='j0 tip', axis=(0.0, 1.0, 0.0), name=None)",
    ),
    "contact within one body": (
        {"contacts": [PointContact("j0 tip", plane="same", name="toe")]},
        'PointContact "toe": frame and plane are on the same body, which cannot touch itself',
    ),
    "spheres on one body": (
        {"contacts": [pn.SphereContact("j0 tip", "same", 0.1, name="toe")]},
        'SphereContact "toe": frame1 and frame2 are on the same body, which cannot touch itself',
    ),
    "stop beyond that of the model": (
        {"contacts": [pn.JointLimit("j0", lower=1.0, name="stop")]},
        'JointLimit "stop": lower must be below upper; got 1 and 0.5',
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
        'HoldPosition: kp must be zero on joint "j2", whose configuration is not a vector; '
        "drive it by a function or by a TrackTrajectory",
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
    model.upperPositionLimit[0] = 0.5
    model.addFrame(model.frames[model.getFrameId("j0 tip")])
    frame = model.frames[model.getFrameId("j0 tip")]
    model.addFrame(pin.Frame("same", frame.parentJoint, 0, frame.placement, pin.FrameType.OP_FRAME), False)
    with refuses(message, InputError):
        pn.Scene(model, **keywords)


def test_a_scene_needs_a_model():
    with refuses("Scene: model must be a pinocchio.Model; got str", InputError):
        pn.Scene("arm.urdf")


def spoil(**parts):
    """Build a scene of two links with invalid parts."""
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
