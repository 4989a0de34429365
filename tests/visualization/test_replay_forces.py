"""Marks and arrows of the replay: position, direction and size of constraint forces."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description.constraints import (
    Distance,
    FrameAnchor,
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
    Rolling,
)
from pin_nonideal.description.contacts import PointContact
from pin_nonideal.description.forces import SpringDamper
from pin_nonideal.description.time_functions import constant
from pin_nonideal.visualization.page.contact_points import contact_points
from pin_nonideal.visualization.page.force_arrows import arrows_of
from pin_nonideal.visualization.page.frames import sample
from pin_nonideal.visualization.page.markers import marks_of

from ..support.replay_runs import add_frame, described, four_bar, jointed, run_of

ROUNDING = 1e-12
# Closure of the four-bar in closed form: a few roundings of 1 m through an arc cosine.
CLOSURE = 1e-12


def arrows(run: object) -> list:
    motion = sample(run, 20.0)
    return arrows_of(run, motion, contact_points(run, motion))


def frames(run: object, name: str) -> list[pin.SE3]:
    """Placement of a frame at the replay's frames."""
    model, found = run.scene.model, []
    data = model.createData()
    motion = sample(run, 20.0)
    for time in motion.times:
        k = int(np.argmin(np.abs(run.t - time)))
        assert run.t[k] == pytest.approx(time)
        pin.framesForwardKinematics(model, data, run.q[k])
        found.append(data.oMf[model.getFrameId(name)].copy())
    return found


def test_an_anchor_is_marked_on_both_bodies() -> None:
    run = four_bar()
    (mark,) = marks_of(run.scene._compiled)
    assert (mark.name, mark.kind) == ("loop", "anchor")
    motion = sample(run, 20.0)
    first, second = motion.point(mark.joint1, mark.point1), motion.point(mark.joint2, mark.point2)
    np.testing.assert_allclose(first, second, atol=CLOSURE)
    np.testing.assert_allclose(
        first, [place.translation for place in frames(run, "coupler_tip")], atol=ROUNDING
    )


def test_an_anchor_on_the_world_stays_where_its_frame_starts() -> None:
    model = jointed(pin.JointModelRZ())
    add_frame(model, "tip", 1, [0.4, 0.0, 0.0])
    run = run_of(model, [0.0, 1.0], lambda t: np.array([0.5 + t]), constraints=[PointAnchor("tip")])
    (mark,) = marks_of(run.scene._compiled)
    assert mark.joint2 == 0
    np.testing.assert_allclose(mark.point2, [0.4 * np.cos(0.5), 0.4 * np.sin(0.5), 0.0], atol=ROUNDING)
    assert mark.name == "PointAnchor"


def test_a_joint_without_a_frame_of_its_own_is_marked_by_its_name() -> None:
    model = jointed(pin.JointModelRZ(), pin.JointModelRZ())
    assert not model.existFrame("j1")
    run = run_of(model, [0.0, 1.0], lambda t: np.array([t, 0.0]), constraints=[PointAnchor("j1")])
    (mark,) = marks_of(run.scene._compiled)
    assert (mark.joint1, mark.joint2) == (2, 0)
    np.testing.assert_allclose(mark.point1, np.zeros(3), atol=ROUNDING)
    np.testing.assert_allclose(mark.point2, [0.4, 0.0, 0.0], atol=ROUNDING)


def test_a_reaction_is_turned_from_the_second_frame_into_the_world_and_split() -> None:
    run = four_bar()
    by_kind = {arrow.kind: arrow for arrow in arrows(run) if arrow.name == "loop"}
    assert set(by_kind) == {"ideal", "nonideal"}
    samples = np.round(sample(run, 20.0).times * 60.0).astype(int)
    expected = [
        place.rotation @ lam for place, lam in zip(frames(run, "rocker_tip"), run.lam[samples], strict=True)
    ]
    np.testing.assert_allclose(by_kind["ideal"].values, 0.75 * np.array(expected), atol=ROUNDING * 10.0)
    np.testing.assert_allclose(by_kind["nonideal"].values, 0.25 * np.array(expected), atol=ROUNDING * 10.0)
    tips = [place.translation for place in frames(run, "coupler_tip")]
    np.testing.assert_allclose(by_kind["ideal"].origin, tips, atol=ROUNDING)


