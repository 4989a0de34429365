"""Orders of convergence of fixed steps with a shortened last step before each break and the end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Step sizes in decreasing order, without integer ratios.
SIZES = 1.37 ** -np.arange(8.0)


def is_of_order(misses: Sequence[float], order: int, floor: float) -> bool:
    """Check if one constant times dt^order bounds the errors at all SIZES."""
    constants = np.maximum(np.array(misses) - floor, 0.0) / SIZES**order
    return bool(constants[4:].max() <= 2.0 * constants[:4].max())
