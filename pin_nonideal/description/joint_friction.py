"""Dry and viscous friction of joints, bearings, teeth and threads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import fields as dataclass_fields

from pin_nonideal.description.constraints import is_mimic
from pin_nonideal.errors import InputError, UnknownNameError, nearest, short_repr
from pin_nonideal.types import Model
from pin_nonideal.validation import (
    by_name,
    choice,
    label,
    nonnegative,
    number,
    optional_text,
    positive,
    sequence,
    text,
)


@dataclass(frozen=True)
class JointFriction:
    """Friction in a joint, an anchor or a coupling, with constant or load-dependent limits.

    Let v_j be the joint's velocity, f its reaction force, and m_b its bending moment. The force has parts
    along (axial, normal) and across (radial) the joint's axis. The dry friction limit is

        revolute, helical, universal:  limit = constant + mu (radius (|f_radial| + |m_b| / span)
                                                             + axial_radius |f_axial|)       [N m]
        spherical:          limit = constant + mu radius |f|                                 [N m]
        prismatic:          limit = constant + mu (|f_radial| + |m| / span)                  [N]
        planar:             limit = constant + mu (|f_normal| + |m_b| / span)                [N]
        translation, free flyer:       limit = constant                                      [N]
        coupling:           limit = constant + k |ratio lam|                                 [N m or N]

    Here constant = coulomb + preload, m is the reaction moment about the joint's origin, and m_b is its part
    across the axis (for a planar joint, the normal of its plane). Without `span`, moments are ignored.
    Sliding gives C_j = -limit s(v_j) sgn(v_j) - viscous v_j, with Stribeck's factor
    s = 1 + (static_ratio - 1) exp(-(v_j / stribeck_velocity)^2), and s = 1 without stribeck_velocity.
    A sticking joint stays at rest while the required force is below static_ratio times the limit.

    Directions. The two axes of a universal joint have independent friction. In a ball joint (spherical, or a
    `PointAnchor` of all three axes) C opposes the angular velocity, with |C| = limit. Planar joints and free
    flyers have the same friction for sliding in two or three directions. Turning has a limit of radius times
    the sliding limit [N m], and a viscous coefficient of radius^2 times `viscous`, as for a contact area of
    that mean radius. Without `radius` turning is free. Sliding friction and turning friction are independent.

    Couplings. lam is the multiplier of a `JointCoupling`, the tooth force on joint1 [N m or N]; limit and v_j
    belong to joint2. One of two inputs defines the losses: the efficiencies, or the thread of a screw or worm
    on joint2. The thread has lead angle l (ratio = tan(l) times the thread's mean radius) and
    tan(p) = mu / cos(pressure_angle):

        joint2 drives:  efficiency      = tan(l) / tan(l + p)
        joint1 drives:  efficiency_back = tan(l - p) / tan(l)

    Both follow from one sliding pair of surfaces that carries lam. Its friction removes part a of lam
    from joint1 and part b from joint2: a = tan(p) tan(l) and b = tan(p) / tan(l). With the efficiencies e and
    e', a = (1 - 2 e + e e') / (1 - e e') and b = (1 - 2 e' + e e') / (1 - e e'). The limit has k = a + b. If
    b >= 1, that is efficiency_back <= 0, joint1 cannot drive joint2: the coupling is self-locking.

    Args:
        joint: name of a revolute, prismatic, helical, spherical, universal, planar, translation or
            free-flyer joint, of a `HingeAnchor`, of a `PointAnchor` of three axes, or of a `JointCoupling`.
        coulomb: constant dry friction [N m or N].
        mu: coefficient of friction of the bearing surfaces.
        radius: friction radius of the radial load [m]; for planar joints and free flyers, the mean radius of
            the contact area.
        axial_radius: mean friction radius of the axial load [m].
        span: lever arm at which the moment loads the bearing [m]: half the distance between two bearings.
        preload: dry friction of a preloaded bearing, present without load [N m or N].
        static_ratio: ratio of static to kinetic friction, at least 1.
        stribeck_velocity: velocity scale of the decrease from static to kinetic friction [rad/s or m/s].
        viscous: viscous coefficient [N m s/rad or N s/m].
        reaction: "total" solves the implicit equation for the reaction with friction; "ideal" evaluates the
            law on the ideal reaction, as in the paper's Example (c).
        lead_angle: lead angle of the thread of a coupling [rad], between 0 and pi/2; with `mu`.
        pressure_angle: flank angle of the thread in its normal section [rad]: 0 for a square thread.
        efficiency: ratio of the power at joint1 to the power at joint2 while joint2 drives, between 0 and 1.
        efficiency_back: power at joint2 over power at joint1 while joint1 drives, below 1; zero or negative
            if joint1 cannot drive. None: equal to `efficiency`, as for a gear mesh.
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
    lead_angle: float | None = None
    pressure_angle: float = 0.0
    efficiency: float | None = None
    efficiency_back: float | None = None
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
        _thread(self, who)
        _efficiencies(self, who)
        if not (self.coulomb or self.mu or self.preload or self.viscous or self.efficiency):
            raise InputError(
                f"{who}: one of coulomb, mu, preload, viscous must be positive; all are zero, "
                "so leave the law out"
            )

    @classmethod
    def for_joints(
        cls,
        scene: object,
        joints: Mapping[str, float | Mapping[str, object]] | Sequence[str] | None = None,
        **coefficients: object,
    ) -> list[JointFriction]:
        """Return the friction of many joints: one law for each joint, with the joint's name.

        Args:
            scene: a Scene or a pinocchio.Model.
            joints: by joint name the dry friction `coulomb` or a table of coefficients (a dict, or a pandas
                Series or DataFrame with a column for each joint), or names alone; None
                for all joints of one degree of freedom. Mimic joints of a Scene are then left out.
            **coefficients: coefficients of all joints; a table replaces them for its joint.

        Returns:
            The laws, in the order of `joints` or of the model.

        Raises:
            InputError: a coefficient is invalid, or all coefficients of a joint are zero.
            UnknownNameError: there is no such joint.
        """
        who = "JointFriction.for_joints"
        model: Model = getattr(scene, "model", scene)
        if not (hasattr(model, "names") and hasattr(model, "joints")):
            raise InputError(f"{who}: scene must be a Scene or a pinocchio.Model; got {short_repr(scene)}")
        known = [str(name) for name in model.names][1:]
        if joints is None:
            mimics = {c.joint1 for c in getattr(scene, "constraints", ()) if is_mimic(c)}
            single = [name for name, j in zip(known, list(model.joints)[1:], strict=True) if j.nv == 1]
            joints = [name for name in single if name not in mimics]
        given = by_name(joints)
        table = {n: {} for n in sequence(f"{who}: joints", joints)} if given is None else given
        laws, fields_of_law = [], [entry.name for entry in dataclass_fields(cls) if entry.name != "joint"]
        for joint, fields in table.items():
            if joint not in known:
                raise UnknownNameError(f'{who}: no joint "{joint}"{nearest(str(joint), known)}')
            named = by_name(fields)
            own = {"coulomb": fields} if named is None else named
            for key in [*coefficients, *own]:
                if key not in fields_of_law:
                    raise UnknownNameError(f'{who}: no coefficient "{key}"{nearest(str(key), fields_of_law)}')
            laws.append(cls(joint, **{"name": f"{joint} friction", **coefficients, **own}))
        return laws

    @property
    def tooth_losses(self) -> tuple[float, float]:
        """Parts a and b of a coupling's tooth force that friction removes from joint1 and from joint2."""
        if self.efficiency is not None:
            e, back = self.efficiency, self.efficiency_back
            back = e if back is None else back
            return (1.0 - 2.0 * e + e * back) / (1.0 - e * back), (1.0 - 2.0 * back + e * back) / (
                1.0 - e * back
            )
        if self.lead_angle is None:
            return 0.0, 0.0
        rough, rise = self.mu / math.cos(self.pressure_angle), math.tan(self.lead_angle)
        return rough * rise, rough / rise


