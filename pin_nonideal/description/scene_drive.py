"""Base of drives whose torques depend on the scene that they drive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.types import Array, Model

from .scene_spec import SceneSpec


class SceneDrive(ABC):
    """A drive that computes its torques from the scene that it drives.

    Attributes:
        period: sample period [s] if the torque is held between samples, or None.
        name: used in messages and results.
    """

    period: float | None
    name: str | None

    @abstractmethod
    def bound(
        self, model: Model, q0: Array, spec: SceneSpec
    ) -> tuple[Callable[[float, Array, Array], Array], NDArray[np.bool_]]:
        """Return the function (t, q, v) -> tau, and the mask of the degrees of freedom that it drives, (nv,).

        Args:
            model: pinocchio.Model of the scene.
            q0: initial configuration of the scene, (nq,).
            spec: descriptions of the scene.

        Raises:
            InputError, UnknownNameError: the drive does not fit the model.
        """
