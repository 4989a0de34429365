"""MJCF files: bodies, joints and gravity arrive, and equalities become constraints."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.constraints import Distance, FrameAnchor, JointCoupling, PointAnchor, PrescribedMotion

from .refusals import refuses

# Poses of order one computed along two routes of some ten operations each.
ROUNDING = 1e-12

CRANK = """
<body name="crank" pos="0 0 1"><joint name="crank_joint" type="hinge" axis="0 1 0" ref="0.25"/>
  <geom name="knob" type="sphere" size="0.1" pos="0.5 0 0"/>
  <body name="rod" pos="1 0 0"><joint name="rod_joint" type="hinge" axis="0 1 0"/>
    <geom size="0.1" pos="0.5 0 0"/><site name="rod_tip" pos="1 0 0"/></body></body>
"""
ROCKER = """
<body name="rocker" pos="2 0 0.5"><joint name="rocker_joint" type="hinge" axis="0 1 0"/>
  <geom name="ball" type="sphere" size="0.2" pos="0 0 0.25"/><site name="rocker_tip" pos="0 0 0.5"/></body>
"""


def write(path, equality="", bodies=CRANK + ROCKER, head='<compiler angle="radian"/>', tail=""):
    file = path / "robot.xml"
    section = f"<equality>{equality}</equality>" if equality else ""
    file.write_text(f'<mujoco model="linkage">{head}<worldbody>{bodies}</worldbody>{section}{tail}</mujoco>')
    return file


def frame_places(scene, *names):
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, scene.q0)
    return [data.oMf[scene.model.getFrameId(name)] for name in names]


def test_every_root_body_arrives(tmp_path):
    scene = pn.load(write(tmp_path))
    assert list(scene.model.names)[1:] == ["crank_joint", "rod_joint", "rocker_joint"]
    np.testing.assert_array_equal(scene.q0, [0.25, 0.0, 0.0])
    (tip,) = frame_places(scene, "rod_tip")
    np.testing.assert_allclose(tip.translation, [2.0, 0.0, 1.0], atol=ROUNDING)


def test_bodies_and_joints_without_names_arrive(tmp_path):
    bodies = '<body><joint/><geom size="0.1"/><body><freejoint/><geom size="0.1"/></body></body>'
    assert pn.load(write(tmp_path, bodies=bodies)).model.nv == 7


def test_several_joints_of_one_body_stay_single(tmp_path):
    bodies = """<body name="base"><geom size="0.1"/><body name="table" pos="0 0 1" euler="0 0 0.5">
        <joint name="x" type="slide" axis="1 0 0"/><joint name="turn" axis="0 0 1"/>
        <joint name="tilt" axis="0 1 0"/>
        <geom size="0.1" pos="0.5 0 0"/><site name="edge" pos="1 0 0"/></body></body>"""
    scene = pn.load(write(tmp_path, bodies=bodies))
    assert list(scene.model.names)[1:] == ["x", "turn", "tilt"]
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, np.array([0.3, 0.2, 0.4]))
    turn, tilt = pin.utils.rotate("z", 0.5 + 0.2), pin.utils.rotate("y", 0.4)
    expected = [0, 0, 1] + pin.utils.rotate("z", 0.5) @ [0.3, 0, 0] + turn @ tilt @ [1, 0, 0]
    np.testing.assert_allclose(data.oMf[scene.model.getFrameId("edge")].translation, expected, atol=ROUNDING)


def test_gravity_of_the_file_is_used(tmp_path):
    scene = pn.load(write(tmp_path, head='<option gravity="0 -3 0"/>'))
    np.testing.assert_array_equal(scene.model.gravity.linear, [0, -3, 0])


def test_damping_friction_and_springs_with_default_classes(tmp_path):
    head = """<compiler angle="degree"/><default><joint damping="0.5"/><default class="stiff">
        <joint stiffness="4" springref="90" frictionloss="0.2"/></default></default>"""
    bodies = """<body name="a" childclass="stiff"><joint name="j"/><geom size="0.1"/>
        <body name="b"><joint name="k" class="main" stiffness="3"/><geom size="0.1"/></body></body>"""
    scene = pn.load(write(tmp_path, bodies=bodies, head=head))
    assert [(w.joint, w.viscous, w.coulomb) for w in scene.laws] == [("j", 0.5, 0.2), ("k", 0.5, 0.0)]
    springs = [(f.joint, f.stiffness, f.rest) for f in scene.forces]
    assert springs == [("j", 4.0, pytest.approx(np.pi / 2, rel=1e-15)), ("k", 3.0, 0.0)]


def test_connect_holds_the_points_that_coincide_at_the_reference(tmp_path):
    scene = pn.load(write(tmp_path, '<connect name="pin" body1="rod" body2="rocker" anchor="1 0 0"/>'))
    (anchor,) = scene.constraints
    assert isinstance(anchor, PointAnchor)
    one, two = frame_places(scene, anchor.frame1, anchor.frame2)
    np.testing.assert_allclose(one.translation, [2, 0, 1], atol=ROUNDING)
    np.testing.assert_allclose(two.translation, one.translation, atol=ROUNDING)
    assert scene.model.frames[scene.model.getFrameId(anchor.frame2)].parentJoint == 3


def test_connect_to_the_world(tmp_path):
    scene = pn.load(write(tmp_path, '<connect body1="rod" anchor="1 0 0"/>'))
    (anchor,) = scene.constraints
    one, two = frame_places(scene, anchor.frame1, anchor.frame2)
    np.testing.assert_allclose(two.translation, one.translation, atol=ROUNDING)
    assert scene.model.frames[scene.model.getFrameId(anchor.frame2)].parentJoint == 0


def test_connect_and_weld_of_sites(tmp_path):
    equality = '<connect site1="rod_tip" site2="rocker_tip"/><weld site1="rod_tip" site2="rocker_tip"/>'
    connect, weld = pn.load(write(tmp_path, equality)).constraints
    assert (connect.frame1, connect.frame2) == (weld.frame1, weld.frame2) == ("rod_tip", "rocker_tip")


def test_weld_holds_the_pose_at_the_reference(tmp_path):
    scene = pn.load(write(tmp_path, '<weld body1="rod" body2="rocker"/>'))
    (weld,) = scene.constraints
    assert isinstance(weld, FrameAnchor)
    one, two = frame_places(scene, weld.frame1, weld.frame2)
    np.testing.assert_allclose(one.homogeneous, two.homogeneous, atol=ROUNDING)


def test_weld_holds_the_pose_that_is_stated(tmp_path):
    scene = pn.load(write(tmp_path, '<weld body1="rod" body2="rocker" relpose="1 0 2 2 0 2 0"/>'))
    (weld,) = scene.constraints
    one, two, rod = frame_places(scene, weld.frame1, weld.frame2, "rod")
    quarter_turn = pin.utils.rotate("y", np.pi / 2)  # quaternion (w, x, y, z) = (2, 0, 2, 0), normalized
    stated = pin.SE3(quarter_turn, np.array([1.0, 0.0, 2.0]))
    np.testing.assert_allclose(rod.actInv(one).homogeneous, stated.homogeneous, atol=ROUNDING)
    np.testing.assert_allclose(two.translation, [2, 0, 0.5], atol=ROUNDING)


def test_joint_equalities_are_taken_from_the_reference_positions(tmp_path):
    equality = """<joint joint1="rocker_joint" joint2="crank_joint" polycoef="0.1 -2"/>
        <joint joint1="crank_joint" polycoef="0.5 0 0 0 0"/>"""
    coupling, held = pn.load(write(tmp_path, equality)).constraints
    assert isinstance(coupling, JointCoupling)
    # rocker - 0 = 0.1 - 2 (crank - 0.25)
    assert (coupling.ratio, coupling.offset) == (-2.0, pytest.approx(0.6, rel=1e-15))
    assert isinstance(held, PrescribedMotion)
    assert held.function(3.0) == (0.75, 0.0, 0.0)


def test_distance_of_spheres(tmp_path):
    scene = pn.load(write(tmp_path, '<distance geom1="knob" geom2="ball" distance="0.5"/>'))
    (rod,) = scene.constraints
    assert isinstance(rod, Distance)
    assert rod.length == pytest.approx(0.5 + 0.1 + 0.2, rel=1e-15)
    one, two = frame_places(scene, rod.frame1, rod.frame2)
    np.testing.assert_allclose(one.translation, [0.5, 0, 1], atol=ROUNDING)
    np.testing.assert_allclose(two.translation, [2, 0, 0.75], atol=ROUNDING)


def test_what_is_left_out_is_noted(tmp_path):
    equality = """<connect name="off" body1="rod" anchor="1 0 0" active="false"/>
        <connect name="soft" body1="rod" anchor="1 0 0" solref="0.1 1"/>"""
    scene = pn.load(write(tmp_path, equality, tail='<actuator><motor joint="rod_joint"/></actuator>'))
    assert [c.name for c in scene.constraints] == ["soft"]
    assert 'equality "off" is inactive in the MJCF file and left out' in scene.notes
    assert "solref and solimp of soft are not used: constraints here are exact, not soft" in scene.notes
    assert "<actuator> of the MJCF file is not read" in scene.notes


EQUALITY_REFUSED = {
    "tendon": (
        '<tendon tendon1="t"/>',
        "<tendon> cannot be honored; only connect, weld, joint, distance can",
    ),
    "flex": ('<flex flex="f"/>', "<flex> cannot be honored"),
    "unknown body": ('<connect body1="rodd" anchor="0 0 0"/>', 'no body "rodd"; nearest: "rod"'),
    "unknown site": ('<weld site1="rod_tip" site2="tip"/>', 'no site "tip"; nearest: "rod_tip"'),
    "unknown joint": ('<joint joint1="rod_join"/>', 'no joint "rod_join"; nearest: "rod_joint"'),
    "no anchor": ('<connect body1="rod"/>', "connect needs an anchor"),
    "anchor nan": ('<connect body1="rod" anchor="0 nan 0"/>', 'anchor must be finite; got "0 nan 0"'),
    "nonlinear": (
        '<joint joint1="rod_joint" joint2="crank_joint" polycoef="0 1 2 0 0"/>',
        "polycoef must be linear (c2 = c3 = c4 = 0) to become a coupling; got 0 1 2 0 0",
    ),
    "unknown geom": ('<distance geom1="knb" geom2="ball"/>', 'no geom "knb"; nearest: "knob"'),
    "touching centers": (
        '<distance geom1="knob" geom2="ball" distance="-1"/>',
        "must be positive; got -0.7 m",
    ),
}


@pytest.mark.parametrize(("equality", "message"), EQUALITY_REFUSED.values(), ids=EQUALITY_REFUSED)
def test_equalities_that_cannot_be_honored_are_errors(tmp_path, equality, message):
    with refuses(message):
        pn.load(write(tmp_path, equality))


def test_distance_of_other_shapes_is_an_error(tmp_path):
    bodies = CRANK + ROCKER.replace('type="sphere" size="0.2"', 'type="box" size="0.2 0.2 0.2"')
    with refuses('distance can be honored between spheres only; geom "ball" is a box'):
        pn.load(write(tmp_path, '<distance geom1="knob" geom2="ball"/>', bodies))


FILE_REFUSED = {
    "include": (
        '<include file="other.xml"/>' + CRANK,
        "<include> is not read; write its content out in this file",
    ),
    "frame": (f'<frame pos="0 0 1">{CRANK}</frame>', "<frame> is not read"),
    "no body": ('<geom size="1"/>', "must have a <worldbody> with at least one <body>"),
    "twice the same joint": (
        CRANK + ROCKER.replace("rocker_joint", "rod_joint"),
        '"rod_joint" appears twice',
    ),
    "unknown element": (CRANK.replace("<geom", "<sprout/><geom", 1), '<sprout> in body "crank" is not read'),
}


@pytest.mark.parametrize(("bodies", "message"), FILE_REFUSED.values(), ids=FILE_REFUSED)
def test_bodies_that_cannot_be_read_are_errors(tmp_path, bodies, message):
    with refuses(message):
        pn.load(write(tmp_path, bodies=bodies))


def test_another_xml_file_is_refused(tmp_path):
    (tmp_path / "a.xml").write_text("<robot/>")
    with refuses("must have the root element <mujoco>; got <robot>"):
        pn.load(tmp_path / "a.xml")


def test_truncated_mjcf_never_loads(tmp_path):
    text = write(tmp_path, '<connect body1="rod" anchor="1 0 0"/>').read_text()
    for end in range(0, len(text), 17):
        (tmp_path / "cut.xml").write_text(text[:end])
        with refuses("is truncated or not XML"):
            pn.load(tmp_path / "cut.xml")


def test_missing_mesh_is_a_note_where_the_mass_is_known(tmp_path):
    head = '<asset><mesh name="hull" file="hull.stl"/></asset>'
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    bodies = f'<body name="a"><joint name="j"/>{inertial}<geom type="mesh" mesh="hull"/></body>'
    scene = pn.load(write(tmp_path, bodies=bodies, head=head))
    assert 'mesh "hull.stl" was not found; its shape is left out' in scene.notes
    with refuses('body "a" has its mass from mesh "hull.stl", which was not found'):
        pn.load(write(tmp_path, bodies=bodies.replace(inertial, ""), head=head))
