"""MJCF files: bodies, joints and gravity arrive, and equalities become constraints."""

from __future__ import annotations

import sys

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description.constraints import (
    FrameAnchor,
    JointCoupling,
    PointAnchor,
    PrescribedMotion,
    UserConstraint,
)

from ..support.refusals import refuses

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
    bodies = (
        '<body><joint/><geom size="0.1"/></body><body name="joint_0"><freejoint/><geom size="0.1"/></body>'
    )
    model = pn.load(write(tmp_path, bodies=bodies)).model
    assert model.nv == 7
    assert list(model.names)[1:] == ["joint_0", "joint_1"]


def test_a_joint_that_has_the_name_of_the_ground_gets_another(tmp_path):
    bodies = '<body name="universe"><joint name="universe"/><geom size="0.1"/></body>'
    scene = pn.load(write(tmp_path, bodies=bodies))
    assert list(scene.model.names) == ["universe", "universe_0"]
    assert 'joint "universe" has the name "universe_0" here, since its name is reserved' in scene.notes


def test_a_fragment_whose_tendon_goes_around_nothing_is_refused(tmp_path):
    path = '<site site="rod_tip"/><geom geom="lost"/><site site="rocker_tip"/>'
    tail = f"<tendon><spatial>{path}</spatial></tendon>"
    with refuses("cannot be compiled by MuJoCo"):
        pn.load(write(tmp_path, tail=tail))


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
    scene = pn.load(write(tmp_path, equality))
    sites = frame_places(scene, "rod_tip", "rocker_tip")
    for anchor in scene.constraints:
        for place, site in zip(frame_places(scene, anchor.frame1, anchor.frame2), sites, strict=True):
            np.testing.assert_allclose(place.homogeneous, site.homogeneous, atol=ROUNDING)


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


def test_what_is_left_out_is_noted(tmp_path):
    equality = """<connect name="off" body1="rod" anchor="1 0 0" active="false"/>
        <connect name="soft" body1="rod" anchor="1 0 0" solref="0.1 1"/>"""
    scene = pn.load(write(tmp_path, equality))
    assert [c.name for c in scene.constraints] == ["soft"]
    assert 'equality "off" is inactive in the MJCF file and left out' in scene.notes
    assert "solref and solimp of soft are not used: constraints are exact here, not soft" in scene.notes


def test_joint_equalities_of_higher_order_are_rows(tmp_path):
    equality = '<joint joint1="rod_joint" joint2="crank_joint" polycoef="0.1 1 2 0 0"/>'
    (row,) = pn.load(write(tmp_path, equality)).constraints
    assert isinstance(row, UserConstraint)
    q = np.array([0.25 + 0.3, 0.1 + 0.3 + 2 * 0.3**2, 0.0])  # the crank's reference is 0.25
    np.testing.assert_allclose(row.residual(0.0, q), [0.0], atol=ROUNDING)


EQUALITY_REFUSED = {
    "unknown body": ('<connect body1="rodd" anchor="0 0 0"/>', "cannot be compiled by MuJoCo: unknown"),
    "no anchor": ('<connect body1="rod"/>', "cannot be read by MuJoCo: XML Error"),
}


@pytest.mark.parametrize(("equality", "message"), EQUALITY_REFUSED.values(), ids=EQUALITY_REFUSED)
def test_equalities_that_mujoco_refuses_are_errors(tmp_path, equality, message):
    with refuses(message):
        pn.load(write(tmp_path, equality))


FILE_REFUSED = {
    "include": ('<include file="other.xml"/>' + CRANK, "other.xml"),
    "twice the same joint": (
        CRANK + ROCKER.replace("rocker_joint", "rod_joint"),
        "repeated name 'rod_joint'",
    ),
    "unknown element": (CRANK.replace("<geom", "<sprout/><geom", 1), "sprout"),
    "no mass": ('<body name="a"><joint/></body>', "mass and inertia of moving bodies must be larger"),
}


@pytest.mark.parametrize(("bodies", "message"), FILE_REFUSED.values(), ids=FILE_REFUSED)
def test_bodies_that_mujoco_refuses_are_errors(tmp_path, bodies, message):
    with refuses(message):
        pn.load(write(tmp_path, bodies=bodies))


def test_without_mujoco_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with refuses("pip install 'pin-nonideal[mjcf]'"):
        pn.load(write(tmp_path))


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


SHARED = """<default><geom density="500"/></default><worldbody><frame pos="0 0 1" euler="0 0 90">
    <body name="base"><joint name="first" axis="0 1 0"/><geom size="0.1" contype="0"
    conaffinity="0"/></body></frame>
    <replicate count="2" offset="1 0 0"><body name="arm" pos="0 1 0"><joint name="j" type="ball"/>
    <geom type="box" size="0.1 0.2 0.3" pos="0.2 0 0"/></body></replicate></worldbody>"""


