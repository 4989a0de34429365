"""rollout: many runs of one scene in native threads."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pin_nonideal.compilation.parameter_overrides import ParameterOverrides, parse_overrides
from pin_nonideal.core_loader import core
from pin_nonideal.errors import InputError, PinNonidealError, RunError, RunInterrupted, short_repr
from pin_nonideal.scene.scene import Scene, compiled_scene, require_scene, scene_states
from pin_nonideal.scene.state import SceneStates
from pin_nonideal.states.joint_layout import require_resolved
from pin_nonideal.trajectory.run_list import RunList
from pin_nonideal.types import Array, Model, State
from pin_nonideal.validation import array, by_name, choice, count

from .decoupled import decoupled_components, rollout_decoupled
from .methods import SCIPY
from .options import RunOptions, run_options
from .results import finish
from .rollout_arrays import RunArrays, run_arrays

MAX_JOBS = 100_000  # also for negative numbers: -n leaves n - 1 processors free


def rollout(
    scene: Scene,
    q: ArrayLike | None,
    v: ArrayLike | None,
    duration: float,
    *,
    parameters: Mapping[str, object] | None = None,
    t0: float = 0.0,
    method: str = "dop853",
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    dt: float | None = None,
    output_dt: float | None = None,
    max_steps: float | None = None,
    record: str | Sequence[str] = (),
    several: str = "error",
    jobs: int = 1,
    failures: str = "raise",
    as_arrays: bool = False,
) -> Any:
    """Simulate many initial states in native threads; each result equals `simulate` bit by bit.

    With `parameters`, numbers differ between runs. A scene with these numbers has the same run, bit by bit:

        pn.rollout(scene, None, None, 1.0, parameters={
            "elbow": {"mu": [0.1, 0.2, 0.3]},              # fields of the law, contact or force of that name
            "forearm_joint": {"mass": [1.0, 1.5, 2.0]},    # the body of a joint
            "actuation": {"kp": [50.0, 80.0, 90.0]},       # fields of HoldPosition, or torques (n, nv)
        })

    Parameters are numbers of laws (coefficients, radii, ratios), of contacts (mu, restitution, resistances),
    of forces (stiffness, damping, lengths) and of the actuation (kp, kd, q). A body has "mass" [kg], which
    scales its inertia, or "inertia", (n, 10), as in `pinocchio.Inertia.FromDynamicParameters`. "gravity" is
    (n, 3) [m/s^2]. Other quantities need a scene per run, see `sweep`: frames, lengths and ratios of
    constraints, radii of contacts, functions, and friction that is zero in some runs only. `run.scene` is the
    given scene.

    Args:
        scene: scene to simulate.
        q: initial configurations, (n, nq), columns by joint name (a table or a pandas DataFrame), or a list
            of configurations by joint name; None for the scene's initial configuration in every run.
        v: initial velocities, (n, nv), or by joint name as q; None for the scene's initial velocity in every
            run.
        duration: duration [s].
        parameters: numbers of each run, by name and field, (n,) or (n, ...); see above.
        t0: initial time [s].
        method: one of the core's methods (not SciPy's).
        rtol: relative tolerance.
        atol: absolute tolerance, a number or an array (2 nv,).
        dt: step of the fixed-step methods [s].
        output_dt: time between samples [s]; every accepted step when None.
        max_steps: as in `simulate`.
        record: as in `simulate`; "dense" is not supported with parameters.
        several: "error" or "continue", as in `simulate`.
        jobs: number of parallel jobs, in native threads; -1 for all processors, -2 for all but one.
        failures: "raise" raises the error of the first failed run after all runs have ended. "keep" returns
            errors in place of the trajectories of failed runs.
        as_arrays: whether to return a `RunArrays` with states by run and sample, without an object per run.
            This is faster for many short runs. No other quantities are recorded.

    Returns:
        A list with one Trajectory per run, or with failures="keep" the error of a failed run; or a RunArrays.

    Raises:
        InputError, UnknownNameError: an argument does not fit.
        RunError: a run stopped early. The first failed run raises its error: `index` is its index,
            `trajectory` has its samples, and `results` holds the trajectories and errors of all runs.
        RunInterrupted: Ctrl-C ended all runs; the attributes are as for RunError.
    """
    require_scene("rollout", scene)
    threads = _threads(jobs)
    keep = choice("rollout: failures", failures, ("raise", "keep")) == "keep"
    compiled = compiled_scene(scene)
    starts_q, starts_v = _starts(scene_states(scene), compiled.model, q, v, parameters)
    steps = (method, rtol, atol, dt, output_dt, max_steps)
    options = run_options(compiled, scene.name, duration, t0, *steps, record, several)
    if method in SCIPY:
        raise InputError(f'rollout: method must be one of the core\'s; "{method}" runs in SciPy')
    if parameters and options.dense:
        raise InputError(
            'rollout: record "dense" is not supported with parameters; use output_dt for more samples'
        )
    numbers = parse_overrides(compiled, parameters or {}, len(starts_q))
    if choice("rollout: as_arrays", as_arrays, (True, False)):
        return _arrays(scene, starts_q, starts_v, numbers, options, threads, keep, record)
    results = _run(scene, starts_q, starts_v, numbers, options, threads)
    failed = [each for each in results if isinstance(each, PinNonidealError)]
    interrupted = [each for each in failed if isinstance(each, RunInterrupted)]
    if interrupted or (failed and not keep):
        error = (interrupted or failed)[0]
        if isinstance(error, RunError):
            error.results = results
        raise error
    return RunList(results)


def _threads(jobs: int) -> int:
    """Return the number of threads; negative numbers of jobs count from the number of processors.

    Raises:
        InputError: it is zero or no number of jobs.
    """
    if count("rollout: jobs", jobs, min_value=-MAX_JOBS) == 0:
        raise InputError("rollout: jobs must not be zero; use 1 for no parallel jobs, -1 for all processors")
    return jobs if jobs > 0 else max(1, (os.cpu_count() or 1) + 1 + jobs)


def _starts(
    states: SceneStates, model: Model, q: object, v: object, parameters: object
) -> tuple[Array, Array]:
    """Return the initial states of all runs; a missing state is the scene's initial state."""
    if parameters is not None and not isinstance(parameters, Mapping):
        raise InputError(f"rollout: parameters must be values by name; got {short_repr(parameters)}")
    starts_q = None if q is None else _states_of_runs(q, model.nq, states.configuration, "rollout: q")
    starts_v = None if v is None else _states_of_runs(v, model.nv, states.velocity, "rollout: v")
    by_run: list[Any] = [each for each in (starts_q, starts_v) if each is not None]
    for values in (parameters or {}).values():
        by_run += [*values.values()] if isinstance(values, Mapping) else [values]
    counts = [len(each) for each in by_run if isinstance(each, (list, tuple)) or np.ndim(each) > 0]
    if not counts:
        raise InputError("rollout needs states or parameters of its runs: rollout(scene, q, v, duration)")
    if starts_q is None:
        starts_q = np.tile(states.closed_initial()[0], (counts[0], 1))
    if starts_v is None:
        starts_v = np.tile(states.closed_initial()[1], (counts[0], 1))
    if len(starts_q) != len(starts_v):
        raise InputError(f"rollout: q and v must have as many rows; got {len(starts_q)} and {len(starts_v)}")
    return starts_q, starts_v


