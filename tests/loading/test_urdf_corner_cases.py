"""URDF files in practice: broken mesh paths, elements of other tools, and notes about them."""

from __future__ import annotations

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.refusals import refuses
from ..support.small_robots import ARM, folder, joint, link, robot

CORNERS = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0"
STL = f"solid a\nfacet normal 0 0 1\nouter loop\n{CORNERS}\nendloop\nendfacet\nendsolid a\n"


def shown(filename):
    return f'<visual><geometry><mesh filename="{filename}"/></geometry></visual>'


def write_meshes(folder, *names):
    for name in names:
        path = folder / "meshes" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(STL)


def load_with(home, filename):
    (home / "urdf").mkdir(parents=True, exist_ok=True)
    (home / "urdf" / "arm.urdf").write_text(
        robot(*ARM, link("x", inside=shown(filename)), joint("j", "base", "x"))
    )
    return pn.load(home / "urdf" / "arm.urdf")


BROKEN = (
    "package://visual/link.stl",
    "package:///visual/link.stl",
    "package://another_name/meshes/visual/link.stl",
    "file:///home/someone/ws/arm/meshes/visual/link.stl",
    "C:\\Users\\someone\\arm\\meshes\\visual\\link.stl",
    "../../meshes/arm/visual/link.stl",
)


@pytest.mark.parametrize("filename", BROKEN)
def test_a_mesh_of_a_broken_path_is_found_by_its_ending(tmp_path, filename):
    write_meshes(tmp_path / "arm", "v2/visual/link.stl", "v2/collision/link.stl")
    scene = load_with(tmp_path / "arm", filename)
    found = tmp_path / "arm" / "meshes" / "v2" / "visual" / "link.stl"
    assert [g.meshPath for g in scene.visual_model.geometryObjects] == [str(found)]
    (note,) = (note for note in scene.notes if "mesh" in note)
    assert note.startswith(
        f'paths of meshes "{filename}" do not exist; the only files with the same end below a folder'
    )
    assert note.endswith(f'"meshes" are used, such as "{found}"')


@pytest.mark.parametrize(
    "names", [("a/visual/link.stl", "b/visual/link.stl"), ("a/link.stl", "b/link.stl"), ("other.stl",)]
)
def test_a_mesh_whose_ending_is_not_the_only_one_is_missing(tmp_path, names):
    write_meshes(tmp_path / "arm", *names)
    scene = load_with(tmp_path / "arm", "package://visual/link.stl")
    assert scene.visual_model.ngeoms == 0
    assert 'mesh "package://visual/link.stl" was not found; its shape is left out' in scene.notes


def test_a_whole_path_is_never_told(tmp_path):
    write_meshes(tmp_path / "arm", "link.stl", "old/link.stl")
    scene = load_with(tmp_path / "arm", "package://arm/meshes/link.stl")
    (item,) = scene.visual_model.geometryObjects
    assert Path(item.meshPath) == tmp_path / "arm" / "meshes" / "link.stl"
    assert not any("mesh" in note for note in scene.notes)


def test_a_mesh_of_a_broken_path_is_looked_for_in_its_own_package_first(tmp_path):
    write_meshes(tmp_path / "arm", "link.stl")
    write_meshes(tmp_path / "hand", "deep/link.stl")
    (item,) = load_with(tmp_path / "arm", "package://hand/link.stl").visual_model.geometryObjects
    assert Path(item.meshPath) == tmp_path / "hand" / "meshes" / "deep" / "link.stl"


def test_a_mesh_that_comes_later_is_found(tmp_path):
    write_meshes(tmp_path / "arm", "other.stl")
    assert load_with(tmp_path / "arm", "package://visual/link.stl").visual_model.ngeoms == 0
    write_meshes(tmp_path / "arm", "visual/link.stl")
    assert load_with(tmp_path / "arm", "package://visual/link.stl").visual_model.ngeoms == 1


def test_the_world_need_not_be_declared(tmp_path):
    parts = [link("base"), joint("mount", "world", "base", kind="fixed", xyz="0 0 2"), *ARM[1:]]
    scene = pn.load(folder(tmp_path, urdf=robot(*parts)))
    assert 'link "world", a parent of joints, is not declared; it is added without inertia' in scene.notes
    assert scene.model.jointPlacements[1].translation[2] == 2.0
    with refuses('no link "wrld", the parent of joint "mount"'):
        pn.load(folder(tmp_path, urdf=robot(*parts).replace('"world"', '"wrld"')))