def test_include_frame_replicate_and_several_sections_are_read_as_mujoco_reads_them(tmp_path):
    (tmp_path / "shared.xml").write_text(f"<mujocoinclude>{SHARED}</mujocoinclude>")
    tail = (
        '<worldbody><body name="late"><joint name="k"/><geom size="0.1" density="1000"/></body></worldbody>'
    )
    (tmp_path / "robot.xml").write_text(f'<mujoco><include file="shared.xml"/>{tail}</mujoco>')
    scene = pn.load(tmp_path / "robot.xml")
    assert list(scene.model.names)[1:] == ["first", "j0", "j1", "k"]
    masses = [scene.model.inertias[j].mass for j in range(1, 5)]
    ball, box = 4.0 / 3.0 * np.pi * 0.1**3, 0.2 * 0.4 * 0.6
    np.testing.assert_allclose(masses, [500 * ball, 500 * box, 500 * box, 1000 * ball], rtol=ROUNDING)


def test_keyframes_are_named_starts(tmp_path):
    tail = """<actuator><motor name="drive" joint="rod_joint"/></actuator><keyframe>
        <key name="home" qpos="0.5 0.1 0.2" qvel="1 2 3" ctrl="0.7"/></keyframe>"""
    file = write(tmp_path, tail=tail)
    scene = pn.load(file, q0="home")
    np.testing.assert_array_equal(scene.q0, [0.5, 0.1, 0.2])
    np.testing.assert_array_equal(scene.v0, [1, 2, 3])
    np.testing.assert_array_equal(scene.actuation.ctrl, [0.7])
    np.testing.assert_array_equal(pn.load(file).q0, [0.25, 0, 0])
    np.testing.assert_array_equal(pn.load(file, q0="home", ctrl={"drive": 0.2}).actuation.ctrl, [0.2])
    np.testing.assert_array_equal(pn.load(file, q0={"rod_joint": 0.4}).q0, [0.25, 0.4, 0])
    with refuses('load: q0: no reference configuration "hoem"; nearest: "home"', pn.UnknownNameError):
        pn.load(file, q0="hoem")
    with refuses('ctrl: no actuator "driv"; nearest: "drive"', pn.UnknownNameError):
        pn.load(file, ctrl={"driv": 1.0})
    with refuses("ctrl must have shape (1,); got shape (2,)", pn.InputError):
        pn.load(file, ctrl=[1.0, 2.0])


def test_controls_drive_a_run(tmp_path):
    """A motor's constant control is a constant torque; a function of time is heeded too."""
    body = '<body><joint name="j"/><inertial pos="0 0 0" mass="1" diaginertia="2 2 2"/></body>'
    tail = '<actuator><motor joint="j" gear="3" ctrlrange="-1 1"/></actuator>'
    file = write(tmp_path, bodies=body, tail=tail, head='<option gravity="0 0 0"/>')
    run = pn.simulate(pn.load(file, ctrl=[5.0]), 2.0)
    assert run.q[-1, 0] == pytest.approx(
        0.5 * (3.0 * 1.0 / 2.0) * 4.0, rel=1e-9
    )  # the control is cut off at 1
    run = pn.simulate(pn.load(file, ctrl=lambda t, q, v: [0.5 * t]), 2.0, rtol=1e-9, atol=1e-9)
    assert run.v[-1, 0] == pytest.approx(3.0 * 0.5 * 2.0**2 / 2.0 / 2.0, rel=1e-8)


ACTIVATIONS = {
    "filter": ('dyntype="filter" dynprm="0.5"', lambda t: 0.8 * (1.0 - np.exp(-t / 0.5))),
    "exact filter": ('dyntype="filterexact" dynprm="0.5"', lambda t: 0.8 * (1.0 - np.exp(-t / 0.5))),
    "integrator": ('dyntype="integrator" actlimited="true" actrange="-1 1"', lambda t: min(0.8 * t, 1.0)),
}


@pytest.mark.parametrize(("kind", "act"), ACTIVATIONS.values(), ids=ACTIVATIONS)
def test_activations_follow_a_constant_control(tmp_path, kind, act):
    tail = f'<actuator><general joint="rod_joint" gainprm="2" {kind}/></actuator>'
    file = write(tmp_path, tail=tail)
    scene = pn.load(file, ctrl=[0.8])
    for t in (0.0, 0.3, 2.0):
        tau = scene.actuation(t, scene.q0, scene.v0)
        np.testing.assert_allclose(tau, [0.0, 2.0 * act(t), 0.0], atol=ROUNDING)
    with refuses("ctrl must be constant for actuators with an activation", pn.InputError):
        pn.load(file, ctrl=lambda t, q, v: [1.0])


