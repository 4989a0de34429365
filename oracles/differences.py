"""Check of the core's rows by differences: A against d residual, b against d(A v)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pin_nonideal.states.rows import holonomic_rows

# Step and tolerance of fourth-order central differences.  Truncation is 1e-14 and rounding 1e-16 / 1e-3; the
# tolerance leaves a margin for the curvature of short levers.
STEP = 1e-3
DIFFERENCES = 1e-6
# Residual of a projected state, relative to the size of the rows.
MET = 1e-12
# Newton's method converges quadratically; singular values below this relative size are rounding.
NEWTON_STEPS = 12
HELD = 1e-9


def fourth_order(f):
    """Return the derivative of f at 0 by fourth-order central differences."""
    return (8.0 * (f(STEP) - f(-STEP)) - (f(2 * STEP) - f(-2 * STEP))) / (12.0 * STEP)


def consistent(scene, rng, t, speed=1.0):
    """Return a random state on the constraints, by Newton's method or else by the scene's projection."""
    model = scene.model
    near = pin.integrate(model, scene.q0, 0.1 * rng.standard_normal(model.nv))
    v = speed * rng.standard_normal(model.nv)
    state = None if any(contact_opens(c) for c in scene.contacts) else _on_rows(scene, near, v, t)
    return scene.project(near, v, t) if state is None else state


def contact_opens(contact):
    """Check if a contact can open."""
    return getattr(contact, "unilateral", True)


def _on_rows(scene, q, v, t):
    """Return a nearby state on the rows by Newton's method, or None if it does not converge."""
    runner, position = scene._compiled.program.runner(), holonomic_rows(scene._compiled.program)
    for _ in range(NEWTON_STEPS):
        A, _, phi, rate = rows_at(scene, runner, q, v, t)
        if np.abs(phi[position]).max(initial=0.0) < 0.1 * MET and np.abs(rate).max(initial=0.0) < MET:
            return q, v
        q = pin.integrate(scene.model, q, -np.linalg.lstsq(A[position], phi[position], rcond=HELD)[0])
        A, _, _, rate = rows_at(scene, runner, q, v, t)
        v = v - np.linalg.lstsq(A, rate, rcond=HELD)[0]
    return None


def rows_at(scene, runner, q, v, t):
    A, b, phi, rate = runner.rows(np.asarray(q), np.asarray(v), float(t))
    return A.reshape(-1, scene.model.nv), b, phi, rate


def assert_rows_match_differences(scene, q, v, t, a):
    model, runner = scene.model, scene._compiled.program.runner()
    A, b, phi, rate = rows_at(scene, runner, q, v, t)
    size = 1.0 + np.abs(A).max(initial=0.0)
    np.testing.assert_allclose(phi, 0.0, atol=MET * size)
    np.testing.assert_allclose(rate, 0.0, atol=10 * MET * size)

    def moved(s, w, c=0.0):
        return pin.integrate(model, q, s * w + 0.5 * s * s * c)

    # A: the rates of the rows are linear in v with the matrix A.
    for k, e in enumerate(np.eye(model.nv)):
        column = rows_at(scene, runner, q, v + e, t)[3] - rows_at(scene, runner, q, v, t)[3]
        np.testing.assert_allclose(column, A[:, k], atol=DIFFERENCES * size)
    # Residual: its time derivative is the rate, along any motion; rows without a residual keep zero.
    w = np.linspace(-1.0, 1.0, model.nv)
    there = rows_at(scene, runner, q, w, t)[3]
    change = fourth_order(lambda s: rows_at(scene, runner, moved(s, w), w, t + s)[2])
    position = holonomic_rows(scene._compiled.program)
    scale = size + np.abs(there).max(initial=0.0)
    np.testing.assert_allclose(change[position], there[position], atol=DIFFERENCES * scale)
    np.testing.assert_array_equal(change[~position], 0.0)
    # b: d rate/dt = A a - b along a motion with velocity v and acceleration a.
    change = fourth_order(lambda s: rows_at(scene, runner, moved(s, v, a), v + s * a, t + s)[3])
    scale = size * (1.0 + np.abs(a).max()) + np.abs(b).max(initial=0.0)
    np.testing.assert_allclose(change, A @ a - b, atol=DIFFERENCES * scale)
