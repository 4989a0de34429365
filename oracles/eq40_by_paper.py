"""The equations of the paper as printed, and independent solutions of the same problem.

The code is simple rather than fast: the symmetric root of M, V by Gram-Schmidt, J by inversion.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

# Relative length at which Gram-Schmidt drops the remainder of a vector.  In the random problems of the tests,
# redundant rows have a remainder of about 1e-15, and independent rows of more than 1e-3.
DEPENDENT = 1e-9


class Forces(NamedTuple):
    a: np.ndarray
    F_ideal: np.ndarray
    F_nonideal: np.ndarray


class Letters(NamedTuple):
    """Intermediate matrices of the paper."""

    root: np.ndarray  # M^(1/2)
    B: np.ndarray
    V: np.ndarray
    J: np.ndarray
    D: np.ndarray
    E: np.ndarray


def symmetric_root(M):
    eigenvalues, vectors = np.linalg.eigh(M)
    return (vectors * np.sqrt(eigenvalues)) @ vectors.T


def gram_schmidt(vectors, basis):
    """Return orthonormal vectors that extend `basis` to the span of both; each vector is projected twice."""
    basis = list(basis)
    found = []
    for vector in vectors:
        left = vector.copy()
        for _ in range(2):
            for u in basis:
                left = left - (u @ left) * u
        if np.linalg.norm(left) > DEPENDENT * max(np.linalg.norm(vector), 1e-300):
            basis.append(left / np.linalg.norm(left))
            found.append(basis[-1])
    return found


def null_basis(B):
    """Return V, (n, n - k): orthonormal columns with B V = 0, Eqs. (12)-(14)."""
    n = B.shape[1]
    columns = gram_schmidt(np.eye(n), gram_schmidt(B, []))  # Eqs. (12)-(14)
    return np.array(columns).reshape(-1, n).T


def letters(M, A, V=None):
    root = symmetric_root(M)
    B = A @ np.linalg.inv(root)  # Eq. (7)
    V = null_basis(B) if V is None else V
    D = B.T @ B  # Eq. (17)
    E = V @ V.T  # Eq. (18)
    J = np.linalg.inv(D + E)  # Eq. (33)
    return Letters(root, B, V, J, D, E)


def eq40_by_paper(M, F, A, b, C, V=None):
    """Solve by Eqs. (38)-(40) as printed."""
    root, B, _, J, _, _ = letters(M, A, V)
    n = len(M)
    a_free = np.linalg.solve(M, F)  # Eq. (1)
    F_ideal = root @ J @ B.T @ (b - A @ a_free)  # Eq. (39)
    F_nonideal = root @ (np.eye(n) - J @ B.T @ B) @ np.linalg.solve(root, C)  # Eq. (39)
    return Forces(np.linalg.solve(M, F + F_ideal + F_nonideal), F_ideal, F_nonideal)  # Eq. (40)


def stacked_road(M, F, A, b, C):
    """Solve the normal equations of the stacked system, Eq. (15), with the block inverse of Eqs. (20)-(24).

    [I  -I ]                 [a_s    ]
    [B   0 ] [qdd_s; F_s] =  [b      ]
    [0  V^T]                 [V^T C_s]
    """
    root, B, V, J, D, E = letters(M, A)
    n = len(M)
    eye, zero = np.eye(n), np.zeros
    W = np.block([[eye, -eye], [B, zero(B.shape)], [zero(V.T.shape), V.T]])
    right = np.concatenate([root @ np.linalg.solve(M, F), b, V.T @ np.linalg.solve(root, C)])  # Eq. (15)
    inverse = np.block([[J @ (eye + E), J], [J, J @ (eye + D)]])  # Eqs. (20)-(24)
    x = inverse @ W.T @ right
    return np.linalg.solve(root, x[:n]), root @ x[n:]


def generalized_inverse_road(M, F, A, b, C):
    """Solve by the 2002 form, Eqs. (47)-(49)."""
    root = symmetric_root(M)
    B = A @ np.linalg.inv(root)
    B_plus = np.linalg.pinv(B, rcond=DEPENDENT) if B.size else B.T
    a_free = np.linalg.solve(M, F)
    F_ideal = root @ B_plus @ (b - A @ a_free)  # Eq. (48)
    F_nonideal = root @ (np.eye(len(M)) - B_plus @ B) @ np.linalg.solve(root, C)  # Eq. (49)
    return Forces(a_free + np.linalg.solve(M, F_ideal + F_nonideal), F_ideal, F_nonideal)  # Eq. (47)


def kkt_road(M, F, A, b, C):
    """Solve the dense KKT system in (a, lam) by least squares.  Returns (forces, lam of minimum norm)."""
    n, m = len(M), len(A)
    K = np.block([[M, -A.T], [A, np.zeros((m, m))]])
    ideal = np.linalg.lstsq(K, np.concatenate([F, b]), rcond=DEPENDENT)[0]
    added = np.linalg.lstsq(K, np.concatenate([C, np.zeros(m)]), rcond=DEPENDENT)[0]
    forces = Forces((ideal + added)[:n], A.T @ ideal[n:], C + A.T @ added[n:])
    return forces, (ideal + added)[n:]


def exact_road(M, F, A, b, C):
    """Solve the KKT system of independent rows in rational numbers: exact for the inputs, rounded once."""
    n, m = len(M), len(A)
    K = np.block([[M, -A.T], [A, np.zeros((m, m))]])
    right = np.column_stack([np.concatenate([F, b]), np.concatenate([C, np.zeros(m)])])
    rows = [[Fraction(float(x)) for x in row] for row in np.hstack([K, right])]
    size = n + m
    for k in range(size):
        pivot = next(i for i in range(k, size) if rows[i][k] != 0)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(size):
            if i != k and rows[i][k] != 0:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    ideal, added = ([rows[i][size + c] / rows[i][i] for i in range(size)] for c in (0, 1))

    def pull(lam, i):
        return sum((Fraction(float(A[j, i])) * lam[j] for j in range(m)), Fraction(0))

    forces = Forces(
        np.array([float(ideal[i] + added[i]) for i in range(n)]),
        np.array([float(pull(ideal[n:], i)) for i in range(n)]),
        np.array([float(Fraction(float(C[i])) + pull(added[n:], i)) for i in range(n)]),
    )
    return forces, np.array([float(x + y) for x, y in zip(ideal[n:], added[n:], strict=True)])