def _acute(what: str, angle: float) -> float:
    """Return an angle of a thread [rad], checked to be below pi/2."""
    if not angle < 0.5 * math.pi:
        raise InputError(f"{what} must be below pi/2 rad; got {angle:g}")
    return angle


def _thread(law: JointFriction, who: str) -> None:
    """Check the thread of a coupling: two angles, and the coefficient that they need."""
    what = f"{who}: pressure_angle"
    object.__setattr__(law, "pressure_angle", _acute(what, nonnegative(what, law.pressure_angle)))
    if law.lead_angle is None:
        if law.pressure_angle:
            raise InputError(f"{who}: pressure_angle describes a thread; give its lead_angle too")
        return
    what = f"{who}: lead_angle"
    object.__setattr__(law, "lead_angle", _acute(what, positive(what, law.lead_angle)))
    if not law.mu:
        raise InputError(f"{who}: lead_angle needs a positive mu of the thread")


def _efficiencies(law: JointFriction, who: str) -> None:
    """Check the two efficiencies of a coupling."""
    if law.efficiency is None:
        if law.efficiency_back is not None:
            raise InputError(f"{who}: efficiency_back needs efficiency too")
        return
    if law.mu or law.lead_angle is not None:
        raise InputError(f"{who}: give either efficiency, or mu and lead_angle; got both")
    forth = number(f"{who}: efficiency", law.efficiency)
    if not 0.0 < forth < 1.0:
        raise InputError(f"{who}: efficiency must lie between 0 and 1; got {forth:g}")
    object.__setattr__(law, "efficiency", forth)
    if law.efficiency_back is not None:
        back = number(f"{who}: efficiency_back", law.efficiency_back)
        if not back < 1.0:
            raise InputError(f"{who}: efficiency_back must be below 1; got {back:g}")
        object.__setattr__(law, "efficiency_back", back)


def static_ratio(who: str, value: object) -> float:
    """Return the ratio of static to kinetic friction, checked to be at least 1.

    Raises:
        InputError: the ratio is below 1 or no finite number.
    """
    ratio = number(f"{who}: static_ratio", value)
    if ratio < 1.0:
        raise InputError(
            f"{who}: static_ratio must be at least 1 (static friction is never below kinetic friction); "
            f"got {ratio:g}"
        )
    return ratio
