"""Velocities of which some entries are held: the nearest that meet the constraints by the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core import core
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Model

from .extents import coordinate
from .rows import rows_at

# Part of the largest row, over the root of the mass matrix, below which the free entries do not move one.
UNMOVED = 1e-10
# Singular values below this part of the largest are rounding of rows that depend on others.
DEPENDENT = 1e-11
# Part of 1 + |v| by which a row may miss its rate.
MISSED = 1e-9
# A change of a free entry of more than this part of 1 + |v| is worth a word.
LITTLE = 1e-3


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
    root = np.linalg.cholesky(metric[np.ix_(free, free)])
    B = np.linalg.solve(root, A[rows][:, free].T).T
    size = np.linalg.norm(B, axis=1)
    moved = size > UNMOVED * size.max(initial=0.0)
    found: Array = v.copy()
    if moved.any():
        scale = size[moved]
        x = np.linalg.lstsq(B[moved] / scale[:, None], -rate[rows][moved] / scale, rcond=DEPENDENT)[0]
        found[free] += np.linalg.solve(root.T, x)
    missed = np.abs(np.where(rows, rows_at(runner, q, found, t)[3], 0.0))
    # Rows as long as they are: of a meter or a radian each.
    length = np.maximum(np.linalg.norm(A, axis=1), 1.0)
    if (missed > MISSED * length * (1.0 + np.abs(found).max(initial=0.0))).any():
        raise InputError(
            f"v: the constraints do not allow {_told(model, v, held)} together at t = {t:.2f} s; name fewer "
            "entries, so that the others can follow, or give velocities that go together"
        )
    return found


def told(model: Model, asked: Array, found: Array, held: NDArray[np.bool_]) -> list[str]:
    """A sentence on entries that follow held ones; none where nothing had to.

    Args:
        model: pinocchio.Model.
        asked: velocity as asked for, (nv,).
        found: with which the run begins, (nv,).
        held: entries that stay, (nv,).
    """
    change = np.abs(found - asked)
    follows = ~held & (change > LITTLE * (1.0 + np.abs(found).max(initial=0.0)))
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
