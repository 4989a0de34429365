"""Least displacements under linear equality rows and nonnegative gaps.

[Lawson, Hanson: Solving Least Squares Problems, 1974, ch. 23: least distance programming.]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.types import Array

# Singular values of rows below this fraction of the largest count as zero.
MIN_SINGULAR_VALUE = 1e-9
# Displacements longer than the deepest penetration by this factor are rejected.
LONGEST_WAY_OUT = 1e6


Numbers = NDArray[np.intp]


class LeastDistance(NamedTuple):
    """Step that gives the least total displacement.

    Attributes:
        x: step, (n,).
        touching: indices of the active gaps, which have a positive multiplier.
        pull: largest multiplier of a row or gap.
    """

    x: Array
    touching: Numbers
    pull: float


def row_singular_values(B: Array) -> tuple[Array, Array, Array]:
    """Return the nonzero singular values of the rows, with their vectors U (m, r) and V^T (r, nv).

    Args:
        B: rows, (m, nv).
    """
    U, s, Vt = np.linalg.svd(B, full_matrices=False)
    rank = int(np.count_nonzero(s > MIN_SINGULAR_VALUE * s.max(initial=0.0)))
    return U[:, :rank], s[:rank], Vt[:rank]


def complement(Vt: Array) -> Array:
    """Return orthonormal columns that span the null space of orthonormal rows, (n, n - r).

    Args:
        Vt: rows, (r, n).
    """
    rank, n = Vt.shape
    Q, _ = np.linalg.qr(Vt.T, mode="complete") if rank else (np.eye(n), None)
    return Q[:, rank:]


def solve_ldp(B: Array, phi: Array, G: Array, gap: Array, move: Array) -> LeastDistance | None:
    """Compute x with least |move + x|^2 under B x = -phi and gap + G x >= 0, or None if none is nearby.

    Args:
        B: equality rows, (m, n).
        phi: residuals of the equality rows, (m,).
        G: rows of the gaps, (k, n).
        gap: gaps, (k,).
        move: displacement from the start, (n,).
    """
    U, s, Vt = row_singular_values(B)
    onto = -Vt.T @ ((U.T @ phi) / s)
    open_directions = complement(Vt)
    back = -open_directions @ (open_directions.T @ move)  # in the null space of the rows
    C, lacking = G @ open_directions, -(gap + G @ (onto + back))
    out, pressed = _way_out(C, lacking)
    if out is None:
        return None
    x = onto + back + open_directions @ out
    lam = U @ ((Vt @ (move + x - G.T @ pressed)) / s)
    pull = max(np.abs(lam).max(initial=0.0), pressed.max(initial=0.0))
    return LeastDistance(x, np.flatnonzero(pressed > 0.0), float(pull))


def _way_out(C: Array, lacking: Array) -> tuple[Array | None, Array]:
    """Compute the shortest u = C^T pressed with C u >= lacking, and pressed; u is None if none is nearby."""
    from scipy.optimize import nnls  # imported only for initial penetration, since the import is slow

    deepest = float(lacking.max(initial=0.0))
    if deepest <= 0.0:
        return np.zeros(C.shape[1]), np.zeros(len(lacking))
    E = np.vstack([C.T, lacking / deepest])
    weight, _ = nnls(E, np.append(np.zeros(C.shape[1]), 1.0), maxiter=30 * (len(lacking) + C.shape[1]))
    short = 1.0 - float(E[-1] @ weight)
    if not short > LONGEST_WAY_OUT**-2:
        return None, np.zeros(len(lacking))
    pressed = weight * (deepest / short)
    return C.T @ pressed, pressed
