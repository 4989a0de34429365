"""Configurations at the door: quaternions and (cos, sin) pairs must have unit length, or nearly so."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from .checks import array
from .errors import InputError

# Lengths off by less than this are rounding of a file or a printout and are restored; more is an error.
UNIT_TOLERANCE = 1e-6

# Joints whose configuration ends in the cosine and sine of an angle, by the beginnings of their names.
CIRCLES = ("JointModelRUB", "JointModelRevoluteUnbounded", "JointModelPlanar")


def unit_parts(model: Any) -> Iterator[tuple[str, slice]]:
    """Stretches of a configuration that must have length 1, with the joint's name.

    Args:
        model: pinocchio.Model.
    """
    for i in range(1, model.njoints):
        for part in _parts(model.joints[i]):
            yield model.names[i], part


def _parts(joint: Any) -> Iterator[slice]:
    kind = joint.shortname()
    if kind == "JointModelComposite":
        for part in joint.extract().joints:
            yield from _parts(part)
    elif joint.nq != joint.nv:  # a quaternion or (cos, sin) ends the joint's stretch
        end = joint.idx_q + joint.nq
        yield slice(end - (2 if kind.startswith(CIRCLES) else 4), end)


def configuration(
    model: Any, q: ArrayLike, what: str, parts: Sequence[tuple[str, slice]] | None = None
) -> NDArray[np.float64]:
    """A configuration with unit quaternions and (cos, sin) pairs, (nq,).

    Args:
        model: pinocchio.Model.
        q: configuration, (nq,).
        what: words for messages.
        parts: those of `unit_parts`, when known.

    Raises:
        InputError: wrong shape, not finite, or a part far from unit length.
    """
    result = np.array(array(what, q, (model.nq,)))
    parts = tuple(unit_parts(model)) if parts is None else parts
    if not parts:
        return result
    for joint, part in parts:
        length = float(np.linalg.norm(result[part]))
        if abs(length - 1.0) > UNIT_TOLERANCE:
            kind = "quaternion" if part.stop - part.start == 4 else "(cos, sin) pair"
            raise InputError(
                f'{what}: the {kind} of joint "{joint}" must have length 1; got {length:g}; normalize it'
            )
    return np.asarray(pin.normalize(model, result))
