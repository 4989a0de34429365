"""Frozen descriptions of constraints.

The scene resolves the names, and the core computes the rows A a = b.

Notation: p1, R1 are position and orientation of `frame1` in the world, and p2, R2 those of `frame2`. With
`frame2=None` the second side is the world: point p2 = p1 and orientation R1 are fixed at the scene's initial
state, and components are in world axes. `lam` belongs to M a = F + C + A^T lam. For anchors, `lam` is the
force of the constraint on the body of frame1, in the axes of frame2 (world axes when None). The opposite
force acts on the body of frame2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.validation import (
    count,
    function,
    label,
    nonnegative,
    number,
    optional_text,
    positive,
    text,
    unit_axis,
)

from .time_functions import TimeFunction

__all__ = [
    "Distance",
    "FrameAnchor",
    "HingeAnchor",
    "JointCoupling",
    "KnifeEdge",
    "PointAnchor",
    "PrescribedMotion",
    "Rolling",
    "UserConstraint",
]

Axis = str | Sequence[float]
TIME_FUNCTION = "t -> (value, rate, acceleration)"
MAX_ROWS = 10_000  # rows of a user constraint: A takes a gigabyte at 10,000 degrees of freedom


def _frames(description: Any) -> None:
    who = label(description)
    text(f"{who}: frame1", description.frame1)
    optional_text(f"{who}: frame2", description.frame2)
    if description.frame1 == description.frame2:
        raise InputError(f'{who}: frame1 and frame2 must differ; both are "{description.frame1}"')


def _name(description: Any) -> None:
    optional_text(f"{type(description).__name__}: name", description.name)


def _axis(description: object, key: str = "axis") -> None:
    object.__setattr__(description, key, unit_axis(f"{label(description)}: {key}", getattr(description, key)))


@dataclass(frozen=True)
class PointAnchor:
    """Holds the origin of one frame on the origin of another: a ball joint, or part of it.

    Residual: phi = R2^T (p1 - p2), the components named by `axes` [m]; with frame2=None, phi = p1 - p2 in
    world axes.
    Rows: one for each letter of `axes`, in the order x, y, z.
    lam: force on frame1's body [N], same components and axes.

    Args:
        frame1: name of a frame of the model.
        frame2: name of a frame, or None for the world, at the initial position of frame1.
        axes: held components, letters out of "xyz".
        name: used in messages and results.
    """

    frame1: str
    frame2: str | None = None
    axes: str = "xyz"
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        _frames(self)
        letters = self.axes
        if (
            not isinstance(letters, str)
            or not letters
            or set(letters) - set("xyz")
            or len(set(letters)) != len(letters)
        ):
            raise InputError(
                f'{label(self)}: axes must be one or more of the letters "xyz", each once; '
                f"got {short_repr(letters)}"
            )
        object.__setattr__(self, "axes", "".join(sorted(letters)))


@dataclass(frozen=True)
class FrameAnchor:
    """Holds one frame on another, in position and orientation: a weld.

    Residual: phi = [R2^T (p1 - p2); log(R2^T R1)], [m; rad]. With frame2=None:
    [p1 - p2; log(R1 R1(start)^T)] in world axes.
    Rows: 6, three of position and three of orientation.
    lam: [force; moment] on frame1's body, [N; N m], in the axes of frame2, the moment about the origin of
    frame2.

    Args:
        frame1: name of a frame of the model.
        frame2: name of a frame, or None for the world, at the initial position of frame1.
        name: used in messages and results.
    """

    frame1: str
    frame2: str | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        _frames(self)


@dataclass(frozen=True)
class HingeAnchor:
    """Holds the origins of two frames together and lets them turn about one common axis u: a hinge.

    Residual: phi = [R2^T (p1 - p2); t1 . (u x u'); t2 . (u x u')], [m; rad]. u' = R2^T R1 u is the axis fixed
    in frame1, and `validation.axis_triad(u)` gives t1 and t2. The last two components are scaled by
    angle/sine, so they measure the angle between the axes. The axes must point in the same direction. With
    frame2=None, u is replaced by R1(start) u and all components are in world axes.
    Rows: 5, three of position and two of orientation.
    lam: force on frame1's body [N] in the axes of frame2, and the moments about t1 and t2 [N m].

    Args:
        frame1: name of a frame of the model.
        frame2: name of a frame, or None for the world, at the initial position of frame1.
        axis: the common axis, with the same components in both frames: "x", "y", "z" or three numbers.
        name: used in messages and results.
    """

    frame1: str
    frame2: str | None = None
    axis: Axis = "z"
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        _frames(self)
        _axis(self)


@dataclass(frozen=True)
class Distance:
    """Holds the distance between the origins of two frames: a massless rod or an inextensible taut string.

    Residual: phi = |p1 - p2| - length(t) [m].
    Rows: 1.
    lam: force along the rod on frame1's body, away from frame2 [N]; positive pushes (a strut), negative
    pulls.

    Args:
        frame1: name of a frame of the model.
        frame2: name of a frame, or None for the world, at the initial position of frame1 (then `length` must
            be given).
        length: positive length [m]; a function t -> (value, rate, acceleration), with breaks as in
            `PrescribedMotion`; None for the initial distance.
        name: used in messages and results.
    """

    frame1: str
    frame2: str | None = None
    length: float | TimeFunction | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        _frames(self)
        if self.length is None:
            if self.frame2 is None:
                raise InputError(
                    f"{label(self)}: length must be given when frame2 is None (frame1 starts at distance "
                    "zero from its own start); pass a length or a second frame"
                )
        elif not callable(self.length):
            object.__setattr__(self, "length", positive(f"{label(self)}: length", self.length))


@dataclass(frozen=True)
class JointCoupling:
    """Ties two joints of one degree of freedom: gears, belts, mimic joints.

    Residual: phi = q1 - ratio q2 - offset [m or rad].
    Rows: 1.
    lam: generalized force on joint1 [N or N m]; -ratio lam acts on joint2.

    Args:
        joint1: name of the driven joint.
        joint2: name of the leading joint.
        ratio: d q1 / d q2, not zero.
        offset: q1 at q2 = 0 [m or rad].
        name: used in messages and results.
    """

    joint1: str
    joint2: str
    ratio: float
    offset: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        who = label(self)
        text(f"{who}: joint1", self.joint1)
        text(f"{who}: joint2", self.joint2)
        if self.joint1 == self.joint2:
            raise InputError(f'{who}: joint1 and joint2 must differ; both are "{self.joint1}"')
        ratio = number(f"{who}: ratio", self.ratio)
        if ratio == 0.0:
            raise InputError(
                f"{who}: ratio must not be zero; hold a joint at rest by a PrescribedMotion, or lock it"
            )
        object.__setattr__(self, "ratio", ratio)
        object.__setattr__(self, "offset", number(f"{who}: offset", self.offset))


@dataclass(frozen=True)
class PrescribedMotion:
    """Moves a joint of one degree of freedom along a given function of time.

    Residual: phi = q_joint - function(t) [m or rad].
    Rows: 1.
    lam: generalized force of the drive on the joint [N or N m]; its power is v lam.
    Breaks: steps of the integrator end at the times at which pieces of the function meet. A jump of the rate
    causes an impulse I on the rows, M (v+ - v-) = A^T I with A v+ + phi_t+ = 0. The jump is an event of kind
    "jump", and its work belongs to the motion. Contacts that the jump drives into each other have an impact.
    Dry friction has finite forces and thus no impulse.

    Args:
        joint: name of the joint.
        function: t -> (value, rate, acceleration), for example `sinusoid(...)`. A user function may list its
            breaks [s] in an attribute `breaks`. Otherwise breaks are searched in sixteen intervals of each
            adaptive step, and over each fixed step. Shorter pulses are detected only with the attribute.
        name: used in messages and results.
    """

    joint: str
    function: TimeFunction
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        text(f"{label(self)}: joint", self.joint)
        function(f"{label(self)}: function", self.function, TIME_FUNCTION)


@dataclass(frozen=True)
class KnifeEdge:
    """Forbids the velocity of a frame's origin along one of the frame's axes: a skate, a blade.

    Rate (nonholonomic, no residual): u . R1^T v_p1 = 0 [m/s], with the axis u in the axes of the frame.
    Rows: 1.
    lam: force on the body along the axis [N].

    Args:
        frame: name of a frame of the model.
        axis: direction without velocity, in the axes of the frame: "x", "y", "z" or three numbers.
        name: used in messages and results.
    """

    frame: str
    axis: Axis = "y"
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        text(f"{label(self)}: frame", self.frame)
        _axis(self)


@dataclass(frozen=True)
class Rolling:
    """Rolls a sphere or a thin disk on a plane without slip and without lifting.

    With the plane's normal n and the disk's axis e, the contact point is c = p - radius n for a sphere and
    c = p - radius (n - (n.e) e)/|n - (n.e) e| for a disk. The material points of both bodies at c have the
    same velocity.
    Residual: height of c above the plane [m] (holonomic, the third row); the first two rows are nonholonomic
    [m/s].
    Rows: 3, along t1, t2 and n of `validation.axis_triad(normal)`, axes fixed in the plane.
    lam: force on the rolling body at c [N] along t1, t2 and n; the third is the normal force, positive when
    pressed.
    Resistance: the angular velocity of the body relative to the plane has a part along the normal (spinning)
    and a part in the plane (rolling). The torque torsional |lam_n| opposes spinning, and the torque
    rolling |lam_n| opposes rolling. Each sticks and slips independently.

    Args:
        frame: name of the frame at the center of the sphere or disk.
        radius: radius of the sphere or disk [m].
        axis: axis of the disk in the frame; None for a sphere.
        plane: name of a frame with origin in the plane (its body may move); None for the world's origin.
        normal: normal of the plane, in the axes of the plane's frame.
        torsional: ratio of the torque against spinning to the normal force [m].
        rolling: ratio of the torque against rolling to the normal force [m], a lever arm.
        name: used in messages and results.
    """

    frame: str
    radius: float
    axis: Axis | None = "y"
    plane: str | None = None
    normal: Axis = "z"
    torsional: float = 0.0
    rolling: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        who = label(self)
        text(f"{who}: frame", self.frame)
        object.__setattr__(self, "radius", positive(f"{who}: radius", self.radius))
        if self.axis is not None:
            _axis(self)
        optional_text(f"{who}: plane", self.plane)
        if self.plane == self.frame:
            raise InputError(f'{who}: frame and plane must differ; both are "{self.frame}"')
        _axis(self, "normal")
        for key in ("torsional", "rolling"):
            object.__setattr__(self, key, nonnegative(f"{who}: {key}", getattr(self, key)))


@dataclass(frozen=True)
class UserConstraint:
    """A constraint A(q, v, t) a = b(q, v, t) as a Python function: Eq. (3).

    Holonomic: residual is phi(q, t) and rate is A v + phi_t. Nonholonomic: no residual, and rate is the
    velocity constraint itself. d residual/dt = rate and d rate/dt = A a - b are checked once by differences.
    Without residual and rate the rows hold at acceleration level only and cannot be projected. With a
    residual and without a rate, the rate is A v plus a difference in t.
    A row shorter than about 1e-14 times the longest row of the same function is rounding error and has no
    effect.
    Rows: `size`, in the order of the function.
    lam: multipliers in M a = F + C + A^T lam, in the scale of the rows.

    Args:
        function: (t, q, v, data) -> (A, b), shapes (size, nv) and (size,).  `data` is a read-only
            pinocchio.Data for (q, v) as after forwardKinematics(q, v, 0), with frames and joint Jacobians
            (WORLD) current.
        size: number of rows, from 1 to 10,000.
        residual: (t, q) -> phi, shape (size,).
        rate: (t, q, v) -> shape (size,).
        name: used in messages and results.
    """

    function: Callable[..., object]
    size: int
    residual: Callable[..., object] | None = None
    rate: Callable[..., object] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        _name(self)
        who = label(self)
        function(f"{who}: function", self.function, "(t, q, v, data) -> (A, b)")
        object.__setattr__(self, "size", count(f"{who}: size", self.size, min_value=1, max_value=MAX_ROWS))
        if self.residual is not None:
            function(f"{who}: residual", self.residual, "(t, q) -> phi")
        if self.rate is not None:
            function(f"{who}: rate", self.rate, "(t, q, v) -> rate")


Constraint = (
    PointAnchor
    | FrameAnchor
    | HingeAnchor
    | Distance
    | JointCoupling
    | PrescribedMotion
    | KnifeEdge
    | Rolling
    | UserConstraint
)


def is_mimic(constraint: object) -> TypeGuard[JointCoupling]:
    """Check if a constraint is the coupling of a mimic joint of a file.

    Args:
        constraint: the description.
    """
    return isinstance(constraint, JointCoupling) and (constraint.name or "").endswith("mimic")
