"""Chains of rods, the mechanism of most closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

SLENDER = 1e-3  # axial over transverse moment of inertia of a rod


def rods(
    lengths: Any,
    masses: Any = None,
    *,
    along: Any = (1.0, 0.0, 0.0),
    joint: Any = None,
    name: str = "j",
    model: Any = None,
    start: Any = (0.0, 0.0, 0.0),
) -> Any:
    """Return a chain of slender rods with joints `name`0, `name`1, ... and a frame `name`tip at its end.

    Args:
        lengths: lengths of the rods [m].
        masses: masses of the rods [kg]; None for 1 each.
        along: unit vector of the rods at zero angles.
        joint: pinocchio joint of each rod; None for a hinge about y.
        name: prefix of the names of joints and frame.
        model: pinocchio.Model to add the chain to; None for a new one, with gravity along -z.
        start: position of the first joint [m].
    """
    if model is None:
        model = pin.Model()
        model.name = "rods"
    joint = pin.JointModelRY() if joint is None else joint
    along, parent = np.asarray(along, dtype=float), 0
    place = pin.SE3(np.eye(3), np.asarray(start, dtype=float))
    across = np.eye(3) - (1.0 - SLENDER) * np.outer(along, along)
    for k, length in enumerate(lengths):
        mass = 1.0 if masses is None else float(masses[k])
        parent = model.addJoint(parent, joint, place, f"{name}{k}")
        rod = pin.Inertia(mass, 0.5 * length * along, mass * length**2 / 12.0 * across)
        model.appendBodyToJoint(parent, rod, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), length * along)
    model.addFrame(pin.Frame(f"{name}tip", parent, 0, place, pin.FrameType.OP_FRAME), False)
    return model
