"""Effort limits of drives, by degree of freedom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pin_nonideal.description.actuation import EffortLimits
from pin_nonideal.description.drive_kinds import requesting_drives
from pin_nonideal.description.drive_lists import drives_of
from pin_nonideal.states.parsing import (
    named_joint_values,
)
from pin_nonideal.types import Array, Mask, Model

from .resolver import words

# Efforts from here on are unlimited: Pinocchio stores the largest float for no limit.
UNLIMITED_EFFORT = 1e300


def effort_limits(u: object, model: Model, acts: Sequence[Mask]) -> tuple[Array, Array] | None:
    """Return the lower and upper effort limits, (nv,), or None without limits.

    Limits of one drive of a list apply to the degrees of freedom that it commands.

    Args:
        u: the actuation of a scene.
        model: pinocchio.Model.
        acts: mask of the degrees of freedom that each requesting drive commands, (nv,).
    """
    outer = drives_of(u)
    if not any(isinstance(drive, EffortLimits) for drive in outer):
        return None
    if len(outer) == 1:
        return _efforts(outer[0], model)
    lower, upper = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    first = 0
    for drive in outer:
        count = len(requesting_drives(drive))
        if isinstance(drive, EffortLimits):
            own = np.logical_or.reduce(acts[first : first + count])
            for all_limits, limits in zip((lower, upper), _efforts(drive, model), strict=True):
                all_limits[own] = limits[own]
        first += count
    return lower, upper


def _efforts(u: EffortLimits, model: Model) -> tuple[Array, Array]:
    """Return the lower and upper effort limit of each degree of freedom; no limit is infinite."""
    if u.effort is not None:
        if isinstance(u.effort, float):
            upper = np.full(model.nv, u.effort)
        else:
            upper = named_joint_values(model, u.effort, f"{words(u)}: effort", others=np.inf)
        return -upper, upper
    lower, upper = model.lowerEffortLimit.copy(), model.upperEffortLimit.copy()
    unstated = lower >= upper
    lower[unstated | (lower <= -UNLIMITED_EFFORT)] = -np.inf
    upper[unstated | (upper >= UNLIMITED_EFFORT)] = np.inf
    return np.ascontiguousarray(lower), np.ascontiguousarray(upper)