def test_a_name_that_body_joint_and_site_share_means_the_body(tmp_path):
    inside = '<joint name="arm" pos="0 0 1"/><geom size="0.1"/><site name="arm" pos="1 0 0"/>'
    model = pn.load(write(tmp_path, bodies=f'<body name="arm" pos="0 0 0">{inside}</body>')).model
    scene = pn.Scene(model, constraints=[pn.PointAnchor("arm", "universe", axes="z")])
    frame = model.frames[scene.anchor_frames[0][1]]
    assert (frame.type, frame.parentJoint) == (pin.FrameType.BODY, 1)
    np.testing.assert_array_equal(frame.placement.translation, [0, 0, -1])


def test_missing_mesh_is_a_note_where_the_mass_is_known(tmp_path):
    head = '<asset><mesh name="hull" file="hull.stl"/></asset>'
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    bodies = f'<body name="a"><joint name="j"/>{inertial}<geom type="mesh" mesh="hull"/></body>'
    scene = pn.load(write(tmp_path, bodies=bodies, head=head))
    assert 'mesh "hull.stl" was not found; its shape is left out' in scene.notes
    with refuses('body "a" has its mass from mesh "hull.stl", which was not found'):
        pn.load(write(tmp_path, bodies=bodies.replace(inertial, ""), head=head))


