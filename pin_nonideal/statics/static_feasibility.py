"""rest: feasibility of rest of a configuration under dry friction and contacts, with its margin."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import Rolling
from pin_nonideal.errors import InputError
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.parsing import named_velocity
from pin_nonideal.states.rows import DEPENDENT
from pin_nonideal.types import Array, State
from pin_nonideal.validation import number

from .residual import AtRest, weight

# Tolerance of cone violations relative to the largest force, and maximum number of rounds of cuts.
CUT, MOST_CUTS = 1e-9, 60
# Number of initial cut directions of a disk.
FIRST = 8
# Tolerance of the margin, and friction factor above which no friction suffices.
FOUND, MOST_FACTOR = 1e-9, 1e6
# Smallest force scale, relative to the weight; forces balance to CUT times the force scale.
LIGHT = 1e-3
PARTS = ("", "torsional", "rolling")  # suffixes of the names of a contact's friction elements


@dataclass(frozen=True, eq=False)
class Rest:
    """Feasibility of rest of a configuration, with its margin and forces.

    Attributes:
        rests: whether forces within all limits balance the configuration.
        margin: 1 minus the smallest common factor of all friction limits for which forces balance. It is 1 if
            no friction is needed, 0 if friction just suffices, negative if larger limits are needed, and -inf
            if no friction suffices.
        friction: force of each friction element by name, along its slip directions, for the smallest factor
            [N or N m]; empty if no friction suffices.
        lam: multipliers of all rows with this friction; contacts press, (m,).
    """

    rests: bool
    margin: float
    friction: dict[str, Array]
    lam: Array


def rest(scene: Scene, q: State | None = None, tau: State | None = None, *, t: float = 0.0) -> Rest:
    """Check if friction and contact forces can hold a scene at rest, and compute the margin.

    The unknowns are multipliers lam, friction forces f and the smallest factor k of the static limits. They
    satisfy F + A^T lam + D^T f = 0 and |f_e| <= k limit_e for each friction element e. Contacts press:
    lam >= 0, and lam = 0 for open contacts. Limits of contacts depend on the unknown lam. Load-dependent
    limits of joints are computed from the reactions of the sticking scene, with least norm if they are not
    unique. Cutting planes approximate disks and balls; each linear program is solved exactly.

    Args:
        scene: the scene.
        q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
        tau: torques that replace the scene's actuation, (nv,) or by joint name.
        t: time at which actuation and constraints are evaluated [s].

    Returns:
        The Rest.

    Raises:
        InputError: an argument does not fit.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"rest: scene must be a Scene; got {type(scene).__name__}")
    still = np.zeros(scene.model.nv)
    torque = None if tau is None else named_velocity(scene.model, tau, still, "rest: tau")
    time = number("rest: t", t)
    at = scene.project(q, still, time)[0]
    cones = _Cones(scene, AtRest(scene, torque, time, at), at)
    factor = cones.least_factor()
    if factor > MOST_FACTOR:
        return Rest(False, -np.inf, {}, np.zeros(len(cones.A)))
    forces = cones.solve(factor)[1]
    friction = {name: forces[s] for name, s in zip(scene.element_names, cones.parts, strict=True)}
    margin = 1.0 - factor
    return Rest(margin >= -10.0 * FOUND, margin, friction, forces[: len(cones.A)])


