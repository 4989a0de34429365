"""The explicit equation of motion, Eq. (40), on plain arrays.

A system has mass matrix M, given force F and constraints A a = b, whose rows may be redundant. On every
virtual displacement w (A w = 0), the constraint force F_c does the prescribed work w^T F_c = w^T C,
Eq. (9). Then

    M a = F + F_ideal + F_nonideal                                             Eq. (40)
    F_ideal    = R B^+ (b - A M^-1 F)                                          Eq. (39)
    F_nonideal = R (I - B^+ B) R^-1 C                                          Eq. (39)

with M = R R^T, B = A R^-T and B^+ = J B^T = (B^T B + V V^T)^-1 B^T, Eqs. (33) and (41)-(46). The paper uses
the symmetric root R = M^(1/2). Any factor gives the same forces, so R is the Cholesky factor here.

Source: F. E. Udwadia, R. E. Kalaba, P. Phohomsiri, "Mechanical systems with nonideal constraints: explicit
equations without the use of generalized inverses", J. Appl. Mech. 71 (2004).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InconsistentConstraintsError, InputError, NonFiniteError, SingularMassError
from .html_tables import numbers, table
from .validation import floats

Array = NDArray[np.floating[Any]]

# A unit row is redundant if its remainder outside the span of the other rows is at most this value. Rows from
# kinematics have rounding errors of about 1e-13, which a smaller tolerance would count as independent. A row
# with a larger remainder still determines its acceleration to about 1e-6.
RANK_TOLERANCE = 1e-10
# A row below this fraction of the longest row is the rounding error of a vanishing row (a planar loop closed
# in 3D).
ZERO_ROW = 1e-14
# Redundant rows are inconsistent if their residual exceeds this part of the acceleration scale. The tolerance
# is a hundred times the largest remainder of a redundant row, so rounding alone never raises.
RESIDUAL_TOLERANCE = 1e-8
# Number of refinements: repeated solutions for the remaining residual. Each refinement adds the correct
# digits of one solution, which are few if M has condition 1e12.
REFINEMENTS = 2
# M[i, j] and M[j, i] may differ by this fraction of sqrt(M[i, i] M[j, j]); sums in another order differ by
# 1e-15.
SYMMETRY_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class Solution:
    """Acceleration and constraint forces at one instant.

    The multipliers belong to the total motion, M a = F + C + A^T lam, so that
    A^T lam = F_ideal + F_nonideal - C. For redundant rows the multipliers are not unique: `lam` has minimum
    norm, in the row order and the row scale of the given A. The forces are unique.

    Attributes:
        a: acceleration, (n,).
        F_ideal: ideal part of the constraint force, (n,), Eq. (39).
        F_nonideal: nonideal part of the constraint force, (n,), Eq. (39).
        lam: multipliers of the rows of A, (m,); a pair of shapes in a scene has one, the sum of the normal
            forces at its points.
        rank: number of independent rows of A, the paper's k.
        modes: mode of each friction element of a scene, +1 or -1 for slip, 0 for stick, 2 for an open
            contact; empty without friction elements. A pair of shapes slips if one of its points slips.
        closed: whether each contact of a scene is closed, in the order of its `contact_names`; empty without
            contacts.
        unique: whether this is the only motion that constraints and laws admit. True: uniqueness is proven.
            False: another motion is known. None: unknown, for example if user functions read the reactions,
            many elements load each other strongly, or several rough contacts are at rest.
    """

    a: Array
    F_ideal: Array
    F_nonideal: Array
    lam: Array
    rank: int
    modes: NDArray[np.int8] = field(default_factory=lambda: np.zeros(0, dtype=np.int8))
    unique: bool | None = True
    closed: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def _repr_html_(self) -> str:
        keys = ("a", "F_ideal", "F_nonideal", "lam", "modes", "closed")
        vectors: dict[str, NDArray[np.generic]] = {key: getattr(self, key) for key in keys}
        rows: list[tuple[str, object]] = [(name, numbers(x)) for name, x in vectors.items() if x.size]
        return table("Solution", [*rows, ("rank", self.rank), ("unique", self.unique)])


def solve(
    M: ArrayLike,
    F: ArrayLike,
    A: ArrayLike | None = None,
    b: ArrayLike | None = None,
    C: ArrayLike | None = None,
) -> Solution:
    """Compute the acceleration and the constraint forces by Eq. (40).

    Units follow from the coordinates: for a joint angle, F in N m and M in kg m^2; for a length, N and kg.

    Args:
        M: mass matrix, (n, n), symmetric and positive definite; its condition may reach 1e12.
        F: given force, (n,).
        A: constraint rows, (m, n); redundant, zero and repeated rows are allowed.
        b: right-hand side of A a = b, (m,).
        C: force that prescribes the work of the constraint force on virtual displacements, (n,), Eq. (9);
            None for ideal constraints.

    Returns:
        The `Solution`, which satisfies M a = F + C + A^T lam and A^T lam = F_ideal + F_nonideal - C.

    Raises:
        InputError: a shape does not fit, a value is not finite, or M is not symmetric.
        SingularMassError: M is not positive definite.
        InconsistentConstraintsError: no acceleration satisfies A a = b.
        NonFiniteError: the numbers are so large or small that the result overflows.

    Source: Eqs. (3)-(7), (39), (40).
    """
    M, R, F, A, b, C = checked_problem(M, F, A, b, C)
    mass_scale = np.sqrt(np.diag(M))  # scales coordinates in meters and radians alike
    with np.errstate(over="ignore", invalid="ignore"):
        row_scale, chosen, E = independent_rows(A / mass_scale)
        A_k, b_k, rank = A[chosen], b[chosen], len(chosen)  # A = E A_k: without redundant rows
        R_inverse = _solve_lower(R, np.eye(len(R)))
        B = A_k @ R_inverse.T  # Eq. (7)
        Q, T = np.linalg.qr(B.T)  # B^T = Q T: the Gram-Schmidt of Eqs. (12)-(14), so B^+ = Q T^-T
        T_inverse = np.linalg.solve(T, np.eye(rank))

        def respond(f: Array, r: Array) -> tuple[Array, Array]:
            """Solve M a = f + A_k^T lam, A_k a = r for a and lam, for several columns f and r at once."""
            a_s = R_inverse @ f  # Eq. (5)
            c = T_inverse.T @ (r - B @ a_s)
            a = R_inverse.T @ (a_s + Q @ c)  # Eq. (40), scaled: a_s + B^+ (r - B a_s)
            return a, T_inverse @ c

        # Eq. (40) is linear in (F, b) and C: the first column is the ideal motion, the second the part of C.
        f, r = np.column_stack([F, C]), np.column_stack([b_k, np.zeros(rank)])
        a, lam_k = respond(f, r)
        # Light links give a large M^-1 f, which constraints then cancel. The response to the remaining
        # residual restores the digits lost by cancellation.
        for _ in range(REFINEMENTS):
            more_a, more_lam = respond(f - M @ a + A_k.T @ lam_k, r - A_k @ a)  # residuals of Eqs. (3), (4)
            a, lam_k = a + more_a, lam_k + more_lam

        F_ideal = A_k.T @ lam_k[:, 0]  # Eq. (39)
        F_nonideal = C + A_k.T @ lam_k[:, 1]  # Eq. (39)
        total = a[:, 0] + a[:, 1]
        lam = _spread(E, chosen, lam_k[:, 0] + lam_k[:, 1])

    if not (np.isfinite(total).all() and np.isfinite(lam).all()):
        raise NonFiniteError("acceleration must be finite, got an overflow; change the units of M, F or A")
    if rank < len(A):
        free = R_inverse.T @ (R_inverse @ (F + C))  # Eq. (1), with C
        in_play = np.linalg.norm(mass_scale * total) + np.linalg.norm(mass_scale * free)
        _check_consistent(A, b, total, E, chosen, row_scale, float(in_play))
    return Solution(total, F_ideal, F_nonideal, lam, rank)


def independent_rows(A: Array) -> tuple[Array, list[int], Array]:
    """Select rows of A that span all of its rows, by Gram-Schmidt with pivoting on rows of unit length.

    A and B = A R^-T have the same rank. The use of A makes the decision independent of the condition of M.

    Args:
        A: rows in coordinates of equal units, (m, n).

    Returns:
        Length of each row (for vanishing rows the largest entry of A), (m,); the k chosen rows; and E,
        (m, k), with A = E A[chosen].
    """
    m, n = A.shape
    largest = float(np.abs(A).max(initial=0.0)) or 1.0  # divided out first, since squares of 1e200 overflow
    length = np.linalg.norm(A / largest, axis=1)
    vanishing = length <= ZERO_ROW * length.max(initial=0.0)
    length[vanishing] = 1.0
    remainder = np.where(vanishing[:, None], 0.0, A / largest / length[:, None])
    length *= largest

    L = np.zeros((m, min(m, n)))  # unit rows = L times orthonormal rows
    chosen: list[int] = []
    for k in range(min(m, n)):
        left = np.linalg.norm(remainder, axis=1)
        pivot = int(np.argmax(left))
        if left[pivot] <= RANK_TOLERANCE:
            break
        direction = remainder[pivot] / left[pivot]
        L[:, k] = remainder @ direction
        remainder -= np.outer(L[:, k], direction)
        remainder[pivot] = 0.0  # exactly, so that L[chosen] is lower triangular
        chosen.append(pivot)
    L = L[:, : len(chosen)]
    if len(chosen) == m:  # no row is redundant
        E = np.zeros((m, m))
        E[chosen, range(m)] = 1.0
        return length, chosen, E
    E = np.linalg.solve(L[chosen].T, L.T).T * (length[:, None] / length[chosen])
    return length, chosen, E


def _spread(E: Array, chosen: list[int], lam_k: Array) -> Array:
    """Compute the minimum-norm lam with E^T lam = lam_k, so that A^T lam = A_k^T lam_k."""
    if len(chosen) == len(E):
        lam = np.zeros(len(E))
        lam[chosen] = lam_k
        return lam
    Q, T = np.linalg.qr(E)
    lam = Q @ _solve_lower(T.T, lam_k)
    lam += Q @ _solve_lower(T.T, lam_k - E.T @ lam)  # refinement for rows of very different scale
    lam[~E.any(axis=1)] = 0.0  # vanishing rows have zero multipliers
    return lam


def _solve_lower(L: Array, X: Array) -> Array:
    """Compute L^-1 X by forward substitution.

    With rows and columns reversed, L is upper triangular. `numpy.linalg.solve` then neither pivots nor
    eliminates, so rounding error of heavy coordinates does not enter light ones.
    """
    return np.linalg.solve(L[::-1, ::-1], X[::-1])[::-1]


@np.errstate(over="ignore", invalid="ignore")
def _check_consistent(
    A: Array, b: Array, a: Array, E: Array, chosen: list[int], row_scale: Array, in_play: float
) -> None:
    """Raise InconsistentConstraintsError if the motion violates a redundant row."""
    residual = A @ a - b  # Eq. (3)
    dropped = np.ones(len(A), dtype=bool)
    dropped[chosen] = False
    demanded = float(np.max(np.abs(b[chosen]) / row_scale[chosen], initial=0.0))
    excess = np.where(dropped, np.abs(residual) / row_scale, 0.0)
    worst = int(np.argmax(excess))
    if excess[worst] <= RESIDUAL_TOLERANCE * (in_play + demanded):
        return
    weight = np.abs(E[worst]) * row_scale[chosen] / row_scale[worst]
    rows = sorted([worst, *(chosen[j] for j in np.flatnonzero(weight > RESIDUAL_TOLERANCE))])
    if len(rows) == 1:
        raise InconsistentConstraintsError(
            f"row {worst} of A is zero: b[{worst}] must be 0, got {b[worst]:.6g}; correct b or remove the row"
        )
    listed = ", ".join(str(i) for i in rows[:-1]) + f" and {rows[-1]}"
    raise InconsistentConstraintsError(
        f"constraint rows {listed} contradict each other: A a - b must be 0,"
        f" got {residual[worst]:.1e} in row {worst}; correct b or remove a row"
    )


def checked_problem(
    M: ArrayLike, F: ArrayLike, A: ArrayLike | None, b: ArrayLike | None, C: ArrayLike | None
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return the arguments of `solve` as checked arrays with defaults, and the factor R of M."""
    M = _numbers("M", M)
    if M.ndim != 2 or M.shape[0] != M.shape[1] or M.shape[0] == 0:
        raise InputError(f"M must have shape (n, n) with n >= 1, got {M.shape}; pass the mass matrix")
    n = M.shape[0]
    if (A is None) != (b is None):
        present, absent = ("A", "b") if b is None else ("b", "A")
        raise InputError(
            f"A and b must be given together, got {present} without {absent}; pass {absent} as well"
        )
    F = _numbers("F", F)
    A = np.zeros((0, n)) if A is None else _numbers("A", A)
    b = np.zeros(0) if b is None else _numbers("b", b)
    C = np.zeros(n) if C is None else _numbers("C", C)
    if F.shape != (n,):
        raise InputError(f"F must have shape ({n},) to fit M, got {F.shape}; one force per coordinate")
    if A.ndim != 2 or A.shape[1] != n:
        raise InputError(f"A must have shape (m, {n}) to fit M, got {A.shape}; one row per constraint")
    if b.shape != (len(A),):
        raise InputError(f"b must have shape ({len(A)},) to fit A, got {b.shape}; one value per row of A")
    if C.shape != (n,):
        raise InputError(f"C must have shape ({n},) to fit M, got {C.shape}; one force per coordinate")
    _check_symmetry(M)
    symmetric: Array = M + (M.T - M) / 2.0
    return symmetric, _factor(symmetric), F, A, b, C


