"""Layout of joint values, and checks of configurations: unit lengths and size of coordinates."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.types import JointModel, Model
from pin_nonideal.validation import array

# Deviations of a unit length below this value are rounding error of a file and are normalized; others are
# errors.
UNIT_TOLERANCE = 1e-6

# Largest spacing of floating-point numbers at a coordinate of an initial state [m or rad]. A joint cannot
# move if its steps are shorter than the spacing.
COARSEST_SPACING = 1e-3

# Prefixes of joint kinds whose configuration ends in the cosine and sine of an angle.
COS_SIN_JOINTS = ("JointModelRUB", "JointModelRevoluteUnbounded", "JointModelPlanar")


class JointPlace(NamedTuple):
    """Indices of a joint's values in q and v.

    Attributes:
        name: name of the joint.
        kind: Pinocchio's name of the joint kind.
        q_first: index of the first value in a configuration.
        nq: number of values in a configuration.
        v_first: index of the first value in a velocity.
        nv: number of values in a velocity.
    """

    name: str
    kind: str
    q_first: int
    nq: int
    v_first: int
    nv: int


def joint_places(model: Model) -> list[JointPlace]:
    """Return the indices of all joints' values, in the order of the model.

    Args:
        model: pinocchio.Model.
    """
    sizes = zip(model.names, model.joints, model.idx_qs, model.nqs, model.idx_vs, model.nvs, strict=True)
    return [
        JointPlace(str(name), str(joint.shortname()), int(q), int(nq), int(v), int(nv))
        for name, joint, q, nq, v, nv in list(sizes)[1:]
    ]


def unit_parts(model: Model) -> Iterator[tuple[str, slice]]:
    """Yield (joint name, slice) of each part of a configuration that must have length 1.

    Args:
        model: pinocchio.Model.
    """
    for i in range(1, model.njoints):
        for part in _parts(model.joints[i]):
            yield model.names[i], part


def _parts(joint: JointModel) -> Iterator[slice]:
    kind = joint.shortname()
    if kind == "JointModelComposite":
        for part in joint.extract().joints:
            yield from _parts(part)
    elif joint.nq != joint.nv:  # the joint's values end with a quaternion or (cos, sin)
        end = joint.idx_q + joint.nq
        yield slice(end - (2 if kind.startswith(COS_SIN_JOINTS) else 4), end)


def configuration(
    model: Model, q: ArrayLike, what: str, parts: Sequence[tuple[str, slice]] | None = None
) -> NDArray[np.float64]:
    """Return a configuration with normalized quaternions and (cos, sin) pairs, (nq,).

    Args:
        model: pinocchio.Model.
        q: configuration, (nq,).
        what: name of the argument in messages.
        parts: result of `unit_parts`, if known.

    Raises:
        InputError: wrong shape, not finite, or a part far from unit length.
    """
    result = np.array(array(what, q, (model.nq,)))
    parts = tuple(unit_parts(model)) if parts is None else parts
    if not parts:
        return result
    for joint, part in parts:
        length = math.hypot(*result[part])
        if abs(length - 1.0) > UNIT_TOLERANCE:
            kind = "quaternion" if part.stop - part.start == 4 else "(cos, sin) pair"
            raise InputError(
                f'{what}: the {kind} of joint "{joint}" must have length 1; got {length:g}; normalize it'
            )
    return np.asarray(pin.normalize(model, result))


def require_resolved(model: Model, q: NDArray[np.float64]) -> None:
    """Check that floating-point spacing at each coordinate is at most `COARSEST_SPACING`.

    Args:
        model: pinocchio.Model.
        q: one or several configurations, (..., nq).

    Raises:
        InputError: a coordinate is too large; the message names its joint.
    """
    if q.ndim == 1:
        farthest = max(map(abs, q.tolist()), default=0.0)
    else:
        farthest = max(float(q.max(initial=0.0)), -float(q.min(initial=0.0)))
    spacing = math.ulp(farthest)
    if spacing <= COARSEST_SPACING:
        return
    k = int(np.argmax(np.abs(q))) % model.nq
    joint = next(i for i, j in enumerate(model.joints) if i and j.idx_q <= k < j.idx_q + j.nq)
    raise InputError(
        f'q: joint "{model.names[joint]}" must start where floating-point numbers are at most '
        f"{COARSEST_SPACING:g} (m or rad) apart; at {farthest:g} they are {spacing:.2g} apart; "
        "leave out whole turns, or move the origin"
    )
