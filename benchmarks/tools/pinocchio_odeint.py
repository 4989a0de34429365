"""Compiled C++ loop around Pinocchio: Boost.odeint with constraintDynamics or aba.

The tool selects the faster of two builds: with the instantiations of the wheel, or compiled from its headers.
No Python code runs between start and end.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks import build_peers

from .base import Outcome, Setting, tolerances
from .pinocchio_scipy import anchors, proximal

MAX_EVALUATIONS = 1_000_000
# Number of evaluations for the selection of the build.
TRIED = 2000
METHODS = (("fehlberg78", 13), ("dopri5", 9), ("bulirsch_stoer", 13))


class PinocchioOdeint:
    """Adaptive methods of Boost.odeint over Pinocchio's forward dynamics, compiled."""

    name = "pin+odeint"
    title = "Pinocchio + Boost.odeint (C++ loop)"

    def missing(self) -> str | None:
        """Return the reason why the tool cannot run, or None."""
        if any(build_peers.load(name) for name in build_peers.NAMES):
            return None
        return "the C++ peers are not built (pin-nonideal bench build-peers)"

    def settings(self, problem: Any) -> list[Setting]:
        """Return the settings to try; empty with a floating base, springs, friction or position control."""
        stated = (problem.hold, problem.coulomb, problem.viscous)
        if problem.model.nq != problem.model.nv or problem.springs or any(s is not None for s in stated):
            return []
        return [
            Setting(method, f"rtol {rtol:.0e}", values={"rtol": rtol})
            for method, last in METHODS
            for rtol in tolerances(3, last)
        ]

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """Return a function that runs the problem once from its start."""
        peer = fastest(problem)
        nv, rtol = problem.model.nv, setting.values["rtol"]
        q0, v0 = np.array(problem.q0), np.array(problem.v0)
        tau = np.zeros(nv) if problem.torque is None else np.array(problem.torque)
        times = np.linspace(0.0, problem.duration, samples + 1)[1:]

        def run() -> Outcome:
            q, v = np.empty(samples * nv), np.empty(nv)
            count = peer.integrate(
                q0, v0, tau, times, setting.family, rtol, rtol, MAX_EVALUATIONS, q_out=q, v_out=v
            )
            if count < 0 or not np.isfinite(q).all():
                return Outcome(None, MAX_EVALUATIONS, failure="it does not end" if count < 0 else "diverged")
            return Outcome(q.reshape(samples, nv), count, v=v)

        return run


def fastest(problem: Any) -> Any:
    """Return the build with the faster evaluation at the problem's initial state."""
    modules = [module for module in map(build_peers.load, build_peers.NAMES) if module is not None]
    peers = [m.Peer(problem.model, anchors(problem), proximal(problem).mu, 1) for m in modules]
    q, v = np.array(problem.q0), np.array(problem.v0)

    def seconds(peer: Any) -> float:
        if problem.anchors:
            return float(min(peer.time_constraint_dynamics(q, v, TRIED) for _ in range(3)))
        return float(min(peer.time_aba(q, v, TRIED, world=False) for _ in range(3)))

    return min(peers, key=seconds)
