"""Contacts of ellipsoids, disks, cylinders, cones and convex hulls: frozen descriptions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pin_nonideal.description.constraints import Axis
from pin_nonideal.errors import InputError
from pin_nonideal.validation import (
    Vector3,
    array,
    label,
    nonnegative,
    number,
    optional_text,
    positive,
    text,
    unit_axis,
)

from .base import check_rubbing, check_two_frames, check_vectors
from .convex_hull import convex_hull

__all__ = ["CylinderContact", "EllipsoidContact", "HullContact", "RevolvedContact", "RimContact"]


@dataclass(frozen=True)
class EllipsoidContact:
    """An ellipsoid, or a disk, touches a plane with its lowest point, with Coulomb friction there.

    Gap: phi = n . (p - p_plane) - height - |D R^T n| [m], p the middle, R the axes and D the semiaxes; else
    as that of a `PointContact` that may open.  One semiaxis may be zero: a disk, which touches with its rim
    and rolls on it, as a coin or a wheel does.  One that lies on its face has no lowest point: points of the
    face carry it, as a `GeometryContact` of a cylinder gives them.
    Rows: 1 while it is closed.  lam: the normal force on the frame's body [N].

    Args:
        frame: name of a frame on the body.
        semiaxes: half the lengths along the axes [m], (3,), at most one of them zero.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        plane: name of the frame whose origin the plane goes through (its body may move); None for the world's
            origin.
        normal: normal of the plane, in the axes of the plane's frame: "x", "y", "z" or three numbers.
        offset: where the middle is, in the axes of the frame [m].
        rpy: how the axes are turned against the frame, roll, pitch and yaw [rad].
        height: of the plane over the origin of its frame, along the normal [m].
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
    """

    frame: str
    semiaxes: Vector3
    mu: float = 0.0
    static_ratio: float = 1.0
    plane: str | None = None
    normal: Axis = "z"
    offset: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    height: float = 0.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        who = check_rubbing(self)
        text(f"{who}: frame", self.frame)
        optional_text(f"{who}: plane", self.plane)
        if self.plane == self.frame:
            raise InputError(f'{who}: frame and plane must differ; both are "{self.frame}"')
        check_vectors(self, who, "semiaxes", "offset", "rpy")
        if not sorted(self.semiaxes)[1] > 0.0 <= min(self.semiaxes):
            raise InputError(
                f"{who}: two of the semiaxes must be positive, and none negative; got {list(self.semiaxes)}"
            )
        object.__setattr__(self, "height", number(f"{who}: height", self.height))
        object.__setattr__(self, "normal", unit_axis(f"{who}: normal", self.normal))


@dataclass(frozen=True)
class HullContact:
    """A sphere, or a point, touches the convex hull of points of another body, with Coulomb friction there.

    Gap: the distance of the sphere's middle from the hull, less both radii [m]; else as `SphereContact`.
    Rows: 1 while it is closed.  lam: the normal force on the body of frame1 [N], away from the hull.

    Args:
        frame1: name of a frame on the body of the sphere.
        frame2: name of a frame on the body of the hull, or of the world.
        points: in the axes of frame2 [m], (n, 3); those inside the hull of the others add nothing.
        radius1: radius of the sphere [m]; 0 for a point.
        radius2: radius around the hull [m], which rounds its edges and moves its faces outward.
        offset: where the sphere's middle is, in the axes of frame1 [m].
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
    """

    frame1: str
    frame2: str
    points: tuple[Vector3, ...]
    radius1: float
    radius2: float = 0.0
    offset: Vector3 = (0.0, 0.0, 0.0)
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        who = check_rubbing(self, "radius1", "radius2")
        check_two_frames(self, who)
        if self.radius1 + self.radius2 == 0.0:
            raise InputError(f"{who}: one of radius1 and radius2 must be positive; a point has no normal")
        check_vectors(self, who, "offset")
        object.__setattr__(self, "points", hull_points(self.points, who))


@dataclass(frozen=True)
class CylinderContact:
    """A sphere or a capsule touches a cylinder or a cone of another body, with Coulomb friction there.

    Gap: the distance of the sphere's middle, or of the capsule's middle line, from the solid, less both radii
    [m]; else as `SphereContact`.  One place touches: a capsule that lies along the solid touches in the
    middle of what lies beside it.
    Rows: 1 while it is closed.  lam: the normal force on the body of frame1 [N], away from the solid.

    Args:
        frame1: name of a frame on the body of the sphere.
        frame2: name of a frame on the body of the solid, or of the world.
        length: of the solid along its axis [m].
        below: radius of the face at the lower end of the axis [m].
        above: radius of that at the upper end [m]; `below` when None, and 0 for the tip of a cone.
        radius1: radius of the sphere or capsule [m]; 0 for a point or a line.
        offset: where the sphere's middle is, in the axes of frame1 [m].
        xyz: where the middle of the axis is, in the axes of frame2 [m].
        rpy: how the solid, its axis along z, is turned against frame2, roll, pitch and yaw [rad].
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
        end: of a capsule, whose middle line goes from offset to there, in the axes of frame1 [m]; None for a
            sphere.
        radius2: radius around the solid [m], which rounds its rims and moves its faces and side outward.
    """

    frame1: str
    frame2: str
    length: float
    below: float
    radius1: float
    above: float | None = None
    offset: Vector3 = (0.0, 0.0, 0.0)
    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None
    end: Vector3 | None = None
    radius2: float = 0.0

    def __post_init__(self) -> None:
        if self.above is None:
            object.__setattr__(self, "above", self.below)
        who = check_rubbing(self, "below", "above", "radius2")
        check_two_frames(self, who)
        object.__setattr__(self, "length", positive(f"{who}: length", self.length))
        around = nonnegative if self.radius2 > 0.0 else positive
        object.__setattr__(self, "radius1", around(f"{who}: radius1", self.radius1))
        check_vectors(self, who, "offset", "xyz", "rpy")
        if self.below == self.above == 0.0:
            raise InputError(f"{who}: one of below and above must be positive; a line is a CapsuleContact's")
        if self.end is not None:
            check_vectors(self, who, "end")
            if self.end == self.offset:
                raise InputError(f"{who}: end and offset must differ; leave end out for a sphere")


@dataclass(frozen=True)
class RimContact:
    """A disk, the rim of a cylinder or cone, touches the convex hull of points of another body.

    Gap: the distance of the disk from the hull, less radius2 [m]; else as `SphereContact`.  One place
    touches: with a disk that lies on a face points of it have to carry it, a `HullContact` each.
    Rows: 1 while it is closed.  lam: the normal force on the body of frame1 [N], away from the hull.

    Args:
        frame1: name of a frame on the body of the disk.
        frame2: name of a frame on the body of the hull, or of the world.
        points: in the axes of frame2 [m], (n, 3); those inside the hull of the others add nothing.
        rim: radius of the disk [m].
        radius2: radius around the hull [m], which rounds its edges and moves its faces outward.
        offset: where the disk's middle is, in the axes of frame1 [m].
        rpy: how the disk, its axis along z, is turned against frame1, roll, pitch and yaw [rad].
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
    """

    frame1: str
    frame2: str
    points: tuple[Vector3, ...]
    rim: float
    radius2: float
    offset: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        who = check_rubbing(self)
        check_two_frames(self, who)
        for key in ("rim", "radius2"):
            object.__setattr__(self, key, positive(f"{who}: {key}", getattr(self, key)))
        check_vectors(self, who, "offset", "rpy")
        object.__setattr__(self, "points", hull_points(self.points, who))


@dataclass(frozen=True)
class RevolvedContact:
    """Two cylinders, cones or disks touch, each with a radius around it, with Coulomb friction there.

    Gap: the distance of both, less both radii [m]; else as `SphereContact`.  One place touches: where two
    lie along each other or face on face, points of them have to carry them as well.
    Rows: 1 while it is closed.  lam: the normal force on the body of frame1 [N], away from the other.

    Args:
        frame1: name of a frame on the body of the first.
        frame2: name of a frame on the body of the second, or of the world.
        solid1: length along its axis and radii of the faces at its lower and upper end [m], (3,); one radius
            may be 0, the tip of a cone, and without length both are that of a disk.
        solid2: the same of the second.
        radius1: radius around the first [m], which rounds its rims and moves its faces and side outward.
        radius2: radius around the second [m].
        xyz1: where the middle of the first one's axis is, in the axes of frame1 [m].
        rpy1: how the first, its axis along z, is turned against frame1, roll, pitch and yaw [rad].
        xyz2: where the middle of the second one's axis is, in the axes of frame2 [m].
        rpy2: how the second is turned against frame2 [rad].
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results.
    """

    frame1: str
    frame2: str
    solid1: Vector3
    solid2: Vector3
    radius1: float
    radius2: float = 0.0
    xyz1: Vector3 = (0.0, 0.0, 0.0)
    rpy1: Vector3 = (0.0, 0.0, 0.0)
    xyz2: Vector3 = (0.0, 0.0, 0.0)
    rpy2: Vector3 = (0.0, 0.0, 0.0)
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        who = check_rubbing(self, "radius2")
        check_two_frames(self, who)
        object.__setattr__(self, "radius1", positive(f"{who}: radius1", self.radius1))
        check_vectors(self, who, "solid1", "solid2", "xyz1", "rpy1", "xyz2", "rpy2")
        for key in ("solid1", "solid2"):
            length, below, above = solid = getattr(self, key)
            disk = length == 0.0 and below == above
            if not (min(solid) >= 0.0 < max(below, above) and (disk or length > 0.0)):
                raise InputError(
                    f"{who}: {key} must be a length and two radii, none negative and one radius positive; "
                    f"without a length both must be one; got {list(solid)}"
                )


def hull_points(given: object, who: str) -> tuple[Vector3, ...]:
    """Points that span a solid.

    Args:
        given: (n, 3).
        who: words for messages.

    Raises:
        InputError: they do not, or are none.
    """
    points = array(f"{who}: points", given, (None, 3))
    convex_hull(points, f"{who}: points")
    return tuple((x, y, z) for x, y, z in points.tolist())


def core_hull(c: HullContact | RimContact) -> tuple[list[float], list[float], list[int]]:
    """The hull in the axes of frame2 as the core takes it, one number after the other.

    Args:
        c: the description.

    Returns:
        Corners; of each face its outward normal and its offset along it; of each edge the numbers of two
        corners and of the two faces that meet there.
    """
    hull = convex_hull(np.array(c.points), label(c))
    return hull.points.ravel().tolist(), hull.planes.ravel().tolist(), hull.edges.ravel().tolist()
