"""Least moves under rows that are held and gaps that stay open or touch.

[Lawson, Hanson: Solving Least Squares Problems, 1974, ch. 23: least distance programming.]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.types import Array

# Directions that the rows hold by less than this part of the best held ones they do not hold.
HELD = 1e-9
# A move as many times longer than the deepest gap leads out of it nowhere near.
LONGEST_WAY_OUT = 1e6


Numbers = NDArray[np.intp]


class LeastMove(NamedTuple):
    """The shortest sum of a move so far and a further one.

    Attributes:
        x: the further one, (n,).
        touching: the numbers of the gaps that it brings to zero and presses on.
        pull: the largest multiplier of a row or gap.
    """

    x: Array
    touching: Numbers
    pull: float


def held(B: Array) -> tuple[Array, Array, Array]:
    """Singular values of the rows that hold something, with their vectors U (m, r) and V^T (r, nv).

    Args:
        B: rows, (m, nv).
    """
    U, s, Vt = np.linalg.svd(B, full_matrices=False)
    rank = int(np.count_nonzero(s > HELD * s.max(initial=0.0)))
    return U[:, :rank], s[:rank], Vt[:rank]


def complement(Vt: Array) -> Array:
    """Orthonormal columns that span what the orthonormal rows leave.

    Args:
        Vt: rows, (r, n).
    """
    rank, n = Vt.shape
    Q, _ = np.linalg.qr(Vt.T, mode="complete") if rank else (np.eye(n), None)
    return Q[:, rank:]


def least_move(B: Array, phi: Array, G: Array, gap: Array, move: Array) -> LeastMove | None:
    """The x with least |move + x|^2 under B x = -phi and gap + G x >= 0; None where there is none nearby.

    Args:
        B: rows that are held, (m, n).
        phi: their residuals, (m,).
        G: rows of the gaps, (k, n).
        gap: gaps, (k,).
        move: from the start, (n,).
    """
    U, s, Vt = held(B)
    onto = -Vt.T @ ((U.T @ phi) / s)
    open_directions = complement(Vt)
    back = -open_directions @ (open_directions.T @ move)  # along what the rows leave open
    C, lacking = G @ open_directions, -(gap + G @ (onto + back))
    out, pressed = _way_out(C, lacking)
    if out is None:
        return None
    x = onto + back + open_directions @ out
    lam = U @ ((Vt @ (move + x - G.T @ pressed)) / s)
    pull = max(np.abs(lam).max(initial=0.0), pressed.max(initial=0.0))
    return LeastMove(x, np.flatnonzero(pressed > 0.0), float(pull))


def _way_out(C: Array, lacking: Array) -> tuple[Array | None, Array]:
    """The shortest u with C u >= lacking, None where there is none nearby, and u = C^T pressed."""
    from scipy.optimize import nnls  # where a contact starts inside only: its import takes long

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
