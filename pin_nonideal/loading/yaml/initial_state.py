"""Initial state of a robot: the file's state, entries of robot.yaml, and arguments of `load`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import InputError, LoadingError, UnknownNameError, nearest, short_repr
from pin_nonideal.loading.urdf.reader import RobotFile
from pin_nonideal.states.held_entries import Held
from pin_nonideal.states.joint_order import describe_order, order_words
from pin_nonideal.states.parsing import (
    find_joint,
    named_configuration,
    named_coordinates,
    named_entries,
    named_velocity,
    with_unit_lengths,
)
from pin_nonideal.types import Model
from pin_nonideal.validation import array

from .robot import check_keys

Start = Sequence[float] | NDArray[np.float64] | Mapping[str, object] | str | None


def joint_index(model: Model, name: object, where: str) -> int:
    """Return the index of a joint.

    Args:
        model: pinocchio.Model.
        name: name of the joint.
        where: prefix of error messages.

    Raises:
        LoadingError: no joint has that name.
    """
    if not isinstance(name, str) or not model.existJointName(name):
        raise LoadingError(f'{where}: no joint "{name}"{nearest(str(name), list(model.names)[1:])}')
    return int(model.getJointId(name))


def vector(value: object, size: int, where: str) -> list[float]:
    """Return a list of finite numbers.

    Args:
        value: candidate.
        size: required number of entries.
        where: prefix of error messages.

    Raises:
        LoadingError: the value is not such a list.
    """
    try:
        return [float(x) for x in array(where, value, (size,))]
    except InputError as error:
        raise LoadingError(str(error)) from None


def initial_state(
    robot: RobotFile, initial: object, where: str, notes: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return initial q and v: the file's state with the changes of the table.

    Args:
        robot: content of the robot's file.
        initial: entry of robot.yaml, or None.
        where: prefix of error messages.
        notes: receives a note if a list is not in the joint order of the URDF.

    Raises:
        LoadingError: a joint does not exist, or a value is invalid.
    """
    model = robot.model
    q0 = pin.neutral(model) if robot.q0 is None else np.array(robot.q0, dtype=float)
    v0 = np.zeros(model.nv) if robot.v0 is None else np.array(robot.v0, dtype=float)
    if initial is None:
        return q0, v0
    where = f"{where}: initial"
    if not isinstance(initial, dict):
        raise LoadingError(
            f"{where} must be a table with the keys q, v, reference; got {short_repr(initial)}"
        )
    check_keys(initial, ("q", "v", "reference"), where)
    for key in ("q", "v"):
        if not isinstance(initial.get(key) or {}, (list, dict)):
            raise LoadingError(
                f"{where}: {key} must be a table by joint name or a full list; got {short_repr(initial[key])}"
            )
        words = order_words(model) if isinstance(initial.get(key), list) else None
        if words is not None:
            notes.append(f"{where}: {key}: {words}")
    try:
        if "reference" in initial:
            q0 = named_configuration(model, str(initial["reference"]), q0, where)
        q0 = _file_state(model, initial.get("q"), q0, f"{where}: q", named_configuration)
        return q0, _file_state(model, initial.get("v"), v0, f"{where}: v", named_velocity)
    except (InputError, UnknownNameError) as error:
        raise LoadingError(str(error)) from None


def _file_state(model: Model, entry: object, base: NDArray[np.float64], where: str, parse: Any) -> Any:
    """Return a state of a file: a table by name, a list, or the base state."""
    if isinstance(entry, list) and parse is named_configuration:
        return with_unit_lengths(model, np.array(array(where, entry, (model.nq,))), where)
    return parse(model, np.asarray(entry) if isinstance(entry, list) else entry or {}, base, where)


def requested_state(
    robot: RobotFile, q0: NDArray[np.float64], v0: NDArray[np.float64], start: Start, speed: Start
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the state with the arguments of `load`, and with the velocity of a keyframe.

    Args:
        robot: content of the robot's file.
        q0: configuration so far, (nq,).
        v0: velocity so far, (nv,).
        start: requested configuration, or None.
        speed: requested velocity, or None.

    Raises:
        InputError, UnknownNameError: the state does not fit the model.
    """
    if isinstance(start, str) and start in robot.keyframes:
        keyframe = robot.keyframes[start]
        keyframe.apply()
        q0, v0 = np.array(keyframe.q), np.array(keyframe.v)
    elif start is not None:
        q0 = _requested_configuration(robot.model, start, q0)
    if speed is not None:
        v0 = named_velocity(robot.model, speed, v0, "load: v0")
    return q0, v0


def held_entries(robot: RobotFile, table: Mapping[str, Any], start: Start, speed: Start) -> Held:
    """Return the entries that the arguments of `load` name, else the entries that robot.yaml names.

    Args:
        robot: content of the robot's file, with the joints of the scene.
        table: content of robot.yaml.
        start: requested configuration, or None.
        speed: requested velocity, or None.
    """
    model, initial = robot.model, table.get("initial") or {}
    of_keyframe = isinstance(start, str) and start in robot.keyframes

    def named(override: Start, key: str) -> Any:
        entries = initial.get(key) if override is None else override
        if override is None and isinstance(entries, dict):  # fixed joints have no entries
            entries = {name: value for name, value in entries.items() if _moves(model, name)}
        return entries

    speeds = None if of_keyframe and speed is None else named(speed, "v")
    return Held(named_coordinates(model, named(start, "q")), named_entries(model, speeds))


def _moves(model: Model, name: object) -> bool:
    try:
        find_joint(model, name, "initial")
    except UnknownNameError:
        return False
    return True


def _requested_configuration(model: Model, start: object, q0: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a configuration from a name, a table, or numbers in the order of the model."""
    if isinstance(start, (str, Mapping)):
        return named_configuration(model, start, q0, "load: q0")
    describe_order(model, start, "load: q0", "nqs")
    return with_unit_lengths(model, np.array(array("load: q0", start, (model.nq,))), "load: q0")
