"""Constraint rows of a program, in the order and scale of the descriptions."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.types import Array


def names_by_row(program: core.Program | core.Builder) -> tuple[list[str], list[int]]:
    """Return the names of all constraints and contacts in the order of their rows, and their numbers of rows.

    Args:
        program: the core's program, finished or under construction.
    """
    first, names = np.array(program.first_rows, dtype=np.intp), program.block_names
    order = np.argsort(first, kind="stable")
    counts = np.diff(np.append(first[order], program.rows))
    return [names[block] for block in order.tolist()], counts.tolist()


def row_slices(program: core.Program | core.Builder) -> dict[str, slice]:
    """Return the rows of each constraint and contact, by name.

    Args:
        program: the core's program, finished or under construction.
    """
    names, counts = names_by_row(program)
    ends = np.cumsum(counts, dtype=np.intp).tolist()
    return {name: slice(end - count, end) for name, count, end in zip(names, counts, ends, strict=True)}


def holonomic_rows(program: core.Program) -> NDArray[np.bool_]:
    """Return the mask of rows that constrain a position and belong to no unilateral contact, (m,).

    Args:
        program: the core's program.
    """
    out = np.zeros(program.rows, dtype=bool)
    for c in program.bilateral:
        out[c.first : c.first + c.count] = c.holonomic
    return out


def gap_rows(program: core.Program, immovable_contacts: Collection[str] = ()) -> NDArray[np.bool_]:
    """Return the mask of rows that are gaps of unilateral contacts, (m,).

    Args:
        program: the core's program.
        immovable_contacts: names of contacts that no joint moves, which are excluded.
    """
    out = np.zeros(program.rows, dtype=bool)
    out[program.first_rows[program.first_gap :]] = True  # one row each
    if immovable_contacts:
        slices = row_slices(program)
        for name in immovable_contacts:
            out[slices[name]] = False
    return out


def rows_at(
    runner: core.Runner, q: Array, v: Array, t: float, blocks: Sequence[int] | None = None
) -> tuple[Array, Array, Array, Array]:
    """Compute A (m, nv), b (m,), residual (m,) and rate (m,) of rows at a state, removed rows included.

    Args:
        runner: a workspace of the core.
        q: configuration, (nq,).
        v: velocity, (nv,).
        t: time [s].
        blocks: blocks of constraints and contacts with these rows; None for all, in the order of their rows.
    """
    A, b, phi, rate = runner.rows(q, v, t, blocks)
    return A.reshape(len(phi), len(v)), b, phi, rate


def residuals_at(runner: core.Runner, q: Array, v: Array, t: float) -> Array:
    """Compute the residuals of all rows, removed rows included, (m,).

    Args:
        runner: a workspace of the core.
        q: configuration, (nq,).
        v: velocity, which functions of a user may read, (nv,).
        t: time [s].
    """
    return np.asarray(runner.residuals(q, v, t))


def row_lengths(
    runner: core.Runner,
    q: Array,
    v: Array,
    t: float,
    *,
    own: bool = False,
    blocks: Sequence[int] | None = None,
) -> Array:
    """Compute the greatest possible lengths of rows at q in the metric of M^-1, or their lengths, (m + d,).

    The rows of `rows_at` come first, then the d slip directions of friction elements. The greatest length of
    a row between two bodies is the maximum over all directions of its force and couple at its point. A row is
    much shorter if the joints leave no freedom, as out of the plane of a planar loop.

    Args:
        runner: a workspace of the core; its friction elements are unloaded afterwards.
        q: configuration, (nq,).
        v: velocity, (nv,).
        t: time [s].
        own: whether to return the lengths of the rows instead of their greatest possible lengths.
        blocks: blocks of constraints and contacts with these rows; None for all rows and slip directions.
    """
    return np.asarray(runner.row_lengths(q, v, t, own, blocks))


# Singular value of rows divided by their greatest lengths below which rows are dependent or vanish. Closures
# and rounding give about 1e-12; directions of light mechanisms lie above 1e-7.
MIN_SINGULAR_VALUE = 1e-9


def metric_rows(runner: core.Runner, M: Array, q: Array, v: Array, t: float) -> Array:
    """Compute all rows divided by their greatest possible lengths in the metric of M^-1, (m, nv).

    Args:
        runner: a workspace of the core; its friction elements are unloaded afterwards.
        M: mass matrix, (nv, nv).
        q: configuration, (nq,).
        v: velocity, (nv,).
        t: time [s].

    Returns:
        The rows in axes in which M is the identity; rows of greatest length zero are zero.
    """
    A = rows_at(runner, q, v, t)[0]
    lengths = row_lengths(runner, q, v, t)[: len(A), None]
    rows = np.linalg.solve(np.linalg.cholesky(M), A.T).T
    scaled: Array = np.divide(rows, lengths, out=np.zeros_like(rows), where=lengths > 0.0)
    return scaled


def minimum_norm(scaled: Array, y: Array, lengths: Array) -> Array:
    """Solve min |scaled diag(lengths) x - y| for the x of least norm, (n,).

    Args:
        scaled: matrix with columns divided by their greatest lengths; its singular values define the rank,
            (m, n).
        y: right-hand side, (m,).
        lengths: greatest lengths of the columns, (n,); entries of x are zero for zero lengths.
    """
    used = lengths > 0.0
    x = np.zeros(len(lengths))
    left, values, right = np.linalg.svd(scaled[:, used])
    rank = int((values > MIN_SINGULAR_VALUE).sum())
    solution = right[:rank].T @ ((left.T[:rank] @ y) / values[:rank]) / lengths[used]
    null_basis = right[rank:].T / lengths[used][:, None]
    x[used] = solution - null_basis @ np.linalg.lstsq(null_basis, solution, rcond=None)[0]
    return x


# Relative difference of directions below which rows are duplicates: rounding error of the kinematics.
SAME_ROW = 1e-11
# Relative difference of the projections of duplicates onto a random vector: rounding error of long sums.
SUM_ROUNDING = 1e-9


def duplicate_rows(wide: Array, candidates: NDArray[np.bool_], width: int) -> list[tuple[int, int, float]]:
    """Return the rows that are multiples of earlier rows, as (row, first, factor): row = factor first.

    Args:
        wide: rows at several states side by side, followed by right-hand sides or residuals, (m, n).
        candidates: mask of rows to compare, (m,).
        width: number of leading columns that hold the rows; the other columns do not count for the length.
    """
    length = np.linalg.norm(wide[:, :width], axis=1)
    rows = np.flatnonzero(candidates & (length > 0.0))
    unit = wide[rows] / length[rows, None]
    probe = unit @ np.random.default_rng(2).standard_normal(unit.shape[1])
    side = np.where(probe < 0.0, -1.0, 1.0)  # a duplicate may have the opposite sign
    unit, probe = unit * side[:, None], np.abs(probe)
    order = np.argsort(probe, kind="stable")
    is_duplicate = np.zeros(len(rows), dtype=bool)
    duplicates = []
    for place, i in enumerate(order):
        if is_duplicate[i]:
            continue
        close, same = SAME_ROW * (1.0 + np.abs(unit[i]).max()), [i]
        for j in order[place + 1 :]:
            if probe[j] - probe[i] > SUM_ROUNDING * (1.0 + probe[i]):
                break
            if not is_duplicate[j] and np.abs(unit[i] - unit[j]).max() <= close:
                same.append(j)
        is_duplicate[same] = True
        first = min(same)
        for j in same:
            if j != first:
                factor = side[j] * length[rows[j]] / (side[first] * length[rows[first]])
                duplicates.append((int(rows[j]), int(rows[first]), float(factor)))
    return sorted(duplicates)
