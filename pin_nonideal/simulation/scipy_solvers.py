"""SciPy's implicit methods on the core's right-hand side, for stiff scenes.

The state is y = (q, v, states of laws, work of the ledger's columns), with q in ambient coordinates.
Quaternions and (cos, sin) pairs are plain numbers. The right-hand side is also smooth for other lengths.
The core monitors the steps: modes of dry friction are fixed within a step, events are located by the method's
interpolant, and the integrator restarts after each event. Radau is a one-step method and continues from the
projected state after each step. BDF and LSODA use earlier steps: their samples are projected, and they
restart from the projected state when their own state is several tolerances away from it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.description.drive_kinds import switching_drives
from pin_nonideal.errors import InputError, RunError, StepSizeError
from pin_nonideal.types import Array, Table

from .events import Watched
from .methods import ONE_STEP
from .options import RunOptions

Tick = Callable[[float], None]  # function of the time [s]

# Smallest relative tolerance that SciPy's methods accept and reach.
MIN_RTOL = 1e-13
# Distance of a state of BDF or LSODA to its projection at which the method restarts, in tolerances.
# A velocity that violates the rows of a wheel displaces the wheel permanently.
MAX_DRIFT = 10.0
# Absolute tolerance of work: excludes work from step size control.
WORK_ATOL = 1e100


class _Run:
    """One run with a SciPy solver: right-hand side, Jacobian, tolerances and steps."""

    def __init__(
        self, compiled: CompiledScene, options: RunOptions, tick: Tick | None, events: Sequence[Watched]
    ) -> None:
        self.model, self.options = compiled.model, options
        self.core = core.ExternalRun(compiled.program, options, tick, list(events))
        self.failure: core.CoreFailure | None = None

    def rate(self, t: float, y: Array) -> Array:
        """Return dy/dt, or NaN if a trial state cannot be evaluated, so that SciPy tries a shorter step."""
        try:
            return self.core.derivative(t, np.ascontiguousarray(y))
        except core.CoreFailure as failure:
            if self.options.method == "LSODA":  # LSODA does not check for NaN
                raise
            self.failure = failure
            return np.full(y.shape, np.nan)

    def jacobian(self, t: float, y: Array) -> Array:
        """Return d(dy/dt)/dy; difference steps of SciPy grow with the angle of a joint after many turns."""
        return self.core.jacobian(t, np.ascontiguousarray(y))

    def tolerance(self, size: int) -> Array:
        """Return absolute tolerances in ambient coordinates; a quaternion has the smallest of its joint."""
        atol, model = self.options.atol, self.model
        positions = np.empty(model.nq)
        for joint in list(model.joints)[1:]:
            own = atol[joint.idx_v : joint.idx_v + joint.nv]
            same = joint.nq == joint.nv
            positions[joint.idx_q : joint.idx_q + joint.nq] = own if same else own.min(initial=np.inf)
        known = np.concatenate([positions, atol[model.nv :]])
        return np.concatenate([known, np.full(size - known.size, WORK_ATOL)])

    def smooth_stretch(self, method: Any, t_end: float) -> None:
        """Integrate to the next event, to the next break of a function of time, or to the end."""
        self._require_regular_start()
        y = self.core.y
        tolerance = {"rtol": max(self.options.rtol, MIN_RTOL), "atol": self.tolerance(y.size)}
        stop = self.core.stop_before(t_end)
        solver = method(self.rate, self.core.t, y, stop, jac=self.jacobian, **tolerance)
        while solver.status == "running":
            self.failure = None
            self._step(solver)
            if self.core.stop_before(solver.t) < solver.t:  # a break lies inside the step, which is repeated
                return
            if self.core.follow(solver.t, solver.dense_output()):
                return
            if self.options.method not in ONE_STEP:
                if self._drift(solver.y, tolerance) > MAX_DRIFT:
                    return
            elif not np.array_equal(solver.y, self.core.y):
                solver.y, solver.f = self.core.y, self.core.rate

    def _drift(self, y: Array, tolerance: Table) -> float:
        """Return the distance of a state to its projection, in tolerances."""
        size = self.model.nq + self.model.nv
        distance = np.abs(y - self.core.y)[:size]
        return float((distance / (tolerance["atol"] + tolerance["rtol"] * np.abs(y))[:size]).max(initial=0.0))

    def _require_regular_start(self) -> None:
        """Check for a singular slip onset, whose direction relaxes faster than any step of these methods.

        Raises:
            StepSizeError: slip in several directions has a singular onset.
        """
        element = self.core.singular_onset
        if element is None:
            return
        raise StepSizeError(
            f'{self.options.method} cannot continue at t = {self.core.t:.6g} s: "{element}" begins to slip '
            "in several directions with hardly any acceleration, and its direction relaxes faster than any "
            'step; use method="dop853", which solves for the direction of an onset, or a larger '
            "static_ratio; the trajectory up to this time is in error.trajectory",
            time=self.core.t,
        )

    def _step(self, solver: Any) -> None:
        message = solver.step()
        if solver.status != "failed":
            return
        if self.failure is not None:
            raise self.failure
        raise StepSizeError(
            f"{self.options.method} cannot continue at t = {solver.t:.6g} s ({message}): the motion is "
            "singular there; check the last samples, or loosen rtol and atol; the trajectory up to this "
            "time is in error.trajectory",
            time=float(solver.t),
        )


def _one_blas_thread() -> AbstractContextManager[object]:
    """Return a context with one BLAS thread: small factorizations are much slower on several threads."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:  # slower, with the same results
        return nullcontext()
    limits: AbstractContextManager[object] = threadpool_limits(limits=1, user_api="blas")
    return limits


def simulate_stiff(
    compiled: CompiledScene,
    q0: Array,
    v0: Array,
    options: RunOptions,
    tick: Tick | None,
    events: Sequence[Watched] = (),
) -> tuple[core.Outcome, BaseException | None]:
    """Simulate with one of SciPy's implicit methods.

    Args:
        compiled: compiled scene to simulate.
        q0: initial configuration on the constraints, (nq,).
        v0: initial velocity on the constraints, (nv,).
        options: checked options of the run.
        tick: progress function of the time, or None.
        events: event functions of the user.

    Returns:
        Outcome recorded by the core, and the exception that stopped the run, or None.

    Raises:
        InputError: torques of the actuation jump, and these methods would step over the jumps.
    """
    from scipy import integrate

    if switching := switching_drives(compiled.spec.actuation):
        kind = type(switching[0]).__name__
        raise InputError(f'simulate: {kind} needs one of the core\'s methods; got "{options.method}"')
    run = _Run(compiled, options, tick, events)
    try:
        with _one_blas_thread():
            run.core.start(q0, v0)
            while not run.core.done:
                run.smooth_stretch(getattr(integrate, options.method), options.t0 + options.duration)
    except (KeyboardInterrupt, RunError, core.CoreFailure) as error:
        return run.core.outcome(), error
    return run.core.outcome(), None
