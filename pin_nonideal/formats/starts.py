"""Where a robot starts: the file's state, what robot.yaml says of it, what the caller of `load` asks for."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.checks import array, number
from pin_nonideal.errors import InputError, LoadingError, nearest
from pin_nonideal.states.configurations import CIRCLES, unit_parts
from pin_nonideal.types import Model

from .robot_yaml import check_keys
from .urdf import RobotFile

# A quaternion this close to unit length is normalized; one farther away is a mistake.
UNIT_TOLERANCE = 1e-3

Start = Sequence[float] | NDArray[np.float64] | Mapping[str, Any] | str | None


def joint_index(model: Model, name: Any, where: str) -> int:
    """Index of a joint.

    Args:
        model: pinocchio.Model.
        name: of the joint.
        where: words for messages.

    Raises:
        LoadingError: there is none of that name.
    """
    if not isinstance(name, str) or not model.existJointName(name):
        raise LoadingError(f'{where}: no joint "{name}"{nearest(str(name), list(model.names)[1:])}')
    return int(model.getJointId(name))


def vector(value: Any, size: int, where: str) -> list[float]:
    """A list of finite numbers.

    Args:
        value: the candidate.
        size: how many there must be.
        where: words for messages.

    Raises:
        LoadingError: they are others.
    """
    try:
        return [float(x) for x in array(where, value, (size,))]
    except InputError as error:
        raise LoadingError(str(error)) from None


def initial_state(
    robot: RobotFile, initial: Any, where: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Initial q and v: the file's own, changed joint by joint by the table.

    Args:
        robot: what the robot's file holds.
        initial: the entry of robot.yaml, or None.
        where: words for messages.

    Raises:
        LoadingError: a joint does not exist, or a value is refused.
    """
    model = robot.model
    q0 = pin.neutral(model) if robot.q0 is None else np.array(robot.q0, dtype=float)
    v0 = np.zeros(model.nv) if robot.v0 is None else np.array(robot.v0, dtype=float)
    if initial is None:
        return q0, v0
    where = f"{where}: initial"
    if not isinstance(initial, dict):
        raise LoadingError(f"{where} must be a table with the keys q, v, reference; got {initial!r}")
    check_keys(initial, ("q", "v", "reference"), where)
    if "reference" in initial:
        known = [entry.key() for entry in model.referenceConfigurations]
        if initial["reference"] not in known:
            asked = str(initial["reference"])
            raise LoadingError(f'{where}: no reference configuration "{asked}"{nearest(asked, known)}')
        q0 = np.array(model.referenceConfigurations[initial["reference"]])
    for key, state, first, size in (("q", q0, model.idx_qs, model.nqs), ("v", v0, model.idx_vs, model.nvs)):
        given = initial.get(key) or {}
        if isinstance(given, list):
            state[:] = vector(given, state.size, f"{where}: {key}")
            given = {}
        if not isinstance(given, dict):
            raise LoadingError(f"{where}: {key} must be a table by joint name or a full list; got {given!r}")
        for name, value in given.items():
            j = joint_index(model, name, f"{where}: {key}")
            state[first[j] : first[j] + size[j]] = _joint_value(
                model, j, key, value, f'{where}: {key} of "{name}"'
            )
    return _with_unit_quaternions(model, q0, where), v0


def asked_start(
    robot: RobotFile, q0: NDArray[np.float64], v0: NDArray[np.float64], start: Start
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The configuration that the caller of `load` asks for, with the velocity of a keyframe.

    Args:
        robot: what the robot's file holds.
        q0: configuration so far, (nq,).
        v0: velocity so far, (nv,).
        start: what is asked for.

    Raises:
        InputError: it does not fit the model.
    """
    if isinstance(start, str) and start in robot.keyframes:
        keyframe = robot.keyframes[start]
        keyframe.apply()
        return np.array(keyframe.q), np.array(keyframe.v)
    key, value = ("reference", start) if isinstance(start, str) else ("q", start)
    if not isinstance(value, (str, Mapping)):
        value = np.asarray(value).tolist()
    kept = dataclasses.replace(robot, q0=q0, v0=v0)
    try:
        return initial_state(kept, {key: dict(value) if isinstance(value, Mapping) else value}, "load: q0")[
            0
        ], v0
    except LoadingError as error:
        raise InputError(str(error).replace("load: q0: initial", "load: q0")) from None


def _joint_value(model: Model, j: int, key: str, value: Any, where: str) -> list[float]:
    """Values of one joint; an angle may stand for its cosine and sine."""
    size = model.nqs[j] if key == "q" else model.nvs[j]
    values = list(value) if isinstance(value, (list, tuple)) else [value]
    turns = key == "q" and model.joints[j].shortname().startswith(CIRCLES)
    if turns and len(values) == model.nvs[j]:
        try:
            angle = number(where, values[-1])
        except InputError as error:
            raise LoadingError(str(error)) from None
        values = [*values[:-1], float(np.cos(angle)), float(np.sin(angle))]
    return vector(values, size, where)


def _with_unit_quaternions(model: Model, q: NDArray[np.float64], where: str) -> NDArray[np.float64]:
    """Quaternions (and cosine-sine pairs) of unit length.

    Raises:
        LoadingError: one is far from unit length.
    """
    for joint, part in unit_parts(model):
        length = math.hypot(*q[part])
        if abs(length - 1.0) > UNIT_TOLERANCE:
            what = "quaternion [x, y, z, w]" if part.stop - part.start == 4 else "cosine and sine"
            raise LoadingError(f'{where}: {what} of joint "{joint}" must have length 1; got {length:g}')
        q[part] /= length
    return q
