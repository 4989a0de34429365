"""Applied forces: they belong to F in M a = F + F^c, Eq. (4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pin_nonideal.errors import InputError
from pin_nonideal.validation import array, function, label, nonnegative, number, optional_text, text

__all__ = [
    "JointSpring",
    "SpringDamper",
    "UserForce",
    "Wrench",
]


@dataclass(frozen=True)
class SpringDamper:
    """A spring and a damper in parallel between the origins of two frames.

    With L = |p1 - p2| and e = (p1 - p2)/L, the force on frame1's body is -(stiffness (L - rest_length) +
    damping dL/dt) e [N]. The opposite force acts on frame2's body. The direction e does not exist at L = 0.
    With a rest length of zero, the force is -stiffness (p1 - p2) minus damping times the component of v1 - v2
    along e, which vanishes at L = 0.

    Args:
        frame1: name of a frame of the model.
        frame2: name of a frame, or None for the world, at the initial position of frame1.
        stiffness: spring stiffness [N/m], not negative.
        damping: damping coefficient [N s/m], not negative.
        rest_length: length without spring force [m], not negative.
        name: used in messages and results.
    """

    frame1: str
    frame2: str | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    rest_length: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("SpringDamper: name", self.name)
        who = label(self)
        text(f"{who}: frame1", self.frame1)
        optional_text(f"{who}: frame2", self.frame2)
        if self.frame1 == self.frame2:
            raise InputError(f'{who}: frame1 and frame2 must differ; both are "{self.frame1}"')
        for key in ("stiffness", "damping", "rest_length"):
            object.__setattr__(self, key, nonnegative(f"{who}: {key}", getattr(self, key)))
        if not (self.stiffness or self.damping):
            raise InputError(
                f"{who}: stiffness or damping must be positive; both are zero, so leave the force out"
            )


@dataclass(frozen=True)
class JointSpring:
    """A spring and a damper in a joint of one degree of freedom: tau = -stiffness (q - rest) - damping v.

    Args:
        joint: name of the joint.
        stiffness: spring stiffness [N m/rad or N/m], not negative.
        rest: position without spring force [rad or m].
        damping: damping coefficient [N m s/rad or N s/m], not negative.
        name: used in messages and results.
    """

    joint: str
    stiffness: float
    rest: float = 0.0
    damping: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("JointSpring: name", self.name)
        who = label(self)
        text(f"{who}: joint", self.joint)
        for key in ("stiffness", "damping"):
            object.__setattr__(self, key, nonnegative(f"{who}: {key}", getattr(self, key)))
        object.__setattr__(self, "rest", number(f"{who}: rest", self.rest))
        if not (self.stiffness or self.damping):
            raise InputError(
                f"{who}: stiffness or damping must be positive; both are zero, so leave the force out"
            )


@dataclass(frozen=True)
class Wrench:
    """A force and a moment on the body of a frame, at the frame's origin, in world axes.

    Args:
        frame: name of a frame of the model.
        value: [force; moment] as 6 numbers [N; N m], or a function t -> 6 numbers.
        name: used in messages and results.
    """

    frame: str
    value: Sequence[float] | Callable[[float], object]
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("Wrench: name", self.name)
        who = label(self)
        text(f"{who}: frame", self.frame)
        if not callable(self.value):
            six = array(f"{who}: value [force; moment]", self.value, (6,))
            object.__setattr__(self, "value", tuple(float(x) for x in six))


@dataclass(frozen=True)
class UserForce:
    """Any applied generalized force as a Python function.

    Args:
        function: (t, q, v) -> generalized force, shape (nv,) [N or N m].
        name: used in messages and results.
    """

    function: Callable[..., object]
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("UserForce: name", self.name)
        function(f"{label(self)}: function", self.function, "(t, q, v) -> force")


Force = SpringDamper | JointSpring | Wrench | UserForce
