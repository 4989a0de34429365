"""Type aliases of signatures: arrays of floats, and Pinocchio's objects, which have no static types."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]
Table: TypeAlias = dict[str, Any]  # names to values of files and options
State: TypeAlias = ArrayLike | Mapping[str, Any]  # a configuration or velocity, as numbers or by name

Model: TypeAlias = Any  # pinocchio.Model
JointModel: TypeAlias = Any  # pinocchio.JointModel
GeometryModel: TypeAlias = Any  # pinocchio.GeometryModel
GeometryObject: TypeAlias = Any  # pinocchio.GeometryObject
Placement: TypeAlias = Any  # pinocchio.SE3
Inertia: TypeAlias = Any  # pinocchio.Inertia
CollisionGeometry: TypeAlias = Any  # coal.CollisionGeometry
# pinocchio.RigidConstraintModel, PointAnchorConstraintModel or FrameAnchorConstraintModel
PinocchioConstraint: TypeAlias = Any