def test_what_stands_beside_a_shape_is_told(tmp_path):
    inside = '<collision><geometry><box size="1 1 1"/><origin xyz="0 0 1"/></geometry></collision>'
    scene = pn.load(folder(tmp_path, urdf=robot(*ARM, link("x", inside=inside), joint("j", "base", "x"))))
    assert 'elements beside the shape of a <geometry> are not read: <origin> in link "x"' in scene.notes
    assert scene.collision_model.ngeoms == 1
    two = inside.replace("</geometry>", '<sphere radius="1"/></geometry>')
    with refuses(
        "<geometry> must hold one of box, cylinder, capsule, sphere, mesh; got <box>, <origin>, <sp"
    ):
        pn.load(folder(tmp_path, urdf=robot(*ARM, link("x", inside=two), joint("j", "base", "x"))))


UNREAD = {
    "a word misspelt": (
        joint("j", "base", "x").replace("origin xyz", "origin xzy"),
        "attributes that URDF does not have are not read: xzy in <origin>",
    ),
    "a spring of another tool": (
        joint("j", "base", "x", inside='<traits spring_k="3"/>'),
        "elements that play no part here are not read: <traits> in <joint>",
    ),
    "stiffness in dynamics": (
        joint("j", "base", "x", inside='<dynamics damping="1" spring_stiffness="3"/>'),
        "attributes that URDF does not have are not read: spring_stiffness in <dynamics>",
    ),
    "a controller and a calibration": (
        joint("j", "base", "x", inside='<safety_controller k_velocity="1"/><calibration rising="0.1"/>'),
        "elements that play no part here are not read: <safety_controller> in <joint>, <calibration> in "
        "<joint>",
    ),
    "two origins": (
        joint("j", "base", "x", inside='<origin xyz="1 2 3"/>'),
        'elements are ignored after the first of their kind: <origin> in joint "j"',
    ),
}


@pytest.mark.parametrize(("text", "note"), UNREAD.values(), ids=UNREAD)
def test_words_that_play_no_part_are_told(tmp_path, text, note):
    scene = pn.load(folder(tmp_path, urdf=robot(*ARM, link("x"), text)))
    assert note in scene.notes


def test_bounds_and_reductions_that_play_no_part_are_told(tmp_path):
    geared = (
        '<transmission name="drive"><joint name="elbow"/><actuator name="motor"><mechanicalReduction>50'
        "</mechanicalReduction></actuator></transmission>"
    )
    scene = pn.load(folder(tmp_path, urdf=robot(*ARM, geared)))
    bounds = (
        "bounds of the effort of 2 joints (scene.model.upperEffortLimit) and the velocity of 2 joints "
        "(scene.model.upperVelocityLimit) are not enforced"
    )
    assert bounds in scene.notes
    assert 'reductions of transmissions "drive" are not used: torques are those at the joints' in scene.notes
    np.testing.assert_array_equal(scene.model.upperEffortLimit, [1.0, 1.0])


QUATERNION = 'quat_xyzw="0 0 3 3"'


def test_a_quaternion_turns_whatever_version_the_file_states(tmp_path):
    turned = joint("j", "base", "x").replace('<origin xyz="0 0 0"', f"<origin {QUATERNION}")
    for version in ("", ' version="1.0"', ' version="1.2"'):
        text = robot(*ARM, link("x"), turned).replace('<robot name="arm"', f'<robot name="arm"{version}')
        model = pn.load(folder(tmp_path, urdf=text)).model
        turn = model.jointPlacements[model.getJointId("j")].rotation
        np.testing.assert_allclose(turn, pin.rpy.rpyToMatrix(0, 0, np.pi / 2), atol=1e-15)


