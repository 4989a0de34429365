"""Stepping of a scene by user code: single steps from any state, or one run period by period."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pin_nonideal.core_loader import core
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, State
from pin_nonideal.validation import array, choice, nonnegative, number, positive

if TYPE_CHECKING:
    from pin_nonideal.compilation.compiled_scene import CompiledScene

# Methods of the core, and its methods with a fixed step.
STEPPING = tuple(method.name for method in core.methods() if not method.outside)
FIXED = tuple(method.name for method in core.methods() if not method.outside and not method.adaptive)
RTOL, ATOL = 1e-8, 1e-10
# Relative tolerance for a whole number of steps in a period.
WHOLE = 1e-9


class Stepper:
    """A run that a controller advances period by period, each from the end of the last.

    `Scene.stepper` creates it. Torques may change between two periods. Step sizes, modes of dry friction and
    factorizations are kept between periods, so a period costs only its steps.

    Args:
        run: stepped run of the core.
        compiled: the compiled scene.
    """

    def __init__(self, run: core.SteppedRun, compiled: CompiledScene) -> None:
        self._run, self._compiled = run, compiled

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
    def modes(self) -> Array:
        """Current mode of each friction element: +1 or -1 slips, 0 sticks, 2 if its contact is open."""
        return np.array([int(mode) for mode in self._run.modes], dtype=np.int8)

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

    def reset(self, q: Array, v: Array, t: float = 0.0, tau: ArrayLike | None = None) -> None:
        """Restart the run at a state and discard all previous data.

        Args:
            q: configuration on the constraints, (nq,), as from `Scene.project`.
            v: velocity on the constraints, (nv,).
            t: time [s].
            tau: joint torques that replace the scene's actuation, (nv,), or None.

        Raises:
            InputError: an argument does not fit.
            RunError: no motion exists from this state.
        """
        model = self._compiled.model
        at, speed = array("Stepper: q", q, (model.nq,)), array("Stepper: v", v, (model.nv,))
        time = number("Stepper: t", t)
        self._compiled.check_functions(at, speed, time)
        self._guarded(lambda torque: self._run.begin(at, speed, time, torque), tau)

    def _guarded(self, act: Callable[[Any], None], tau: ArrayLike | None) -> None:
        try:
            act(tau)
        except (TypeError, ValueError):
            torque = None if tau is None else array("Stepper: tau", tau, (self._compiled.model.nv,))
            try:
                act(None if torque is None else np.ascontiguousarray(torque))
            except ValueError as error:
                raise InputError(f"Stepper: {error}") from None
            except core.CoreFailure as failure:
                raise self._compiled.named(failure) from None
        except core.CoreFailure as failure:
            raise self._compiled.named(failure) from None

    def _require_begun(self) -> None:
        if not self._run.begun:
            raise InputError("Stepper: the run has stopped; begin anew with reset(q, v)")


class Steps:
    """Methods of a Scene for stepping by user code."""

    if TYPE_CHECKING:
        _compiled: CompiledScene
        _steps: dict[tuple[str, float], core.SteppedRun]
        _call: Callable[..., Any]
        _require_unchanged: Callable[[], None]
        _checked_at: Callable[[State, State, float], None]
        project: Callable[..., Any]

    def step(
        self,
        q: State,
        v: State,
        tau: ArrayLike | None,
        dt: float,
        *,
        t: float = 0.0,
        method: str = "semi_implicit_euler",
    ) -> tuple[Array, Array]:
        """Take one step from any state, for controllers and learning loops.

        The result is the final state of `simulate(scene, dt, q, v, method=method, dt=dt)`, including friction
        and contact events inside the step.

        Args:
            q: configuration on the constraints, (nq,) or by joint name.
            v: velocity on the constraints, (nv,) or by joint name.
            tau: joint torques, (nv,) [N m or N]; those of the scene's actuation when None.
            dt: length of the step [s].
            t: time at the start of the step [s].
            method: method of the core with a fixed step: "semi_implicit_euler", "rk4" or "moreau".

        Returns:
            q (nq,) and v (nv,) at the end of the step.

        Raises:
            InputError: an argument does not fit.
            RunError: the run stops inside the step.
        """
        self._require_unchanged()
        known = isinstance(dt, float) and isinstance(method, str)
        run = self._steps.get((method, dt)) if known else None
        if run is None:
            choice("step: method", method, FIXED)
            length = positive("step: dt", dt)
            run = self._steps[method, length] = self._new_run(method, length, length, RTOL, ATOL)
        if self._compiled.unchecked:
            self._checked_at(q, v, t)
        try:  # the core checks sizes, unit lengths and finiteness of arrays
            return run.step(q, v, t, tau)
        except (TypeError, ValueError, core.CoreFailure):
            return self._call(run.step, q, v, t, tau)  # type: ignore[no-any-return]

    def stepper(
        self,
        period: float,
        q: State | None = None,
        v: State | None = None,
        *,
        t0: float = 0.0,
        tau: ArrayLike | None = None,
        method: str = "semi_implicit_euler",
        dt: float | None = None,
        rtol: float | None = None,
        atol: float | None = None,
    ) -> Stepper:
        """Return a run that advances period by period with user torques and keeps its state between calls.

        Args:
            period: duration of each call of `Stepper.step` [s].
            q: initial configuration, (nq,) or by joint name, projected onto the constraints; the scene's when
                None.
            v: initial velocity, (nv,) or by joint name; the scene's when None.
            t0: initial time [s].
            tau: joint torques that replace the scene's actuation from the start, (nv,), or None.
            method: method of the core, adaptive or with a fixed step.
            dt: step of fixed-step methods [s]; the period must be a multiple of it. None for the period.
            rtol: relative tolerance of adaptive methods, 1e-8 when None.
            atol: absolute tolerance, 1e-10 when None.

        Returns:
            The Stepper, at its initial state.

        Raises:
            InputError: an argument does not fit.
            RunError: no motion exists from the initial state.
        """
        choice("stepper: method", method, STEPPING)
        length = positive("stepper: period", period)
        if dt is not None and method not in FIXED:
            raise InputError(f'stepper: method "{method}" chooses its own steps; leave dt out')
        size = length if dt is None else positive("stepper: dt", dt)
        if (
            not length / size >= 1.0 - WHOLE
            or abs(length / size - round(length / size)) > WHOLE * length / size
        ):
            raise InputError(
                f"stepper: period must be a whole number of steps; got {length:g} s and dt = {size:g} s"
            )
        tolerances = (
            RTOL if rtol is None else positive("stepper: rtol", rtol),
            ATOL if atol is None else nonnegative("stepper: atol", atol),
        )
        made = Stepper(self._new_run(method, length, size, *tolerances), self._compiled)
        begin = number("stepper: t0", t0)
        at, speed = self.project(q, v, begin)
        made.reset(at, speed, begin, tau)
        return made

    def _new_run(self, method: str, period: float, dt: float, rtol: float, atol: float) -> core.SteppedRun:
        program = self._compiled.program
        tolerance = np.full(2 * self._compiled.model.nv + program.states, atol)
        return core.SteppedRun(program, method, period, dt, rtol, tolerance)
