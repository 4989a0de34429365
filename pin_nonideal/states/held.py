"""Projection of a velocity onto the constraints with some of its entries held."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core import core
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Model

from .extents import coordinate
from .rows import DEPENDENT, row_lengths, rows_at, shortest

# Part of the terms A_j v_j and phi_t of a row by which their sum may miss zero.
MISSED = 1e-9
# Part of the largest velocity by which a projection changes velocities that meet the constraints already.
ROUNDING = 1e-12
# Part of the largest velocity above which the change of a free entry is reported.
LITTLE = 1e-3


def changes(asked: Array, found: Array, held: NDArray[np.bool_]) -> bool:
    """Whether a projection has changed held entries by more than rounding.

    Args:
        asked: velocity before, (nv,).
        found: velocity after, (nv,).
        held: entries to be held, (nv,).
    """
    change = np.abs(found - asked)[held].max(initial=0.0)
    return bool(change > ROUNDING * np.abs(asked).max(initial=0.0))


def holding(
    model: Model,
    program: core.Program,
    q: Array,
    v: Array,
    held: NDArray[np.bool_],
    rows: NDArray[np.bool_],
    metric: Array,
    t: float,
) -> Array:
    """The velocity v' with A v' + phi_t = 0, v' = v in held entries and the least d^T M d, d = v' - v.

    Args:
        model: pinocchio.Model.
        program: the scene as the core knows it.
        q: configuration on the constraints, (nq,).
        v: velocity as asked for, (nv,).
        held: entries that stay, (nv,).
        rows: rows that must hold, (m,).
        metric: M, positive definite, (nv, nv).
        t: time [s].

    Returns:
        v', (nv,).

    Raises:
        InputError: the constraints do not allow the held entries together.
    """
    runner, free = program.runner(), ~held
    A, _, _, rate = rows_at(runner, q, v, t)
    lengths = row_lengths(runner, q, v, t)[: len(A)]
    whole = np.linalg.norm(np.linalg.solve(np.linalg.cholesky(metric), A.T), axis=0)
    acting = np.flatnonzero(rows & (whole > DEPENDENT * lengths))
    A, rate, lengths = A[acting], rate[acting], lengths[acting]
    root = np.linalg.cholesky(metric[np.ix_(free, free)])
    B = np.linalg.solve(root, A[:, free].T).T
    moved = np.linalg.norm(B, axis=1) > DEPENDENT * lengths
    scale = lengths[moved]
    x = shortest(B[moved] / scale[:, None], -rate[moved] / scale, np.ones(B.shape[1]))
    found: Array = v.copy()
    found[free] += np.linalg.solve(root.T, x)
    missed = rows_at(runner, q, found, t)[3][acting]
    terms = np.abs(A) @ (np.abs(v) + np.abs(found)) + np.abs(rate - A @ v)
    if (np.abs(missed) > MISSED * terms).any():
        raise InputError(
            f"v: no velocity on the constraints has {_told(model, v, held)} at t = {t:.2f} s; name fewer "
            "entries, so that the others can follow, or give velocities that are consistent"
        )
    return found


def told(model: Model, asked: Array, found: Array, held: NDArray[np.bool_]) -> list[str]:
    """A note that names the entries that follow held ones; none where no entry had to.

    Args:
        model: pinocchio.Model.
        asked: velocity as asked for, (nv,).
        found: velocity at the start of the run, (nv,).
        held: entries that stay, (nv,).
    """
    change = np.abs(found - asked)
    follows = ~held & (change > LITTLE * max(np.abs(asked).max(initial=0.0), np.abs(found).max(initial=0.0)))
    if not follows.any():
        return []
    return [
        f"the velocities that were named are held, {_told(model, found, held)}, and others follow them: "
        f"{_told(model, found, follows)}"
    ]


def _told(model: Model, v: Array, which: NDArray[np.bool_]) -> str:
    dofs = list(map(int, np.flatnonzero(which)))
    shown = ", ".join(f'"{coordinate(model, dof)}" = {v[dof]:.4g}' for dof in dofs[:4])
    return f"{shown} and {len(dofs) - 4} more" if len(dofs) > 4 else shown
