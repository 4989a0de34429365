"""Lists of drives, whose torques add."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Any

import numpy as np

from pin_nonideal.errors import InputError
from pin_nonideal.validation import (
    by_name,
)


def given_actuation(actuation: object) -> Any:
    """Return an actuation, with a list of drives as a tuple.

    A list or tuple is a list of drives if an entry is a description, a function, a table by joint name or an
    array. Otherwise it holds the numbers of constant torques.

    Args:
        actuation: the argument of a scene.

    Raises:
        InputError: an entry of a list of drives is None or another list of drives.
    """
    if not isinstance(actuation, (list, tuple)) or not any(map(_is_drive, actuation)):
        return actuation
    for k, drive in enumerate(actuation):
        if drive is None or given_actuation(drive) is not drive:
            kind = "None" if drive is None else "another list"
            raise InputError(
                f"actuation: each entry of a list of drives must be a drive; entry {k} is {kind}"
            )
    return tuple(actuation)


def _is_drive(entry: object) -> bool:
    """Check if an entry of a list is a drive and not a number of constant torques."""
    arrays = isinstance(entry, (list, tuple)) or (isinstance(entry, np.ndarray) and entry.ndim > 0)
    return arrays or callable(entry) or is_dataclass(entry) or by_name(entry) is not None


def drives_of(actuation: Any) -> tuple[Any, ...]:
    """Return the drives of an actuation: none, one, or all drives of a list.

    Args:
        actuation: the actuation of a scene, as returned by `given_actuation`.
    """
    if actuation is None:
        return ()
    is_list = isinstance(actuation, tuple) and any(map(_is_drive, actuation))
    return actuation if is_list else (actuation,)
