"""equilibrium: a configuration where a scene can rest without friction, and whether it is stable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import EquilibriumError, InputError, LoopClosureError
from pin_nonideal.scene.scene import Scene
from pin_nonideal.states.parsing import named_velocity
from pin_nonideal.types import Array, State
from pin_nonideal.validation import choice, count, number

from .residual import AtRest, Balance, weight

# Central differences of forces: the cube root of rounding, where rounding and curvature cost the same.
DIFFERENCE = 6e-6
# Longest step [units, see `AtRest.units`], the shortest that still leads somewhere, and most of them.
LONGEST, SHORTEST, MOST = 0.5, 1e-13, 300
CLOSINGS = 20  # iterations to the place where a contact closes
# Newton step at which an equilibrium counts as found [units].
CLOSE = 1e-9
# A motion has no stiffness where it is below this part of the forces in play along it over a unit of motion,
# or below that part of the stiffnesses that cancel in it: the state is neutral that way.
NEUTRAL, CANCELED = 1e-7, 1e-10
LEAST_RATE = 1e-12  # where nothing at all has a stiffness [1/s^2]
# Forces along a motion balance below this part of those in play along it; so much of a stiffness is rounding.
BALANCED, ROUNDING = 1e-9, 1e-14


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A state of rest.

    Attributes:
        q: configuration, (nq,).
        lam: multipliers of all rows in F + A^T lam = 0, of least norm, (m,).
        left: largest force that is left along a motion that the constraints allow [N or N m].
        free: those motions, orthonormal columns, (nv, k).
        stiffness: of the scene along them, - free^T d(F + A^T lam)/dq free, (k, k).
        rates: eigenvalues of the stiffness over the inertia along them [1/s^2], (k,), by their real part:
            squares of angular frequencies of small motions; a negative or complex one grows.
        stable: True, False, or None where it is neutral some way.
        starts: how many starts it took.
    """

    q: Array
    lam: Array
    left: float
    free: Array
    stiffness: Array
    rates: NDArray[np.complex128]
    stable: bool | None
    starts: int


