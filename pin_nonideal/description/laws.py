"""Frozen descriptions of nonideal laws C(q, v, t, reactions) in Eq. (9), w^T F^c = w^T C.

Friction laws never supply energy: their power v^T C is zero or negative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pin_nonideal.description.joint_friction import JointFriction, static_ratio
from pin_nonideal.errors import InputError
from pin_nonideal.validation import (
    choice,
    count,
    function,
    label,
    nonnegative,
    number,
    optional_text,
    positive,
    text,
)

__all__ = [
    "Drag",
    "JointFriction",
    "LuGre",
    "SigmoidFriction",
    "UserFriction",
    "UserLaw",
]


@dataclass(frozen=True)
class SigmoidFriction:
    """Smooth friction of a robot joint from identification, independent of the load.

        C_j = -(phi1 / (1 + exp(-phi2 (v_j + phi3))) - phi1 / (1 + exp(-phi2 phi3)))          [N m]

    It vanishes at rest, so a loaded joint creeps; use `JointFriction` for joints that must stick.
    Source: Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca, IEEE RA-L 4 (2019), Franka Emika Panda.

    Args:
        joint: name of a joint of one degree of freedom.
        phi1: difference of the friction between both directions [N m], not negative.
        phi2: steepness [s/rad], positive.
        phi3: velocity offset [rad/s].
        name: used in messages and results.
    """

    joint: str
    phi1: float
    phi2: float
    phi3: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("SigmoidFriction: name", self.name)
        who = label(self)
        text(f"{who}: joint", self.joint)
        object.__setattr__(self, "phi1", nonnegative(f"{who}: phi1", self.phi1))
        object.__setattr__(self, "phi2", positive(f"{who}: phi2", self.phi2))
        object.__setattr__(self, "phi3", number(f"{who}: phi3", self.phi3))


@dataclass(frozen=True)
class LuGre:
    """Bristle friction with presliding and hysteresis; its deflection z is integrated with the motion.

        dz/dt = v - stiffness |v| z / g(v)
        g(v) = coulomb + (stiction - coulomb) exp(-(v / stribeck_velocity)^2)
        C_j = -(stiffness z + damping dz/dt + viscous v)                                       [N m or N]

    z is one column of `Trajectory.z`. Bristles deflect under any load, and the body drifts under a varying
    load; use `JointFriction` for joints that must stick.
    Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Automatic Control 40 (1995).

    Args:
        joint: name of a joint of one degree of freedom.
        stiffness: bristle stiffness [N m/rad or N/m], positive.
        damping: bristle damping [N m s/rad or N s/m], not negative.
        viscous: viscous coefficient [N m s/rad or N s/m], not negative.
        coulomb: level at high velocity [N m or N], positive.
        stiction: level near rest, at least `coulomb`; equal to it when None.
        stribeck_velocity: velocity scale of the decrease from stiction to coulomb [rad/s or m/s], positive.
        name: used in messages and results.
    """

    joint: str
    stiffness: float
    damping: float
    coulomb: float
    viscous: float = 0.0
    stiction: float | None = None
    stribeck_velocity: float = 1e-3
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("LuGre: name", self.name)
        who = label(self)
        text(f"{who}: joint", self.joint)
        for key in ("stiffness", "coulomb", "stribeck_velocity"):
            object.__setattr__(self, key, positive(f"{who}: {key}", getattr(self, key)))
        for key in ("damping", "viscous"):
            object.__setattr__(self, key, nonnegative(f"{who}: {key}", getattr(self, key)))
        level = self.coulomb if self.stiction is None else positive(f"{who}: stiction", self.stiction)
        if level < self.coulomb:
            raise InputError(
                f"{who}: stiction must be at least coulomb (static friction is never below kinetic "
                f"friction); got {level:g} and {self.coulomb:g}"
            )
        object.__setattr__(self, "stiction", level)


@dataclass(frozen=True)
class Drag:
    """Resistance of a fluid against the motion of a frame's origin.

    Force on the body at the origin of the frame, in world axes: f = -coefficient |u|^(exponent - 1) u, with
    its velocity u, and C = J^T f. The paper's Example (a), Eq. (58), has exponent = 2 beta.

    Args:
        frame: name of a frame of the model.
        coefficient: drag coefficient [N (s/m)^exponent], not negative.
        exponent: positive; 1 is linear drag, 2 is quadratic drag.
        name: used in messages and results.
    """

    frame: str
    coefficient: float
    exponent: float = 1.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("Drag: name", self.name)
        who = label(self)
        text(f"{who}: frame", self.frame)
        object.__setattr__(self, "coefficient", nonnegative(f"{who}: coefficient", self.coefficient))
        object.__setattr__(self, "exponent", positive(f"{who}: exponent", self.exponent))


@dataclass(frozen=True)
class UserLaw:
    """Any law C(q, v, t, reactions) as a Python function, optionally with states.

    `reactions.lam` holds all multipliers, `reactions[name]` those of one constraint, and
    `reactions.wrench(name)` the wrench of a joint or an anchor. The function must be pure. The force must be
    finite for any reactions, since iterations call it with provisional reactions.

    Args:
        function: (t, q, v, reactions) -> C, shape (nv,); with states: (t, q, v, reactions, z) -> (C, dz/dt).
        reaction: "total" solves the implicit equation, "ideal" evaluates the law once on the ideal reactions,
            None passes None for the reactions, at no cost.
        states: number of states z of the law.
        name: used in messages and results.
    """

    function: Callable[..., object]
    reaction: str | None = "total"
    states: int = 0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("UserLaw: name", self.name)
        who = label(self)
        object.__setattr__(self, "states", count(f"{who}: states", self.states))
        signature = "(t, q, v, reactions, z) -> (C, dz)" if self.states else "(t, q, v, reactions) -> C"
        function(f"{who}: function", self.function, signature)
        choice(f"{who}: reaction", self.reaction, ("total", "ideal", None))


@dataclass(frozen=True)
class UserFriction:
    """Dry friction along a user-defined generalized direction; the package determines its modes.

    With d = direction(t, q) and slip velocity s = d . v, sliding gives C = -limit sgn(s) d. Sticking is an
    ideal row that holds s at zero while the required force is below static_ratio times the limit.

    If friction differs between both slip directions, as in a one-way clutch or a ratchet, `limit` returns
    (forward, backward): C = -forward d for s > 0, and C = backward d for s < 0. Sticking has C = f d and
    holds while -static_ratio forward <= f <= static_ratio backward.

    Args:
        direction: (t, q) -> row, shape (nv,).
        limit: (t, q, v, reactions) -> kinetic friction force, not negative: one number, or two numbers
            against forward slip (along `direction`) and backward slip.
        static_ratio: ratio of static to kinetic friction, at least 1.
        name: used in messages and results.
    """

    direction: Callable[..., object]
    limit: Callable[..., object]
    static_ratio: float = 1.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("UserFriction: name", self.name)
        who = label(self)
        function(f"{who}: direction", self.direction, "(t, q) -> row")
        function(f"{who}: limit", self.limit, "(t, q, v, reactions) -> force")
        object.__setattr__(self, "static_ratio", static_ratio(who, self.static_ratio))


Law = JointFriction | SigmoidFriction | LuGre | Drag | UserLaw | UserFriction
