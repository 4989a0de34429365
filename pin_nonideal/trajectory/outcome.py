"""Conversion of the core's results to fields of a Trajectory."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from pin_nonideal.compilation.error_context import joint_of
from pin_nonideal.core_loader import core
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.types import Array, Table

from .records import LEDGER, Event, Stats


def outcome_stats(outcome: core.Outcome, wall: float) -> Stats:
    """Return the counters of a run.

    Args:
        outcome: result of the core.
        wall: wall time [s].
    """
    return Stats(
        outcome.steps,
        outcome.rejected,
        outcome.evaluations,
        outcome.factorizations,
        outcome.projections,
        outcome.iterations,
        wall,
        outcome.motion_residual,
        *outcome.contact_misses,
        outcome.limited,
        outcome.rounding,
    )


def outcome_fields(scene: Scene, outcome: core.Outcome, options: Any) -> Table:
    """Return the fields of a Trajectory, without its counters, from the core's flat arrays.

    Args:
        scene: scene of the run.
        outcome: result of the core.
        options: options of the run, a RunOptions.
    """
    t, nq, nv, program = outcome.t, scene.q0.size, scene.v0.size, compiled_scene(scene).program
    nt = len(t)
    fields: Table = {}
    if options.a:
        fields["a"] = outcome.a.reshape(nt, nv)
    if options.tau:
        fields["tau"] = outcome.tau.reshape(nt, nv)
    if options.forces:
        fields["F_ideal"] = outcome.F_ideal.reshape(nt, nv)
        fields["F_nonideal"] = outcome.F_nonideal.reshape(nt, nv)
        fields["lam"] = outcome.lam.reshape(nt, program.rows)
        fields["lam_ideal"] = outcome.lam_ideal.reshape(nt, program.rows)
        fields["contact_forces"] = _contact_forces(scene, outcome)
    if options.laws:
        fields |= _of_laws(scene, outcome)
    if options.reactions:
        fields["reactions"] = _reactions(scene, outcome)
    if options.power or options.energy:
        columns = _columns(program)
    if options.power:
        power = outcome.power.reshape(nt, len(columns))
        fields["power"] = dict(zip(columns, power.T, strict=True))
    if options.energy:
        jumps = ["impacts"] if compiled_scene(scene).opening_names else []
        fields["energy"] = _ledger([*columns, *jumps], outcome.energy)
    if scene.contact_names:
        fields["closed"] = outcome.closed.reshape(nt, len(scene.contact_names)).astype(bool)
    if program.states:
        fields["z"] = outcome.z.reshape(nt, program.states)
    elements = scene.element_names
    if elements:
        fields["modes"] = outcome.modes.reshape(nt, len(elements))
    return dict(
        t=t,
        q=outcome.q.reshape(nt, nq),
        v=outcome.v.reshape(nt, nv),
        violation=outcome.violation,
        violation_rate=outcome.violation_rate,
        events=[_event(scene, event, options.event_names) for event in outcome.events],
        scene=scene,
        element_names=list(elements),
        element_laws=list(program.element_laws),
        law_names=list(program.law_names),
        joints=compiled_scene(scene).joints,
        rows=compiled_scene(scene).rows,
        name=scene.name,
        **fields,
    )


def _of_laws(scene: Scene, outcome: core.Outcome) -> Table:
    """Return the forces of the laws on the degrees of freedom of each law, and the limits of the elements."""
    program, nt = compiled_scene(scene).program, len(outcome.t)
    flat, last = (numbers.astype(int).tolist() for numbers in program.law_supports())
    ends = [0, *last]
    supports = [flat[start:end] for start, end in itertools.pairwise(ends)]
    forces = outcome.law_forces.reshape(nt, ends[-1])
    parts = [forces[:, start:end] for start, end in itertools.pairwise(ends)]
    elements = len(scene.element_names)
    return {
        "law_forces": dict(zip(program.law_names, parts, strict=False)),
        "law_dofs": supports,
        "limits": outcome.limits.reshape(nt, elements),
    }


def _contact_forces(scene: Scene, outcome: core.Outcome) -> dict[str, Array]:
    """Return the force of each contact between two frames, in world axes."""
    compiled = compiled_scene(scene)
    names = [compiled.block_names[block] for block in compiled.program.framed_contacts]
    forces = outcome.contact_forces.reshape(len(outcome.t), len(names), 3)
    return {name: forces[:, k] for k, name in enumerate(names)}


def _reactions(scene: Scene, outcome: core.Outcome) -> dict[str, Array]:
    """Return the wrenches of joints, then of anchors and contacts, in their own axes and in world axes."""
    compiled = compiled_scene(scene)
    joints = [str(name) for name in scene.model.names][1:]
    names = [*joints, *(compiled.block_names[block] for block in compiled.program.reaction_blocks)]
    wrenches = outcome.reactions.reshape(len(outcome.t), len(names), 12)
    return {name: wrenches[:, k] for k, name in enumerate(names)}


def _event(scene: Scene, event: core.Event, functions: Sequence[str]) -> Event:
    """Return an event with the name of its element, contact or constraint, or of the user's function."""
    if event.kind is core.EventKind.user:
        return Event(event.time, event.kind.name, functions[event.element])
    if event.kind in (core.EventKind.saturate, core.EventKind.desaturate):
        joint = scene.model.names[joint_of(scene.model, event.element)]
        return Event(event.time, event.kind.name, str(joint))
    if not event.of_contact and event.kind is not core.EventKind.jump:
        # Without friction, a cluster of events consists of contact events.
        names = scene.element_names or compiled_scene(scene).opening_names
        return Event(event.time, event.kind.name, names[event.element])
    name = compiled_scene(scene).block_names[event.element]
    if event.kind not in (core.EventKind.impact, core.EventKind.jump):
        return Event(event.time, event.kind.name, name, miss=event.miss)
    change = event.energy_change
    return Event(event.time, event.kind.name, name, event.impulse, change, event.v_minus, event.v_plus)


def _ledger(columns: Sequence[str], energy: Array) -> dict[str, Array]:
    """Return the stored energies, the work since the start, and their sums, from the core's columns."""
    stored, works = ("kinetic", "potential"), (*columns, "projection")
    split = len(stored)
    numbers = energy.reshape(-1, split + len(works))
    ledger = dict(zip(stored, numbers.T[:split], strict=True))
    ledger["total"] = ledger["kinetic"] + ledger["potential"]
    ledger |= dict(zip(works, numbers.T[split:], strict=True))
    ledger["balance"] = ledger["total"] - ledger["total"][:1] - numbers[:, split:].sum(axis=1)
    return ledger


def _columns(program: core.Program) -> list[str]:
    """Return the names of the power columns; laws are renamed if another ledger column has their name."""
    names = program.power_names
    first_law = len(names) - len(program.law_names)
    used_names = {*LEDGER, *names[:first_law], "projection"}
    return names[:first_law] + [f"law {name}" if name in used_names else name for name in names[first_law:]]