TETRAHEDRON = """v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


def test_meshes_are_read_when_a_replay_asks_for_them(tmp_path):
    (tmp_path / "hull.obj").write_text(TETRAHEDRON)
    head = '<asset><mesh name="hull" file="hull.obj"/></asset>'
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    bodies = f"""<geom name="floor" type="plane" size="0 0 1"/><body name="a" pos="0 0 2"><joint name="j"/>
        {inertial}<geom name="skin" type="mesh" mesh="hull" rgba="1 0 0 1"/>
        <geom name="hidden" size="0.1" group="3"/></body>"""
    scene = pn.load(write(tmp_path, bodies=bodies, head=head))
    shapes = {item.name: item for item in scene.visual_model.geometryObjects}
    assert sorted(shapes) == ["floor", "skin"]
    np.testing.assert_array_equal(shapes["skin"].meshColor, [1, 0, 0, 1])
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, scene.q0)
    place = data.oMi[1] * shapes["skin"].placement
    corners = [place.act(corner) for corner in shapes["skin"].geometry.vertices()]
    expected = np.array([[0, 0, 2], [1, 0, 2], [0, 1, 2], [0, 0, 3]])
    assert all(
        min(np.linalg.norm(c - e) for c in corners) < 1e-6 for e in expected
    )  # meshes are floats of 24 bits
    assert [(p.first, p.second) for p in scene.collision_model.collisionPairs] == [(0, 1), (0, 2)]
    assert scene.contact_friction["floor"] == (1.0, 0.005, 0.0001)


@pytest.mark.parametrize("through", ["", "include"])
def test_meshes_of_attached_models_are_found_in_their_own_folders(tmp_path, through):
    (tmp_path / "hand" / "shapes").mkdir(parents=True)
    (tmp_path / "hand" / "shapes" / "t.obj").write_text(TETRAHEDRON)
    body = '<body name="palm"><joint axis="1 0 0"/><geom type="mesh" mesh="t"/></body>'
    head = '<compiler meshdir="shapes"/><asset><mesh name="t" file="t.obj"/></asset>'
    text = f"<mujoco>{head}<worldbody>{body}</worldbody></mujoco>"
    (tmp_path / "hand" / "hand.xml").write_text(text)
    asset = '<asset><model name="hand" file="hand/hand.xml"/></asset>'
    (tmp_path / "parts.xml").write_text(f"<mujoco>{asset}</mujoco>")
    attached = '<frame pos="1 0 0"><attach model="hand" body="palm" prefix="left_"/></frame>'
    head = '<include file="parts.xml"/>' if through else asset
    scene = pn.load(write(tmp_path, bodies=CRANK + attached, head=head))
    assert [scene.model.inertias[3].mass] == pytest.approx([1000.0 / 6.0])
    assert scene.visual_model.ngeoms == 3
    assert not any("not found" in note for note in scene.notes)


def test_what_makes_a_body_float_is_said_in_the_words_of_the_file(tmp_path):
    scene = pn.load(write(tmp_path, bodies='<body><geom size="0.1"/></body>'))
    assert "nothing moves: give a body a <freejoint/>" in scene.notes


def test_mass_of_meshes_is_mujocos(tmp_path):
    (tmp_path / "hull.obj").write_text(TETRAHEDRON)
    head = '<asset><mesh name="hull" file="hull.obj"/></asset>'
    bodies = (
        '<body name="a"><joint name="j"/><geom type="mesh" mesh="hull" contype="0" conaffinity="0"/></body>'
    )
    scene = pn.load(write(tmp_path, bodies=bodies, head=head))
    inertia = scene.model.inertias[1]
    assert inertia.mass == pytest.approx(1000.0 / 6.0, rel=1e-6)
    np.testing.assert_allclose(inertia.lever, [0.25, 0.25, 0.25], rtol=1e-6)


def test_the_mass_of_a_body_that_does_not_move_may_be_missing(tmp_path):
    head = '<asset><mesh name="hull" file="hull.stl"/></asset>'
    bodies = '<body name="table"><geom type="mesh" mesh="hull"/></body>'
    bodies += '<body name="a"><joint name="j"/><geom size="0.1" pos="1 0 0"/></body>'
    scene = pn.load(write(tmp_path, bodies=bodies, head=head))
    assert 'mesh "hull.stl" was not found; its shape is left out' in scene.notes
    with refuses('body "table" has its mass from mesh "hull.stl", which was not found'):
        pn.load(write(tmp_path, bodies=bodies, head=f'<compiler settotalmass="3"/>{head}'))


def test_a_mesh_without_mass_that_cannot_be_read_is_left_out_of_the_shapes(tmp_path):
    (tmp_path / "hull.stl").write_text("version https://git-lfs.github.com/spec/v1")
    (tmp_path / "good.obj").write_text(TETRAHEDRON)
    head = '<asset><mesh name="hull" file="hull.stl"/><mesh name="good" file="good.obj"/></asset>'
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    bodies = f"""<body name="a"><joint name="j"/>{inertial}<geom type="mesh" mesh="hull"/>
        <geom name="skin" type="mesh" mesh="good"/></body>"""
    scene = pn.load(write(tmp_path, bodies=bodies, head=head))
    assert [item.name for item in scene.visual_model.geometryObjects] == ["skin"]
    assert 'mesh "hull.stl" cannot be read; its shape is left out' in scene.notes
    with refuses("cannot be compiled by MuJoCo"):
        pn.load(write(tmp_path, bodies=bodies.replace(inertial, ""), head=head))


@pytest.mark.parametrize(
    ("joint", "field"), [('range="nan 1"', "jnt_range"), ('damping="nan"', "dof_damping")]
)
def test_numbers_that_are_none_are_refused_without_a_log(tmp_path, monkeypatch, capfd, joint, field):
    monkeypatch.chdir(tmp_path)
    bodies = f'<body name="a"><joint name="j" {joint}/><geom size="0.1" pos="1 0 0"/></body>'
    with refuses(f"must hold finite numbers; MuJoCo finds NaN in {field}"):
        pn.load(write(tmp_path, bodies=bodies))
    assert [path.suffix for path in tmp_path.iterdir()] == [".xml"]
    assert capfd.readouterr().err == ""


def test_only_pairs_that_mujoco_lets_collide_are_told(tmp_path):
    inside = (
        '<body name="b"><joint/><geom size="0.1"/><body name="c"><joint/><geom size="0.1"/></body></body>'
    )
    bodies = f'<body name="a"><joint name="j"/><geom size="0.1"/>{inside}</body>'
    exclude = '<contact><exclude body1="a" body2="c"/></contact>'

    def told(text, option=""):
        path = write(tmp_path, bodies=bodies, head=option)
        path.write_text(path.read_text().replace("</mujoco>", f"{text}</mujoco>"))
        return [note.split(" are")[0] for note in pn.load(path).notes if "contacts between" in note]

    assert told("") == ["contacts between geoms (1 pairs)"]
    assert told(exclude) == []
    everything = '<option><flag filterparent="disable"/></option>'
    assert told("", everything) == ["contacts between geoms (3 pairs)"]


@pytest.mark.parametrize("answer", [[1.0, 2.0, 3.0], None, [float("nan")]])
def test_controls_that_do_not_fit_are_said_as_they_came(tmp_path, answer):
    file = write(tmp_path, bodies='<body name="a"><joint name="j"/><geom size="0.1" pos="1 0 0"/></body>')
    file.write_text(file.read_text().replace("</mujoco>", '<actuator><motor joint="j"/></actuator></mujoco>'))
    scene = pn.load(file, ctrl=lambda t, q, v: answer)
    with refuses(f"ctrl must return 1 finite numbers; got {answer!r}", pn.UserFunctionError):
        scene.solve(*scene.initial_state())
