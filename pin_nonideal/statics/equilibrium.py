"""equilibrium: equilibrium configurations of a scene without dry friction, and their stability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import EquilibriumError, InputError, LoopClosureError
from pin_nonideal.html_tables import numbers, table
from pin_nonideal.scene.scene import Scene, compiled_scene, require_scene, scene_states
from pin_nonideal.scene.state import SceneStates
from pin_nonideal.states.parsing import named_velocity
from pin_nonideal.types import Array, Model, State
from pin_nonideal.validation import choice, count, number

from .residual import AtRest, Balance, weight

# Step of central differences of forces [units]: the cube root of rounding, at which the errors by rounding
# and by curvature are equal.
DIFFERENCE_STEP = 6e-6
# Longest step [units, see `AtRest.units`], shortest step, and maximum number of steps.
MAX_STEP, MIN_STEP, MAX_STEPS = 0.5, 1e-13, 300
# Longest step if all coordinates are slides, whose unit may be any unit of length.
MAX_SLIDE = 1e9
CLOSINGS = 20  # maximum number of iterations to the configuration at which a contact closes
# Newton step at which an equilibrium is found [units].
CONVERGED_STEP = 1e-9
# A direction is neutral if its stiffness is below NEUTRAL_STIFFNESS times the force scale over a unit
# displacement, or below CANCELLATION_TOL times the stiffnesses that cancel in it.
NEUTRAL_STIFFNESS, CANCELLATION_TOL = 1e-7, 1e-10
MIN_RATE = 1e-12  # smallest divisor of neutral directions [1/s^2]
# Tolerance of balanced forces relative to the force scale, and rounding error of a stiffness relative to its
# size.
BALANCE_TOL, ROUNDING = 1e-9, 1e-14


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium configuration and its stability.

    Attributes:
        q: configuration, (nq,).
        lam: multipliers of all rows in F + A^T lam = 0, of least norm, (m,).
        left: largest unbalanced force along the motions that the constraints admit [N or N m].
        free: orthonormal basis of the motions that the constraints admit, (nv, k).
        stiffness: stiffness matrix along `free`, - free^T d(F + A^T lam)/dq free, (k, k).
        rates: eigenvalues of the stiffness relative to the inertia along `free`, sorted by real part
            [1/s^2], (k,). The eigenvalues are squared angular frequencies of small motions. A negative or
            complex eigenvalue belongs to a growing motion.
        stable: True, False, or None if a direction is neutral and no motion grows.
        starts: number of starts used.
    """

    q: Array
    lam: Array
    left: float
    free: Array
    stiffness: Array
    rates: NDArray[np.complex128]
    stable: bool | None
    starts: int

    def _repr_html_(self) -> str:
        arrays: dict[str, NDArray[np.generic]] = {
            "q": self.q,
            "lam": self.lam,
            "rates [1/s^2]": np.real_if_close(self.rates),
        }
        rows: list[tuple[str, object]] = [(key, numbers(x)) for key, x in arrays.items() if x.size]
        rows += [("largest unbalanced force", f"{self.left:.2g}"), ("stable", self.stable)]
        return table("Equilibrium", [*rows, ("starts", self.starts)])


def equilibrium(
    scene: Scene,
    q: State | None = None,
    tau: State | None = None,
    *,
    t: float = 0.0,
    stable: bool = True,
    starts: int = 8,
) -> Equilibrium:
    """Find an equilibrium on the constraints near q, without dry friction.

    The equations are free^T F(q) = 0 and phi(q, t) = 0: forces vanish along the motions that the constraints
    admit. Contacts that touch at q, or close during the search, are held. Open contacts exert no force.
    Newton steps with the stiffness made positive in the metric of M descend to a stable state. The first
    start is q; further starts lie around it. `rest` checks if dry friction holds other configurations.

    Args:
        scene: the scene.
        q: start configuration, (nq,) or by joint name; the scene's initial configuration when None.
        tau: torques that replace the scene's actuation, (nv,) or by joint name.
        t: time at which actuation and constraints are evaluated [s].
        stable: whether to search for a stable equilibrium. False accepts any equilibrium of Newton's method.
        starts: maximum number of starts.

    Returns:
        The Equilibrium; if no stable equilibrium is found, the first one of another kind.

    Raises:
        InputError: an argument does not fit, or rows restrict the velocity only.
        LoopClosureError: the loops cannot be closed.
        EquilibriumError: no equilibrium is found.
    """
    require_scene("equilibrium", scene)
    downhill = choice("equilibrium: stable", stable, (True, False))
    still = np.zeros(scene.model.nv)
    torque = None if tau is None else named_velocity(scene.model, tau, still, "equilibrium: tau")
    time, attempts = number("equilibrium: t", t), count("equilibrium: starts", starts, min_value=1)
    start = scene.project(q, still, time)[0]
    at_rest = AtRest(compiled_scene(scene), torque, time, start)
    search = _Search(at_rest, scene_states(scene), downhill)
    best: Equilibrium | None = None
    for k in range(attempts):
        q = start if k == 0 else search.elsewhere(start, k)
        result = None if q is None else search.run(q, k + 1)
        if result is None:
            continue
        if result.stable or not downhill:
            return result
        best = best or result
    if best is None:
        raise EquilibriumError(
            f'no state of rest of "{scene.name}" was found from {attempts} starts: {search.reason()}',
            time=time,
        )
    return best


