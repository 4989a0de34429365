"""States on the constraints: the core's Newton method nearby, damped steps and many starts from far away."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pin_nonideal.core import core
from pin_nonideal.errors import InconsistentConstraintsError, LoopClosureError
from pin_nonideal.types import Array, Model

from .closure import CLOSURE_TOLERANCE, close_loops
from .rows import holonomic_rows, row_slices, rows_at

# A larger gap than this [m or rad] is closed by damped steps before Newton's method has its turn.
FAR = 1e-3
# Rows that no velocity meets better than this part of 1 + |v| contradict each other.
RATE_TOLERANCE = 1e-6


def nearest_state(model: Model, program: core.Program, q: Array, v: Array, t: float) -> tuple[Array, Array]:
    """Nearest state with phi(q, t) = 0 and A v + phi_t = 0.

    Args:
        model: pinocchio.Model.
        program: the scene as the core knows it.
        q: configuration, (nq,).
        v: velocity, (nv,).
        t: time [s].

    Returns:
        q (nq,), v (nv,).

    Raises:
        LoopClosureError: no configuration satisfies the constraints.
        InconsistentConstraintsError: no velocity does.
    """
    if not program.rows:
        return q, v
    runner = program.runner()
    on, v_on, before, after, rate = runner.project(q, v, t, FAR)
    if not after <= CLOSURE_TOLERANCE:
        rows, mass = _holonomic_rows(program, runner, model.nv, t), _mass(model, runner)
        q, _ = close_loops(model, rows, mass, q)
        on, v_on, before, after, rate = runner.project(q, v, t, np.inf)
    if not after <= CLOSURE_TOLERANCE:
        raise _open_loops(rows_at(runner, on if after < before else q, v_on, t)[2], program, t)
    if not rate <= RATE_TOLERANCE * (1.0 + _largest(v_on)):
        raise _lost_velocity(rows_at(runner, on, v_on, t)[3], program, t)
    return on, v_on


def nearest_closure(
    model: Model, program: core.Program, runner: core.Runner, q: Array, enough: float
) -> tuple[Array, float]:
    """The configuration near q with the smallest gaps that are found, whether closed or not.

    Args:
        model: pinocchio.Model.
        program: the scene as the core knows it.
        runner: a workspace of it.
        q: configuration, (nq,).
        enough: gap that needs no search from farther away [m or rad].

    Returns:
        The configuration, (nq,), and its largest gap [m or rad].
    """
    zero = np.zeros(model.nv)
    try:
        on, _, before, after, _ = runner.project(q, zero, 0.0, FAR)
    except core.CoreFailure:
        before = after = np.inf
    if min(before, after) > enough:
        on, after = close_loops(
            model, _holonomic_rows(program, runner, model.nv, 0.0), _mass(model, runner), q
        )
        before = np.inf
    return (on, after) if after <= before else (q, before)


def nearest_states(
    model: Model, program: core.Program, q: Array, v: Array, t: float, threads: int
) -> tuple[Array, Array]:
    """The `nearest_state` of each of many, taken on several threads as long as Newton's method suffices.

    Args:
        model: pinocchio.Model.
        program: the scene as the core knows it.
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
    if not program.rows:
        return q, v
    found_q, found_v, after, rate = core.nearest_states(program, q, v, t=t, far=FAR, threads=threads)
    on, v_on = found_q.reshape(q.shape), found_v.reshape(v.shape)
    closed = after <= CLOSURE_TOLERANCE
    met = rate <= RATE_TOLERANCE * (1.0 + np.abs(v_on).max(axis=1, initial=0.0))
    for i in np.flatnonzero(~(closed & met)):
        on[i], v_on[i] = nearest_state(model, program, q[i], v[i], t)
    return on, v_on


def _open_loops(phi: Array, program: core.Program, t: float) -> LoopClosureError:
    gaps = {name: _largest(phi[s]) for name, s in row_slices(program).items()}
    open_loops = {name: gap for name, gap in gaps.items() if not gap <= CLOSURE_TOLERANCE}
    text = "; ".join(f'loop "{name}" does not close: gap {gap:.2g}' for name, gap in open_loops.items())
    return LoopClosureError(
        f"{text} after several starts; check the lengths and frames, or start nearer", gaps=gaps, time=t
    )


def _lost_velocity(rate: Array, program: core.Program, t: float) -> InconsistentConstraintsError:
    slices = row_slices(program)
    worst = max(slices, key=lambda name: float(np.abs(rate[slices[name]]).max()))
    return InconsistentConstraintsError(
        f'no velocity satisfies the constraints at t = {t:.2f} s: "{worst}" misses its rate by '
        f"{_largest(rate):.1e}",
        time=t,
    )


def _holonomic_rows(
    program: core.Program, runner: core.Runner, nv: int, t: float
) -> Callable[[Array], tuple[Array, Array]]:
    """The function q -> (A, phi), with the rows that restrict the velocity only set to zero."""
    zero, holonomic = np.zeros(nv), holonomic_rows(program)

    def rows(q: Array) -> tuple[Array, Array]:
        A, _, phi, _ = rows_at(runner, q, zero, t)
        A[~holonomic] = 0.0
        return A, phi

    return rows


def _mass(model: Model, runner: core.Runner) -> Callable[[Array], Array]:
    """Mass matrix at a configuration, q -> M, (nv, nv)."""
    n, zero = model.nv, np.zeros(model.nv)
    return lambda q: runner.terms(q, zero)[0].reshape(n, n)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
