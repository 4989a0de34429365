"""Validation of user input: numbers, names, arrays and functions are checked once, when they are passed.

Inner loops do not repeat the checks. The parameter `what` of each helper is the name of the argument in
messages.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, nearest, short_repr

MAX_PYTHON_SUM = 100  # up to this size a Python sum is faster than NumPy; a finite sum implies finite numbers
MAX_CACHED_AXES = 1024  # number of axes whose triads are kept: contacts of a scene share few of them

Vector3 = tuple[float, float, float]

AXES: dict[str, Vector3] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def label(description: object) -> str:
    """Return the label of a description in messages: its class and, if it has one, its name.

    Args:
        description: any object, with or without an attribute `name`.
    """
    kind = type(description).__name__
    name = getattr(description, "name", None)
    return f'{kind} "{name}"' if isinstance(name, str) and name else kind


def by_name(value: Any) -> dict[Any, Any] | None:
    """Entries by name of a mapping, a pandas Series or DataFrame, or a structured array; None otherwise.

    Args:
        value: any object.
    """
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray):
        names = value.dtype.names
        return None if names is None else {name: value[name] for name in names}
    is_pandas = type(value).__module__.split(".")[0] == "pandas" and hasattr(value, "items")
    return dict(value.items()) if is_pandas else None


def number(what: str, value: object) -> float:
    """Return a finite real number as a float.

    Raises:
        InputError: `value` is not a real number, or NaN, or infinite.
    """
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (Real, np.ndarray)):
        raise InputError(f"{what} must be a number; got {short_repr(value)}")
    if isinstance(value, np.ndarray) and (value.ndim != 0 or value.dtype.kind not in "fiu"):
        raise InputError(f"{what} must be one number; got an array of shape {value.shape}")
    result = float(value)
    if not math.isfinite(result):
        raise InputError(f"{what} must be finite; got {result}")
    return result


def nonnegative(what: str, value: object) -> float:
    """Return a finite number >= 0.

    Raises:
        InputError: `value` is negative or no finite number.
    """
    result = number(what, value)
    if result < 0.0:
        raise InputError(f"{what} must not be negative; got {result:g}")
    return result


def positive(what: str, value: object) -> float:
    """Return a finite number > 0.

    Raises:
        InputError: `value` is zero, negative or no finite number.
    """
    result = number(what, value)
    if result <= 0.0:
        raise InputError(f"{what} must be positive; got {result:g}")
    return result


# Bounds of relative tolerances: no step satisfies a tolerance below rounding, and an error of more than a
# tenth of a coordinate is not an approximation.
MIN_RTOL, MAX_RTOL = 1e-14, 0.1


def relative_tolerance(what: str, value: object) -> float:
    """Return a relative tolerance within its bounds, or 0.

    Raises:
        InputError: `value` is not a number, or outside the bounds.
    """
    relative = nonnegative(what, value)
    if relative and not MIN_RTOL <= relative <= MAX_RTOL:
        raise InputError(
            f"{what} must be from {MIN_RTOL:g} (rounding) to {MAX_RTOL:g}, or zero for atol alone; "
            f"got {relative:g}"
        )
    return relative


def fraction(what: str, value: object) -> float:
    """Return a number from 0 to 1.

    Raises:
        InputError: `value` is not a number from 0 to 1.
    """
    result = nonnegative(what, value)
    if result > 1.0:
        raise InputError(f"{what} must be at most 1; got {result:g}")
    return result


def flag(what: str, value: object) -> bool:
    """Return True or False.

    Raises:
        InputError: `value` is not a bool.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{what} must be True or False; got {short_repr(value)}")
    return bool(value)


