"""Shapes of MJCF files as MuJoCo sees them: sizes, height fields, pairs, and files that are missing."""

from __future__ import annotations

import coal
import mujoco
import numpy as np
import pytest

import pin_nonideal as pn

from ..support.refusals import refuses

# Coordinates of meshes and height fields are floats of 24 bits.
SINGLE = 1e-6
KINDS = {
    "plane": ("0 0 1", coal.Halfspace, None),
    "sphere": ("0.2", coal.Sphere, (0.2, 0.2, 0.2)),
    "capsule": ("0.1 0.3", coal.Capsule, (0.1, 0.1, 0.4)),
    "ellipsoid": ("0.1 0.2 0.3", coal.Ellipsoid, (0.1, 0.2, 0.3)),
    "cylinder": ("0.1 0.3", coal.Cylinder, (0.1, 0.1, 0.3)),
    "box": ("0.1 0.2 0.3", coal.Box, (0.1, 0.2, 0.3)),
}
HILLS = """<asset><hfield name="hills" nrow="3" ncol="4" size="1 2 0.5 0.1"
    elevation="0 1 2 1 3 0 4 2 1 2 0 3"/></asset>"""


def write(path, bodies, head="", tail=""):
    file = path / "robot.xml"
    file.write_text(f"<mujoco>{head}<worldbody>{bodies}</worldbody>{tail}</mujoco>")
    return file


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_the_size_of_the_file(tmp_path, kind):
    size, shape, half = KINDS[kind]
    scene = pn.load(
        write(tmp_path, f'<geom name="it" type="{kind}" size="{size}"/><body><joint/><geom size="1"/></body>')
    )
    for shapes in (scene.visual_model, scene.collision_model):
        geometry = shapes.geometryObjects[shapes.getGeometryId("it")].geometry
        assert isinstance(geometry, shape)
        if half is not None:
            geometry.computeLocalAABB()
            np.testing.assert_allclose(geometry.aabb_local.max_, half, rtol=1e-14)
            np.testing.assert_allclose(geometry.aabb_local.min_, -np.array(half), rtol=1e-14)


def height(mesh, x, y):
    """Return the height of the triangles of a mesh above a point of the plane."""
    for k in range(mesh.num_tris):
        corners = mesh.vertices()[[mesh.tri_indices(k)[i] for i in range(3)]]
        part = np.linalg.solve(np.vstack([corners[:, :2].T, np.ones(3)]), [x, y, 1.0])
        if (part > -1e-12).all():
            return part @ corners[:, 2]
    raise AssertionError("no triangle above this point")


def test_a_height_field_is_the_surface_that_mujoco_sees(tmp_path):
    """Rays from above meet the same triangles, which differ between the two diagonals of a cell."""
    ball = '<body><joint type="slide"/><geom size="0.01" pos="0 0 -9"/></body>'
    file = write(tmp_path, f'<geom name="ground" type="hfield" hfield="hills"/>{ball}', HILLS)
    compiled = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    mesh = pn.load(file).collision_model.geometryObjects[0].geometry
    assert (mesh.num_vertices, mesh.num_tris) == (12, 12)
    for x, y in np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2)) * [0.99, 1.99]:
        ray = np.array([x, y, 5.0]), np.array([0.0, 0.0, -1.0])
        distance = mujoco.mj_ray(compiled, data, *ray, None, 1, -1, np.zeros(1, dtype=np.int32))
        assert height(mesh, x, y) == pytest.approx(5.0 - distance, abs=SINGLE)


def test_pairs_of_the_file_collide_even_between_neighbors(tmp_path):
    """MuJoCo leaves out parent and child, and masks that exclude each other, unless a pair names them."""
    inner = '<body name="b"><joint/><geom name="two" size="0.1" contype="0" conaffinity="0"/></body>'
    bodies = f'<body name="a"><joint/><geom name="one" size="0.1"/>{inner}</body>'
    assert len(pn.load(write(tmp_path, bodies)).collision_model.collisionPairs) == 0
    pair = '<contact><pair geom1="one" geom2="two"/></contact>'
    shapes = pn.load(write(tmp_path, bodies, tail=pair)).collision_model
    assert [item.name for item in shapes.geometryObjects] == ["one", "two"]
    assert [(p.first, p.second) for p in shapes.collisionPairs] == [(0, 1)]


@pytest.mark.parametrize("content", [None, b"no picture"])
def test_a_height_field_without_a_readable_file_is_left_out(tmp_path, content):
    head = '<asset><hfield name="hills" file="hills.png" size="1 2 0.5 0.1"/></asset>'
    ball = '<body><joint/><geom name="ball" size="0.1" pos="1 0 0"/></body>'
    if content is not None:
        (tmp_path / "hills.png").write_bytes(content)
    scene = pn.load(write(tmp_path, f'<geom type="hfield" hfield="hills"/>{ball}', head))
    assert [item.name for item in scene.collision_model.geometryObjects] == ["ball"]
    why = "was not found" if content is None else "cannot be read"
    assert f'mesh "hills.png" {why}; its shape is left out' in scene.notes


def test_pictures_of_textures_need_not_be_there(tmp_path):
    head = """<asset><texture name="wood" type="2d" file="wood.png"/>
        <material name="board" texture="wood" rgba="1 0.5 0 1"/></asset>"""
    body = '<body><joint/><geom name="plank" type="box" size="1 1 1" material="board"/></body>'
    (item,) = pn.load(write(tmp_path, body, head)).visual_model.geometryObjects
    np.testing.assert_allclose(item.meshColor, [1.0, 0.5, 0.0, 1.0], atol=SINGLE)


def test_entities_and_old_versions_of_mujoco_are_refused(tmp_path, monkeypatch):
    file = write(tmp_path, '<body><joint/><geom size="0.1"/></body>')
    text = file.read_text()
    file.write_text(f'<!DOCTYPE mujoco [<!ENTITY size "0.1">]>{text}')
    with refuses("must not declare a DOCTYPE or entities; remove them"):
        pn.load(file)
    file.write_text(text)
    monkeypatch.setattr(mujoco, "__version__", "3.3.0")
    with refuses("needs mujoco 4 or newer; got 3.3.0; pip install --upgrade 'pin-nonideal[mjcf]'"):
        pn.load(file)
