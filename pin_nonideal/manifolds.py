"""Pairs of shapes as the contacts of their analytic manifold: a place for each way in which they touch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, product
from typing import Any

import numpy as np
import pinocchio as pin

from .collision_shapes import CORNERS, Shape
from .contacts import PointContact
from .errors import InputError
from .hulls import convex_hull, shrunk
from .round_contacts import BoxContact, CapsuleContact, Segment
from .solid_contacts import CylinderContact, EllipsoidContact, HullContact
from .types import Array

Place = PointContact | CapsuleContact | BoxContact | CylinderContact | EllipsoidContact | HullContact

# Part of the least edge to which boxes and hulls are rounded where nothing else is said, and part of its
# radius by which the rim of a cylinder stands back behind its face.
LEAST_ROUNDING = 1e-3
# What carries a cylinder that stands on its face: so many points on this part of its radius.  The rim takes
# over from the tilt at which it is as low as they are, 0.03 rad.
FACE_POINTS, FACE_CIRCLE = 8, 0.97
# Places of one pair beyond which it is refused: rows of all of them take room by the square of their number.
MOST_PLACES = 1000


def manifold(
    who: str, first: Shape, second: Shape, rounding: float | None, base: str, more: dict[str, Any]
) -> list[Place]:
    """The contacts of one pair of shapes.

    Args:
        who: words for messages.
        first: one shape.
        second: another one, on another body.
        rounding: radius to which edges are rounded where edges meet edges [m]; None for the default.
        base: name of all; several are numbered.
        more: mu, static_ratio and restitution of each.

    Raises:
        InputError: no contacts are known for the pair, they are too many, or the rounding does not fit.
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
            found = [_on_revolved(first, second, more)]
        else:
            raise InputError(
                f"{who}: no contacts are known for this pair of shapes, a {first.kind} and a {second.kind}; "
                "a half-space with any other shape is one, and so are spheres, capsules, boxes and convex "
                "meshes with each other, and spheres with cylinders and cones: use PointContact for the "
                "places that touch"
            )
    return [replace(c, name=base if len(found) == 1 else f"{base} {k + 1}") for k, c in enumerate(found)]


def _on_half_space(
    who: str, shape: Shape, ground: Shape, rounding: float | None, more: dict[str, Any]
) -> Iterator[Place]:
    """Any shape over a half-space: its corners and ends, points of its faces and its rims."""
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
    half, *radii = shape.ends
    back = LEAST_ROUNDING * max(radii) if rounding is None else rounding
    if not back < half:
        raise InputError(
            f"{who}: rounding must be less than half the length {2.0 * half:g} m; got {back:g} m"
        )
    for end, radius in zip((-half, half), radii, strict=True):
        if radius == 0.0:
            continue
        for turn in 2.0 * np.pi / FACE_POINTS * np.arange(FACE_POINTS):
            x, y = FACE_CIRCLE * radius * np.array([np.cos(turn), np.sin(turn)])
            yield PointContact(shape.frame, offset=_at(shape, x, y, end), **level)
        middle = _at(shape, 0.0, 0.0, end - np.copysign(back, end))
        yield EllipsoidContact(shape.frame, (radius, radius, 0.0), offset=middle, rpy=rpy, **level)


def _at(shape: Shape, x: float, y: float, z: float) -> tuple[float, float, float]:
    a, b, c = shape.place.act(np.array([x, y, z])).tolist()
    return a, b, c


def _on_revolved(ball: Shape, solid: Shape, more: dict[str, Any]) -> CylinderContact:
    """A sphere on a cylinder or cone."""
    assert solid.ends is not None
    half, below, above = solid.ends
    return CylinderContact(
        ball.frame,
        solid.frame,
        2.0 * half,
        below,
        ball.radius,
        above,
        offset=tuple(ball.points[0].tolist()),
        xyz=tuple(solid.place.translation.tolist()),
        rpy=tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist()),
        **more,
    )


def _solid_manifold(
    who: str, first: Shape, solid: Shape, rounding: float | None, more: dict[str, Any]
) -> list[Place]:
    """A box or convex mesh with a sphere, a capsule or another one: corners on faces, then edges on edges."""
    edge = min(_least_edge(s) for s in (first, solid) if s.solid)
    r2 = 0.0 if not first.solid else LEAST_ROUNDING * edge if rounding is None else rounding
    if not 2.0 * r2 < edge:
        raise InputError(f"{who}: rounding must be less than half the least edge {edge:g} m; got {r2:g} m")
    r1 = r2 if first.solid else first.radius
    cores = _core(who, first, r1), _core(who, solid, r2)
    lines = _edges(first, cores[0]), _edges(solid, cores[1])
    count = len(cores[0]) + first.solid * len(cores[1]) + len(lines[0]) * len(lines[1])
    if count > MOST_PLACES:
        raise InputError(
            f"{who}: two shapes may touch at {MOST_PLACES} places at most, and these have {count}: "
            f"{len(lines[0])} edges by {len(lines[1])} and all corners; use simpler shapes, or PointContact"
        )
    found: list[Place] = []
    for ball, points, target, core, radius in (
        (first, cores[0], solid, cores[1], r1),
        (solid, cores[1], first, cores[0], r2),
    ):
        if target.half is not None:
            found += [_on_box(ball, at, target, radius, r2, more) for at in points]
        elif target.solid:
            corners = tuple(tuple(corner) for corner in core.tolist())
            found += [
                HullContact(ball.frame, target.frame, corners, radius, r2, tuple(at.tolist()), **more)
                for at in points
            ]
    for one, other in product(*lines):
        found.append(CapsuleContact(first.frame, solid.frame, one, other, r1, r2, **more))
    return found


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
    """The corners of a solid less a radius on all sides; of others the points that the radius is around."""
    if not shape.solid:
        return np.unique(shape.points, axis=0)
    if shape.half is None:
        return shape.points if radius == 0.0 else shrunk(shape.points, radius, f'{who}: "{shape.name}"')
    corners = CORNERS * (shape.half - radius)
    return np.asarray(corners @ shape.place.rotation.T + shape.place.translation)


def _edges(shape: Shape, points: Array) -> list[Segment]:
    """The edges of a solid with these corners, or the one of a capsule."""
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
