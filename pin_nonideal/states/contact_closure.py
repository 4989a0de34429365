"""The closure nearest to a configuration among those in which no contact is inside its plane.

min d^T M(q0) d / 2 over phi(q) = 0 and gap(q) >= 0: steps of sequential quadratic programming tell which
gaps are touched; with these held like rows Newton's method of `closure` finds the nearest place, which the
signs of their multipliers and the other gaps confirm.

[Nocedal, Wright: Numerical Optimization, 2006, ch. 18.]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pin_nonideal.types import Array

from .least_distance import LeastMove, Numbers, least_move
from .loop_closure import HALVINGS, ROUNDING, Closure, Place, Rows, Search

STEPS, SETTLINGS, OPENINGS = 60, 8, 15
# Steps are over where the next is shorter than this part of the move: Newton's method squares it.
SHORT = 1e-7
# A gap that is negative by more than this part of its reach is inside.
INSIDE = 10.0 * ROUNDING
# Of what the linear model promises, the part that a step must keep.
KEPT = 1e-4


class SearchOutside(Search):
    """Closures around a configuration with all gaps open or touching.

    Args:
        gaps: q -> (G, gap) of the contacts that may open over their reach, (k, nv) and (k,).
        given: what `Search` takes.
    """

    def __init__(self, gaps: Rows, *given: Any) -> None:
        super().__init__(*given)
        self.loops, self.gaps = self.rows, gaps

    def _hold(self, touching: Numbers) -> None:
        """Takes the rows of some gaps among those that are held."""

        def rows(q: Array) -> tuple[Array, Array]:
            (A, phi), (G, gap) = self.loops(q), self.gaps(q)
            return np.vstack([A, G[touching]]), np.concatenate([phi, gap[touching]])

        self.rows = rows if len(touching) else self.loops

    def _close(self, q: Array) -> Place:
        """A closure outside of all planes; some contact is inside where none is found."""
        self._hold(np.zeros(0, dtype=int))
        return self._step_out(super()._close(q))

    def _is_closed(self, place: Place) -> bool:
        """Whether all rows are met there, and no contact is inside."""
        return super()._is_closed(place) and self._depth(place) <= INSIDE

    def _settle(self, place: Place) -> Closure:
        """The nearest closure downhill, by the gaps that are touched there."""
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
        """Rows and values of the gaps, in coordinates in which |x| is a distance."""
        G, gap = self.gaps(place.q)
        return np.linalg.solve(place.half.T, G.T).T, gap

    def _least(self, place: Place, move: Array) -> LeastMove | None:
        return least_move(place.B, place.phi, *self._gaps(place), move)

    def _step_out(self, place: Place) -> Place:
        """Steps to the nearest place outside, each as long as the sum of distance and gaps falls."""
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
        """Out of what is left inside, and onto what is left open, by least moves."""
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
        """The largest by which a contact is inside."""
        return -float(self._gaps(place)[1].min(initial=0.0))

    def _lacking(self, place: Place) -> float:
        """The largest residual, or depth."""
        return max(place.gap, self._depth(place))

    def _missed(self, place: Place) -> float:
        """The sum of all residuals and depths."""
        gap = self._gaps(place)[1]
        return float(np.abs(place.phi).sum() - np.minimum(gap, 0.0).sum())

    def _merit(self, place: Place, weight: float) -> float:
        return 0.5 * float(place.move @ place.move) + weight * self._missed(place)

    def _slope_of_merit(self, place: Place, x: Array, weight: float) -> float:
        """By which the merit falls along x, which meets all rows."""
        return float(place.move @ x) - weight * self._missed(place)
