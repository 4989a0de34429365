"""The loop a user of Pinocchio writes in C++: Boost.odeint over constraintDynamics or aba, compiled.

Of the two builds (instantiations of the wheel, and compiled anew from its headers) the one is taken whose
evaluation is faster.  Nothing is called from Python between start and end.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks import build_peers

from .base import Outcome, Setting, tolerances
from .pinocchio_scipy import anchors, proximal

MOST_EVALUATIONS = 1_000_000
# Evaluations that tell which build is faster.
TRIED = 2000
METHODS = (("fehlberg78", 13), ("dopri5", 9), ("bulirsch_stoer", 13))


class PinocchioOdeint:
    """Adaptive methods of Boost.odeint over Pinocchio's forward dynamics, compiled."""

    name = "pin+odeint"
    title = "Pinocchio + Boost.odeint (C++ loop)"

    def missing(self) -> str | None:
        """Why it cannot run here, or None."""
        if any(build_peers.load(name) for name in build_peers.NAMES):
            return None
        return "the C++ peers are not built (pin-nonideal bench build-peers)"

    def settings(self, problem: Any) -> list[Setting]:
        """Settings worth trying; none of problems with a floating base, springs, friction or a control."""
        stated = (problem.hold, problem.coulomb, problem.viscous)
        if problem.model.nq != problem.model.nv or problem.springs or any(s is not None for s in stated):
            return []
        return [
            Setting(method, f"rtol {rtol:.0e}", values={"rtol": rtol})
            for method, last in METHODS
            for rtol in tolerances(3, last)
        ]

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """A function that runs the problem once from its start."""
        peer = fastest(problem)
        nv, rtol = problem.model.nv, setting.values["rtol"]
        q0, v0 = np.array(problem.q0), np.array(problem.v0)
        tau = np.zeros(nv) if problem.torque is None else np.array(problem.torque)
        times = np.linspace(0.0, problem.duration, samples + 1)[1:]

        def run() -> Outcome:
            q, v = np.empty(samples * nv), np.empty(nv)
            count = peer.integrate(
                q0, v0, tau, times, setting.family, rtol, rtol, MOST_EVALUATIONS, q_out=q, v_out=v
            )
            if count < 0 or not np.isfinite(q).all():
                return Outcome(None, MOST_EVALUATIONS, failure="it does not end" if count < 0 else "diverged")
            return Outcome(q.reshape(samples, nv), count, v=v)

        return run


def fastest(problem: Any) -> Any:
    """The build whose evaluation is faster at the problem's start."""
    modules = [module for module in map(build_peers.load, build_peers.NAMES) if module is not None]
    peers = [m.Peer(problem.model, anchors(problem), proximal(problem).mu, 1) for m in modules]
    q, v = np.array(problem.q0), np.array(problem.v0)

    def seconds(peer: Any) -> float:
        if problem.anchors:
            return float(min(peer.time_constraint_dynamics(q, v, TRIED) for _ in range(3)))
        return float(min(peer.time_aba(q, v, TRIED, world=False) for _ in range(3)))

    return min(peers, key=seconds)
