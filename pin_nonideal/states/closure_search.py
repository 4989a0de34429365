"""Global search for the nearest closure: units of the coordinates, scales of the rows, and the metric."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.errors import UserFunctionError
from pin_nonideal.types import Array, Model

from .contact_closure import UnilateralClosure
from .loop_closure import MIN_RCOND, Closure, Rows, Search, conditioning
from .rows import duplicate_rows, rows_at
from .scales import MIN_ROW_LENGTH

# Inertia that the metric gains if M is singular, relative to the largest inertia.
MIN_INERTIA = 1e-9
# Parts of a displacement at which rows are sampled. If a user function raises, the next part is tried.
SAMPLE_PARTS = (1.0, 0.1, 1e-2, 1e-3)


class ClosureSearch:
    """Search of one scene at one time for closures around a configuration.

    Args:
        model: pinocchio.Model.
        runner: a workspace of the core.
        t: time [s].
        unit: unit displacement of each coordinate, (nv,).
        length: length of the mechanism [m].
        slides: mask of sliding coordinates, (nv,).
        gaps: mask of the rows of unilateral contacts, (m,).
        loops: mask of the holonomic rows, (m,).
    """

    def __init__(
        self,
        model: Model,
        runner: core.Runner,
        t: float,
        unit: Array,
        length: float,
        slides: NDArray[np.bool_],
        gaps: NDArray[np.bool_],
        loops: NDArray[np.bool_],
    ) -> None:
        self.model, self.unit, self.length = model, unit, length
        self._runner, self._t = runner, t
        self._slides, self._gaps, self._loops = slides, gaps, loops

    def nearest(self, q: Array, free: NDArray[np.bool_] | None = None) -> tuple[Closure, bool]:
        """Return the nearest closure, and whether the search confirms it as nearest.

        Args:
            q: start configuration, (nq,).
            free: mask of coordinates that may move, (nv,); all when None.
        """
        try:
            return self._search(q, free).nearest()
        except np.linalg.LinAlgError:  # a number overflowed: no closure
            return Closure(q, np.inf, 0.0, False, 0), False

    def first(self, q: Array) -> Closure:
        """Return the first closure found around the configuration q, (nq,), at any distance."""
        try:
            return self._search(q, None).first()
        except np.linalg.LinAlgError:  # a number overflowed: no closure
            return Closure(q, np.inf, 0.0, False, 0)

    def _search(self, q: Array, free: NDArray[np.bool_] | None) -> Search:
        mass, unit = mass_function(self.model, self._runner), self._unit_at(q)
        is_free = np.ones(self.model.nv, dtype=bool) if free is None else free
        block = np.ix_(is_free, is_free)
        loops = self._rows(q, unit, self._loops, is_free)
        arguments = (
            self.model,
            loops,
            lambda q: mass(q)[block],
            metric(mass(q), self.unit)[block],
            unit[is_free],
            np.logical_not(self._slides)[is_free],
            q,
            free,
        )
        if not self._gaps.any():
            return Search(*arguments)
        return UnilateralClosure(self._rows(q, unit, self._gaps, is_free), *arguments)

    def _unit_at(self, q: Array) -> Array:
        """Return the units of a search; slide units cover the least displacements that close single rows."""
        A, _, phi, _ = rows_at(self._runner, q, np.zeros(self.model.nv), self._t)
        phi = np.where(self._gaps, np.minimum(phi, 0.0), phi)
        weighted = A * self.unit
        reach = np.linalg.norm(weighted, axis=1)
        max_slide = np.abs(weighted[:, self._slides]).max(axis=1, initial=0.0)
        acts = reach > MIN_ROW_LENGTH * reach.max(initial=0.0)
        far = self.length * np.divide(np.abs(phi) * max_slide, reach**2, out=np.zeros_like(phi), where=acts)
        return np.where(self._slides, max(self.length, _largest(far)), 1.0)

    def _rows(
        self,
        q: Array,
        unit: Array,
        selected: NDArray[np.bool_],
        free: NDArray[np.bool_],
    ) -> Rows:
        """Return the rows of free coordinates divided by their scales, without duplicate and zero rows."""
        zero, generator = np.zeros(self.model.nv), np.random.default_rng(1)
        moves = [unit * generator.standard_normal(self.model.nv) for _ in range(3)]
        samples = [self._sample(q, move) for move in moves]
        weighted = np.hstack([A * unit for A, _, _, _ in samples])
        reach = np.abs(weighted).max(axis=1, initial=0.0)
        used = selected & (reach > MIN_ROW_LENGTH * reach.max(initial=0.0))
        wide = np.hstack([weighted, np.column_stack([phi for _, _, phi, _ in samples])])
        used[[row for row, _, _ in duplicate_rows(wide, used, weighted.shape[1])]] = False
        scale = 1.0 / reach[used]

        def rows(q: Array) -> tuple[Array, Array]:
            A, _, phi, _ = rows_at(self._runner, q, zero, self._t)
            return A[np.ix_(used, free)] * scale[:, None], phi[used] * scale

        return rows

    def _sample(self, q: Array, move: Array) -> tuple[Array, Array, Array, Array]:
        """Return the rows after a displacement; it is shortened if a user function raises."""
        for part in SAMPLE_PARTS:
            with suppress(UserFunctionError):
                moved = pin.integrate(self.model, q, part * move)
                return rows_at(self._runner, moved, np.zeros(self.model.nv), self._t)
        return rows_at(self._runner, q, np.zeros(self.model.nv), self._t)


def metric(M: Array, unit: Array) -> Array:
    """Return M, with a small inertia added to each coordinate if M is singular.

    Args:
        M: mass matrix, (nv, nv).
        unit: unit displacement of each coordinate, (nv,).
    """
    if conditioning(M) > MIN_RCOND:
        return M
    return M + np.diag(MIN_INERTIA * (np.diag(M) * unit**2).max() / unit**2)


def mass_function(model: Model, runner: core.Runner) -> Callable[[Array], Array]:
    """Return the mass matrix as a function q -> M, (nv, nv).

    Args:
        model: pinocchio.Model.
        runner: a workspace of the core.
    """
    n, zero = model.nv, np.zeros(model.nv)
    return lambda q: runner.terms(q, zero)[0].reshape(n, n)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
