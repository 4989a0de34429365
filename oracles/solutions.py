"""Check of the core's solutions of Eq. (40) against dense systems with independent M, F, A and b."""

from __future__ import annotations

import numpy as np

import pin_nonideal as pn

from .applied_forces import given_force, mass_matrix
from .differences import MET, rows_at
from .rows import rows

# Tolerances of a dense KKT solution of condition 1e4; multipliers have the squared condition.
KKT = 1e-10
MULTIPLIERS = 1e-8


def assert_same_terms(scene, q, v, t, core_F, F, A, b):
    """Assert that the core's F, A and b equal those of Pinocchio's frames, up to rounding of their terms."""
    still = given_force(scene, q, np.zeros_like(v), t)
    size = np.abs(F).max() + np.abs(F - still).max() + np.abs(still).max()
    np.testing.assert_allclose(core_F, F, rtol=0, atol=MET * size)
    core_A, core_b, _, _ = rows_at(scene, scene._compiled.program.runner(), q, v, t)
    size = 1.0 + np.abs(A).max(initial=0.0)
    np.testing.assert_allclose(core_A, A, rtol=0, atol=MET * size)
    size = size * (1.0 + np.abs(v).max()) ** 2 + np.abs(b).max(initial=0.0)
    np.testing.assert_allclose(core_b, b, rtol=0, atol=MET * size)


def kkt_acceleration(M, force, A, b):
    """Solve [M -A^T; A 0] (a, lam) = (force, b) for a with independent rows, refined in long double."""
    from scipy.linalg import qr

    n = len(M)
    d = 1.0 / np.sqrt(np.diag(M))  # scales rows and columns to similar size
    A, b = A * d, b.copy()
    length = np.linalg.norm(A, axis=1)
    long = length > 1e-9 * length.max(initial=0.0)  # other rows are zero up to rounding of the kinematics
    A, b = A[long] / length[long, None], b[long] / length[long]
    if len(A):
        B = np.linalg.solve(np.linalg.cholesky(M * np.outer(d, d)), A.T)
        B /= np.linalg.norm(B, axis=0)
        _, R, order = qr(B, mode="economic", pivoting=True)
        chosen = order[: np.count_nonzero(np.abs(np.diag(R)) > 1e-9)]
        A, b = A[chosen], b[chosen]
    K = np.block([[M * np.outer(d, d), -A.T], [A, np.zeros((len(A), len(A)))]])
    right, exact = np.concatenate([force * d, b]), K.astype(np.longdouble)
    x = np.linalg.solve(K, right).astype(np.longdouble)
    for _ in range(3):
        x += np.linalg.solve(K, (right - exact @ x).astype(float))
    return x[:n].astype(float) * d


def assert_solves_its_rows(scene, q, v, t, modes=None):
    """Assert acceleration, ideal and nonideal forces, multipliers and rank; returns the core's solution."""
    raw = scene._compiled.program.runner().solve(q, v, t, None, modes)
    M, F = mass_matrix(scene.model, q), given_force(scene, q, v, t)
    A, b = rows(scene, q, v, t)
    assert_same_terms(scene, q, v, t, raw.F, F, A, b)
    C = raw.C  # checked by friction_conditions
    a = kkt_acceleration(M, F + C, A, b)
    in_play = np.abs(a).max() + np.abs(np.linalg.solve(M, F + C)).max()
    np.testing.assert_allclose(raw.a, a, rtol=0, atol=KKT * in_play)
    # The equation itself, and the identity of the multipliers.
    force = np.abs(M) @ np.abs(a) + np.abs(F) + np.abs(A.T) @ np.abs(raw.lam)
    assert (np.abs(M @ raw.a - F - C - A.T @ raw.lam) <= KKT * force.max()).all()
    split = raw.F_ideal + raw.F_nonideal - C
    assert (np.abs(A.T @ raw.lam - split) <= KKT * force.max()).all()
    # The paper's equation on the same arrays.
    oracle = pn.solve(M, F, A, b, C)
    for key in ("a", "F_ideal", "F_nonideal"):
        expected = getattr(oracle, key)
        scale = in_play if key == "a" else force.max()
        np.testing.assert_allclose(getattr(raw, key), expected, rtol=0, atol=KKT * scale)
    assert raw.rank == oracle.rank
    if not scene.dropped:
        most = np.abs(oracle.lam).max(initial=1.0)
        np.testing.assert_allclose(raw.lam, oracle.lam, rtol=0, atol=MULTIPLIERS * most)
    return raw
