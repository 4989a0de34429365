"""Checks at the door: every number, name and function a user passes is looked at once, here.

The inner loop trusts what has passed.  Each helper takes `what`, the words that name the argument in its
message.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, nearest

FEW = 100  # numbers that Python adds up faster than NumPy looks at them; their sum is finite as they are

Vector3 = tuple[float, float, float]

AXES: dict[str, Vector3] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def label(description: Any) -> str:
    """Words that name a description in a message: its class and, when it has one, its name.

    Args:
        description: any object, with or without an attribute `name`.
    """
    kind = type(description).__name__
    name = getattr(description, "name", None)
    return f'{kind} "{name}"' if isinstance(name, str) and name else kind


def by_name(value: Any) -> dict[Any, Any] | None:
    """Entries by name of a mapping, a pandas Series or a pandas DataFrame; None of anything else.

    Args:
        value: any object.
    """
    if isinstance(value, Mapping):
        return dict(value)
    is_pandas = type(value).__module__.split(".")[0] == "pandas" and hasattr(value, "items")
    return dict(value.items()) if is_pandas else None


def number(what: str, value: object) -> float:
    """A finite real number as a float.

    Raises:
        InputError: `value` is no real number, or NaN, or infinite.
    """
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (Real, np.ndarray)):
        raise InputError(f"{what} must be a number; got {value!r}")
    if isinstance(value, np.ndarray) and (value.ndim != 0 or value.dtype.kind not in "fiu"):
        raise InputError(f"{what} must be one number; got an array of shape {value.shape}")
    result = float(value)
    if not math.isfinite(result):
        raise InputError(f"{what} must be finite; got {result}")
    return result


def nonnegative(what: str, value: object) -> float:
    """A finite number >= 0.

    Raises:
        InputError: it is negative or no finite number.
    """
    result = number(what, value)
    if result < 0.0:
        raise InputError(f"{what} must not be negative; got {result:g}")
    return result


def positive(what: str, value: object) -> float:
    """A finite number > 0.

    Raises:
        InputError: it is zero, negative or no finite number.
    """
    result = number(what, value)
    if result <= 0.0:
        raise InputError(f"{what} must be positive; got {result:g}")
    return result


def fraction(what: str, value: object) -> float:
    """A number from 0 to 1.

    Raises:
        InputError: it is none.
    """
    result = nonnegative(what, value)
    if result > 1.0:
        raise InputError(f"{what} must be at most 1; got {result:g}")
    return result


def flag(what: str, value: object) -> bool:
    """True or False.

    Raises:
        InputError: it is neither.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{what} must be True or False; got {value!r}")
    return bool(value)


