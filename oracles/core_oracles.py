"""What the core's rows and solutions are compared with: differences, dense KKT matrices, the paper's form."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

# Central differences of fourth order at this step: truncation 1e-14, rounding 1e-16 / 1e-3; with a margin for
# the curvature of short levers.
STEP = 1e-3
DIFFERENCES = 1e-6
# Rows of a state that was projected are met to rounding.
MET = 1e-12
# One dense factorization of a KKT matrix of condition 1e4; multipliers carry its square.
KKT = 1e-10
MULTIPLIERS = 1e-8


def fourth_order(f):
    """Derivative of f at 0."""
    return (8.0 * (f(STEP) - f(-STEP)) - (f(2 * STEP) - f(-2 * STEP))) / (12.0 * STEP)


def consistent(scene, rng, t, speed=1.0):
    """A random state of the scene on its constraints."""
    q = pin.integrate(scene.model, scene.initial_state()[0], 0.1 * rng.standard_normal(scene.model.nv))
    return scene.project(q, speed * rng.standard_normal(scene.model.nv), t)


def rows_at(scene, runner, q, v, t):
    A, b, phi, rate = runner.rows(np.asarray(q), np.asarray(v), float(t))
    return A.reshape(-1, scene.model.nv), b, phi, rate


def assert_rows_match_differences(scene, q, v, t, a):
    model, runner = scene.model, scene.new_runner()
    A, b, phi, rate = rows_at(scene, runner, q, v, t)
    size = 1.0 + np.abs(A).max(initial=0.0)
    np.testing.assert_allclose(phi, 0.0, atol=MET * size)
    np.testing.assert_allclose(rate, 0.0, atol=10 * MET * size)

    def moved(s, w, c=0.0):
        return pin.integrate(model, q, s * w + 0.5 * s * s * c)

    # A: every row's rate is linear in v with A as its matrix.
    for k, e in enumerate(np.eye(model.nv)):
        column = rows_at(scene, runner, q, v + e, t)[3] - rows_at(scene, runner, q, v, t)[3]
        np.testing.assert_allclose(column, A[:, k], atol=DIFFERENCES * size)
    # Residual: it changes at the rate, along any motion; rows without a residual stay at zero.
    w = np.linspace(-1.0, 1.0, model.nv)
    there = rows_at(scene, runner, q, w, t)[3]
    change = fourth_order(lambda s: rows_at(scene, runner, moved(s, w), w, t + s)[2])
    position = ~np.asarray(scene._nonholonomic())
    scale = size + np.abs(there).max(initial=0.0)
    np.testing.assert_allclose(change[position], there[position], atol=DIFFERENCES * scale)
    np.testing.assert_array_equal(change[~position], 0.0)
    # b: d rate/dt = A a - b along a motion with velocity v and acceleration a.
    change = fourth_order(lambda s: rows_at(scene, runner, moved(s, v, a), v + s * a, t + s)[3])
    scale = size * (1.0 + np.abs(a).max()) + np.abs(b).max(initial=0.0)
    np.testing.assert_allclose(change, A @ a - b, atol=DIFFERENCES * scale)


def dense(scene, q, v, t, modes=None):
    """M and F from Pinocchio (F with the scene's forces), A and b from the core."""
    model, data = scene.model, scene.model.createData()
    M = pin.crba(model, data, q, pin.Convention.WORLD)
    M = np.triu(M) + np.triu(M, 1).T
    bias = pin.nonLinearEffects(model, data, q, v)
    raw = scene.new_runner().solve(q, v, t, None, modes)
    given = raw["F"] + bias  # torques and forces, tested on their own
    A, b, _, _ = rows_at(scene, scene.new_runner(), q, v, t)
    return M, given - bias, A, b, raw


def kkt_acceleration(M, force, A, b):
    """a of the dense system [M -A^T; A 0] (a, lam) = (force, b), independent rows, refined in long double."""
    from scipy.linalg import qr

    n = len(M)
    d = 1.0 / np.sqrt(np.diag(M))  # units that make rows and columns alike
    A, b = A * d, b.copy()
    length = np.linalg.norm(A, axis=1)
    long = length > 1e-9 * length.max(initial=0.0)  # others vanish, up to the rounding of the kinematics
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
    """Acceleration, split of the forces, multipliers and rank; returns the core's answer."""
    M, F, A, b, raw = dense(scene, q, v, t, modes)
    C = raw["C"]
    a = kkt_acceleration(M, F + C, A, b)
    in_play = np.abs(a).max() + np.abs(np.linalg.solve(M, F + C)).max()
    np.testing.assert_allclose(raw["a"], a, rtol=0, atol=KKT * in_play)
    # The equation itself, and the identity of the multipliers.
    force = np.abs(M) @ np.abs(a) + np.abs(F) + np.abs(A.T) @ np.abs(raw["lam"])
    assert (np.abs(M @ raw["a"] - F - C - A.T @ raw["lam"]) <= KKT * force.max()).all()
    split = raw["F_ideal"] + raw["F_nonideal"] - C
    assert (np.abs(A.T @ raw["lam"] - split) <= KKT * force.max()).all()
    # The paper's equation on the same arrays.
    oracle = pn.solve(M, F, A, b, C)
    for key in ("a", "F_ideal", "F_nonideal"):
        expected = getattr(oracle, key)
        scale = in_play if key == "a" else force.max()
        np.testing.assert_allclose(raw[key], expected, rtol=0, atol=KKT * scale)
    assert raw["rank"] == oracle.rank
    if not scene.dropped:
        most = np.abs(oracle.lam).max(initial=1.0)
        np.testing.assert_allclose(raw["lam"], oracle.lam, rtol=0, atol=MULTIPLIERS * most)
    return raw
