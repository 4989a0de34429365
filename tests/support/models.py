"""Pinocchio models rebuilt in other units, on another mount, in another order, or with a split body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

# Dimensions of velocity and configuration by kind of joint: L for lengths, 1 for pure numbers.
LENGTHS = {
    "JointModelPX": ("L", "L"),
    "JointModelPY": ("L", "L"),
    "JointModelPZ": ("L", "L"),
    "JointModelPrismaticUnaligned": ("L", "L"),
    "JointModelTranslation": ("LLL", "LLL"),
    "JointModelPlanar": ("LL1", "LL11"),
    "JointModelFreeFlyer": ("LLL111", "LLL1111"),
}


@dataclass(frozen=True)
class Units:
    """Old units of length, mass and time, expressed in new units."""

    L: float = 1.0
    M: float = 1.0
    T: float = 1.0

    @property
    def energy(self) -> float:
        return self.M * self.L**2 / self.T**2

    @property
    def force(self) -> float:
        return self.energy / self.L

    def of(self, letters: str) -> np.ndarray:
        """Return factors of coordinates: the length factor for each L, one for each 1."""
        return np.array([self.L if letter == "L" else 1.0 for letter in letters])


SI = Units()


def letters(joint: Any) -> tuple[str, str]:
    """Return the dimensions of a joint's velocity and configuration."""
    kind = joint.shortname()
    if kind == "JointModelComposite":
        parts = [letters(part) for part in joint.extract().joints]
        return "".join(v for v, _ in parts), "".join(q for _, q in parts)
    return LENGTHS.get(kind, ("1" * joint.nv, "1" * joint.nq))


def model_letters(model: pin.Model) -> tuple[str, str]:
    """Return the dimensions of a model's velocity and configuration."""
    parts = [letters(joint) for joint in list(model.joints)[1:]]
    return "".join(v for v, _ in parts), "".join(q for _, q in parts)


def joint_letter(model: pin.Model, name: str) -> str:
    """Return the dimension of the first velocity of a joint."""
    return letters(model.joints[model.getJointId(name)])[0][0]


def scaled_place(place: pin.SE3, units: Units) -> pin.SE3:
    return pin.SE3(place.rotation, units.L * place.translation)


def scaled_joint(joint: Any, units: Units) -> Any:
    """Return a copy of a joint with its lengths in other units."""
    kind = joint.shortname()
    inner = joint.extract() if hasattr(joint, "extract") else joint
    if kind == "JointModelComposite":
        made = pin.JointModelComposite()
        for part, place in zip(inner.joints, inner.jointPlacements, strict=True):
            made.addJoint(scaled_joint(part, units), scaled_place(place, units))
        return made
    if kind == "JointModelHelicalUnaligned":
        return pin.JointModelHelicalUnaligned(np.array(inner.axis), units.L * inner.pitch)
    if kind.startswith("JointModelH"):
        return getattr(pin, kind)(units.L * inner.pitch)
    if kind == "JointModelEllipsoid":
        radii = (inner.radius_x, inner.radius_y, inner.radius_z)
        return pin.JointModelEllipsoid(*(units.L * r for r in radii))
    return joint


def scaled_inertia(Y: pin.Inertia, units: Units, part: float = 1.0) -> pin.Inertia:
    mass = part * units.M
    return pin.Inertia(mass * Y.mass, units.L * Y.lever, mass * units.L**2 * Y.inertia)


@dataclass
class Rebuilt:
    """Model derived from another model.

    Attributes:
        model: new model.
        joints: new index of each old joint.
        parts: new index of the joint whose body has the frames and children of each old joint.
    """

    model: pin.Model
    joints: dict[int, int] = field(default_factory=dict)
    parts: dict[int, int] = field(default_factory=dict)


