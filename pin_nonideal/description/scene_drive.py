"""Base of drives whose torques depend on the scene that they drive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.types import Array, Model

from .scene_spec import SceneSpec


class BoundDrive(NamedTuple):
    """A drive of one scene.

    Attributes:
        function: function (t, q, v) -> tau, (nv,).
        acts: mask of the degrees of freedom that it drives, (nv,).
        breaks: times at which the torque or its rate jumps [s], ascending, (n,). Steps end there.
        prepare: function that runs call before their first step, or None. It raises an InputError if the
            drive does not fit the constraints.
    """

    function: Callable[[float, Array, Array], Array]
    acts: NDArray[np.bool_]
    breaks: Array
    prepare: Callable[[], object] | None = None


class SceneDrive(ABC):
    """A drive that computes its torques from the scene that it drives.

    Attributes:
        period: sample period [s] if the torque is held between samples, or None.
        name: used in messages and results.
    """

    period: float | None
    name: str | None

    @abstractmethod
    def bound(self, model: Model, q0: Array, spec: SceneSpec) -> BoundDrive:
        """Return the torques of the drive in a scene.

        Args:
            model: pinocchio.Model of the scene.
            q0: initial configuration of the scene, (nq,).
            spec: descriptions of the scene.

        Raises:
            InputError, UnknownNameError: the drive does not fit the model.
        """
