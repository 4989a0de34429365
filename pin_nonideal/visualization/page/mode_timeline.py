"""Modes of elements and contacts over time, and gaps of contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.contact_groups import Groups
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.trajectory.contact_points import gaps_of_points
from pin_nonideal.types import Array

from .style import CLOSED, OPEN

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Maximum number of samples at which gaps are computed.
MAX_GAP_SAMPLES = 5000
# Maximum number of gap values of all samples, about a quarter of a second of work. Scenes of many contacts
# have fewer samples, but at least `MIN_GAP_SAMPLES`.
MAX_GAP_VALUES = 1e6
MIN_GAP_SAMPLES = 20

Bands = list[tuple[float, float, int]]
NamedBands = list[tuple[str, Bands]]


def mode_bands(t: Array, modes: NDArray[np.int8]) -> list[Bands]:
    """Return the intervals of constant mode of each element, as (start [s], end [s], mode).

    Args:
        t: times [s], (nt,).
        modes: +1 and -1 for slip, 0 for stick, (nt, n). A mode holds from its sample to the next.
    """
    bands = []
    for column in np.asarray(modes).T:
        starts = np.concatenate([[0], np.flatnonzero(np.diff(column)) + 1])
        ends = np.append(starts[1:], len(t) - 1)
        bands.append([(float(t[i]), float(t[j]), int(column[i])) for i, j in zip(starts, ends, strict=True)])
    return bands


def bands_of(run: Trajectory) -> NamedBands:
    """Return the mode bands by name, for friction elements and frictionless contacts that open or close.

    Contacts that stay open during the whole run are omitted.

    Args:
        run: run of the replay.
    """
    named_bands: NamedBands = []
    if run.modes is not None:
        modes = np.asarray(run.modes)
        is_ever_closed = np.any(modes != OPEN, axis=0)
        struck = {str(event.element) for event in run.events}
        shown = [k for k, name in enumerate(run.element_names) if is_ever_closed[k] or name in struck]
        bands = mode_bands(run.t, modes[:, shown])
        named_bands = [(run.element_names[k], band) for k, band in zip(shown, bands, strict=True)]
    closed = getattr(run, "closed", None)
    if closed is None:
        return named_bands
    rubbing = {run.law_names[law] for law in run.element_laws}
    for name, column in zip(run.scene.contact_names, np.asarray(closed).T, strict=True):
        if name not in rubbing and column.any() and not column.all():
            modes = np.where(column, CLOSED, OPEN).astype(np.int8)
            named_bands.append((name, mode_bands(run.t, modes[:, None])[0]))
    return named_bands


def point_bands_of(run: Trajectory) -> NamedBands:
    """Return the mode bands of the points of pairs of shapes that rub, by name.

    Args:
        run: run of the replay.
    """
    points, rubbing = getattr(run, "points", None), {run.law_names[law] for law in run.element_laws}
    if points is None:
        return []
    pairs = compiled_scene(run.scene).contact_of
    shown = [k for k, name in enumerate(points.names) if name in pairs and points.contacts[k] in rubbing]
    bands = mode_bands(run.t, points.modes[:, shown])
    return [(points.names[k], band) for k, band in zip(shown, bands, strict=True)]


def has_open_contact(run: Trajectory) -> bool:
    """Check if a contact of the run was ever open.

    Args:
        run: run of the replay.
    """
    closed = getattr(run, "closed", None)
    return closed is not None and not np.asarray(closed).all()


def gaps_of(run: Trajectory, names: Sequence[str] | None = None) -> tuple[Array, dict[str, Array]]:
    """Return times [s], (k,), and the least gaps of contacts at these times by name [m, rad], (k,).

    Args:
        run: run of the replay.
        names: names of the contacts; None for all.
    """
    t, compiled = np.asarray(run.t, dtype=float), compiled_scene(run.scene)
    names = run.scene.contact_names if names is None else names
    points = [point for name in names for point in compiled.points.get(name, [name])]
    count = int(np.clip(MAX_GAP_VALUES / max(1, len(points)), MIN_GAP_SAMPLES, MAX_GAP_SAMPLES))
    chosen = np.unique(np.linspace(0, len(t) - 1, min(len(t), count)).astype(int))
    gaps = gaps_of_points(compiled, run.q[chosen], t[chosen], points)
    smallest_gaps = Groups(points, compiled.contact_of).least(gaps, axis=1)
    return t[chosen], dict(zip(names, smallest_gaps.T, strict=True))
