"""Runs in which each decoupled component of a scene takes its own steps.

An event of dry friction ends a step. If all components took common steps, each would stop at the events of
all others. The cost of a run would then grow with the square of their number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.types import Array

from .components import Component, components
from .merge import merge_outcomes
from .methods import METHODS, SCIPY
from .options import RunOptions


def decoupled_components(compiled: CompiledScene, options: RunOptions) -> list[Component]:
    """Return the components that take their own steps in a run; empty if all take common steps.

    Args:
        compiled: the compiled scene of the run.
        options: options of the run.
    """
    is_supported = METHODS[options.method] and options.method not in SCIPY and not options.event_names
    return components(compiled) if is_supported and options.max_steps == 0 and options.max_wall == 0.0 else []


def run_together(
    compiled: CompiledScene,
    q0: Array,
    v0: Array,
    options: RunOptions,
    program: core.Program | None = None,
    **more: Any,
) -> core.Outcome:
    """Run all mechanisms in common steps, in a workspace reused from an earlier run of the scene.

    Args:
        compiled: the compiled scene of the run.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        options: options of the run.
        program: the program of this run, if it is not the one of the scene.
        **more: further arguments of the core's `simulate`.
    """
    if program is not None and program is not compiled.program:
        return program.runner().simulate(q0, v0, options, **more)
    idle_runners: list[core.Runner] = compiled.__dict__.setdefault("_idle_runners", [])
    try:
        runner = idle_runners.pop()
    except IndexError:  # first run, or all workspaces are in use
        runner = compiled.program.runner()
    outcome = runner.simulate(q0, v0, options, **more)
    idle_runners.append(runner)
    return outcome


def run_decoupled(
    compiled: CompiledScene,
    parts: Sequence[Component],
    q0: Array,
    v0: Array,
    options: RunOptions,
    tick: Callable[[float], None] | None,
) -> core.Outcome | None:
    """Run each component separately and merge the results; None if a component fails.

    An interrupt leaves no samples, since the components have not reached a common time.

    Args:
        compiled: the compiled whole scene.
        parts: components of the scene.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        options: options of the run.
        tick: progress function of the time, or None.
    """
    outcomes = []
    for k, part in enumerate(parts):
        own = _options_of(part, options, len(v0))
        own_tick = _shared_progress(tick, k, len(parts), options)
        outcome = run_together(part.compiled, q0[part.q], v0[part.v], own, tick=own_tick)
        if isinstance(outcome.stopped, KeyboardInterrupt):
            return merge_outcomes(compiled, [], [], options, outcome.stopped)
        if outcome.stopped is not None:
            return None
        outcomes.append(outcome)
    return merge_outcomes(compiled, parts, outcomes, options)


def rollout_decoupled(
    compiled: CompiledScene,
    parts: Sequence[Component],
    q0: Array,
    v0: Array,
    options: RunOptions,
    threads: int,
) -> list[core.Outcome | None]:
    """Return the result of `run_decoupled` for each of many states, on several threads.

    After an interrupt only the interrupted run has an outcome, without samples; the others are None.

    Args:
        compiled: the compiled whole scene.
        parts: components of the scene.
        q0: initial configurations, (n, nq).
        v0: initial velocities, (n, nv).
        options: options of the runs.
        threads: number of threads.
    """
    of_parts = []
    for part in parts:
        states = (np.ascontiguousarray(q0[:, part.q]), np.ascontiguousarray(v0[:, part.v]))
        own = _options_of(part, options, v0.shape[1])
        program = part.compiled.program
        outcomes_of_part = core.rollout(program, *states, own, threads, [], np.zeros((len(q0), 0)))
        for k, outcome in enumerate(outcomes_of_part):
            if outcome is not None and isinstance(outcome.stopped, KeyboardInterrupt):
                interrupted = merge_outcomes(compiled, [], [], options, outcome.stopped)
                return [interrupted if i == k else None for i in range(len(q0))]
        of_parts.append(outcomes_of_part)
    results: list[core.Outcome | None] = []
    for k, outcomes in enumerate(zip(*of_parts, strict=True)):
        if all(one is not None and one.stopped is None for one in outcomes):
            results.append(merge_outcomes(compiled, parts, cast(list[core.Outcome], outcomes), options))
        else:  # a run in common steps reports the failure of the whole scene
            program = compiled.program
            results += core.rollout(program, q0[k : k + 1], v0[k : k + 1], options, 1, [], np.zeros((1, 0)))
    return results


def _options_of(part: Component, options: RunOptions, nv: int) -> RunOptions:
    atol = np.concatenate([options.atol[part.v], options.atol[nv + part.v]])
    silent = replace(options, a=False, forces=False, power=False, laws=False, reactions=False, tau=False)
    return replace(silent, atol=atol, dense=True)


def _shared_progress(
    tick: Callable[[float], None] | None, k: int, n: int, options: RunOptions
) -> Callable[[float], None] | None:
    """Return a progress function for the k-th of n runs that maps its time to the progress of all runs."""
    if tick is None:
        return None
    t0, duration = options.t0, options.duration
    return lambda t: tick(t0 + (k * duration + t - t0) / n)
