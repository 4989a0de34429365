"""Wrappers of user functions for the core: checked results, and errors that name the function."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.description.time_functions import Constant, Polynomial, Sinusoid, Spline
from pin_nonideal.errors import InputError, RunError, UnknownNameError, UserFunctionError, nearest, short_repr
from pin_nonideal.types import Array
from pin_nonideal.validation import array, floats

from .contact_groups import RowGroups

# Times at which a user's function of time is compared with its central differences [s]. Round times are
# avoided, since functions often have corners there. Several times are used, since one may fall on a corner.
PROBES = (0.01371, 0.21317, 0.71753)
PROBE_STEP = 1e-6
FLOATS = np.dtype(float)
DERIVATIVE_RTOL = 0.1  # separately interpolated tables of value and derivatives stay below it
DERIVATIVE_ATOL = 1e-7  # above the rounding error of a difference quotient over two steps


def checked_function(
    function: Callable[..., object], who: str, *shapes: tuple[int, ...]
) -> Callable[..., Any]:
    """Wrap a user function: contiguous finite results of the given shapes, and errors that name it.

    Args:
        function: the user's function.
        who: prefix of error messages.
        shapes: shape of the result, or of each part of a tuple of results.
    """
    ask = named_function(function, who)

    def call(*arguments: object) -> object:
        value = ask(*arguments)
        if type(value) is np.ndarray and value.dtype == FLOATS and (value.shape,) == shapes:
            row = value.reshape(-1)
            if value.flags.c_contiguous and math.isfinite(row.dot(row)):
                return value
        parts = (value,) if len(shapes) == 1 else value
        if not isinstance(parts, (tuple, list)) or len(parts) != len(shapes):
            raise _function_error(
                f"{who} must return {len(shapes)} values; got {type(value).__name__}", arguments
            )
        try:
            results = [numbers_of(part, shape, who) for part, shape in zip(parts, shapes, strict=True)]
        except UserFunctionError as error:
            raise _function_error(str(error), arguments) from None
        return results[0] if len(shapes) == 1 else tuple(results)

    return call


def named_function(function: Callable[..., object], who: str) -> Callable[..., Any]:
    """Wrap a user function so that errors name it.

    Args:
        function: the user's function.
        who: prefix of error messages.
    """

    def call(*arguments: object) -> object:
        try:
            return function(*arguments)
        except RunError:
            raise
        except Exception as error:
            raise _function_error(f"{who} raised {type(error).__name__}: {error}", arguments) from error

    return call


def _function_error(message: str, arguments: Sequence[object]) -> UserFunctionError:
    """Return the error of a user function; it includes the time if the first argument is a float."""
    time = float(arguments[0]) if arguments and isinstance(arguments[0], float) else None
    return UserFunctionError(message if time is None else f"{message} (at t = {time:.6g} s)")


def numbers_of(part: object, shape: tuple[int, ...], who: str) -> Array:
    """Convert a result of a user function to a contiguous array of finite numbers.

    Args:
        part: the result.
        shape: required shape.
        who: prefix of error messages.

    Raises:
        UserFunctionError: the result is not a finite array of this size.
    """
    result, where = floats(part, "fiubOUS")  # any kind that float() accepts
    if result is None:
        raise UserFunctionError(f"{who} must return numbers of shape {shape}; got {short_repr(part)}")
    if result.shape != shape and result.size != math.prod(shape):
        raise UserFunctionError(f"{who} must return shape {shape}; got shape {result.shape}")
    if where is not None:
        raise UserFunctionError(f"{who} must return finite numbers; got {result.reshape(shape)}")
    return np.asarray(result.reshape(shape), order="C")


def checked_limits(function: Callable[..., object], who: str) -> Callable[..., tuple[float, float]]:
    """Wrap a user's friction limit so that it returns two numbers: against forward and backward slip.

    Args:
        function: the user's function; it returns one number for both directions, or two.
        who: prefix of error messages.
    """
    ask = named_function(function, who)

    def call(*arguments: object) -> tuple[float, float]:
        value = ask(*arguments)
        if type(value) is float and 0.0 <= value < math.inf:
            return value, value
        two = isinstance(value, (tuple, list)) or (np.ndim(value) == 1 and np.size(value) == 2)
        try:
            numbers = numbers_of(value, (2,) if two else (), who).reshape(-1).tolist()
        except UserFunctionError as error:
            raise _function_error(str(error), arguments) from None
        if min(numbers) < 0.0:
            raise UserFunctionError(f"{who} must not be negative; got {min(numbers):g}")
        return numbers[0], numbers[-1]

    return call


def time_function(function: Any, who: str) -> Any:
    """Return a function of time as numbers for the core, or as a checked callable if it is the user's.

    Args:
        function: one of `description.time_functions`, or the user's t -> (value, rate, acceleration).
        who: prefix of error messages.

    Raises:
        InputError: a derivative is wrong.
    """
    if isinstance(function, Constant):
        return ("polynomial", [function.value])
    if isinstance(function, Polynomial):
        return ("polynomial", list(function.coefficients))
    if isinstance(function, Sinusoid):
        return ("sinusoid", [function.amplitude, function.omega, function.phase, function.offset])
    if isinstance(function, Spline):
        return ("spline", function.breaks.tolist(), function.coefficients.ravel().tolist())
    jet = checked_function(function, f"{who}: function of time", (), (), ())
    _check_derivatives(jet, who)
    return lambda t: tuple(float(x) for x in jet(t))


def breaks(function: object, who: str) -> list[float]:
    """Return the times [s] at which pieces of a user's function of time meet, from its attribute `breaks`.

    Args:
        function: the user's function.
        who: prefix of error messages.

    Raises:
        InputError: the attribute is not an ascending sequence of times.
    """
    attribute = getattr(function, "breaks", None)
    if attribute is None or isinstance(function, Spline):
        return []
    times = array(f"{who}: breaks", attribute, (None,))
    if (np.diff(times) <= 0.0).any():
        raise InputError(f"{who}: breaks must increase; got {times}")
    return [float(t) for t in times]


def _check_derivatives(jet: Callable[..., Any], who: str) -> None:
    """Compare the rate and the acceleration of a user's function of time with central differences.

    Args:
        jet: checked function t -> (value, rate, acceleration).
        who: prefix of error messages.

    Raises:
        InputError: the rate or the acceleration is wrong at every probe.
    """
    ends = []
    for t in PROBES:
        with contextlib.suppress(UserFunctionError):  # the function may be undefined at this time
            ends.append((t, jet(t - PROBE_STEP), jet(t), jet(t + PROBE_STEP)))
    for k, (quantity, derivative) in enumerate((("value", "rate"), ("rate", "acceleration"))):
        rows = [
            (t, (after[k] - before[k]) / (2.0 * PROBE_STEP), at[k + 1], abs(at[k]))
            for t, before, at, after in ends
        ]
        wrong = [
            (t, difference, stated)
            for t, difference, stated, size in rows
            if abs(difference - stated)
            > DERIVATIVE_RTOL * max(abs(difference), abs(stated)) + DERIVATIVE_ATOL * (1.0 + size)
        ]
        if wrong and len(wrong) == len(rows):
            t, difference, stated = wrong[0]
            raise InputError(
                f"{who}: function of time: {derivative} must be the derivative of {quantity}; at t = {t:g} s "
                f"it returns {stated:.6g}, and differences give {difference:.6g}; correct it, or use "
                "sinusoid, polynomial or spline"
            )


@dataclass
class ReactionNames:
    """Names by which a user law may access reactions.

    Attributes:
        multipliers: rows of the user.
        blocks: index of each constraint and contact in the core's list of blocks.
        joints: index of each joint.
    """

    multipliers: RowGroups
    blocks: dict[str, int]
    joints: dict[str, int]


class Reactions:
    """Constraint reactions at the instant of a call of a user law; valid during the call only.

    Attributes:
        lam: multipliers of all rows, in the order and scale of the descriptions, (m,).
    """

    def __init__(self, view: core.ReactionView, names: ReactionNames) -> None:
        self._view, self._names = view, names

    @property
    def lam(self) -> Array:
        """Multipliers of all rows, (m,); a pair of shapes has one, the sum over its points."""
        return self._names.multipliers.groups.sum(self._view.lam)

    def __getitem__(self, name: str) -> Array:
        """Multipliers of one constraint or contact.

        Args:
            name: its name.

        Raises:
            UnknownNameError: no constraint has that name.
        """
        slices = self._names.multipliers.slices
        if name not in slices:
            raise UnknownNameError(f'no constraint "{name}" in this scene{nearest(name, slices)}')
        return self.lam[slices[name]]

    def wrench(self, name: str) -> Array:
        """[force; moment] that a joint or an anchor exerts, (6,) [N; N m].

        A joint acts on the body that it moves: the joint frame gives the axes and the moment point. An anchor
        acts on the body of frame1: frame2 gives the axes.

        Args:
            name: a joint of the model, or a constraint.

        Raises:
            UnknownNameError: there is no such joint or constraint.
        """
        known = self._names
        if name in known.blocks:
            return self._view.of_block(known.blocks[name])
        if name in known.joints:
            return self._view.of_joint(known.joints[name])
        names = [*known.blocks, *known.joints]
        raise UnknownNameError(f'no joint or constraint "{name}" in this scene{nearest(name, names)}')
