"""Friction and contact cones of a scene at rest, as linear programs with cutting planes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import Rolling
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.rows import MIN_SINGULAR_VALUE
from pin_nonideal.types import Array

from .residual import AtRest, weight

# Tolerance of cone violations relative to the largest force, and maximum number of rounds of cuts.
CUT, MAX_CUTS = 1e-9, 60
# Number of initial cut directions of a disk.
INITIAL_CUTS = 8
# Tolerance of the margin, and friction factor above which no friction suffices.
FOUND, MAX_FACTOR = 1e-9, 1e6
# Smallest force scale, relative to the weight; forces balance to CUT times the force scale.
MIN_FORCE_SCALE = 1e-3
PARTS = ("", "torsional", "rolling")  # suffixes of the names of a contact's friction elements
# Distance from a limit, in the units of the unknowns, within which an element counts as at its limit.
AT_LIMIT = 1e-6
INFINITE_FACTOR = 1e9  # factor of limits that stands for friction of any size


class LimitCones:
    """Linear programs for the friction and contact cones of one configuration at rest.

    The unknowns are lam (m), the friction forces (d), a torque that is added to one drive, and an excess s
    over all limits. They are measured in the metric of M^-1, over the greatest length of their row or
    element, and over the largest force. Tolerances are therefore independent of units and of the mount.

    Args:
        scene: the scene.
        at_rest: forces at rest.
        q: configuration on the constraints, (nq,).
        dof: degree of freedom of the drive with an additional torque, or None.

    Attributes:
        A: rows of constraints and contacts, (m, nv).
        parts: slice of each element's forces in the unknowns.
        lengths: factor of each unknown, the length of its row.
        unit: largest force, by which the unknowns are divided.
        constant: limits of the elements that do not depend on the unknowns, in the units of the unknowns.
        balance: forces of the unknowns along an orthonormal basis of their span, (r, m + d).
        load: forces that the unknowns must balance along that basis, (r,).
        holds: whether the load lies in the span of that basis.
        unheld: motion that no unknown resists, along the part of the load outside of that basis, (nv,).
    """

    def __init__(self, scene: Scene, at_rest: AtRest, q: Array, dof: int | None = None) -> None:
        self.sizes = list(compiled_scene(scene).program.element_sizes)
        root = at_rest.root(q)
        self.A, reach, rows = at_rest.scaled_rows(q, root)
        _, lengths, D = at_rest.directions(q)
        m, ends = len(self.A), np.cumsum([0, *self.sizes])
        known, self.following = self._limits(scene, at_rest, q)
        self.open = np.flatnonzero(at_rest.open)
        for (first, end), follows in zip(pairwise(ends.tolist()), self.following, strict=True):
            lengths[first:end] = lengths[first:end].max(initial=0.0)
            if follows is not None and at_rest.open[follows[0]]:
                D[first:end] = 0.0
        drive = np.zeros((0, len(root)))
        if dof is not None:
            drive = np.linalg.solve(root, np.eye(len(root))[dof])[None]
        self.parts = [slice(m + a, m + b) for a, b in pairwise(ends.tolist())]
        self.count = m + int(ends[-1]) + len(drive)
        self.lengths = np.concatenate([reach, lengths, np.linalg.norm(drive, axis=1)])
        self.lengths[self.lengths == 0.0] = 1.0
        slices = list(compiled_scene(scene).slices.values())
        self.contacts = [rows.start for rows in slices[len(scene.constraints) :]]
        limits = known * np.array([self.lengths[part.start] for part in self.parts])
        scaled, acting = (
            np.vstack([rows, np.vstack([D, drive]) / self.lengths[m:, None]]),
            np.linalg.solve(root, -at_rest.forces(q)),
        )
        largest = float(np.linalg.norm(acting))
        self.unit = max(largest, CUT * float(limits.max(initial=0.0)), MIN_FORCE_SCALE * weight(scene)) or 1.0
        self.constant = limits / self.unit
        reached, values, _ = np.linalg.svd(scaled.T)
        reached = reached[:, : int((values > MIN_SINGULAR_VALUE).sum())].T
        self.balance, self.load = reached @ scaled.T, reached @ acting / self.unit
        left = acting - reached.T @ (reached @ acting)
        self.holds = bool(np.linalg.norm(left) <= CUT * self.unit)
        self.unheld = np.linalg.solve(root.T, left)
        self.cuts: list[tuple[int, Array]] = [
            (e, n) for e, size in enumerate(self.sizes) for n in _directions(size)
        ]

    def _limits(
        self, scene: Scene, at_rest: AtRest, q: Array
    ) -> tuple[Array, list[tuple[int, float] | None]]:
        """Return known limits [N or N m], and (row, coefficient) of limits that depend on a contact force."""
        elements = len(self.sizes)
        following: list[tuple[int, float] | None] = [None] * elements
        rows, descriptions = compiled_scene(scene).slices, compiled_scene(scene).described
        for e, name in enumerate(compiled_scene(scene).program.element_names):
            for part in PARTS:
                about = descriptions.get(name.removesuffix(f" {part}") if part else name)
                if not hasattr(about, "torsional") or (part and not name.endswith(f" {part}")):
                    continue
                row = rows[name.removesuffix(f" {part}") if part else name].start
                coefficient = getattr(about, part or "mu", 0.0) * getattr(about, "static_ratio", 1.0)
                following[e] = (row + (2 if isinstance(about, Rolling) else 0), coefficient)
        known = np.zeros(elements)
        modes, lasts = [core.Mode.sticking] * elements, any(each is None for each in following)
        while lasts:
            stuck = at_rest.runner.solve(q, at_rest.still, at_rest.t, at_rest.tau, modes, frozen=True)
            known = np.array([0.0 if f else x for f, x in zip(following, stuck.limits, strict=True)])
            before = modes
            modes = [
                core.Mode.unloaded if mode == core.Mode.sticking and x == 0.0 else mode
                for mode, x in zip(modes, stuck.limits, strict=True)
            ]  # an element with a zero limit cannot stick
            lasts = modes != before
        return known, following

    def solve(self, factor: float) -> tuple[float, Array]:
        """Return the least scaled excess with all limits multiplied by a factor, and the forces of it.

        Args:
            factor: factor of all limits.
        """
        excess, x = self._within_cones(factor)
        return excess, x * self.unit / self.lengths

    def span(self) -> tuple[float, float]:
        """Return the least and the largest additional torque of the drive within all limits [N m or N].

        An end without bound is infinite. Both are NaN if no torque holds.
        """
        excess, _ = self._within_cones(1.0)
        if not excess <= CUT:
            return math.nan, math.nan
        ends = []
        for sign in (-1.0, 1.0):
            x = self._within_cones(1.0, sign, max(excess, 0.0))[1]
            if not len(x):  # without bound, or infeasible by rounding of the excess
                x = self._within_cones(1.0, sign, CUT)[1]
            ends.append(float(x[-1]) * self.unit / float(self.lengths[-1]) if len(x) else sign * math.inf)
        return ends[0], ends[1]

    def at_limits(self, factor: float) -> list[int]:
        """Return the elements at their limits under the least factor with which forces balance.

        Args:
            factor: this factor.
        """
        x = self._within_cones(factor)[1]
        return [
            e
            for e in range(len(self.sizes))
            if np.linalg.norm(x[self.parts[e]]) > AT_LIMIT and self._beyond(e, x, factor) >= -AT_LIMIT
        ]

    def missing(self) -> tuple[dict[int, float], dict[int, float]]:
        """Return the missing forces of a scene that limits of any size cannot hold.

        Their sum is least. Only for loads that the unknowns can balance with any signs.

        Returns:
            Pull of contacts by their first row. If no contact must pull, friction of elements without a load
            [N or N m].
        """
        pulls = []
        for first in self.contacts:
            row = np.zeros(self.count)
            row[first] = -1.0
            pulls.append((row, 0.0))
        violations = self._least_violations(pulls, list(range(len(pulls))), pressing=False)
        pulled = {
            first: float(x) * self.unit / float(self.lengths[first])
            for first, x in zip(self.contacts, violations, strict=True)
            if x > AT_LIMIT
        }
        if pulled:
            return pulled, {}
        cuts, elements = [], []
        for e, n in self.cuts:
            part, constant = self._limit(e, INFINITE_FACTOR)
            row = -part
            row[self.parts[e]] += n
            cuts.append((row, constant))
            elements.append(e)
        violations = self._least_violations(cuts, elements, pressing=True)
        missing_friction = {
            e: float(x) * self.unit / float(self.lengths[self.parts[e].start])
            for e, x in enumerate(violations)
            if x > AT_LIMIT
        }
        return {}, missing_friction

    def _least_violations(
        self, bounds: list[tuple[Array, float]], owners: list[int], *, pressing: bool
    ) -> Array:
        """Return the violations of the bounds row x <= bound with the smallest sum for which forces balance.

        Args:
            bounds: rows and bounds.
            owners: index of the violation that each row shares with other rows.
            pressing: whether contacts must press.
        """
        from scipy.optimize import linprog

        several = max(owners, default=-1) + 1
        limits: list[tuple[float | None, float | None]] = [(None, None)] * self.count
        limits += [(0.0, None)] * several
        for first in self.contacts:
            limits[first] = (0.0 if pressing else None, None)
        for open_element in self.open:
            limits[open_element] = (0.0, 0.0)
        rows = [np.append(row, -np.eye(several)[k]) for (row, _), k in zip(bounds, owners, strict=True)]
        optimum = linprog(
            np.append(np.zeros(self.count), np.ones(several)),
            A_ub=np.array(rows) if rows else None,
            b_ub=[bound for _, bound in bounds] or None,
            A_eq=np.hstack([self.balance, np.zeros((len(self.load), several))]),
            b_eq=self.load,
            bounds=limits,
            method="highs",
        )
        return np.zeros(several) if optimum.x is None else np.asarray(optimum.x[self.count :])

    def _within_cones(self, factor: float, sign: float = 0.0, max_excess: float = 0.0) -> tuple[float, Array]:
        """Solve the programs of more and more cuts until the forces lie within all cones."""
        for _ in range(MAX_CUTS):
            excess, x = self._program(factor, sign, max_excess)
            if not len(x):
                break
            outside = [
                (e, self._beyond(e, x, factor) - excess) for e, size in enumerate(self.sizes) if size > 1
            ]
            worst = [(e, beyond) for e, beyond in outside if beyond > CUT]
            if not worst or not np.isfinite(excess):
                break
            self.cuts += [(e, x[self.parts[e]] / np.linalg.norm(x[self.parts[e]])) for e, _ in worst]
        return excess, x

    def _limit(self, e: int, factor: float) -> tuple[Array, float]:
        """Return a limit as coefficients of the unknowns and a constant."""
        row = np.zeros(self.count)
        follows = self.following[e]
        if follows is not None:
            row[follows[0]] = (
                factor * follows[1] * self.lengths[self.parts[e].start] / self.lengths[follows[0]]
            )
        return row, factor * self.constant[e]

    def _beyond(self, e: int, x: Array, factor: float) -> float:
        row, constant = self._limit(e, factor)
        return float(np.linalg.norm(x[self.parts[e]]) - row @ x - constant)

    def _program(self, factor: float, sign: float, max_excess: float) -> tuple[float, Array]:
        """Solve the linear program of the current cuts: n f - limit <= s for each cut.

        Args:
            factor: factor of all limits.
            sign: 0 for the least s; otherwise the largest sign times the additional torque.
            max_excess: maximum s, with a sign.

        Returns:
            s and the unknowns; s is infinite if nothing balances, and there are no unknowns without bound.
        """
        from scipy.optimize import linprog

        rows, bounds = [], []
        for e, n in self.cuts:
            row, constant = self._limit(e, factor)
            row = -row
            row[self.parts[e]] += n
            rows.append(np.append(row, -1.0))
            bounds.append(constant)
        limits: list[tuple[float | None, float | None]] = [(None, None)] * self.count
        limits.append((0.0, max_excess if sign else None))
        for first in self.contacts:
            limits[first] = (0.0, None)
        for open_element in self.open:
            limits[open_element] = (0.0, 0.0)
        if not self.holds:
            return np.inf, np.zeros(self.count)
        goal = np.zeros(self.count + 1)
        goal[-2 if sign else -1] = -sign if sign else 1.0
        equal = np.hstack([self.balance, np.zeros((len(self.load), 1))])
        optimum = linprog(
            goal,
            A_ub=np.array(rows) if rows else None,
            b_ub=bounds or None,
            A_eq=equal if len(equal) else None,
            b_eq=self.load if len(equal) else None,
            bounds=limits,
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if optimum.x is None:
            return np.inf, np.zeros(0 if sign else self.count)
        return float(optimum.x[-1]), np.asarray(optimum.x[:-1])

    def min_factor(self) -> float:
        """Return the least factor of all limits for which forces balance, by bisection, or infinity."""
        low, high = 0.0, MAX_FACTOR / (1.0 + MAX_FACTOR)
        if self.solve(0.0)[0] <= CUT:
            return 0.0
        if not self.solve(MAX_FACTOR)[0] <= CUT:
            return np.inf
        while high - low > FOUND * (1.0 - high):
            middle = 0.5 * (low + high)
            if self.solve(middle / (1.0 - middle))[0] <= CUT:
                high = middle
            else:
                low = middle
        return high / (1.0 - high)


def _directions(size: int) -> Iterator[Array]:
    """Yield unit vectors of the initial cuts around an interval, a disk or a ball."""
    if size == 1:
        yield from (np.array([1.0]), np.array([-1.0]))
    elif size == 2:
        for k in range(INITIAL_CUTS):
            yield np.array([np.cos(2.0 * np.pi * k / INITIAL_CUTS), np.sin(2.0 * np.pi * k / INITIAL_CUTS)])
    else:
        yield from np.vstack([np.eye(size), -np.eye(size)])
