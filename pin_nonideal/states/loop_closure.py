"""The closed configuration nearest to a given one, from however far away.

With d(q) the move from q0 to q in tangent coordinates, this is min d^T M(q0) d / 2 over phi(q) = 0.  Damped
steps close the loops; then Newton's method for the Lagrangian slides along the constraints until
M(q0) d + A^T lam = 0, downhill all the way.  Loops may close in several ways: where the move is long other
starts are tried as well, and the nearest closure wins.

Nothing here has a unit: rows are divided by their reach and moves by the units of `Loops`, so that lengths,
scales of rows and copies of rows change nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import UserFunctionError
from pin_nonideal.types import Array, Model

from .least_distance import complement, held

# A gap below this part of the reach of its row is left to the core's Newton method, which squares it.
CLOSED = 1e-9
# A gap that stays above this part of it after projection is a loop that does not close.
CLOSURE_TOLERANCE = 1e-8
CLOSING_STEPS, RETRACTIONS, SLIDES, HALVINGS = 300, 15, 60, 25
# Of the steps that close: part of the mean square of a row at first, and between which it stays.
DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-14, 1e10
# The part of the move along the constraints at which a closure counts as stationary: rounding over gaps.
STATIONARY = 1e-10
# Rounding of a move, as a part of moving everything by its unit.
ROUNDING = 1e-13
# Differences of gradients, over a part of a unit.
DIFFERENCE = 1e-6
# Rows that miss their slope by more than CORNER of a move, at this part of a unit, have a corner nearby.
NEAR_CORNER, CORNER = 1e-2, 0.1
# A second derivative below minus this (1 without curvature) tells a saddle, where gradients alone would stay.
SADDLE, ESCAPE = 1e-5, 0.05
LEAST_CURVATURE = 1e-2
# Freedoms beyond which second derivatives, one evaluation each, are not taken.
MANY_FREEDOMS = 200
# Starts until a closure is found, and further ones beside it where its move is longer than FAR units, some
# more where it is longer than VERY_FAR; of few freedoms up to MOST_STARTS until the nearest came so OFTEN.
STARTS, FURTHER_STARTS, FAR, VERY_FAR = 24, 12, 0.05, 0.5
MOST_STARTS, OFTEN, FEW_FREEDOMS = 60, 4, 12
SPREADS = (0.1, 0.3, 0.5, 1.0)  # of these, in turn: of a unit, or of the longest move so far beyond that
# Closures with a worse conditioned mass matrix than this (gimbal lock) are kept only without a better one.
WELL_CONDITIONED = 1e-10
# Stands for what is zero and divides.
TINY = 1e-300
# Two distances that differ by less than this part are the same, and those of one closure found twice.
SAME, SAME_CLOSURE = 1e-9, 1e-6
TURN = 2.0 * np.pi

Rows = Callable[[Array], tuple[Array, Array]]


class Closure(NamedTuple):
    """A configuration on the constraints, or the one that came nearest to them.

    Attributes:
        q: configuration, (nq,).
        gap: largest residual over the reach of its row.
        distance: from where the search began, in the metric of its mass matrix.
        settled: no closure around it is nearer.
        iterations: steps taken in all.
    """

    q: Array
    gap: float
    distance: float
    settled: bool
    iterations: int


class Place(NamedTuple):
    """What a configuration is to the search, in coordinates x in which |x| is a distance.

    Attributes:
        q: configuration, (nq,).
        move: from the start, (nv,).
        half: x = half dq, (nv, nv).
        B: rows, (m, nv).
        phi: their residuals, (m,).
    """

    q: Array
    move: Array
    half: Array
    B: Array
    phi: Array

    @property
    def gap(self) -> float:
        """The largest residual."""
        return float(np.abs(self.phi).max(initial=0.0))


class Search:
    """Closures around a configuration.

    Args:
        model: pinocchio.Model.
        rows: q -> (A, phi) of the holonomic rows over their reach, (m, nv) and (m,).
        mass: q -> M(q), (nv, nv).
        metric: positive definite, (nv, nv): that of the distance.
        unit: a long move of each coordinate, (nv,).
        angles: which coordinates are angles, (nv,).
        q0: where it begins, (nq,).
        free: which coordinates move, (nv,); all when None.  Of the others nothing above holds entries.
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
        """The nearest closure found, and whether nothing speaks against it being the nearest of all.

        Raises:
            numpy.linalg.LinAlgError: numbers ran away.
        """
        best: Closure | None = None
        fallback: Closure | None = None
        open_place = self._place(self.q0)
        starts, further, often = STARTS, 0, 0
        generator = np.random.default_rng(0)  # the same closure every time
        most = MOST_STARTS if len(self.unit) <= FEW_FREEDOMS else 0
        k = 0
        while k < starts or (further and often < OFTEN and k < most):
            longest = 1.0 if best is None else max(1.0, self._longest(best.q))
            spread = longest * SPREADS[k % len(SPREADS)] * generator.standard_normal(len(self.unit))
            k += 1
            try:
                place = self._close(self._integrate(self.q0, spread * self.unit) if k > 1 else self.q0)
                if not self._is_closed(place):
                    open_place = min(place, open_place, key=self._lacking)
                    continue
                found = self._unwound(self._settle(place))
            except UserFunctionError:  # a way that leads where a function of the user has no value
                continue
            if conditioning(self.mass(found.q)) <= WELL_CONDITIONED:
                fallback = fallback if fallback and fallback.distance <= found.distance else found
                continue
            if best is None:
                move = self._longest(found.q)
                further = FURTHER_STARTS * ((move > FAR) + (move > VERY_FAR))
                starts = k + further
            same = best is not None and abs(found.distance - best.distance) <= SAME_CLOSURE * best.distance
            if best is None or found.distance < best.distance * (1.0 - SAME):
                best, often = found, often if same else 0
                same = True
            often += same
        if best is not None:
            alone = fallback is None or fallback.distance >= best.distance
            known = best.settled and alone and (often > 1 or not further)
            return best._replace(iterations=self.iterations), known
        if fallback is not None:
            return fallback._replace(iterations=self.iterations), fallback.settled
        lacking = self._lacking(open_place)
        return Closure(open_place.q, lacking, self._distance(open_place), False, self.iterations), False

    def _unwound(self, found: Closure) -> Closure:
        """The nearer one of a closure and of what it is without whole turns of joints."""
        move = self._difference(found.q)
        turns = np.where(self.angles, np.round(move / TURN), 0.0)
        if not turns.any():
            return found
        place = self._close(self._integrate(self.q0, move - TURN * turns))
        return min(found, self._settle(place), key=lambda c: c.distance) if self._is_closed(place) else found

    def _is_closed(self, place: Place) -> bool:
        """Whether all rows are met there, but for what the core's Newton method squares."""
        return self._lacking(place) <= CLOSED

    def _lacking(self, place: Place) -> float:
        """The largest gap."""
        return place.gap

    def _longest(self, q: Array) -> float:
        """The longest move of a coordinate [units]."""
        return float((np.abs(self._difference(q)) / self.unit).max(initial=0.0))

    def _place(self, q: Array) -> Place:
        A, phi = self.rows(q)
        move = self.root @ self._difference(q)
        turned = pin.dDifference(self.model, self.q0, q, pin.ArgumentPosition.ARG1)
        turned = turned.reshape(self.model.nv, self.model.nv)
        half = self.root @ (turned if self.free is None else turned[np.ix_(self.free, self.free)])
        return Place(q, move, half, np.linalg.solve(half.T, A.T).T, phi)

    @staticmethod
    def _distance(place: Place) -> float:
        return float(np.linalg.norm(place.move))

    def _go(self, place: Place, x: Array, part: float = 1.0) -> Array:
        """The configuration a move x away, which is cut to one unit."""
        dq = np.linalg.solve(place.half, x)
        longest = float((np.abs(dq) / self.unit).max(initial=0.0))
        if not np.isfinite(longest):
            raise np.linalg.LinAlgError("a move is not finite")
        return self._integrate(place.q, dq * (part / max(longest, 1.0)))

    def _integrate(self, q: Array, dq: Any) -> Array:
        """The configuration from which the free coordinates of q have moved by dq."""
        if self.free is not None:
            whole = np.zeros(self.model.nv)
            whole[self.free] = dq
            dq = whole
        moved: Array = pin.integrate(self.model, q, dq)
        return moved

    def _difference(self, q: Array) -> Array:
        """The move of the free coordinates from the start to q."""
        move: Array = pin.difference(self.model, self.q0, q)
        return move if self.free is None else move[self.free]

    # --- onto the constraints -------------------------------------------------------------------------------

    def _close(self, q: Array) -> Place:
        """Levenberg-Marquardt steps x = -B^T (B B^T + damping I)^-1 phi down to the constraints."""
        place, damping = self._place(q), DAMPING
        for _ in range(CLOSING_STEPS):
            if place.gap <= ROUNDING:
                break
            self.iterations += 1
            G = place.B @ place.B.T
            scale = max(float(np.trace(G)) / len(G), TINY)
            x = -place.B.T @ np.linalg.solve(G + damping * scale * np.eye(len(G)), place.phi)
            trial = self._place(self._go(place, x))
            if np.linalg.norm(trial.phi) < np.linalg.norm(place.phi):
                place, damping = trial, max(0.2 * damping, LEAST_DAMPING)
                if np.linalg.norm(x) < ROUNDING * ROUNDING * self.size:
                    break
            else:
                damping *= 5.0
                if damping > MOST_DAMPING:
                    break
        return place

    def _retract(self, q: Array) -> Place | None:
        """Back onto the constraints from nearby, by least moves."""
        place = self._place(q)
        for _ in range(RETRACTIONS):
            gap = place.gap
            if gap <= ROUNDING:
                break
            U, s, Vt = held(place.B)
            trial = self._place(self._go(place, -Vt.T @ ((U.T @ place.phi) / s)))
            if not trial.gap < gap:
                break
            place = trial
        return place if place.gap <= CLOSED else None

    # --- along the constraints ------------------------------------------------------------------------------

    def _settle(self, place: Place) -> Closure:
        """The nearest closure downhill; its start where that is a corner, in which rows have no direction."""
        found, settled = self._slide(place)
        if not settled and self._has_corner(found):
            found = place
        return Closure(found.q, found.gap, self._distance(found), settled, self.iterations)

    def _slide(self, place: Place) -> tuple[Place, bool]:
        """Newton's method for the Lagrangian in the open directions, and whether it ends in a minimum."""
        settled = False
        for _ in range(SLIDES):
            U, s, Vt = held(place.B)
            open_directions = complement(Vt)
            slope = open_directions.T @ place.move
            lam = -U @ ((Vt @ place.move) / s)
            flat = np.linalg.norm(slope) <= STATIONARY * self._distance(place) + ROUNDING * self.size
            curvature, directions = self._curvature(place, lam, open_directions)
            if flat and curvature.min(initial=1.0) >= -SADDLE:
                settled = len(curvature) <= MANY_FREEDOMS
                break
            self.iterations += 1
            if flat:
                x = ESCAPE * self._unit_length(place, directions[:, 0]) * directions[:, 0]
                trial = self._downhill(place, x, 0.0) or self._downhill(place, -x, 0.0)
            else:
                parts = directions.T @ place.move
                x = -directions @ (parts / np.maximum(np.abs(curvature), LEAST_CURVATURE))
                trial = self._downhill(place, x, float(np.linalg.norm(slope)))
            if trial is None:
                # Where neither distance nor slope falls any more it is rounding.
                settled = bool(np.linalg.norm(slope) <= 1e3 * STATIONARY * self._distance(place))
                break
            place = trial
        return place, settled

    def _has_corner(self, place: Place) -> bool:
        """Whether the rows change their direction at once, such as those of a disk that lies flat."""
        _, _, Vt = held(place.B)
        slope = place.move - Vt.T @ (Vt @ place.move)
        x = NEAR_CORNER * self._unit_length(place, slope) * slope
        there = [self._place(self._go(place, side * x)).phi - side * (place.B @ x) for side in (1.0, -1.0)]
        return bool(max(np.abs(phi - place.phi).max(initial=0.0) for phi in there) > CORNER * NEAR_CORNER)

    def _unit_length(self, place: Place, x: Array) -> float:
        """How far along x some coordinate moves by its unit."""
        return 1.0 / max(float((np.abs(np.linalg.solve(place.half, x)) / self.unit).max()), TINY)

    def _downhill(self, place: Place, x: Array, slope: float) -> Place | None:
        """The first of ever shorter moves along x that comes nearer, or, at rounding, is less steep."""
        distance = self._distance(place)
        for k in range(HALVINGS):
            trial = self._retract(self._go(place, x, 0.5**k))
            if trial is None:
                continue
            now = self._distance(trial)
            if now < distance * (1.0 - SAME):
                return trial
            if now <= distance * (1.0 + ROUNDING) and self._slope(trial) < 0.5 * slope:
                return trial
        return None

    def _slope(self, place: Place) -> float:
        """How much of the move lies in the open directions."""
        _, _, Vt = held(place.B)
        return float(np.linalg.norm(place.move - Vt.T @ (Vt @ place.move)))

    def _curvature(self, place: Place, lam: Array, open_directions: Array) -> tuple[Array, Array]:
        """Second derivatives of the Lagrangian along the open directions, rising, and their directions."""
        n = open_directions.shape[1]
        if n == 0 or n > MANY_FREEDOMS:
            return np.ones(n), open_directions
        here, H = self._gradient(place, lam), np.empty((n, n))
        for k in range(n):
            x = open_directions[:, k]
            h = DIFFERENCE * self._unit_length(place, x)
            there = self._gradient(self._place(self._go(place, h * x)), lam)
            H[:, k] = open_directions.T @ np.linalg.solve(place.half.T, (there - here) / h)
        values, vectors = np.linalg.eigh(0.5 * (H + H.T))
        return values, open_directions @ vectors

    @staticmethod
    def _gradient(place: Place, lam: Array) -> Array:
        """Of |move|^2/2 + lam . phi, in tangent coordinates."""
        gradient: Array = place.half.T @ (place.move + place.B.T @ lam)
        return gradient


def conditioning(M: Array) -> float:
    """Smallest over largest eigenvalue of M scaled to unit diagonal; 0 where M overflows.

    Args:
        M: mass matrix, (nv, nv).
    """
    if not np.isfinite(M).all():
        return 0.0
    diagonal = np.sqrt(np.maximum(np.diag(M), TINY))
    values = np.linalg.eigvalsh(M / np.outer(diagonal, diagonal))
    return float(values[0] / values[-1])
