"""Dimensions of the fields of descriptions; a field without an entry raises an error in a change of units."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pinocchio as pin

import pin_nonideal as pn

from .models import Units, joint_letter

Factor = Callable[[Units], float]

# Dimensionless numbers, names and flags.
PLAIN = {
    "axis",
    "normal",
    "mu",
    "static_ratio",
    "restitution",
    "rpy",
    "rpy1",
    "rpy2",
    "exponent",
    "lead_angle",
    "pressure_angle",
    "efficiency",
    "efficiency_back",
    "states",
    "size",
}
LENGTHS = {
    "radius",
    "radius1",
    "radius2",
    "axial_radius",
    "span",
    "offset",
    "height",
    "torsional",
    "rolling",
    "length",
    "below",
    "above",
    "end",
    "xyz",
    "xyz1",
    "xyz2",
    "rim",
    "solid1",
    "solid2",
    "semiaxes",
    "points",
    "segment1",
    "segment2",
    "rest_length",
}
# Exponents of force, of the joint unit u (length or angle) and of time: (forces, u, times).
OF_JOINT = {
    (pn.JointFriction, "coulomb"): (1, 0, 0),
    (pn.JointFriction, "preload"): (1, 0, 0),
    (pn.JointFriction, "stribeck_velocity"): (0, 1, -1),
    (pn.JointFriction, "viscous"): (1, -1, 1),
    (pn.SigmoidFriction, "phi1"): (1, 0, 0),
    (pn.SigmoidFriction, "phi2"): (0, -1, 1),
    (pn.SigmoidFriction, "phi3"): (0, 1, -1),
    (pn.LuGre, "stiffness"): (1, -1, 0),
    (pn.LuGre, "damping"): (1, -1, 1),
    (pn.LuGre, "viscous"): (1, -1, 1),
    (pn.LuGre, "coulomb"): (1, 0, 0),
    (pn.LuGre, "stiction"): (1, 0, 0),
    (pn.LuGre, "stribeck_velocity"): (0, 1, -1),
    (pn.JointSpring, "stiffness"): (1, -1, 0),
    (pn.JointSpring, "damping"): (1, -1, 1),
    (pn.JointSpring, "rest"): (0, 1, 0),
    (pn.JointLimit, "lower"): (0, 1, 0),
    (pn.JointLimit, "upper"): (0, 1, 0),
}
SPECIAL: dict[tuple[type, str], Callable[[Any, Units], float]] = {
    (pn.BoxContact, "size"): lambda d, u: u.L,
    (pn.SpringDamper, "stiffness"): lambda d, u: u.force / u.L,
    (pn.SpringDamper, "damping"): lambda d, u: u.force * u.T / u.L,
    (pn.Drag, "coefficient"): lambda d, u: u.force * (u.T / u.L) ** d.exponent,
}


def rubbing_letter(model: pin.Model, name: str, constraints: tuple[Any, ...]) -> str:
    """Return the dimension of friction, torque or force; a coupling has the one of its second joint."""
    for c in constraints:
        if c.name == name:
            return joint_letter(model, c.joint2) if isinstance(c, pn.JointCoupling) else "1"
    return joint_letter(model, name)


def factor(d: Any, key: str, model: pin.Model, constraints: tuple[Any, ...]) -> Factor:
    """Return the unit factor of a field of a description.

    Raises:
        KeyError: the field has no entry.
    """
    kind = type(d)
    if (kind, key) in SPECIAL:
        return lambda units: SPECIAL[kind, key](d, units)
    if (kind, key) in OF_JOINT:
        letter = rubbing_letter(model, d.joint, constraints)
        forces, lengths, times = OF_JOINT[kind, key]

        def of_joint(units: Units) -> float:
            u = float(units.of(letter)[0])
            return float((units.energy / u) ** forces * u**lengths * units.T**times)

        return of_joint
    if kind is pn.JointCoupling and key in ("ratio", "offset"):
        one, two = joint_letter(model, d.joint1), joint_letter(model, d.joint2)
        return lambda units: float(units.of(one)[0] / (units.of(two)[0] if key == "ratio" else 1.0))
    if key in PLAIN:
        return lambda units: 1.0
    if key in LENGTHS:
        return lambda units: units.L
    raise KeyError(
        f"{kind.__name__}.{key} has no dimension here; add its line to tests/support/dimensions.py"
    )
