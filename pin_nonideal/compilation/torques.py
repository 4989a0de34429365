"""Torques of drives in the form of the core, and their sums."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from pin_nonideal.errors import InputError
from pin_nonideal.states.joint_layout import joint_places
from pin_nonideal.types import Array, Model
from pin_nonideal.validation import by_name, label


class ConstantTorque(NamedTuple):
    """Constant torques tau, (nv,)."""

    tau: Array


class TimedTorque(NamedTuple):
    """Torques `values`, (nt, nv), at `times` [s], (nt,), linear in between. Steps end at every time.

    With `held` the times come in pairs with equal values, one pair for each value of a zero-order hold.
    """

    times: Array
    values: Array
    held: bool = False


class Spring(NamedTuple):
    """Torques kp (q - q_now) - kd v, with gains (nv,) and a configuration q, (nq,)."""

    kp: Array
    kd: Array
    q: Array


class TorqueFunction(NamedTuple):
    """Torques of a function (t, q, v) -> tau, held between samples of `period` [s] if it is not None.

    Steps end at the times `breaks` [s], (n,), where torques that are not held may jump. The torques of the
    table `beside` add to held torques. Runs call `prepare` before their first step, see `BoundDrive`.
    """

    function: Callable[..., Any]
    period: float | None
    breaks: Array = np.zeros(0)
    beside: TimedTorque | None = None
    prepare: Callable[[], object] | None = None


Part = ConstantTorque | TimedTorque | Spring | TorqueFunction

# Samples of a control and times of a held table that differ by less than this fraction of a period are equal.
SAMPLE_ROUNDING = 1e-9


def kind_of_drive(drive: object) -> str:
    """Return a label of a drive for messages.

    Args:
        drive: a drive, or constant torques.
    """
    if isinstance(drive, (list, tuple, np.ndarray)) or by_name(drive) is not None:
        return "constant torques"
    return label(drive)


def sum_of_torques(parts: Sequence[Part], drives: Sequence[object], model: Model) -> Part:
    """Return the sum of torques that act on separate joints.

    Args:
        parts: torques of each drive.
        drives: the drives, for messages.
        model: pinocchio.Model.

    Raises:
        InputError: sampled torques cannot be added to torques that change between their samples.
    """
    if all(isinstance(part, ConstantTorque) for part in parts):
        return ConstantTorque(np.sum([part.tau for part in parts], axis=0))  # type: ignore[union-attr]
    if all(isinstance(part, (ConstantTorque, TimedTorque)) for part in parts):
        return _sum_of_tables(parts)
    springs = [part for part in parts if isinstance(part, Spring)]
    if len(springs) == len(parts):
        return _sum_of_springs(springs, model)
    periods = sorted(
        {part.period for part in parts if isinstance(part, TorqueFunction) and part.period is not None}
    )
    if periods:
        _require_steady(parts, drives)
    time_shift = SAMPLE_ROUNDING * periods[0] if periods else 0.0
    linear = [part for part in parts if periods and isinstance(part, TimedTorque) and not part.held]
    functions = [
        _function_of(part, model, time_shift) for part in parts if not any(part is table for table in linear)
    ]

    def total(t: float, q: Array, v: Array) -> Array:
        tau = np.zeros(model.nv)
        for function in functions:
            tau += function(t, q, v)
        return tau

    if periods:
        return TorqueFunction(total, periods[0], beside=_sum_of_tables(linear) if linear else None)
    times = [part.times for part in parts if isinstance(part, TimedTorque)]
    times += [part.breaks for part in parts if isinstance(part, TorqueFunction)]
    return TorqueFunction(total, None, np.unique(np.concatenate([np.zeros(0), *times])))


def _require_steady(parts: Sequence[Part], drives: Sequence[object]) -> None:
    """Check that torques in addition to sampled torques come from tables, or are constant between samples.

    Raises:
        InputError: see above.
    """
    periods = [part.period if isinstance(part, TorqueFunction) else None for part in parts]
    sampled = next(k for k, period in enumerate(periods) if period is not None)
    for part, period, drive in zip(parts, periods, drives, strict=True):
        if isinstance(part, (ConstantTorque, TimedTorque)) or period == periods[sampled]:
            continue
        got = kind_of_drive(drive) + ("" if period is None else f" with a period of {period:g} s")
        raise InputError(
            f"actuation: torques that {kind_of_drive(drives[sampled])} holds between samples of "
            f"{periods[sampled]:g} s add only to torques of tables and to torques that change at these "
            f"samples; got {got}; give all drives one period, or compute their sum in one function"
        )


def _sum_of_tables(parts: Sequence[Part]) -> TimedTorque:
    """Return the sum of tables and constant torques: a table with all times."""
    tables = [part for part in parts if isinstance(part, TimedTorque)]
    times = np.unique(np.concatenate([table.times for table in tables]))
    values = np.zeros((times.size, tables[0].values.shape[1]))
    for part in parts:
        if isinstance(part, TimedTorque):
            values += np.array([_table_torque(part, float(t)) for t in times])
        elif isinstance(part, ConstantTorque):
            values += part.tau
    return TimedTorque(times, values)


def _table_torque(table: TimedTorque, t: float) -> Array:
    """Return the torques of a table at a time, as the core computes them, (nv,)."""
    times, values, held = table
    if t <= times[0] or t >= times[-1]:
        return np.asarray(values[0] if t <= times[0] else values[-1])
    k = int(np.searchsorted(times, t, side="right")) - 1
    if held:
        return np.asarray(values[k])
    s = (t - times[k]) / (times[k + 1] - times[k])
    return np.asarray((1.0 - s) * values[k] + s * values[k + 1])


def _sum_of_springs(springs: Sequence[Spring], model: Model) -> Spring:
    """Return one spring with the gains of all and the configuration that each holds."""
    q = springs[0].q.copy()
    for spring in springs[1:]:
        for place in joint_places(model):
            if spring.kp[place.v_first : place.v_first + place.nv].any():
                own = slice(place.q_first, place.q_first + place.nq)
                q[own] = spring.q[own]
    return Spring(np.sum([s.kp for s in springs], axis=0), np.sum([s.kd for s in springs], axis=0), q)


def _function_of(part: Part, model: Model, time_shift: float) -> Callable[..., object]:
    """Return the torques of a part as (t, q, v) -> tau; tables are read `time_shift` [s] after t."""
    if isinstance(part, TorqueFunction):
        return part.function
    if isinstance(part, TimedTorque):
        return lambda t, q, v: _table_torque(part, t + time_shift)
    if isinstance(part, ConstantTorque):
        return lambda t, q, v: part.tau
    return lambda t, q, v: part.kp * pin.difference(model, q, part.q) - part.kd * v
