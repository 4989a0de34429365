"""The ground as a half-space, and heights of the lowest points of shapes above a plane."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pin_nonideal.description.constraints import Axis
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, GeometryModel, GeometryObject, Model, Placement
from pin_nonideal.validation import number, text, unit_axis

from .bodies import shape_color

# Color of the ground in a viewer: red, green, blue and opacity.
GROUND_COLOR = (0.62, 0.65, 0.69, 1.0)


def ground(
    name: str = "ground", *, height: float = 0.0, normal: Axis = "z", color: ArrayLike | None = None
) -> GeometryObject:
    """Return the ground, a half-space fixed to the world, as a shape for collision models and contacts.

    The points x with n . x <= height belong to the ground. `GeometryContact("box", pn.ground())` accepts it
    directly. `collision_model.addGeometryObject(pn.ground())` makes it a shape of the scene, which contacts
    find by its name. A replay draws the floor of contacts as a grid, and other planes as plates around the
    contact points.

    Args:
        name: name of the shape.
        height: distance of the surface from the world's origin along the normal [m].
        normal: outward normal in world axes: "x", "y", "z" or three numbers; scaled to length 1.
        color: red, green, blue and optionally opacity, 0 to 1, (3,) or (4,), for viewers of geometry
            models; None for gray.

    Returns:
        pinocchio.GeometryObject on the world with a coal.Halfspace.

    Raises:
        InputError: an argument is invalid.
    """
    import coal

    text("ground: name", name)
    up, at = np.array(unit_axis("ground: normal", normal)), number("ground: height", height)
    item = pin.GeometryObject(name, 0, 0, pin.SE3.Identity(), coal.Halfspace(up, at))
    rgba = shape_color("ground: color", color)
    item.meshColor = np.array(GROUND_COLOR) if rgba is None else rgba
    return item


def lowest_height(model: Model, shapes: GeometryModel, q: Array, plane: Placement) -> float:
    """Return the height of the lowest point of the shapes of moving bodies above a plane [m].

    Args:
        model: pinocchio.Model.
        shapes: pinocchio.GeometryModel; shapes on the world are ignored.
        q: configuration, (nq,).
        plane: placement of the plane; its origin lies on the plane, its third axis is the normal.

    Raises:
        InputError: no shape is on a moving body, or a shape has no lowest point.
    """
    data, of_shapes = model.createData(), shapes.createData()
    pin.updateGeometryPlacements(model, data, shapes, of_shapes, q)
    heights = [
        depth(item, plane.inverse() * place)
        for item, place in zip(shapes.geometryObjects, of_shapes.oMg, strict=True)
        if item.parentJoint
    ]
    if not heights:
        raise InputError(f'no collision shape of model "{model.name}" is on a moving body')
    return min(heights)


def depth(item: GeometryObject, place: Placement) -> float:
    """Return the height of the lowest point of one shape above the plane z = 0 [m].

    Args:
        item: pinocchio.GeometryObject.
        place: placement of the shape's axes.

    Raises:
        InputError: the shape is unbounded, or its kind is not supported.
    """
    shape, kind = item.geometry, type(item.geometry).__name__
    height, normal = float(place.translation[2]), place.rotation[2]  # the normal in the shape's axes
    across = float(np.hypot(normal[0], normal[1]))
    if kind == "Sphere":
        return height - float(shape.radius)
    if kind == "Capsule":
        return height - float(shape.halfLength) * abs(float(normal[2])) - float(shape.radius)
    if kind == "Box":
        return height - float(np.abs(normal) @ np.array(shape.halfSide))
    if kind == "Ellipsoid":
        return height - float(np.linalg.norm(normal * np.array(shape.radii)))
    if kind == "Cylinder":
        return height - float(shape.halfLength) * abs(float(normal[2])) - float(shape.radius) * across
    if kind == "Cone":
        half = float(shape.halfLength) * float(normal[2])
        return height + min(half, -half - float(shape.radius) * across)
    points = _vertices(item)
    if points is None:
        raise InputError(f'shape "{item.name}" is a {kind}, which has no lowest point here; remove it')
    return height + float((points @ normal).min())


def _vertices(item: GeometryObject) -> Array | None:
    """Return the vertices of a mesh, or None for other shapes."""
    mesh, kind = item.geometry, type(item.geometry).__name__
    if kind.startswith("Convex"):
        points = np.array([mesh.point(i) for i in range(mesh.num_points)])
    elif "BVH" in kind:
        points = np.array(mesh.vertices())
    else:
        return None
    return np.asarray(points * np.array(item.meshScale))
