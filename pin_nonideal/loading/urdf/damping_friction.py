"""Joint damping and dry friction of a robot's file, as laws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.description.constraints import JointCoupling, PrescribedMotion
from pin_nonideal.description.laws import JointFriction
from pin_nonideal.types import Model


def dissipation(
    model: Model, laws: Sequence[object], couplings: Sequence[object], notes: list[str]
) -> list[JointFriction]:
    """Return the joint friction of the robot's file as laws.

    URDF states it in `<dynamics>`, MJCF in `damping` and `frictionloss`. Pinocchio stores these values in
    `model.damping` and `model.upperDryFrictionLimit`, and its forward dynamics ignores them. The friction of
    a mimic joint q = r q_leader + c is added to its leader: dry friction times |r|, damping times r^2.

    Args:
        model: pinocchio.Model.
        laws: laws of the user; a JointFriction replaces the file's values for its joint.
        couplings: constraints of the file; mimic joints are `JointCoupling`, or `PrescribedMotion` if they
            are held.
        notes: receives a note for each replacement, and for each joint with several velocities.
    """
    with_law = {law.joint for law in laws if isinstance(law, JointFriction)}
    leaders = {c.joint1: (c.joint2, c.ratio) for c in couplings if isinstance(c, JointCoupling)}
    held = {c.joint for c in couplings if isinstance(c, PrescribedMotion)}
    dry: dict[str, float] = {}
    viscous: dict[str, float] = {}
    radius: dict[str, float] = {}
    replaced: dict[str, None] = {}
    for j in range(1, model.njoints):
        dofs = slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
        name, damping, friction = model.names[j], model.damping[dofs], model.upperDryFrictionLimit[dofs]
        if not (damping.any() or friction.any()):
            continue
        if model.nvs[j] != 1 and not _slides_and_turns(model, j, damping, friction, notes):
            continue
        ratio = 1.0
        for _ in leaders:
            if name in leaders:
                ratio *= leaders[name][1]
                name = leaders[name][0]
        if model.nvs[j] != 1:
            radius[name] = 1.0  # equal values in both units
        if name in with_law:
            replaced[name] = None
        elif name not in held:
            dry[name] = dry.get(name, 0.0) + abs(ratio) * float(friction[0])
            viscous[name] = viscous.get(name, 0.0) + ratio**2 * float(damping[0])
    if replaced:
        notes.append(
            "laws given replace the damping and friction of the robot's file in " + ", ".join(replaced)
        )
    return [
        JointFriction(n, coulomb=dry[n], viscous=viscous[n], radius=radius.get(n, 0.0), name=f"{n} dynamics")
        for n in dry
    ]


def _slides_and_turns(
    model: Model, j: int, damping: NDArray[np.float64], friction: NDArray[np.float64], notes: list[str]
) -> bool:
    """Check if all velocities of a joint have equal values, and add a note on their use."""
    name, kind = model.names[j], model.joints[j].shortname()
    alike = np.ptp(damping) == 0.0 and np.ptp(friction) == 0.0
    if not alike or kind not in ("JointModelPlanar", "JointModelFreeFlyer"):
        notes.append(
            f'joint "{name}" has {model.nvs[j]} axes: damping and friction of the robot\'s file are left out'
        )
        return False
    notes.append(
        f'joint "{name}" slides and turns: damping {damping[0]:g} of the robot\'s file is taken in N s/m and '
        f"N m s/rad, friction {friction[0]:g} in N and N m"
    )
    return True