def count(what: str, value: object, *, min_value: int = 0, max_value: int = 1_000_000_000) -> int:
    """Return an integer from `min_value` to `max_value`.

    Raises:
        InputError: `value` is not an integer, too small or too large.
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise InputError(f"{what} must be an integer; got {short_repr(value)}")
    if value < min_value:
        raise InputError(f"{what} must be at least {min_value}; got {value}")
    if value > max_value:
        raise InputError(f"{what} must be at most {max_value}; got {value}")
    return int(value)


def text(what: str, value: object) -> str:
    """Return a name, which is a nonempty string.

    Raises:
        InputError: `value` is not a string, or empty.
    """
    if not isinstance(value, str):
        raise InputError(f"{what} must be a name (a string); got {short_repr(value)}")
    if not value.strip():
        raise InputError(f"{what} must be a name; got an empty string")
    return value


def optional_text(what: str, value: object) -> str | None:
    """Return a name or None.

    Raises:
        InputError: `value` is neither None nor a nonempty string.
    """
    return None if value is None else text(what, value)


def choice(what: str, value: object, allowed: Sequence[Any]) -> Any:
    """Return `value` if it is one of `allowed`.

    Raises:
        InputError: `value` is not allowed; the message lists the allowed values.
    """
    for a in allowed:
        if value is a:
            return value
    if not any(isinstance(value, type(a)) and value == a for a in allowed):
        names = [a for a in allowed if isinstance(a, str)]
        hint = nearest(value, names) if isinstance(value, str) else ""
        if not hint.startswith("; nearest"):  # the message lists the known names already
            hint = ""
        raise InputError(
            f"{what} must be one of {', '.join(map(repr, allowed))}; got {short_repr(value)}{hint}"
        )
    return value


def sequence(what: str, value: object) -> tuple[Any, ...]:
    """Return a list or tuple as a tuple.

    Raises:
        InputError: `value` is not a list or tuple, for example a single description.
    """
    if not isinstance(value, (list, tuple)):
        raise InputError(f"{what} must be a list; got {short_repr(value)}")
    return tuple(value)


def floats(
    value: object, kinds: str = "fiu", copy: bool = True
) -> tuple[NDArray[np.float64] | None, tuple[int, ...] | None]:
    """Return a copy as floats, and the index of its first entry that is not finite, or None.

    The copy is None unless the dtype kind of `value` is in `kinds`, by default the real numbers. Without
    `copy`, an array of floats is not copied. Masked entries of a masked array are NaN.
    """
    try:
        if isinstance(value, np.ma.MaskedArray):
            value = np.ma.filled(value.astype(float), np.nan)
        source = np.asarray(value)
        result = np.array(source, dtype=float, copy=copy or None) if source.dtype.kind in kinds else None
    except (TypeError, ValueError):  # rows of unequal length, or objects that are not numbers
        result = None
    if result is None or (result.size <= MAX_PYTHON_SUM and math.isfinite(sum(result.ravel().tolist()))):
        return result, None
    if np.count_nonzero(np.isfinite(result)) == result.size:  # faster than all()
        return result, None
    return result, tuple(np.argwhere(~np.isfinite(result))[0].tolist())


def array(what: str, value: object, shape: Sequence[int | None], copy: bool = True) -> NDArray[np.float64]:
    """Return a finite array of the given shape, copied and read-only.

    Args:
        what: name of the argument in messages.
        value: any value that NumPy converts to an array of floats.
        shape: expected shape; None accepts any length.
        copy: whether to copy the array; False for large arrays that are read during the call only.

    Raises:
        InputError: wrong shape, not numbers, or not finite.
    """
    result, where = floats(value, copy=copy)
    if result is not None and not copy:
        result = result.view()
    if result is not None and where is None and result.shape == shape:
        result.setflags(write=False)
        return result
    expected = str(tuple("n" if s is None else s for s in shape)).replace("'", "")
    if result is None:
        form = f"an array of numbers of shape {expected}" if shape else "a number or an array of numbers"
        raise InputError(f"{what} must be {form}; got {short_repr(value)}")
    if result.ndim != len(shape) or any(s not in (None, n) for s, n in zip(shape, result.shape, strict=True)):
        raise InputError(f"{what} must have shape {expected}; got shape {result.shape}")
    if where is not None:
        place = f"entry {list(where)} is" if where else "got"
        raise InputError(f"{what} must be finite; {place} {result[where]}")
    result.setflags(write=False)
    return result


def function(what: str, value: object, signature: str) -> Callable[..., Any]:
    """Return `value` if it is callable.

    Args:
        what: name of the argument in messages.
        value: the argument.
        signature: expected signature, shown in the message.

    Raises:
        InputError: `value` is not callable.
    """
    if not callable(value):
        raise InputError(f"{what} must be a function {signature}; got {short_repr(value)}")
    result: Callable[..., Any] = value
    return result


def unit_axis(what: str, value: object) -> Vector3:
    """Return an axis as a unit vector.

    Args:
        what: name of the argument in messages.
        value: "x", "y", "z", or three numbers of any nonzero length.

    Raises:
        InputError: another string, a wrong shape, or a zero vector.
    """
    if isinstance(value, str):
        if value not in AXES:
            raise InputError(f'{what} must be "x", "y", "z" or three numbers; got {short_repr(value)}')
        return AXES[value]
    x, y, z = array(what, value, (3,)).tolist()
    if not (x or y or z):
        raise InputError(f"{what} must have a direction; got three zeros")
    return unit_vector((x, y, z))


@lru_cache(maxsize=MAX_CACHED_AXES)
def unit_vector(vector: Vector3) -> Vector3:
    """Return a vector of three numbers, not all zero, divided by its length."""
    scaled = np.array(vector)
    scaled /= np.abs(scaled).max()
    return _triple(scaled / math.sqrt(float(scaled @ scaled)))


@lru_cache(maxsize=MAX_CACHED_AXES)
def axis_triad(axis: Vector3) -> tuple[Vector3, Vector3, Vector3]:
    """Return right-handed unit vectors (t1, t2, axis), the basis of all rows across an axis.

    t1 is the projection of the coordinate axis that follows, cyclically, the largest component of `axis`.
    Thus "z" gives (x, y, z), "x" gives (y, z, x) and "y" gives (z, x, y).

    Args:
        axis: unit vector.
    """
    n = np.asarray(axis, dtype=float)
    start = np.zeros(3)
    start[(int(np.argmax(np.abs(n))) + 1) % 3] = 1.0
    t1 = start - (start @ n) * n
    t1 /= math.sqrt(float(t1 @ t1))
    (x, y, z), (a, b, c) = _triple(n), _triple(t1)
    t2 = np.array([y * c - z * b, z * a - x * c, x * b - y * a])  # n x t1
    return (_triple(t1), _triple(t2), _triple(n))


def _triple(vector: NDArray[np.float64]) -> Vector3:
    x, y, z = (float(c) + 0.0 for c in vector)
    return (x, y, z)