@pytest.mark.parametrize(
    ("new", "message"),
    [
        (f'{QUATERNION} rpy="0 0 1"', "<origin> must have one of rpy and quat_xyzw; got both"),
        ('quat_xyzw="0 0 0 0"', "quat_xyzw must have a length; got 0 0 0 0"),
        ('quat_xyzw="0 0 1"', "quat_xyzw must hold 4 numbers"),
    ],
)
def test_quaternions_that_turn_nothing_are_refused(tmp_path, new, message):
    turned = joint("j", "base", "x").replace('<origin xyz="0 0 0"', f"<origin {new}")
    with refuses(message):
        pn.load(folder(tmp_path, urdf=robot(*ARM, link("x"), turned)))


def test_capsules_are_shapes_whatever_version_the_file_states(tmp_path):
    origin = '<origin quat_xyzw="0 3 0 3" xyz="0 0 1"/>'
    inside = f'<collision>{origin}<geometry><capsule radius="0.1" length="0.4"/></geometry></collision>'
    text = robot(*ARM, f'<link name="x">{inside}</link>', joint("j", "base", "x"))
    scene = pn.load(folder(tmp_path, urdf=text), density=1000.0)
    (item,) = scene.collision_model.geometryObjects
    assert isinstance(item.geometry, coal.Capsule)
    inertia = scene.model.inertias[scene.model.getJointId("j")]
    assert inertia.mass == pytest.approx(1000.0 * np.pi * (0.01 * 0.4 + 4.0 / 3.0 * 0.001), rel=1e-12)
    assert np.argmin(np.diag(inertia.inertia)) == 0  # its long axis is turned onto x


@pytest.mark.parametrize("name", ["ARM.URDF", "Arm.Urdf"])
def test_endings_count_in_any_case(tmp_path, name):
    (tmp_path / name).write_text(robot(*ARM))
    assert pn.load(tmp_path / name).model.nv == 2


@pytest.mark.parametrize("name", ["arm.URDF", "arm.urdf.xacro", "arm.xml"])
def test_a_folder_without_a_robot_urdf_names_the_files_that_can_be_loaded(tmp_path, name):
    (tmp_path / name).write_text(robot(*ARM))
    with refuses(f'must hold a robot.urdf; there is none; load "{tmp_path / name}" by its path'):
        pn.load(tmp_path)


def test_materials_that_are_defined_twice_and_colors_that_are_none_are_told(tmp_path, capfd):
    red, loud = (f'<material name="m"><color rgba="{c}"/></material>' for c in ("1 0 0 1", "255 0 0 1"))
    shape = '<visual><geometry><box size="1 1 1"/></geometry>{}</visual>'
    file = tmp_path / "arm.urdf"
    file.write_text(
        robot(red, red, *ARM, link("x", inside=shape.format('<material name="m"/>')), joint("j", "base", "x"))
    )
    scene = pn.load(file)
    assert 'materials defined twice keep their first definition: "m"' in scene.notes
    assert scene.visual_model.ngeoms == 1
    file.write_text(robot(*ARM, link("x", inside=shape.format(loud)), joint("j", "base", "x")))
    scene = pn.load(file)
    assert 'colors that are not four numbers from 0 to 1 are left out, of materials "m"' in scene.notes
    assert scene.visual_model.ngeoms == 1
    assert capfd.readouterr().err == ""


def test_a_mesh_without_a_file_is_a_shape_without_size(tmp_path):
    assert 'shapes of size zero are left out, in links "x"' in load_with(tmp_path, "").notes


