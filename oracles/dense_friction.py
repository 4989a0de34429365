"""Constant Coulomb friction on the dense reference: smooth between events, modes by enumeration."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from .dense import DenseScene
from .modes import combinations

Array = NDArray[np.float64]

AT_REST = 1e-9  # velocity below which a joint is at rest at an event [rad/s]
MOST_EVENTS = 500


class Friction:
    """Tree of one-axis joints in stick-slip modes: slipping (+1, -1) or sticking (0)."""

    def __init__(self, dense: DenseScene, coulomb: Array, viscous: Array) -> None:
        self.dense, self.coulomb, self.viscous = dense, coulomb, viscous
        self.mode = np.zeros(dense.nv)
        dense.laws = lambda t, q, v: -coulomb * self.mode - viscous * v

    def held(self) -> list[int]:
        """Return the sticking joints."""
        return [int(j) for j in np.flatnonzero(self.mode == 0.0)]

    def solve(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the acceleration, and the friction force of each sticking joint."""
        return self.dense.acceleration(t, q, v, self.held())

    def choose(self, t: float, q: Array, v: Array) -> None:
        """Select modes of the joints at rest that are consistent with their limits and accelerations."""
        resting = np.abs(v) <= AT_REST
        for modes in combinations(v, AT_REST):
            self.mode = np.array(modes, dtype=float)
            a, force = self.solve(t, q, v)
            holds = all(abs(f) <= self.coulomb[j] for f, j in zip(force, self.held(), strict=True))
            if holds and (self.mode * a > 0.0)[resting & (self.mode != 0.0)].all():
                return
        raise RuntimeError(f"no modes fit at t = {t}")


def friction_motion(dense: DenseScene, problem: Any, max_step: float) -> Array:
    """Return the configurations at the problem's sample times, (k, nq).

    Args:
        dense: mechanics of the problem without friction.
        problem: initial state, friction and sample times.
        max_step: maximum step of the integrator [s]; it bounds the error of event location.
    """
    friction = Friction(dense, problem.coulomb, problem.viscous)
    t, q, v = 0.0, problem.q0.copy(), problem.v0.copy()
    nv = dense.nv
    friction.choose(t, q, v)
    found: list[Array] = []
    times = problem.times
    for _ in range(MOST_EVENTS):
        sliding, held = [int(j) for j in np.flatnonzero(friction.mode)], friction.held()

        def rate(time: float, y: Array) -> Array:
            a, _ = friction.solve(time, y[:nv], y[nv:])
            return np.concatenate([y[nv:], a])

        def stops(time: float, y: Array, j: int) -> float:
            return float(y[nv + j] * friction.mode[j])

        def slips(time: float, y: Array, k: int, held: list[int] = held) -> float:
            return float(friction.coulomb[held[k]] - abs(friction.solve(time, y[:nv], y[nv:])[1][k]))

        events: list[Any] = [lambda time, y, j=j: stops(time, y, j) for j in sliding]
        events += [lambda time, y, k=k: slips(time, y, k) for k in range(len(held))]
        for event in events:
            event.terminal, event.direction = True, -1.0
        out = solve_ivp(
            rate, (t, times[len(found)]), np.concatenate([q, v]), method="DOP853", rtol=1e-13, atol=1e-14,
            events=events, max_step=max_step,
        )  # fmt: skip
        t, q, v = float(out.t[-1]), out.y[:nv, -1], out.y[nv:, -1].copy()
        v[held] = 0.0
        if out.status == 0:
            found.append(q)
            if len(found) == len(times):
                return np.array(found)
            continue
        which = next(k for k, times in enumerate(out.t_events) if len(times))
        if which < len(sliding):
            v[sliding[which]] = 0.0
            friction.choose(t, q, v)
        else:  # a joint at its limit slips against its friction force
            k = which - len(sliding)
            force = friction.solve(t, q, v)[1][k]
            friction.mode[held[k]] = -np.sign(force)
    raise RuntimeError(f"more than {MOST_EVENTS} events")
