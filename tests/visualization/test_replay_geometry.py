"""Shapes of the replay: primitives, meshes with the colors of their parts, and drawings without geometry."""

from __future__ import annotations

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from pin_nonideal.visualization.page.stick_figure import link_bars
from pin_nonideal.visualization.page.visuals import collada_parts, joint_axis, shape_of, visuals_of

from ..support.replay_runs import add_frame, four_bar, jointed, panda

ROUNDING = 1e-12


@pytest.mark.parametrize(
    ("geometry", "kind", "size", "half"),
    [
        (coal.Box(0.2, 0.4, 0.6), "box", (0.2, 0.4, 0.6), (0.1, 0.2, 0.3)),
        (coal.Sphere(0.3), "ellipsoid", (0.3, 0.3, 0.3), (0.3, 0.3, 0.3)),
        (coal.Ellipsoid(0.1, 0.2, 0.3), "ellipsoid", (0.1, 0.2, 0.3), (0.1, 0.2, 0.3)),
        (coal.Cylinder(0.1, 0.5), "cylinder", (0.1, 0.5), (0.1, 0.1, 0.25)),
        (coal.Capsule(0.1, 0.5), "capsule", (0.1, 0.5), (0.1, 0.1, 0.35)),
        (coal.Cone(0.1, 0.5), "cone", (0.1, 0.5), (0.1, 0.1, 0.25)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_primitives_keep_their_dimensions(geometry: object, kind: str, size: object, half: object) -> None:
    shape, offset = shape_of(geometry)
    assert shape.kind == kind
    np.testing.assert_allclose(shape.size, size, atol=ROUNDING)
    np.testing.assert_allclose(shape.half_extent()[1], half, atol=ROUNDING)
    assert offset == pin.SE3.Identity()
    geometry.computeLocalAABB()  # type: ignore[attr-defined]
    np.testing.assert_allclose(geometry.aabb_local.max_, half, atol=ROUNDING)  # type: ignore[attr-defined]


@pytest.mark.parametrize("plane", [coal.Halfspace, coal.Plane])
def test_a_plane_lies_where_coal_has_it(plane: type) -> None:
    normal = np.array([0.6, 0.0, 0.8])
    shape, offset = shape_of(plane(normal, 0.5))
    assert shape.kind == "plane"
    np.testing.assert_allclose(offset.rotation[:, 2], normal, atol=ROUNDING)
    np.testing.assert_allclose(offset.translation @ normal, 0.5, atol=ROUNDING)


def test_a_triangle_is_a_mesh() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    shape, _ = shape_of(coal.TriangleP(*corners))
    assert sorted(shape.vertices[shape.triangles[0]].tolist()) == sorted(corners.tolist())


def test_a_convex_hull_is_a_mesh_of_its_faces() -> None:
    cube = np.array(list(np.ndindex(2, 2, 2)), dtype=float)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(8, 0)
    mesh.addVertices(cube)
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    shape, _ = shape_of(mesh.convex)
    a, b, c = shape.vertices[shape.triangles].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
    np.testing.assert_allclose(area, 6.0, atol=ROUNDING)


def test_a_geometry_without_a_drawing_is_its_box() -> None:
    ground = coal.HeightFieldOBBRSS(2.0, 4.0, np.array([[0.0, 1.0], [1.0, 1.0]]), -1.0)
    shape, offset = shape_of(ground)
    assert shape.kind == "box"
    ground.computeLocalAABB()
    np.testing.assert_allclose(offset.translation, ground.aabb_local.center(), atol=ROUNDING)
    np.testing.assert_allclose(shape.size[:2], [2.0, 4.0], atol=ROUNDING)


def mesh_of(vertices: list[list[float]], triangles: list[list[int]]) -> coal.BVHModelOBBRSS:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(np.array(vertices))
    mesh.addTriangles(np.array(triangles))
    mesh.endModel()
    return mesh


def test_repeated_vertices_are_welded_and_flat_triangles_dropped() -> None:
    a, b, c, d = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]
    shape, _ = shape_of(mesh_of([a, b, c, b, d, c, a, a, b], [[0, 1, 2], [3, 4, 5], [6, 7, 8]]))
    assert len(shape.vertices) == 4
    corners = [{tuple(point) for point in shape.vertices[triangle]} for triangle in shape.triangles]
    assert corners == [{tuple(a), tuple(b), tuple(c)}, {tuple(b), tuple(d), tuple(c)}]
    assert shape.parts == ((2, None),)


def test_panda_keeps_every_triangle_and_the_colors_of_its_parts() -> None:
    visual_model = panda(count=3).scene.visual_model
    visuals = visuals_of(visual_model)
    assert len(visuals) == visual_model.ngeoms
    for visual, item in zip(visuals, visual_model.geometryObjects, strict=True):
        assert visual.placement == item.placement
        assert sum(count for count, _ in visual.shape.parts) == len(visual.shape.triangles)
        # The files hold a few triangles whose corners coincide; no more than those may go.
        assert 0 <= item.geometry.num_tris - len(visual.shape.triangles) <= 0.002 * item.geometry.num_tris
    colors = {color for visual in visuals for _, color in visual.shape.parts}
    assert (1.0, 1.0, 1.0, 1.0) in colors  # white covers
    assert (0.25, 0.25, 0.25, 1.0) in colors  # black rings
    assert None not in colors


def test_parts_of_a_collada_file_lie_where_coal_has_them() -> None:
    hand = next(item for item in panda(count=3).scene.visual_model.geometryObjects if "hand" in item.name)
    shape, _ = shape_of(hand.geometry, hand.meshPath)
    sizes = [count for count, _ in shape.parts]
    pieces = np.split(shape.triangles, np.cumsum(sizes)[:-1])
    # The parts of this file share no vertex: were the limits wrong, some vertex would be in two of them.
    owners = [set(piece.ravel().tolist()) for piece in pieces]
    shared = sum(len(one & other) for i, one in enumerate(owners) for other in owners[:i])
    assert shared <= 0.02 * len(shape.vertices)


def test_an_overriding_material_replaces_the_colors_of_the_file() -> None:
    visual_model = panda(count=3).scene.visual_model
    visual_model.geometryObjects[0].overrideMaterial = True
    assert {color for _, color in visuals_of(visual_model)[0].shape.parts} == {None}


@pytest.mark.parametrize(
    "text", ["", "not xml", "<COLLADA/>", "<a><b></a>"], ids=["empty", "text", "bare", "torn"]
)
def test_a_collada_file_that_cannot_be_read_has_no_parts(text: str, tmp_path: Path) -> None:
    path = tmp_path / "part.dae"
    path.write_text(text)
    assert collada_parts(path) == []
    assert collada_parts(tmp_path / "absent.dae") == []


def test_a_model_without_geometry_is_drawn_from_joint_to_joint() -> None:
    model = four_bar().scene.model
    tips = [(2, model.frames[model.getFrameId("coupler_tip")].placement.translation)]
    drawn = {visual.name: visual for visual in link_bars(model, tips, 1.0)}
    bar = drawn["crank bar 0"]
    assert bar.joint == 1
    ends = [bar.placement.act(np.array([0.0, 0.0, side * bar.shape.size[1] / 2.0])) for side in (-1.0, 1.0)]
    np.testing.assert_allclose(ends, [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]], atol=ROUNDING)
    assert drawn["coupler bar 0"].shape.size[1] == pytest.approx(0.8)
    hub = drawn["rocker joint"]
    assert hub.shape.kind == "cylinder"
    np.testing.assert_allclose(np.abs(hub.placement.rotation[:, 2]), [0.0, 1.0, 0.0], atol=ROUNDING)


def test_a_last_link_ends_at_twice_its_center_of_mass_or_at_its_frame() -> None:
    model = jointed(pin.JointModelRZ(), lever=0.15)
    (bar,) = [visual for visual in link_bars(model, [], 1.0) if "bar" in visual.name]
    assert bar.shape.size[1] == pytest.approx(0.3)
    add_frame(model, "tool", 1, [0.0, 0.5, 0.0])
    (bar,) = [visual for visual in link_bars(model, [], 1.0) if "bar" in visual.name]
    assert bar.shape.size[1] == pytest.approx(0.5)


def test_a_point_mass_is_a_ball_and_a_slider_a_block() -> None:
    model = jointed(pin.JointModelPX(), lever=0.0)
    (ball,) = link_bars(model, [], 1.0)
    assert (ball.name, ball.shape.kind) == ("j0 mass", "ellipsoid")
    shapes = {visual.name: visual.shape.kind for visual in link_bars(jointed(pin.JointModelPX()), [], 1.0)}
    assert shapes == {"j0 bar 0": "capsule", "j0 joint": "box"}
    shapes = {
        visual.name: visual.shape.kind for visual in link_bars(jointed(pin.JointModelFreeFlyer()), [], 1.0)
    }
    assert shapes == {"j0 bar 0": "capsule", "j0 joint": "ellipsoid"}


@pytest.mark.parametrize(
    ("joint", "axis", "turning"),
    [
        (pin.JointModelRY(), [0.0, 1.0, 0.0], True),
        (pin.JointModelRUBX(), [1.0, 0.0, 0.0], True),
        (pin.JointModelRevoluteUnaligned(np.array([0.6, 0.8, 0.0])), [0.6, 0.8, 0.0], True),
        (pin.JointModelPZ(), [0.0, 0.0, 1.0], False),
    ],
    ids=["revolute", "continuous", "slanted", "prismatic"],
)
def test_axis_of_a_joint(joint: object, axis: list[float], turning: bool) -> None:
    found, turns = joint_axis(jointed(joint), 1)
    np.testing.assert_allclose(found, axis, atol=ROUNDING)
    assert turns is turning
    assert joint_axis(jointed(pin.JointModelSpherical()), 1) == (None, False)
