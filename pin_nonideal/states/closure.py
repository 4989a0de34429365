"""Closing loops from far away: damped steps and many starts, before the core's Newton method takes over."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, Model

# A gap below this [m or rad] is left to Newton's method, which squares it each time.
CLOSED = 1e-9
# A gap that stays above this after projection [m or rad] is a loop that does not close.
CLOSURE_TOLERANCE = 1e-8
STEPS = 300  # damped steps a start
STARTS = 24  # first the given configuration, then random ones around it
SPREADS = (0.1, 0.3, 1.0)  # of the random starts [rad or m], in turn
# Closures with a worse conditioned mass matrix than this (gimbal lock) are kept only without a better one.
WELL_CONDITIONED = 1e-10


@np.errstate(over="ignore", invalid="ignore")
def close_loops(
    model: Model, rows: Callable[[Array], tuple[Array, Array]], mass: Callable[[Array], Array], q: Array
) -> tuple[Array, float]:
    """Configuration near q that satisfies the holonomic constraints.

    Levenberg-Marquardt steps dq = -A^T (A A^T + d^2 I)^-1 phi in tangent coordinates, each at most one radian
    or meter.  Among the closures found the first with a well conditioned mass matrix wins.

    Args:
        model: pinocchio.Model.
        rows: q -> (A, phi) of the holonomic rows, (m, nv) and (m,).
        mass: q -> M(q), (nv, nv).
        q: start, (nq,).

    Returns:
        The best configuration and its largest residual [m or rad].
    """
    generator = np.random.default_rng(0)  # the same closure every time
    best, best_gap = q, _gap(rows(q)[1])
    fallback: tuple[Array, float] | None = None
    for start in range(STARTS):
        spread = 0.0 if start == 0 else SPREADS[start % len(SPREADS)]
        begin = pin.integrate(model, q, spread * generator.standard_normal(model.nv)) if spread else q
        found, gap = _descend(model, rows, begin)
        if gap < CLOSED:
            if _conditioning(mass(found)) > WELL_CONDITIONED:
                return found, gap
            fallback = fallback or (found, gap)
        elif gap < best_gap:
            best, best_gap = found, gap
    return fallback or (best, best_gap)


def _descend(model: Model, rows: Callable[[Array], tuple[Array, Array]], q: Array) -> tuple[Array, float]:
    A, phi = rows(q)
    damping = 1e-3
    for _ in range(STEPS):
        gap = _gap(phi)
        if gap < 1e-13:
            break
        G = A @ A.T
        size = max(float(np.trace(G)) / len(G), 1e-300)
        step = -A.T @ np.linalg.solve(G + damping * size * np.eye(len(G)), phi)
        longest = float(np.abs(step).max(initial=0.0))
        if not np.isfinite(longest):
            break
        if longest > 1.0:
            step /= longest
        trial = pin.integrate(model, q, step)
        A_new, phi_new = rows(trial)
        if np.linalg.norm(phi_new) < np.linalg.norm(phi):
            q, A, phi = trial, A_new, phi_new
            damping = max(damping * 0.2, 1e-14)
            if longest < 1e-15:
                break
        else:
            damping *= 5.0
            if damping > 1e10:
                break
    return q, _gap(phi)


def _gap(phi: Array) -> float:
    return float(np.abs(phi).max(initial=0.0))


def _conditioning(M: Array) -> float:
    """Smallest over largest eigenvalue of M scaled to unit diagonal; 0 where M overflows."""
    if not np.isfinite(M).all():
        return 0.0
    diagonal = np.sqrt(np.maximum(np.diag(M), 1e-300))
    values = np.linalg.eigvalsh(M / np.outer(diagonal, diagonal))
    return float(values[0] / values[-1])
