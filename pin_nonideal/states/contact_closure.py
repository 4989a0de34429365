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

from .least_distance import LeastMove, Numbers, least_move
from .loop_closure import HALVINGS, ROUNDING, Closure, Place, Rows, Search

STEPS, SETTLINGS, OPENINGS = 60, 8, 15
# Steps end if the next step is shorter than this part of the displacement, since Newton's method squares it.
SHORT = 1e-7
# Largest penetration, scaled like its row, that counts as rounding.
INSIDE = 10.0 * ROUNDING
# Minimum decrease of the merit function, relative to the decrease of its linear model.
KEPT = 1e-4


class SearchOutside(Search):
    """Search for closures around a configuration without penetration.

    Args:
        gaps: q -> (G, gap) of the unilateral contacts over their row scales, (k, nv) and (k,).
        given: arguments of `Search`.
    """

    def __init__(self, gaps: Rows, *given: Any) -> None:
        super().__init__(*given)
        self.loops, self.gaps = self.rows, gaps

    def _hold(self, touching: Numbers) -> None:
        """Add the rows of active gaps to the rows of the loops."""

        def rows(q: Array) -> tuple[Array, Array]:
            (A, phi), (G, gap) = self.loops(q), self.gaps(q)
            return np.vstack([A, G[touching]]), np.concatenate([phi, gap[touching]])

        self.rows = rows if len(touching) else self.loops

    def _close(self, q: Array) -> Place:
        """Close the loops and remove penetration; the result may still penetrate if the search fails."""
        self._hold(np.zeros(0, dtype=int))
        return self._step_out(super()._close(q))

    def _is_closed(self, place: Place) -> bool:
        """Check if all rows are satisfied and no contact penetrates."""
        return super()._is_closed(place) and self._depth(place) <= INSIDE

    def _settle(self, place: Place) -> Closure:
        """Descend to a local minimum of the distance, with an update of the active gaps."""
        known = place
        for _ in range(SETTLINGS):
            self._hold(np.zeros(0, dtype=int))
            bare = self._place(place.q)
            found = self._least(bare, bare.move)
            if found is None:
                break
            self._hold(found.touching)
            start = self._retract(place.q)
            if start is None:
                break
            closure = super()._settle(start)
            self._hold(np.zeros(0, dtype=int))
            place = self._place(closure.q)
            outside, further = self._depth(place) <= INSIDE, self._least(place, place.move)
            if outside:
                known = place
            rounding = SHORT * self._distance(place) + ROUNDING * self.size
            if outside and further is not None and np.linalg.norm(further.x) <= rounding:
                return closure
            place = self._step_out(place)
        return Closure(known.q, known.gap, self._distance(known), False, self.iterations)

    def _gaps(self, place: Place) -> tuple[Array, Array]:
        """Return rows and values of the gaps, in coordinates x in which |x| is the distance."""
        G, gap = self.gaps(place.q)
        return np.linalg.solve(place.half.T, G.T).T, gap

    def _least(self, place: Place, move: Array) -> LeastMove | None:
        return least_move(place.B, place.phi, *self._gaps(place), move)

    def _step_out(self, place: Place) -> Place:
        """Take steps to the nearest configuration without penetration, with a line search on the merit."""
        weight = 0.0
        for _ in range(STEPS):
            step = self._least(place, place.move)
            if step is None:
                break
            length = float(np.linalg.norm(step.x))
            if length <= SHORT * self._distance(place) + ROUNDING * self.size:
                break
            self.iterations += 1
            weight = max(weight, 2.0 * step.pull)
            before, slope = self._merit(place, weight), self._slope_of_merit(place, step.x, weight)
            for k in range(HALVINGS):
                trial = self._place(self._go(place, step.x, 0.5**k))
                if self._merit(trial, weight) <= before + KEPT * 0.5**k * slope:
                    break
            else:
                break
            place = trial
        return self._open(place)

    def _open(self, place: Place) -> Place:
        """Remove remaining residuals and penetration by least displacements."""
        for _ in range(OPENINGS):
            lacking = self._lacking(place)
            step = self._least(place, np.zeros_like(place.move)) if lacking > 0.0 else None
            if step is None:
                break
            trial = self._place(self._go(place, step.x))
            if not self._lacking(trial) < lacking:
                break
            place = trial
        return place

    def _depth(self, place: Place) -> float:
        """Return the largest penetration."""
        return -float(self._gaps(place)[1].min(initial=0.0))

    def _lacking(self, place: Place) -> float:
        """Return the largest residual or penetration."""
        return max(place.gap, self._depth(place))

    def _missed(self, place: Place) -> float:
        """Return the sum of all residuals and penetrations."""
        gap = self._gaps(place)[1]
        return float(np.abs(place.phi).sum() - np.minimum(gap, 0.0).sum())

    def _merit(self, place: Place, weight: float) -> float:
        return 0.5 * float(place.move @ place.move) + weight * self._missed(place)

    def _slope_of_merit(self, place: Place, x: Array, weight: float) -> float:
        """Return the derivative of the merit along x, which satisfies all linearized rows."""
        return float(place.move @ x) - weight * self._missed(place)
