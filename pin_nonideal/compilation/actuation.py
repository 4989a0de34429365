"""Actuation in the core's program: one drive, or a list of drives whose torques add."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.description.actuation import HoldPosition, SampledControl, Table
from pin_nonideal.description.drive_kinds import requesting_drives
from pin_nonideal.description.scene_drive import SceneDrive
from pin_nonideal.description.scene_spec import SceneSpec
from pin_nonideal.errors import InputError
from pin_nonideal.states.joint_layout import joint_places
from pin_nonideal.states.parsing import (
    find_joint,
    named_configuration,
    named_joint_samples,
    named_joint_values,
)
from pin_nonideal.types import Array, Mask, Model
from pin_nonideal.validation import by_name

from .callbacks import checked_function
from .delay import DelayedTorque
from .effort_limits import effort_limits
from .resolver import Resolver, words
from .sampled_control import commanded_by_control, initial_torque, named_torques, sampled_torque
from .torques import (
    ConstantTorque,
    Part,
    Spring,
    TimedTorque,
    TorqueFunction,
    kind_of_drive,
    sum_of_torques,
)


def lower_actuation(
    u: object, out: core.Builder, resolver: Resolver, spec: SceneSpec
) -> list[Callable[[], object]]:
    """Set the actuation of the scene.

    Args:
        u: None, an array (nv,), a table by joint name, a function, a description, or a list of drives.
        out: the program under construction.
        resolver: frames and joints by name.
        spec: descriptions of the scene.

    Returns:
        Functions that runs call before their first step, see `BoundDrive`.

    Raises:
        InputError: shapes do not fit the model, two drives command the same joint, or drives cannot be added.
        UnknownNameError: a joint does not exist.
    """
    model, drives = resolver.model, requesting_drives(u)
    if not drives:
        return []
    lowered = _lowered_drives(drives, resolver, spec)
    if len(drives) > 1:
        _require_separate(model, drives, [acts for _, acts in lowered])
        _require_one_delay(drives)
    _write(_sum([part for part, _ in lowered], drives, model), out)
    limits = effort_limits(u, model, [acts for _, acts in lowered])
    if limits is not None:
        out.limit_effort(min_effort=limits[0], max_effort=limits[1])
    parts = [part for part, _ in lowered]
    return [part.prepare for part in parts if isinstance(part, TorqueFunction) and part.prepare is not None]


def _lowered_drives(drives: Sequence[object], resolver: Resolver, spec: SceneSpec) -> list[tuple[Part, Mask]]:
    listed = len(drives) > 1
    return [
        _lower_drive(drive, resolver, spec, f"actuation[{k}]" if listed else "actuation")
        for k, drive in enumerate(drives)
    ]


def _sum(parts: Sequence[Part], drives: Sequence[object], model: Model) -> Part:
    return parts[0] if len(parts) == 1 else sum_of_torques(parts, drives, model)


def _write(part: Part, out: core.Builder) -> None:
    """Set the torques of the program."""
    if isinstance(part, ConstantTorque):
        out.set_constant_torque(tau=part.tau)
    elif isinstance(part, TimedTorque):
        out.set_torque_table(part.times.tolist(), np.ascontiguousarray(part.values))
    elif isinstance(part, Spring):
        out.set_hold_position(kp=part.kp, kd=part.kd, q=part.q)
    elif part.period is None:
        out.set_torque_function(part.function)
        out.add_breaks(part.breaks.tolist())
    else:
        out.set_sampled_torque(part.function, part.period)
        if part.beside is not None:
            out.add_torque_table(part.beside.times.tolist(), np.ascontiguousarray(part.beside.values))


# --- one drive ----------------------------------------------------------------------------------------------


def _lower_drive(u: object, resolver: Resolver, spec: SceneSpec, who: str) -> tuple[Part, Mask]:
    """Return the torques of one drive, and the mask of the degrees of freedom that it commands, (nv,)."""
    model, everything = resolver.model, np.ones(resolver.model.nv, dtype=bool)
    if isinstance(u, SampledControl):
        acts = commanded_by_control(u, model)
        if u.delay_in_samples:  # runs have their own delayed torques, see `delayed_torque`
            initial = initial_torque(u, model)
            return TorqueFunction(lambda t, q, v: initial, u.period), acts
        return TorqueFunction(sampled_torque(u, model), u.period), acts
    if isinstance(u, SceneDrive):
        function, acts, breaks, prepare = u.bound(model, resolver.q0, spec)
        torques = _IdentifiedFunction(checked_function(function, words(u), (model.nv,)), u)
        return TorqueFunction(torques, u.period, breaks, prepare=prepare), acts
    if isinstance(u, HoldPosition):
        q = resolver.q0 if u.q is None else named_configuration(model, u.q, resolver.q0, f"{words(u)}: q")
        kp, kd = (gains_of(model, getattr(u, key), f"{words(u)}: {key}") for key in ("kp", "kd"))
        _require_vectors(model, kp, f"{words(u)}: kp")
        acts = command_mask(model, u.kp) | command_mask(model, u.kd)
        return Spring(kp, kd, np.ascontiguousarray(q)), acts
    if isinstance(u, Table):
        times = np.asarray(u.times)
        values = named_joint_samples(model, u.values, times.size, f"{words(u)}: values")
        timed = TimedTorque(times, values) if u.interpolation == "linear" else _zero_order_hold(times, values)
        return timed, command_mask(model, u.values)
    if callable(u):
        return TorqueFunction(
            checked_function(named_torques(u, model, who), who, (model.nv,)), None
        ), everything
    return ConstantTorque(named_joint_values(model, u, who)), command_mask(model, u)


def delayed_torque(
    u: SampledControl, resolver: Resolver, spec: SceneSpec, t0: float, by_thread: bool
) -> tuple[DelayedTorque, TorqueFunction]:
    """Return the delayed torques of one run or of the runs of a rollout, and their sum with other drives.

    Args:
        u: the sampled control with a delay.
        resolver: frames and joints by name.
        spec: descriptions of the scene.
        t0: start time of the runs [s].
        by_thread: whether several threads run at once, each with runs of its own.
    """
    model, drives = resolver.model, requesting_drives(spec.actuation)
    function, initial = sampled_torque(u, model), initial_torque(u, model)
    delayed = DelayedTorque(function, u.delay_in_samples, initial, t0, by_thread)
    if len(drives) == 1:
        return delayed, TorqueFunction(delayed, u.period)
    parts = [part for part, _ in _lowered_drives(drives, resolver, spec)]
    parts = [
        TorqueFunction(delayed, u.period) if d is u else part for d, part in zip(drives, parts, strict=True)
    ]
    total = _sum(parts, drives, model)
    assert isinstance(total, TorqueFunction)
    return delayed, total


class _IdentifiedFunction:
    """A function of torques that equals functions of the same drive only, see `parameter_overrides`.

    Args:
        function: (t, q, v) -> tau.
        source: the drive.
    """

    def __init__(self, function: Callable[..., object], source: object) -> None:
        self.function, self.source = function, source

    def __call__(self, t: float, q: Array, v: Array) -> object:
        return self.function(t, q, v)


def _zero_order_hold(times: Array, values: Array) -> TimedTorque:
    """Return a zero-order hold: each value ends one floating-point spacing before the next time.

    A step of the core ends at both times, so that no stage of a step has both values.
    """
    ends = times[1:] - np.spacing(np.maximum(np.abs(times[1:]), np.diff(times)))
    both = np.column_stack([times[:-1], np.maximum(ends, times[:-1])]).ravel()
    values = np.vstack([np.repeat(values[:-1], 2, axis=0), values[-1:]])
    return TimedTorque(np.append(both, times[-1]), values, held=True)


def gains_of(model: Model, gain: object, who: str) -> Array:
    """Return a gain for each degree of freedom; a scalar acts on joints with one degree of freedom.

    Args:
        model: pinocchio.Model.
        gain: a number, an array (nv,), or a table by joint name.
        who: prefix of error messages.

    Raises:
        InputError: wrong shape, or not finite.
        UnknownNameError: there is no such joint.
    """
    if isinstance(gain, float):
        return np.where(command_mask(model, gain), gain, 0.0)
    return named_joint_values(model, gain, who)


def command_mask(model: Model, torques: object) -> Mask:
    """Return the mask of the degrees of freedom that torques, samples or gains command, (nv,).

    A table by joint name commands its joints. A number commands the joints with one degree of freedom, and an
    array commands all joints.

    Args:
        model: pinocchio.Model.
        torques: see above; names exist.
    """
    acts = np.zeros(model.nv, dtype=bool)
    table = by_name(torques)
    if table is None and not isinstance(torques, float):
        return ~acts
    names = None if table is None else {find_joint(model, name, "actuation") for name in table}
    for j, place in enumerate(joint_places(model), start=1):
        if place.nv == 1 if names is None else j in names:
            acts[place.v_first : place.v_first + place.nv] = True
    return acts


def _require_vectors(model: Model, kp: Array, who: str) -> None:
    """Check that a stiffness acts only on joints whose configuration is a vector.

    Raises:
        InputError: see above.
    """
    for place in joint_places(model):
        part = kp[place.v_first : place.v_first + place.nv]
        if place.nq != place.nv and place.nv > 1 and (part != 0.0).any():
            raise InputError(
                f'{who} must be zero on joint "{place.name}", whose configuration is not a vector; '
                "drive it by a function or by a TrackTrajectory"
            )


# --- several drives -----------------------------------------------------------------------------------------


def _require_one_delay(drives: Sequence[object]) -> None:
    """Check that at most one sampled control of a list has a delay.

    Raises:
        InputError: see above.
    """
    late = [words(d) for d in drives if isinstance(d, SampledControl) and d.delay_in_samples]
    if len(late) > 1:
        raise InputError(
            f"actuation: at most one SampledControl of a list may have a delay; {late[0]} and {late[1]} have "
            "one; compute the torques of both in one function"
        )


def _require_separate(model: Model, drives: Sequence[object], acts: Sequence[Mask]) -> None:
    """Check that no joint is commanded by two drives.

    Raises:
        InputError: see above; the message names the joint and both drives.
    """
    for place in joint_places(model):
        own = slice(place.v_first, place.v_first + place.nv)
        first, *others = [*(k for k, mask in enumerate(acts) if mask[own].any()), None]
        if first is None or others == [None]:
            continue
        second = others[0]
        assert second is not None
        raise InputError(
            f'actuation: each joint must be commanded by one drive; "{place.name}" is commanded by drive '
            f"{first} ({kind_of_drive(drives[first])}) and drive {second} "
            f"({kind_of_drive(drives[second])}) of the list; "
            "drives by joint name, and a SampledControl with joints, command the joints that they name; the "
            "others command all joints"
        )
