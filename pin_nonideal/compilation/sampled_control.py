"""Torques of sampled controls: the joints that they command, and the times of their samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pin_nonideal.description.actuation import SampledControl
from pin_nonideal.description.drive_kinds import held_tables, sampled_drives
from pin_nonideal.errors import InputError, UserFunctionError
from pin_nonideal.states.joint_layout import joint_places
from pin_nonideal.states.parsing import (
    find_joint,
    named_joint_values,
)
from pin_nonideal.types import Array, Mask, Model
from pin_nonideal.validation import by_name

from .callbacks import checked_function
from .resolver import words
from .torques import (
    SAMPLE_ROUNDING,
)


def require_samples(u: object, t0: float) -> None:
    """Check that held tables beside a sampled control change at samples of the control.

    Args:
        u: the actuation of a scene.
        t0: start time of a run [s], the first sample.

    Raises:
        InputError: see above.
    """
    sampled, tables = sampled_drives(u), held_tables(u)
    for table in tables if sampled else ():
        period = sampled[0].period
        times = np.asarray(table.times)[1:]
        times = times[times > t0]
        off = np.abs((times - t0) / period - np.round((times - t0) / period))
        late = np.flatnonzero(off > SAMPLE_ROUNDING + np.spacing(np.abs(times) + abs(t0)) / period)
        if late.size:
            raise InputError(
                f"{words(table)}: times must be samples t0 + k period of {words(sampled[0])} in the list "
                f"(t0 = {t0:g} s, period = {period:g} s); got {times[late[0]]:.12g} s; move the time to a "
                "sample, or read the table in the function of the control"
            )


def sampled_torque(u: SampledControl, model: Model) -> Callable[..., object]:
    """Return the checked function of a sampled control, (t, q, v) -> torques (nv,).

    Args:
        u: a sampled control.
        model: pinocchio.Model.
    """
    who = f"{words(u)}: function"
    function = checked_function(named_torques(u.function, model, who), who, (model.nv,))
    if u.joints is None:
        return function
    others = ~commanded_by_control(u, model)

    def torques(*arguments: object) -> Array:
        tau: Array = function(*arguments)
        if tau[others].any():
            raise UserFunctionError(f"{who} must return {_other_torque(tau, others, model)}")
        return tau

    return torques


def _other_torque(tau: Array, others: Mask, model: Model) -> str:
    """Return a text about the first torque of a joint that a control does not command."""
    dof = int(np.flatnonzero(others & (tau != 0.0))[0])
    name = next(p.name for p in joint_places(model) if p.v_first <= dof < p.v_first + p.nv)
    return f'no torque for joints that are not in joints; got {tau[dof]:g} for "{name}"; add it to joints'


def commanded_by_control(u: SampledControl, model: Model) -> Mask:
    """Return the mask of the degrees of freedom that a sampled control commands, (nv,).

    Args:
        u: a sampled control.
        model: pinocchio.Model.

    Raises:
        UnknownNameError: a joint does not exist.
    """
    acts = np.full(model.nv, u.joints is None)
    for name in u.joints or ():
        j = find_joint(model, name, f"{words(u)}: joints")
        acts[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = True
    return acts


def initial_torque(u: SampledControl, model: Model) -> Array:
    """Return the torque before the first delayed one arrives, (nv,).

    Args:
        u: a sampled control.
        model: pinocchio.Model.

    Raises:
        InputError: the torque does not fit, or acts on a joint that the control does not command.
    """
    if u.initial is None:
        return np.zeros(model.nv)
    tau = np.ascontiguousarray(named_joint_values(model, u.initial, f"{words(u)}: initial"))
    others = ~commanded_by_control(u, model)
    if tau[others].any():
        raise InputError(f"{words(u)}: initial must hold {_other_torque(tau, others, model)}")
    return tau


def named_torques(function: Callable[..., object], model: Model, who: str) -> Callable[..., object]:
    """Return a function of torques (nv,) for one that may return them by joint name.

    Args:
        function: (t, q, v) -> torques.
        model: pinocchio.Model.
        who: prefix of error messages.
    """

    def torques(*arguments: object) -> object:
        tau = function(*arguments)
        if type(tau) is np.ndarray or by_name(tau) is None:
            return tau
        return named_joint_values(model, tau, who)

    return torques