def _states_of_runs(values: object, size: int, one: Callable[[State, str], Array], what: str) -> Array:
    """Return configurations or velocities of all runs.

    Args:
        values: array (n, size), a table of columns (n,) or (n, k) by joint name, or a list of n tables.
        size: nq or nv.
        one: function that returns one state from a table by joint name.
        what: name of the argument in messages.

    Raises:
        InputError: a shape does not fit, or a number is not finite.
    """
    columns = by_name(values)
    if columns is not None:
        table = {name: np.asarray(column) for name, column in columns.items()}
        lengths = {len(column) if column.ndim else 0 for column in table.values()}
        if len(lengths) != 1 or 0 in lengths:
            raise InputError(f"{what} by joint name must have columns of one length; got {sorted(lengths)}")
        values = [{name: column[k] for name, column in table.items()} for k in range(lengths.pop())]
    if isinstance(values, (list, tuple)) and len(values) and by_name(values[0]) is not None:
        return np.array([one(entry, f"{what}[{k}]") for k, entry in enumerate(values)])
    return array(what, values, (None, size), copy=False)


def _arrays(
    scene: Scene,
    q: Array,
    v: Array,
    numbers: ParameterOverrides,
    options: RunOptions,
    threads: int,
    keep: bool,
    record: str | Sequence[str],
) -> RunArrays:
    """Run all states and return a RunArrays."""
    if len(record):
        raise InputError("rollout: as_arrays records only states; leave out record or as_arrays")
    q = scene_states(scene).with_unit_parts(q)
    compiled = compiled_scene(scene)
    require_resolved(compiled.model, q)
    if len(q):
        compiled.check_functions(q[0], v[0], options.t0)
    on, v_on, opened = compiled.projection.nearest_of_each(q, v, options.t0, threads, numbers)
    errors = {i: compiled.named(e) if isinstance(e, core.CoreFailure) else e for i, e in opened.items()}
    for i, error in errors.items():
        if isinstance(error, RunError):
            error.index = i
    if errors and not keep:
        raise errors[min(errors)]
    closed = np.array([i for i in range(len(q)) if i not in errors], dtype=np.intp)
    starts = np.ascontiguousarray(on[closed]), np.ascontiguousarray(v_on[closed])
    of_closed = numbers._replace(values=numbers.values[closed])
    runs = run_arrays(compiled, *starts, of_closed, options, threads).among(len(q), closed, errors)
    runs = replace(runs, scene=scene)
    for i, error in runs.failures.items():
        if isinstance(error, RunError):
            error.index = i
    interrupted = [error for error in runs.failures.values() if isinstance(error, RunInterrupted)]
    if interrupted or (runs.failures and not keep):
        error = interrupted[0] if interrupted else runs.failures[min(runs.failures)]
        if isinstance(error, RunError):
            error.results = [runs]
        raise error
    return runs


