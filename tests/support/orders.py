"""Orders of fixed steps whose last one before each break, or the end, is any part of a whole one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Sizes of steps, from the largest down, without a whole ratio between them.
SIZES = 1.37 ** -np.arange(8.0)


def is_of_order(misses: Sequence[float], order: int, floor: float) -> bool:
    """Whether one constant times dt^order bounds the errors at all SIZES: finer steps need no larger one."""
    constants = np.maximum(np.array(misses) - floor, 0.0) / SIZES**order
    return bool(constants[4:].max() <= 2.0 * constants[:4].max())
