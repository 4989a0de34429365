"""Shapes of the replay on joints, from Pinocchio's geometry or, without geometry, from the joints.

A shape is a primitive with its dimensions or a triangle mesh. Triangles come from coal, which has read every
mesh format that Pinocchio supports. COLLADA files are read again for the colors of their parts, which coal
does not store.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.types import Array, GeometryObject

Indices = NDArray[np.int64]
Color = tuple[float, float, float, float]

# Tolerance of equal vertices relative to the mesh's diagonal; STL files repeat all vertices.
VERTEX_TOL = 1e-5
COLLADA = "{http://www.collada.org/2005/11/COLLADASchema}"

# Colors of links, used cyclically, and color of the joints between them.
LINK_COLORS: tuple[Color, ...] = (
    (0.31, 0.47, 0.65, 1.0),
    (0.93, 0.58, 0.25, 1.0),
    (0.36, 0.62, 0.51, 1.0),
    (0.80, 0.42, 0.45, 1.0),
    (0.56, 0.49, 0.70, 1.0),
    (0.85, 0.70, 0.33, 1.0),
)
JOINT_COLOR: Color = (0.27, 0.30, 0.35, 1.0)


@dataclass(frozen=True)
class Shape:
    """Primitive or mesh in its own axes.

    Attributes:
        kind: "box", "ellipsoid", "cylinder", "capsule", "cone", "plane" or "mesh".
        size: dimensions [m]. Box: three edges. Ellipsoid: three radii. Cylinder, cone and capsule: radius and
            length along z (the capsule's without its caps). Plane z = 0 and mesh: empty.
        vertices: vertices of a mesh [m], (nv, 3).
        triangles: vertex indices of a mesh, (nf, 3).
        parts: number of triangles and color of consecutive parts of a mesh; None selects the color of the
            visual.
    """

    kind: str
    size: tuple[float, ...] = ()
    vertices: Array = field(default_factory=lambda: np.zeros((0, 3)))
    triangles: Indices = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    parts: tuple[tuple[int, Color | None], ...] = ()

    def half_extent(self) -> tuple[Array, Array]:
        """Return center and half edges of the bounding box in the shape's axes [m], (3,); zero for planes."""
        if self.kind == "mesh":
            low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
            return (low + high) / 2.0, (high - low) / 2.0
        if self.kind == "plane":
            return np.zeros(3), np.zeros(3)
        if self.kind == "ellipsoid":
            return np.zeros(3), np.array(self.size)
        if self.kind == "box":
            return np.zeros(3), np.array(self.size) / 2.0
        radius, length = self.size
        caps = radius if self.kind == "capsule" else 0.0
        return np.zeros(3), np.array([radius, radius, length / 2.0 + caps])


@dataclass(frozen=True)
class Visual:
    """Shape fixed to a joint.

    Attributes:
        name: name of the geometry object, or of the shape that replaces it.
        joint: index of the joint that carries it, 0 for the world.
        placement: placement of the shape in the joint's frame.
        shape: shape of the visual.
        color: red, green, blue and opacity, 0 to 1.
    """

    name: str
    joint: int
    placement: pin.SE3
    shape: Shape
    color: Color


def visuals_of(geometry_model: pin.GeometryModel, max_triangles: int | None = None) -> list[Visual]:
    """Return one visual for each object of a geometry model.

    Args:
        geometry_model: model of the shapes.
        max_triangles: maximum number of triangles of an object; larger ones are omitted. None for no limit.
    """
    visuals = []
    for item in geometry_model.geometryObjects:
        if max_triangles is not None and getattr(item.geometry, "num_tris", 0) > max_triangles:
            continue
        shape, offset = shape_of(item.geometry, None if item.overrideMaterial else item.meshPath)
        red, green, blue, opacity = (float(value) for value in item.meshColor)
        color = (red, green, blue, opacity)
        visuals.append(Visual(item.name, int(item.parentJoint), item.placement * offset, shape, color))
    return visuals


def shape_of(geometry: GeometryObject, mesh_path: str | None = None) -> tuple[Shape, pin.SE3]:
    """Return the shape of a coal geometry, with the placement of the shape's axes in those of the geometry.

    Args:
        geometry: coal geometry; unsupported kinds (octree) become their bounding box.
        mesh_path: file of a mesh, for the colors of its parts.
    """
    kind = type(geometry).__name__
    placement = pin.SE3.Identity()
    if kind == "Box":
        return Shape("box", _tuple(2.0 * geometry.halfSide)), placement
    if kind == "Sphere":
        return Shape("ellipsoid", (float(geometry.radius),) * 3), placement
    if kind == "Ellipsoid":
        return Shape("ellipsoid", _tuple(geometry.radii)), placement
    if kind in ("Cylinder", "Capsule", "Cone"):
        return Shape(kind.lower(), (float(geometry.radius), 2.0 * float(geometry.halfLength))), placement
    if kind in ("Plane", "Halfspace"):
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), geometry.n).matrix()
        return Shape("plane"), pin.SE3(turn, geometry.n * geometry.d)
    if kind == "TriangleP":
        return _mesh(np.array([geometry.a, geometry.b, geometry.c]), np.array([[0, 1, 2]])), placement
    if hasattr(geometry, "num_tris") and geometry.num_tris > 0:
        corners = [(t[0], t[1], t[2]) for t in map(geometry.tri_indices, range(geometry.num_tris))]
        return _mesh(geometry.vertices(), np.array(corners), mesh_path), placement
    if hasattr(geometry, "num_polygons") and geometry.num_polygons > 0:
        corners = [(t[0], t[1], t[2]) for t in map(geometry.polygons, range(geometry.num_polygons))]
        return _mesh(geometry.points(), np.array(corners)), placement
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    return Shape("box", _tuple(box.max_ - box.min_)), pin.SE3(np.eye(3), (box.max_ + box.min_) / 2.0)