class _Search:
    """Searches for an equilibrium from several starts."""

    def __init__(self, rest: AtRest, states: SceneStates, downhill: bool) -> None:
        self.rest, self.states, self.downhill = rest, states, downhill
        self.model: Model = rest.compiled.model
        self.least = np.inf
        self.nearest = np.array(rest.compiled.q0)
        self.unit = np.ones(self.model.nv)  # unit displacement of each coordinate
        self.longest = MAX_SLIDE if rest.only_slides else MAX_STEP

    def elsewhere(self, start: Array, k: int) -> Array | None:
        """Return the k-th start, with a spread that grows with k; deterministic."""
        rest, unit = self.rest, self.rest.units(self.rest.mass(start), self.rest.free(start))
        move = unit * np.random.default_rng(k).standard_normal(self.model.nv) * min(1.5, 0.3 * k)
        try:
            return self.states.project(pin.integrate(self.model, start, move), rest.still, rest.t)[0]
        except (LoopClosureError, InputError):  # InputError: a contact would start with penetration
            return None

    def run(self, q: Array, start: int) -> Equilibrium | None:
        """Search from one configuration; None if the search fails."""
        self.rest.begin(q)
        self.unit = self.rest.units(self.rest.mass(q), self.rest.free(q))
        now, longest = self.rest.balance(q), MAX_STEP
        for _ in range(MAX_STEPS):
            self.note(q, now)
            stiffness = self.stiffness(q, now)
            move, distance, is_unopposed = self.move(q, now, stiffness)
            if distance <= CONVERGED_STEP and not is_unopposed:
                q, now = self.polished(q, now, move)
                return self.result(q, now, self.stiffness(q, now), start)
            size = float(np.abs(move / self.unit).max(initial=0.0))
            scale = min(1.0, longest / size) if size > 0.0 else 1.0
            next_state = self.step(q, now, scale * move)
            if next_state is not None:
                q, now = next_state
                if self.rest.touch(q):
                    now = self.rest.balance(q)
                longest = min(self.longest, 2.0 * max(longest, scale * size))
            elif (longest := min(longest, scale * size) / 4.0) < MIN_STEP:
                break
        return None

    def note(self, q: Array, now: Balance) -> None:
        """Store the configuration with the smallest unbalanced force."""
        left = float(np.linalg.norm(now.left))
        if left < self.least:
            self.least, self.nearest = left, q

    def reason(self) -> str:
        """Return the reason of a failed search: a drive that exceeds all resistance, or unbalanced forces."""
        has_friction = bool(self.rest.compiled.elements.names)
        friction_note = "; dry friction is ignored here, and `rest` includes it" * has_friction
        now = self.rest.balance(self.nearest)
        way = now.free @ now.left
        way /= np.linalg.norm(way) or 1.0
        drive = now.F - self.rest.undriven(self.nearest)
        power = drive * way
        along, held = float(power.sum()), float(power.sum() - now.F @ way)
        if along <= max(held, 0.0):
            return (
                f"along motions that the constraints allow, forces of {self.least:.2g} (N or N m) remain; "
                f"start nearer, or hold the bodies that fall freely{friction_note}"
            )
        dof = int(power.argmax())
        ends = [i + n for i, n in zip(self.model.idx_vs, self.model.nvs, strict=True)]
        joint = self.model.names[int(np.searchsorted(ends[1:], dof, side="right")) + 1]
        others = f"all other forces resist with {held:.2g}" if held > 0.0 else "no other force resists"
        return (
            f'the drive of joint "{joint}", {drive[dof]:.4g} (N or N m), exceeds all resistance: at the '
            f"smallest unbalanced force the drives push with {along:.2g} along a motion that the constraints "
            f"allow, and {others}; reduce the drive, or add resistance{friction_note}"
        )

    def in_play(self, now: Balance, inertia: Array) -> Array:
        """Return the force scale along the columns of free, from acting forces and weight, (k,)."""
        acting = np.abs(now.F) + np.abs(now.A.T) @ np.abs(now.lam)
        pull = weight(self.model) * np.sqrt(np.diag(inertia))  # largest force along each column
        return np.asarray(np.abs(now.free).T @ acting + pull)

    def polished(self, q: Array, now: Balance, move: Array) -> tuple[Array, Balance]:
        """Return the state after one more step if its unbalanced force is smaller, else the given state."""
        moved = self.states.project(pin.integrate(self.model, q, move), self.rest.still, self.rest.t)[0]
        then = self.rest.balance(moved)
        return (moved, then) if np.linalg.norm(then.left) < np.linalg.norm(now.left) else (q, now)

    def stiffness(self, q: Array, now: Balance) -> Array:
        """Compute - free^T d(F + A^T lam)/dq free at constant lam, by central differences."""
        columns = []
        for direction in now.free.T:
            ends, part = [], DIFFERENCE_STEP / float(np.linalg.norm(direction / self.unit))
            for sign in (1.0, -1.0):
                there = pin.integrate(self.model, q, sign * part * direction)
                ends.append(self.rest.forces(there) + self.rest.rows(there).T @ now.lam)
            columns.append(-(ends[0] - ends[1]) / (2.0 * part))
        k = now.free.shape[1]
        return now.free.T @ np.array(columns).T if k else np.zeros((0, 0))

    def neutral(self, now: Balance, inertia: Array, stiffness: Array, shapes: Array) -> Array:
        """Return the stiffness of each shape (column) below which it is neutral, from its own terms, (k,)."""
        size = np.abs(shapes)
        motion = np.linalg.norm(now.free / self.unit[:, None], axis=0)
        canceled = CANCELLATION_TOL * np.abs(stiffness) + NEUTRAL_STIFFNESS * np.diag(
            motion * self.in_play(now, inertia)
        )
        return np.asarray(np.einsum("ik,ij,jk->k", size, canceled, size))

    def move(self, q: Array, now: Balance, stiffness: Array) -> tuple[Array, float, bool]:
        """Return the step, the length of the Newton step, and whether a force acts in a neutral direction."""
        from scipy.linalg import eigh

        if not len(now.left):
            return np.zeros(self.model.nv), 0.0, False
        inertia = now.free.T @ self.rest.mass(q) @ now.free
        rates, shapes = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (inertia + inertia.T))
        pull, least = shapes.T @ now.left, self.neutral(now, inertia, stiffness, shapes)
        neutral = np.abs(rates) <= least
        rounding = BALANCE_TOL * self.in_play(now, inertia) + ROUNDING * np.abs(stiffness).sum(axis=1)
        pushed = neutral & (np.abs(pull) > np.abs(shapes).T @ rounding)
        steps = np.where(neutral & ~pushed, 0.0, pull / np.where(neutral, least + MIN_RATE, np.abs(rates)))
        away = now.free @ (shapes @ np.where(neutral, 0.0, steps))
        distance = float(np.abs(away / self.unit).max(initial=0.0))
        if not self.downhill:
            steps = np.linalg.lstsq(stiffness, now.left, rcond=CANCELLATION_TOL)[0]
            return now.free @ steps, distance, bool(pushed.any())
        return now.free @ (shapes @ steps), distance, bool(pushed.any())

    def to_contact(self, q: Array, move: Array) -> Array:
        """Shorten a displacement to the point at which the first open contact closes, by regula falsi."""
        if not self.rest.open.any():
            return move
        before = self.rest.gaps_at(q)
        for _ in range(CLOSINGS):
            after = self.rest.gaps_at(pin.integrate(self.model, q, move))
            enters = after < -self.rest.touching
            if not enters.any():
                break
            move = move * float((before[enters] / (before - after)[enters]).min())
        return move

    def step(self, q: Array, now: Balance, move: Array) -> tuple[Array, Balance] | None:
        """Return the state after a step, or None if the forces do negative work along it."""
        move = self.to_contact(q, move)
        try:
            there = self.states.project(pin.integrate(self.model, q, move), self.rest.still, self.rest.t)[0]
            then = self.rest.balance(there)
        except (LoopClosureError, InputError):
            return None
        before, after = np.linalg.norm(now.left), np.linalg.norm(then.left)
        if not self.downhill:
            return (there, then) if after < before else None
        way = pin.difference(self.model, q, there)
        work = 0.5 * float((now.F + then.F) @ way)
        near = float(np.abs(move / self.unit).max(initial=0.0)) < 1e-4 and after < 0.5 * before
        return (there, then) if work > 0.0 or near else None

    def result(self, q: Array, now: Balance, stiffness: Array, start: int) -> Equilibrium:
        """Return the equilibrium at a configuration, with its stability."""
        from scipy.linalg import eig

        inertia = now.free.T @ self.rest.mass(q) @ now.free
        values, shapes = eig(stiffness, inertia) if len(now.left) else (np.zeros(0), np.zeros((0, 0)))
        order = np.argsort(values.real)
        rates: NDArray[np.complex128] = np.asarray(values[order], dtype=complex)
        shapes = np.abs(shapes[:, order])
        weights = np.einsum("ik,ij,jk->k", shapes, np.abs(inertia), shapes)
        least = self.neutral(now, inertia, stiffness, shapes) / np.where(weights > 0.0, weights, 1.0)
        neutral = np.abs(rates) <= least
        grows = ~neutral & ((rates.real < 0.0) | (np.abs(rates.imag) > 1e-3 * np.abs(rates)))
        verdict = False if grows.any() else None if neutral.any() else True
        left = float(np.abs(now.left).max(initial=0.0))
        lam = self.rest.compiled.multipliers.groups.sum(now.lam)
        return Equilibrium(q, lam, left, now.free, stiffness, rates, verdict, start)
