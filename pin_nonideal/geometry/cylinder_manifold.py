"""Contacts of two cylinders or cones: their analytic manifold.

Rims and tips are rounded. Faces and sides keep their positions. A contact at a single point involves a rim or
a tip of one shape, or both sides crosswise. Contacts along a line or on a face need more points. The rims
support two sides that lie along each other. The points of a face support it on another face, and the chords
between these points support a side on that face. Chords of both faces support two overlapping faces.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.description.contacts.round import CapsuleContact, Segment
from pin_nonideal.description.contacts.solids import CylinderContact, RevolvedContact
from pin_nonideal.errors import InputError
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
)
from .shapes import Shape

# Maximum rounding of rims, relative to the radius of the largest inscribed ball. The inset of the faces
# equals the rounding, so a larger value would leave no core.
MOST_ROUNDING = 0.4
# Minimum distance between a rim and the support points of its face, in radii of rounding.
WITHIN_RIM = 2.0


def two_revolved(
    who: str, first: Shape, second: Shape, rounding: float | None, more: dict[str, Any]
) -> list[CylinderContact | CapsuleContact | RevolvedContact]:
    """Return the contacts of two cylinders or cones.

    Args:
        who: prefix of error messages.
        first: first shape.
        second: second shape, on another body.
        rounding: radius of the rounded rims, equal to their inset [m]; None for the default.
        more: mu, static_ratio and restitution of each contact.

    Raises:
        InputError: the rounding is too large.
    """
    ball = min(_ball(first), _ball(second))
    by = LEAST_ROUNDING * ball if rounding is None else rounding
    if not by < MOST_ROUNDING * ball:
        raise InputError(
            f"{who}: rounding must be less than {MOST_ROUNDING:g} of the largest ball inside both, of radius "
            f"{ball:g} m; got {by:g} m"
        )
    found: list[CylinderContact | CapsuleContact | RevolvedContact] = []
    one, another = (_core(side_of(solid, by, PASSED_ON * by), by) for solid in (first, second))
    found.append(_pair(one, another, by, more))
    for own, other in ((first, second), (second, first)):
        whole = _core(other, by)
        found += [_pair(rim, whole, by, more) for rim in _rims(own, by)]
        for tip in _core(own, by).points:
            found.append(replace(on_revolved(tip, by, own.frame, whole, more), radius2=by))
        for ring in _rings(own, by):
            found += [
                on_revolved(np.array(at), 0.0, own.frame, whole, {**more, "radius2": by}) for at in ring
            ]
        beside = _core(side_of(other, by, PASSED_ON * by), by)
        chords = [chord for ring in _rings(own, by) for chord in _chords(ring)]
        found += [
            line_on_revolved(chord, 0.0, own.frame, beside, {**more, "radius2": by}) for chord in chords
        ]
    lower = [
        [chord for ring in _rings(solid, by, depth) for chord in _chords(ring)]
        for solid, depth in ((first, 0.0), (second, by))
    ]
    for line1, line2 in product(*lower):
        found.append(CapsuleContact(first.frame, second.frame, line1, line2, 0.0, by, **more))
    return found


def _ball(solid: Shape) -> float:
    """Return the radius of the largest inscribed ball [m]."""
    assert solid.ends is not None
    half, below, above = solid.ends
    if below > 0.0 < above:
        return min(half, below, above)
    radius = max(below, above)
    return 2.0 * half * radius / (radius + float(np.hypot(2.0 * half, radius)))


def _core(solid: Shape, by: float) -> Shape:
    """Return the part of a solid that is at least the given depth below faces and side; it keeps its tip."""
    assert solid.ends is not None
    half, below, above = solid.ends
    slant = float(np.hypot(2.0 * half, below - above)) / (2.0 * half)
    low, high = heights(solid, by)
    if above == 0.0:
        high = half - 2.0 * half * by * slant / below
    elif below == 0.0:
        low = 2.0 * half * by * slant / above - half
    first, last = ((below * (half - z) + above * (half + z)) / (2.0 * half) - by * slant for z in (low, high))
    place = pin.SE3(solid.place.rotation, np.array(at_place(solid, 0.0, 0.0, 0.5 * (low + high))))
    ends = 0.5 * (high - low), first if below > 0.0 else 0.0, last if above > 0.0 else 0.0
    tips = [end for end, radius in ((low, below), (high, above)) if radius == 0.0]
    points = np.array([at_place(solid, 0.0, 0.0, end) for end in tips]).reshape(-1, 3)
    return replace(solid, place=place, points=points, ends=ends)


def _rims(solid: Shape, by: float) -> list[Shape]:
    """Return the inset rims of a cylinder or cone as disks of thickness zero, without the rounding."""
    core = _core(between(solid, *heights(solid, by), 1.0), by)
    disks = []
    for end, radius in faces(core):
        place = pin.SE3(core.place.rotation, np.array(at_place(core, 0.0, 0.0, end)))
        disks.append(replace(core, place=place, ends=(0.0, radius, radius)))
    return disks


def _rings(solid: Shape, by: float, depth: float = 0.0) -> list[list[Vector3]]:
    """Return the support points of each face, at a depth below the face [m]."""
    return [
        face_points(solid, end - float(np.copysign(depth, end)), radius, radius - WITHIN_RIM * by)
        for end, radius in faces(solid)
    ]


def _chords(ring: list[Vector3]) -> list[Segment]:
    return list(zip(ring, ring[1:] + ring[:1], strict=True))


def _pair(first: Shape, second: Shape, by: float, more: dict[str, Any]) -> RevolvedContact:
    """Return the contact of two cylinders, cones or disks that are rounded by the same radius."""
    places: dict[str, Any] = {}
    for number, solid in ((1, first), (2, second)):
        assert solid.ends is not None
        half, below, above = solid.ends
        places[f"solid{number}"] = (2.0 * half, below, above)
        places[f"xyz{number}"] = tuple(solid.place.translation.tolist())
        places[f"rpy{number}"] = tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist())
    return RevolvedContact(first.frame, second.frame, radius1=by, radius2=by, **places, **more)
