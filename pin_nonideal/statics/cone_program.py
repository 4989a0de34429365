"""Second-order cone programs for forces within friction cones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pin_nonideal.types import Array

from .second_order_cones import REDUCED_TOL, Cones

# Excess that counts as zero, relative to the largest force, at the tolerance of the cone programs.
EXCESS_TOL = 3e-9
# Tolerance of the least factor, factor above which no friction suffices, and maximum number of steps.
FACTOR_TOL, MAX_FACTOR, MAX_STEPS = 1e-9, 1e6, 100
# Limit that counts as a force of any size, relative to the largest force.
MAX_LIMIT = 1e6
# Distance from a limit, relative to the largest force, within which an element counts as at its limit.
AT_LIMIT = 1e-6


class Limit(NamedTuple):
    """Limit of the force of one element: constant + coefficient x[load]; load is -1 for a constant limit."""

    constant: float
    load: int = -1
    coefficient: float = 0.0

    def at(self, x: Array) -> float:
        """Return the limit for forces x, (n,)."""
        return self.constant + (self.coefficient * float(x[self.load]) if self.load >= 0 else 0.0)


class Excess(NamedTuple):
    """Least excess of forces over their limits.

    Attributes:
        value: excess, at least zero; infinite if no forces balance.
        slope: derivative of the excess with respect to the factor of all limits.
        x: forces, (n,).
    """

    value: float
    slope: float
    x: Array


@dataclass
class ConeProgram:
    """Forces x that balance a load within limits: balance x = load, and |x_e| <= factor limit_e(x).

    Unknowns, loads and limits are relative to the largest force.

    Attributes:
        balance: coefficients of the balance, (r, n).
        load: load, (r,).
        parts: slice of the unknowns of each element.
        limits: limit of each element.
        pressing: unknowns that must not be negative.
    """

    balance: Array
    load: Array
    parts: Sequence[slice]
    limits: Sequence[Limit]
    pressing: Sequence[int]

    @cached_property
    def count(self) -> int:
        """Number of unknowns, n."""
        return int(self.balance.shape[1])

    def least_excess(self, factor: float) -> Excess:
        """Return the least excess s >= 0 with |x_e| <= factor limit_e(x) + s for all elements.

        Args:
            factor: factor of all limits.
        """
        cones = self._balance(1, pressing=True)
        cones.nonnegative([self.count])
        first = cones.rows
        self._limit(cones, factor, [self.count] * len(self.parts))
        solution = cones.minimize(np.append(np.zeros(self.count), 1.0))
        if solution is None:
            return Excess(math.inf, 0.0, np.zeros(self.count))
        values, duals = solution
        x, slope = self._balanced(values[: self.count]), 0.0
        for part, limit in zip(self.parts, self.limits, strict=True):
            slope -= float(duals[first]) * limit.at(x)
            first += 1 + part.stop - part.start
        return Excess(max(float(values[-1]), 0.0), slope, x)

    def min_factor(self) -> float:
        """Return the least factor of all limits for which forces balance, or infinity.

        Newton's method finds the root of the least excess from factors that are too small. Bisection replaces
        steps that leave the bracket.
        """
        low, high, factor = 0.0, math.inf, 0.0
        for _ in range(MAX_STEPS):
            excess, root = self.least_excess(factor), math.inf
            if excess.value <= EXCESS_TOL:
                high = factor
            elif factor >= MAX_FACTOR:
                return math.inf
            else:
                low = factor
                if excess.slope < 0.0:
                    root = factor - excess.value / excess.slope
            end = min(root, high)
            if end - low <= FACTOR_TOL * (1.0 + end) or abs(root - high) <= FACTOR_TOL * (1.0 + end):
                return end
            if root < high:
                factor = min(root, MAX_FACTOR)
            else:
                factor = 0.5 * (low + high) if high < math.inf else MAX_FACTOR
        return high

    def span(self, unknown: int) -> tuple[float, float]:
        """Return the least and the largest value of an unknown within all limits.

        An end without bound is infinite. Both are NaN if no forces balance within the limits.

        Args:
            unknown: index of the unknown.
        """
        if not self.least_excess(1.0).value <= REDUCED_TOL:
            return math.nan, math.nan
        ends = []
        for sign in (-1.0, 1.0):
            cones = self._balance(0, pressing=True)
            self._limit(cones, 1.0, [-1] * len(self.parts))
            goal = np.zeros(self.count)
            goal[unknown] = -sign
            solution = cones.minimize(goal)
            ends.append(sign * math.inf if solution is None else float(solution[0][unknown]))
        return ends[0], ends[1]

    def at_limits(self, factor: float) -> list[int]:
        """Return the elements at their limits in the forces of the least excess.

        Args:
            factor: factor of all limits.
        """
        x = self.least_excess(factor).x
        forces = [float(np.linalg.norm(x[part])) for part in self.parts]
        return [
            e
            for e, (force, limit) in enumerate(zip(forces, self.limits, strict=True))
            if force > AT_LIMIT and force - factor * limit.at(x) >= -AT_LIMIT
        ]

    def missing(self) -> tuple[dict[int, float], dict[int, float]]:
        """Return the missing forces of a load that limits of any size cannot balance, of least sum.

        Returns:
            Pulling force of each unknown that must press. If no unknown must pull, friction by element beyond
            MAX_FACTOR times the limit.
        """
        cones = self._balance(len(self.pressing), pressing=False)
        added = list(range(self.count, cones.count))
        cones.nonnegative(added)
        cones.nonnegative(self.pressing, added)
        pulls = self._least_sum(cones, self.pressing)
        if pulls:
            return pulls, {}
        cones = self._balance(len(self.parts), pressing=True)
        added = list(range(self.count, cones.count))
        cones.nonnegative(added)
        self._limit(cones, MAX_FACTOR, added)
        return {}, self._least_sum(cones, range(len(self.parts)))

    def _balanced(self, x: Array) -> Array:
        """Return the nearest forces that balance the load to rounding."""
        return x + np.linalg.lstsq(self.balance, self.load - self.balance @ x, rcond=None)[0]

    def _least_sum(self, cones: Cones, keys: Sequence[int]) -> dict[int, float]:
        """Minimize the sum of the added unknowns and return the values that are not zero, by key."""
        goal = np.append(np.zeros(self.count), np.ones(len(keys)))
        solution = cones.minimize(goal)
        added = np.zeros(len(keys)) if solution is None else solution[0][self.count :]
        return {key: float(x) for key, x in zip(keys, added, strict=True) if x > AT_LIMIT}

    def _balance(self, added: int, *, pressing: bool) -> Cones:
        """Return cones with the balance, for the unknowns and some added ones.

        Args:
            added: number of added unknowns.
            pressing: whether the unknowns that must not be negative are not.
        """
        cones = Cones(self.count + added)
        cones.equal(self.balance, self.load)
        if pressing:
            cones.nonnegative(self.pressing)
        return cones

    def _limit(self, cones: Cones, factor: float, excess: Sequence[int]) -> None:
        """Add |x_e| <= factor limit_e(x) + excess_e.

        Args:
            cones: the cones.
            factor: factor of all limits.
            excess: unknown that is the excess of each element; -1 without excess.
        """
        for part, (constant, load, coefficient), slack in zip(self.parts, self.limits, excess, strict=True):
            bound = [(load, factor * coefficient)] if load >= 0 else []
            bound += [(slack, 1.0)] if slack >= 0 else []
            cones.second_order(min(factor * constant, MAX_LIMIT), bound, range(part.start, part.stop))
