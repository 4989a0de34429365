"""Geometry of cylinders and cones: faces, rims and side, and their contacts with spheres and capsules."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.description.contacts.round import Segment
from pin_nonideal.description.contacts.solids import CylinderContact
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array
from pin_nonideal.validation import Vector3

from .shapes import Shape

# Default rounding of boxes and hulls, relative to the shortest edge, and default inset of a cylinder's rims,
# relative to its radius.
LEAST_ROUNDING = 1e-3
# Number of points that support a cylinder on its face, and the radius of their circle relative to the radius
# of the face. From a tilt of 0.03 rad on, the rim is lower than these points.
FACE_POINTS, FACE_CIRCLE = 8, 0.97
# Inset of the side of a cylinder, relative to the rounding of edges or to the inset of rims. It keeps the
# side apart from rims and corners, so that no two contacts coincide and a line along the side touches both
# rims.
PASSED_ON = 0.01


def standing_back(who: str, shape: Shape, rounding: float | None) -> float:
    """Return the distance by which the rims of a cylinder or cone lie behind its faces [m]."""
    assert shape.ends is not None
    half, *radii = shape.ends
    back = LEAST_ROUNDING * max(radii) if rounding is None else rounding
    if not back < half:
        raise InputError(
            f"{who}: rounding must be less than half the length {2.0 * half:g} m; got {back:g} m"
        )
    return back


def faces(shape: Shape) -> list[tuple[float, float]]:
    """Return the axial coordinate [m] and the radius [m] of each face of a cylinder or cone."""
    assert shape.ends is not None
    half, below, above = shape.ends
    return [(end, radius) for end, radius in ((-half, below), (half, above)) if radius > 0.0]


def face_points(shape: Shape, end: float, radius: float, most: float = np.inf) -> list[Vector3]:
    """Return the points that support a face, on a circle of at most the given radius."""
    turns = 2.0 * np.pi / FACE_POINTS * np.arange(FACE_POINTS)
    ways = [min(FACE_CIRCLE * radius, most) * np.array([np.cos(turn), np.sin(turn)]) for turn in turns]
    return [at_place(shape, x, y, end) for x, y in ways]


def at_place(shape: Shape, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Transform a point from the shape's axes, with its axis of revolution as z, to the joint's frame."""
    a, b, c = shape.place.act(np.array([x, y, z])).tolist()
    return a, b, c


def on_revolved(at: Array, radius: float, frame: str, solid: Shape, more: dict[str, Any]) -> CylinderContact:
    """Return the contact of a sphere, or of a rounded corner, with a cylinder or cone."""
    assert solid.ends is not None
    half, below, above = solid.ends
    return CylinderContact(
        frame,
        solid.frame,
        2.0 * half,
        below,
        radius,
        above,
        offset=tuple(at.tolist()),
        xyz=tuple(solid.place.translation.tolist()),
        rpy=tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist()),
        **more,
    )


def line_on_revolved(
    line: Segment, radius: float, frame: str, solid: Shape, more: dict[str, Any]
) -> CylinderContact:
    """Return the contact of a capsule, or of a rounded edge, with a cylinder or cone."""
    return replace(on_revolved(np.array(line[0]), radius, frame, solid, more), end=line[1])


def heights(solid: Shape, back: float) -> tuple[float, float]:
    """Return the axial coordinates of the ends of a cylinder or cone with inset faces; a tip has no inset."""
    assert solid.ends is not None
    half, below, above = solid.ends
    return -half + back * (below > 0.0), half - back * (above > 0.0)


def side_of(solid: Shape, back: float, by: float) -> Shape:
    """Return a cylinder or cone with inset faces, and with its largest radius reduced by the given length."""
    assert solid.ends is not None
    return between(solid, *heights(solid, back), 1.0 - by / max(solid.ends[1:]))


def slices(solid: Shape, back: float) -> list[Shape]:
    """Return thin slices of a cylinder or cone at its inset rims."""
    assert solid.ends is not None
    low, high = heights(solid, back)
    _, below, above = solid.ends
    places = [(low, low + min(back, 0.5 * (high - low)))] * (below > 0.0)
    places += [(high - min(back, 0.5 * (high - low)), high)] * (above > 0.0)
    return [between(solid, *place, 1.0) for place in places]


def between(solid: Shape, low: float, high: float, part: float) -> Shape:
    """Return the part of a cylinder or cone between two axial coordinates, with scaled radii."""
    assert solid.ends is not None
    half, below, above = solid.ends
    first, last = (part * (below * (half - z) + above * (half + z)) / (2.0 * half) for z in (low, high))
    place = pin.SE3(solid.place.rotation, np.array(at_place(solid, 0.0, 0.0, 0.5 * (low + high))))
    return replace(solid, place=place, ends=(0.5 * (high - low), first, last))
