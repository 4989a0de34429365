"""Conversion of the core's results to fields of a Trajectory."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.error_context import joint_of
from pin_nonideal.core_loader import core
from pin_nonideal.types import Array, Table

from .energy_ledger import energy_ledger, power_columns
from .pair_events import ContactStates, contact_events
from .point_samples import recorded_points
from .records import Event, Stats
from .resultants import contact_forces, reactions


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


def outcome_fields(compiled: CompiledScene, outcome: core.Outcome, options: Any) -> Table:
    """Return the fields of a Trajectory, without its counters and its scene, from the core's flat arrays.

    Args:
        compiled: compiled scene of the run.
        outcome: result of the core.
        options: options of the run, a RunOptions.
    """
    t, nq, nv = outcome.t, compiled.model.nq, compiled.model.nv
    nt, program = len(t), compiled.program
    every = getattr(options, "contact_points", False)  # dense output of earlier versions has no such option
    recorded = {"forces": options.forces, "reactions": options.reactions}
    points = recorded_points(compiled, outcome, every=every, **recorded)
    fields: Table = {"points": points}
    if options.a:
        fields["a"] = outcome.a.reshape(nt, nv)
    if options.tau:
        fields["tau"] = outcome.tau.reshape(nt, nv)
    if options.forces:
        fields["F_ideal"] = outcome.F_ideal.reshape(nt, nv)
        fields["F_nonideal"] = outcome.F_nonideal.reshape(nt, nv)
        rows = compiled.multipliers.groups
        fields["lam"] = rows.sum(outcome.lam.reshape(nt, program.rows))
        fields["lam_ideal"] = rows.sum(outcome.lam_ideal.reshape(nt, program.rows))
        fields |= contact_forces(compiled, outcome, points)
    if options.laws:
        fields |= _of_laws(compiled, outcome)
    if every:
        fields["contact_points"] = {} if points is None else points.by_contact()
    if options.reactions:
        fields["reactions"] = reactions(compiled, outcome, points)
    works = compiled.works
    if options.power:
        power = works.sum(outcome.power.reshape(nt, works.count))
        fields["power"] = dict(zip(power_columns(compiled), power.T, strict=True))
    if options.energy:
        jumps = ["impacts"] if compiled.has_openings else []
        fields["energy"] = energy_ledger(works, [*power_columns(compiled), *jumps], outcome.energy)
    if compiled.contacts.names:
        closed = outcome.closed.reshape(nt, compiled.contacts.count).astype(bool)
        fields["closed"] = compiled.contacts.any(closed)
    if program.states:
        fields["z"] = outcome.z.reshape(nt, program.states)
    elements = compiled.elements
    if elements.names:
        fields["modes"] = elements.modes(outcome.modes.reshape(nt, elements.count))

    def states() -> ContactStates:
        closed = outcome.closed.reshape(nt, compiled.contacts.count).astype(bool)
        modes = outcome.modes.reshape(nt, elements.count)
        return ContactStates(
            t, compiled.contacts, compiled.point_names, closed, elements, compiled.element_names, modes
        )

    events = [_event(compiled, event, options.event_names) for event in outcome.events]
    fields |= {
        "t": t,
        "q": outcome.q.reshape(nt, nq),
        "v": outcome.v.reshape(nt, nv),
        "violation": outcome.violation,
        "violation_rate": outcome.violation_rate,
    }
    if compiled.points:
        fields = {key: _copied(value) for key, value in fields.items()}
    return dict(
        events=contact_events(events, compiled.contact, states),
        element_names=list(elements.names),
        element_laws=compiled.laws.index[np.array(program.element_laws, dtype=int)[elements.starts]].tolist(),
        law_names=list(compiled.laws.names),
        joints=compiled.joints,
        rows=compiled.rows,
        **fields,
    )


def _copied(value: object) -> object:
    """Return arrays that do not keep the recording of the core alive, which has a column for each point."""
    if isinstance(value, dict):
        return {name: _copied(x) for name, x in value.items()}
    return np.array(value) if isinstance(value, np.ndarray) else value


def _of_laws(compiled: CompiledScene, outcome: core.Outcome) -> Table:
    """Return the forces of the laws on the degrees of freedom of each law, and the limits of the elements."""
    nt = len(outcome.t)
    flat, last = (numbers.astype(int).tolist() for numbers in compiled.program.law_supports())
    ends = [0, *last]
    supports = [flat[start:end] for start, end in itertools.pairwise(ends)]
    forces = outcome.law_forces.reshape(nt, ends[-1])
    limits = outcome.limits.reshape(nt, compiled.elements.count)
    dofs, laws = [], {}
    for name, own in compiled.laws.slices().items():
        support, laws[name] = _sum_of_laws(supports[own], forces[:, ends[own.start] : ends[own.stop]])
        dofs.append(support)
    return {"law_forces": laws, "law_dofs": dofs, "limits": compiled.elements.sum(limits)}


def _sum_of_laws(supports: Sequence[list[int]], forces: Array) -> tuple[list[int], Array]:
    """Return the degrees of freedom on which the laws act, and the total force on each, (nt, n).

    Args:
        supports: degrees of freedom of each law.
        forces: forces of the laws side by side, (nt, number of degrees of freedom of all laws).
    """
    if len(supports) == 1:
        return supports[0], forces
    if all(support == supports[0] for support in supports):
        by_law = forces.reshape(len(forces), len(supports), len(supports[0]))
        return supports[0], np.einsum("tkn->tn", by_law)
    together, first = sorted(set().union(*supports)), 0
    total = np.zeros((len(forces), len(together)))
    for support in supports:
        total[:, [together.index(dof) for dof in support]] += forces[:, first : first + len(support)]
        first += len(support)
    return together, total


def _event(compiled: CompiledScene, event: core.Event, functions: Sequence[str]) -> Event:
    """Return an event with the name of its element, contact or constraint, or of the user's function."""
    if event.kind is core.EventKind.user:
        return Event(event.time, event.kind.name, functions[event.element])
    if event.kind in (core.EventKind.saturate, core.EventKind.desaturate):
        joint = compiled.model.names[joint_of(compiled.model, event.element)]
        return Event(event.time, event.kind.name, str(joint))
    if not event.of_contact and event.kind is not core.EventKind.jump:
        # Without friction, a cluster of events consists of contact events.
        names = compiled.element_names or compiled.opening_names
        return Event(event.time, event.kind.name, names[event.element])
    name = compiled.block_names[event.element]
    if event.kind not in (core.EventKind.impact, core.EventKind.jump):
        return Event(event.time, event.kind.name, name, miss=event.miss)
    change = event.energy_change
    return Event(event.time, event.kind.name, name, event.impulse, change, event.v_minus, event.v_plus)