def count(what: str, value: object, *, least: int = 0, most: int = 1_000_000_000) -> int:
    """An integer from `least` to `most`.

    Raises:
        InputError: it is no integer, too small or too large.
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise InputError(f"{what} must be an integer; got {value!r}")
    if value < least:
        raise InputError(f"{what} must be at least {least}; got {value}")
    if value > most:
        raise InputError(f"{what} must be at most {most}; got {value}")
    return int(value)


def text(what: str, value: object) -> str:
    """A name: a string that is not empty.

    Raises:
        InputError: it is no string, or empty.
    """
    if not isinstance(value, str):
        raise InputError(f"{what} must be a name (a string); got {value!r}")
    if not value.strip():
        raise InputError(f"{what} must be a name; got an empty string")
    return value


def optional_text(what: str, value: object) -> str | None:
    """A name or None.

    Raises:
        InputError: it is neither None nor a string that is not empty.
    """
    return None if value is None else text(what, value)


def choice(what: str, value: object, allowed: Sequence[Any]) -> Any:
    """One of `allowed`.

    Raises:
        InputError: it is another value; the message lists the allowed ones.
    """
    for a in allowed:
        if value is a:
            return value
    if not any(isinstance(value, type(a)) and value == a for a in allowed):
        names = [a for a in allowed if isinstance(a, str)]
        hint = nearest(value, names) if isinstance(value, str) else ""
        if not hint.startswith("; nearest"):  # the message lists them already
            hint = ""
        raise InputError(f"{what} must be one of {', '.join(map(repr, allowed))}; got {value!r}{hint}")
    return value


def sequence(what: str, value: object) -> tuple[Any, ...]:
    """A list or tuple, as a tuple.

    Raises:
        InputError: it is something else, such as one description that was not put into a list.
    """
    if not isinstance(value, (list, tuple)):
        raise InputError(f"{what} must be a list; got {value!r}")
    return tuple(value)


def floats(
    value: object, kinds: str = "fiu", copy: bool = True
) -> tuple[NDArray[np.float64] | None, tuple[int, ...] | None]:
    """A copy as floats, and the place of its first entry that is not finite, None where all are.

    There is no copy (None) unless the type of `value` is one of `kinds`, NumPy's letters of real numbers.
    Without `copy` it is a view where `value` is an array of floats.
    """
    try:
        given = np.asarray(value)
        result = np.array(given, dtype=float, copy=copy or None) if given.dtype.kind in kinds else None
    except (TypeError, ValueError):  # rows of unequal length, or objects that are no numbers
        result = None
    if result is None or (result.size <= FEW and math.isfinite(sum(result.ravel().tolist()))):
        return result, None
    if np.count_nonzero(np.isfinite(result)) == result.size:  # faster than all()
        return result, None
    return result, tuple(np.argwhere(~np.isfinite(result))[0].tolist())


def array(what: str, value: object, shape: Sequence[int | None], copy: bool = True) -> NDArray[np.float64]:
    """A finite array of the given shape, copied and read-only.

    Args:
        what: words for messages.
        value: anything NumPy can turn into an array of floats.
        shape: expected shape; None leaves a length free.
        copy: False for many numbers that are read while the call lasts and no longer: not copied.

    Raises:
        InputError: wrong shape, not numbers, or not finite.
    """
    result, where = floats(value, copy=copy)
    if result is not None and not copy:
        result = result.view()
    if result is not None and where is None and result.shape == shape:
        result.setflags(write=False)
        return result
    wanted = str(tuple("n" if s is None else s for s in shape)).replace("'", "")
    if result is None:
        raise InputError(f"{what} must be an array of numbers of shape {wanted}; got {value!r}")
    if result.ndim != len(shape) or any(s not in (None, n) for s, n in zip(shape, result.shape, strict=True)):
        raise InputError(f"{what} must have shape {wanted}; got shape {result.shape}")
    if where is not None:
        place = f"entry {list(where)} is" if where else "got"
        raise InputError(f"{what} must be finite; {place} {result[where]}")
    result.setflags(write=False)
    return result


def function(what: str, value: object, signature: str) -> Callable[..., Any]:
    """Something that can be called.

    Args:
        what: words for messages.
        value: the candidate.
        signature: how it will be called, shown in the message.

    Raises:
        InputError: it cannot be called.
    """
    if not callable(value):
        raise InputError(f"{what} must be a function {signature}; got {value!r}")
    result: Callable[..., Any] = value
    return result


def unit_axis(what: str, value: object) -> Vector3:
    """An axis as a unit vector.

    Args:
        what: words for messages.
        value: "x", "y", "z", or three numbers of any nonzero length.

    Raises:
        InputError: another string, a wrong shape, or a vector of no length.
    """
    if isinstance(value, str):
        if value not in AXES:
            raise InputError(f'{what} must be "x", "y", "z" or three numbers; got {value!r}')
        return AXES[value]
    vector = array(what, value, (3,))
    largest = float(np.abs(vector).max())
    if largest == 0.0:
        raise InputError(f"{what} must have a direction; got three zeros")
    scaled = vector / largest
    x, y, z = (float(c) for c in scaled / math.sqrt(float(scaled @ scaled)))
    return (x, y, z)


def axis_triad(axis: Vector3) -> tuple[Vector3, Vector3, Vector3]:
    """Right-handed unit vectors (t1, t2, axis) that every row across an axis is written in.

    t1 starts from the coordinate axis that follows, cyclically, the largest component of `axis`; so "z" gives
    (x, y, z), "x" gives (y, z, x) and "y" gives (z, x, y).

    Args:
        axis: unit vector.
    """
    n = np.asarray(axis, dtype=float)
    start = np.zeros(3)
    start[(int(np.argmax(np.abs(n))) + 1) % 3] = 1.0
    t1 = start - (start @ n) * n
    t1 /= math.sqrt(float(t1 @ t1))
    t2 = np.cross(n, t1)
    return (_triple(t1), _triple(t2), _triple(n))


def _triple(vector: NDArray[np.float64]) -> Vector3:
    x, y, z = (float(c) + 0.0 for c in vector)
    return (x, y, z)
