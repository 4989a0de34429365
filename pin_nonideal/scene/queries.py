"""Matrices, forces and energies of a scene at one state."""

from __future__ import annotations

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.errors import UnknownNameError, nearest
from pin_nonideal.states.rows import rows_at
from pin_nonideal.types import Array, State
from pin_nonideal.validation import number, text

from .evaluation import Evaluator
from .state import SceneStates


class Queries:
    """Evaluation of terms of the equation of motion. The closed initial state is the default state.

    Args:
        compiled: the compiled scene.
        states: its states.
        evaluator: evaluator of the scene.
        name: name of the scene in messages.
    """

    def __init__(self, compiled: CompiledScene, states: SceneStates, evaluator: Evaluator, name: str) -> None:
        self._compiled, self._states, self._name = compiled, states, name
        self._evaluator = evaluator
        self._nv = int(compiled.model.nv)

    def mass_matrix(self, q: State | None) -> Array:
        """M(q) of the tree, without constraints, (nv, nv)."""
        return self._evaluator.runner.terms(self._at(q), np.zeros(self._nv))[0].reshape(self._nv, self._nv)

    def bias_forces(self, q: State | None, v: State | None) -> Array:
        """Coriolis, centrifugal and gravity forces, (nv,)."""
        return self._evaluator.runner.terms(self._at(q), self._speed(v))[1]

    def jacobian(self, name: str, q: State | None, t: float) -> Array:
        """Rows of one constraint or contact, (rows, nv)."""
        known, slices = self._compiled.rows, self._compiled.slices
        if text("jacobian: name", name) not in known:
            raise UnknownNameError(
                f'no constraint or contact "{name}" in scene "{self._name}"{nearest(name, known)}'
            )
        points = self._compiled.points.get(name, [name])
        rows = slice(slices[points[0]].start, slices[points[-1]].stop)
        return rows_at(self._evaluator.runner, self._at(q), np.zeros(self._nv), number("t", t))[0][rows]

    def energies(self, q: State | None, v: State | None) -> dict[str, float]:
        """Kinetic, potential and total energy [J], by name."""
        kinetic, potential = self._evaluator.runner.energies(self._at(q), self._speed(v))
        return {"kinetic": kinetic, "potential": potential, "total": kinetic + potential}

    def _at(self, q: State | None) -> Array:
        return self._states.closed_initial()[0] if q is None else self._states.configuration(q, "q")

    def _speed(self, v: State | None) -> Array:
        return np.zeros(self._nv) if v is None else self._states.velocity(v, "v")