def _numbers(name: str, value: ArrayLike) -> Array:
    """Return `value` as an array of finite floats."""
    array, where = floats(value)
    if array is None:
        raise InputError(f"{name} must hold real numbers, got {type(value).__name__}; pass floats")
    if where is not None:
        place = f"{name}{list(where)}"
        raise InputError(f"{name} must be finite, got {array[where]} at {place}; check how it is computed")
    return array


def _check_symmetry(M: Array) -> None:
    """Raise InputError unless M is symmetric up to rounding."""
    diagonal = np.sqrt(np.abs(np.diag(M)))
    gap = np.abs(M - M.T) - SYMMETRY_TOLERANCE * np.outer(diagonal, diagonal)
    if (gap <= 0.0).all():
        return
    i, j = (int(k) for k in np.unravel_index(np.argmax(gap), gap.shape))
    i, j = min(i, j), max(i, j)
    raise InputError(
        f"M must be symmetric, got M[{i}, {j}] = {M[i, j]:.6g} but M[{j}, {i}] = {M[j, i]:.6g};"
        " mirror the triangle that was computed"
    )


def _factor(M: Array) -> Array:
    """Return R of M = R R^T; raise SingularMassError unless M is positive definite beyond rounding."""
    try:
        R: Array = np.linalg.cholesky(M)
        left = np.diag(R) ** 2 / np.diag(M)  # remaining part of each diagonal entry after elimination
        definite = bool((left > len(M) * np.finfo(float).eps).all())
    except np.linalg.LinAlgError:
        definite = False
    if definite:
        return R
    eigenvalues = np.linalg.eigvalsh(M)
    raise SingularMassError(
        f"M must be positive definite, got smallest eigenvalue {eigenvalues[0]:.3e}"
        f" (largest {eigenvalues[-1]:.3e}); give every link a positive mass and inertia"
    )
