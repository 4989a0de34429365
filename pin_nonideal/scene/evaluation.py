"""Accelerations and forces of a scene at one state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.equation import Solution
from pin_nonideal.errors import InputError
from pin_nonideal.states.parsing import named_joint_values
from pin_nonideal.types import Array, State
from pin_nonideal.validation import choice, number

from .state import SceneStates

Rest = ParamSpec("Rest")
Result = TypeVar("Result")

# Behavior if laws and dynamics admit several motions.
SEVERAL_CHOICES = ("error", "continue")


class Evaluator:
    """Evaluates Eq. (40) of a compiled scene.

    Args:
        compiled: the compiled scene.
        states: its states.
    """

    def __init__(self, compiled: CompiledScene, states: SceneStates) -> None:
        self._compiled, self._states = compiled, states
        self._model, self._nv = compiled.model, int(compiled.model.nv)
        self._is_of = compiled.program.is_of

    @cached_property
    def runner(self) -> core.Runner:
        """The core's workspace for single states."""
        return self._compiled.program.runner()

    def solve(
        self,
        q: State,
        v: State,
        t: float,
        tau: ArrayLike | None,
        modes: Sequence[int] | None,
        several: str,
        unilateral: bool,
    ) -> Solution:
        """Solution at one state, see `Scene.solve`.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            t: time [s].
            tau: joint torques instead of the scene's actuation, (nv,).
            modes: mode of each friction element, or None.
            several: "error" or "continue".
            unilateral: whether the scene has unilateral contacts.

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        self.runner.continues = choice("solve: several", several, SEVERAL_CHOICES) == "continue"
        prescribed = None if modes is None else self._modes(modes, unilateral)
        now = self.call(self.runner.solve, q, v, t, tau, prescribed)
        compiled = self._compiled
        used = compiled.elements.modes(np.array(now.modes, dtype=np.int8))
        closed = compiled.contacts.any(np.array(now.closed, dtype=bool))
        lam = compiled.multipliers.groups.sum(now.lam)
        return Solution(now.a, now.F_ideal, now.F_nonideal, lam, now.rank, used, now.unique, closed)

    def _modes(self, modes: Sequence[int], unilateral: bool) -> list[core.Mode]:
        names = self._compiled.elements.names
        values = np.asarray(modes, dtype=object)
        known = [int(mode) for mode in core.Mode if unilateral or mode is not core.Mode.unloaded]
        if values.shape != (len(names),) or not np.isin(values, known).all():
            raise InputError(
                f"modes must hold {len(names)} numbers out of {', '.join(map(str, known))}; got {modes}"
            )
        return [core.Mode(int(mode)) for mode in values[self._compiled.elements.index]]

    def acceleration(self, q: State, v: State, tau: ArrayLike | None, t: float, several: str) -> Array:
        """Acceleration at one state, (nv,), see `Scene.acceleration`.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            tau: joint torques instead of the scene's actuation, (nv,).
            t: time [s].
            several: "error" or "continue".

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        if not self._is_of(self._model):
            self._states.require_unchanged()
        if self._compiled.unchecked:
            self._states.check_functions_at(q, v, t)
        if several not in SEVERAL_CHOICES:
            choice("acceleration: several", several, SEVERAL_CHOICES)
        a = np.empty(self._nv)
        self.runner.continues = several == "continue"
        try:  # arrays of the right shape go straight to the core, which checks sizes, lengths and finiteness
            self.runner.acceleration(q, v, t, tau, a)
        except (TypeError, ValueError, core.CoreFailure):
            self.call(self.runner.acceleration, q, v, t, tau, a)
        return a

    def call(
        self,
        function: Callable[Concatenate[Array, Array, float, Array | None, Rest], Result],
        q: State,
        v: State,
        t: float,
        tau: ArrayLike | None,
        *rest: Rest.args,
        **named: Rest.kwargs,
    ) -> Result:
        """Result of a function of the core at a state that is checked here."""
        try:
            return function(*self.arguments(q, v, t, tau), *rest, **named)
        except core.CoreFailure as failure:
            raise self._compiled.named(failure) from None

    def arguments(
        self, q: State, v: State, t: float, tau: ArrayLike | None
    ) -> tuple[Array, Array, float, Array | None]:
        """Check a state and torques, and return them as numbers.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            t: time [s].
            tau: joint torques, (nv,) or by joint name, or None.

        Raises:
            InputError: wrong shapes or numbers.
        """
        q_in, v_in = self._states.configuration(q, "q"), self._states.velocity(v, "v")
        self._states.check_functions_at(q_in, v_in, t)
        torque = None if tau is None else named_joint_values(self._compiled.model, tau, "tau")
        return q_in, v_in, number("t", t), torque

    def rank(self, q: Array, v: Array) -> int:
        """Number of independent rows at a state, where every friction element slips.

        Args:
            q: configuration on the constraints, (nq,).
            v: velocity on them, (nv,).
        """
        slipping = [core.Mode.slip_plus] * len(self._compiled.element_names)
        self.runner.solve(q, v, 0.0, modes=slipping)
        return int(self.runner.rank)
