"""Search for the nearest configuration that satisfies the constraints without penetration.

The problem is min d^T M(q0) d / 2 over phi(q) = 0 and gap(q) >= 0. Steps of sequential quadratic programming
determine the active gaps. With active gaps held as rows, Newton's method of `loop_closure` finds the nearest
closure. The signs of the gap multipliers and the other gaps confirm it.

[Nocedal, Wright: Numerical Optimization, 2006, ch. 18.]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pin_nonideal.types import Array

from .least_distance import LeastDistance, Numbers, solve_ldp
from .loop_closure import HALVINGS, ROUNDING, Closure, Iterate, Rows, Search

STEPS, MAX_SETTLINGS, OPENINGS = 60, 8, 15
# Steps end if the next step is shorter than this fraction of the displacement, since Newton's method squares
# it.
MIN_STEP = 1e-7
# Largest penetration, scaled like its row, that counts as rounding error.
PENETRATION_ROUNDING = 10.0 * ROUNDING
# Minimum decrease of the merit function, relative to the decrease of its linear model.
MIN_DECREASE = 1e-4


class UnilateralClosure(Search):
    """Search for closures around a configuration without penetration.

    Args:
        gaps: q -> (G, gap) of the unilateral contacts divided by their row scales, (k, nv) and (k,).
        arguments: arguments of `Search`.
    """

    def __init__(self, gaps: Rows, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.loops, self.gaps = self.rows, gaps

    def _hold(self, touching: Numbers) -> None:
        """Add the rows of active gaps to the rows of the loops."""

        def rows(q: Array) -> tuple[Array, Array]:
            (A, phi), (G, gap) = self.loops(q), self.gaps(q)
            return np.vstack([A, G[touching]]), np.concatenate([phi, gap[touching]])

        self.rows = rows if len(touching) else self.loops

    def _close(self, q: Array) -> Iterate:
        """Close the loops and remove penetration; the result may still penetrate if the search fails."""
        self._hold(np.zeros(0, dtype=int))
        return self._step_out(super()._close(q))

    def _is_closed(self, iterate: Iterate) -> bool:
        """Check if all rows are satisfied and no contact penetrates."""
        return super()._is_closed(iterate) and self._depth(iterate) <= PENETRATION_ROUNDING

    def _settle(self, iterate: Iterate, limit: float) -> Closure:
        """Descend to a local minimum of the distance, with an update of the active gaps."""
        known = iterate
        for _ in range(MAX_SETTLINGS):
            self._hold(np.zeros(0, dtype=int))
            free_iterate = self._place(iterate.q)
            move = self._least(free_iterate, free_iterate.move)
            if move is None:
                break
            self._hold(move.touching)
            start = self._retract(iterate.q)
            if start is None:
                break
            closure = super()._settle(start, np.inf)
            self._hold(np.zeros(0, dtype=int))
            iterate = self._place(closure.q)
            outside, further = (
                self._depth(iterate) <= PENETRATION_ROUNDING,
                self._least(iterate, iterate.move),
            )
            if outside:
                known = iterate
            rounding = MIN_STEP * self._distance(iterate) + ROUNDING * self.size
            if outside and further is not None and np.linalg.norm(further.x) <= rounding:
                return closure
            iterate = self._step_out(iterate)
        return Closure(known.q, known.gap, self._distance(known), False, self.iterations)

    def _gaps(self, iterate: Iterate) -> tuple[Array, Array]:
        """Return rows and values of the gaps, in coordinates x in which |x| is the distance."""
        G, gap = self.gaps(iterate.q)
        return np.linalg.solve(iterate.dx_dq.T, G.T).T, gap

    def _least(self, iterate: Iterate, move: Array) -> LeastDistance | None:
        return solve_ldp(iterate.B, iterate.phi, *self._gaps(iterate), move)

    def _step_out(self, iterate: Iterate) -> Iterate:
        """Step to the nearest configuration without penetration, with a line search on a merit function."""
        weight = 0.0
        for _ in range(STEPS):
            step = self._least(iterate, iterate.move)
            if step is None:
                break
            length = float(np.linalg.norm(step.x))
            if length <= MIN_STEP * self._distance(iterate) + ROUNDING * self.size:
                break
            self.iterations += 1
            weight = max(weight, 2.0 * step.pull)
            before, slope = self._merit(iterate, weight), self._slope_of_merit(iterate, step.x, weight)
            for k in range(HALVINGS):
                trial = self._place(self._displace(iterate, step.x, 0.5**k))
                if self._merit(trial, weight) <= before + MIN_DECREASE * 0.5**k * slope:
                    break
            else:
                break
            iterate = trial
        return self._open(iterate)

    def _open(self, iterate: Iterate) -> Iterate:
        """Remove remaining residuals and penetration by least displacements."""
        for _ in range(OPENINGS):
            lacking = self._lacking(iterate)
            step = self._least(iterate, np.zeros_like(iterate.move)) if lacking > 0.0 else None
            if step is None:
                break
            trial = self._place(self._displace(iterate, step.x))
            if not self._lacking(trial) < lacking:
                break
            iterate = trial
        return iterate

    def _depth(self, iterate: Iterate) -> float:
        """Return the largest penetration."""
        return -float(self._gaps(iterate)[1].min(initial=0.0))

    def _lacking(self, iterate: Iterate) -> float:
        """Return the largest residual or penetration."""
        return max(iterate.gap, self._depth(iterate))

    def _missed(self, iterate: Iterate) -> float:
        """Return the sum of all residuals and penetrations."""
        gap = self._gaps(iterate)[1]
        return float(np.abs(iterate.phi).sum() - np.minimum(gap, 0.0).sum())

    def _merit(self, iterate: Iterate, weight: float) -> float:
        return 0.5 * float(iterate.move @ iterate.move) + weight * self._missed(iterate)

    def _slope_of_merit(self, iterate: Iterate, x: Array, weight: float) -> float:
        """Return the derivative of the merit along x, which satisfies all linearized rows."""
        return float(iterate.move @ x) - weight * self._missed(iterate)