def equilibrium(
    scene: Scene,
    q0: State | None = None,
    tau: State | None = None,
    *,
    t: float = 0.0,
    stable: bool = True,
    starts: int = 8,
) -> Equilibrium:
    """A state of rest with all constraints held, found from q0; dry friction counts for nothing.

    The forces along the motions that the constraints allow are brought to zero: free^T F(q) = 0 where
    phi(q, t) = 0.  Contacts that touch at q0, or come to touch in the search, are held; open ones give no
    force.
    Steps of Newton's method with the stiffness made positive in the metric of M go downhill, to a stable
    state; from q0 first, then from others around it.  `rest` tells what friction holds besides.

    Args:
        scene: the scene.
        q0: configuration to start from, (nq,) or by joint name; the scene's initial one when None.
        tau: torques in place of the scene's actuation, (nv,) or by joint name.
        t: time at which actuation and constraints are taken [s].
        stable: False takes the nearest state of rest that Newton's method meets, be it unstable.
        starts: from how many configurations it is sought.

    Returns:
        The Equilibrium; where no stable one was met, the best that was.

    Raises:
        InputError: an argument does not fit, or rows restrict the velocity only.
        LoopClosureError: the loops cannot be closed.
        EquilibriumError: no state of rest was found.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"equilibrium: scene must be a Scene; got {type(scene).__name__}")
    downhill = choice("equilibrium: stable", stable, (True, False))
    still = np.zeros(scene.model.nv)
    torque = None if tau is None else named_velocity(scene.model, tau, still, "equilibrium: tau")
    time, attempts = number("equilibrium: t", t), count("equilibrium: starts", starts, least=1)
    start = scene.project(q0, still, time)[0]
    search = _Search(AtRest(scene, torque, time, start), downhill)
    best: Equilibrium | None = None
    for k in range(attempts):
        q = start if k == 0 else search.elsewhere(start, k)
        found = None if q is None else search.run(q, k + 1)
        if found is None:
            continue
        if found.stable or not downhill:
            return found
        best = best or found
    if best is None:
        raise EquilibriumError(
            f'no state of rest of "{scene.name}" was found from {attempts} starts: {search.reason()}',
            time=time,
        )
    return best


class _Search:
    """One search after another."""

    def __init__(self, rest: AtRest, downhill: bool) -> None:
        self.rest, self.downhill = rest, downhill
        self.model: Any = rest.scene.model
        self.least = np.inf
        self.nearest = np.array(rest.scene.q0)
        self.unit = np.ones(rest.scene.model.nv)  # a long move of each coordinate

    def elsewhere(self, start: Array, k: int) -> Array | None:
        """Another start, farther away with each; always the same ones."""
        rest, unit = self.rest, self.rest.units(self.rest.mass(start), self.rest.free(start))
        move = unit * np.random.default_rng(k).standard_normal(self.model.nv) * min(1.5, 0.3 * k)
        try:
            return rest.scene.project(pin.integrate(self.model, start, move), rest.still, rest.t)[0]
        except (LoopClosureError, InputError):  # of a contact that would start inside
            return None

    def run(self, q: Array, start: int) -> Equilibrium | None:
        """From one configuration; None where it leads nowhere."""
        self.rest.begin(q)
        self.unit = self.rest.units(self.rest.mass(q), self.rest.free(q))
        now, longest = self.rest.balance(q), LONGEST
        for _ in range(MOST):
            self.note(q, now)
            stiffness = self.stiffness(q, now)
            move, distance, unopposed = self.move(q, now, stiffness)
            if distance <= CLOSE and not unopposed:
                q, now = self.polished(q, now, move)
                return self.result(q, now, self.stiffness(q, now), start)
            size = float(np.abs(move / self.unit).max(initial=0.0))
            scale = min(1.0, longest / size) if size > 0.0 else 1.0
            taken = self.step(q, now, scale * move)
            if taken is not None:
                q, now = taken
                if self.rest.touch(q):
                    now = self.rest.balance(q)
                longest = min(LONGEST, 2.0 * max(longest, scale * size))
            elif (longest := min(longest, scale * size) / 4.0) < SHORTEST:
                break
        return None

    def note(self, q: Array, now: Balance) -> None:
        """Keeps where the least was left."""
        left = float(np.linalg.norm(now.left))
        if left < self.least:
            self.least, self.nearest = left, q

    def reason(self) -> str:
        """Why nothing was found: what drives it where the least was left, or what falls."""
        rubs = "; dry friction counts for nothing here: `rest` tells whether it holds" * bool(
            self.rest.scene.element_names
        )
        now = self.rest.balance(self.nearest)
        way = now.free @ now.left
        way /= np.linalg.norm(way) or 1.0
        drive = now.F - self.rest.undriven(self.nearest)
        power = drive * way
        along, held = float(power.sum()), float(power.sum() - now.F @ way)
        if along <= max(held, 0.0):
            return (
                f"along motions that the constraints allow, forces of {self.least:.2g} (N or N m) are left; "
                f"start nearer, or hold what falls freely{rubs}"
            )
        dof = int(power.argmax())
        ends = [i + n for i, n in zip(self.model.idx_vs, self.model.nvs, strict=True)]
        joint = self.model.names[int(np.searchsorted(ends[1:], dof, side="right")) + 1]
        others = f"all else holds {held:.2g} of it" if held > 0.0 else "nothing else holds against it"
        return (
            f'the drive of joint "{joint}", {drive[dof]:.4g} (N or N m), exceeds what holds it: where the '
            f"least is left, the drives push with {along:.2g} along a motion that the constraints allow, "
            f"and {others}; drive less, or hold more{rubs}"
        )

    def in_play(self, now: Balance, inertia: Array) -> Array:
        """Forces beside which those along the columns of free must be small: what acts, the weight, (k,)."""
        acting = np.abs(now.F) + np.abs(now.A.T) @ np.abs(now.lam)
        pull = weight(self.rest.scene) * np.sqrt(np.diag(inertia))  # the most that it does along each
        return np.asarray(np.abs(now.free).T @ acting + pull)

    def polished(self, q: Array, now: Balance, move: Array) -> tuple[Array, Balance]:
        """After one more step, down to rounding, where that leaves less."""
        there = self.rest.scene.project(pin.integrate(self.model, q, move), self.rest.still, self.rest.t)[0]
        then = self.rest.balance(there)
        return (there, then) if np.linalg.norm(then.left) < np.linalg.norm(now.left) else (q, now)

    def stiffness(self, q: Array, now: Balance) -> Array:
        """- free^T d(F + A^T lam)/dq free with lam held, by central differences."""
        columns = []
        for direction in now.free.T:
            ends, part = [], DIFFERENCE / float(np.linalg.norm(direction / self.unit))
            for sign in (1.0, -1.0):
                there = pin.integrate(self.model, q, sign * part * direction)
                ends.append(self.rest.forces(there) + self.rest.rows(there).T @ now.lam)
            columns.append(-(ends[0] - ends[1]) / (2.0 * part))
        k = now.free.shape[1]
        return now.free.T @ np.array(columns).T if k else np.zeros((0, 0))

    def neutral(self, now: Balance, inertia: Array, stiffness: Array, shapes: Array) -> Array:
        """Stiffness of each shape, a column, that counts as none: each by what adds up in it alone, (k,)."""
        size = np.abs(shapes)
        motion = np.linalg.norm(now.free / self.unit[:, None], axis=0)
        canceled = CANCELED * np.abs(stiffness) + NEUTRAL * np.diag(motion * self.in_play(now, inertia))
        return np.asarray(np.einsum("ik,ij,jk->k", size, canceled, size))

    def move(self, q: Array, now: Balance, stiffness: Array) -> tuple[Array, float, bool]:
        """The step to take; how far Newton's method has to go; whether a force acts without stiffness."""
        from scipy.linalg import eigh

        if not len(now.left):
            return np.zeros(self.model.nv), 0.0, False
        inertia = now.free.T @ self.rest.mass(q) @ now.free
        rates, shapes = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (inertia + inertia.T))
        pull, least = shapes.T @ now.left, self.neutral(now, inertia, stiffness, shapes)
        neutral = np.abs(rates) <= least
        rounding = BALANCED * self.in_play(now, inertia) + ROUNDING * np.abs(stiffness).sum(axis=1)
        pushed = neutral & (np.abs(pull) > np.abs(shapes).T @ rounding)
        steps = np.where(neutral & ~pushed, 0.0, pull / np.where(neutral, least + LEAST_RATE, np.abs(rates)))
        away = now.free @ (shapes @ np.where(neutral, 0.0, steps))
        distance = float(np.abs(away / self.unit).max(initial=0.0))
        if not self.downhill:
            steps = np.linalg.lstsq(stiffness, now.left, rcond=CANCELED)[0]
            return now.free @ steps, distance, bool(pushed.any())
        return now.free @ (shapes @ steps), distance, bool(pushed.any())

    def to_contact(self, q: Array, move: Array) -> Array:
        """The part of a move up to where the first open contact closes, by regula falsi."""
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
        """Where a step leads, unless it climbs: the work of the forces along it must not be negative."""
        scene, move = self.rest.scene, self.to_contact(q, move)
        try:
            there = scene.project(pin.integrate(self.model, q, move), self.rest.still, self.rest.t)[0]
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
        """The equilibrium at a configuration, with its stability."""
        from scipy.linalg import eig

        inertia = now.free.T @ self.rest.mass(q) @ now.free
        found, shapes = eig(stiffness, inertia) if len(now.left) else (np.zeros(0), np.zeros((0, 0)))
        order = np.argsort(found.real)
        rates: NDArray[np.complex128] = np.asarray(found[order], dtype=complex)
        shapes = np.abs(shapes[:, order])
        weights = np.einsum("ik,ij,jk->k", shapes, np.abs(inertia), shapes)
        least = self.neutral(now, inertia, stiffness, shapes) / np.where(weights > 0.0, weights, 1.0)
        neutral = np.abs(rates) <= least
        grows = ~neutral & ((rates.real < 0.0) | (np.abs(rates.imag) > 1e-3 * np.abs(rates)))
        verdict = False if grows.any() else None if neutral.any() else True
        left = float(np.abs(now.left).max(initial=0.0))
        return Equilibrium(q, now.lam, left, now.free, stiffness, rates, verdict, start)
