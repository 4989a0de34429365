"""Frozen descriptions of contacts of ellipsoids, disks, cylinders, cones and convex hulls."""

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

from .base import check_friction, check_two_frames, check_vectors
from .convex_hull import convex_hull

__all__ = ["CylinderContact", "EllipsoidContact", "HullContact", "RevolvedContact", "RimContact"]


@dataclass(frozen=True)
class EllipsoidContact:
    """Contact of the lowest point of an ellipsoid, or a disk, with a plane, with Coulomb friction.

    Gap: phi = n . (p - p_plane) - height - |D R^T n| [m], with center p, axes R and semiaxes D; otherwise as
    a unilateral `PointContact`. One semiaxis may be zero: such a disk touches and rolls on its rim, like a
    coin or a wheel. A disk that lies on its face has no lowest point. Use contact points of the face instead,
    as a `GeometryContact` of a cylinder creates them.
    Rows: 1 while closed. lam: normal force on the frame's body [N].

    Args:
        frame: name of a frame on the body.
        semiaxes: half lengths along the axes [m], (3,), at most one of them zero.
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        plane: name of a frame with origin in the plane (its body may move); None for the world's origin.
        normal: normal of the plane, in the axes of the plane's frame: "x", "y", "z" or three numbers.
        offset: center of the ellipsoid, in the axes of the frame [m].
        rpy: orientation of the axes in the frame, roll, pitch and yaw [rad].
        height: height of the plane above the origin of its frame, along the normal [m].
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
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
        who = check_friction(self)
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
    """Contact of a sphere, or a point, with the convex hull of points of another body, with Coulomb friction.

    Gap: distance of the sphere's center from the hull, minus both radii [m]; otherwise as `SphereContact`.
    Rows: 1 while closed. lam: normal force on the body of frame1 [N], away from the hull.

    Args:
        frame1: name of a frame on the body of the sphere.
        frame2: name of a frame on the body of the hull, or of the world.
        points: points in the axes of frame2 [m], (n, 3); points inside the hull of the others have no effect.
        radius1: radius of the sphere [m]; 0 for a point.
        radius2: radius around the hull [m], which rounds its edges and moves its faces outward.
        offset: center of the sphere, in the axes of frame1 [m].
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
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
        who = check_friction(self, "radius1", "radius2")
        check_two_frames(self, who)
        if self.radius1 + self.radius2 == 0.0:
            raise InputError(f"{who}: one of radius1 and radius2 must be positive; a point has no normal")
        check_vectors(self, who, "offset")
        object.__setattr__(self, "points", hull_points(self.points, who))


@dataclass(frozen=True)
class CylinderContact:
    """Contact of a sphere or a capsule with a cylinder or a cone of another body, with Coulomb friction.

    Gap: distance of the sphere's center, or of the capsule's segment, from the solid, minus both radii [m];
    otherwise as `SphereContact`. The contact has one point: a capsule parallel to the solid touches it in the
    middle of the overlap.
    Rows: 1 while closed. lam: normal force on the body of frame1 [N], away from the solid.

    Args:
        frame1: name of a frame on the body of the sphere or capsule.
        frame2: name of a frame on the body of the solid, or of the world.
        length: length of the solid along its axis [m].
        below: radius of the face at the lower end of the axis [m].
        above: radius of the face at the upper end [m]; `below` when None, and 0 for the tip of a cone.
        radius1: radius of the sphere or capsule [m]; 0 for a point or a line.
        offset: center of the sphere, in the axes of frame1 [m].
        xyz: center of the solid's axis, in the axes of frame2 [m].
        rpy: orientation of the solid, with axis z, in frame2, roll, pitch and yaw [rad].
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
        name: used in messages and results.
        end: end of a capsule's segment, which starts at offset, in the axes of frame1 [m]; None for a sphere.
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
        who = check_friction(self, "below", "above", "radius2")
        check_two_frames(self, who)
        object.__setattr__(self, "length", positive(f"{who}: length", self.length))
        around = nonnegative if self.radius2 > 0.0 else positive
        object.__setattr__(self, "radius1", around(f"{who}: radius1", self.radius1))
        check_vectors(self, who, "offset", "xyz", "rpy")
        if self.below == self.above == 0.0:
            raise InputError(f"{who}: one of below and above must be positive; use CapsuleContact for a line")
        if self.end is not None:
            check_vectors(self, who, "end")
            if self.end == self.offset:
                raise InputError(f"{who}: end and offset must differ; leave end out for a sphere")


@dataclass(frozen=True)
class RimContact:
    """Contact of a disk, the rim of a cylinder or cone, with the convex hull of points of another body.

    Gap: distance of the disk from the hull, minus radius2 [m]; otherwise as `SphereContact`. The contact has
    one point: a disk that lies on a face needs further contact points, one `HullContact` each.
    Rows: 1 while closed. lam: normal force on the body of frame1 [N], away from the hull.

    Args:
        frame1: name of a frame on the body of the disk.
        frame2: name of a frame on the body of the hull, or of the world.
        points: points in the axes of frame2 [m], (n, 3); points inside the hull of the others have no effect.
        rim: radius of the disk [m].
        radius2: radius around the hull [m], which rounds its edges and moves its faces outward.
        offset: center of the disk, in the axes of frame1 [m].
        rpy: orientation of the disk, with axis z, in frame1, roll, pitch and yaw [rad].
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
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
        who = check_friction(self)
        check_two_frames(self, who)
        for key in ("rim", "radius2"):
            object.__setattr__(self, key, positive(f"{who}: {key}", getattr(self, key)))
        check_vectors(self, who, "offset", "rpy")
        object.__setattr__(self, "points", hull_points(self.points, who))


