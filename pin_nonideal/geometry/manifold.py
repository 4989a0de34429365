"""Analytic contact manifolds of pairs of shapes: one contact for each pair of features that can touch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, product
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.description.contacts import PointContact
from pin_nonideal.description.contacts.convex_hull import convex_hull, shrunk
from pin_nonideal.description.contacts.round import BoxContact, CapsuleContact, Segment
from pin_nonideal.description.contacts.solids import (
    CylinderContact,
    EllipsoidContact,
    HullContact,
    RevolvedContact,
    RimContact,
)
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array
from pin_nonideal.validation import Vector3

from .cylinder import (
    LEAST_ROUNDING,
    PASSED_ON,
    at_place,
    between,
    face_points,
    faces,
    heights,
    line_on_revolved,
    on_revolved,
    side_of,
    slices,
    standing_back,
)
from .cylinder_manifold import two_revolved
from .shapes import CORNERS, Shape

Place = (
    PointContact
    | CapsuleContact
    | BoxContact
    | CylinderContact
    | EllipsoidContact
    | HullContact
    | RimContact
    | RevolvedContact
)

# Maximum number of contacts of one pair. The rows of all contacts need memory proportional to the square of
# their number.
MOST_PLACES = 1000


def manifold(
    who: str, first: Shape, second: Shape, rounding: float | None, base: str, more: dict[str, Any]
) -> list[Place]:
    """Return the contacts of one pair of shapes.

    Args:
        who: prefix of error messages.
        first: first shape.
        second: second shape, on another body.
        rounding: radius of edges that can touch edges [m]; None for the default.
        base: name of the contacts; several contacts are numbered.
        more: mu, static_ratio and restitution of each contact.

    Raises:
        InputError: the pair has no manifold, the contacts are too many, or the rounding is too large.
    """
    if first.normal is not None:
        first, second = second, first
    found: list[Any]
    if second.normal is not None and first.normal is None:
        found = list(_on_half_space(who, first, second, rounding, more))
    elif first.is_round and second.is_round:
        ends = _segment(first.points), _segment(second.points)
        found = [CapsuleContact(first.frame, second.frame, *ends, first.radius, second.radius, **more)]
    else:
        if first.solid and (second.solid or second.is_round):
            first, second = second, first
        if first.ends is not None:
            first, second = second, first
        if second.solid and (first.solid or first.is_round):
            found = _solid_manifold(who, first, second, rounding, more)
        elif second.ends is not None and first.kind == "Sphere":
            found = [on_revolved(first.points[0], first.radius, first.frame, second, more)]
        elif second.ends is not None and (first.solid or first.is_round):
            found = _revolved_manifold(who, first, second, rounding, more)
        elif first.ends is not None and second.ends is not None:
            found = two_revolved(who, first, second, rounding, more)
        else:
            raise InputError(
                f"{who}: no contacts are known for this pair of shapes, a {first.kind} and a {second.kind}; "
                "a half-space with any other shape is one, and so are spheres, capsules, boxes, convex "
                "meshes, cylinders and cones with each other: use PointContact for the places that touch"
            )
    return [replace(c, name=base if len(found) == 1 else f"{base} {k + 1}") for k, c in enumerate(found)]


def _on_half_space(
    who: str, shape: Shape, ground: Shape, rounding: float | None, more: dict[str, Any]
) -> Iterator[Place]:
    """Yield the contacts of a shape with a half-space: corners, ends, points of faces, and rims."""
    assert ground.normal is not None
    level: dict[str, Any] = {
        "plane": None if ground.frame == "universe" else ground.frame,
        "normal": tuple(ground.normal.tolist()),
        "height": float(ground.normal @ ground.points[0]),
        **more,
    }
    for point in np.unique(shape.points, axis=0):
        yield PointContact(shape.frame, offset=tuple(point.tolist()), radius=shape.radius, **level)
    rpy = tuple(pin.rpy.matrixToRpy(shape.place.rotation).tolist())
    if shape.semiaxes is not None:
        xyz, semiaxes = tuple(shape.place.translation.tolist()), tuple(shape.semiaxes.tolist())
        yield EllipsoidContact(shape.frame, semiaxes, offset=xyz, rpy=rpy, **level)
    if shape.ends is None:
        return
    back = standing_back(who, shape, rounding)
    for end, radius in faces(shape):
        for point in face_points(shape, end, radius):
            yield PointContact(shape.frame, offset=point, **level)
        middle = at_place(shape, 0.0, 0.0, end - np.copysign(back, end))
        yield EllipsoidContact(shape.frame, (radius, radius, 0.0), offset=middle, rpy=rpy, **level)


def _revolved_manifold(
    who: str, other: Shape, solid: Shape, rounding: float | None, more: dict[str, Any]
) -> list[Place]:
    """Return the contacts of a capsule, box or convex mesh with a cylinder or cone.

    Corners, and the ends of a capsule, touch the whole solid. Edges, and the segment of a capsule, touch the
    slightly inset side, the rims and the chords between the support points of the faces. These support points
    and the tip touch the faces of a box or mesh. The rims touch its faces and edges.
    """
    back = standing_back(who, solid, rounding)
    radius = _edge_radius(who, [other], rounding) if other.solid else other.radius
    core = _core(who, other, radius)
    lines = _edges(other, core)
    rings = [face_points(solid, *face) for face in faces(solid)]
    chords = [ends for points in rings for ends in zip(points, points[1:] + points[:1], strict=True)]
    tips = [*solid.points.tolist(), *(point for points in rings for point in points)]
    on_faces = len(tips) if other.solid else 0
    count = len(core) + len(lines) * (1 + len(chords)) + on_faces + len(rings)
    _check_count(who, count, f"{len(lines)} edges by {1 + len(chords)}")
    side = side_of(solid, back, PASSED_ON * (radius if other.solid else back))
    found: list[Place] = [on_revolved(at, radius, other.frame, solid, more) for at in core]
    found += [line_on_revolved(line, radius, other.frame, side, more) for line in lines]
    for line, chord in product(lines, chords):
        found.append(CapsuleContact(other.frame, solid.frame, line, chord, radius, 0.0, **more))
    if not other.solid:
        rims = slices(solid, back)
        return found + [
            line_on_revolved(line, radius, other.frame, rim, more) for line in lines for rim in rims
        ]
    found += [_on_solid(solid, np.array(at), other, core, 0.0, radius, more) for at in tips]
    rpy = tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist())
    inner = between(solid, *heights(solid, back), 1.0)
    for end, rim in faces(inner):
        middle = at_place(inner, 0.0, 0.0, end)
        found.append(
            RimContact(solid.frame, other.frame, _rows(core), rim, radius, offset=middle, rpy=rpy, **more)
        )
    return found


def _solid_manifold(
    who: str, first: Shape, solid: Shape, rounding: float | None, more: dict[str, Any]
) -> list[Place]:
    """Return the contacts of a box or convex mesh with a sphere, a capsule, a box or a convex mesh."""
    r2 = _edge_radius(who, [first, solid], rounding) if first.solid else 0.0
    r1 = r2 if first.solid else first.radius
    cores = _core(who, first, r1), _core(who, solid, r2)
    lines = _edges(first, cores[0]), _edges(solid, cores[1])
    count = len(cores[0]) + first.solid * len(cores[1]) + len(lines[0]) * len(lines[1])
    _check_count(who, count, f"{len(lines[0])} edges by {len(lines[1])}")
    found: list[Place] = []
    for ball, points, target, core, radius in (
        (first, cores[0], solid, cores[1], r1),
        (solid, cores[1], first, cores[0], r2),
    ):
        if target.solid:
            found += [_on_solid(ball, at, target, core, radius, r2, more) for at in points]
    for one, other in product(*lines):
        found.append(CapsuleContact(first.frame, solid.frame, one, other, r1, r2, **more))
    return found


def _edge_radius(who: str, shapes: list[Shape], rounding: float | None) -> float:
    """Return the radius of the rounded edges of boxes and meshes [m]."""
    edge = min(_least_edge(shape) for shape in shapes if shape.solid)
    radius = LEAST_ROUNDING * edge if rounding is None else rounding
    if not 2.0 * radius < edge:
        raise InputError(
            f"{who}: rounding must be less than half the least edge {edge:g} m; got {radius:g} m"
        )
    return radius


def _check_count(who: str, count: int, edges: str) -> None:
    if count > MOST_PLACES:
        raise InputError(
            f"{who}: two shapes may touch at {MOST_PLACES} places at most, and these have {count}: "
            f"{edges} and all corners; use simpler shapes, or PointContact"
        )


def _rows(points: Array) -> tuple[Vector3, ...]:
    return tuple((x, y, z) for x, y, z in points.tolist())


def _on_solid(
    ball: Shape, at: Array, target: Shape, core: Array, radius: float, rounding: float, more: dict[str, Any]
) -> BoxContact | HullContact:
    """Return the contact of a sphere or a point with a rounded box or mesh with these corners."""
    if target.half is not None:
        return _on_box(ball, at, target, radius, rounding, more)
    offset = tuple(at.tolist())
    return HullContact(ball.frame, target.frame, _rows(core), radius, rounding, offset, **more)


def _on_box(
    ball: Shape, at: Array, box: Shape, radius: float, rounding: float, more: dict[str, Any]
) -> BoxContact:
    assert box.half is not None
    size = tuple((2.0 * box.half).tolist())
    rpy = tuple(pin.rpy.matrixToRpy(box.place.rotation).tolist())
    xyz = tuple(box.place.translation.tolist())
    offset = tuple(at.tolist())
    return BoxContact(ball.frame, box.frame, size, radius, rounding, offset=offset, xyz=xyz, rpy=rpy, **more)


def _least_edge(shape: Shape) -> float:
    if shape.half is not None:
        return 2.0 * float(shape.half.min())
    ends = np.array(_edges(shape, shape.points))
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min())


def _core(who: str, shape: Shape, radius: float) -> Array:
    """Return the corners of a solid shrunk by a radius, or the points of a sphere or capsule."""
    if not shape.solid:
        return np.unique(shape.points, axis=0)
    if shape.half is None:
        return shape.points if radius == 0.0 else shrunk(shape.points, radius, f'{who}: "{shape.name}"')
    corners = CORNERS * (shape.half - radius)
    return np.asarray(corners @ shape.place.rotation.T + shape.place.translation)


def _edges(shape: Shape, points: Array) -> list[Segment]:
    """Return the edges of a solid with these corners, or the segment of a capsule."""
    if not shape.solid:
        return [_segment(points)] if len(points) == 2 else []
    if shape.half is None:
        hull = convex_hull(points, shape.name)
        return [_segment(hull.points[edge[:2]]) for edge in hull.edges]
    pairs = combinations(range(len(CORNERS)), 2)
    return [_segment(points[[i, j]]) for i, j in pairs if (CORNERS[i] != CORNERS[j]).sum() == 1]


def _segment(points: Array) -> Segment:
    first, last = points[[0, -1]].tolist()
    return tuple(first), tuple(last)
