"""A reference motion on the constraints of a scene: some coordinates are given, and the others follow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.held import Held, settled
from pin_nonideal.states.reference_motion import ReferenceMotion
from pin_nonideal.states.rows import DEPENDENT, holonomic_rows, rows_at
from pin_nonideal.states.scales import coordinate
from pin_nonideal.types import Array

from .inverse_dynamics import inverse_dynamics
from .residual import AtRest

Mask = NDArray[np.bool_]

# Velocities of a coordinate below this part of the admitted ones depend on the coordinates chosen before.
INDEPENDENT = 1e-6
CLOSED = 1e-9  # residual of a reference on the constraints, relative to the scene's length or 1 m


class ClosedReference:
    """A reference motion on the constraints, and the torques that drive it.

    As many given coordinates as the constraints leave free are kept, driven ones first. The other coordinates
    follow from the constraints at every time.

    Args:
        scene: the scene without actuation and contacts; its constraints hold positions.
        times: sample times [s], (nt,).
        q: configurations, (nt, nq); coordinates that are not given are guesses.
        v: velocities, (nt, nv), or None.
        given: mask of the given coordinates, (nv,).
        driven: names of the driven joints.
        dofs: mask of their degrees of freedom, (nv,).
        who: words for messages.

    Raises:
        InputError: the given coordinates do not determine the motion, or no configuration on the constraints
            has them.
    """

    def __init__(
        self,
        scene: Scene,
        times: Array,
        q: Array,
        v: Array | None,
        given: Mask,
        driven: list[str],
        dofs: Mask,
        who: str,
    ) -> None:
        self._scene, self._driven, self._who = scene, driven, who
        compiled = compiled_scene(scene)
        self._runner, self._rows = compiled.program.runner(), holonomic_rows(compiled.program)
        self._allowed = CLOSED * max(1.0, compiled.projection.length)
        still = np.zeros(scene.model.nv)
        start = compiled.project(q[0], still, float(times[0]), Held(q=given & dofs))[0]
        basis = AtRest(scene, still, float(times[0]), start).free(start)
        self._free = ~self._independent(basis, [given & dofs, given])
        on = np.array(q)
        before = start
        for k, t in enumerate(times.tolist()):
            guess = np.where(self._kept(given), q[k], before)
            on[k] = before = self._settled(guess, t)
        on_rates = None if v is None else np.array(v)
        if on_rates is not None:
            for k, t in enumerate(times.tolist()):
                on_rates[k] = self._velocity(on[k], on_rates[k], t)
        self._motion = ReferenceMotion(scene.model, times, on, on_rates)

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Return q (nq,), v (nv,) and a (nv,) on the constraints at time t [s]."""
        q, v, a = self._motion(t)
        q = self._settled(q, t)
        v = self._velocity(q, v, t)
        A, b, _, _ = rows_at(self._runner, q, v, t)
        a = np.array(a)
        a[self._free] += self._solved(A, b - A @ a, t)
        return q, v, a

    def torques(self, q: Array, v: Array, a: Array, t: float) -> Array:
        """Return the torques of the driven joints for a motion on the constraints, (nv,)."""
        return inverse_dynamics(self._scene, q, v, a, self._driven, t=t).tau

    def _kept(self, given: Mask) -> Mask:
        """Return the mask of configuration values that belong to given coordinates, (nq,)."""
        model = self._scene.model
        kept = np.zeros(model.nq, dtype=bool)
        for j in range(1, model.njoints):
            if given[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]].any():
                kept[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]] = True
        return kept

    def _independent(self, basis: Array, groups: list[Mask]) -> Mask:
        """Return the mask of coordinates that determine the motion, (nv,), from the first groups first."""
        chosen, left = np.zeros(len(basis), dtype=bool), basis.copy()
        for group in groups:
            while chosen.sum() < basis.shape[1]:
                sizes = np.where(group & ~chosen, np.linalg.norm(left, axis=1), 0.0)
                best = int(np.argmax(sizes))
                if sizes[best] < INDEPENDENT:
                    break
                chosen[best] = True
                along = left[best] / sizes[best]
                left = left - np.outer(left @ along, along)
        if chosen.sum() < basis.shape[1]:
            loose = coordinate(self._scene.model, int(np.argmax(np.linalg.norm(left, axis=1))))
            raise InputError(
                f'{self._who}: q must determine the motion with feedforward "constrained"; the constraints '
                f'leave "{loose}" free beside the joints that q names; name further joints'
            )
        return chosen

    def _settled(self, q: Array, t: float) -> Array:
        """Return the configuration on the constraints with the independent coordinates of q, (nq,)."""
        on = settled(self._scene.model, self._runner, q, self._free, self._rows, t)
        residual = rows_at(self._runner, on, np.zeros(len(self._free)), t)[2][self._rows]
        if not np.abs(residual).max(initial=0.0) <= self._allowed:
            raise InputError(
                f"{self._who}: no configuration on the constraints has the reference at t = {t:g} s; the "
                f"loops stay open by {np.abs(residual).max():.2g} (m or rad)"
            )
        return on

    def _velocity(self, q: Array, v: Array, t: float) -> Array:
        """Return the velocity on the constraints with the independent entries of v, (nv,)."""
        A, _, _, rate = rows_at(self._runner, q, v, t)
        found = np.array(v)
        found[self._free] -= self._solved(A, rate, t)
        return found

    def _solved(self, A: Array, b: Array, t: float) -> Array:
        """Solve A x = b for the dependent coordinates."""
        own = A[np.ix_(self._rows, self._free)]
        x, _, rank, _ = np.linalg.lstsq(own, b[self._rows], rcond=DEPENDENT)
        if rank < own.shape[1]:
            raise InputError(
                f"{self._who}: the reference passes a singular position at t = {t:g} s, where the given "
                "coordinates do not determine the others"
            )
        return np.asarray(x)


def without_drives(model: Any, q0: Array, said: Any, who: str) -> Scene:
    """Return a scene with the constraints, laws and forces of another, without contacts and actuation.

    Args:
        model: pinocchio.Model.
        q0: initial configuration, (nq,).
        said: descriptions of the other scene.
        who: words for messages.

    Raises:
        InputError: a constraint holds no position.
    """
    scene = Scene(
        model,
        constraints=said.constraints,
        laws=said.laws,
        forces=said.forces,
        q0=q0,
        terms=said.terms,
        assembly_tolerance=said.assembly_tolerance,
    )
    program = compiled_scene(scene).program
    for c in program.constraints:
        if not np.all(c.holonomic):
            raise InputError(
                f'{who}: feedforward "constrained" needs constraints of positions; "{c.name}" constrains '
                'velocities only; take feedforward "rnea" or "gravity"'
            )
    return scene