@dataclass(frozen=True)
class RevolvedContact:
    """Contact of two cylinders, cones or disks with rounding radii, with Coulomb friction.

    Gap: distance of both solids, minus both radii [m]; otherwise as `SphereContact`. The contact has one
    point: solids that lie along each other, or face on face, need further contact points.
    Rows: 1 while closed. lam: normal force on the body of frame1 [N], away from the other body.

    Args:
        frame1: name of a frame on the body of the first solid.
        frame2: name of a frame on the body of the second solid, or of the world.
        solid1: length along the axis, and radii of the lower and upper face [m], (3,). One radius may be 0,
            for the tip of a cone. Zero length with equal radii is a disk.
        solid2: length and radii of the second solid [m], (3,).
        radius1: radius around the first solid [m], which rounds its rims and moves its surface outward.
        radius2: radius around the second solid [m].
        xyz1: center of the first solid's axis, in the axes of frame1 [m].
        rpy1: orientation of the first solid, with axis z, in frame1, roll, pitch and yaw [rad].
        xyz2: center of the second solid's axis, in the axes of frame2 [m].
        rpy2: orientation of the second solid, with axis z, in frame2, roll, pitch and yaw [rad].
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
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
        who = check_friction(self, "radius2")
        check_two_frames(self, who)
        object.__setattr__(self, "radius1", positive(f"{who}: radius1", self.radius1))
        check_vectors(self, who, "solid1", "solid2", "xyz1", "rpy1", "xyz2", "rpy2")
        for key in ("solid1", "solid2"):
            length, below, above = solid = getattr(self, key)
            disk = length == 0.0 and below == above
            if not (min(solid) >= 0.0 < max(below, above) and (disk or length > 0.0)):
                raise InputError(
                    f"{who}: {key} must be a length and two radii, none negative and one radius positive; "
                    f"without a length the radii must be equal; got {list(solid)}"
                )


def hull_points(corners: object, who: str) -> tuple[Vector3, ...]:
    """Return points as tuples, after a check that they span a solid.

    Args:
        corners: points, (n, 3).
        who: prefix of error messages.

    Raises:
        InputError: the points are invalid or span no solid.
    """
    points = array(f"{who}: points", corners, (None, 3))
    convex_hull(points, f"{who}: points")
    return tuple((x, y, z) for x, y, z in points.tolist())


def core_hull(c: HullContact | RimContact) -> tuple[list[float], list[float], list[int]]:
    """Return the hull in the axes of frame2 as flat lists for the core.

    Args:
        c: the description.

    Returns:
        Corners (3 numbers each); outward normal and offset of each face (4 numbers); indices of the two
        corners and the two faces of each edge (4 numbers).
    """
    hull = convex_hull(np.array(c.points), label(c))
    return hull.points.ravel().tolist(), hull.planes.ravel().tolist(), hull.edges.ravel().tolist()
