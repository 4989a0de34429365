"""Second-order cone programs in sparse form, solved by Clarabel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from pin_nonideal.errors import FrictionConvergenceError
from pin_nonideal.types import Array

# Tolerance of feasibility and duality gap for unknowns of order 1, and tolerance of a program that ends
# early. Rounding in Clarabel, which regularizes by 1e-8, ends one in ten programs before 1e-10.
SOLVER_TOL, REDUCED_TOL = 1e-9, 1e-7


class Cones:
    """Rows bounds - rows x within a product of cones, and the minimum of a sum subject to them.

    Args:
        count: number of unknowns.

    Attributes:
        count: number of unknowns.
        rows: number of rows so far.
    """

    def __init__(self, count: int) -> None:
        self.count, self.rows = count, 0
        self._entries: list[tuple[int, int, float]] = []
        self._bounds: list[float] = []
        self._cones: list[Any] = []

    def equal(self, rows: Array, bounds: Array) -> None:
        """Require rows x = bounds for the first unknowns.

        Args:
            rows: rows, (k, n) with at most `count` columns.
            bounds: right-hand sides, (k,).
        """
        from clarabel import ZeroConeT

        at, columns = np.nonzero(rows)
        values = rows[at, columns]
        self._entries += zip((self.rows + at).tolist(), columns.tolist(), values.tolist(), strict=True)
        self._add(bounds.tolist(), ZeroConeT)

    def nonnegative(self, *unknowns: Sequence[int]) -> None:
        """Require sums of unknowns to be nonnegative.

        Args:
            unknowns: lists of equal length; the sums of their k-th unknowns are nonnegative.
        """
        from clarabel import NonnegativeConeT

        for indices in unknowns:
            self._entries += [(self.rows + k, index, -1.0) for k, index in enumerate(indices)]
        self._add([0.0] * len(unknowns[0]), NonnegativeConeT)

    def second_order(
        self, constant: float, bound: Iterable[tuple[int, float]], unknowns: Sequence[int]
    ) -> None:
        """Require the norm of unknowns to be at most a bound.

        Args:
            constant: constant part of the bound.
            bound: unknowns and coefficients of the linear part of the bound.
            unknowns: unknowns whose norm is bounded.
        """
        from clarabel import SecondOrderConeT

        self._entries += [(self.rows, index, -coefficient) for index, coefficient in bound]
        self._entries += [(self.rows + 1 + k, index, -1.0) for k, index in enumerate(unknowns)]
        self._add([constant] + [0.0] * len(unknowns), SecondOrderConeT)

    def minimize(self, goal: Array) -> tuple[Array, Array] | None:
        """Minimize goal x within the cones.

        Args:
            goal: coefficients, (n,).

        Returns:
            Unknowns, (n,), and multipliers, (rows,). None if no unknowns lie within the cones or the sum has
            no bound.

        Raises:
            FrictionConvergenceError: the solver reached neither a solution nor a proof that there is none.
        """
        import clarabel

        status = clarabel.SolverStatus
        for equilibrates in (True, False):  # some programs that stop early end in their own scales
            solution = self._solve(goal, equilibrates)
            if solution.status in (status.Solved, status.AlmostSolved):
                return np.array(solution.x), np.array(solution.z)
            if solution.status in (status.PrimalInfeasible, status.DualInfeasible):
                return None
        raise FrictionConvergenceError(
            "the program of friction cones found neither forces nor a proof that there are none; it ended "
            f'with status "{solution.status}"; choose units in which masses and lengths are closer to 1',
            element="",
        )

    def _solve(self, goal: Array, equilibrates: bool) -> Any:
        """Return Clarabel's solution, with or without its scaling of the rows and columns."""
        import clarabel

        rows, columns, values = zip(*self._entries, strict=True) if self._entries else ((), (), ())
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.equilibrate_enable = equilibrates
        for kind in ("gap_abs", "gap_rel", "feas"):
            setattr(settings, f"tol_{kind}", SOLVER_TOL)
            setattr(settings, f"reduced_tol_{kind}", REDUCED_TOL)
        return clarabel.DefaultSolver(
            csc_matrix((self.count, self.count)),
            goal,
            csc_matrix((values, (rows, columns)), shape=(self.rows, self.count)),
            np.array(self._bounds),
            self._cones,
            settings,
        ).solve()

    def _add(self, bounds: list[float], cone: Any) -> None:
        if bounds:
            self._bounds += bounds
            self._cones.append(cone(len(bounds)))
            self.rows += len(bounds)
