"""States on the constraints: the core's Newton method nearby, damped steps and many starts from far away."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.analysis import rows_at
from pin_nonideal.compilation.program import Lowered
from pin_nonideal.constraints import KnifeEdge, Rolling, UserConstraint
from pin_nonideal.core import load_core
from pin_nonideal.errors import InconsistentConstraintsError, LoopClosureError

from .closure import CLOSURE_TOLERANCE, close_loops

core = load_core()

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

# A larger gap than this [m or rad] is closed by damped steps before Newton's method has its turn.
FAR = 1e-3
# Rows that no velocity meets better than this part of 1 + |v| contradict each other.
RATE_TOLERANCE = 1e-6


def nonholonomic_rows(constraints: Sequence[Any], low: Lowered) -> Rows:
    """Which rows restrict the velocity only, so that no position can be projected on them, (m,).

    Args:
        constraints: descriptions of all constraints.
        low: the program.
    """
    rows = np.zeros(low.rows, dtype=bool)
    for s, c in zip(low.slices.values(), constraints, strict=False):
        if isinstance(c, KnifeEdge) or (isinstance(c, UserConstraint) and c.residual is None):
            rows[s] = True
        elif isinstance(c, Rolling):
            rows[s.start : s.start + 2] = True
    return rows


def nearest_state(
    model: Any, low: Lowered, nonholonomic: Rows, q: Array, v: Array, t: float
) -> tuple[Array, Array]:
    """Nearest state with phi(q, t) = 0 and A v + phi_t = 0.

    Args:
        model: pinocchio.Model.
        low: the program.
        nonholonomic: rows that restrict the velocity only, (m,).
        q: configuration, (nq,).
        v: velocity, (nv,).
        t: time [s].

    Returns:
        q (nq,), v (nv,).

    Raises:
        LoopClosureError: no configuration satisfies the constraints.
        InconsistentConstraintsError: no velocity does.
    """
    if not low.slices:
        return q, v
    runner = low.builder.runner()
    on, v_on, before, after, rate = runner.project(q, v, t, FAR)
    if not after <= CLOSURE_TOLERANCE:
        rows, mass = _holonomic(model, runner, nonholonomic, t), _mass(model, runner)
        q, _ = close_loops(model, rows, mass, q)
        on, v_on, before, after, rate = runner.project(q, v, t, np.inf)
    if not after <= CLOSURE_TOLERANCE:
        raise _open_loops(rows_at(runner, on if after < before else q, v_on, t)[2], low, t)
    if not rate <= RATE_TOLERANCE * (1.0 + _largest(v_on)):
        raise _lost_velocity(rows_at(runner, on, v_on, t)[3], low, t)
    return on, v_on


def nearest_states(
    model: Any, low: Lowered, nonholonomic: Rows, q: Array, v: Array, t: float, threads: int
) -> tuple[Array, Array]:
    """The `nearest_state` of each of many, taken on several threads as long as Newton's method suffices.

    Args:
        model: pinocchio.Model.
        low: the program.
        nonholonomic: rows that restrict the velocity only, (m,).
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        t: time [s].
        threads: number of native threads.

    Returns:
        q (n, nq), v (n, nv).

    Raises:
        LoopClosureError: no configuration satisfies the constraints.
        InconsistentConstraintsError: no velocity does.
    """
    if not low.slices:
        return q, v
    found_q, found_v, after, rate = core.nearest_states(low.builder, q, v, t, FAR, threads)
    on, v_on = found_q.reshape(q.shape), found_v.reshape(v.shape)
    closed = after <= CLOSURE_TOLERANCE
    met = rate <= RATE_TOLERANCE * (1.0 + np.abs(v_on).max(axis=1, initial=0.0))
    for i in np.flatnonzero(~(closed & met)):
        on[i], v_on[i] = nearest_state(model, low, nonholonomic, q[i], v[i], t)
    return on, v_on


def _open_loops(phi: Array, low: Lowered, t: float) -> LoopClosureError:
    gaps = {name: _largest(phi[s]) for name, s in low.slices.items()}
    open_loops = {name: gap for name, gap in gaps.items() if not gap <= CLOSURE_TOLERANCE}
    text = "; ".join(f'loop "{name}" does not close: gap {gap:.2g}' for name, gap in open_loops.items())
    return LoopClosureError(
        f"{text} after several starts; check the lengths and frames, or start nearer", gaps=gaps, time=t
    )


def _lost_velocity(rate: Array, low: Lowered, t: float) -> InconsistentConstraintsError:
    worst = max(low.slices, key=lambda name: float(np.abs(rate[low.slices[name]]).max()))
    return InconsistentConstraintsError(
        f'no velocity satisfies the constraints at t = {t:.2f} s: "{worst}" misses its rate by '
        f"{_largest(rate):.1e}",
        time=t,
    )


def _holonomic(
    model: Any, runner: Any, nonholonomic: Rows, t: float
) -> Callable[[Array], tuple[Array, Array]]:
    """The function q -> (A, phi), with the rows that restrict the velocity only set to zero."""
    zero = np.zeros(model.nv)

    def rows(q: Array) -> tuple[Array, Array]:
        A, _, phi, _ = rows_at(runner, q, zero, t)
        A[nonholonomic] = 0.0
        return A, phi

    return rows


def _mass(model: Any, runner: Any) -> Callable[[Array], Array]:
    """Mass matrix at a configuration, q -> M, (nv, nv)."""
    n, zero = model.nv, np.zeros(model.nv)
    return lambda q: np.asarray(runner.terms(q, zero)[0]).reshape(n, n)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
