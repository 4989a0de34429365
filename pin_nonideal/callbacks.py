"""Python functions of the user as the core calls them: results checked, errors that name the function."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import RunError, UnknownNameError, UserFunctionError, nearest
from .timefunctions import Constant, Polynomial, Sinusoid, Spline

Array = NDArray[np.float64]


def checked(function: Callable[..., Any], who: str, *shapes: tuple[int, ...]) -> Callable[..., Any]:
    """The user's function with its result made contiguous, and errors that name it.

    Args:
        function: what the user passed.
        who: words for messages.
        shapes: shape of its result, or of each part of a tuple of results.
    """

    def call(*arguments: Any) -> Any:
        try:
            value = function(*arguments)
        except RunError:
            raise
        except Exception as error:
            raise UserFunctionError(f"{who} raised {type(error).__name__}: {error}") from error
        parts = (value,) if len(shapes) == 1 else value
        if not isinstance(parts, (tuple, list)) or len(parts) != len(shapes):
            raise UserFunctionError(f"{who} must return {len(shapes)} values; got {type(value).__name__}")
        results = [_numbers(part, shape, who) for part, shape in zip(parts, shapes, strict=True)]
        return results[0] if len(shapes) == 1 else tuple(results)

    return call


def _numbers(part: Any, shape: tuple[int, ...], who: str) -> Array:
    try:
        result = np.array(part, dtype=float, order="C")
    except (TypeError, ValueError):
        raise UserFunctionError(f"{who} must return numbers of shape {shape}; got {part!r}") from None
    if result.shape != shape and result.size == math.prod(shape):
        result = result.reshape(shape)
    if result.shape != shape:
        raise UserFunctionError(f"{who} must return shape {shape}; got shape {result.shape}")
    if not np.isfinite(result).all():
        raise UserFunctionError(f"{who} must return finite numbers; got {result}")
    return result


def time_function(function: Any, who: str) -> Any:
    """A function of time as numbers for the core, or checked when it is the user's.

    Args:
        function: of `pin_nonideal.timefunctions`, or the user's t -> (value, rate, acceleration).
        who: words for messages.
    """
    if isinstance(function, Constant):
        return ("polynomial", [function.value])
    if isinstance(function, Polynomial):
        return ("polynomial", list(function.coefficients))
    if isinstance(function, Sinusoid):
        return ("sinusoid", [function.amplitude, function.frequency, function.phase, function.offset])
    if isinstance(function, Spline):
        return ("spline", function.breaks.tolist(), function.coefficients.ravel().tolist())
    jet = checked(function, f"{who}: function of time", (), (), ())
    return lambda t: tuple(float(x) for x in jet(t))


@dataclass
class ReactionNames:
    """Names that a law may ask reactions for.

    Attributes:
        slices: rows of each constraint and contact.
        blocks: the core's block of each.
        joints: index of each joint.
    """

    slices: dict[str, slice]
    blocks: dict[str, int]
    joints: dict[str, int]


class Reactions:
    """What the constraints exert at the instant of a law's call; valid during the call only.

    Attributes:
        lam: multipliers of all rows, in the order and scale of the descriptions, (m,).
    """

    def __init__(self, view: Any, names: ReactionNames) -> None:
        self._view, self._names = view, names

    @property
    def lam(self) -> Array:
        """Multipliers of all rows, (m,)."""
        result: Array = self._view.lam
        return result

    def __getitem__(self, name: str) -> Array:
        """Multipliers of one constraint or contact.

        Args:
            name: its name.

        Raises:
            UnknownNameError: no constraint has that name.
        """
        slices = self._names.slices
        if name not in slices:
            raise UnknownNameError(f'no constraint "{name}" in this scene{nearest(name, slices)}')
        return self.lam[slices[name]]

    def wrench(self, name: str) -> Array:
        """[force; moment] that a joint or an anchor exerts, (6,) [N; N m].

        A joint's is what it exerts on the body that it moves, in the joint frame's axes, about its origin; an
        anchor's is what it exerts on the body of frame1, in the axes of frame2.

        Args:
            name: of a joint of the model, or of a constraint.

        Raises:
            UnknownNameError: there is no such joint or constraint.
        """
        known = self._names
        if name in known.blocks:
            return np.asarray(self._view.of_block(known.blocks[name]))
        if name in known.joints:
            return np.asarray(self._view.of_joint(known.joints[name]))
        names = [*known.blocks, *known.joints]
        raise UnknownNameError(f'no joint or constraint "{name}" in this scene{nearest(name, names)}')
