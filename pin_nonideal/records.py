"""What of a run belongs to one law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .types import Array


@dataclass(frozen=True, eq=False)
class LawRecord:
    """What one law did over a run.

    Attributes:
        name: of the law.
        force: its part of C in M a = F + C + A^T lam, what sticks included [N or N m], (nt, nv), or None.
        power: of that force [W], (nt,), or None.
        limit: of its frictional element: static where it sticks, else kinetic [N or N m], (nt,), or
            (nt, n) of a law of n elements; None without any, or not recorded.
        mode: of its element, +1 or -1 for slip, 0 for stick, shaped alike, or None.
    """

    name: str
    force: Array | None
    power: Array | None
    limit: Array | None
    mode: NDArray[np.int8] | None
