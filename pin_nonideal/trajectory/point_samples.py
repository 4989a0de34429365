"""Samples of contact points of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.contact_groups import OPEN
from pin_nonideal.core_loader import core
from pin_nonideal.types import Array

from .contact_points import contact_lines, gaps_of_points, side_of_point
from .records import ContactPoints


@dataclass(frozen=True, eq=False)
class PointSamples:
    """Samples of the touching points of pairs of shapes, or of all contact points.

    Attributes:
        names: names of the n points.
        contacts: contact of each point.
        closed: whether each point is closed, (nt, n).
        modes: mode of the friction element of each point, 2 without one, (nt, n).
        loads: normal force of each point [N], (nt, n); without columns if it was not recorded.
        forces: force of each point in world axes [N], on the body of the force of its contact, (nt, n, 3);
            without columns if it was not recorded.
        gaps: gap of each point [m], (nt, n), or None unless all contact points were recorded.
        places: position of each point in the world [m], (nt, n, 3), or None unless all were recorded.
    """

    names: list[str]
    contacts: list[str]
    closed: NDArray[np.bool_]
    modes: NDArray[np.int8]
    loads: Array
    forces: Array
    gaps: Array | None = None
    places: Array | None = None

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return the recorded arrays by name."""
        return {key: x for key, x in vars(self).items() if isinstance(x, np.ndarray)}

    def samples(self, chosen: slice | NDArray[np.generic]) -> PointSamples:
        """Return some of the samples.

        Args:
            chosen: mask, indices or slice of samples.
        """
        return replace(self, **{key: x[chosen] for key, x in self.arrays().items()})  # type: ignore[arg-type]

    def with_forces(self, loads: Array, forces: Array) -> PointSamples:
        """Return the points with other forces.

        Args:
            loads: normal forces [N], (nt, n).
            forces: forces [N], (nt, n, 3).
        """
        return replace(self, loads=loads, forces=forces)

    def of(self, contact: str) -> list[int]:
        """Return the columns of the points of a contact.

        Args:
            contact: name of the contact.
        """
        return [k for k, name in enumerate(self.contacts) if name == contact]

    def by_contact(self) -> dict[str, ContactPoints] | None:
        """Return the points of each contact, or None unless all contact points were recorded."""
        if self.gaps is None or self.places is None:
            return None
        table = {}
        for contact in dict.fromkeys(self.contacts):
            point_names = self.of(contact)
            names = [self.names[k] for k in point_names]
            vectors = self.places[..., point_names, :], self.forces[..., point_names, :]
            parts = self.closed[..., point_names], self.gaps[..., point_names], *vectors
            table[contact] = ContactPoints(contact, names, *parts)
        return table


def recorded_points(
    compiled: CompiledScene, outcome: core.Outcome, *, every: bool, forces: bool, reactions: bool
) -> PointSamples | None:
    """Return the samples of contact points of a run, or None if there are no points to record.

    Args:
        compiled: compiled scene of the run.
        outcome: result of the core.
        every: whether all contact points are recorded, with gaps and positions; else the points of pairs of
            shapes that touch.
        forces: whether the run recorded forces.
        reactions: whether it recorded reactions.
    """
    program, nt = compiled.program, len(outcome.t)
    framed = [compiled.block_names[block] for block in program.framed_contacts]
    if not framed or not (every or compiled.points):
        return None
    column = {name: k for k, name in enumerate(compiled.point_names)}
    closed = outcome.closed.reshape(nt, len(column)) != 0
    names = framed if every else _touching(compiled, outcome, closed)
    contacts = [compiled.contact(name) for name in names]
    loads, pushes, fields = np.zeros((nt, 0)), np.zeros((nt, 0, 3)), {}
    if forces:
        rows = [compiled.slices[name].stop - 1 for name in names]
        loads = outcome.lam.reshape(nt, program.rows)[:, rows]
    if forces or reactions:
        side = np.array([side_of_point(compiled, name) for name in names])
        given = _forces(outcome, framed, names) if forces else _reactions(compiled, outcome, names)
        pushes = side[:, None] * given
    if every:
        q = np.ascontiguousarray(outcome.q.reshape(nt, -1))
        fields["gaps"] = gaps_of_points(compiled, q, outcome.t, names)
        fields["places"] = contact_lines(compiled, q, outcome.t, names)[0]
    closed_points = closed[:, [column[name] for name in names]]
    modes = _modes(compiled, outcome, names)
    return PointSamples(names, contacts, closed_points, modes, loads, pushes, **fields)


def _touching(compiled: CompiledScene, outcome: core.Outcome, closed: NDArray[np.bool_]) -> list[str]:
    """Return the points of pairs of shapes that are closed or loaded at a sample, or take an impact."""
    chosen = set(np.array(compiled.point_names)[closed.any(axis=0)].tolist())
    chosen |= {compiled.block_names[event.element] for event in outcome.events if event.of_contact}
    framed = [compiled.block_names[block] for block in compiled.program.framed_contacts]
    return [name for name in framed if name in chosen and name in compiled.contact_of]


def _forces(outcome: core.Outcome, framed: Sequence[str], names: Sequence[str]) -> Array:
    """Return the forces of points on the bodies of their first frames in world axes, (nt, n, 3)."""
    column = {name: k for k, name in enumerate(framed)}
    forces = outcome.contact_forces.reshape(len(outcome.t), len(framed), 3)
    return forces[:, [column[name] for name in names]]


def _reactions(compiled: CompiledScene, outcome: core.Outcome, names: Sequence[str]) -> Array:
    """Return the forces of points as `_forces` does, from their wrenches."""
    blocks, first = compiled.program.reaction_blocks, compiled.model.njoints - 1
    column = {compiled.block_names[block]: first + k for k, block in enumerate(blocks)}
    wrenches = outcome.reactions.reshape(len(outcome.t), first + len(blocks), 12)
    return wrenches[:, [column[name] for name in names], 6:9]


def _modes(compiled: CompiledScene, outcome: core.Outcome, names: Sequence[str]) -> NDArray[np.int8]:
    """Return the modes of the friction elements of points, (nt, n)."""
    elements = compiled.element_names
    column = {name: k for k, name in enumerate(elements)}
    modes = outcome.modes.reshape(len(outcome.t), len(elements)) if elements else None
    shown = np.full((len(outcome.t), len(names)), OPEN, dtype=np.int8)
    for k, name in enumerate(names):
        if modes is not None and name in column:
            shown[:, k] = modes[:, column[name]]
    return shown
