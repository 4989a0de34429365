"""Merging of the outcomes of components that took their own steps."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import NamedTuple, cast

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.trajectory.dense_output import DenseOutput, dense_output, inside_steps
from pin_nonideal.types import Array, Table

from .components import Component
from .options import RunOptions

COUNTERS = ("steps", "rejected", "evaluations", "factorizations", "projections", "iterations", "limited")
Motion = tuple[Array, Array, Array, Array, Array]  # states, modes, directions, sought, moved


class MergedEvent(NamedTuple):
    """An event of one component, with the element index of the whole scene."""

    time: float
    kind: core.EventKind
    element: int
    of_contact: bool = False


def merge_outcomes(
    compiled: CompiledScene,
    parts: Sequence[Component],
    outcomes: Sequence[core.Outcome],
    options: RunOptions,
    stopped: BaseException | None = None,
) -> core.Outcome:
    """Merge the outcomes of all components, with samples on the output grid and at all events.

    Without a grid, samples lie at the steps of the component with the most steps.

    Args:
        compiled: the compiled whole scene.
        parts: components of the scene.
        outcomes: outcome of each component, with interpolants.
        options: options of the run.
        stopped: exception that stopped the run, or None.
    """
    dense = [
        dense_output(one, options, part.v.size, part.elements.size)
        for one, part in zip(outcomes, parts, strict=True)
    ]
    events = sorted(
        (
            MergedEvent(event.time, event.kind, int(part.elements[event.element]))
            for one, part in zip(outcomes, parts, strict=True)
            for event in one.events
        ),
        key=lambda event: event.time,
    )
    if options.output_dt:
        times = [one.t for one in outcomes]
    else:
        times = [
            max((one.t for one in outcomes), key=len, default=np.zeros(0)),
            np.array([e.time for e in events]),
        ]
    t = np.unique(np.concatenate(times or [np.zeros(0)]))
    motion = _motion(compiled, parts, dense, t)
    joined = SimpleNamespace(**_samples(compiled, options, t, *motion))
    for name in COUNTERS:
        setattr(joined, name, sum(getattr(one, name) for one in outcomes))
    joined.rounding = max((one.rounding for one in outcomes), default=0.0)
    joined.events, joined.stopped = events, stopped
    if options.dense:
        _join_dense(compiled, parts, dense, joined)
    return cast(core.Outcome, joined)


def _motion(
    compiled: CompiledScene, parts: Sequence[Component], dense: Sequence[DenseOutput], t: Array
) -> Motion:
    """Return states of the whole scene at given times, with modes, slip directions and energy moved.

    Directions have no columns if every element slips along one direction.
    """
    nq, nv, ne = compiled.model.nq, compiled.model.nv, len(compiled.elements.names)
    work = dense[0].states.shape[2] - parts[0].q.size - parts[0].v.size if dense else 0
    columns = len(compiled.program.power_names) if work else 0
    # One row per coordinate, so that each component fills contiguous times.
    states, moved = np.zeros((nq + nv + columns, t.size)), np.zeros(t.size)
    modes, sought = np.zeros((2, ne, t.size), dtype=np.int8)
    turns = any(one.turning.size for one in dense)
    directions = np.zeros((ne if turns else 0, 3, t.size))
    for part, one in zip(parts, dense, strict=True):
        step = np.searchsorted(one.times[:, 0], t, side="right") - 1
        np.minimum(np.maximum(step, 0, out=step), len(one) - 1, out=step)
        begin, end = one.times[step].T
        at = (t - begin) / (end - begin)
        own = inside_steps(one.states, step, at).T
        first, last = part.q.size, part.q.size + part.v.size
        states[part.q], states[nq + part.v] = own[:first], own[first:last]
        if columns:
            states[nq + nv + part.works] += own[last:]
        modes[part.elements] = one.modes[step].T
        sought[part.elements] = one.sought[step].T
        if one.turning.size:
            own = inside_steps(one.directions, step, at).reshape(t.size, -1, 3)
            directions[part.elements[one.turning]] = own.transpose(1, 2, 0)
        before = np.concatenate([[0.0], one.moved])[step]
        moved += before + at * (one.moved[step] - before)
    return states.T, modes.T, directions.reshape(3 * len(directions), t.size).T, sought.T, moved


def _samples(
    compiled: CompiledScene,
    options: RunOptions,
    t: Array,
    states: Array,
    modes: Array,
    directions: Array,
    sought: Array,
    moved: Array,
) -> Table:
    """Return the samples as fields of a core outcome; states of a tree alone need no evaluation."""
    program, (nq, nv) = compiled.program, (compiled.model.nq, compiled.model.nv)
    records = (
        options.a,
        options.tau,
        options.forces,
        options.laws,
        options.reactions,
        options.power,
        options.energy,
    )
    evaluated = any(records) or program.rows or nq != nv
    k, no_torques = t.size if evaluated else 0, np.zeros((0, nv))
    y, held, turns, sought_modes = (
        np.ascontiguousarray(x[:k], dtype=float) for x in (states, modes, directions, sought)
    )
    turning, no_gaps, no_impacts = np.arange(directions.shape[1] // 3), np.zeros((k, 0)), np.zeros(k)
    inside = core.sample_inside(
        program,
        options,
        t[:k],
        y,
        held,
        no_gaps,
        turning,
        turns,
        sought_modes,
        no_torques,
        moved[:k],
        no_impacts,
    )
    samples = {name: getattr(inside, name) for name in dir(core.Outcome) if not name.startswith("_")}
    if evaluated:
        return samples
    return samples | {
        "t": t,
        "q": np.ascontiguousarray(states[:, :nq]).ravel(),
        "v": np.ascontiguousarray(states[:, nq : nq + nv]).ravel(),
        "violation": np.zeros(t.size),
        "violation_rate": np.zeros(t.size),
        "modes": modes.ravel(),
    }


def _join_dense(
    compiled: CompiledScene, parts: Sequence[Component], dense: Sequence[DenseOutput], joined: SimpleNamespace
) -> None:
    """Join the interpolants of all components: their polynomials, on the intervals between all steps."""
    ends = np.unique(np.concatenate([one.times.ravel() for one in dense]))
    points = dense[0].states.shape[1]
    part = 0.5 * (1.0 - np.cos(np.pi * np.arange(points) / (points - 1)))
    stretches = np.stack([ends[:-1], ends[1:]], axis=1)
    # Points stay inside an interval, so that they are evaluated by its own polynomial.
    inside = np.clip(part, 1e-9, 1.0 - 1e-9)
    t = (stretches[:, :1] + inside * np.diff(stretches, axis=1)).ravel()
    states, modes, directions, sought, _ = _motion(compiled, parts, dense, t)
    joined.dense_times, joined.dense_states = stretches.ravel(), states.ravel()
    joined.dense_modes = modes[::points].ravel()
    joined.dense_directions, joined.dense_sought = directions.ravel(), sought[::points].ravel()
    elements, steps = directions.shape[1] // 3, len(stretches)
    joined.dense_turning = np.tile(np.arange(elements), steps)
    joined.dense_turning_counts = np.full(steps, elements)
    joined.dense_closed, joined.dense_impacts = np.zeros(0, np.int8), np.zeros(2 * steps)
    joined.dense_torque = np.zeros(0)
    joined.dense_moved = _motion(compiled, parts, dense, ends[1:])[4]
