"""Contacts of two cylinders or cones: their analytic manifold.

Rims and tips are rounded. Faces and sides keep their positions. A contact at a single point involves a rim or
a tip of one shape, or both sides crosswise. Contacts along a line or on a face need more points. The rims
support two sides that lie along each other. The points of a face support it on another face, and the chords
between these points support a side on that face. Chords of both faces support two overlapping faces.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from pin_nonideal.description.contacts.pair_of_shapes import ContactGroup
from pin_nonideal.description.contacts.round import Segment
from pin_nonideal.description.contacts.solids import CylinderContact, RevolvedContact
from pin_nonideal.errors import InputError
from pin_nonideal.types import Table
from pin_nonideal.validation import Vector3

from .cylinder import (
    DEFAULT_ROUNDING,
    SIDE_INSET,
    capsule_contacts,
    capsule_pairs,
    end_coordinates,
    face_points,
    faces,
    inset_side,
    section,
    sphere_contacts,
    to_joint_frame,
)
from .shapes import Shape

# Maximum rounding of rims, relative to the radius of the largest inscribed ball. The inset of the faces
# equals the rounding, so a larger value would leave no core.
MAX_ROUNDING = 0.4
# Minimum distance between a rim and the support points of its face, in radii of rounding.
MIN_RIM_DISTANCE = 2.0


def cylinder_contacts(
    who: str, first: Shape, second: Shape, rounding: float | None, options: Table
) -> list[CylinderContact | ContactGroup | RevolvedContact]:
    """Return the contacts of two cylinders or cones.

    Args:
        who: prefix of error messages.
        first: first shape.
        second: second shape, on another body.
        rounding: radius of the rounded rims, equal to their inset [m]; None for the default.
        options: mu, static_ratio and restitution of each contact.

    Raises:
        InputError: the rounding is too large.
    """
    ball = min(_ball(first), _ball(second))
    inset = DEFAULT_ROUNDING * ball if rounding is None else rounding
    if not inset < MAX_ROUNDING * ball:
        raise InputError(
            f"{who}: rounding must be less than {MAX_ROUNDING:g} of the largest ball inside both, of radius "
            f"{ball:g} m; got {inset:g} m"
        )
    contacts: list[CylinderContact | ContactGroup | RevolvedContact] = []
    core, other_core = (
        _core(inset_side(solid, inset, SIDE_INSET * inset), inset) for solid in (first, second)
    )
    contacts.append(_pair(core, other_core, inset, options))
    for own, other in ((first, second), (second, first)):
        whole = _core(other, inset)
        contacts += [_pair(rim, whole, inset, options) for rim in _rims(own, inset)]
        rounded = {**options, "radius2": inset}
        contacts += sphere_contacts(_core(own, inset).points, inset, own.frame, whole, rounded)
        for ring in _rings(own, inset):
            contacts += sphere_contacts(np.array(ring), 0.0, own.frame, whole, rounded)
        side = _core(inset_side(other, inset, SIDE_INSET * inset), inset)
        chords = [chord for ring in _rings(own, inset) for chord in _chords(ring)]
        contacts += capsule_contacts(chords, 0.0, own.frame, side, rounded)
    chords1, chords2 = [
        [chord for ring in _rings(solid, inset, depth) for chord in _chords(ring)]
        for solid, depth in ((first, 0.0), (second, inset))
    ]
    return contacts + capsule_pairs(first.frame, second.frame, chords1, chords2, 0.0, inset, options)


def _ball(solid: Shape) -> float:
    """Return the radius of the largest inscribed ball [m]."""
    assert solid.ends is not None
    half, below, above = solid.ends
    if below > 0.0 < above:
        return min(half, below, above)
    radius = max(below, above)
    return 2.0 * half * radius / (radius + float(np.hypot(2.0 * half, radius)))


def _core(solid: Shape, inset: float) -> Shape:
    """Return the part of a solid that is at least the given depth below faces and side; it keeps its tip."""
    assert solid.ends is not None
    half, below, above = solid.ends
    slant = float(np.hypot(2.0 * half, below - above)) / (2.0 * half)
    low, high = end_coordinates(solid, inset)
    if above == 0.0:
        high = half - 2.0 * half * inset * slant / below
    elif below == 0.0:
        low = 2.0 * half * inset * slant / above - half
    first, last = (
        (below * (half - z) + above * (half + z)) / (2.0 * half) - inset * slant for z in (low, high)
    )
    place = pin.SE3(solid.place.rotation, np.array(to_joint_frame(solid, 0.0, 0.0, 0.5 * (low + high))))
    ends = 0.5 * (high - low), first if below > 0.0 else 0.0, last if above > 0.0 else 0.0
    tips = [end for end, radius in ((low, below), (high, above)) if radius == 0.0]
    points = np.array([to_joint_frame(solid, 0.0, 0.0, end) for end in tips]).reshape(-1, 3)
    return replace(solid, place=place, points=points, ends=ends)


def _rims(solid: Shape, inset: float) -> list[Shape]:
    """Return the inset rims of a cylinder or cone as disks of thickness zero, without the rounding."""
    core = _core(section(solid, *end_coordinates(solid, inset), 1.0), inset)
    disks = []
    for end, radius in faces(core):
        place = pin.SE3(core.place.rotation, np.array(to_joint_frame(core, 0.0, 0.0, end)))
        disks.append(replace(core, place=place, ends=(0.0, radius, radius)))
    return disks


def _rings(solid: Shape, inset: float, depth: float = 0.0) -> list[list[Vector3]]:
    """Return the support points of each face, at a depth below the face [m]."""
    return [
        face_points(solid, end - float(np.copysign(depth, end)), radius, radius - MIN_RIM_DISTANCE * inset)
        for end, radius in faces(solid)
    ]


def _chords(ring: list[Vector3]) -> list[Segment]:
    return list(zip(ring, ring[1:] + ring[:1], strict=True))


def _pair(first: Shape, second: Shape, inset: float, options: Table) -> RevolvedContact:
    """Return the contact of two cylinders, cones or disks that are rounded by the same radius."""
    places: Table = {}
    for number, solid in ((1, first), (2, second)):
        assert solid.ends is not None
        half, below, above = solid.ends
        places[f"solid{number}"] = (2.0 * half, below, above)
        places[f"xyz{number}"] = tuple(solid.place.translation.tolist())
        places[f"rpy{number}"] = tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist())
    return RevolvedContact(first.frame, second.frame, radius1=inset, radius2=inset, **places, **options)
