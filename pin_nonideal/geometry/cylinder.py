"""Cylinders and cones: their faces, sides and rims, what stands back from these, and what touches them."""

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

# Part of the least edge to which boxes and hulls are rounded where nothing else is said, and part of its
# radius by which the rim of a cylinder stands back behind its face.
LEAST_ROUNDING = 1e-3
# What carries a cylinder that stands on its face: so many points on this part of its radius.  The rim takes
# over from the tilt at which it is as low as they are, 0.03 rad.
FACE_POINTS, FACE_CIRCLE = 8, 0.97
# Part of the rounding of edges, or of how far rims stand back, by which the side of a cylinder does from its
# rims and from where corners find it: no two places touch at one, and what lies along it lies on both rims.
PASSED_ON = 0.01


def standing_back(who: str, shape: Shape, rounding: float | None) -> float:
    """How far the rims of a cylinder or cone stand back behind its faces [m]."""
    assert shape.ends is not None
    half, *radii = shape.ends
    back = LEAST_ROUNDING * max(radii) if rounding is None else rounding
    if not back < half:
        raise InputError(
            f"{who}: rounding must be less than half the length {2.0 * half:g} m; got {back:g} m"
        )
    return back


def faces(shape: Shape) -> list[tuple[float, float]]:
    """Where the faces of a cylinder or cone are on its axis, and their radii."""
    assert shape.ends is not None
    half, below, above = shape.ends
    return [(end, radius) for end, radius in ((-half, below), (half, above)) if radius > 0.0]


def face_points(shape: Shape, end: float, radius: float, most: float = np.inf) -> list[Vector3]:
    """What carries a face, around it, on a circle of that radius at the most."""
    turns = 2.0 * np.pi / FACE_POINTS * np.arange(FACE_POINTS)
    ways = [min(FACE_CIRCLE * radius, most) * np.array([np.cos(turn), np.sin(turn)]) for turn in turns]
    return [at_place(shape, x, y, end) for x, y in ways]


def at_place(shape: Shape, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A place given in the shape's own axes, its axis along z."""
    a, b, c = shape.place.act(np.array([x, y, z])).tolist()
    return a, b, c


def on_revolved(at: Array, radius: float, frame: str, solid: Shape, more: dict[str, Any]) -> CylinderContact:
    """A sphere, or a rounded corner, on a cylinder or cone."""
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
    """A capsule, or a rounded edge, on a cylinder or cone."""
    return replace(on_revolved(np.array(line[0]), radius, frame, solid, more), end=line[1])


def heights(solid: Shape, back: float) -> tuple[float, float]:
    """Where on its axis the faces of a cylinder or cone are when they stand back; a tip does not."""
    assert solid.ends is not None
    half, below, above = solid.ends
    return -half + back * (below > 0.0), half - back * (above > 0.0)


def side_of(solid: Shape, back: float, by: float) -> Shape:
    """A cylinder or cone whose faces stand back, and whose side does by that much where it is widest."""
    assert solid.ends is not None
    return between(solid, *heights(solid, back), 1.0 - by / max(solid.ends[1:]))


def slices(solid: Shape, back: float) -> list[Shape]:
    """Its rims where its faces stand back, thin slices of it."""
    assert solid.ends is not None
    low, high = heights(solid, back)
    _, below, above = solid.ends
    places = [(low, low + min(back, 0.5 * (high - low)))] * (below > 0.0)
    places += [(high - min(back, 0.5 * (high - low)), high)] * (above > 0.0)
    return [between(solid, *place, 1.0) for place in places]


def between(solid: Shape, low: float, high: float, part: float) -> Shape:
    """A part of the radii of a cylinder or cone, between two places on its axis."""
    assert solid.ends is not None
    half, below, above = solid.ends
    first, last = (part * (below * (half - z) + above * (half + z)) / (2.0 * half) for z in (low, high))
    place = pin.SE3(solid.place.rotation, np.array(at_place(solid, 0.0, 0.0, 0.5 * (low + high))))
    return replace(solid, place=place, ends=(0.5 * (high - low), first, last))
