"""The quantities from which the paper builds Eq. (40), on plain arrays.

`solve` computes accelerations and forces without these matrices.  `solve_details` returns the matrices of the
paper beside them: the symmetric root of M, B, V, J and the generalized inverse of B.

Source: F. E. Udwadia, R. E. Kalaba, P. Phohomsiri, "Mechanical systems with nonideal constraints: explicit
equations without the use of generalized inverses", J. Appl. Mech. 71 (2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .equation import Array, checked_problem, independent_rows, solve


@dataclass(frozen=True, eq=False)
class SolutionDetails:
    """Matrices, forces and acceleration of Eq. (40), under the paper's letters.

    With R = M^(1/2), the symmetric root:

        M a = F + F_ideal + F_nonideal                              Eq. (40)
        F_ideal    = R J B^T (b - A a_free)                         Eq. (39)
        F_nonideal = R (I - J B^T B) R^-1 C                         Eq. (39)

    Attributes:
        a_free: acceleration without constraints, M^-1 F, (n,), Eq. (1).
        M_root: symmetric root M^(1/2), (n, n), Eq. (5).
        M_root_inverse: its inverse M^(-1/2), (n, n).
        B: rows in scaled coordinates, A M^(-1/2), (m, n), Eq. (7).
        V: orthonormal columns with B V = 0, (n, n - rank), Eqs. (12)-(14). J does not depend on the choice of
            columns as long as they are orthonormal.
        J: inverse of B^T B + V V^T, (n, n), Eqs. (21), (33).
        B_pinv: Moore-Penrose inverse of B, equal to J B^T, (n, m), Eqs. (41)-(46).
        F_ideal: ideal part of the constraint force, (n,), Eq. (39).
        F_nonideal: nonideal part of the constraint force, (n,), Eq. (39).
        a: acceleration, (n,), Eq. (40).
        lam: multipliers of the rows of A, (m,), as in `Solution`.
        rank: number of independent rows of A, the paper's k.
    """

    a_free: Array
    M_root: Array
    M_root_inverse: Array
    B: Array
    V: Array
    J: Array
    B_pinv: Array
    F_ideal: Array
    F_nonideal: Array
    a: Array
    lam: Array
    rank: int


def solve_details(
    M: ArrayLike,
    F: ArrayLike,
    A: ArrayLike | None = None,
    b: ArrayLike | None = None,
    C: ArrayLike | None = None,
) -> SolutionDetails:
    """Acceleration and forces of Eq. (40) with the matrices that the paper builds them from.

    The acceleration, forces and multipliers are those of `solve`, which is faster: it forms neither the
    symmetric root nor J.

    Args:
        M: mass matrix, (n, n), symmetric and positive definite; its condition may reach 1e12.
        F: given force, (n,).
        A: constraint rows, (m, n); redundant, zero and repeated rows are allowed.
        b: right-hand side of A a = b, (m,).
        C: force that prescribes the work of the constraint force on virtual displacements, (n,), Eq. (9);
            None for ideal constraints.

    Returns:
        The `SolutionDetails`.

    Raises:
        InputError: a shape does not fit, a value is not finite, or M is not symmetric.
        SingularMassError: M is not positive definite.
        InconsistentConstraintsError: no acceleration satisfies A a = b.
        NonFiniteError: the numbers are so large or small that the result overflows.

    Source: Eqs. (1), (5)-(7), (12)-(14), (21), (33), (39)-(46).
    """
    solution = solve(M, F, A, b, C)
    M, R, F, A, b, C = checked_problem(M, F, A, b, C)
    # The singular values of R are the roots of M's eigenvalues: R = U S W^T gives M^(1/2) = U S U^T and keeps
    # digits that an eigendecomposition of M loses to its condition.
    U, S, _ = np.linalg.svd(R)
    half, inverse_half = U * np.sqrt(S), U / np.sqrt(S)
    M_root, M_root_inverse = half @ half.T, inverse_half @ inverse_half.T
    B = A @ M_root_inverse  # Eq. (7)

    _, chosen, E = independent_rows(A / np.sqrt(np.diag(M)))  # A = E A[chosen]
    k = len(chosen)
    Q, T = np.linalg.qr(B[chosen].T, mode="complete")  # the Gram-Schmidt of Eqs. (12)-(14): B[chosen]^T = Q T
    V = Q[:, k:]
    # B = E T^T Q_k^T with E of full column rank, so that B^+ = Q_k T^-T E^+.
    B_pinv = np.zeros(B.T.shape)
    if k:
        B_pinv = Q[:, :k] @ np.linalg.solve(T[:k].T, np.linalg.pinv(E))  # Eqs. (41)-(46)
    # Eq. (33): inverse of B^T B on its range, of V V^T on the null space of B.
    J = B_pinv @ B_pinv.T + V @ V.T
    return SolutionDetails(
        a_free=np.linalg.solve(R.T, np.linalg.solve(R, F)),  # Eq. (1)
        M_root=M_root,
        M_root_inverse=M_root_inverse,
        B=B,
        V=V,
        J=J,
        B_pinv=B_pinv,
        F_ideal=solution.F_ideal,
        F_nonideal=solution.F_nonideal,
        a=solution.a,
        lam=solution.lam,
        rank=solution.rank,
    )
