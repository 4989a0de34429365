"""Length scales of mechanisms, and the coordinates that are lengths."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.types import Model

# Rows and axes below this fraction of the largest are rounding error.
MIN_ROW_LENGTH = 1e-11


def chain(model: Model) -> float:
    """Return the longest path along the tree from the world to a joint or frame, without slides [m].

    Args:
        model: pinocchio.Model.
    """
    way = [0.0] * model.njoints
    for i in range(1, model.njoints):
        way[i] = way[model.parents[i]] + float(np.linalg.norm(model.jointPlacements[i].translation))
    ends = [way[f.parentJoint] + float(np.linalg.norm(f.placement.translation)) for f in model.frames]
    return float(max([*way, *ends]))


def largest_body(model: Model) -> float:
    """Return the largest radius of gyration of a body about the axes of its joint, zero for point masses [m].

    Args:
        model: pinocchio.Model.
    """
    bodies = [body for body in list(model.inertias)[1:] if body.mass > 0.0]
    squares = [body.lever @ body.lever + 0.5 * np.trace(body.inertia) / body.mass for body in bodies]
    return float(np.sqrt(max(squares, default=0.0)))


def slides(model: Model) -> NDArray[np.bool_]:
    """Return the mask of coordinates that are lengths, (nv,).

    Args:
        model: pinocchio.Model.
    """
    q, sliding = pin.neutral(model), np.zeros(model.nv, dtype=bool)
    for joint in list(model.joints)[1:]:
        data = joint.createData()
        joint.calc(data, q)
        turning = np.asarray(data.S).reshape(6, joint.nv)[3:]
        sliding[joint.idx_v : joint.idx_v + joint.nv] = np.abs(turning).max(axis=0) < MIN_ROW_LENGTH
    return sliding


def coordinate(model: Model, dof: int) -> str:
    """Return the name of a coordinate: the joint name, with an index from 0 if the joint has several.

    Args:
        model: pinocchio.Model.
        dof: index of the coordinate.
    """
    i = next(i for i, j in enumerate(model.joints) if i and j.idx_v <= dof < j.idx_v + j.nv)
    joint = model.joints[i]
    return str(model.names[i]) if joint.nv == 1 else f"{model.names[i]}[{dof - joint.idx_v}]"
