"""Joint coordinates for plots: angles, displacements and their rates, with labels and units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array

from .visuals import joint_axis


@dataclass(frozen=True)
class Coordinate:
    """Component of a configuration or velocity for plots.

    Attributes:
        joint: name of the joint.
        label: name of the joint, with the component if the joint has several.
        unit: unit of the values.
        values: value of each sample, (nt,).
    """

    joint: str
    label: str
    unit: str
    values: Array


def positions(model: pin.Model, q: Array) -> list[Coordinate]:
    """Return the angles and displacements of all joints; spatial orientations have none.

    Args:
        model: model of the scene.
        q: configurations, (nt, nq).
    """
    coordinates = []
    for joint in range(1, model.njoints):
        name, kind = str(model.names[joint]), model.joints[joint].shortname()
        first, nq, nv = model.joints[joint].idx_q, model.joints[joint].nq, model.joints[joint].nv
        part = q[:, first : first + nq]
        if nv == 1:
            unit = "rad" if joint_axis(model, joint)[1] else "m"
            value = part[:, 0] if nq == 1 else np.unwrap(np.arctan2(part[:, 1], part[:, 0]))
            coordinates.append(Coordinate(name, name, unit, value))
        elif kind in ("JointModelFreeFlyer", "JointModelTranslation", "JointModelPlanar"):
            axes = "xy" if kind == "JointModelPlanar" else "xyz"
            coordinates += [Coordinate(name, f"{name} {a}", "m", part[:, i]) for i, a in enumerate(axes)]
            if kind == "JointModelPlanar":
                angle = np.unwrap(np.arctan2(part[:, 3], part[:, 2]))
                coordinates.append(Coordinate(name, f"{name} angle", "rad", angle))
    return coordinates


def velocities(model: pin.Model, v: Array, per: str = "/s") -> list[Coordinate]:
    """Return the components of a velocity or, with `per` "/s²", of an acceleration.

    Args:
        model: model of the scene.
        v: velocities, (nt, nv).
        per: suffix of the units rad and m.
    """
    rates = []
    for joint in range(1, model.njoints):
        name, kind = str(model.names[joint]), model.joints[joint].shortname()
        first, nv = model.joints[joint].idx_v, model.joints[joint].nv
        if nv == 1:
            units, labels = ["rad" if joint_axis(model, joint)[1] else "m"], [name]
        elif kind == "JointModelFreeFlyer":
            units = ["m"] * 3 + ["rad"] * 3
            labels = [f"{name} {c}" for c in ("vx", "vy", "vz", "wx", "wy", "wz")]
        elif kind == "JointModelTranslation":
            units, labels = ["m"] * 3, [f"{name} {c}" for c in ("vx", "vy", "vz")]
        elif kind == "JointModelPlanar":
            units, labels = ["m", "m", "rad"], [f"{name} {c}" for c in ("vx", "vy", "wz")]
        elif kind in ("JointModelSpherical", "JointModelSphericalZYX"):
            units, labels = ["rad"] * 3, [f"{name} {c}" for c in ("wx", "wy", "wz")]
        else:
            continue
        for i, (unit, label) in enumerate(zip(units, labels, strict=True)):
            rates.append(Coordinate(name, label, unit + per, v[:, first + i]))
    return rates
