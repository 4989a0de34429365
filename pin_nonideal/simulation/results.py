"""Conversion of core results to a Trajectory, and of failures to exceptions with the trajectory attached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.contact_groups import contact_names
from pin_nonideal.compilation.error_context import open_loop_error, singular_position
from pin_nonideal.core_loader import core
from pin_nonideal.errors import (
    LoopClosureError,
    NonFiniteError,
    OutputError,
    RunError,
    RunInterrupted,
    StepSizeError,
    UserFunctionError,
)
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.errors import largest_by_contact
from pin_nonideal.states.rows import (
    MIN_SINGULAR_VALUE,
    gap_rows,
    holonomic_rows,
    metric_rows,
    residuals_at,
    row_slices,
)
from pin_nonideal.trajectory.dense_output import dense_output
from pin_nonideal.trajectory.fields import with_defaults
from pin_nonideal.trajectory.outcome import outcome_fields, outcome_stats
from pin_nonideal.trajectory.records import UserEventRecord
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.types import Array, Table

from .events import exact_grid, grid_of
from .options import RunOptions

# Largest residual of a sample on the constraints [m or rad]. Projection after each step reduces residuals to
# rounding, or to the square root of the rounding error in singular positions.
MAX_RESIDUAL = 1e-6
# Smallest singular value of the rows over that at the start below which a position is singular, and the part
# of a constraint in the dependence above which an error names it.
SINGULAR_RATIO, DEPENDENT_SHARE = 1e-4, 0.1
TRAJECTORY_HINT = "the trajectory up to this time is in error.trajectory"


def finish(
    scene: Scene,
    outcome: core.Outcome,
    stopped: BaseException | None,
    options: RunOptions,
    wall: float,
    notes: Sequence[str] = (),
) -> Trajectory:
    """Return the trajectory of a run, or raise the error that stopped it with the trajectory attached.

    Args:
        scene: the scene of the run.
        outcome: outcome of the core.
        stopped: a failure of the core, an exception of a user function, an interrupt, or None.
        options: options of the run.
        wall: wall time [s].
        notes: notes on the run.

    Raises:
        RunError: the run stopped early.
        OutputError: the first checkpoint of the run could not be written.
    """
    compiled = compiled_scene(scene)
    fields = partial(_fields, compiled, outcome, options, list(notes))
    known: Table = {"stats": outcome_stats(outcome, wall), "scene": scene, "name": scene.name}

    def shaped() -> Trajectory:
        return Trajectory(**(fields() | known))

    # A time step may penetrate a contact, which the next step detects. An opening loop stops the run itself.
    enters = options.method == "moreau" and bool(compiled.opening_names)
    if (
        not enters
        and outcome.largest_violation > MAX_RESIDUAL
        and (stopped is None or isinstance(stopped, core.CoreFailure))
    ):
        raise _open_loop_failure(compiled, shaped())
    if stopped is None:
        return Trajectory.later(fields, **known)
    if isinstance(stopped, OutputError):
        raise stopped
    trajectory = shaped()
    last = float(trajectory.t[-1]) if len(trajectory) else options.t0
    cause: BaseException | None = None
    singular = _singular(compiled, trajectory, stopped)
    if singular is not None:
        error = singular
        error.args = (f"{error}; {TRAJECTORY_HINT}",)
    elif isinstance(stopped, core.CoreFailure):
        error = compiled.named(stopped, options.method)
        error.args = (f"{error}{_overflow_hint(error, options)}; {TRAJECTORY_HINT}", *error.args[1:])
    elif isinstance(stopped, KeyboardInterrupt):
        error = RunInterrupted(f"the run was interrupted at t = {last:.4g} s; {TRAJECTORY_HINT}", time=last)
    elif isinstance(stopped, RunError):
        error, cause = stopped, stopped.__cause__
    else:
        error = UserFunctionError(f"a function of the scene failed at t = {last:.4g} s: {stopped}", time=last)
        cause = stopped
    error.time = last if error.time is None else error.time
    error.trajectory = _stopped_trajectory(trajectory, error)
    raise error from cause


def _fields(compiled: CompiledScene, outcome: core.Outcome, options: RunOptions, notes: list[str]) -> Table:
    """Return the fields of the trajectory without its scene; with `separate`, samples on the grid only."""
    fields = outcome_fields(compiled, outcome, options)
    t, q, v = fields["t"], fields["q"], fields["v"]
    grid = grid_of(t, options)
    for name in options.event_names:
        times = [e.time for e in fields["events"] if e.kind == "user" and e.element == name]
        at = np.searchsorted(t, times) if times else np.zeros(0, dtype=int)
        fields.setdefault("user_events", []).append(UserEventRecord(name, np.array(times), q[at], v[at]))
    if options.dense:
        fields["dense"] = dense_output(outcome, options, compiled.model.nv, compiled.elements.count)
    trajectory_fields = with_defaults({**fields, "grid": grid, "notes": notes})
    if not options.separate:
        return trajectory_fields
    run = Trajectory(**trajectory_fields).samples(grid)
    run.t[:] = exact_grid(run.t, options)
    return {name: value for name, value in vars(run).items() if name != "stats"}


def _open_loop_failure(compiled: CompiledScene, trajectory: Trajectory) -> LoopClosureError:
    """Return the error of a run that has left its constraints, with the samples before that time."""
    k = int((trajectory.violation > MAX_RESIDUAL).argmax())
    t = float(trajectory.t[k])
    runner = compiled.program.runner()
    residual = residuals_at(runner, trajectory.q[k], trajectory.v[k], t)
    left = np.where(gap_rows(compiled.program), np.maximum(-residual, 0.0), np.abs(residual))
    gaps = largest_by_contact(left, compiled.slices, compiled.contact_of)
    stopped = open_loop_error(max(gaps, key=lambda key: gaps[key]), gaps, t, f"; {TRAJECTORY_HINT}")
    stopped.trajectory = _stopped_trajectory(trajectory.first(k), stopped)
    return stopped


def _singular(compiled: CompiledScene, trajectory: Trajectory, stopped: BaseException) -> RunError | None:
    """Return the error of a run whose steps end in a singular position of its constraints, or None."""
    of_core = isinstance(stopped, core.CoreFailure) and stopped.kind is core.FailureKind.step_size
    if not (of_core or type(stopped) is StepSizeError) or len(trajectory) < 2:
        return None
    runner, rows = compiled.program.runner(), holonomic_rows(compiled.program)
    (first, _), (last, shares) = (
        _independence(runner, trajectory, k, rows) for k in (0, len(trajectory) - 1)
    )
    rank = int((first > MIN_SINGULAR_VALUE).sum())
    if not rank or last[rank - 1] > SINGULAR_RATIO * first[rank - 1]:
        return None
    weights = np.zeros(len(rows))
    weights[rows] = np.abs(shares[:, rank - 1])
    names = [n for n, part in row_slices(compiled.program).items() if weights[part].max() > DEPENDENT_SHARE]
    return singular_position(contact_names(names, compiled.contact_of), float(trajectory.t[-1]))


def _independence(
    runner: core.Runner, run: Trajectory, k: int, rows: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return the singular values of the rows of positions at a sample, and the left singular vectors."""
    nv = run.v.shape[1]
    M = runner.terms(run.q[k], np.zeros(nv))[0].reshape(nv, nv)
    left, values, _ = np.linalg.svd(metric_rows(runner, M, run.q[k], run.v[k], float(run.t[k]))[rows])
    return values, left


def _overflow_hint(error: RunError, options: RunOptions) -> str:
    """Return a hint for a run that has overflowed; empty for other failures."""
    if not isinstance(error, NonFiniteError):
        return ""
    if options.dt == 0.0:
        return "; check the last samples for a force, stiffness or function that grows without bound"
    return (
        f": the motion overflows if steps of dt = {options.dt:g} s are too long for the stiffest force; "
        'use a shorter dt, or method="dop853", with max_steps if the scene is stiff'
    )


def _stopped_trajectory(trajectory: Trajectory, error: RunError) -> Trajectory:
    """Return the trajectory with the message of the error that stopped the run."""
    return replace(trajectory, failure=str(error).removesuffix(f"; {TRAJECTORY_HINT}"))