def test_a_nonideal_part_that_is_rounding_has_no_arrow() -> None:
    run = four_bar()
    run.lam_ideal = run.lam * (1.0 + 1e-14)
    assert [arrow.kind for arrow in arrows(run) if arrow.name == "loop"] == ["ideal"]


def test_without_a_split_the_arrow_is_the_total() -> None:
    run = four_bar()
    run.lam_ideal = None
    (arrow,) = [arrow for arrow in arrows(run) if arrow.name == "loop"]
    assert arrow.kind == "total"
    np.testing.assert_allclose(np.linalg.norm(arrow.values[0]), np.linalg.norm(run.lam[0]))


def test_friction_in_joints_is_a_moment_about_their_axes() -> None:
    run = four_bar()
    moments = {arrow.name: arrow for arrow in arrows(run) if arrow.unit == "N m"}
    assert set(moments) == {"crank", "rocker"}  # the coupler's is zero throughout
    assert {arrow.kind for arrow in moments.values()} == {"nonideal"}
    np.testing.assert_allclose(moments["crank"].values, run.F_nonideal[::3, 0], atol=ROUNDING)
    np.testing.assert_allclose(moments["crank"].axis, [0.0, 1.0, 0.0])
    assert moments["rocker"].joint == 3


def test_without_anchors_the_generalized_force_of_constraint_is_drawn_at_the_joints() -> None:
    model = jointed(pin.JointModelPX(), pin.JointModelPY())
    t = np.linspace(0.0, 1.0, 21)
    run = run_of(model, t, lambda x: np.array([x, 2.0 * x]), F_ideal=np.column_stack([t, 0.0 * t]))
    (arrow,) = arrows(run)
    assert (arrow.name, arrow.kind, arrow.unit) == ("j0", "ideal", "N")
    np.testing.assert_allclose(arrow.values, np.column_stack([t, 0 * t, 0 * t]), atol=ROUNDING)
    np.testing.assert_allclose(arrow.origin[:, 0], t, atol=ROUNDING)


def test_a_run_without_forces_has_no_arrows() -> None:
    assert arrows(run_of(jointed(pin.JointModelRZ()), [0.0, 1.0], lambda t: np.array([t]))) == []


def single(item: object, lam: list[float], joint: object = None, **fields: object) -> list:
    """Arrows of one constraint on a body at (0.3, 0, 0.5) that carries the frames "center" and "tip"."""
    model = jointed(joint or pin.JointModelPX())
    add_frame(model, "center", 1, [0.3, 0.0, 0.5])
    add_frame(model, "tip", 1, [0.4, 0.0, 0.0], turn=pin.utils.rotate("z", np.pi / 2.0))
    add_frame(model, "base", 0, [0.0, 0.0, 0.0], turn=pin.utils.rotate("z", np.pi / 2.0))
    name = item.name
    return arrows(
        run_of(
            model,
            [0.0, 1.0],
            lambda t: np.zeros(1),
            lam=np.array([lam, lam]),
            constraint_slices={name: slice(0, len(lam))},
            constraints=[item],
            **fields,
        )
    )


