"""What each contact is: frozen descriptions of what touches what, and of the friction there."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from pin_nonideal.description.constraints import Axis
from pin_nonideal.description.laws import static_ratio
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
    """The origin of a frame, or a sphere around it, touches a plane, with Coulomb friction there.

    Gap: phi = n . (p - p_plane) - height - radius [m], which is never negative: the contact opens where it
    would have to pull, and closes where its gap does, with an impact: the gap's rate after it is at least
    -restitution times the one before (Newton), and the impulse along the plane lies in Coulomb's cone.  With
    unilateral=False it is kept closed, as a wheel in a groove, and a pull is only reported.
    Rows: 1 while it is closed.  lam: the normal force on the frame's body [N]; positive presses, zero while
    open.
    Sliding friction on the body at the contact point: -mu lam u/|u|, with u the slip velocity in the
    plane, Eqs. (77)-(80); sticking holds while the tangential force is below static_ratio mu lam.
    A spot of contact of some size resists turning too.  With w the angular velocity of the frame's body
    against that of the plane, the torque torsional |lam| opposes its part along the normal (spinning), and
    the torque rolling |lam| its part along the plane (rolling); each sticks and slips on its own, as sliding
    does.

    Args:
        frame: name of a frame of the model.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction of all three, at least 1.
        plane: name of the frame whose origin the plane goes through (its body may move); None for the world's
            origin.
        normal: normal of the plane, in the axes of the plane's frame: "x", "y", "z" or three numbers.
        radius: radius of the sphere around the frame's origin [m]; 0 for a point.
        offset: where the point or the sphere's middle is, in the axes of the frame [m].
        height: of the plane over the origin of its frame, along the normal [m].
        torsional: torque against spinning over normal force [m]; where the spot is a circle of radius R,
            2/3 mu R when it presses evenly and 3/16 pi mu R when it is that of a sphere (Hertz).
        rolling: torque against rolling over normal force [m], the lever of rolling resistance.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        unilateral: whether it may open.
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
                f"{who}: restitution is of a contact that may open; leave it or unilateral=False out"
            )


@dataclass(frozen=True)
class JointLimit:
    """Stops of a joint of one degree of freedom: lower <= q <= upper.

    Gaps: q - lower and upper - q [rad or m], each a contact of its own that opens and closes as PointContact
    does; they are called "NAME lower" and "NAME upper".
    Rows: 1 while a stop is touched.  lam: the torque or force of that stop, away from it [N m or N].

    Args:
        joint: name of the joint.
        lower: least position [rad or m]; None for the model's own, where that is finite.
        upper: largest position; None likewise.
        restitution: rate after an impact over that before, 0 to 1.
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
    """Any gap that opens and closes, as Python functions.

    Gap: g(t, q) [m or rad], never negative; A a = b is its second derivative, d^2 g/dt^2 = A a - b.
    d gap/dt = rate and d rate/dt = A a - b are checked once by differences.
    Rows: 1 while it is closed.  lam: the force on the gap [N or N m], scaled as A is; zero while open.
    Sliding friction opposes the slip velocities `directions` v, with mu lam at most while it slips and
    static_ratio mu lam while it sticks; the rates of the directions are differences along the motion.
    Nothing bounds the curvature of the gap between two steps: a touch is sought where its cubic between them
    and twice that curvature cannot rule it out.

    Args:
        function: (t, q, v, data) -> (A, b), shapes (1, nv) and (1,), as of a `UserConstraint`; A does not
            depend on v.
        gap: (t, q) -> g.
        rate: (t, q, v) -> dg/dt; A v and a difference in time when None.
        directions: (t, q) -> rows of slip at right angles to each other, (1, nv) or (2, nv); needed with mu.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
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
    """The contacts of a box with a plane: its eight corners, a `PointContact` each.

    Args:
        frame: name of the frame in the middle of the box, along its edges.
        size: its edges along x, y and z [m], (3,).
        plane: name of the plane's frame, as in `PointContact`.
        name: the corners are called "NAME -x-y-z" to "NAME +x+y+z"; by default the frame's name.
        **more: mu, static_ratio, normal, height, restitution and unilateral of each.

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