def rebuilt(
    old: pin.Model,
    *,
    units: Units = SI,
    mount: pin.SE3 | None = None,
    moving: Any = None,
    order: Sequence[int] | None = None,
    split: int | None = None,
    by: Any = None,
) -> Rebuilt:
    """Rebuild a model joint by joint.

    Args:
        old: model.
        units: units of the new model.
        mount: placement of all parts that are fixed to the world, and rotation of gravity.
        moving: joint "mount" between the world and these parts.
        order: order of the joints, branch by branch.
        split: joint whose body is split into 0.6 and 0.4 of its inertia; the second body has all frames.
        by: joint "split" between the two bodies.
    """
    new, away = pin.Model(), pin.SE3.Identity() if mount is None else mount
    new.name = old.name
    made = Rebuilt(new, {0: 0}, {0: 0})
    if moving is not None:
        made.parts[0] = new.addJoint(0, moving, pin.SE3.Identity(), "mount")
        new.appendBodyToJoint(made.parts[0], pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    for j in range(1, old.njoints) if order is None else order:
        place = scaled_place(old.jointPlacements[j], units)
        place = away * place if old.parents[j] == 0 else place
        k = new.addJoint(made.parts[old.parents[j]], scaled_joint(old.joints[j], units), place, old.names[j])
        made.joints[j] = made.parts[j] = k
        part = 0.6 if j == split else 1.0
        new.appendBodyToJoint(k, scaled_inertia(old.inertias[j], units, part), pin.SE3.Identity())
        if j == split:
            made.parts[j] = s = new.addJoint(k, by, pin.SE3.Identity(), "split")
            new.appendBodyToJoint(s, scaled_inertia(old.inertias[j], units, 0.4), pin.SE3.Identity())
    for f in list(old.frames)[1:]:
        place = scaled_place(f.placement, units)
        place = away * place if f.parentJoint == 0 else place
        joint = made.joints if f.type == pin.FrameType.JOINT else made.parts
        new.addFrame(pin.Frame(f.name, joint[f.parentJoint], 0, place, f.type), False)
    _copy_numbers(old, made, units)
    new.gravity = pin.Motion(away.rotation @ old.gravity.linear * units.L / units.T**2, np.zeros(3))
    return made


def _copy_numbers(old: pin.Model, made: Rebuilt, units: Units) -> None:
    """Copy armature and limits of each joint."""
    new = made.model
    inertia, least, most = np.zeros(new.nv), np.full(new.nv, -np.inf), np.full(new.nv, np.inf)
    lower, upper = np.full(new.nq, -np.inf), np.full(new.nq, np.inf)

    def finite(x: Any) -> np.ndarray:
        """Return limits with infinity in place of Pinocchio's largest number for no limit."""
        x = np.asarray(x)
        return np.where(np.abs(x) > 1e300, np.sign(x) * np.inf, x)

    for j, k in made.joints.items():
        if j == 0:
            continue
        dofs, places = (units.of(x) for x in letters(old.joints[j]))
        was, now = (slice(m.idx_vs[i], m.idx_vs[i] + m.nvs[i]) for m, i in ((old, j), (new, k)))
        inertia[now] = np.asarray(old.armature)[was] * units.energy * units.T**2 / dofs**2
        least[now] = finite(old.lowerEffortLimit)[was] * units.energy / dofs
        most[now] = finite(old.upperEffortLimit)[was] * units.energy / dofs
        was, now = (slice(m.idx_qs[i], m.idx_qs[i] + m.nqs[i]) for m, i in ((old, j), (new, k)))
        lower[now] = finite(old.lowerPositionLimit)[was] * places
        upper[now] = finite(old.upperPositionLimit)[was] * places
    new.armature = inertia
    new.lowerEffortLimit, new.upperEffortLimit = least, most
    new.lowerPositionLimit, new.upperPositionLimit = lower, upper


def other_order(model: pin.Model) -> list[int]:
    """Return the joints branch by branch, with the branches of each body in reverse order."""
    children: Callable[[int], list[int]] = lambda j: [  # noqa: E731
        k for k in range(model.njoints - 1, 0, -1) if model.parents[k] == j
    ]
    found, waiting = [], children(0)
    while waiting:
        found.append(waiting.pop(0))
        waiting = children(found[-1]) + waiting
    return found