def _run(
    scene: Scene, q: Array, v: Array, numbers: ParameterOverrides, options: RunOptions, threads: int
) -> list[Any]:
    """Return the Trajectory or the error of each run."""
    begin = time.perf_counter()
    compiled, states = compiled_scene(scene), scene_states(scene)
    q = states.with_unit_parts(q)
    require_resolved(compiled.model, q)
    if len(q):
        compiled.check_functions(q[0], v[0], options.t0)
    on, v_on, open_starts = compiled.projection.nearest_of_each(q, v, options.t0, threads, numbers)
    results: list[object] = [None] * len(q)
    for i, failure in open_starts.items():
        results[i] = compiled.named(failure) if isinstance(failure, core.CoreFailure) else failure
    going = [i for i in range(len(q)) if i not in open_starts]
    rows = slice(None) if len(going) == len(q) else going
    started = np.ascontiguousarray(on[rows]), np.ascontiguousarray(v_on[rows])
    values = np.ascontiguousarray(numbers.values[rows])
    if not numbers.names and (parts := decoupled_components(compiled, options)):
        outcomes = rollout_decoupled(compiled, parts, *started, options, threads)
    else:
        program = compiled.program_of_runs(options.t0, by_thread=True)[0]
        outcomes = core.rollout(program, *started, options, threads, numbers.names, values)
    wall = time.perf_counter() - begin
    for i, outcome in zip(going, outcomes, strict=True):
        if outcome is None:  # an interrupt ended all runs before this one started
            continue
        try:
            moved = states.configuration_notes(q[i], on[i]) + states.velocity_notes(v[i], v_on[i])
            results[i] = finish(scene, outcome, outcome.stopped, options, wall, moved)
        except PinNonidealError as error:
            results[i] = error
    for i, result in enumerate(results):
        if isinstance(result, RunError):
            result.index = i
    return results
