"""SciPy's implicit methods on the core's right-hand side, for stiff scenes.

The state is y = (q, v, states of laws, work of the ledger's columns), with q in ambient coordinates:
quaternions and (cos, sin) pairs are plain numbers, and the right-hand side is smooth off unit length as well.
Radau, a one-step method, goes on from the projected state after every step; BDF and LSODA remember earlier
steps, so that only their samples are projected.  Modes of dry friction are chosen anew at every evaluation,
without located events: prefer the core's methods there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from pin_nonideal.actuation import SampledControl
from pin_nonideal.core import core
from pin_nonideal.errors import InputError, RunError, StepSizeError
from pin_nonideal.scene import Scene
from pin_nonideal.types import Array

from .options import RunOptions

Tick = Callable[[float], None]  # with the time

# Relative step of central differences of the right-hand side: the cube root of the rounding, where rounding
# and curvature cost the same.
DIFFERENCE = 6e-6
# SciPy refuses, or cannot reach, tolerances below this.
LEAST_RTOL = 1e-13
# Work is integrated along and takes no part in the choice of steps.
FREE = 1e100


class _Run:
    """One run: right-hand side, Jacobian, and samples so far."""

    def __init__(self, scene: Scene, options: RunOptions, tick: Tick | None) -> None:
        self.scene, self.options, self.tick = scene, options, tick
        program = scene._compiled.program
        self.runner, self.states = program.runner(), program.states
        self.energy = options.energy
        self.work = len(program.power_names) if self.energy else 0
        self.moved = 0.0  # energy, by projections that the run went on from
        self.steps = 0
        self.samples: list[tuple[float, Array, float]] = []

    def rate(self, t: float, y: Array) -> Array:
        """dy/dt."""
        return self.runner.derivative(t, np.ascontiguousarray(y), self.energy)

    def jacobian(self, t: float, y: Array) -> Array:
        """d(dy/dt)/dy by central differences.

        Their steps stay bounded when a joint has turned many times; SciPy's own grow with the coordinate.
        """
        n, nq = y.size, self.scene.model.nq
        result = np.zeros((n, n))
        for k in range(n - self.work):
            h = DIFFERENCE * (1.0 if k < nq else max(1.0, abs(float(y[k]))))
            ahead, back = y.copy(), y.copy()
            ahead[k] += h
            back[k] -= h
            result[:, k] = (self.rate(t, ahead) - self.rate(t, back)) / (ahead[k] - back[k])
        return result

    def tolerance(self) -> Array:
        """Absolute tolerance in ambient coordinates: a quaternion takes the smallest of its joint's."""
        given, model = self.options.atol, self.scene.model
        positions = np.empty(model.nq)
        for joint in list(model.joints)[1:]:
            own = given[joint.idx_v : joint.idx_v + joint.nv]
            same = joint.nq == joint.nv
            positions[joint.idx_q : joint.idx_q + joint.nq] = own if same else own.min(initial=np.inf)
        return np.concatenate([positions, given[model.nv :], np.full(self.work, FREE)])

    def sample(self, t: float, y: Array) -> None:
        """Keeps the projected state, unless that time has a sample already."""
        if self.samples and t <= self.samples[-1][0]:
            return
        on, moved = self.runner.project_outside(t, np.ascontiguousarray(y), self.energy)
        self.samples.append((t, on, self.moved + moved))

    def step(self, solver: Any, grid: _Grid) -> None:
        """One step of SciPy's, and the samples inside it."""
        message = solver.step()
        if solver.status == "failed":
            raise StepSizeError(
                f"{self.options.method} cannot go on at t = {solver.t:.6g} s ({message}): the motion is "
                "singular there; look at the last samples, or loosen rtol and atol; the trajectory up to "
                "there is in error.trajectory",
                time=float(solver.t),
            )
        self.steps += 1
        now, last = float(solver.t), solver.status == "finished"
        if grid.dt:
            dense = solver.dense_output()
            for t in grid.before(now):
                self.sample(t, dense(t))
        if last or not grid.dt:
            self.sample(now, solver.y)
        if self.options.method == "Radau" and self.scene.constraint_slices:
            solver.y, moved = self.runner.project_outside(now, np.ascontiguousarray(solver.y), self.energy)
            solver.f = self.rate(now, solver.y)
            self.moved += moved
        if self.tick is not None:
            self.tick(now)

    def recorded(self) -> core.Outcome:
        """The samples as the core records its own."""
        times, states, moved = zip(*self.samples, strict=True) if self.samples else ((), (), ())
        width = self.scene.model.nq + self.scene.model.nv + self.states + self.work
        rows = np.array(states).reshape(len(times), width)
        return self.runner.record(np.array(times), rows, np.array(moved), self.options, steps=self.steps)


class _Grid:
    """Times t0 + k dt of the samples, in turn; none when dt is zero."""

    def __init__(self, t0: float, dt: float) -> None:
        self.t0, self.dt, self.k = t0, dt, 1

    def before(self, t: float) -> Iterator[float]:
        """Times of the grid before t, or at it, that were not asked for yet."""
        while self.t0 + self.k * self.dt <= t:
            yield self.t0 + self.k * self.dt
            self.k += 1


def simulate_stiff(
    scene: Scene, q0: Array, v0: Array, options: RunOptions, tick: Tick | None
) -> tuple[core.Outcome, BaseException | None]:
    """Runs one of SciPy's implicit methods.

    Args:
        scene: what to simulate.
        q0: initial configuration on the constraints, (nq,).
        v0: initial velocity on the constraints, (nv,).
        options: as checked by `simulate`.
        tick: called with the time after every step.

    Returns:
        What the core recorded of it, and what stopped the run.

    Raises:
        InputError: the scene's torque is held between samples, which these methods would step over.
    """
    from scipy import integrate

    if isinstance(scene.actuation, SampledControl):
        raise InputError(f'simulate: SampledControl needs one of the core\'s methods; got "{options.method}"')
    run = _Run(scene, options, tick)
    t0, t_end = options.t0, options.t0 + options.duration
    grid = _Grid(t0, options.output_dt)
    y0 = np.concatenate([q0, v0, np.zeros(run.states + run.work)])
    try:
        run.sample(t0, y0)
        tolerance = {"rtol": max(options.rtol, LEAST_RTOL), "atol": run.tolerance()}
        method = getattr(integrate, options.method)
        solver = method(run.rate, t0, y0, t_end, jac=run.jacobian, **tolerance)
        while solver.status == "running":
            run.step(solver, grid)
    except (KeyboardInterrupt, RunError, core.CoreFailure) as error:
        return run.recorded(), error
    return run.recorded(), None