@pytest.mark.parametrize(
    ("item", "lam", "force", "origin"),
    [
        (PointAnchor("tip", "base", axes="xz", name="c"), [2.0, 3.0], [0.0, 2.0, 3.0], [0.4, 0.0, 0.0]),
        (HingeAnchor("tip", "base", name="c"), [1.0, 2.0, 3.0, 8.0, 9.0], [-2.0, 1.0, 3.0], [0.4, 0.0, 0.0]),
        (Distance("tip", "base", name="c"), [5.0], [5.0, 0.0, 0.0], [0.4, 0.0, 0.0]),
        (Rolling("center", 0.5, axis="y", name="c"), [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [0.3, 0.0, 0.0]),
        (Rolling("center", 0.2, axis=None, name="c"), [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [0.3, 0.0, 0.3]),
        (KnifeEdge("tip", axis="y", name="c"), [6.0], [-6.0, 0.0, 0.0], [0.4, 0.0, 0.0]),
        (PrescribedMotion("j0", constant(0.0), name="c"), [4.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ],
    ids=["point", "hinge", "distance", "disk", "sphere", "edge", "drive"],
)
def test_force_and_place_of_each_kind(item: object, lam: list, force: list, origin: list) -> None:
    (arrow,) = [found for found in single(item, lam) if found.unit == "N"]
    np.testing.assert_allclose(arrow.values[0], force, atol=ROUNDING)
    np.testing.assert_allclose(arrow.origin[0], origin, atol=ROUNDING)
    assert (arrow.name, arrow.unit, arrow.kind) == ("c", "N", "total")


def test_a_coupling_acts_on_both_joints() -> None:
    model = jointed(pin.JointModelRZ(), pin.JointModelRX())
    first, second = arrows(
        run_of(
            model,
            [0.0, 1.0],
            lambda t: np.array([t, t]),
            constraints=[JointCoupling("j0", "j1", ratio=-2.0, name="gear")],
            constraint_slices={"gear": slice(0, 1)},
            lam=np.full((2, 1), 3.0),
        )
    )
    assert [(arrow.name, arrow.unit, arrow.joint, arrow.values[0]) for arrow in (first, second)] == [
        ("gear", "N m", 1, 3.0),
        ("gear", "N m", 2, 6.0),
    ]


def test_constraints_of_pinocchio_are_drawn_like_anchors() -> None:
    run = four_bar()
    model = run.scene.model
    first, second = (model.frames[model.getFrameId(name)] for name in ("coupler_tip", "rocker_tip"))
    expected = arrows(run)
    run.scene.constraints = [
        pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            model,
            first.parentJoint,
            first.placement,
            second.parentJoint,
            second.placement,
            pin.ReferenceFrame.LOCAL,
        )
    ]
    run.scene._compiled.described = described(["loop"], run.scene.constraints)
    found = arrows(run)
    assert [(arrow.name, arrow.kind) for arrow in found] == [(arrow.name, arrow.kind) for arrow in expected]
    np.testing.assert_allclose(found[0].values, expected[0].values, atol=ROUNDING)
    np.testing.assert_allclose(found[0].origin, expected[0].origin, atol=ROUNDING)
    assert marks_of(run.scene._compiled)[0].kind == "anchor"


def test_rods_springs_and_contacts_are_marked() -> None:
    model = jointed(pin.JointModelRZ())
    add_frame(model, "tip", 1, [0.4, 0.0, 0.0])
    run = run_of(
        model,
        [0.0, 1.0],
        lambda t: np.array([t]),
        constraints=[Distance("tip", "universe", name="rod")],
        contacts=[PointContact("tip", name="foot")],
        given_forces=[SpringDamper("tip", stiffness=1.0, name="spring")],
    )
    assert [(mark.name, mark.kind) for mark in marks_of(run.scene._compiled)] == [
        ("rod", "rod"),
        ("foot", "contact"),
        ("spring", "spring"),
    ]


@pytest.mark.parametrize(
    ("item", "lam", "moment"),
    [
        (HingeAnchor("tip", "base", name="c"), [1.0, 2.0, 3.0, 8.0, 9.0], [-9.0, 8.0, 0.0]),
        (HingeAnchor("tip", "base", axis="x", name="c"), [1.0, 2.0, 3.0, 8.0, 9.0], [-8.0, 0.0, 9.0]),
        (FrameAnchor("tip", "base", name="c"), [1.0, 2.0, 3.0, 7.0, 8.0, 9.0], [-8.0, 7.0, 9.0]),
    ],
    ids=["hinge z", "hinge x", "frame"],
)
def test_moments_of_anchors_are_drawn_at_the_frame(item: object, lam: list, moment: list) -> None:
    """`base` is turned by a right angle about z: its x is the world's y; t1 and t2 of "x" are y and z."""
    (arrow,) = [found for found in single(item, lam) if found.unit == "N m"]
    np.testing.assert_allclose(arrow.values[0], moment, atol=ROUNDING)
    np.testing.assert_allclose(arrow.origin[0], [0.4, 0.0, 0.0], atol=ROUNDING)


def test_a_moment_that_is_rounding_of_the_forces_has_no_arc() -> None:
    item = FrameAnchor("tip", "base", name="c")
    assert [a.unit for a in single(item, [10.0, 0.0, 0.0, 1e-15, 0.0, 0.0])] == ["N"]
    assert [a.unit for a in single(item, [10.0, 0.0, 0.0, 1e-3, 0.0, 0.0])] == ["N", "N m"]


def test_joints_of_several_dofs_show_the_force_and_the_moment_on_their_body() -> None:
    """A free body turned by a right angle about z: its own x is the world's y."""
    model = jointed(pin.JointModelFreeFlyer())
    q = pin.SE3ToXYZQUAT(pin.SE3(pin.utils.rotate("z", np.pi / 2.0), np.array([1.0, 2.0, 3.0])))
    force = np.tile([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], (2, 1))
    straight, moment = arrows(run_of(model, [0.0, 1.0], lambda t: q, F_nonideal=force))
    np.testing.assert_allclose(straight.values[0], [-2.0, 1.0, 3.0], atol=ROUNDING)
    np.testing.assert_allclose(moment.values[0], [-5.0, 4.0, 6.0], atol=ROUNDING)
    assert (straight.unit, moment.unit, straight.kind) == ("N", "N m", "nonideal")
    model = jointed(pin.JointModelTranslation())
    (arrow,) = arrows(
        run_of(model, [0.0, 1.0], lambda t: np.zeros(3), F_ideal=np.tile([1.0, 2.0, 3.0], (2, 1)))
    )
    np.testing.assert_allclose(arrow.values[0], [1.0, 2.0, 3.0], atol=ROUNDING)


def test_the_force_on_a_universal_joint_is_the_least_that_has_its_components() -> None:
    model = jointed(pin.JointModelSphericalZYX())
    q, tau = np.array([0.3, -0.8, 0.5]), np.array([1.0, -2.0, 0.7])
    (moment,) = arrows(run_of(model, [0.0, 1.0], lambda t: q, F_nonideal=np.tile(tau, (2, 1))))
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    turning = pin.getJointJacobian(model, data, 1, pin.LOCAL_WORLD_ALIGNED)[3:]
    np.testing.assert_allclose(turning.T @ moment.values[0], tau, atol=ROUNDING)


def test_slides_without_a_mass_between_them_are_one_particle() -> None:
    model = pin.Model()
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    y = model.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
    model.appendBodyToJoint(y, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    (arrow,) = arrows(
        run_of(model, [0.0, 1.0], lambda t: np.array([t, 0.0]), F_ideal=np.tile([3.0, 4.0], (2, 1)))
    )
    np.testing.assert_allclose(arrow.values[0], [3.0, 4.0, 0.0], atol=ROUNDING)
    assert arrow.name == "x, y"


def test_torques_of_the_actuation_are_drawn_at_their_joints() -> None:
    model = jointed(pin.JointModelRZ(), pin.JointModelRX())
    tau = np.array([[0.0, 2.5], [0.0, 2.5]])
    (arrow,) = arrows(run_of(model, [0.0, 1.0], lambda t: np.array([t, 0.0]), tau=tau))
    assert (arrow.name, arrow.kind, arrow.unit) == ("j1", "drive", "N m")
    np.testing.assert_allclose(arrow.values, 2.5)


def test_stops_of_joints_and_bounces_are_drawn() -> None:
    """A pendulum against its stops: the force of the upper stop turns back; each stop has separate rows."""
    model = jointed(pin.JointModelRY())
    stop = pn.JointLimit("j0", lower=-0.5, upper=0.5, name="stop")
    run = pn.simulate(pn.Scene(model, contacts=[stop]), 2.0, record="forces")
    (arrow,) = [arrow for arrow in arrows(run) if arrow.name == "stop upper"]
    assert arrow.values[-1] < 0.0
    assert len(pn.replay(run).text) > 100_000