class _Cones:
    """Linear programs for the cones of one configuration.

    The unknowns are lam (m), the friction forces (d) and an excess s over all limits. They are measured in
    the metric of M^-1, over the greatest length of their row or element, and over the largest force.
    Tolerances are therefore independent of units and of the mount.

    Attributes:
        A: rows of constraints and contacts, (m, nv).
        parts: slice of each element's forces in the unknowns.
        balance: forces of the unknowns along an orthonormal basis of their span, (r, m + d).
        load: forces that the unknowns must balance along that basis, (r,).
        holds: whether the load lies in the span of that basis.
    """

    def __init__(self, scene: Scene, at_rest: AtRest, q: Array) -> None:
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
        self.parts = [slice(m + a, m + b) for a, b in pairwise(ends.tolist())]
        self.count = m + int(ends[-1])
        self.lengths = np.concatenate([reach, lengths])
        self.lengths[self.lengths == 0.0] = 1.0
        self.contacts = [first for first, _, contact in compiled_scene(scene).rows.values() if contact]
        limits = known * np.array([self.lengths[part.start] for part in self.parts])
        scaled, acting = (
            np.vstack([rows, D / self.lengths[m:, None]]),
            np.linalg.solve(root, -at_rest.forces(q)),
        )
        largest = float(np.linalg.norm(acting))
        self.unit = max(largest, CUT * float(limits.max(initial=0.0)), LIGHT * weight(scene)) or 1.0
        self.constant = limits / self.unit
        reached, values, _ = np.linalg.svd(scaled.T)
        reached = reached[:, : int((values > DEPENDENT).sum())].T
        self.balance, self.load = reached @ scaled.T, reached @ acting / self.unit
        self.holds = bool(np.linalg.norm(acting - reached.T @ (reached @ acting)) <= CUT * self.unit)
        self.cuts: list[tuple[int, Array]] = [
            (e, n) for e, size in enumerate(self.sizes) for n in _directions(size)
        ]

    def _limits(
        self, scene: Scene, at_rest: AtRest, q: Array
    ) -> tuple[Array, list[tuple[int, float] | None]]:
        """Return known limits [N or N m], and (row, coefficient) of limits that depend on a contact force."""
        elements = len(self.sizes)
        following: list[tuple[int, float] | None] = [None] * elements
        rows = scene.constraint_slices
        said = dict(zip(rows, (*scene.constraints, *scene.contacts), strict=True))
        for e, name in enumerate(scene.element_names):
            for part in PARTS:
                about = said.get(name.removesuffix(f" {part}") if part else name)
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
        """Return the least scaled excess with all limits multiplied by a factor, and the forces of it."""
        for _ in range(MOST_CUTS):
            excess, x = self._program(factor)
            outside = [
                (e, self._beyond(e, x, factor) - excess) for e, size in enumerate(self.sizes) if size > 1
            ]
            worst = [(e, beyond) for e, beyond in outside if beyond > CUT]
            if not worst or not np.isfinite(excess):
                break
            self.cuts += [(e, x[self.parts[e]] / np.linalg.norm(x[self.parts[e]])) for e, _ in worst]
        return excess, x * self.unit / self.lengths

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

    def _program(self, factor: float) -> tuple[float, Array]:
        """Solve the linear program of the current cuts: least s with n f - limit <= s for each cut."""
        from scipy.optimize import linprog

        rows, bounds = [], []
        for e, n in self.cuts:
            row, constant = self._limit(e, factor)
            row = -row
            row[self.parts[e]] += n
            rows.append(np.append(row, -1.0))
            bounds.append(constant)
        limits: list[tuple[float | None, float | None]] = [(None, None)] * self.count + [(0.0, None)]
        for first in self.contacts:
            limits[first] = (0.0, None)
        for idle in self.open:
            limits[idle] = (0.0, 0.0)
        if not self.holds:
            return np.inf, np.zeros(self.count)
        equal = np.hstack([self.balance, np.zeros((len(self.load), 1))])
        found = linprog(
            np.append(np.zeros(self.count), 1.0),
            A_ub=np.array(rows) if rows else None,
            b_ub=bounds or None,
            A_eq=equal if len(equal) else None,
            b_eq=self.load if len(equal) else None,
            bounds=limits,
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if found.x is None:
            return np.inf, np.zeros(self.count)
        return float(found.x[-1]), np.asarray(found.x[:-1])

    def least_factor(self) -> float:
        """Return the least factor of all limits for which forces balance, by bisection, or infinity."""
        low, high = 0.0, MOST_FACTOR / (1.0 + MOST_FACTOR)
        if self.solve(0.0)[0] <= CUT:
            return 0.0
        if not self.solve(MOST_FACTOR)[0] <= CUT:
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
        for k in range(FIRST):
            yield np.array([np.cos(2.0 * np.pi * k / FIRST), np.sin(2.0 * np.pi * k / FIRST)])
    else:
        yield from np.vstack([np.eye(size), -np.eye(size)])
