"""URDF files: elements that Pinocchio's reader ignores become an error, a note, a law or a constraint."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import LoadingError

from ..support.refusals import refuses
from ..support.small_robots import ARM, DATA, folder, joint, link, robot


def test_link_with_two_parents_explains_robot_yaml(tmp_path):
    text = robot(*ARM, joint("second", "base", "lower"))
    with refuses(
        'link "lower" has two parents, joints "elbow" and "second", but URDF holds trees only.'
    ) as caught:
        pn.load(folder(tmp_path, urdf=text))
    assert "closed_loop: [[frame_A, frame_B]]" in str(caught.value)


URDF_REFUSED = {
    "two roots": (
        robot(*ARM, link("lost")),
        'must have one root link; got 2: "base", "lost"; join them with fixed',
    ),
    "ring": (
        robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
        "must have a root link",
    ),
    "ring beside a tree": (
        robot(*ARM, link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
        "form a ring without a root",
    ),
    "no link": (robot(), "must hold at least one <link>; got none"),
    "twice the same link": (robot(*ARM, link("upper")), 'link names must be unique; "upper" appears 2 times'),
    "twice the same joint": (
        robot(*ARM, link("x"), joint("elbow", "base", "x")),
        'joint names must be unique; "elbow" appears 2 times',
    ),
    "unknown link": (
        robot(*ARM, joint("j", "uper", "x"), link("x")),
        'no link "uper", the parent of joint "j"; nearest: "upper"',
    ),
    "joint without child": (
        robot(*ARM, '<joint name="j" type="fixed"><parent link="base"/></joint>'),
        'joint "j" must name its child link',
    ),
    "link without name": (robot("<link/>"), "every <link> must have a name; one has none"),
    "unknown joint type": (
        robot(*ARM, link("x"), joint("j", "base", "x", kind="ball")),
        'joint "j": type must be one of revolute, continuous, prismatic, floating, planar, fixed; got "ball"',
    ),
    "axis without direction": (
        robot(*ARM, link("x"), joint("j", "base", "x", axis="0 0 0")),
        'joint "j": axis must have a direction; got 0 0 0',
    ),
    "negative damping": (
        robot(*ARM, link("x"), joint("j", "base", "x", inside='<dynamics damping="-1"/>')),
        'joint "j": damping must not be negative; got -1',
    ),
    "negative mass": (
        robot(*ARM, link("x", mass=-2.0), joint("j", "base", "x")),
        'link "x": mass must not be negative; got -2 kg',
    ),
    "negative inertia": (
        robot(*ARM, link("x", inertia=-0.1), joint("j", "base", "x")),
        'link "x": principal moments of inertia must not be negative; got -0.1 kg m^2',
    ),
    "mass nan": (
        robot(*ARM, link("x", mass="nan"), joint("j", "base", "x")),
        'value must be finite; got "nan"',
    ),
    "mass with an underscore": (
        robot(*ARM, link("x", mass="1_3"), joint("j", "base", "x")),
        'value must hold numbers; got "1_3"',
    ),
    "mass in other digits": (
        robot(*ARM, link("x", mass="\u0661"), joint("j", "base", "x")),
        'value must hold numbers; got "\u0661"',
    ),
    "mass a word": (
        robot(*ARM, link("x", mass="heavy"), joint("j", "base", "x")),
        'value must hold numbers; got "heavy"',
    ),
    "origin of two numbers": (
        robot(*ARM, link("x"), joint("j", "base", "x", xyz="1 2")),
        'xyz must hold 3 numbers; got "1 2"',
    ),
    "inertial without mass": (
        robot(*ARM, '<link name="x"><inertial><mass/><inertia/></inertial></link>', joint("j", "base", "x")),
        'link "x": value is missing in <mass>',
    ),
    "inertial without inertia": (
        robot(*ARM, '<link name="x"><inertial><mass value="1"/></inertial></link>', joint("j", "base", "x")),
        'link "x": <inertial> must hold <mass> and <inertia>',
    ),
    "shape without size": (
        robot(
            *ARM, link("x", inside="<visual><geometry><sphere/></geometry></visual>"), joint("j", "base", "x")
        ),
        'link "x": radius is missing in <sphere>',
    ),
    "shape of negative size": (
        robot(
            *ARM,
            link("x", inside='<visual><geometry><box size="1 -1 1"/></geometry></visual>'),
            joint("j", "base", "x"),
        ),
        'link "x": size of <box> must be positive; got "1 -1 1"',
    ),
    "unknown shape": (
        robot(
            *ARM, link("x", inside="<visual><geometry><cone/></geometry></visual>"), joint("j", "base", "x")
        ),
        'link "x": <geometry> must hold one of box, cylinder, capsule, sphere, mesh; got <cone>',
    ),
    "mimic of nothing": (
        robot(*ARM, link("x"), joint("j", "base", "x", inside='<mimic joint="elbo"/>')),
        'mimics joint "elbo", which does not exist; nearest: "elbow"',
    ),
    "mimic of itself": (
        robot(*ARM, link("x"), joint("j", "base", "x", inside='<mimic joint="j"/>')),
        "must mimic another joint; it mimics itself",
    ),
    "joint of the ground": (
        robot(*ARM, link("x"), joint("universe", "base", "x")),
        'no joint may have the name "universe", which Pinocchio uses for the world or for the',
    ),
    "another root element": ("<sdf/>", "must have the root element <robot>; got <sdf>"),
    "entities": (
        '<!DOCTYPE r [<!ENTITY a "b">]>' + robot(*ARM),
        "must not declare a DOCTYPE or entities; remove them",
    ),
    "empty": ("", "is truncated or not XML"),
}


@pytest.mark.parametrize(("text", "message"), URDF_REFUSED.values(), ids=URDF_REFUSED)
def test_malformed_urdf_is_refused(tmp_path, text, message):
    with refuses(message):
        pn.load(folder(tmp_path, urdf=text))


def test_a_joint_must_not_have_the_name_of_the_floating_base(tmp_path):
    path = folder(tmp_path, urdf=robot(*ARM, link("x"), joint("root_joint", "base", "x")))
    assert "root_joint" in pn.load(path).model.names
    with refuses('no joint may have the name "root_joint"'):
        pn.load(path, free_flyer=True)


def test_truncated_urdf_never_loads(tmp_path):
    text = (DATA / "digit_like" / "robot.urdf").read_text().rstrip()
    path = tmp_path / "robot.urdf"
    for end in np.linspace(0, len(text) - 1, 40).astype(int):
        path.write_text(text[:end])
        with pytest.raises(LoadingError, match=r"truncated or not XML|must have the root element"):
            pn.load(path)


def test_binary_file_is_refused(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_bytes(b"\xff\xfe\x00robot")
    with refuses("must be a text file in UTF-8"):
        pn.load(path)


def test_dynamics_tags_become_laws(tmp_path):
    text = robot(*ARM, link("x"), joint("j", "base", "x", inside='<dynamics damping="0.3" friction="0.2"/>'))
    scene = pn.load(folder(tmp_path, urdf=text))
    assert [(w.joint, w.viscous, w.coulomb) for w in scene.laws] == [("j", 0.3, 0.2)]


@pytest.mark.parametrize(("kind", "slides"), [("planar", 2), ("floating", 3)])
def test_dynamics_tags_of_joints_that_slide_and_turn(tmp_path, kind, slides):
    """Each velocity takes the number in its own unit: m v' = -f - d v and J w' = -f - d w."""
    mass, inertia, d, f, t = 2.0, 0.5, 0.3, 0.2, 0.7
    tag = f'<dynamics damping="{d}" friction="{f}"/>'
    text = robot(
        '<link name="base"/>',
        link("x", mass=mass, inertia=inertia),
        joint("j", "base", "x", kind, inside=tag),
    )
    scene = pn.load(folder(tmp_path, "gravity: [0, 0, 0]", text))
    note = (
        'joint "j" slides and turns: damping 0.3 of the robot\'s file is taken in N s/m and N m s/rad, '
        "friction 0.2 in N and N m"
    )
    assert note in scene.notes
    v = np.zeros(scene.model.nv)
    v[1], v[-1] = 1.5, -2.0
    run = pn.simulate(scene, t, v=v, rtol=1e-11, atol=1e-12)
    left = [(abs(x) + f / d) * np.exp(-d * t / m) - f / d for x, m in ((v[1], mass), (v[-1], inertia))]
    assert np.linalg.norm(run.v[-1, :slides]) == pytest.approx(left[0], rel=1e-9)
    assert run.v[-1, -1] == pytest.approx(-left[1], rel=1e-9)


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_law_of_robot_yaml_replaces_the_tags_of_such_joints(tmp_path, kind):
    tag = '<dynamics damping="0.3" friction="0.2"/>'
    text = robot('<link name="base"/>', link("x"), joint("j", "base", "x", kind, inside=tag))
    scene = pn.load(folder(tmp_path, "laws:\n  - JointFriction: {joint: j, viscous: 1.0}\n", text))
    assert [(w.joint, w.viscous, w.coulomb, w.radius) for w in scene.laws] == [("j", 1.0, 0.0, 0.0)]
    assert any("laws given replace the damping and friction" in note for note in scene.notes)


def test_mimic_joints_hand_their_friction_to_the_leader(tmp_path):
    rubbing = '<mimic joint="elbow" multiplier="-2"/><dynamics damping="0.3" friction="0.2"/>'
    follower = '<mimic joint="j"/><dynamics damping="0.5"/>'
    text = robot(
        *ARM,
        link("x"),
        joint("j", "base", "x", inside=rubbing),
        link("y"),
        joint("k", "base", "y", inside=follower),
    )
    (law,) = pn.load(folder(tmp_path, urdf=text)).laws
    # Power: 0.3 (2 v)^2 + 0.5 (2 v)^2 and 0.2 |2 v| at an elbow speed v.
    assert (law.joint, law.viscous, law.coulomb) == ("elbow", pytest.approx(3.2), pytest.approx(0.4))


def test_a_law_of_robot_yaml_replaces_the_tags_and_says_so(tmp_path):
    text = robot(*ARM, link("x"), joint("j", "base", "x", inside='<dynamics damping="0.3" friction="0.2"/>'))
    scene = pn.load(folder(tmp_path, "laws:\n  - JointFriction: {joint: j, viscous: 1.0}\n", text))
    assert [(w.joint, w.viscous, w.coulomb) for w in scene.laws] == [("j", 1.0, 0.0)]
    assert any("laws given replace the damping and friction" in note for note in scene.notes)


def test_mimic_joints_become_couplings(tmp_path):
    mimic = '<mimic joint="elbow" multiplier="-2" offset="0.5"/>'
    held = '<mimic joint="elbow" multiplier="0" offset="0.25"/>'
    text = robot(
        *ARM,
        link("x"),
        joint("j", "base", "x", inside=mimic),
        link("y"),
        joint("k", "base", "y", inside=held),
    )
    found = {c.name: c for c in pn.load(folder(tmp_path, urdf=text)).constraints}
    coupling = found["j mimic"]
    assert (coupling.joint1, coupling.joint2, coupling.ratio, coupling.offset) == ("j", "elbow", -2.0, 0.5)
    assert found["k mimic"].function(1.0) == (0.25, 0.0, 0.0)


def test_missing_and_broken_meshes_are_notes(tmp_path):
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    shapes = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        for name in ("package:///lost.stl", "package://x/broken.stl", "meshes/away.dae")
    )
    text = robot(
        *ARM, link("x", inside=shapes + '<visual><geometry><sphere radius="1"/></geometry></visual>')
    )
    text = text.replace("</robot>", joint("j", "base", "x") + "</robot>")
    scene = pn.load(folder(tmp_path, urdf=text))
    assert len(scene.visual_model.geometryObjects) == 1
    assert 'mesh "package:///lost.stl" was not found; its shape is left out' in scene.notes
    assert 'mesh "meshes/away.dae" was not found; its shape is left out' in scene.notes
    assert any("broken.stl" in n and "cannot be read; its shape is left out" in n for n in scene.notes)


TRIANGLE = """solid s
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid s
"""


@pytest.mark.parametrize(
    "where", ["package:///t.stl", "package://arm/t.stl", "t.stl", "package://arm/meshes/u.stl"]
)
def test_meshes_are_found_in_the_folder(tmp_path, where):
    home = tmp_path / "arm"
    (home / "meshes").mkdir(parents=True)
    (home / "t.stl").write_text(TRIANGLE)
    (home / "meshes" / "u.stl").write_text(TRIANGLE)
    shape = f'<visual><geometry><mesh filename="{where}"/></geometry></visual>'
    text = robot(*ARM, link("x", inside=shape), joint("j", "base", "x"))
    scene = pn.load(folder(home, urdf=text))
    assert Path(scene.visual_model.geometryObjects[0].meshPath).is_relative_to(home)
    assert not any("mesh" in note for note in scene.notes)


def test_meshes_are_found_in_package_folders(tmp_path):
    (tmp_path / "packages" / "arm").mkdir(parents=True)
    (tmp_path / "packages" / "arm" / "t.stl").write_text(TRIANGLE)
    home = tmp_path / "home"
    home.mkdir()
    shape = '<visual><geometry><mesh filename="package://arm/t.stl"/></geometry></visual>'
    text = robot(*ARM, link("x", inside=shape), joint("j", "base", "x"))
    assert len(pn.load(folder(home, urdf=text)).visual_model.geometryObjects) == 0
    scene = pn.load(home, package_dirs=[tmp_path / "packages"])
    assert len(scene.visual_model.geometryObjects) == 1


def test_the_next_robot_of_the_same_files_is_read_no_more(tmp_path, monkeypatch):
    """The second robot has a separate model and separate shapes, and changed content is read again."""
    (tmp_path / "t.stl").write_text(TRIANGLE)
    inside = '<visual><geometry><mesh filename="t.stl"/></geometry></visual>'
    text = robot(*ARM, link("x", inside=inside), joint("j", "base", "x"))
    first = pn.load(folder(tmp_path, urdf=text))
    places = [g.placement.copy() for g in first.visual_model.geometryObjects]
    first.model.inertias[1].mass = 77.0
    first.visual_model.geometryObjects[0].placement = pin.SE3.Random()
    reads = []
    read_shapes, read_model = pin.buildGeomFromUrdfString, pin.buildModelFromXML
    monkeypatch.setattr(pin, "buildGeomFromUrdfString", lambda *a: reads.append("mesh") or read_shapes(*a))
    monkeypatch.setattr(pin, "buildModelFromXML", lambda *a: reads.append("model") or read_model(*a))
    again = pn.load(tmp_path)
    assert again.model.inertias[1].mass != 77.0
    assert again.visual_model.geometryObjects[0].placement == places[0]
    assert reads == []
    (tmp_path / "t.stl").write_text(TRIANGLE.replace("1 0 0", "2 0 0"))
    wider = pn.load(tmp_path).visual_model.geometryObjects[0].geometry
    assert wider.vertices().max() == 2.0
    assert reads == ["mesh"]
    (tmp_path / "robot.urdf").write_text(text.replace('name="j"', 'name="k"'))
    assert "k" in list(pn.load(tmp_path).model.names)
    assert reads == ["mesh", "model"]


def shape(kind, attributes, inside=""):
    return f"<visual><geometry><{kind} {attributes}/></geometry>{inside}</visual>"


COSMETIC = {
    "material without name": (link("x", inside=shape("sphere", 'radius="1"', "<material/>")), None),
    "material without definition": (
        link("x", inside=shape("sphere", 'radius="1"', '<material name="gold"/>')),
        'materials that are not defined are left out: "gold"',
    ),
    "color of two numbers": (
        link("x") + '<material name="dim"><color rgba="0.5 0.5"/></material>',
        'colors that are not four numbers from 0 to 1 are left out, of materials "dim"',
    ),
    "color of three numbers": (
        link("x") + '<material name="red"><color rgba="1 0 0"/></material>',
        None,
    ),
    "color that is no number": (
        link("x") + '<material name="dim"><color rgba="dark red"/></material>',
        'colors that are not four numbers from 0 to 1 are left out, of materials "dim"',
    ),
    "shape of nothing": (
        link("x", inside="<visual/>"),
        'shapes of size zero are left out, in links "x"',
    ),
    "attribute of another tool": (link("x").replace('name="x"', 'name="x" gz:layer="2"'), None),
    "shape of size zero": (
        link("x", inside=shape("box", 'size="0 0 0"')),
        'shapes of size zero are left out, in links "x"',
    ),
    "inertia negative by rounding": (
        link("x").replace('ixx="0.1"', 'ixx="-2.4e-35"'),
        'moments of inertia that rounding makes negative are zero, of links "x"',
    ),
    "tag of another tool": (
        link("x") + "<gazebo><speed>3</speed></gazebo>",
        "elements of other tools are not read: <gazebo>",
    ),
    "unbound prefix": (
        link("x", inside='<xacro:note who="me"/>') + "<drake:thing/>",
        "elements of other tools are not read: <thing>, <note>",
    ),
    "scale of one number": (link("x"), None),
}


@pytest.mark.parametrize(("text", "note"), COSMETIC.values(), ids=COSMETIC)
def test_cosmetics_are_notes(tmp_path, text, note):
    file = robot(*ARM, text, joint("j", "base", "x", xyz="0 0.3 0"))
    scene = pn.load(folder(tmp_path, urdf=file))
    assert scene.model.nv == 3
    if note is not None:
        assert note in scene.notes
    assert scene.visual_model.ngeoms <= 1


LIMITS = {
    "none": ('<limit effort="1" velocity="1" lower="-3" upper="3"/>', ""),
    "without effort": ('effort="1"', ""),
    "negative effort": ('effort="1"', 'effort="-1"'),
    "reversed": ('lower="-3" upper="3"', 'lower="3" upper="-3"'),
    "infinite": ('effort="1"', 'effort="inf"'),
}


@pytest.mark.parametrize(("old", "new"), LIMITS.values(), ids=LIMITS)
def test_limits_are_corrected(tmp_path, old, new):
    text = robot(*ARM, link("x"), joint("j", "base", "x").replace(old, new))
    scene = pn.load(folder(tmp_path, urdf=text))
    assert (
        'limits that are infinite, missing, negative or reversed are corrected, of joints "j"' in scene.notes
    )


BARE = (
    '<link name="x"><collision><origin xyz="0.1 0.2 0.3" rpy="0.2 0.1 0.3"/><geometry>{}</geometry>'
    "</collision></link>"
)


def test_links_without_inertia_take_that_of_their_shapes_when_a_density_is_given(tmp_path):
    text = robot(*ARM, BARE.format('<box size="0.1 0.2 0.3"/>'), joint("j", "base", "x"))
    with refuses(
        "load(..., density=1000.0) computes the inertia of such links from their shapes", pn.SingularMassError
    ):
        bare = robot(ARM[0], BARE.format('<box size="0.1 0.2 0.3"/>'), joint("j", "base", "x"))
        pn.load(folder(tmp_path, urdf=bare))
    scene = pn.load(folder(tmp_path, urdf=text), density=500.0)
    inertia = scene.model.inertias[scene.model.getJointId("j")]
    mass = 500.0 * 0.1 * 0.2 * 0.3
    assert inertia.mass == pytest.approx(mass, rel=1e-14)
    np.testing.assert_allclose(inertia.lever, [0.1, 0.2, 0.3], atol=1e-15)
    squares = np.array([0.1, 0.2, 0.3]) ** 2
    principal = mass / 12.0 * (squares.sum() - squares)
    np.testing.assert_allclose(np.linalg.eigvalsh(inertia.inertia), np.sort(principal), rtol=1e-12)
    assert 'inertias of links "x" are those of their shapes at 500 kg/m^3' in scene.notes
    with refuses("density must be positive; got -1", pn.InputError):
        pn.load(tmp_path, density=-1.0)


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]  # of a tetrahedron, counterclockwise from outside


def obj(corners, faces):
    lines = ["v " + " ".join(map(str, corner)) for corner in corners]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in face) for face in faces)])


def with_density(path, geometry):
    text = robot(*ARM, BARE.format(geometry), joint("j", "base", "x"))
    return pn.load(folder(path, urdf=text), density=1000.0)


def test_a_sphere_has_the_mass_of_its_volume(tmp_path):
    model = with_density(tmp_path, '<sphere radius="0.2"/>').model
    inertia = model.inertias[model.getJointId("j")]
    mass = 1000.0 * 4.0 / 3.0 * np.pi * 0.2**3
    assert inertia.mass == pytest.approx(mass, rel=1e-14)
    np.testing.assert_allclose(inertia.inertia, 0.4 * mass * 0.04 * np.eye(3), atol=1e-12 * mass)


@pytest.mark.parametrize("turned", [False, True])
def test_a_closed_mesh_has_the_mass_of_its_volume(tmp_path, turned):
    """A tetrahedron of edges 1, 1, 2 from its corner: volume 1/3, center (1/4, 1/4, 1/2), either way out."""
    faces = [face[::-1] for face in FACES] if turned else FACES
    (tmp_path / "wedge.obj").write_text(obj(CORNERS, faces))
    scene = with_density(tmp_path, '<mesh filename="wedge.obj" scale="1 1 2"/>')
    inertia = scene.model.inertias[scene.model.getJointId("j")]
    assert inertia.mass == pytest.approx(1000.0 / 3.0, rel=1e-12)
    place = pin.SE3(pin.rpy.rpyToMatrix(0.2, 0.1, 0.3), np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(inertia.lever, place.act(np.array([0.25, 0.25, 0.5])), atol=1e-12)
    assert not any("bounding boxes" in note for note in scene.notes)


def test_an_open_mesh_has_the_mass_of_its_box(tmp_path):
    (tmp_path / "sheet.obj").write_text(obj(CORNERS, FACES[:3]))
    scene = with_density(tmp_path, '<mesh filename="sheet.obj" scale="0.1 0.2 0.3"/>')
    inertia = scene.model.inertias[scene.model.getJointId("j")]
    assert inertia.mass == pytest.approx(1000.0 * 0.006, rel=1e-12)
    moments = np.linalg.eigvalsh(inertia.inertia)
    np.testing.assert_allclose(moments, 6.0 / 12.0 * np.array([0.05, 0.10, 0.13]), rtol=1e-12)
    assert 'meshes that are not closed count as their bounding boxes, in links "x"' in scene.notes


def test_infinite_bounds_are_none(tmp_path):
    endless = joint("j", "base", "x", limits='lower="-inf" upper="Infinity"')
    scene = pn.load(folder(tmp_path, urdf=robot(*ARM, link("x"), endless)), limits=True)
    assert {c.joint for c in scene.contacts} == {"shoulder", "elbow"}


def test_inertias_that_no_body_has_are_told(tmp_path):
    text = link("x").replace('izz="0.1"', 'izz="0.3"')
    scene = pn.load(folder(tmp_path, urdf=robot(*ARM, text, joint("j", "base", "x"))))
    (note,) = (note for note in scene.notes if "inertias" in note)
    assert note.startswith('physically impossible inertias are used unchanged, of links "x": their largest')
    assert scene.model.inertias[scene.model.getJointId("j")].inertia[2, 2] == 0.3


def test_joints_that_move_nothing_are_fixed(tmp_path):
    text = robot(*ARM, '<link name="tip"/>', joint("wrist", "lower", "tip"))
    scene = pn.load(folder(tmp_path, urdf=text))
    assert list(scene.model.names)[1:] == ["shoulder", "elbow"]
    assert 'joints that move no inertia are fixed: "wrist"' in scene.notes
    held = folder(tmp_path, "constraints: [{PointAnchor: {frame1: tip}}]", text)
    with refuses('joint "wrist" moves no inertia', pn.SingularMassError):
        pn.load(held)


def test_a_floating_base_is_proposed_when_nothing_moves(tmp_path):
    scene = pn.load(folder(tmp_path, urdf=robot(link("base"))))
    assert "nothing moves: load(..., free_flyer=True) gives the root link a floating base" in scene.notes
    assert pn.load(tmp_path, free_flyer=True).model.nv == 6


def test_packages_are_found_as_ros_finds_them(tmp_path, monkeypatch):
    mesh = tmp_path / "prefix" / "share" / "arm_meshes" / "hull.stl"
    mesh.parent.mkdir(parents=True)
    corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0"
    mesh.write_text(f"solid a\nfacet normal 0 0 1\nouter loop\n{corners}\nendloop\nendfacet\nendsolid a\n")
    inside = shape("mesh", 'filename="package://arm_meshes/hull.stl" scale=".00254"')
    text = robot(*ARM, link("x", inside=inside), joint("j", "base", "x"))
    missing = pn.load(folder(tmp_path, urdf=text))
    assert 'mesh "package://arm_meshes/hull.stl" was not found; its shape is left out' in missing.notes
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "prefix"))
    (item,) = pn.load(tmp_path).visual_model.geometryObjects
    np.testing.assert_allclose(item.meshScale, [0.00254] * 3)
    monkeypatch.delenv("AMENT_PREFIX_PATH")
    home = tmp_path / "checkout"  # a package of another name than its folder
    (home / "urdf").mkdir(parents=True)
    (home / "package.xml").write_text("<package><name>arm_meshes</name></package>")
    (home / "hull.stl").write_text(mesh.read_text())
    (home / "urdf" / "arm.urdf").write_text(text)
    assert pn.load(home / "urdf" / "arm.urdf").visual_model.ngeoms == 1


XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="length" value="0.4"/>
  <xacro:macro name="bar" params="name mass">
    <link name="${name}">
      <inertial>
        <origin xyz="${length/2} 0 0"/><mass value="${mass}"/>
        <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
      </inertial>
    </link>
  </xacro:macro>
  <link name="ground"/>
  <xacro:bar name="upper" mass="${2*0.5}"/>
  <xacro:bar name="lower" mass="0.5"/>
  <joint name="shoulder" type="continuous">
    <parent link="ground"/><child link="upper"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/><origin xyz="${length} 0 0"/>
  </joint>
</robot>"""


