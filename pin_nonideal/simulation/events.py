"""User hooks of a run: event functions, and a callback between steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.callbacks import checked_function, named_function, numbers_of
from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.types import Array
from pin_nonideal.validation import count

from .options import RunOptions

Watched = tuple[Callable[..., float], int, int]  # function, direction, number of events that ends the run
SEPARATE = "separate"
SAME_TIME = 1e-12  # times closer than this are equal: relative, or absolute [s] below 1 s


class RunRequests(NamedTuple):
    """Event functions of a run.

    Attributes:
        watched: functions with direction and terminal count, in the form of the core.
        names: unique names of the functions.
        separate: whether events are not samples of the trajectory.
    """

    watched: list[Watched]
    names: tuple[str, ...]
    separate: bool


NO_REQUESTS = RunRequests([], (), False)


def parse_events(events: object) -> RunRequests:
    """Parse the `events` argument of `simulate`.

    Args:
        events: None, "separate", a function (t, q, v) -> number, or a list of these.

    Raises:
        InputError: an entry is of another type, or `terminal` or `direction` of a function is invalid.
    """
    if events is None:
        return NO_REQUESTS
    listed = list(events) if isinstance(events, (list, tuple)) else [events]
    functions = [each for each in listed if not (isinstance(each, str) and each == SEPARATE)]
    names: list[str] = []
    watched: list[Watched] = []
    for f in functions:
        if not callable(f):
            raise InputError(
                f'simulate: events must be functions (t, q, v) -> number, or "{SEPARATE}"; '
                f"got {short_repr(f)}"
            )
        name = base = str(getattr(f, "__name__", type(f).__name__))
        number = 1
        while name in names:
            number += 1
            name = f"{base} #{number}"
        names.append(name)
        who = f'event "{name}"'
        watched.append((_valued(f, who), _direction(f, who), _terminal(f, who)))
    return RunRequests(watched, tuple(names), len(functions) < len(listed))


def _valued(f: Callable[..., object], who: str) -> Callable[..., float]:
    call = checked_function(f, who, ())
    return lambda t, q, v: float(call(t, q, v))


def _direction(f: Callable[..., object], who: str) -> int:
    """Return the sign of the attribute `direction`, as in solve_ivp."""
    sign = getattr(f, "direction", 0)
    if isinstance(sign, bool) or not isinstance(sign, (int, float, np.number)) or not np.isfinite(sign):
        raise InputError(
            f"{who}: direction must be a number, of which the sign counts; got {short_repr(sign)}"
        )
    return int(np.sign(sign))


def _terminal(f: Callable[..., object], who: str) -> int:
    """Return the number of events that ends the run, 0 for none, from the attribute `terminal`."""
    value = getattr(f, "terminal", False)
    if value is None or isinstance(value, (bool, np.bool_)):
        return int(bool(value))
    return count(f"{who}: terminal", value)


def parse_callback(callback: object, nv: int) -> Callable[[float, Array, Array], object] | None:
    """Wrap the callback between steps, with its result checked.

    Args:
        callback: None, or a function (t, q, v) -> None, True to stop, or torques (nv,).
        nv: number of velocities.

    Raises:
        InputError: the callback is not callable.
    """
    if callback is None:
        return None
    if not callable(callback):
        raise InputError(f"simulate: callback must be a function (t, q, v); got {short_repr(callback)}")
    ask = named_function(callback, "callback")

    def call(t: float, q: Array, v: Array) -> object:
        answer = ask(t, q, v)
        if answer is None or isinstance(answer, (bool, np.bool_)):
            return True if answer else None
        return numbers_of(answer, (nv,), "callback")

    return call


def grid_of(t: Array, options: RunOptions) -> NDArray[np.bool_]:
    """Return the mask of samples on the output grid, both ends included; of equal times only the last.

    Args:
        t: times [s], (nt,).
        options: options of the run.

    Returns:
        Mask, (nt,).
    """
    if options.output_dt == 0.0 or not len(t):
        return np.ones(len(t), dtype=bool)
    near = SAME_TIME * np.maximum(1.0, np.abs(t))
    on = np.abs(t - exact_grid(t, options)) <= near
    return np.asarray(on & ~np.append(np.diff(t) <= near[1:], False))


def exact_grid(t: Array, options: RunOptions) -> Array:
    """Return the time of the output grid nearest to each sample [s], (nt,).

    Args:
        t: times [s], (nt,).
        options: options of the run.
    """
    nearest = options.t0 + options.output_dt * np.round((t - options.t0) / options.output_dt)
    end = options.t0 + options.duration
    return np.where(np.abs(t - end) < np.abs(t - nearest), end, nearest)
