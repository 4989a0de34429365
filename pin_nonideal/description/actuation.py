"""Torques tau that drive a scene, in generalized coordinates (shape nv).

A scene accepts None, constant torques, a function (t, q, v) -> tau that is called at every evaluation, one of
the descriptions below, or a list of drives, whose torques add. Torques, also the results of functions, are
arrays (nv,) or tables by joint name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, State
from pin_nonideal.validation import (
    array,
    by_name,
    choice,
    count,
    function,
    label,
    nonnegative,
    optional_text,
    positive,
    sequence,
    text,
)

from .drive_lists import drives_of, given_actuation
from .scene_drive import SceneDrive

__all__ = [
    "EffortLimits",
    "HoldPosition",
    "SampledControl",
    "Table",
]

MAX_DELAY = 1_000_000_000  # samples
PERIOD_ROUNDING = 1e-9  # a delay this part of a period above a whole number of periods is rounded down
Gain = float | Sequence[float] | NDArray[np.float64] | Mapping[str, ArrayLike]


@dataclass(frozen=True)
class SampledControl:
    """A controller in discrete time: its torque is held between samples, and steps end at every sample.

    A delay stands for sensors, buses and computing time. With a delay of d samples, the torque
    tau(t) = function(t_(k-d), q(t_(k-d)), v(t_(k-d))) acts for t_k <= t < t_(k+1), t_k = t0 + k period. The
    torque `initial` acts for the first d samples. Each run starts without earlier samples: each call of
    `simulate`, each run of a `rollout`, and each `Stepper.reset`. Single states and steps
    (`Scene.acceleration`, `Scene.solve`, `Scene.step`) have no earlier samples, so `initial` acts there.
    Torques that replace the actuation, in `Stepper.step` and in a callback, act without delay.

    A control with `joints` may stand in a list of drives. The other drives are constant torques, controls and
    `TrackTrajectory` drives of the same period, and tables. A `Table` with interpolation "hold" has times t0
    + k period. A `Table` with linear interpolation may have any times. At most one control of a list may have
    a delay.

    Args:
        function: (t, q, v) -> tau, shape (nv,) or by joint name, called once per period.
        period: sample period [s].
        delay: delay of the torque [s], not negative. The delay is rounded up to a whole number of periods.
        delay_samples: delay as a number of samples instead.
        initial: torque before the first delayed torque [N m or N], (nv,) or by joint name; None for zero.
        name: used in messages and results.
        joints: names of the joints that the control commands; the torques of all others must be zero. None
            for all joints.

    Raises:
        InputError: an argument does not fit, or both delays are given.
    """

    function: Callable[..., object]
    period: float
    delay: float = 0.0
    delay_samples: int = 0
    initial: State | None = None
    name: str | None = None
    joints: Sequence[str] | None = None

    def __post_init__(self) -> None:
        optional_text("SampledControl: name", self.name)
        who = label(self)
        function(f"{who}: function", self.function, "(t, q, v) -> tau")
        object.__setattr__(self, "period", positive(f"{who}: period", self.period))
        object.__setattr__(self, "delay", nonnegative(f"{who}: delay", self.delay))
        samples = count(f"{who}: delay_samples", self.delay_samples, max_value=MAX_DELAY)
        object.__setattr__(self, "delay_samples", samples)
        if self.delay and samples:
            raise InputError(
                f"{who}: the delay must be given once; got delay={self.delay:g} s and "
                f"delay_samples={samples}; leave one of them out"
            )
        if self.delay / self.period > MAX_DELAY:
            raise InputError(
                f"{who}: delay must be at most {MAX_DELAY:g} periods; got {self.delay:g} s with a period of "
                f"{self.period:g} s"
            )
        if self.initial is not None:
            named = by_name(self.initial)
            torques = array(f"{who}: initial", self.initial, (None,)).tolist() if named is None else []
            object.__setattr__(self, "initial", tuple(torques) if named is None else named)
        if self.joints is not None:
            names = [text(f"{who}: joints", name) for name in sequence(f"{who}: joints", self.joints)]
            if not names:
                raise InputError(f"{who}: joints must name at least one joint; got none")
            object.__setattr__(self, "joints", tuple(names))

    @property
    def delay_in_samples(self) -> int:
        """Delay as a number of samples; a delay in seconds is rounded up."""
        return self.delay_samples or math.ceil(self.delay / self.period - PERIOD_ROUNDING)


@dataclass(frozen=True, eq=False)
class HoldPosition:
    """Proportional-derivative control around a configuration: tau = kp (q0 - q) - kd v.

    The difference q0 - q is computed in the tangent space (pinocchio.difference). A floating base has no
    motor: its gains in an array must be zero. A scalar gain acts on joints with one degree of freedom only.

    Args:
        kp: stiffness [N m/rad or N/m], not negative: a number, an array of shape (nv,), or by joint name,
            zero for missing joints.
        kd: damping [N m s/rad or N s/m], not negative, as kp.
        q: configuration to hold, shape (nq,) or by joint name, with missing joints at the scene's initial
            configuration; None for the scene's initial configuration.
        name: used in messages and results.
    """

    kp: Gain
    kd: Gain
    q: State | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("HoldPosition: name", self.name)
        who = label(self)
        for key in ("kp", "kd"):
            object.__setattr__(self, key, checked_gain(f"{who}: {key}", getattr(self, key)))
        if self.q is not None and by_name(self.q) is None:
            object.__setattr__(self, "q", array(f"{who}: q", self.q, (None,)))


@dataclass(frozen=True, eq=False)
class Table:
    """Torques at given times, interpolated linearly or held until the next time.

    With interpolation "hold", values[k] acts from times[k] up to times[k + 1] (zero-order hold). Steps of the
    core's methods end at every time of the table, also in a list of drives. The first
    value acts before the first time and the last value after the last time.

    Args:
        times: increasing times [s], shape (nt,) with nt >= 1.
        values: torques [N m or N], shape (nt, nv), or by joint name, shape (nt,) or (nt, n) for a joint of n
            degrees of freedom: a dict, a pandas DataFrame or a structured array. Missing joints have no
            torque.
        interpolation: "linear" or "hold".
        name: used in messages and results.
    """

    times: Sequence[float] | NDArray[np.float64]
    values: Sequence[Sequence[float]] | NDArray[np.float64] | Mapping[str, ArrayLike]
    interpolation: str = "linear"
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("Table: name", self.name)
        who = label(self)
        choice(f"{who}: interpolation", self.interpolation, ("linear", "hold"))
        times = sample_times(who, self.times)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", checked_samples(f"{who}: values", self.values, times.size))


@dataclass(frozen=True, eq=False)
class EffortLimits:
    """A drive with effort limits: tau = min(max(u, -effort), effort) for each degree of freedom.

    Requested torques are clipped, including torques that replace the scene's actuation. An event of kind
    "saturate" occurs when the drive of a joint reaches its limit. An event of kind "desaturate" occurs when
    the drive follows the requested torque again.

    In a list of drives, the limits apply to the joints of this drive.

    Args:
        actuation: source of the requested torques u: any other actuation, or a list of drives.
        effort: largest effort of each dof [N m or N], not negative: a number, an array of shape (nv,), or by
            joint name, without limit for missing joints. None selects the model's limits
            (`lowerEffortLimit`, `upperEffortLimit` of the file). Infinite limits, and zero limits of joints
            without stated limits, are no limits.
        name: used in messages and results.
    """

    actuation: Actuation
    effort: Gain | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("EffortLimits: name", self.name)
        who = label(self)
        object.__setattr__(self, "actuation", given_actuation(self.actuation))
        inner = drives_of(self.actuation)
        if not inner or any(isinstance(drive, EffortLimits) for drive in inner):
            kind = "EffortLimits" if inner else "None"
            raise InputError(f"{who}: actuation must be drives without effort limits; got {kind}")
        if self.effort is not None:
            object.__setattr__(self, "effort", checked_gain(f"{who}: effort", self.effort))


Drive = (
    EffortLimits
    | SampledControl
    | HoldPosition
    | Table
    | SceneDrive
    | Callable[..., object]
    | Sequence[float]
    | Array
    | Mapping[str, ArrayLike]
)
Actuation = Drive | Sequence[Drive]


def checked_gain(what: str, value: object) -> float | Array | dict[str, Array]:
    """Return a number, an array or a table by joint name of numbers that are not negative.

    Args:
        what: name of the argument in messages.
        value: the argument.

    Raises:
        InputError: the argument has another form, or a number is negative or not finite.
    """
    table = by_name(value)
    if table is not None:
        return {
            name: np.asarray(checked_gain(f'{what} of "{name}"', np.asarray(x))) for name, x in table.items()
        }
    checked = array(what, value, () if np.asarray(value, dtype=object).ndim == 0 else (None,))
    if (checked < 0.0).any():
        raise InputError(f"{what} must not be negative; got {float(checked.min()):g}")
    return float(checked) if checked.ndim == 0 else checked


def sample_times(who: str, values: object) -> Array:
    """Return increasing sample times [s], (nt,) with nt >= 1, read-only.

    Args:
        who: label of the description.
        values: the argument.

    Raises:
        InputError: there is no sample, or a time does not follow the one before it.
    """
    times = array(f"{who}: times", values, (None,))
    if times.size == 0:
        raise InputError(f"{who}: times must hold at least one sample; got none")
    disorder = np.flatnonzero(np.diff(times) <= 0.0)
    if disorder.size:
        i = int(disorder[0])
        raise InputError(
            f"{who}: times must increase; times[{i + 1}] = {times[i + 1]:g} does not follow "
            f"times[{i}] = {times[i]:g}"
        )
    return times


def checked_samples(what: str, values: object, count: int) -> Array | dict[str, Array]:
    """Return samples of all joints, (nt, n), or by joint name, (nt,) or (nt, n) for each joint.

    Args:
        what: name of the argument in messages.
        values: the argument: an array, a dict or a pandas DataFrame.
        count: nt.

    Raises:
        InputError: a shape does not fit, or a number is not finite.
    """
    samples = by_name(values)
    if samples is None:
        return array(what, values, (count, None))
    return {
        name: array(f'{what} of "{name}"', x, (count,) if np.ndim(x) < 2 else (count, None))
        for name, x in samples.items()
    }
