"""Analytic contact manifolds of pairs of shapes: one contact for each pair of features that can touch."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.description.contacts import PointContact
from pin_nonideal.description.contacts.convex_hull import convex_hull, shrunk
from pin_nonideal.description.contacts.pair_of_shapes import BallContacts, ContactGroup, numbered
from pin_nonideal.description.contacts.round import BoxContact, CapsuleContact, Segment
from pin_nonideal.description.contacts.solids import (
    CylinderContact,
    EllipsoidContact,
    HullContact,
    RevolvedContact,
    RimContact,
)
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Table

from .cylinder import (
    DEFAULT_ROUNDING,
    SIDE_INSET,
    capsule_contacts,
    capsule_pairs,
    end_coordinates,
    face_points,
    faces,
    inset_side,
    rim_inset,
    rim_slices,
    rows_of,
    section,
    sphere_contacts,
    to_joint_frame,
)
from .cylinder_manifold import cylinder_contacts
from .shapes import CORNERS, Shape

# Pairs of corners of a box that an edge joins.
BOX_EDGES = [(i, j) for i, j in combinations(range(len(CORNERS)), 2) if (CORNERS[i] != CORNERS[j]).sum() == 1]

ManifoldContact = (
    PointContact
    | CapsuleContact
    | ContactGroup
    | BoxContact
    | CylinderContact
    | EllipsoidContact
    | HullContact
    | RimContact
    | RevolvedContact
)

# Maximum number of contacts of one pair. The rows of all contacts need memory proportional to the square of
# their number.
MAX_CONTACTS = 1000


def manifold(
    who: str, first: Shape, second: Shape, rounding: float | None, base: str, options: Table
) -> tuple[object, ...]:
    """Return the parts of the manifold of one pair of shapes: contacts, and contacts of all their edges.

    Args:
        who: prefix of error messages.
        first: first shape.
        second: second shape, on another body.
        rounding: radius of edges that can touch edges [m]; None for the default.
        base: name of the contacts; several contacts are numbered.
        options: mu, static_ratio and restitution of each contact.

    Raises:
        InputError: the pair has no manifold, the contacts are too many, or the rounding is too large.
    """
    if first.normal is not None:
        first, second = second, first
    contacts: list[Any]
    if second.normal is not None and first.normal is None:
        contacts = list(_half_space_contacts(who, first, second, rounding, options))
    elif first.is_round and second.is_round:
        ends = _segment(first.points), _segment(second.points)
        contacts = [CapsuleContact(first.frame, second.frame, *ends, first.radius, second.radius, **options)]
    else:
        if first.solid and (second.solid or second.is_round):
            first, second = second, first
        if first.ends is not None:
            first, second = second, first
        if second.solid and (first.solid or first.is_round):
            contacts = _solid_manifold(who, first, second, rounding, options)
        elif second.ends is not None and first.kind == "Sphere":
            contacts = sphere_contacts(first.points[:1], first.radius, first.frame, second, options)
        elif second.ends is not None and (first.solid or first.is_round):
            contacts = _cylinder_manifold(who, first, second, rounding, options)
        elif first.ends is not None and second.ends is not None:
            contacts = cylinder_contacts(who, first, second, rounding, options)
        else:
            raise InputError(
                f"{who}: this pair of shapes is not supported, a {first.kind} and a {second.kind}; supported "
                "pairs are a half-space with any other shape, and spheres, capsules, boxes, convex meshes, "
                "cylinders and cones with each other: use PointContact for the points that touch"
            )
    return numbered(contacts, base)


def _half_space_contacts(
    who: str, shape: Shape, ground: Shape, rounding: float | None, options: Table
) -> Iterator[ManifoldContact]:
    """Yield the contacts of a shape with a half-space: corners, ends, points of faces, and rims."""
    assert ground.normal is not None
    level: Table = {
        "plane": None if ground.frame == "universe" else ground.frame,
        "normal": tuple(ground.normal.tolist()),
        "height": float(ground.normal @ ground.points[0]),
        **options,
    }
    if len(shape.points):
        offsets = rows_of(np.unique(shape.points, axis=0))
        like = PointContact(shape.frame, offset=offsets[0], radius=shape.radius, **level)
        yield BallContacts(like, offsets)
    rpy = tuple(pin.rpy.matrixToRpy(shape.place.rotation).tolist())
    if shape.semiaxes is not None:
        xyz, semiaxes = tuple(shape.place.translation.tolist()), tuple(shape.semiaxes.tolist())
        yield EllipsoidContact(shape.frame, semiaxes, offset=xyz, rpy=rpy, **level)
    if shape.ends is None:
        return
    inset = rim_inset(who, shape, rounding)
    for end, radius in faces(shape):
        offsets = tuple(face_points(shape, end, radius))
        yield BallContacts(PointContact(shape.frame, offset=offsets[0], **level), offsets)
        middle = to_joint_frame(shape, 0.0, 0.0, end - np.copysign(inset, end))
        # The rim belongs to a disk, an ellipsoid without thickness.
        yield EllipsoidContact(shape.frame, (radius, radius, 0.0), offset=middle, rpy=rpy, **level)


def _cylinder_manifold(
    who: str, other: Shape, solid: Shape, rounding: float | None, options: Table
) -> list[ManifoldContact]:
    """Return the contacts of a capsule, box or convex mesh with a cylinder or cone.

    Corners, and the ends of a capsule, touch the whole solid. Edges, and the segment of a capsule, touch the
    slightly inset side, the rims and the chords between the support points of the faces. These support points
    and the tip touch the faces of a box or mesh. The rims touch its faces and edges.
    """
    inset = rim_inset(who, solid, rounding)
    radius = _edge_radius(who, [other], rounding) if other.solid else other.radius
    core = _core(who, other, radius)
    lines = _edges(other, core)
    rings = [face_points(solid, *face) for face in faces(solid)]
    chords = [ends for points in rings for ends in zip(points, points[1:] + points[:1], strict=True)]
    tips = [*solid.points.tolist(), *(point for points in rings for point in points)]
    on_faces = len(tips) if other.solid else 0
    count = len(core) + len(lines) * (1 + len(chords)) + on_faces + len(rings)
    _check_count(who, count, f"{len(lines)} edges by {1 + len(chords)}")
    side = inset_side(solid, inset, SIDE_INSET * (radius if other.solid else inset))
    contacts: list[ManifoldContact] = [*sphere_contacts(core, radius, other.frame, solid, options)]
    contacts += capsule_contacts(lines, radius, other.frame, side, options)
    contacts += capsule_pairs(other.frame, solid.frame, lines, chords, radius, 0.0, options)
    if not other.solid:
        for disk in rim_slices(solid, inset):
            contacts += capsule_contacts(lines, radius, other.frame, disk, options)
        return contacts
    contacts.append(_solid_contacts(solid, np.array(tips), other, core, 0.0, radius, options))
    rpy, points = tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist()), rows_of(core)
    inner = section(solid, *end_coordinates(solid, inset), 1.0)
    for end, rim in faces(inner):
        middle = to_joint_frame(inner, 0.0, 0.0, end)
        contacts.append(
            RimContact(solid.frame, other.frame, points, rim, radius, offset=middle, rpy=rpy, **options)
        )
    return contacts


def _solid_manifold(
    who: str, first: Shape, solid: Shape, rounding: float | None, options: Table
) -> list[ManifoldContact]:
    """Return the contacts of a box or convex mesh with a sphere, a capsule, a box or a convex mesh."""
    r2 = _edge_radius(who, [first, solid], rounding) if first.solid else 0.0
    r1 = r2 if first.solid else first.radius
    cores = _core(who, first, r1), _core(who, solid, r2)
    lines = _edges(first, cores[0]), _edges(solid, cores[1])
    count = len(cores[0]) + first.solid * len(cores[1]) + len(lines[0]) * len(lines[1])
    _check_count(who, count, f"{len(lines[0])} edges by {len(lines[1])}")
    contacts: list[ManifoldContact] = []
    for ball, points, target, core, radius in (
        (first, cores[0], solid, cores[1], r1),
        (solid, cores[1], first, cores[0], r2),
    ):
        if target.solid:
            contacts.append(_solid_contacts(ball, points, target, core, radius, r2, options))
    return contacts + capsule_pairs(first.frame, solid.frame, *lines, r1, r2, options)


def _edge_radius(who: str, shapes: list[Shape], rounding: float | None) -> float:
    """Return the radius of the rounded edges of boxes and meshes [m]."""
    edge = min(_min_edge(shape) for shape in shapes if shape.solid)
    radius = DEFAULT_ROUNDING * edge if rounding is None else rounding
    if not 2.0 * radius < edge:
        raise InputError(
            f"{who}: rounding must be less than half the least edge {edge:g} m; got {radius:g} m"
        )
    return radius


def _check_count(who: str, count: int, edges: str) -> None:
    if count > MAX_CONTACTS:
        raise InputError(
            f"{who}: two shapes may have at most {MAX_CONTACTS} contact points, and these have {count}: "
            f"{edges} and all corners; use simpler shapes, or PointContact"
        )


def _solid_contacts(
    ball: Shape,
    points: Array,
    target: Shape,
    core: Array,
    radius: float,
    rounding: float,
    options: Table,
) -> BallContacts:
    """Return the contacts of spheres or points of a body with a rounded box or mesh with these corners."""
    offsets = rows_of(points)
    first: BoxContact | HullContact
    if target.half is not None:
        size = tuple((2.0 * target.half).tolist())
        rpy = tuple(pin.rpy.matrixToRpy(target.place.rotation).tolist())
        xyz = tuple(target.place.translation.tolist())
        first = BoxContact(
            ball.frame, target.frame, size, radius, rounding, offset=offsets[0], xyz=xyz, rpy=rpy, **options
        )
    else:
        first = HullContact(ball.frame, target.frame, rows_of(core), radius, rounding, offsets[0], **options)
    return BallContacts(first, offsets)


def _min_edge(shape: Shape) -> float:
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
    corners = rows_of(points)
    return [(corners[i], corners[j]) for i, j in BOX_EDGES]


def _segment(points: Array) -> Segment:
    first, last = points[[0, -1]].tolist()
    return tuple(first), tuple(last)
