"""Global search for the nearest configuration that satisfies the holonomic constraints.

The problem is min d^T M(q0) d / 2 over phi(q) = 0. The displacement d(q) from q0 to q is in tangent
coordinates. Damped steps close the loops. Newton's method for the Lagrangian then descends along the
constraints until M(q0) d + A^T lam = 0. Loops may have several closures. If the displacement is long, the
search uses further starts and returns the nearest closure.

All quantities are dimensionless: rows are divided by their scales, and displacements by the units of
`Search`. The result is thus independent of length units, row scales and duplicate rows. The scale of a row is
its largest change if one coordinate moves by its unit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import UserFunctionError
from pin_nonideal.types import Array, Model

from .least_distance import complement, row_singular_values

# Scaled residual at which the search ends; the core's Newton method squares it.
CLOSURE_TOL = 1e-9
# Residual above which a loop counts as open after projection.
CLOSURE_TOLERANCE = 1e-8
CLOSING_STEPS, RETRACTIONS, SLIDES, HALVINGS = 300, 15, 60, 25
# Damping of the closing steps relative to the mean square of a row: initial value and bounds.
DAMPING, MIN_DAMPING, MAX_DAMPING = 1e-3, 1e-14, 1e10
# Relative slope of the distance along the constraints at which a closure is stationary: rounding over gaps.
STATIONARY_SLOPE = 1e-10
# Fraction of the last slope above which a descent does not converge.
STALLED_SLOPE = 0.5
# Rounding error of a displacement, relative to a displacement of all coordinates by their units.
ROUNDING = 1e-13
# Step of gradient differences [units].
DIFFERENCE_STEP = 1e-6
# A row has a corner nearby if, at a displacement of NEAR_CORNER units, it differs from its linear model by
# more than CORNER of the displacement.
NEAR_CORNER, CORNER = 1e-2, 0.1
# A second derivative below -SADDLE (1 without curvature) marks a saddle point, at which the gradient
# vanishes. ESCAPE is the displacement off a saddle point [units].
SADDLE, ESCAPE = 1e-5, 0.05
MIN_CURVATURE = 1e-2
# Maximum number of open directions for second derivatives, each of which needs one gradient evaluation.
MANY_FREEDOMS = 200
# Maximum number of starts until a closure is found, and number of further starts if its displacement is
# longer than FAR_MOVE units (twice as many above VERY_FAR_MOVE). With at most FEW_FREEDOMS coordinates,
# starts continue up to MAX_STARTS until a closure is found, and until the nearest was found OFTEN times.
STARTS, FURTHER_STARTS, FAR_MOVE, VERY_FAR_MOVE = 24, 24, 0.05, 0.5
MAX_STARTS, OFTEN, FEW_FREEDOMS = 60, 4, 12
SPREADS = (0.1, 0.3, 0.5, 1.0)  # spreads of the starts before the first closure, in turn [units]
# Smallest reciprocal condition number of the mass matrix. Closures below it (gimbal lock) are a fallback.
MIN_RCOND = 1e-10
# Smallest divisor.
MIN_NUMBER = 1e-300
# Relative difference below which two distances are equal, and below which they belong to one closure.
DISTANCE_TOL, CLOSURE_DISTANCE_TOL = 1e-9, 1e-6
TURN = 2.0 * np.pi

Rows = Callable[[Array], tuple[Array, Array]]


class Closure(NamedTuple):
    """A configuration on the constraints, or the iterate with the smallest residual.

    Attributes:
        q: configuration, (nq,).
        gap: largest scaled residual.
        distance: distance from the start, in the metric of the mass matrix at the start.
        is_minimum: whether the distance is a local minimum.
        iterations: total number of steps.
    """

    q: Array
    gap: float
    distance: float
    is_minimum: bool
    iterations: int


class Iterate(NamedTuple):
    """Iterate of the search, in coordinates x in which |x| is the distance.

    Attributes:
        q: configuration, (nq,).
        move: displacement from the start, (nv,).
        dx_dq: derivative of the scaled displacement x, dx = dx_dq dq, (nv, nv).
        B: scaled rows, (m, nv).
        phi: scaled residuals, (m,).
    """

    q: Array
    move: Array
    dx_dq: Array
    B: Array
    phi: Array

    @property
    def gap(self) -> float:
        """Largest scaled residual."""
        return float(np.abs(self.phi).max(initial=0.0))


class Search:
    """Search for closures around a configuration.

    Args:
        model: pinocchio.Model.
        rows: q -> (A, phi) of the holonomic rows, divided by their scales, (m, nv) and (m,).
        mass: q -> M(q), (nv, nv).
        metric: positive definite metric of the distance, (nv, nv).
        unit: unit displacement of each coordinate, (nv,).
        angles: mask of coordinates that are angles, (nv,).
        q0: start configuration, (nq,).
        free: mask of coordinates that move, (nv,); all when None. The arguments above have entries for free
            coordinates only, so their nv is the number of free coordinates.
    """

    def __init__(
        self,
        model: Model,
        rows: Rows,
        mass: Callable[[Array], Array],
        metric: Array,
        unit: Array,
        angles: Array,
        q0: Array,
        free: NDArray[np.bool_] | None = None,
    ) -> None:
        self.free = free
        self.model, self.rows, self.mass, self.q0 = model, rows, mass, q0
        self.unit, self.angles = unit, angles
        self.root = np.linalg.cholesky(metric).T
        self.size = float(np.linalg.norm(self.root @ unit)) or 1.0
        self.iterations = 0

    def nearest(self) -> tuple[Closure, bool]:
        """Return the nearest closure found, and whether the search confirms it as nearest.

        A closure is confirmed if it is a local minimum, no fallback is nearer, and several starts found it.
        One start suffices if the displacement is short.

        Raises:
            numpy.linalg.LinAlgError: a number overflows.
        """
        best: Closure | None = None
        fallback: Closure | None = None
        open_iterate = self._place(self.q0)
        starts, further, often = STARTS, 0, 0
        generator = np.random.default_rng(0)  # a fixed seed makes the result deterministic
        max_starts = MAX_STARTS if len(self.unit) <= FEW_FREEDOMS else 0
        k = 0
        while k < starts or (k < max_starts and (further and often < OFTEN if best else fallback is None)):
            start = self._start(k, best, generator)
            k += 1
            try:
                iterate = self._close(start)
                if not self._is_closed(iterate):
                    open_iterate = min(iterate, open_iterate, key=self._lacking)
                    continue
                limit = best.distance if best is not None else np.inf
                closure = self._unwound(self._settle(iterate, limit), limit)
            except UserFunctionError:  # a user function raises on the path of this start
                continue
            if conditioning(self.mass(closure.q)) <= MIN_RCOND:
                fallback = fallback if fallback and fallback.distance <= closure.distance else closure
                continue
            if best is None:
                move = self._longest(closure.q)
                further = FURTHER_STARTS * ((move > FAR_MOVE) + (move > VERY_FAR_MOVE))
                starts = k + further
            same = (
                best is not None
                and abs(closure.distance - best.distance) <= CLOSURE_DISTANCE_TOL * best.distance
            )
            if best is None or closure.distance < best.distance * (1.0 - DISTANCE_TOL):
                best, often = closure, often if same else 0
                same = True
            often += same
        if best is not None:
            is_nearer = fallback is None or fallback.distance >= best.distance
            known = best.is_minimum and is_nearer and (often > 1 or not further)
            return best._replace(iterations=self.iterations), known
        if fallback is not None:
            return fallback._replace(iterations=self.iterations), fallback.is_minimum
        lacking = self._lacking(open_iterate)
        return Closure(open_iterate.q, lacking, self._distance(open_iterate), False, self.iterations), False

    def first(self) -> Closure:
        """Return the first closure found from q0 or a random start, at any distance.

        Raises:
            numpy.linalg.LinAlgError: a number overflows.
        """
        generator, open_iterate = np.random.default_rng(0), self._place(self.q0)
        for k in range(STARTS):
            iterate = self._close(self._start(k, None, generator))
            open_iterate = min(iterate, open_iterate, key=self._lacking)
            if self._is_closed(iterate):
                break
        gap = self._lacking(open_iterate)
        return Closure(open_iterate.q, gap, self._distance(open_iterate), False, self.iterations)

    def _start(self, k: int, best: Closure | None, generator: np.random.Generator) -> Array:
        """Return start k: q0, then random starts, from the first closure on no farther away than the best."""
        if k == 0:
            return self.q0
        x = generator.standard_normal(len(self.unit))
        if best is None:
            return self._integrate(self.q0, SPREADS[k % len(SPREADS)] * self.unit * x)
        distance = best.distance * generator.uniform() ** (1.0 / len(x))  # uniform in the ball
        return self._integrate(self.q0, np.linalg.solve(self.root, distance / np.linalg.norm(x) * x))

    def _unwound(self, closure: Closure, limit: float) -> Closure:
        """Return the nearer of a closure and the closure without whole turns of its joints."""
        move = self._difference(closure.q)
        turns = np.where(self.angles, np.round(move / TURN), 0.0)
        if not turns.any():
            return closure
        iterate = self._close(self._integrate(self.q0, move - TURN * turns))
        return (
            min(closure, self._settle(iterate, limit), key=lambda c: c.distance)
            if self._is_closed(iterate)
            else closure
        )

    def _is_closed(self, iterate: Iterate) -> bool:
        """Check if all residuals are small enough for the core's Newton method."""
        return self._lacking(iterate) <= CLOSURE_TOL

    def _lacking(self, iterate: Iterate) -> float:
        """Return the largest residual."""
        return iterate.gap

    def _longest(self, q: Array) -> float:
        """Return the longest displacement of a coordinate [units]."""
        return float((np.abs(self._difference(q)) / self.unit).max(initial=0.0))

    def _place(self, q: Array) -> Iterate:
        A, phi = self.rows(q)
        move = self.root @ self._difference(q)
        turned = pin.dDifference(self.model, self.q0, q, pin.ArgumentPosition.ARG1)
        turned = turned.reshape(self.model.nv, self.model.nv)
        dx_dq = self.root @ (turned if self.free is None else turned[np.ix_(self.free, self.free)])
        return Iterate(q, move, dx_dq, np.linalg.solve(dx_dq.T, A.T).T, phi)

    @staticmethod
    def _distance(iterate: Iterate) -> float:
        return float(np.linalg.norm(iterate.move))

    def _displace(self, iterate: Iterate, x: Array, part: float = 1.0) -> Array:
        """Return the configuration after a displacement x, which is cut to one unit per coordinate."""
        dq = np.linalg.solve(iterate.dx_dq, x)
        longest = float((np.abs(dq) / self.unit).max(initial=0.0))
        if not np.isfinite(longest):
            raise np.linalg.LinAlgError("a move is not finite")
        return self._integrate(iterate.q, dq * (part / max(longest, 1.0)))

    def _integrate(self, q: Array, dq: object) -> Array:
        """Return q with its free coordinates moved by dq."""
        if self.free is not None:
            whole = np.zeros(self.model.nv)
            whole[self.free] = dq
            dq = whole
        moved: Array = pin.integrate(self.model, q, dq)
        return moved

    def _difference(self, q: Array) -> Array:
        """Return the displacement of the free coordinates from the start to q."""
        move: Array = pin.difference(self.model, self.q0, q)
        return move if self.free is None else move[self.free]

    # --- onto the constraints -------------------------------------------------------------------------------

    def _close(self, q: Array) -> Iterate:
        """Close the loops by Levenberg-Marquardt steps x = -B^T (B B^T + damping I)^-1 phi."""
        iterate, damping = self._place(q), DAMPING
        for _ in range(CLOSING_STEPS):
            if iterate.gap <= ROUNDING:
                break
            self.iterations += 1
            G = iterate.B @ iterate.B.T
            scale = max(float(np.trace(G)) / len(G), MIN_NUMBER)
            x = -iterate.B.T @ np.linalg.solve(G + damping * scale * np.eye(len(G)), iterate.phi)
            trial = self._place(self._displace(iterate, x))
            if np.linalg.norm(trial.phi) < np.linalg.norm(iterate.phi):
                iterate, damping = trial, max(0.2 * damping, MIN_DAMPING)
                if np.linalg.norm(x) < ROUNDING * ROUNDING * self.size:
                    break
            else:
                damping *= 5.0
                if damping > MAX_DAMPING:
                    break
        return iterate

    def _retract(self, q: Array) -> Iterate | None:
        """Return to the constraints from nearby by least-norm Newton steps, or None on failure."""
        iterate = self._place(q)
        for _ in range(RETRACTIONS):
            gap = iterate.gap
            if gap <= ROUNDING:
                break
            U, s, Vt = row_singular_values(iterate.B)
            trial = self._place(self._displace(iterate, -Vt.T @ ((U.T @ iterate.phi) / s)))
            if not trial.gap < gap:
                break
            iterate = trial
        return iterate if iterate.gap <= CLOSURE_TOL else None

    # --- along the constraints ------------------------------------------------------------------------------

    def _settle(self, iterate: Iterate, limit: float) -> Closure:
        """Descend to a local minimum of the distance; return the start if the descent ends at a corner.

        Args:
            iterate: configuration on the constraints.
            limit: distance of the nearest closure so far; a descent that will not reach it may end early.
        """
        end, is_minimum = self._slide(iterate, limit)
        if not is_minimum and self._has_corner(end):
            end = iterate
        return Closure(end.q, end.gap, self._distance(end), is_minimum, self.iterations)

    def _slide(self, iterate: Iterate, limit: float) -> tuple[Iterate, bool]:
        """Apply Newton's method for the Lagrangian in the open directions; return if it ends in a minimum.

        A descent may stall at a singular configuration: the slope stays, and the steps become short. The
        descent ends if all remaining steps with the decrease of the last step cannot reach the limit.
        """
        is_minimum = False
        last_distance, last_slope = np.inf, 0.0
        for remaining in range(SLIDES, 0, -1):
            U, s, Vt = row_singular_values(iterate.B)
            open_directions = complement(Vt)
            slope, distance = float(np.linalg.norm(open_directions.T @ iterate.move)), self._distance(iterate)
            if (
                slope > STALLED_SLOPE * last_slope
                and (last_distance - distance) * remaining < distance - limit
            ):
                break
            lam = -U @ ((Vt @ iterate.move) / s)
            flat = slope <= STATIONARY_SLOPE * distance + ROUNDING * self.size
            last_distance, last_slope = (np.inf if flat else distance), slope
            curvature, directions = self._curvature(iterate, lam, open_directions)
            if flat and curvature.min(initial=1.0) >= -SADDLE:
                is_minimum = len(curvature) <= MANY_FREEDOMS
                break
            self.iterations += 1
            if flat:
                x = ESCAPE * self._unit_length(iterate, directions[:, 0]) * directions[:, 0]
                trial = self._downhill(iterate, x, 0.0) or self._downhill(iterate, -x, 0.0)
            else:
                parts = directions.T @ iterate.move
                x = -directions @ (parts / np.maximum(np.abs(curvature), MIN_CURVATURE))
                trial = self._downhill(iterate, x, slope)
            if trial is None:
                # Neither distance nor slope decreases, so the remaining slope may be rounding error.
                is_minimum = slope <= 1e3 * STATIONARY_SLOPE * distance
                break
            iterate = trial
        return iterate, is_minimum

    def _has_corner(self, iterate: Iterate) -> bool:
        """Check if row directions change abruptly, as for a disk that lies flat."""
        _, _, Vt = row_singular_values(iterate.B)
        slope = iterate.move - Vt.T @ (Vt @ iterate.move)
        x = NEAR_CORNER * self._unit_length(iterate, slope) * slope
        there = [
            self._place(self._displace(iterate, side * x)).phi - side * (iterate.B @ x)
            for side in (1.0, -1.0)
        ]
        return bool(max(np.abs(phi - iterate.phi).max(initial=0.0) for phi in there) > CORNER * NEAR_CORNER)

    def _unit_length(self, iterate: Iterate, x: Array) -> float:
        """Return the factor of x at which the first coordinate moves by its unit."""
        return 1.0 / max(float((np.abs(np.linalg.solve(iterate.dx_dq, x)) / self.unit).max()), MIN_NUMBER)

    def _downhill(self, iterate: Iterate, x: Array, slope: float) -> Iterate | None:
        """Backtrack along x until the distance falls, or, if it changes by rounding only, the slope falls."""
        distance = self._distance(iterate)
        for k in range(HALVINGS):
            trial = self._retract(self._displace(iterate, x, 0.5**k))
            if trial is None:
                continue
            now = self._distance(trial)
            if now < distance * (1.0 - DISTANCE_TOL):
                return trial
            if now <= distance * (1.0 + ROUNDING) and self._slope(trial) < 0.5 * slope:
                return trial
        return None

    def _slope(self, iterate: Iterate) -> float:
        """Return the norm of the displacement in the open directions."""
        _, _, Vt = row_singular_values(iterate.B)
        return float(np.linalg.norm(iterate.move - Vt.T @ (Vt @ iterate.move)))

    def _curvature(self, iterate: Iterate, lam: Array, open_directions: Array) -> tuple[Array, Array]:
        """Return ascending curvatures of the Lagrangian, and their directions among the open ones."""
        n = open_directions.shape[1]
        if n == 0 or n > MANY_FREEDOMS:
            return np.ones(n), open_directions
        gradient, H = self._gradient(iterate, lam), np.empty((n, n))
        for k in range(n):
            x = open_directions[:, k]
            h = DIFFERENCE_STEP * self._unit_length(iterate, x)
            moved_gradient = self._gradient(self._place(self._displace(iterate, h * x)), lam)
            H[:, k] = open_directions.T @ np.linalg.solve(iterate.dx_dq.T, (moved_gradient - gradient) / h)
        values, vectors = np.linalg.eigh(0.5 * (H + H.T))
        return values, open_directions @ vectors

    @staticmethod
    def _gradient(iterate: Iterate, lam: Array) -> Array:
        """Return the gradient of |move|^2/2 + lam . phi, in tangent coordinates."""
        gradient: Array = iterate.dx_dq.T @ (iterate.move + iterate.B.T @ lam)
        return gradient


def conditioning(M: Array) -> float:
    """Return the ratio of the smallest to the largest eigenvalue of M with unit diagonal; 0 on overflow.

    Args:
        M: mass matrix, (nv, nv).
    """
    if not np.isfinite(M).all():
        return 0.0
    diagonal = np.sqrt(np.maximum(np.diag(M), MIN_NUMBER))
    values = np.linalg.eigvalsh(M / np.outer(diagonal, diagonal))
    return float(values[0] / values[-1])
