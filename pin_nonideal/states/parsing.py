"""Parsing of states: a configuration or velocity as numbers (nq,) or (nv,), or as a table by joint name.

One parser serves Scene, simulate, project, solve, load, the command line and robot.yaml.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.types import Array, Model, State
from pin_nonideal.validation import array, by_name, number

from .joint_layout import COS_SIN_JOINTS, configuration, unit_parts
from .joint_order import describe_order
from .scales import slides

# A hand-written quaternion within this distance of unit length is normalized; others are errors.
WRITTEN_UNIT_TOLERANCE = 1e-3


class Piece(NamedTuple):
    """A named part of the values of one joint.

    Attributes:
        first: index of the first value in the joint's values.
        size: number of given values.
        kind: "" for plain numbers, "rpy" for angles of a quaternion, "angle" for the angle of (cos, sin).
    """

    first: int
    size: int
    kind: str = ""


TURN = {"quaternion": Piece(0, 4), "rpy": Piece(0, 3, "rpy")}
# Pieces of a joint's configuration and velocity, by the prefix of the joint kind.
PIECES: dict[str, tuple[dict[str, Piece], dict[str, Piece]]] = {
    "JointModelFreeFlyer": (
        {"xyz": Piece(0, 3)} | {name: piece._replace(first=3) for name, piece in TURN.items()},
        {"linear": Piece(0, 3), "angular": Piece(3, 3)},
    ),
    "JointModelSphericalZYX": ({}, {}),
    "JointModelSpherical": (TURN, {"angular": Piece(0, 3)}),
    "JointModelPlanar": (
        {"xy": Piece(0, 2), "angle": Piece(2, 1, "angle")},
        {"linear": Piece(0, 2), "angular": Piece(2, 1)},
    ),
    "JointModelTranslation": ({"xyz": Piece(0, 3)}, {"linear": Piece(0, 3)}),
}


def named_configuration(
    model: Model,
    state: State,
    base: Array,
    what: str,
    parts: Sequence[tuple[str, slice]] | None = None,
) -> Array:
    """Return a configuration from numbers, a table by joint name, or a name, (nq,).

    A table maps a joint name to a number, to the joint's values, or to a table of pieces. A floating base has
    the pieces "xyz" and either "rpy" or "quaternion" [x, y, z, w]. The name of a floating base is that of the
    joint or the body, or "base". A ball joint has "rpy" or "quaternion", a planar joint "xy" and "angle", and
    a translation joint "xyz". An angle [rad] replaces (cos, sin). Missing entries stay as in `base`. A string
    is the name of a reference configuration of the model.

    Args:
        model: pinocchio.Model.
        state: see above.
        base: configuration that a table changes, (nq,).
        what: name of the argument in messages.
        parts: result of `unit_parts`, if known.

    Raises:
        InputError: wrong shape, not finite, or a part far from unit length.
        UnknownNameError: there is no such joint, piece or reference configuration.
    """
    if isinstance(state, str):
        known = [entry.key() for entry in model.referenceConfigurations]
        if state not in known:
            raise UnknownNameError(f'{what}: no reference configuration "{state}"{nearest(state, known)}')
        return np.array(model.referenceConfigurations[state])
    table = by_name(state)
    if table is None:
        describe_order(model, state, what, "nqs")
        return configuration(model, cast("ArrayLike", state), what, parts)
    q = np.array(base)
    for name, value in table.items():
        j = find_joint(model, name, what)
        first, size = model.idx_qs[j], model.nqs[j]
        q[first : first + size] = _values(model, j, 0, value, q[first : first + size], f'{what} of "{name}"')
    return with_unit_lengths(model, q, what)


def named_velocity(model: Model, state: State, base: Array, what: str) -> Array:
    """Return a velocity from numbers or from a table by joint name, (nv,).

    A table maps a joint name to a number, to the joint's values, or to a table of pieces. A planar joint and
    a floating base (in body axes, as in Pinocchio) have the pieces "linear" and "angular". A ball joint has
    "angular", and a translation joint "linear". Missing entries stay as in `base`.

    Args:
        model: pinocchio.Model.
        state: see above.
        base: velocity that a table changes, (nv,).
        what: name of the argument in messages.

    Raises:
        InputError: wrong shape, or not finite.
        UnknownNameError: there is no such joint or piece.
    """
    table = by_name(state)
    if table is None:
        describe_order(model, state, what, "nvs")
        return np.array(array(what, state, (model.nv,)))
    v = np.array(base)
    for name, value in table.items():
        j = find_joint(model, name, what)
        first, size = model.idx_vs[j], model.nvs[j]
        v[first : first + size] = _values(model, j, 1, value, v[first : first + size], f'{what} of "{name}"')
    return v


def named_joint_values(model: Model, joint_values: object, what: str, others: float = 0.0) -> Array:
    """Values of the degrees of freedom from numbers or by joint name, (nv,): torques, gains, limits.

    A table (a mapping or a pandas Series) holds, by joint name, one number for all degrees of freedom of the
    joint, or a number for each. A joint that slides and turns needs a number for each, because their units
    differ; 0 and infinity have no unit.

    Args:
        model: pinocchio.Model.
        joint_values: array (nv,), or a table by joint name.
        what: name of the argument in messages.
        others: value of the joints that a table leaves out.

    Raises:
        InputError: wrong shape, or not finite.
        UnknownNameError: there is no such joint.
    """
    table = by_name(joint_values)
    if table is None:
        return np.array(array(what, joint_values, (model.nv,)))
    values = np.full(model.nv, others)
    for name, value in table.items():
        j = find_joint(model, name, what)
        size, words = model.nvs[j], f'{what} of "{name}"'
        if isinstance(value, Mapping):
            part = _values(model, j, 1, value, np.full(size, others), words)
        else:
            part = array(words, value, () if np.ndim(value) == 0 else (size,))
            if size > 1 and part.ndim == 0 and part != 0.0 and np.isfinite(part):
                _require_one_unit(model, j, words, float(part))
        values[model.idx_vs[j] : model.idx_vs[j] + size] = part
    return values


def _require_one_unit(model: Model, joint: int, what: str, value: float) -> None:
    """Check that one number may stand for all degrees of freedom of a joint.

    Raises:
        InputError: some degrees of freedom slide and others turn.
    """
    size = model.nvs[joint]
    sliding = slides(model)[model.idx_vs[joint] : model.idx_vs[joint] + size]
    if sliding.any() and not sliding.all():
        raise InputError(
            f"{what} must have {size} numbers, since some of its degrees of freedom slide and others turn; "
            f"got {value:g}"
        )


def named_joint_samples(model: Model, joint_samples: object, count: int, what: str) -> Array:
    """Return samples by degree of freedom from an array or by joint name, zero for missing joints, (nt, nv).

    Args:
        model: pinocchio.Model.
        joint_samples: array (nt, nv), or by joint name samples (nt,) or (nt, n) of a joint of n degrees of
            freedom.
        count: nt.
        what: name of the argument in messages.

    Raises:
        InputError: wrong shape, or not finite.
        UnknownNameError: there is no such joint.
    """
    table = by_name(joint_samples)
    if table is None:
        values = array(what, joint_samples, (count, None))
        if values.shape[1] != model.nv:
            raise InputError(
                f"{what} must have {model.nv} columns (nv); got {values.shape[1]}; "
                "give columns by joint name, {joint: samples}, to leave joints out"
            )
        return values
    values = np.zeros((count, model.nv))
    for name, samples in table.items():
        j = find_joint(model, name, what)
        size, words = model.nvs[j], f'{what} of "{name}"'
        part = array(words, samples, (count,) if np.ndim(samples) == 1 and size == 1 else (count, size))
        values[:, model.idx_vs[j] : model.idx_vs[j] + size] = part.reshape(count, size)
    return values


def named_configuration_samples(
    model: Model, configurations: object, base: Array, count: int, what: str
) -> Array:
    """Return samples of a configuration from an array or by joint name, (nt, nq).

    Args:
        model: pinocchio.Model.
        configurations: array (nt, nq), or by joint name samples (nt,) or (nt, n) of the n values of a joint,
            of which an angle [rad] replaces (cos, sin).
        base: configuration of the joints that a table leaves out, (nq,).
        count: nt.
        what: name of the argument in messages.

    Raises:
        InputError: wrong shape, not finite, or a part far from unit length.
        UnknownNameError: there is no such joint.
    """
    table = by_name(configurations)
    if table is None:
        samples = np.array(array(what, configurations, (count, model.nq)))
    else:
        samples = np.tile(base, (count, 1))
        for name, values in table.items():
            j = find_joint(model, name, what)
            first, size, words = model.idx_qs[j], model.nqs[j], f'{what} of "{name}"'
            part = array(words, values, (count,) if np.ndim(values) == 1 else (count, None))
            for k in range(count):
                now = samples[k, first : first + size]
                samples[k, first : first + size] = _values(model, j, 0, part[k], now, words)
    for k in range(count):
        with_unit_lengths(model, samples[k], f"{what}[{k}]")
    return samples


def named_entries(model: Model, state: State | None) -> NDArray[np.bool_] | None:
    """Return the mask of entries that a table of a velocity names, (nv,), or None without a table.

    Args:
        model: pinocchio.Model.
        state: a velocity as in `named_velocity`.
    """
    if state is None or by_name(state) is None:
        return None
    return ~np.isnan(named_velocity(model, state, np.full(model.nv, np.nan), "v"))


def named_coordinates(model: Model, state: State | None) -> NDArray[np.bool_] | None:
    """Return the mask of tangent coordinates that a table of a configuration names, (nv,), or None.

    Args:
        model: pinocchio.Model.
        state: a configuration as in `named_configuration`.
    """
    table = by_name(state)
    if table is None:
        return None
    named = np.zeros(model.nv, dtype=bool)
    for name, value in table.items():
        j = find_joint(model, name, "q")
        is_named = named[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]]
        if not isinstance(value, Mapping):
            is_named[:] = True
            continue
        places = len(is_named) - 3 if model.joints[j].shortname().startswith("JointModelFreeFlyer") else 0
        for key in value:
            if key in ("xyz", "xy"):
                is_named[: len(key)] = True
            elif key == "angle":
                is_named[2] = True
            else:  # an orientation
                is_named[places:] = True
    return named


def find_joint(model: Model, name: object, what: str) -> int:
    """Return the index of a joint; a floating base also has the names "base" and that of its body.

    Args:
        model: pinocchio.Model.
        name: name of the joint.
        what: name of the argument in messages.

    Raises:
        UnknownNameError: no joint has that name.
    """
    known = [str(n) for n in model.names][1:]
    if isinstance(name, str) and name in known:
        return int(model.getJointId(name))
    floating = [j for j in range(1, model.njoints) if model.joints[j].shortname() == "JointModelFreeFlyer"]
    for j in floating:
        if name == "base" and len(floating) == 1:
            return j
        if isinstance(name, str) and model.existFrame(name, pin.FrameType.BODY):
            frame = model.frames[model.getFrameId(name, pin.FrameType.BODY)]
            if frame.parentJoint == j and frame.placement.isIdentity():
                return j
    if isinstance(name, str) and model.existFrame(name, pin.FrameType.FIXED_JOINT):
        raise UnknownNameError(f'{what}: joint "{name}" is fixed (locked) and cannot move; leave it out')
    raise UnknownNameError(f'{what}: no joint "{name}"{nearest(str(name), known)}')


def _values(model: Model, j: int, level: int, value: object, now: Array, what: str) -> Array:
    """Return the values of one joint, of its configuration (level 0) or its velocity (level 1).

    Args:
        model: pinocchio.Model.
        j: index of the joint.
        level: see above.
        value: the given number, values, table or SE3.
        now: current values, kept for coordinates that a table omits.
        what: name of the argument in messages.
    """
    kind = model.joints[j].shortname()
    if isinstance(value, Mapping):
        return _values_of_pieces(kind, level, value, now, what)
    if isinstance(value, pin.SE3) and level == 0 and kind == "JointModelFreeFlyer":
        return np.array(pin.SE3ToXYZQUAT(value))
    plain = np.asarray(value, dtype=object).reshape(-1).tolist()
    if level == 0 and kind.startswith(COS_SIN_JOINTS) and len(plain) == model.nvs[j]:
        angle = number(what, plain[-1])
        plain = [*plain[:-1], float(np.cos(angle)), float(np.sin(angle))]
    return array(what, plain, (now.size,))


def _values_of_pieces(kind: str, level: int, table: Mapping[object, Any], now: Array, what: str) -> Array:
    """Return the values of a joint from a table of its pieces."""
    pieces = next((both[level] for start, both in PIECES.items() if kind.startswith(start)), {})
    values = np.array(now)
    for key, value in table.items():
        if key not in pieces:
            raise UnknownNameError(
                f'{what}: no "{key}" in a {kind.removeprefix("JointModel")} joint{nearest(str(key), pieces)}'
            )
        first, size, way = pieces[key]
        numbers = array(f"{what}: {key}", [value] if size == 1 and np.ndim(value) == 0 else value, (size,))
        if way == "rpy":
            numbers = pin.Quaternion(pin.rpy.rpyToMatrix(*numbers)).coeffs()
        elif way == "angle":
            numbers = np.array([np.cos(numbers[0]), np.sin(numbers[0])])
        values[first : first + len(numbers)] = numbers
    if {"rpy", "quaternion"} <= set(table):
        raise InputError(f'{what}: give "rpy" or "quaternion", not both')
    return values


def with_unit_lengths(model: Model, q: Array, what: str) -> Array:
    """Normalize hand-written quaternions and (cos, sin) pairs of a configuration in place, and return it.

    Args:
        model: pinocchio.Model.
        q: configuration, (nq,), modified in place.
        what: name of the argument in messages.

    Raises:
        InputError: a quaternion or pair is far from unit length.
    """
    for joint, part in unit_parts(model):
        length = float(np.linalg.norm(q[part]))
        if abs(length - 1.0) > WRITTEN_UNIT_TOLERANCE:
            kind = "quaternion [x, y, z, w]" if part.stop - part.start == 4 else "cosine and sine"
            raise InputError(f'{what}: {kind} of joint "{joint}" must have length 1; got {length:g}')
        q[part] /= length
    return q
