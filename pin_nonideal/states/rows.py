"""Rows of all constraints and contacts of a program, in the order and scale of the descriptions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core import core
from pin_nonideal.types import Array


def row_slices(program: core.Program | core.Builder) -> dict[str, slice]:
    """Rows of each constraint and contact, by name.

    Args:
        program: the scene as the core knows it, finished or not.
    """
    return {c.name: slice(c.first, c.first + c.count) for c in program.constraints}


def holonomic_rows(program: core.Program) -> NDArray[np.bool_]:
    """Which rows restrict the position; the others leave nothing to project it on, (m,).

    Args:
        program: the scene as the core knows it.
    """
    return np.array([holds for c in program.constraints for holds in c.holonomic], dtype=bool)


def rows_at(runner: core.Runner, q: Array, v: Array, t: float) -> tuple[Array, Array, Array, Array]:
    """A (m, nv), b (m,), residual (m,) and rate (m,) of all rows at one state, dropped ones too.

    Args:
        runner: a workspace of the core.
        q: configuration, (nq,).
        v: velocity, (nv,).
        t: time [s].
    """
    A, b, phi, rate = runner.rows(q, v, t)
    return A.reshape(-1, len(v)), b, phi, rate
