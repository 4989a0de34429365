"""What each nonideal law is: frozen descriptions of C(q, v, t, reactions) in Eq. (9), w^T F^c = w^T C.

C never feeds energy when the law is a friction: its power v^T C is zero or negative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .checks import choice, count, function, label, nonnegative, number, optional_text, positive, text
from .errors import InputError


@dataclass(frozen=True)
class JointFriction:
    """Friction in a joint or an anchor, that may depend on the load it really carries.

    With v_j the joint's velocity, f its reaction force split along (axial) and across (radial) the joint's
    axis and m_b its bending moment, the dry limit is

        load = |f_radial| + 2 |m_b| / span                                              [N]
        revolute:   limit = coulomb + preload + mu (radius load + axial_radius |f_axial|)  [N m]
        prismatic:  limit = coulomb + preload + mu load                                    [N]

    where `span` is the distance of the two bearings that carry m_b as a couple (without it m_b is left out).
    Sliding gives C_j = -limit s(v_j) sgn(v_j) - viscous v_j, with Stribeck's factor
    s = 1 + (static_ratio - 1) exp(-(v_j / stribeck_velocity)^2), and s = 1 without stribeck_velocity.
    Sticking holds while the force it needs is below static_ratio times the limit.

    Args:
        joint: name of a joint of one degree of freedom, or of a hinge anchor.
        coulomb: constant dry friction [N m or N].
        mu: coefficient of friction of the bearing surfaces.
        radius: radius at which the radial load rubs [m].
        axial_radius: mean radius at which the axial load rubs [m].
        span: distance between the two bearings [m].
        preload: dry friction of a preloaded bearing, present without load [N m or N].
        static_ratio: static over kinetic friction, at least 1.
        stribeck_velocity: velocity scale of the fall from static to kinetic [rad/s or m/s].
        viscous: coefficient of the velocity [N m s/rad or N s/m].
        reaction: "total" solves the implicit equation on the real reaction, friction included; "ideal"
            evaluates the law on the ideal reaction, as the paper's Example (c) does.
        name: used in messages and results.
    """

    joint: str
    coulomb: float = 0.0
    mu: float = 0.0
    radius: float = 0.0
    axial_radius: float = 0.0
    span: float | None = None
    preload: float = 0.0
    static_ratio: float = 1.0
    stribeck_velocity: float | None = None
    viscous: float = 0.0
    reaction: str = "total"
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("JointFriction: name", self.name)
        who = label(self)
        text(f"{who}: joint", self.joint)
        for key in ("coulomb", "mu", "radius", "axial_radius", "preload", "viscous"):
            object.__setattr__(self, key, nonnegative(f"{who}: {key}", getattr(self, key)))
        for key in ("span", "stribeck_velocity"):
            if getattr(self, key) is not None:
                object.__setattr__(self, key, positive(f"{who}: {key}", getattr(self, key)))
        object.__setattr__(self, "static_ratio", static_ratio(who, self.static_ratio))
        choice(f"{who}: reaction", self.reaction, ("total", "ideal"))
        if not (self.coulomb or self.mu or self.preload or self.viscous):
            raise InputError(
                f"{who}: one of coulomb, mu, preload, viscous must be positive; all are zero, "
                "so leave the law out"
            )


@dataclass(frozen=True)
class Drag:
    """Resistance of a fluid against the motion of a frame's origin.

    Force on the body at the origin of the frame, in world axes: f = -coefficient |u|^(exponent - 1) u, with u
    its velocity, and C = J^T f.  The paper's Example (a), Eq. (58), is exponent = 2 beta.

    Args:
        frame: name of a frame of the model.
        coefficient: [N (s/m)^exponent], not negative.
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
    """Any law C(q, v, t, reactions) as a Python function, with states of its own when it needs them.

    `reactions.lam` holds all multipliers, `reactions[name]` one constraint's slice, `reactions.wrench(name)`
    the wrench of a joint or an anchor.  The function must be pure, and finite for any reactions: it is called
    with provisional ones.

    Args:
        function: (t, q, v, reactions) -> C, shape (nv,); with states: (t, q, v, reactions, z) -> (C, dz/dt).
        reaction: "total" solves the implicit equation, "ideal" evaluates once on the ideal reactions, None
            passes None and costs nothing.
        states: number of the law's own states z.
        name: used in messages and results.
    """

    function: Callable[..., Any]
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
    """Dry friction along a generalized direction given by the user; the package owns its modes.

    With d = direction(t, q) and slip velocity s = d . v, sliding gives C = -limit sgn(s) d, and sticking is
    an ideal row that holds s at zero.

    Args:
        direction: (t, q) -> row, shape (nv,).
        limit: (t, q, v, reactions) -> largest friction force, not negative.
        name: used in messages and results.
    """

    direction: Callable[..., Any]
    limit: Callable[..., Any]
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("UserFriction: name", self.name)
        who = label(self)
        function(f"{who}: direction", self.direction, "(t, q) -> row")
        function(f"{who}: limit", self.limit, "(t, q, v, reactions) -> force")


def static_ratio(who: str, value: Any) -> float:
    """Static over kinetic friction, checked to be at least 1.

    Raises:
        InputError: it is below 1 or no finite number.
    """
    ratio = number(f"{who}: static_ratio", value)
    if ratio < 1.0:
        raise InputError(
            f"{who}: static_ratio must be at least 1 (static friction is never below kinetic friction); "
            f"got {ratio:g}"
        )
    return ratio


Law = JointFriction | Drag | UserLaw | UserFriction
