"""Actuation of a robot.yaml table: torques and gains by joint name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.description.actuation import HoldPosition
from pin_nonideal.errors import InputError, LoadingError, nearest
from pin_nonideal.types import Model
from pin_nonideal.validation import nonnegative, number

from .initial_state import joint_index
from .robot import ACTUATION, build, one_entry


def actuation_of(model: Model, entry: Any, motors: Sequence[str], where: str) -> Any:
    """Return the actuation of a table: `torques` by joint name, HoldPosition or Table.

    Args:
        model: pinocchio.Model.
        entry: entry of the table, None for no actuation.
        motors: names of actuated joints; empty for all joints.
        where: prefix of error messages that names the entry.

    Raises:
        LoadingError: the kind of the entry is unknown, or a value is invalid.
    """
    if entry is None:
        return None
    kind, values = one_entry(entry, where)
    if kind == "torques":
        if not isinstance(values, dict):
            raise LoadingError(f"{where}: torques must be a table by joint name; got {values!r}")
        return _by_joint(model, values, f"{where}: torques", signed=True)
    if kind in ("SampledControl", "function"):
        raise LoadingError(
            f"{where}: {kind} holds a Python function, which a file cannot; pass it to Scene in Python"
        )
    if kind not in ACTUATION:
        raise LoadingError(f'{where}: unknown kind "{kind}"{nearest(kind, ("torques", *ACTUATION))}')
    if ACTUATION[kind] is HoldPosition and isinstance(values, dict):
        values = {
            k: _gain(model, v, motors, f"{where}: {k}") if k in ("kp", "kd") else v for k, v in values.items()
        }
    return build(ACTUATION[kind], values, where)


def _gain(model: Model, gain: Any, motors: Sequence[str], where: str) -> Any:
    """Return a gain by joint name, or one number for all actuated joints (all joints if none is named)."""
    if isinstance(gain, dict):
        return _by_joint(model, gain, where, signed=False)
    if motors and not isinstance(gain, list):
        return _by_joint(model, dict.fromkeys(motors, gain), where, signed=False)
    return gain


def _by_joint(model: Model, table: Mapping[Any, Any], where: str, *, signed: bool) -> NDArray[np.float64]:
    """Return an array (nv,) from values by joint name."""
    result = np.zeros(model.nv)
    for name, value in table.items():
        j = joint_index(model, name, where)
        what = f'{where} of "{name}"'
        try:
            result[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = (
                number(what, value) if signed else nonnegative(what, value)
            )
        except InputError as error:
            raise LoadingError(str(error)) from None
    return result
