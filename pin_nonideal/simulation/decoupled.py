"""Runs in which each component of a scene takes its own steps.

An event of dry friction ends a step.  Where mechanisms that share nothing stepped together, each of them
would stop at the events of all, and the cost of a run would grow with the square of their number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.types import Array

from .components import Component, components
from .merge import joined_outcome
from .options import METHODS, SCIPY, RunOptions


def stepped_apart(scene: Scene, options: RunOptions) -> list[Component]:
    """The components that take their own steps in a run; none where all step together.

    Args:
        scene: what runs.
        options: of the run.
    """
    apart = METHODS[options.method] and options.method not in SCIPY and not options.event_names
    return components(scene) if apart and options.max_steps == 0 and options.max_wall == 0.0 else []


def run_together(scene: Scene, q0: Array, v0: Array, options: RunOptions, **more: Any) -> core.Outcome:
    """A run of all mechanisms in common steps, in a workspace that an earlier run of the scene has left.

    Args:
        scene: what runs.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        options: of the run.
        **more: what the core takes beside.
    """
    idle: list[core.Runner] = scene.__dict__.setdefault("_idle_runners", [])
    try:
        runner = idle.pop()
    except IndexError:  # the first run, or others are under way
        runner = compiled_scene(scene).program.runner()
    outcome = runner.simulate(q0, v0, options, **more)
    idle.append(runner)
    return outcome


def run_apart(
    scene: Scene,
    parts: Sequence[Component],
    q0: Array,
    v0: Array,
    options: RunOptions,
    tick: Callable[[float], None] | None,
) -> core.Outcome | None:
    """Runs each component alone and puts their motions together; None where one of them fails.

    Args:
        scene: the whole.
        parts: its components.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        options: of the run.
        tick: is told the time, or None.
    """
    outcomes = []
    for k, part in enumerate(parts):
        own = _options_of(part, options, len(v0))
        told = _after(tick, k, len(parts), options)
        outcome = run_together(part.scene, q0[part.q], v0[part.v], own, tick=told)
        stopped = outcome.stopped
        if isinstance(stopped, core.CoreFailure):
            return None
        if stopped is not None:
            return joined_outcome(scene, [], [], options, stopped)
        outcomes.append(outcome)
    return joined_outcome(scene, parts, outcomes, options)


def roll_apart(
    scene: Scene, parts: Sequence[Component], q0: Array, v0: Array, options: RunOptions, threads: int
) -> list[core.Outcome | None]:
    """What `run_apart` gives for each of many states, on several threads.

    Args:
        scene: the whole.
        parts: its components.
        q0: initial configurations, (n, nq).
        v0: initial velocities, (n, nv).
        options: of the runs.
        threads: how many.
    """
    of_parts = []
    for part in parts:
        states = (np.ascontiguousarray(q0[:, part.q]), np.ascontiguousarray(v0[:, part.v]))
        own = _options_of(part, options, v0.shape[1])
        program = compiled_scene(part.scene).program
        of_parts.append(core.rollout(program, *states, own, threads, [], np.zeros((len(q0), 0))))
    results: list[core.Outcome | None] = []
    for k, outcomes in enumerate(zip(*of_parts, strict=True)):
        if all(one is not None and one.stopped is None for one in outcomes):
            results.append(joined_outcome(scene, parts, cast(list[core.Outcome], outcomes), options))
        else:  # together, which tells what stops them
            program = compiled_scene(scene).program
            results += core.rollout(program, q0[k : k + 1], v0[k : k + 1], options, 1, [], np.zeros((1, 0)))
    return results


def _options_of(part: Component, options: RunOptions, nv: int) -> RunOptions:
    atol = np.concatenate([options.atol[part.v], options.atol[nv + part.v]])
    silent = replace(options, a=False, forces=False, power=False, laws=False, reactions=False, tau=False)
    return replace(silent, atol=atol, dense=True)


def _after(
    tick: Callable[[float], None] | None, k: int, n: int, options: RunOptions
) -> Callable[[float], None] | None:
    """The time told by the k-th of n runs, as a part of all of them."""
    if tick is None:
        return None
    t0, duration = options.t0, options.duration
    return lambda t: tick(t0 + (k * duration + t - t0) / n)
