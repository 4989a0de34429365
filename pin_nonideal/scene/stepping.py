"""Steps of a scene for user-written loops: single steps from any state, or period by period in one run."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.delay import DelayedTorque
from pin_nonideal.core_loader import core
from pin_nonideal.errors import InputError
from pin_nonideal.states.parsing import named_configuration, named_joint_values, named_velocity
from pin_nonideal.types import Array, State
from pin_nonideal.validation import choice, nonnegative, number, positive, relative_tolerance

from .evaluation import Evaluator
from .state import SceneStates

# Methods of the core, and its methods with a fixed step.
CORE_METHODS = tuple(method.name for method in core.methods() if not method.outside)
FIXED_STEP_METHODS = tuple(
    method.name for method in core.methods() if not method.outside and not method.adaptive
)
RTOL, ATOL = 1e-8, 1e-10
# Steps fit into a period if their number differs from a whole number by at most this fraction.
PERIOD_ROUNDING = 1e-9


class Stepper:
    """A run that a controller advances period by period, each from the end of the last.

    `Scene.stepper` creates it. Torques may change between two periods. Step sizes, modes of dry friction and
    factorizations are kept between periods, so a period costs only its steps.

    Args:
        run: stepped run of the core.
        compiled: the compiled scene.
        method: method of the run.
        delayed: delayed torques of the run, or None.
    """

    def __init__(
        self,
        run: core.SteppedRun,
        compiled: CompiledScene,
        method: str,
        delayed: DelayedTorque | None = None,
    ) -> None:
        self._run, self._compiled, self._method, self._delayed = run, compiled, method, delayed

    def __repr__(self) -> str:
        at = f"at t = {self.t:g} s" if self._run.begun else "stopped"
        return f"<Stepper {at}>"

    @property
    def t(self) -> float:
        """Current time [s]."""
        self._require_begun()
        return self._run.t

    @property
    def q(self) -> Array:
        """Current configuration, (nq,), a copy."""
        self._require_begun()
        return self._run.state()[0]

    @property
    def v(self) -> Array:
        """Current velocity, (nv,), a copy."""
        self._require_begun()
        return self._run.state()[1]

    @property
    def modes(self) -> NDArray[np.int8]:
        """Current mode of each friction element: +1 or -1 slips, 0 sticks, 2 if its contact is open."""
        modes = np.array([int(mode) for mode in self._run.modes], dtype=np.int8)
        return np.asarray(self._compiled.elements.modes(modes))

    def step(self, tau: ArrayLike | None = None) -> tuple[Array, Array]:
        """Advance the run by one period.

        Args:
            tau: joint torques that replace the scene's actuation from now on, (nv,) [N m or N]; None keeps
                the current torques.

        Returns:
            q (nq,) and v (nv,) at the end of the period.

        Raises:
            InputError: tau does not fit, or the run has stopped.
            RunError: the run stopped within the period; `reset` starts a new run.
        """
        self._require_begun()
        self._guarded(self._run.advance, tau)
        return self._run.state()

    def reset(self, q: State, v: State, t: float = 0.0, tau: ArrayLike | None = None) -> None:
        """Restart the run at a state and discard all previous data.

        Args:
            q: configuration on the constraints, (nq,), as from `Scene.project`, or by joint name; joints
                without an entry take `q0`.
            v: velocity on the constraints, (nv,), or by joint name; joints without an entry rest.
            t: time [s].
            tau: joint torques that replace the scene's actuation, (nv,), or None.

        Raises:
            InputError: an argument does not fit.
            RunError: no motion exists from this state.
        """
        model = self._compiled.model
        at = named_configuration(model, q, self._compiled.q0, "Stepper: q")
        speed = named_velocity(model, v, np.zeros(model.nv), "Stepper: v")
        time = number("Stepper: t", t)
        self._compiled.check_functions(at, speed, time)
        if self._delayed is not None:
            self._delayed.begin(time)
        self._guarded(lambda torque: self._run.begin(at, speed, time, torque), tau)

    def _guarded(self, act: Callable[[object], None], tau: ArrayLike | None) -> None:
        try:
            act(tau)
        except (TypeError, ValueError):
            torque = None if tau is None else named_joint_values(self._compiled.model, tau, "Stepper: tau")
            try:
                act(None if torque is None else np.ascontiguousarray(torque))
            except ValueError as error:
                raise InputError(f"Stepper: {error}") from None
            except core.CoreFailure as failure:
                raise self._compiled.named(failure, self._method) from None
        except core.CoreFailure as failure:
            raise self._compiled.named(failure, self._method) from None

    def _require_begun(self) -> None:
        if not self._run.begun:
            raise InputError("Stepper: the run has stopped; start a new run with reset(q, v)")


class SceneStepper:
    """Takes steps of a scene.

    Args:
        compiled: the compiled scene.
        states: its states.
        evaluator: evaluates it.
    """

    def __init__(self, compiled: CompiledScene, states: SceneStates, evaluator: Evaluator) -> None:
        self._compiled, self._states, self._evaluator = compiled, states, evaluator
        self._runs: dict[tuple[str, float], core.SteppedRun] = {}  # by method and length

    def step(
        self, q: State, v: State, tau: ArrayLike | None, dt: float, t: float, method: str
    ) -> tuple[Array, Array]:
        """One step of a method from any state, see `Scene.step`."""
        self._states.require_unchanged()
        known = isinstance(dt, float) and isinstance(method, str)
        run = self._runs.get((method, dt)) if known else None
        if run is None:
            choice("step: method", method, FIXED_STEP_METHODS)
            length = positive("step: dt", dt)
            run = self._runs[method, length] = self._new_run(
                self._compiled.program, method, length, length, RTOL, ATOL
            )
        if self._compiled.unchecked:
            self._states.check_functions_at(q, v, t)
        try:  # arrays of the right shape go straight to the core, which checks sizes, lengths and finiteness
            return run.step(q, v, t, tau)
        except (TypeError, ValueError, core.CoreFailure):
            state = self._evaluator.arguments(q, v, t, tau)
        try:
            return run.step(*state)
        except core.CoreFailure as failure:
            raise self._compiled.named(failure, method) from None

    def stepper(
        self,
        period: float,
        q: State | None,
        v: State | None,
        t0: float,
        tau: ArrayLike | None,
        method: str,
        dt: float | None,
        rtol: float | None,
        atol: float | None,
    ) -> Stepper:
        """Return a run that advances period by period, see `Scene.stepper`."""
        choice("stepper: method", method, CORE_METHODS)
        length = positive("stepper: period", period)
        if dt is not None and method not in FIXED_STEP_METHODS:
            raise InputError(f'stepper: method "{method}" chooses its own steps; leave dt out')
        size = length if dt is None else positive("stepper: dt", dt)
        if (
            not length / size >= 1.0 - PERIOD_ROUNDING
            or abs(length / size - round(length / size)) > PERIOD_ROUNDING * length / size
        ):
            raise InputError(
                f"stepper: period must be a whole number of steps; got {length:g} s and dt = {size:g} s"
            )
        tolerances = (
            RTOL if rtol is None else relative_tolerance("stepper: rtol", positive("stepper: rtol", rtol)),
            ATOL if atol is None else nonnegative("stepper: atol", atol),
        )
        begin = number("stepper: t0", t0)
        program, delayed = self._compiled.program_of_runs(begin)
        run = self._new_run(program, method, length, size, *tolerances)
        stepper = Stepper(run, self._compiled, method, delayed)
        at, speed, _ = self._states.project(q, v, begin)
        stepper.reset(at, speed, begin, tau)
        return stepper

    def _new_run(
        self, program: core.Program, method: str, period: float, dt: float, rtol: float, atol: float
    ) -> core.SteppedRun:
        tolerance = np.full(2 * self._compiled.model.nv + program.states, atol)
        return core.SteppedRun(program, method, period, dt, rtol, tolerance)