def test_xacro_is_expanded(tmp_path):
    (tmp_path / "arm.urdf.xacro").write_text(XACRO)
    model = pn.load(tmp_path / "arm.urdf.xacro").model
    assert [inertia.mass for inertia in model.inertias][1:] == [1.0, 0.5]
    assert model.jointPlacements[2].translation[0] == 0.4
    (tmp_path / "wrong.urdf.xacro").write_text(XACRO.replace("2*0.5", "2*weight"))
    with refuses("cannot be expanded by xacro: name 'weight' is not defined"):
        pn.load(tmp_path / "wrong.urdf.xacro")


@pytest.mark.parametrize("place", ["arm_parts", "arm", "x/arm_parts"])
def test_xacro_finds_packages_without_ros(tmp_path, place):
    """Packages are found beside the robot, above its file and in `package_dirs`, also nested."""
    home, parts = tmp_path / "arm" / "urdf", tmp_path / place
    head, tail = XACRO.split('  <link name="ground"/>')
    home.mkdir(parents=True)
    (parts / "macros").mkdir(parents=True)
    if place == "arm":
        (parts / "package.xml").write_text("<package><name>arm_parts</name></package>")
    opening = head.split(">")[0] + ">"
    include = f'{opening}<xacro:include filename="$(find arm_parts)/macros/{{}}.xacro"/>'
    (parts / "macros" / "all.xacro").write_text(f"{include.format('bar')}</robot>")
    (parts / "macros" / "bar.xacro").write_text(f"{head}</robot>")
    (home / "arm.urdf.xacro").write_text(f'{include.format("all")}<link name="ground"/>{tail}')
    (home / "lost.urdf.xacro").write_text(f"{include.format('all').replace('arm_parts', 'lost')}</robot>")
    model = pn.load(home / "arm.urdf.xacro", package_dirs=[tmp_path / "x"]).model
    assert model.jointPlacements[2].translation[0] == 0.4
    with refuses("cannot be expanded by xacro"):
        pn.load(home / "lost.urdf.xacro")


def test_xacro_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "arm.urdf.xacro").write_text(robot(*ARM))
    monkeypatch.setitem(sys.modules, "xacro", None)
    with refuses("must be expanded by xacro, which cannot be imported; pip install xacro"):
        pn.load(tmp_path / "arm.urdf.xacro")
