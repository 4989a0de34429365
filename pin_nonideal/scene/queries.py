"""Queries of a scene: mass matrix, bias forces, Jacobians, energies and tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from pin_nonideal.compilation.summary import Description, describe
from pin_nonideal.errors import UnknownNameError, nearest
from pin_nonideal.states.rows import rows_at
from pin_nonideal.types import Array, State
from pin_nonideal.validation import number

if TYPE_CHECKING:
    from pin_nonideal.compilation.compiled_scene import CompiledScene
    from pin_nonideal.core_loader import core


class Tables:
    """Methods of a Scene that return matrices, energies and tables."""

    if TYPE_CHECKING:
        name: str
        _compiled: CompiledScene
        _runner: core.Runner

        def _configuration(self, q: State, what: str) -> Array: ...
        def _velocity(self, v: State, what: str) -> Array: ...

        initial_state: Callable[[], tuple[Array, Array]]

    def describe(self) -> Description:
        """Return tables of joints, constraints, contacts, laws, forces and actuation.

        `str` formats the tables as text; `to_dict()` returns plain values.
        """
        return describe(self._compiled, self.name)

    def mass_matrix(self, q: State | None = None) -> Array:
        """Return the mass matrix M(q) of the tree, without constraints, (nv, nv).

        Args:
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
        """
        at = self._at(q)
        nv = self._compiled.model.nv
        return self._runner.terms(at, np.zeros(nv))[0].reshape(nv, nv)

    def bias_forces(self, q: State | None = None, v: State | None = None) -> Array:
        """Return Coriolis, centrifugal and gravity forces b of M a + b = tau, (nv,), as nonLinearEffects.

        Args:
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
            v: velocity, (nv,) or by joint name; zero when None.
        """
        return self._runner.terms(self._at(q), self._speed(v))[1]

    def jacobian(self, name: str, q: State | None = None, t: float = 0.0) -> Array:
        """Return rows A of one constraint or contact, A a = b, in the order and scale of `lam`, (rows, nv).

        Rows that can never act are included.

        Args:
            name: name of the constraint or contact.
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
            t: time [s].

        Raises:
            UnknownNameError: no constraint or contact has that name.
        """
        slices = self._compiled.slices
        if name not in slices:
            raise UnknownNameError(
                f'no constraint or contact "{name}" in scene "{self.name}"{nearest(name, slices)}'
            )
        at = self._at(q)
        return rows_at(self._runner, at, np.zeros(self._compiled.model.nv), number("t", t))[0][slices[name]]

    def energies(self, q: State | None = None, v: State | None = None) -> dict[str, float]:
        """Return energies by name [J]: "kinetic", "potential" (gravity, zero at the world's origin), "total".

        Spring energy is not included: a run's ledger counts it as work of applied forces.

        Args:
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
            v: velocity, (nv,) or by joint name; zero when None.
        """
        kinetic, potential = self._runner.energies(self._at(q), self._speed(v))
        return {"kinetic": kinetic, "potential": potential, "total": kinetic + potential}

    def _at(self, q: State | None) -> Array:
        return self.initial_state()[0] if q is None else self._configuration(q, "q")

    def _speed(self, v: State | None) -> Array:
        return np.zeros(self._compiled.model.nv) if v is None else self._velocity(v, "v")
