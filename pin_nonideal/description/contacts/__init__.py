"""Frozen descriptions of contacts and their friction."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from pin_nonideal.description.constraints import Axis
from pin_nonideal.description.joint_friction import static_ratio
from pin_nonideal.errors import InputError
from pin_nonideal.validation import (
    array,
    flag,
    fraction,
    function,
    label,
    nonnegative,
    number,
    optional_text,
    text,
    unit_axis,
)

from .round import BoxContact, CapsuleContact, SphereContact
from .solids import CylinderContact, EllipsoidContact, HullContact, RevolvedContact, RimContact

__all__ = [
    "BoxContact",
    "CapsuleContact",
    "CylinderContact",
    "EllipsoidContact",
    "HullContact",
    "JointLimit",
    "PointContact",
    "RevolvedContact",
    "RimContact",
    "SphereContact",
    "UserContact",
    "box_contacts",
]


@dataclass(frozen=True)
class PointContact:
    """Contact of a frame's origin, or of a sphere around it, with a plane, with Coulomb friction.

    Gap: phi = n . (p - p_plane) - height - radius [m], which is never negative. The contact opens if it would
    need tension, and closes with an impact when its gap reaches zero. The rate of the gap after an impact is
    at least -restitution times the rate before (Newton). The impulse along the plane lies in Coulomb's cone.
    With unilateral=False the contact stays closed, as a wheel in a groove, and tension is only reported.
    Rows: 1 while closed. lam: normal force on the frame's body [N]; positive presses, zero while open.
    Sliding friction on the body at the contact point: -mu lam u/|u|, with the slip velocity u in the plane,
    Eqs. (77)-(80). Sticking holds while the tangential force is below static_ratio mu lam.
    A contact area resists rotation too. The angular velocity of the frame's body relative to the plane has a
    part along the normal (spinning) and a part in the plane (rolling). The torque torsional |lam| opposes
    spinning, and the torque rolling |lam| opposes rolling. Sliding, spinning and rolling stick and slip
    independently.

    Args:
        frame: name of a frame of the model.
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction for sliding, spinning and rolling, at least 1.
        plane: name of a frame with origin in the plane (its body may move); None for the world's origin.
        normal: normal of the plane, in the axes of the plane's frame: "x", "y", "z" or three numbers.
        radius: radius of the sphere around the frame's origin [m]; 0 for a point.
        offset: position of the point or the sphere's center, in the axes of the frame [m].
        height: height of the plane above the origin of its frame, along the normal [m].
        torsional: ratio of the torque against spinning to the normal force [m]. For a circular contact area
            of radius R, it is 2/3 mu R under uniform pressure and 3/16 pi mu R under a sphere (Hertz).
        rolling: ratio of the torque against rolling to the normal force [m], a lever arm.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
        unilateral: whether the contact may open.
        name: used in messages and results.
    """

    frame: str
    mu: float = 0.0
    static_ratio: float = 1.0
    plane: str | None = None
    normal: Axis = "z"
    radius: float = 0.0
    torsional: float = 0.0
    rolling: float = 0.0
    restitution: float = 0.0
    unilateral: bool = True
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    height: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("PointContact: name", self.name)
        who = label(self)
        text(f"{who}: frame", self.frame)
        optional_text(f"{who}: plane", self.plane)
        if self.plane == self.frame:
            raise InputError(f'{who}: frame and plane must differ; both are "{self.frame}"')
        for key in ("mu", "radius", "torsional", "rolling"):
            object.__setattr__(self, key, nonnegative(f"{who}: {key}", getattr(self, key)))
        object.__setattr__(self, "offset", tuple(array(f"{who}: offset", self.offset, (3,)).tolist()))
        object.__setattr__(self, "height", number(f"{who}: height", self.height))
        object.__setattr__(self, "static_ratio", static_ratio(who, self.static_ratio))
        object.__setattr__(self, "normal", unit_axis(f"{who}: normal", self.normal))
        object.__setattr__(self, "restitution", fraction(f"{who}: restitution", self.restitution))
        object.__setattr__(self, "unilateral", flag(f"{who}: unilateral", self.unilateral))
        if self.restitution and not self.unilateral:
            raise InputError(
                f"{who}: only a contact that may open has restitution; omit restitution or unilateral"
            )


@dataclass(frozen=True)
class JointLimit:
    """Stops of a joint of one degree of freedom: lower <= q <= upper.

    Gaps: q - lower and upper - q [rad or m]. Each stop is a separate contact that opens and closes like a
    PointContact; the names are "NAME lower" and "NAME upper".
    Rows: 1 while a stop is closed. lam: torque or force of the stop, away from it [N m or N].

    Args:
        joint: name of the joint.
        lower: smallest position [rad or m]; None for the model's limit, if finite.
        upper: largest position [rad or m]; None for the model's limit, if finite.
        restitution: rate after an impact over the rate before, 0 to 1.
        name: used in messages and results; by default "JointLimit(JOINT)".
    """

    joint: str
    lower: float | None = None
    upper: float | None = None
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("JointLimit: name", self.name)
        who = label(self)
        text(f"{who}: joint", self.joint)
        for key in ("lower", "upper"):
            if getattr(self, key) is not None:
                object.__setattr__(self, key, number(f"{who}: {key}", getattr(self, key)))
        if self.lower is not None and self.upper is not None and not self.lower < self.upper:
            raise InputError(f"{who}: lower must be below upper; got {self.lower:g} and {self.upper:g}")
        object.__setattr__(self, "restitution", fraction(f"{who}: restitution", self.restitution))


@dataclass(frozen=True)
class UserContact:
    """A unilateral contact with a user-defined gap, as Python functions.

    Gap: g(t, q) [m or rad], never negative; A a = b is its second derivative, d^2 g/dt^2 = A a - b.
    d gap/dt = rate and d rate/dt = A a - b are checked once by differences.
    Rows: 1 while closed. lam: force on the gap [N or N m], in the scale of A; zero while open.
    Sliding friction opposes the slip velocities `directions` v. This friction is at most mu lam while
    slipping and static_ratio mu lam while sticking. Rates of the directions are differences along the motion.
    The curvature of the gap between two steps has no bound. The step is searched for a contact unless the
    cubic interpolant of the gap, with twice its curvature, excludes one.

    Args:
        function: (t, q, v, data) -> (A, b), shapes (1, nv) and (1,), as in `UserConstraint`; A does not
            depend on v.
        gap: (t, q) -> g.
        rate: (t, q, v) -> dg/dt; A v plus a difference in time when None.
        directions: (t, q) -> orthogonal slip rows, (1, nv) or (2, nv); needed with mu.
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
        name: used in messages and results.
    """

    function: Callable[..., object]
    gap: Callable[..., object]
    rate: Callable[..., object] | None = None
    directions: Callable[..., object] | None = None
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("UserContact: name", self.name)
        who = label(self)
        function(f"{who}: function", self.function, "(t, q, v, data) -> (A, b)")
        function(f"{who}: gap", self.gap, "(t, q) -> g")
        if self.rate is not None:
            function(f"{who}: rate", self.rate, "(t, q, v) -> dg/dt")
        if self.directions is not None:
            function(f"{who}: directions", self.directions, "(t, q) -> rows (1 or 2, nv)")
        object.__setattr__(self, "mu", nonnegative(f"{who}: mu", self.mu))
        object.__setattr__(self, "static_ratio", static_ratio(who, self.static_ratio))
        object.__setattr__(self, "restitution", fraction(f"{who}: restitution", self.restitution))
        if self.mu and self.directions is None:
            raise InputError(f"{who}: friction needs directions of slip; give directions, or leave mu out")


def box_contacts(
    frame: str, size: ArrayLike, plane: str | None = None, *, name: str | None = None, **more: Any
) -> list[PointContact]:
    """Return the contacts of a box with a plane: one `PointContact` for each of the eight corners.

    Args:
        frame: name of the frame at the center of the box, with axes along its edges.
        size: edges along x, y and z [m], (3,).
        plane: name of the plane's frame, as in `PointContact`.
        name: prefix of the corner names "NAME -x-y-z" to "NAME +x+y+z"; the frame's name by default.
        **more: mu, static_ratio, normal, height, restitution and unilateral of each corner.

    Raises:
        InputError: a size is not positive.
    """
    optional_text("box_contacts: name", name)
    edges = array("box_contacts: size", size, (3,))
    if not (edges > 0.0).all():
        raise InputError(f"box_contacts: size must be positive, got {edges.tolist()}; give three edges")
    corners = []
    for signs in itertools.product("-+", repeat=3):
        x, y, z = (0.5 * float(f"{sign}1") * edge for sign, edge in zip(signs, edges, strict=True))
        called = "".join(sign + axis for sign, axis in zip(signs, "xyz", strict=True))
        corners.append(
            PointContact(frame, plane=plane, offset=(x, y, z), name=f"{name or frame} {called}", **more)
        )
    return corners


Contact = (
    PointContact
    | JointLimit
    | SphereContact
    | CapsuleContact
    | BoxContact
    | EllipsoidContact
    | HullContact
    | CylinderContact
    | RimContact
    | RevolvedContact
    | UserContact
)
