"""Errors of invalid friction: requirement, given value and remedy."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, LoadingError, UnknownNameError, UserFunctionError

from ..support.refusals import refuses
from ..support.small_robots import folder, joint, link, robot

NAN = math.nan
STATIC = "static_ratio must be at least 1 (static friction is never below kinetic friction); got"

# An arm on a pin with a hand welded to it, and a jaw that mimics the pin.
GRIPPER = robot(
    '<link name="base"/>',
    link("arm"),
    joint("pin", "base", "arm", axis="0 1 0"),
    link("hand"),
    joint("wrist", "arm", "hand", kind="fixed", xyz="1 0 0"),
    link("jaw"),
    joint("follower", "hand", "jaw", axis="0 1 0", inside='<mimic joint="pin" multiplier="2"/>'),
    link("slide"),
    joint("rail", "hand", "slide", kind="prismatic"),
)


@pytest.fixture(scope="module")
def gripper(tmp_path_factory):
    return pn.load(folder(tmp_path_factory.mktemp("gripper"), urdf=GRIPPER))


def with_law(robot, law, constraints=()):
    return pn.Scene(robot.model, constraints=[*robot.constraints, *constraints], laws=[law])


def single(kind, law):
    """Return a body on one joint, "joint"."""
    model = pin.Model()
    model.addJoint(0, kind, pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return pn.Scene(model, laws=[law])


class TestNumbers:
    """Errors of descriptions without a scene."""

    @pytest.mark.parametrize("key", ["coulomb", "mu", "radius", "axial_radius", "preload", "viscous"])
    def test_joint_friction(self, key):
        with refuses(f"JointFriction: {key} must not be negative; got -0.1", InputError):
            pn.JointFriction("pin", **{"coulomb": 1.0, key: -0.1})
        with refuses(f"JointFriction: {key} must be finite; got nan", InputError):
            pn.JointFriction("pin", **{"coulomb": 1.0, key: NAN})

    @pytest.mark.parametrize("key", ["span", "stribeck_velocity"])
    def test_lengths_and_speeds_of_scale(self, key):
        with refuses(f"JointFriction: {key} must be positive; got 0", InputError):
            pn.JointFriction("pin", coulomb=1.0, **{key: 0.0})
        with refuses(f"JointFriction: {key} must be finite; got nan", InputError):
            pn.JointFriction("pin", coulomb=1.0, **{key: NAN})

    @pytest.mark.parametrize(
        ("make", "words"),
        [
            (lambda: pn.JointFriction("pin", coulomb=1.0, static_ratio=0.8), f"JointFriction: {STATIC} 0.8"),
            (
                lambda: pn.JointFriction("pin", mu=1.0, static_ratio=NAN),
                "static_ratio must be finite; got nan",
            ),
            (lambda: pn.PointContact("foot", mu=0.1, static_ratio=0.9), f"PointContact: {STATIC} 0.9"),
            (
                lambda: pn.UserFriction(lambda t, q: [1.0], lambda *_: 1.0, static_ratio=0.5),
                f"UserFriction: {STATIC} 0.5",
            ),
            (
                lambda: pn.LuGre("pin", 1e4, 10.0, 1.0, stiction=0.5),
                "LuGre: stiction must be at least coulomb (static friction is never below kinetic friction); "
                "got 0.5 and 1",
            ),
        ],
    )
    def test_static_below_kinetic(self, make, words):
        with refuses(words, InputError):
            make()

    @pytest.mark.parametrize(
        ("make", "words"),
        [
            (lambda: pn.PointContact("foot", mu=-0.1), "PointContact: mu must not be negative; got -0.1"),
            (lambda: pn.PointContact("foot", mu=NAN), "PointContact: mu must be finite; got nan"),
            (lambda: pn.LuGre("pin", -1.0, 10.0, 1.0), "LuGre: stiffness must be positive; got -1"),
            (lambda: pn.LuGre("pin", 1.0, NAN, 1.0), "LuGre: damping must be finite; got nan"),
            (
                lambda: pn.SigmoidFriction("pin", -1.0, 1.0),
                "SigmoidFriction: phi1 must not be negative; got -1",
            ),
            (lambda: pn.SigmoidFriction("pin", 1.0, 0.0), "SigmoidFriction: phi2 must be positive; got 0"),
            (lambda: pn.Drag("foot", NAN), "Drag: coefficient must be finite; got nan"),
            (
                lambda: pn.JointFriction("pin"),
                "one of coulomb, mu, preload, viscous must be positive; all are zero, so leave the law out",
            ),
            (
                lambda: pn.JointFriction("pin", mu=0.1, reaction="none"),
                "JointFriction: reaction must be one of 'total', 'ideal'; got 'none'",
            ),
            (
                lambda: pn.JointFriction("pin", mu="a lot", name="rub"),
                "JointFriction \"rub\": mu must be a number; got 'a lot'",
            ),
            (
                lambda: pn.UserFriction(1.0, lambda t, q, v, r: 1.0),
                "UserFriction: direction must be a function (t, q) -> row; got 1.0",
            ),
        ],
    )
    def test_other_laws(self, make, words):
        with refuses(words, InputError):
            make()


class TestPlaces:
    """Errors of the element that a law acts on."""

    LAWS = {  # noqa: RUF012
        "JointFriction": lambda name: pn.JointFriction(name, mu=0.1, radius=0.02),
        "LuGre": lambda name: pn.LuGre(name, 1e4, 10.0, 1.0),
        "SigmoidFriction": lambda name: pn.SigmoidFriction(name, 1.0, 1.0),
    }

    @pytest.mark.parametrize("kind", LAWS)
    def test_locked_joint(self, gripper, kind):
        words = f'{kind}(wrist): joint "wrist" is fixed (locked) and cannot move; unlock it or leave it out'
        with refuses(words, InputError):
            with_law(gripper, self.LAWS[kind]("wrist"))

    @pytest.mark.parametrize("kind", LAWS)
    def test_mimic_joint(self, gripper, kind):
        words = (
            f'{kind}(follower): joint "follower" is a mimic joint, driven by "pin"; put the friction on "pin"'
        )
        with refuses(words, InputError):
            with_law(gripper, self.LAWS[kind]("follower"))

    def test_unknown_element(self, gripper):
        with refuses('JointFriction(pine): no joint or anchor "pine"; nearest: "pin"', UnknownNameError):
            with_law(gripper, self.LAWS["JointFriction"]("pine"))
        for kind in ("LuGre", "SigmoidFriction"):
            with refuses(f'{kind}(pine): no joint "pine" in model "arm"; nearest: "pin"', UnknownNameError):
                with_law(gripper, self.LAWS[kind]("pine"))
        hinge = pn.HingeAnchor("hand", axis="y", name="loop")
        with refuses('JointFriction(lop): no joint or anchor "lop"; nearest: "loop"', UnknownNameError):
            with_law(gripper, self.LAWS["JointFriction"]("lop"), [hinge])

    def test_a_frame_is_no_joint(self, gripper):
        known = '"pin", "follower", "rail", "follower mimic"'
        with refuses(f'JointFriction(hand): no joint or anchor "hand"; known: {known}', UnknownNameError):
            with_law(gripper, self.LAWS["JointFriction"]("hand"))

    @pytest.mark.parametrize(
        ("anchor", "what"),
        [
            (pn.PointAnchor("hand", axes="xz", name="loop"), "PointAnchor that holds 2 of three directions"),
            (pn.FrameAnchor("hand", name="loop"), "FrameAnchor"),
            (pn.Distance("hand", "base", length=1.0, name="loop"), "Distance"),
            (pn.PrescribedMotion("rail", pn.polynomial([0.0]), name="loop"), "PrescribedMotion"),
        ],
        ids=lambda anchor: type(anchor).__name__,
    )
    def test_anchor_in_which_nothing_rubs(self, gripper, anchor, what):
        words = (
            f'JointFriction(loop): "loop" is a {what}, for which no friction is defined; friction acts in a '
            'HingeAnchor, in a PointAnchor with axes="xyz" and on a JointCoupling'
        )
        with refuses(words, InputError):
            with_law(gripper, self.LAWS["JointFriction"]("loop"), [anchor])

    @pytest.mark.parametrize(
        "kind", [pin.JointModelSphericalZYX, lambda: pin.JointModelEllipsoid(0.3, 0.2, 0.1)]
    )
    def test_joint_with_no_bearing(self, kind):
        words = (
            "must be revolute, prismatic, helical, spherical, universal, planar, translation or free flyer; "
            f"it is {kind().shortname()}"
        )
        with refuses(f'JointFriction(joint): joint "joint" {words}', InputError):
            single(kind(), pn.JointFriction("joint", mu=0.1, radius=0.1))

    @pytest.mark.parametrize("kind", [pin.JointModelFreeFlyer, pin.JointModelTranslation])
    def test_joint_without_load(self, kind):
        words = 'JointFriction(joint): joint "joint" carries no load that mu could follow; give coulomb'
        with refuses(words, InputError):
            single(kind(), pn.JointFriction("joint", mu=0.1, radius=0.1))

    @pytest.mark.parametrize("kind", [pin.JointModelFreeFlyer, pin.JointModelPlanar])
    def test_bristles_need_a_joint_of_one_velocity(self, kind):
        joint = kind()
        with refuses(f'joint "joint" must have 1 degree of freedom; it has {joint.nv}', InputError):
            single(joint, pn.LuGre("joint", 1e4, 10.0, 1.0))

    def test_coefficient_without_radius(self, gripper):
        words = (
            "mu needs a positive radius or axial_radius on a joint that turns, for torque = mu radius force"
        )
        with refuses(f"JointFriction(pin): {words}", InputError):
            with_law(gripper, pn.JointFriction("pin", mu=0.1))
        hinge = pn.HingeAnchor("hand", axis="y", name="loop")
        with refuses(f"JointFriction(loop): {words}", InputError):
            with_law(gripper, pn.JointFriction("loop", mu=0.1), [hinge])
        assert with_law(gripper, pn.JointFriction("rail", mu=0.1)).element_names == ["JointFriction(rail)"]

    def test_ball_without_radius(self):
        model = pin.Model()
        model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
        model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
        with refuses("JointFriction(ball): mu needs a positive radius on a joint that turns", InputError):
            pn.Scene(model, laws=[pn.JointFriction("ball", mu=0.1, axial_radius=0.1)])


class TestFiles:
    """Errors of robot.yaml and URDF."""

    @pytest.mark.parametrize(
        ("entry", "words", "error"),
        [
            (
                "{joint: pin, mu: -0.1}",
                "laws[0]: JointFriction: mu must not be negative; got -0.1",
                LoadingError,
            ),
            ("{joint: pin, mu: .nan}", "laws[0]: JointFriction: mu must be finite; got nan", LoadingError),
            (
                "{joint: pin, mu: 0.1, static_ratio: 0.5}",
                f"laws[0]: JointFriction: {STATIC} 0.5",
                LoadingError,
            ),
            ("{joint: pine, coulomb: 1}", 'no joint or anchor "pine"; nearest: "pin"', UnknownNameError),
            ("{joint: wrist, coulomb: 1}", 'joint "wrist" is fixed (locked) and cannot move', InputError),
            (
                "{joint: follower, coulomb: 1}",
                'joint "follower" is a mimic joint, driven by "pin"',
                InputError,
            ),
        ],
    )
    def test_robot_yaml(self, tmp_path, entry, words, error):
        with refuses(words, error):
            pn.load(folder(tmp_path, f"laws:\n  - JointFriction: {entry}", GRIPPER))

    def test_joint_locked_by_robot_yaml(self, tmp_path):
        yaml = "model: {locked: [rail]}\nlaws:\n  - JointFriction: {joint: rail, coulomb: 1}"
        with refuses('JointFriction(rail): joint "rail" is fixed (locked) and cannot move', InputError):
            pn.load(folder(tmp_path, yaml, GRIPPER))

    @pytest.mark.parametrize(
        ("tag", "words"),
        [
            ('damping="-1"', "damping must not be negative; got -1"),
            ('friction="-1"', "friction must not be negative; got -1"),
            ('friction="nan"', 'friction must be finite; got "nan"'),
        ],
    )
    def test_urdf_dynamics(self, tmp_path, tag, words):
        arm = [
            *('<link name="base"/>', link("arm")),
            joint("pin", "base", "arm", inside=f"<dynamics {tag}/>"),
        ]
        with refuses(f'joint "pin": {words}', LoadingError):
            pn.load(folder(tmp_path, urdf=robot(*arm)))


class TestFunctions:
    """Errors of return values of user friction, with the name of its function."""

    @pytest.mark.parametrize(
        ("direction", "limit", "words"),
        [
            ([1.0, 0.0, 0.0], lambda r: -1.0, "limit must not be negative; got -1"),
            ([1.0, 0.0, 0.0], lambda r: NAN, "limit must return finite numbers; got nan"),
            ([1.0], lambda r: 1.0, "direction must return shape (3,); got shape (1,)"),
            (
                [1.0, 0.0, 0.0],
                lambda r: r.wrench("pinn")[0],
                'limit raised UnknownNameError: no joint or constraint "pinn" in this scene; nearest: "pin"',
            ),
        ],
    )
    def test_user_friction(self, gripper, direction, limit, words):
        own = pn.UserFriction(lambda t, q: direction, lambda t, q, v, r: limit(r), name="own")
        with refuses(f'UserFriction "own": {words}', UserFunctionError):
            with_law(gripper, own).solve(np.zeros(3), [1.0, 2.0, 0.0])

    def test_user_law(self, gripper):
        own = pn.UserLaw(lambda t, q, v, r: [1.0], name="own")
        with refuses('UserLaw "own": function must return shape (3,); got shape (1,)', UserFunctionError):
            with_law(gripper, own).solve(np.zeros(3), [1.0, 2.0, 0.0])
