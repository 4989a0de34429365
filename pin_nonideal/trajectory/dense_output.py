"""Dense output of a run: the interpolants of the steps, and samples at any time of the run.

Each step stores its method's interpolant by values at Chebyshev points, which determine one polynomial. The
polynomial of dop853 has degree 7, so that its local error has order 8 in the step size, as the global error
of the steps has. Samples are projected onto the constraints and evaluated under the modes of their step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Table

from .outcome import outcome_fields


@dataclass(frozen=True, eq=False)
class DenseOutput:
    """Interpolants of the steps of a run.

    Attributes:
        times: start and end of each step [s], (n, 2).
        states: q, v, states of laws and work of the energy ledger at the points of each step, (n, points,
            size).
        modes: modes of the friction elements during each step, (n, ne).
        closed: whether each unilateral contact of the core is closed during each step, (n, gaps).
        turning: elements of several slip directions that carried load in any step, (m,).
        directions: slip directions of these elements at the points of each step, (n, points, 3 m), zero in
            steps without their load. Steps that did not solve for directions store the directions at their
            end.
        sought: whether each step solved for the slip direction of each element, as in slow slip, (n, ne).
        torque: torque that each step holds constant, (n, nv), NaN for steps without one; (0, nv) if no step
            has one.
        moved: energy change due to projection from the start of the run to the end of each step [J], (n,).
        impacts: energy change due to impacts from the start of the run to the start and to the end of each
            step [J], (n, 2).
        options: options of the run, a RunOptions.
    """

    times: Array
    states: Array
    modes: NDArray[np.int8]
    closed: NDArray[np.int8]
    turning: NDArray[np.int64]
    directions: Array
    sought: NDArray[np.int8]
    torque: Array
    moved: Array
    impacts: Array
    options: Any

    def check(self) -> None:
        """Check that the shapes of the arrays agree, for example in a damaged file.

        Raises:
            ValueError: the shapes do not agree, or a mode is unknown.
        """
        n, elements = len(self.times), self.modes.shape[1]
        shapes = [self.times.shape[1:] == (2,), self.states.ndim == 3, self.moved.shape == (n,)]
        shapes += [self.torque.ndim == 2, self.sought.shape == (n, elements), self.directions.ndim == 3]
        shapes += [self.directions.shape[:2] == self.states.shape[:2], self.turning.ndim == 1]
        shapes += [self.directions.shape[2:] == (3 * self.turning.size,), self.impacts.shape == (n, 2)]
        shapes += [self.closed.ndim == 2, bool(np.isin(self.turning, np.arange(elements)).all())]
        rows = {len(x) for x in (self.states, self.modes, self.closed, self.moved)} | {len(self.torque) or n}
        if not all(shapes) or rows != {n} or not np.isin(self.modes, [int(mode) for mode in core.Mode]).all():
            raise ValueError("dense output does not fit together")

    def __len__(self) -> int:
        return len(self.times)

    def at(self, compiled: CompiledScene, t: Array, name: str) -> Table:
        """Return the fields of a Trajectory, without its scene, with samples at any times of the run.

        At the boundary of two steps, for example at an event, the later step is used.

        Args:
            compiled: compiled scene of the run.
            t: times [s], (k,).
            name: name of the scene, for messages.

        Raises:
            InputError: a time is outside of the run.
        """
        if len(t) and not (len(self) and self.times[0, 0] <= t.min() and t.max() <= self.times[-1, 1]):
            span = f"{self.times[0, 0]:g} to {self.times[-1, 1]:g} s" if len(self) else "no time"
            outside_time = t.max() if len(self) and self.times[0, 0] <= t.min() else t.min()
            raise InputError(f"at: t must lie in the run, which took {span}; got {outside_time:g} s")
        sizes = (self.states.shape[2], self.modes.shape[1], self.closed.shape[1])
        torques = len(self.torque) and self.torque.shape[1]
        program, nv = compiled.program, compiled.model.nv
        work = len(program.power_names) if self.options.energy else 0
        states, gaps = compiled.model.nq + nv + program.states + work, len(compiled.opening_names)
        if sizes != (states, len(program.element_names), gaps) or torques not in (0, nv):
            raise InputError(f'at: the scene "{name}" is not the one of the run')
        step = np.maximum(np.searchsorted(self.times[:, 0], t, side="right") - 1, 0)
        begin, end = self.times[step].T
        part = (t - begin) / (end - begin)
        moved_before = np.concatenate([[0.0], self.moved])[step]
        moved = moved_before + part * (self.moved[step] - moved_before)
        before, after = self.impacts[step].T
        outcome = core.sample_inside(
            program,
            self.options,
            np.ascontiguousarray(t),
            np.ascontiguousarray(inside_steps(self.states, step, part)),
            np.ascontiguousarray(self.modes[step], dtype=float),
            np.ascontiguousarray(self.closed[step], dtype=float),
            self.turning,
            inside_steps(self.directions, step, part),
            np.ascontiguousarray(self.sought[step], dtype=float),
            np.ascontiguousarray(self.torque[step] if len(self.torque) else self.torque),
            moved,
            before + part * (after - before),
        )
        return outcome_fields(compiled, outcome, self.options)


def inside_steps(states: Array, step: NDArray[np.int64], part: Array) -> Array:
    """Evaluate the polynomials of steps, given by values at Chebyshev points of the second kind.

    Args:
        states: values at the points of each step, (n, points, size).
        step: index of the step of each value, (k,).
        part: relative position of each value in its step, 0 to 1, (k,).

    Returns:
        Values, (k, size).
    """
    return core.inside_steps(states, step, part).reshape(len(part), states.shape[2])


def dense_output(outcome: core.Outcome, options: Any, nv: int, elements: int) -> DenseOutput:
    """Return the dense output from the core's flat arrays.

    Args:
        outcome: result of the core.
        options: options of the run, a RunOptions.
        nv: number of velocities.
        elements: number of friction elements.
    """
    times = outcome.dense_times.reshape(-1, 2)
    n = len(times)
    points = core.dense_points(options.method)
    turning, directions = _directions_by_step(outcome, n, points)
    return DenseOutput(
        times,
        outcome.dense_states.reshape(n, points, -1) if n else np.zeros((0, points, 0)),
        outcome.dense_modes.reshape(n, elements),
        outcome.dense_closed.reshape(n, -1) if n else np.zeros((0, 0), np.int8),
        turning,
        directions,
        np.broadcast_to(outcome.dense_sought.reshape(n, -1), (n, elements))
        if n
        else np.zeros((0, elements), np.int8),
        outcome.dense_torque.reshape(-1, nv),
        outcome.dense_moved,
        outcome.dense_impacts.reshape(n, 2),
        options,
    )


def _directions_by_step(outcome: core.Outcome, n: int, points: int) -> tuple[NDArray[np.int64], Array]:
    """Return the elements with slip directions in any step, and their directions, (n, points, 3 m)."""
    counts = outcome.dense_turning_counts
    turning, column = np.unique(outcome.dense_turning, return_inverse=True)
    table = np.zeros((n, points, turning.size, 3))
    # The flat directions run over the steps, the points of each step, and its elements with load.
    step = np.repeat(np.arange(n), counts * points)
    point = np.concatenate([np.repeat(np.arange(points), count) for count in counts] or [step])
    columns = [np.tile(own, points) for own in np.split(column, np.cumsum(counts)[:-1])]
    table[step, point, np.concatenate(columns or [step])] = outcome.dense_directions.reshape(-1, 3)
    return turning.astype(np.int64), table.reshape(n, points, 3 * turning.size)
