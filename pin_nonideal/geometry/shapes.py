"""Shapes of a collision model in terms of the parameters of their contacts."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from pin_nonideal.description.contacts.convex_hull import check_convex, convex_hull
from pin_nonideal.errors import InputError, UnknownNameError, nearest, short_repr
from pin_nonideal.types import Array, CollisionGeometry, GeometryModel, GeometryObject, Model, Placement

# Corners of a box of half edges 1.
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
SUPPORTED_SHAPES = "spheres, capsules, boxes, cylinders, cones, ellipsoids, half-spaces and convex meshes"


@dataclass(frozen=True)
class Shape:
    """Geometry object in the frame of its joint.

    Attributes:
        name: name of the geometry object.
        kind: name of the shape's class in Coal.
        frame: name of the joint.
        place: placement of the shape's own axes.
        points: corners of a solid, ends of a capsule's segment, center of a sphere, tip of a cone, or one
            point on the boundary of a half-space, (n, 3).
        radius: radius around the points of a sphere or capsule [m].
        normal: outward normal of a half-space, (3,).
        half: half edges of a box [m], (3,).
        ends: half length and radii of the lower and upper face of a cylinder or cone [m].
        semiaxes: semi-axes of an ellipsoid [m], (3,).
        solid: whether the shape is the convex hull of its points.
    """

    name: str
    kind: str
    frame: str
    place: Placement
    points: Array
    radius: float = 0.0
    normal: Array | None = None
    half: Array | None = None
    ends: tuple[float, float, float] | None = None
    semiaxes: Array | None = None
    solid: bool = False

    @property
    def is_round(self) -> bool:
        """Check if the shape is a sphere or a capsule."""
        return self.radius > 0.0


def geometry_object(who: str, name: str, geometry: GeometryModel) -> GeometryObject:
    """Return the geometry object of a name.

    Args:
        who: prefix of error messages.
        name: name of the geometry object.
        geometry: pinocchio.GeometryModel.

    Raises:
        UnknownNameError: the collision model has no such object.
    """
    if not geometry.existGeometryName(name):
        known = [g.name for g in geometry.geometryObjects]
        raise UnknownNameError(f'{who}: no geometry "{name}" in the collision model{nearest(name, known)}')
    return geometry.geometryObjects[geometry.getGeometryId(name)]


def shape_of(who: str, item: GeometryObject, model: Model) -> Shape:
    """Return a geometry object as a shape of a supported kind.

    Args:
        who: prefix of error messages.
        item: pinocchio.GeometryObject.
        model: pinocchio.Model.

    Raises:
        InputError: the kind is not supported, a length is not positive, or a mesh is not convex.
    """
    name = str(item.name)
    frame, shape, place = str(model.names[item.parentJoint]), item.geometry, item.placement.copy()
    kind = type(shape).__name__
    check_lengths(f'{who}: geometry "{name}"', shape)

    def located(points: Array) -> Array:
        return np.asarray(points @ place.rotation.T + place.translation)

    origin = located(np.zeros((1, 3)))
    if kind == "Halfspace":
        normal = place.rotation @ np.array(shape.n)
        return Shape(name, kind, frame, place, origin + shape.d * normal, normal=normal)
    if kind == "Sphere":
        return Shape(name, kind, frame, place, origin, float(shape.radius))
    if kind == "Capsule":
        ends = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]) * shape.halfLength
        return Shape(name, kind, frame, place, located(ends), float(shape.radius))
    if kind == "Box":
        half = np.array(shape.halfSide)
        return Shape(name, kind, frame, place, located(CORNERS * half), half=half, solid=True)
    if kind == "Ellipsoid":
        return Shape(name, kind, frame, place, np.empty((0, 3)), semiaxes=np.array(shape.radii))
    if kind in ("Cylinder", "Cone"):
        length, radius = float(shape.halfLength), float(shape.radius)
        above = radius if kind == "Cylinder" else 0.0
        tip = np.array([[0.0, 0.0, length]] if kind == "Cone" else np.empty((0, 3)))
        return Shape(name, kind, frame, place, located(tip), ends=(length, radius, above))
    corners = _corners(f'{who}: geometry "{name}"', shape, np.array(item.meshScale))
    return Shape(name, "convex mesh", frame, place, located(corners), solid=True)


def check_lengths(what: str, shape: CollisionGeometry) -> None:
    """Check that edges, radii and lengths of a shape are positive. Coal accepts other values.

    Args:
        what: prefix of error messages.
        shape: shape of coal.

    Raises:
        InputError: a length is not positive and finite.
    """
    for key, factor in (("halfSide", 2.0), ("radii", 1.0), ("radius", 1.0), ("halfLength", 2.0)):
        lengths = factor * np.array(getattr(shape, key, 1.0), dtype=float)
        if not (np.isfinite(lengths).all() and (lengths > 0.0).all()):
            words = {"halfSide": "edges", "radii": "semi-axes", "halfLength": "length"}.get(key, key)
            raise InputError(
                f"{what}: {words} of a {type(shape).__name__} must be positive and finite [m]; "
                f"got {short_repr(lengths.tolist())}"
            )


def _corners(what: str, mesh: CollisionGeometry, scale: Array) -> Array:
    """Return the corners of a convex mesh.

    Raises:
        InputError: the shape is not a mesh, or is not convex.
    """
    kind = type(mesh).__name__
    if kind.startswith("Convex"):
        points = np.array([mesh.point(i) for i in range(mesh.num_points)])
        return convex_hull(points * scale, what).points
    if "BVH" not in kind:
        raise InputError(f"{what} is a {kind}; {SUPPORTED_SHAPES} do")
    points = np.array(mesh.vertices()) * scale
    triangles = [mesh.tri_indices(i) for i in range(mesh.num_tris)]
    check_convex(points, np.array([[t[k] for k in range(3)] for t in triangles]), what)
    return convex_hull(points, what).points
