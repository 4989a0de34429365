"""Geometry of cylinders and cones: faces, rims and side, and their contacts with spheres and capsules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from pin_nonideal.description.contacts.base import similar
from pin_nonideal.description.contacts.pair_of_shapes import BallContacts, CapsulePairs
from pin_nonideal.description.contacts.round import CapsuleContact, Segment
from pin_nonideal.description.contacts.solids import CylinderContact
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Table
from pin_nonideal.validation import Vector3

from .shapes import Shape

# Default rounding of boxes and hulls, relative to the shortest edge, and default inset of a cylinder's rims,
# relative to its radius.
DEFAULT_ROUNDING = 1e-3
# Number of points that support a cylinder on its face, and the radius of their circle relative to the radius
# of the face. From a tilt of 0.03 rad on, the rim is lower than these points.
FACE_POINTS, FACE_CIRCLE_RATIO = 8, 0.97
# Inset of the side of a cylinder, relative to the rounding of edges or to the inset of rims. The inset keeps
# the side apart from rims and corners, so that no two contacts coincide and a line along the side touches
# both rims.
SIDE_INSET = 0.01


def rim_inset(who: str, shape: Shape, rounding: float | None) -> float:
    """Return the distance by which the rims of a cylinder or cone lie behind its faces [m]."""
    assert shape.ends is not None
    half, *radii = shape.ends
    inset = DEFAULT_ROUNDING * max(radii) if rounding is None else rounding
    if not inset < half:
        raise InputError(
            f"{who}: rounding must be less than half the length {2.0 * half:g} m; got {inset:g} m"
        )
    return inset


def faces(shape: Shape) -> list[tuple[float, float]]:
    """Return the axial coordinate [m] and the radius [m] of each face of a cylinder or cone."""
    assert shape.ends is not None
    half, below, above = shape.ends
    return [(end, radius) for end, radius in ((-half, below), (half, above)) if radius > 0.0]


def face_points(shape: Shape, end: float, radius: float, max_radius: float = np.inf) -> list[Vector3]:
    """Return the points that support a face, on a circle of at most the given radius."""
    angles = 2.0 * np.pi / FACE_POINTS * np.arange(FACE_POINTS)
    offsets = [
        min(FACE_CIRCLE_RATIO * radius, max_radius) * np.array([np.cos(angle), np.sin(angle)])
        for angle in angles
    ]
    return [to_joint_frame(shape, x, y, end) for x, y in offsets]


def to_joint_frame(shape: Shape, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Transform a point from the shape's axes, with its axis of revolution as z, to the joint's frame."""
    a, b, c = shape.place.act(np.array([x, y, z])).tolist()
    return a, b, c


def rows_of(points: Array) -> tuple[Vector3, ...]:
    """Return points as tuples of three numbers."""
    return tuple((x, y, z) for x, y, z in points.tolist())


def sphere_contacts(
    points: Array, radius: float, frame: str, solid: Shape, options: Table
) -> list[BallContacts]:
    """Return the contacts of spheres, or of rounded corners, with a cylinder or cone."""
    offsets = rows_of(points)
    if not offsets:
        return []
    return [BallContacts(_with_solid((offsets[0], None), radius, frame, solid, options), offsets)]


def capsule_contacts(
    lines: Sequence[Segment], radius: float, frame: str, solid: Shape, options: Table
) -> list[CylinderContact]:
    """Return the contacts of capsules, or of rounded edges, with a cylinder or cone."""
    if not lines:
        return []
    first = _with_solid(lines[0], radius, frame, solid, options)
    return [similar(first, offset=one, end=other) for one, other in lines]


def _with_solid(
    ends: tuple[Vector3, Vector3 | None],
    radius: float,
    frame: str,
    solid: Shape,
    options: Table,
) -> CylinderContact:
    """Return the contact of a capsule, or of a sphere without a second end, with a cylinder or cone."""
    assert solid.ends is not None
    half, below, above = solid.ends
    return CylinderContact(
        frame,
        solid.frame,
        2.0 * half,
        below,
        radius,
        above,
        offset=ends[0],
        end=ends[1],
        xyz=tuple(solid.place.translation.tolist()),
        rpy=tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist()),
        **options,
    )


def capsule_pairs(
    frame1: str,
    frame2: str,
    lines1: Sequence[Segment],
    lines2: Sequence[Segment],
    radius1: float,
    radius2: float,
    options: Table,
) -> list[CapsulePairs]:
    """Return the contacts of each of some capsules with each of other capsules."""
    if not (lines1 and lines2):
        return []
    first = CapsuleContact(frame1, frame2, lines1[0], lines2[0], radius1, radius2, **options)
    return [CapsulePairs(first, tuple(lines1), tuple(lines2))]


def end_coordinates(solid: Shape, inset: float) -> tuple[float, float]:
    """Return the axial coordinates of the ends of a cylinder or cone with inset faces; a tip has no inset."""
    assert solid.ends is not None
    half, below, above = solid.ends
    return -half + inset * (below > 0.0), half - inset * (above > 0.0)


def inset_side(solid: Shape, inset: float, reduction: float) -> Shape:
    """Return a cylinder or cone with inset faces, and with its largest radius reduced by the given length."""
    assert solid.ends is not None
    return section(solid, *end_coordinates(solid, inset), 1.0 - reduction / max(solid.ends[1:]))


def rim_slices(solid: Shape, inset: float) -> list[Shape]:
    """Return thin slices of a cylinder or cone at its inset rims."""
    assert solid.ends is not None
    low, high = end_coordinates(solid, inset)
    _, below, above = solid.ends
    places = [(low, low + min(inset, 0.5 * (high - low)))] * (below > 0.0)
    places += [(high - min(inset, 0.5 * (high - low)), high)] * (above > 0.0)
    return [section(solid, *place, 1.0) for place in places]


def section(solid: Shape, low: float, high: float, scale: float) -> Shape:
    """Return the part of a cylinder or cone between two axial coordinates, with scaled radii."""
    assert solid.ends is not None
    half, below, above = solid.ends
    first, last = (scale * (below * (half - z) + above * (half + z)) / (2.0 * half) for z in (low, high))
    place = pin.SE3(solid.place.rotation, np.array(to_joint_frame(solid, 0.0, 0.0, 0.5 * (low + high))))
    return replace(solid, place=place, ends=(0.5 * (high - low), first, last))
