"""Actuation of a robot.yaml table: torques and gains by joint name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.description.actuation import HoldPosition
from pin_nonideal.errors import InputError, LoadingError, nearest, short_repr
from pin_nonideal.types import Model
from pin_nonideal.validation import nonnegative, number

from .initial_state import joint_index
from .robot import ACTUATION, build, one_entry


def actuation_of(model: Model, entry: object, motors: Sequence[str], where: str) -> object:
    """Return the actuation of a table: `torques` by joint name, HoldPosition or Table, or a list of drives.

    Drives of a list keep their values by joint name, since they command the joints that they name.

    Args:
        model: pinocchio.Model.
        entry: entry of the table, None for no actuation.
        motors: names of actuated joints; empty for all joints.
        where: prefix of error messages that names the entry.

    Raises:
        LoadingError: the kind of the entry is unknown, or a value is invalid.
    """
    if isinstance(entry, list):
        return [_drive(model, drive, motors, f"{where}[{k}]", True) for k, drive in enumerate(entry)]
    return None if entry is None else _drive(model, entry, motors, where, False)


def _drive(model: Model, entry: object, motors: Sequence[str], where: str, listed: bool) -> object:
    """Return one drive; a drive in a list keeps its values by joint name."""
    kind, values = one_entry(entry, where)
    if kind == "torques":
        if not isinstance(values, dict):
            raise LoadingError(f"{where}: torques must be a table by joint name; got {short_repr(values)}")
        named = _joint_numbers(model, values, f"{where}: torques", signed=True)
        return named if listed else _by_joint(model, named)
    if kind in ("SampledControl", "function"):
        raise LoadingError(
            f"{where}: {kind} holds a Python function, which a file cannot hold; pass it to Scene in Python"
        )
    if kind not in ACTUATION:
        raise LoadingError(f'{where}: unknown kind "{kind}"{nearest(kind, ("torques", *ACTUATION))}')
    if ACTUATION[kind] is HoldPosition and isinstance(values, dict):
        values = {
            k: _gain(model, v, motors, f"{where}: {k}", listed) if k in ("kp", "kd") else v
            for k, v in values.items()
        }
    return build(ACTUATION[kind], values, where)


def _gain(model: Model, gain: object, motors: Sequence[str], where: str, listed: bool) -> object:
    """Return a gain by joint name, or one number for all actuated joints (all joints if none is named)."""
    if motors and not isinstance(gain, (dict, list)):
        gain = dict.fromkeys(motors, gain)
    if not isinstance(gain, dict):
        return gain
    named = _joint_numbers(model, gain, where, signed=False)
    return named if listed else _by_joint(model, named)


def _joint_numbers(
    model: Model, table: Mapping[Any, object], where: str, *, signed: bool
) -> dict[str, float]:
    """Return numbers by joint name.

    Raises:
        LoadingError: there is no such joint, or a value is refused.
    """
    result = {}
    for name, value in table.items():
        joint_index(model, name, where)
        what = f'{where} of "{name}"'
        try:
            result[name] = number(what, value) if signed else nonnegative(what, value)
        except InputError as error:
            raise LoadingError(str(error)) from None
    return result


def _by_joint(model: Model, named: Mapping[str, float]) -> NDArray[np.float64]:
    """An array of shape (nv,) from values by joint name."""
    result = np.zeros(model.nv)
    for name, value in named.items():
        j = joint_index(model, name, "")
        result[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = value
    return result
