"""Friction and contact cones of a scene at rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.states.rows import MIN_SINGULAR_VALUE
from pin_nonideal.types import Array

from .cone_program import ConeProgram, Limit
from .residual import AtRest, weight

# Smallest force scale, relative to the weight, and tolerance of the balance, relative to the force scale.
MIN_FORCE_SCALE, BALANCE_TOL = 1e-3, 1e-9


class LimitCones:
    """Friction and contact cones of one configuration at rest.

    The unknowns are lam (m), the friction forces (d) and a torque that is added to one drive. In the program
    they are measured in the metric of M^-1, relative to the greatest length of their row or element and to
    the largest force. Tolerances are therefore independent of units and of the mount. The program has no
    unknowns
    of rows and elements that exert no force: open contacts and friction without a load.

    Args:
        at_rest: forces at rest.
        q: configuration on the constraints, (nq,).
        dof: degree of freedom of the drive with an additional torque, or None.

    Attributes:
        program: balance of forces within limits.
        rows: number of rows of constraints and contacts, m.
        parts: slice of each element's forces in the unknowns.
        lengths: factor of each unknown, the length of its row.
        unit: largest load, by which the unknowns are divided, and with a drive at least the largest limit.
        constant: limits of the elements that do not depend on the unknowns [N or N m], (ne,).
        holds: whether the unknowns can balance the load with any signs.
        unheld: motion that no unknown resists, along the part of the load that nothing balances, (nv,).
    """

    def __init__(self, at_rest: AtRest, q: Array, dof: int | None = None) -> None:
        root = at_rest.root(q)
        _, reach, rows = at_rest.scaled_rows(q, root)
        _, lengths, D = at_rest.directions(q)
        self.rows = m = len(rows)
        ends = [0, *np.cumsum(at_rest.program.element_sizes).tolist()]
        self.parts = [slice(m + a, m + b) for a, b in pairwise(ends)]
        for first, end in pairwise(ends):
            lengths[first:end] = lengths[first:end].max(initial=0.0)
        drive = np.zeros((0, len(root)))
        if dof is not None:
            drive = np.linalg.solve(root, np.eye(len(root))[dof])[None]
        self.lengths = np.concatenate([reach, lengths, np.linalg.norm(drive, axis=1)])
        self.lengths[self.lengths == 0.0] = 1.0
        loads, self.constant = self._limits(at_rest, q)
        limits = self.constant * np.array([self.lengths[part.start] for part in self.parts])
        scaled = np.vstack([rows, np.vstack([D, drive]) / self.lengths[m:, None]])
        acting = np.linalg.solve(root, -at_rest.forces(q))
        largest = float(np.linalg.norm(acting))
        self.unit = max(largest, MIN_FORCE_SCALE * weight(at_rest.compiled.model))
        if dof is not None or self.unit == 0.0:
            self.unit = max(self.unit, float(limits.max(initial=0.0))) or 1.0
        acts = np.ones(len(scaled), dtype=bool)
        acts[:m] = ~at_rest.open
        for part, (load, _) in zip(self.parts, loads, strict=True):
            acts[part] = load < 0 or acts[load]
        self._acting = np.flatnonzero(acts)
        self._elements = [e for e, part in enumerate(self.parts) if acts[part.start]]
        reached, values, _ = np.linalg.svd(scaled[acts].T)
        reached = reached[:, : int((values > MIN_SINGULAR_VALUE).sum())].T
        left = acting - reached.T @ (reached @ acting)
        self.holds = bool(np.linalg.norm(left) <= BALANCE_TOL * self.unit)
        self.unheld = np.linalg.solve(root.T, left)
        place = np.cumsum(acts) - 1  # index of each unknown among the acting unknowns
        parts = [self.parts[e] for e in self._elements]
        self.program = ConeProgram(
            reached @ scaled[acts].T,
            reached @ acting / self.unit,
            [slice(int(place[a.start]), int(place[a.start]) + a.stop - a.start) for a in parts],
            [self._scaled_limit(e, *loads[e], place) for e in self._elements],
            place[np.flatnonzero(at_rest.gaps & acts[:m])].tolist(),
        )

    def _scaled_limit(self, e: int, load: int, coefficient: float, place: NDArray[np.intp]) -> Limit:
        """Return the limit of an element in the units of the program; the load is a row, or -1."""
        length = self.lengths[self.parts[e].start]
        constant = float(self.constant[e] * length / self.unit)
        if load < 0:
            return Limit(constant)
        return Limit(constant, int(place[load]), float(coefficient * length / self.lengths[load]))

    def _limits(self, at_rest: AtRest, q: Array) -> tuple[list[tuple[int, float]], Array]:
        """Return the rows that load friction, with signed coefficients, and all other static limits.

        Load-dependent limits of joints follow the loads of the sticking scene. The normal force of a rolling
        body or a bilateral contact keeps the sign that it has in the sticking scene.

        Returns:
            Row and coefficient of each element, row -1 without such a row, and constant limits [N or N m],
            (ne,).
        """
        # Laws of joints come before the friction of contacts and rolling bodies.
        laws = len(at_rest.compiled.spec.laws)
        elements = [
            (row if law >= laws else -1, coefficient, constant)
            for law, (row, coefficient, constant) in zip(
                at_rest.program.element_laws, at_rest.program.element_limits, strict=True
            )
        ]
        modes, changes = [core.Mode.sticking] * len(elements), bool(elements)
        signs, limits = np.ones(self.rows), np.zeros(0)
        while changes:
            stuck = at_rest.runner.solve(q, at_rest.still, at_rest.t, at_rest.tau, modes, frozen=True)
            limits = np.array(stuck.limits)
            signs = np.where(at_rest.gaps | (stuck.lam >= 0.0), 1.0, -1.0)
            before = modes
            modes = [
                core.Mode.unloaded if mode == core.Mode.sticking and limit == 0.0 else mode
                for mode, limit in zip(modes, limits, strict=True)
            ]  # an element with a zero limit cannot stick
            changes = modes != before
        loads = [
            (row, coefficient * signs[row]) if row >= 0 else (-1, 0.0) for row, coefficient, _ in elements
        ]
        given = [
            constant if row >= 0 else limit
            for (row, _, constant), limit in zip(elements, limits, strict=True)
        ]
        return loads, np.array(given)

    def min_factor(self) -> float:
        """Return the least factor of all limits for which forces balance, or infinity."""
        return self.program.min_factor() if self.holds else np.inf

    def forces(self, factor: float) -> Array:
        """Return the forces of least excess over the limits times a factor [N or N m], (m + d,).

        Args:
            factor: factor of all limits, at least the least one.
        """
        forces = np.zeros(len(self.lengths))
        forces[self._acting] = self.program.least_excess(factor).x
        return np.asarray(forces * self.unit / self.lengths)

    def span(self) -> tuple[float, float]:
        """Return the least and the largest additional torque of the drive within all limits [N m or N].

        An end without bound is infinite. Both are NaN if no torque holds.
        """
        if not self.holds:
            return np.nan, np.nan
        low, high = self.program.span(self.program.count - 1)
        unit = self.unit / float(self.lengths[-1])
        return low * unit, high * unit

    def at_limits(self, factor: float) -> list[int]:
        """Return the elements at their limits under the least factor with which forces balance.

        Args:
            factor: this factor.
        """
        return [self._elements[e] for e in self.program.at_limits(factor)]

    def missing(self) -> tuple[dict[int, float], dict[int, float]]:
        """Return the missing forces of a scene that limits of any size cannot hold, of least sum.

        Only for loads that the unknowns can balance with any signs.

        Returns:
            Pull of contacts by their row. If no contact must pull, friction of elements without a load
            [N or N m].
        """
        pulls, friction = self.program.missing()
        rows = {int(self._acting[i]): x for i, x in pulls.items()}
        elements = {self._elements[e]: x for e, x in friction.items()}
        return (
            {row: x * self.unit / float(self.lengths[row]) for row, x in rows.items()},
            {e: x * self.unit / float(self.lengths[self.parts[e].start]) for e, x in elements.items()},
        )
