"""Frozen descriptions of contacts of spheres, capsules and boxes on two bodies."""

from __future__ import annotations

from dataclasses import dataclass

from pin_nonideal.errors import InputError
from pin_nonideal.validation import Vector3, array

from .base import check_friction, check_two_frames, check_vectors

__all__ = ["BoxContact", "CapsuleContact", "SphereContact"]


def _check(c: SphereContact | CapsuleContact | BoxContact) -> str:
    """Check the common fields: names of frames, radii and friction."""
    who = check_friction(c, "radius1", "radius2")
    check_two_frames(c, who)
    if c.radius1 + c.radius2 == 0.0:
        raise InputError(f"{who}: one of radius1 and radius2 must be positive; two points have no normal")
    return who


@dataclass(frozen=True)
class SphereContact:
    """Contact of two spheres around two frames' origins, or of a sphere and a point, with Coulomb friction.

    Gap: phi = |p1 - p2| - radius1 - radius2 [m], never negative. The contact opens, closes and has impacts
    like a `PointContact`.
    Rows: 1 while closed. lam: normal force on the body of frame1 [N], away from the other body; zero while
    open.
    Sliding friction opposes the slip of the two bodies at the contact point. This friction is at most mu lam
    while slipping and static_ratio mu lam while sticking.

    Args:
        frame1: name of the frame at the center of the first sphere.
        frame2: name of the frame at the center of the second sphere, on another body or the world.
        radius1: radius of the first sphere [m].
        radius2: radius of the second sphere [m]; 0 for a point.
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
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


Segment = tuple[Vector3, Vector3]
CENTER: Segment = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class CapsuleContact:
    """Contact of two capsules, or of a capsule and a sphere, with Coulomb friction.

    A capsule is the set of points within a radius of a segment.
    Gap: distance of the two segments minus both radii [m]; otherwise as `SphereContact`. The contact has one
    point: parallel capsules touch at the middle of one of them and do not resist tipping about this point.
    Rows: 1 while closed. lam: normal force on the body of frame1 [N], away from the other body.

    Args:
        frame1: name of a frame on the first body.
        frame2: name of a frame on the second body, or of the world.
        segment1: both ends of the first segment in the axes of frame1 [m]; the same point twice for a sphere.
        segment2: both ends of the second segment in the axes of frame2 [m].
        radius1: radius of the first capsule [m].
        radius2: radius of the second capsule [m].
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
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
    """Contact of a sphere, or a point, with a box whose edges are rounded with radius2.

    Gap: distance of the sphere's center from the box shrunk by radius2 on all sides, minus both radii [m];
    otherwise as `SphereContact`.
    Rows: 1 while closed. lam: normal force on the body of frame1 [N], away from the box.

    Args:
        frame1: name of a frame on the body of the sphere.
        frame2: name of a frame on the body of the box, or of the world.
        size: edges of the box [m], (3,), including the rounding.
        radius1: radius of the sphere [m]; 0 for a point.
        radius2: rounding radius of the edges of the box [m], less than half its shortest edge.
        offset: center of the sphere, in the axes of frame1 [m].
        xyz: center of the box, in the axes of frame2 [m].
        rpy: orientation of the box in frame2, roll, pitch and yaw [rad].
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
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


def segments(c: SphereContact | CapsuleContact) -> tuple[Segment, Segment]:
    """Return the ends of both segments in the axes of their frames.

    Args:
        c: the description.
    """
    return (CENTER, CENTER) if isinstance(c, SphereContact) else (c.segment1, c.segment2)
