"""Contacts of spheres and capsules that belong to two bodies: frozen descriptions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pin_nonideal.errors import InputError
from pin_nonideal.types import Array
from pin_nonideal.validation import Vector3, array

from .base import check_rubbing, check_two_frames, check_vectors

__all__ = ["BoxContact", "CapsuleContact", "SphereContact"]


def _check(c: SphereContact | CapsuleContact | BoxContact) -> str:
    """What both say: names of frames, radii and friction."""
    who = check_rubbing(c, "radius1", "radius2")
    check_two_frames(c, who)
    if c.radius1 + c.radius2 == 0.0:
        raise InputError(f"{who}: one of radius1 and radius2 must be positive; two points have no normal")
    return who


@dataclass(frozen=True)
class SphereContact:
    """Two spheres around the origins of two frames, or a sphere and a point, touch with Coulomb friction.

    Gap: phi = |p1 - p2| - radius1 - radius2 [m], never negative; it opens, closes and strikes as that of a
    `PointContact` does.
    Rows: 1 while it is closed.  lam: the normal force on the body of frame1 [N], away from the other; zero
    while open.
    Sliding friction opposes the slip of the two bodies at the place where they touch, with mu lam at most
    while it slips and static_ratio mu lam while it sticks.

    Args:
        frame1: name of the frame in the middle of the first sphere.
        frame2: name of the frame in the middle of the second, on another body or the world.
        radius1: radius of the first [m].
        radius2: radius of the second [m]; 0 for a point.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
    """

    frame1: str
    frame2: str
    radius1: float
    radius2: float = 0.0
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        _check(self)


Segment = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class CapsuleContact:
    """Two capsules, or a capsule and a sphere, touch: all within a radius of a segment on each body.

    Gap: the least distance of the two segments less both radii [m]; else as `SphereContact`.  One place
    touches: two capsules that lie along each other touch at the middle of one of them, and do not resist
    tipping about it.
    Rows: 1 while it is closed.  lam: the normal force on the body of frame1 [N], away from the other.

    Args:
        frame1: name of a frame on the first body.
        frame2: name of a frame on the second, or of the world.
        segment1: both ends of the first segment in the axes of frame1 [m]; the same point twice for a sphere.
        segment2: both ends of the second in those of frame2 [m].
        radius1: radius around the first [m].
        radius2: radius around the second [m].
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
    """

    frame1: str
    frame2: str
    segment1: Segment
    segment2: Segment
    radius1: float
    radius2: float = 0.0
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        who = _check(self)
        for key in ("segment1", "segment2"):
            ends = array(f"{who}: {key}", getattr(self, key), (2, 3))
            object.__setattr__(self, key, tuple(tuple(end) for end in ends.tolist()))


@dataclass(frozen=True)
class BoxContact:
    """A sphere, or a point, touches a box: a solid along edges of its own, rounded with radius2.

    Gap: the distance of the sphere's middle from the box less by radius2 on all sides, less both radii [m];
    else as `SphereContact`.
    Rows: 1 while it is closed.  lam: the normal force on the body of frame1 [N], away from the box.

    Args:
        frame1: name of a frame on the body of the sphere.
        frame2: name of a frame on the body of the box, or of the world.
        size: edges of the box [m], (3,), the rounding included.
        radius1: radius of the sphere [m]; 0 for a point.
        radius2: radius to which the edges of the box are rounded [m], less than half its least edge.
        offset: where the sphere's middle is, in the axes of frame1 [m].
        xyz: where the middle of the box is, in the axes of frame2 [m].
        rpy: how its edges are turned against frame2, roll, pitch and yaw [rad].
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
    """

    frame1: str
    frame2: str
    size: Vector3
    radius1: float
    radius2: float = 0.0
    offset: Vector3 = (0.0, 0.0, 0.0)
    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        who = _check(self)
        check_vectors(self, who, "size", "offset", "xyz", "rpy")
        if not min(self.size) > 2.0 * self.radius2:
            raise InputError(
                f"{who}: each edge of size must be longer than twice radius2; got {list(self.size)} and "
                f"{self.radius2:g}"
            )


def segments(c: SphereContact | CapsuleContact) -> tuple[Array, Array]:
    """Both segments, (2, 3) each, in the axes of their frames.

    Args:
        c: the description.
    """
    if isinstance(c, SphereContact):
        return np.zeros((2, 3)), np.zeros((2, 3))
    return np.array(c.segment1), np.array(c.segment2)