def test_a_transmission_of_no_joint_is_told(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(robot(*ARM, '<transmission name="t"><joint name="jaw"/></transmission>'))
    assert 'transmissions drive joints that do not exist: "jaw"' in pn.load(file).notes


def test_joints_without_a_range_get_no_stops(tmp_path):
    file = tmp_path / "arm.urdf"
    text = robot(*ARM, link("x"), joint("j", "base", "x"))
    file.write_text(text.replace('lower="-3" upper="3"', ""))
    scene = pn.load(file, limits=True)
    assert scene.contacts == ()
    assert 'joints without a range (their bounds are equal) get no stops: "j"' in "\n".join(scene.notes)


@pytest.mark.parametrize("density", [None, 1000.0])
def test_a_mesh_that_is_missing_is_named_where_it_would_give_the_mass(tmp_path, density):
    file = tmp_path / "arm.urdf"
    bare = f'<link name="x">{shown("hull.stl")}</link>'
    file.write_text(robot('<link name="base"/>', bare, joint("j", "base", "x")))
    with refuses('the meshes of links "x", which state no inertia, were not found', pn.SingularMassError):
        pn.load(file, density=density)


def collada(unit, up="Z_UP"):
    """A cube of four units, as COLLADA."""
    corners = [(x, y, z) for x in (0, 4) for y in (0, 4) for z in (0, 4)]
    faces = "0 1 3 0 3 2 4 6 7 4 7 5 0 4 5 0 5 1 2 3 7 2 7 6 0 2 6 0 6 4 1 5 7 1 7 3"
    numbers = " ".join(str(x) for corner in corners for x in corner)
    axes = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
      <asset>{unit}<up_axis>{up}</up_axis></asset>
      <library_geometries><geometry id="g"><mesh>
        <source id="p"><float_array id="n" count="24">{numbers}</float_array>
          <technique_common><accessor source="#n" count="8" stride="3">{axes}</accessor></technique_common>
        </source>
        <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
        <triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
      </mesh></geometry></library_geometries>
      <library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
      </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


UNITS = [
    ("", "", 4.0),
    ('<unit name="meter" meter="1"/>', "", 4.0),
    ('<unit name="centimeter" meter="0.01"/>', "", 0.04),
    ('<unit meter="0.001" name="mm"/>', ' scale="2 2 2"', 0.008),
    ('<unit name="inch" meter="0.0254"/>', "", 0.1016),
]


@pytest.mark.parametrize("up", ["Z_UP", "Y_UP"])
@pytest.mark.parametrize(("unit", "scale", "edge"), UNITS)
def test_a_collada_mesh_has_the_unit_that_its_file_states(tmp_path, unit, scale, edge, up):
    (tmp_path / "cube.dae").write_text(collada(unit, up))
    shape = f'<geometry><mesh filename="cube.dae"{scale}/></geometry>'
    inside = f"<visual>{shape}</visual><collision>{shape}</collision>"
    path = tmp_path / "arm.urdf"
    path.write_text(robot(*ARM, f'<link name="x">{inside}</link>', joint("j", "base", "x")))
    scene = pn.load(path, density=1000.0)
    for geometry in (scene.visual_model, scene.collision_model):
        (cube,) = [item for item in geometry.geometryObjects if item.name.startswith("x")]
        cube.geometry.computeLocalAABB()
        np.testing.assert_allclose(cube.geometry.aabb_local.max_, edge, rtol=1e-6)
    mass = scene.model.inertias[scene.model.getJointId("j")].mass
    assert mass == pytest.approx(1000.0 * edge**3, rel=1e-6)
    told = [note for note in scene.notes if "are drawn in units of" in note]
    assert len(told) == (edge not in (4.0,))


LOOPS = {
    '<loop_joint name="knee" type="continuous"><link1 link="base"/><link2 link="x"/></loop_joint>': (
        '<loop_joint> "knee"'
    ),
    '<gazebo><joint name="rod" type="ball"><parent>base</parent><child>x</child></joint></gazebo>': (
        '<joint> in <gazebo> "rod"'
    ),
    '<drake:ball_constraint xmlns:drake="http://drake.mit.edu"/>': "<ball_constraint>",
}


@pytest.mark.parametrize("element", LOOPS)
def test_loops_of_other_tools_are_a_warning_that_names_them(tmp_path, element):
    file = tmp_path / "robot.urdf"
    file.write_text(robot(*ARM, link("x"), joint("j", "base", "x"), element))
    with pytest.warns(UserWarning, match="load: loops that elements of other tools") as caught:
        scene = pn.load(file)
    assert LOOPS[element] in str(caught[0].message)
    assert caught[0].filename == __file__
    assert LOOPS[element] in "\n".join(scene.notes)


def test_loops_that_robot_yaml_closes_are_a_note(tmp_path, recwarn):
    element = next(iter(LOOPS))
    (tmp_path / "robot.urdf").write_text(robot(*ARM, link("x"), joint("j", "base", "x"), element))
    (tmp_path / "robot.yaml").write_text(
        "constraints:\n  - PrescribedMotion: {joint: j, function: {constant: {value: 0.0}}}\n"
    )
    assert '<loop_joint> "knee"' in "\n".join(pn.load(tmp_path).notes)
    assert not recwarn.list
