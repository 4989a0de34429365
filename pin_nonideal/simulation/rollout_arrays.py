"""Samples of many runs as arrays, without an object per run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.parameter_overrides import ParameterOverrides
from pin_nonideal.core_loader import core
from pin_nonideal.errors import LoopClosureError, PinNonidealError, RunInterrupted, UserFunctionError
from pin_nonideal.scene.scene import Scene
from pin_nonideal.types import Array

from .decoupled import decoupled_components, rollout_decoupled
from .options import RunOptions
from .results import MAX_RESIDUAL

Number = TypeVar("Number", np.float64, np.int64)


@dataclass(frozen=True, eq=False, repr=False)
class RunArrays:
    """Samples of many runs by run and sample, as returned by `rollout(..., as_arrays=True)`.

    Attributes:
        t: times [s], (n, nt); NaN after the last sample of a run.
        q: configurations, (n, nt, nq); NaN after the last sample.
        v: velocities, (n, nt, nv); NaN after the last sample.
        samples: number of samples of each run, (n,).
        violation: largest |residual| of each run [m or rad], (n,); NaN without samples.
        steps: accepted steps of each run, (n,).
        failures: errors of failed runs, by index.
        scene: the scene of the runs.
    """

    t: Array
    q: Array
    v: Array
    samples: NDArray[np.int64]
    violation: Array
    steps: NDArray[np.int64]
    failures: dict[int, PinNonidealError] = field(default_factory=dict)
    scene: Scene | None = None

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        max_samples, failed = self.t.shape[1], len(self.failures)
        return f"<RunArrays: {len(self)} runs of up to {max_samples} samples, {failed} failed>"

    @property
    def last(self) -> tuple[Array, Array]:
        """Configurations (n, nq) and velocities (n, nv) of each run's last sample; NaN without samples."""
        runs, at = np.arange(len(self)), np.maximum(self.samples - 1, 0)
        is_empty = self.samples == 0
        q, v = self.q[runs, at], self.v[runs, at]
        q[is_empty], v[is_empty] = np.nan, np.nan
        return q, v

    def among(self, n: int, runs: NDArray[np.intp], errors: Mapping[int, PinNonidealError]) -> RunArrays:
        """Return n runs: these runs, and failed runs without samples.

        Args:
            n: number of all runs.
            runs: number of each of these runs among all runs.
            errors: errors of the other runs, by number.
        """
        if not errors:
            return self

        def spread(values: NDArray[Number], fill: float) -> NDArray[Number]:
            all_values = np.full((n, *values.shape[1:]), fill, dtype=values.dtype)
            all_values[runs] = values
            return all_values

        t, q, v, violation = (spread(x, np.nan) for x in (self.t, self.q, self.v, self.violation))
        samples, steps = spread(self.samples, 0), spread(self.steps, 0)
        failures = {int(runs[i]): error for i, error in self.failures.items()} | dict(errors)
        return RunArrays(t, q, v, samples, violation, steps, dict(sorted(failures.items())), self.scene)


def run_arrays(
    compiled: CompiledScene,
    q0: Array,
    v0: Array,
    numbers: ParameterOverrides,
    options: RunOptions,
    threads: int,
) -> RunArrays:
    """Simulate initial states that satisfy the constraints, and return their samples, without the scene.

    Args:
        compiled: compiled scene to simulate.
        q0: initial configurations, (n, nq).
        v0: initial velocities, (n, nv).
        numbers: numbers that differ between runs.
        options: options of all runs.
        threads: number of native threads.
    """
    n = len(q0)
    parts = [] if numbers.names else decoupled_components(compiled, options)
    if parts:
        outcomes = rollout_decoupled(compiled, parts, q0, v0, options, threads)
        complete = [outcome for outcome in outcomes if outcome is not None]
        if len(complete) < len(outcomes):
            raise RunInterrupted("the runs were interrupted")
        return _of_outcomes(compiled, complete, options.method)
    numbers_of_runs = np.ascontiguousarray(numbers.values)
    program = compiled.program_of_runs(options.t0, by_thread=True)[0]
    try:
        t, q, v, samples, violation, steps, stopped = core.rollout_arrays(
            program, q0, v0, options, threads, numbers.names, numbers_of_runs
        )
    except KeyboardInterrupt:
        raise RunInterrupted("the runs were interrupted") from None
    max_samples = t.size // n if n else 0
    runs = RunArrays(
        t.reshape(n, max_samples),
        q.reshape(n, max_samples, -1) if n * max_samples else np.zeros((n, max_samples, q0.shape[1])),
        v.reshape(n, max_samples, -1) if n * max_samples else np.zeros((n, max_samples, v0.shape[1])),
        samples.astype(np.int64),
        violation,
        steps.astype(np.int64),
    )
    runs.failures.update(_failures(compiled, dict(stopped), violation, options.method))
    return runs


def _of_outcomes(compiled: CompiledScene, outcomes: Sequence[core.Outcome], method: str) -> RunArrays:
    """Return the samples of runs whose components took their own steps."""
    n, (nq, nv) = len(outcomes), (compiled.model.nq, compiled.model.nv)
    samples = np.array([len(one.t) for one in outcomes], dtype=np.int64)
    max_samples = int(samples.max(initial=0))
    t, q, v = (
        np.full((n, max_samples), np.nan),
        np.full((n, max_samples, nq), np.nan),
        np.full((n, max_samples, nv), np.nan),
    )
    for i, one in enumerate(outcomes):
        t[i, : samples[i]] = one.t
        q[i, : samples[i]] = one.q.reshape(-1, nq)
        v[i, : samples[i]] = one.v.reshape(-1, nv)
    violation = np.array([one.largest_violation for one in outcomes])
    steps = np.array([one.steps for one in outcomes], dtype=np.int64)
    stopped = {i: one.stopped for i, one in enumerate(outcomes) if one.stopped is not None}
    failures = _failures(compiled, stopped, violation, method)
    return RunArrays(t, q, v, samples, violation, steps, failures)


def _failures(
    compiled: CompiledScene, stopped: dict[int, BaseException], violation: Array, method: str
) -> dict[int, PinNonidealError]:
    """Return the errors of stopped runs and of runs that have left their constraints, by index."""
    failures: dict[int, PinNonidealError] = {}
    for i, cause in stopped.items():
        if isinstance(cause, core.CoreFailure):
            failures[i] = compiled.named(cause, method)
        elif isinstance(cause, PinNonidealError):
            failures[i] = cause
        elif isinstance(cause, KeyboardInterrupt):
            failures[i] = RunInterrupted("the runs were interrupted")
        else:
            failures[i] = UserFunctionError(f"a function of the scene failed: {cause}")
    for i in map(int, np.flatnonzero(violation > MAX_RESIDUAL)):
        gap = f"gap {violation[i]:.1e} (m or rad)"
        failures.setdefault(i, LoopClosureError(f"run {i} has left its constraints: {gap}", gaps={}))
    return failures