def _tuple(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _mesh(vertices: Array, triangles: Indices, path: str | None = None) -> Shape:
    """Return a mesh with merged equal vertices and without degenerate triangles; parts keep their colors."""
    vertices = np.asarray(vertices, dtype=np.float64)
    colors = collada_parts(Path(path)) if path and path.lower().endswith(".dae") else []
    if sum(count for count, _ in colors) != len(triangles):
        colors = [(len(triangles), None)]
    part = np.repeat(np.arange(len(colors)), [count for count, _ in colors])

    cell = VERTEX_TOL * max(float(np.linalg.norm(np.ptp(vertices, axis=0))), 1e-12)
    _, first, inverse = np.unique(
        np.round(vertices / cell).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    triangles = inverse.ravel()[triangles]
    a, b, c = triangles.T
    proper = (a != b) & (b != c) & (c != a)
    sizes = np.bincount(part[proper], minlength=len(colors))
    parts = tuple((int(size), color) for size, (_, color) in zip(sizes, colors, strict=True) if size)
    return Shape("mesh", vertices=vertices[first], triangles=triangles[proper], parts=parts)


def collada_parts(path: Path) -> list[tuple[int, Color | None]]:
    """Return the number of triangles and the color of each part of a COLLADA file, in the order of its scene.

    A part with a texture or without a material has color None. Triangles with two equal corners do not count,
    because the mesh reader drops them. An unreadable file has no parts.
    """
    try:
        root = ElementTree.parse(path).getroot()
        geometries = {item.get("id"): item for item in root.iter(COLLADA + "geometry")}
        colors = _material_colors(root)
        parts = []
        for scene in root.iter(COLLADA + "visual_scene"):
            for node in scene.findall(COLLADA + "node"):
                for instance in _instances(node):
                    bound = {
                        item.get("symbol"): (item.get("target") or "")[1:]
                        for item in instance.iter(COLLADA + "instance_material")
                    }
                    mesh = geometries[(instance.get("url") or "")[1:]].find(COLLADA + "mesh")
                    for count, symbol in _triangle_counts(mesh):
                        parts.append((count, colors.get(bound.get(symbol, ""))))
    except (OSError, ElementTree.ParseError, KeyError, ValueError, IndexError, AttributeError):
        return []
    return parts


def _instances(node: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """Yield the geometries of a node, then of its children."""
    yield from node.findall(COLLADA + "instance_geometry")
    for child in node.findall(COLLADA + "node"):
        yield from _instances(child)


def _triangle_counts(mesh: Any) -> Iterator[tuple[int, str | None]]:
    """Yield the number of nondegenerate triangles, and the material, of each group of a COLLADA mesh."""
    sources = {item.get("id"): item for item in mesh.findall(COLLADA + "source")}
    vertices = {item.get("id"): item.find(COLLADA + "input") for item in mesh.findall(COLLADA + "vertices")}
    for group in mesh.findall(COLLADA + "triangles"):
        inputs = group.findall(COLLADA + "input")
        stride = 1 + max(int(item.get("offset")) for item in inputs)
        corner = next(item for item in inputs if item.get("semantic") == "VERTEX")
        source = sources[vertices[corner.get("source")[1:]].get("source")[1:]]
        numbers = (source.find(COLLADA + "float_array").text or "").split()
        points = np.array(numbers, dtype=float).reshape(-1, 3)
        index = np.array((group.find(COLLADA + "p").text or "").split(), dtype=np.int64)
        a, b, c = points[index.reshape(-1, 3, stride)[:, :, int(corner.get("offset"))]].transpose(1, 0, 2)
        flat = np.all(a == b, axis=1) | np.all(b == c, axis=1) | np.all(c == a, axis=1)
        yield int(np.count_nonzero(~flat)), group.get("material")


def _material_colors(root: ElementTree.Element) -> dict[str, Color]:
    """Return the diffuse color of each material of a COLLADA file with such a color."""
    effects: dict[str, Color] = {}
    for effect in root.iter(COLLADA + "effect"):
        color = effect.find(f".//{COLLADA}diffuse/{COLLADA}color")
        if color is not None and color.text:
            red, green, blue = (float(value) for value in color.text.split()[:3])
            effects[effect.get("id") or ""] = (red, green, blue, 1.0)
    materials: dict[str, Color] = {}
    for material in root.iter(COLLADA + "material"):
        instance = material.find(COLLADA + "instance_effect")
        key = "" if instance is None else (instance.get("url") or "")[1:]
        if key in effects:
            materials[material.get("id") or ""] = effects[key]
    return materials


def joint_axis(model: pin.Model, joint: int) -> tuple[Array | None, bool]:
    """Return the axis of a one-degree-of-freedom joint, (3,) or None, and whether the joint rotates."""
    if model.joints[joint].nv != 1:
        return None, False
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, pin.neutral(model))
    linear, angular = np.split(np.asarray(data.S).ravel(), 2)
    turning = bool(np.linalg.norm(angular) > 0.0)
    axis = angular if turning else linear
    return axis / np.linalg.norm(axis), turning
