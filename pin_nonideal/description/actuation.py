"""Torques tau that drive a scene, in generalized coordinates (shape nv).

A scene accepts None, a constant array, a function (t, q, v) -> tau that is called at every evaluation, or one
of the descriptions below.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.types import Array
from pin_nonideal.validation import array, function, label, optional_text, positive

__all__ = [
    "EffortLimits",
    "HoldPosition",
    "SampledControl",
    "Table",
]

Gain = float | Sequence[float] | NDArray[np.float64]


@dataclass(frozen=True)
class SampledControl:
    """A controller in discrete time: its torque is held between samples, and steps end at every sample.

    Args:
        function: (t, q, v) -> tau, shape (nv,), called once per period.
        period: sample period [s].
        name: used in messages and results.
    """

    function: Callable[..., object]
    period: float
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("SampledControl: name", self.name)
        who = label(self)
        function(f"{who}: function", self.function, "(t, q, v) -> tau")
        object.__setattr__(self, "period", positive(f"{who}: period", self.period))


@dataclass(frozen=True, eq=False)
class HoldPosition:
    """Proportional-derivative control around a configuration: tau = kp (q0 - q) - kd v.

    The difference q0 - q is computed in the tangent space (pinocchio.difference). A floating base has no
    motor: its gains in an array must be zero. A scalar gain acts on joints with one degree of freedom only.

    Args:
        kp: stiffness [N m/rad or N/m], a number or an array of shape (nv,), not negative.
        kd: damping [N m s/rad or N s/m], a number or an array of shape (nv,), not negative.
        q: configuration to hold, shape (nq,); None for the scene's initial configuration.
        name: used in messages and results.
    """

    kp: Gain
    kd: Gain
    q: Sequence[float] | NDArray[np.float64] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("HoldPosition: name", self.name)
        who = label(self)
        for key in ("kp", "kd"):
            gain = np.asarray(getattr(self, key), dtype=object)
            checked = array(f"{who}: {key}", getattr(self, key), () if gain.ndim == 0 else (None,))
            if (checked < 0.0).any():
                raise InputError(f"{who}: {key} must not be negative; got {float(checked.min()):g}")
            object.__setattr__(self, key, float(checked) if checked.ndim == 0 else checked)
        if self.q is not None:
            object.__setattr__(self, "q", array(f"{who}: q", self.q, (None,)))


@dataclass(frozen=True, eq=False)
class Table:
    """Torques at given times, interpolated linearly, and held before the first and after the last time.

    Args:
        times: increasing times [s], shape (nt,) with nt >= 1.
        values: torques, shape (nt, nv) [N m or N].
        name: used in messages and results.
    """

    times: Sequence[float] | NDArray[np.float64]
    values: Sequence[Sequence[float]] | NDArray[np.float64]
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("Table: name", self.name)
        who = label(self)
        times = array(f"{who}: times", self.times, (None,))
        if times.size == 0:
            raise InputError(f"{who}: times must hold at least one sample; got none")
        late = np.flatnonzero(np.diff(times) <= 0.0)
        if late.size:
            i = int(late[0])
            raise InputError(
                f"{who}: times must increase; times[{i + 1}] = {times[i + 1]:g} does not follow "
                f"times[{i}] = {times[i]:g}"
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", array(f"{who}: values", self.values, (times.size, None)))


@dataclass(frozen=True, eq=False)
class EffortLimits:
    """A drive with effort limits: tau = min(max(u, -effort), effort) for each degree of freedom.

    Requested torques are clipped, including torques that replace the scene's actuation. An event of kind
    "saturate" occurs when the drive of a joint reaches its limit. An event of kind "desaturate" occurs when
    the drive follows the requested torque again.

    Args:
        actuation: source of the requested torques u: any other actuation.
        effort: largest effort of each dof [N m or N], a number or an array of shape (nv,), not negative. None
            selects the model's limits (`lowerEffortLimit`, `upperEffortLimit` of the file). Infinite limits,
            and zero limits of joints without stated limits, are no limits.
        name: used in messages and results.
    """

    actuation: Actuation
    effort: Gain | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("EffortLimits: name", self.name)
        who = label(self)
        if self.actuation is None or isinstance(self.actuation, EffortLimits):
            kind = "None" if self.actuation is None else "EffortLimits"
            raise InputError(f"{who}: actuation must ask for torques without limits of its own; got {kind}")
        if self.effort is not None:
            shape = () if np.ndim(np.asarray(self.effort, dtype=object)) == 0 else (None,)
            most = array(f"{who}: effort", self.effort, shape)
            if (most < 0.0).any():
                raise InputError(f"{who}: effort must not be negative; got {float(most.min()):g}")
            object.__setattr__(self, "effort", float(most) if most.ndim == 0 else most)


Actuation = (
    EffortLimits | SampledControl | HoldPosition | Table | Callable[..., object] | Sequence[float] | Array
)


def asked_by(actuation: Actuation | None) -> Actuation | None:
    """Return the actuation that requests torques, without effort limits."""
    return actuation.actuation if isinstance(actuation, EffortLimits) else actuation
