"""Report of a projection: displacements of a state, and held named entries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.types import Array, Model

from .held_entries import Held
from .scales import coordinate


@dataclass(frozen=True)
class ProjectionReport:
    """Displacements of a state by a projection.

    Attributes:
        distance: sqrt(d^T M(q) d) of the displacement d = q' - q in tangent coordinates [sqrt(kg) m].
        coordinate: name of the coordinate with the largest displacement relative to its unit, a radian or the
            length of the mechanism. The name is the joint's name, with an index from 0 if the joint has
            several coordinates. Empty without a displacement.
        moved: displacement of this coordinate [rad or m].
        gap: largest residual before [m or rad, in the scale of its row].
        iterations: steps of the search; 0 if Newton's method sufficed.
        nearest: whether the search confirms the configuration as nearest: it is a local minimum of the
            distance, and no other start led to a nearer one. After a long displacement, two starts of the
            search must end at the same configuration.
        velocity_distance: sqrt(d^T M d) of the change d = v' - v of the velocity [sqrt(kg) m/s].
        velocity_coordinate: name of the coordinate with the largest change of velocity relative to its unit;
            empty without a change.
        velocity_changed: change of velocity of this coordinate [rad/s or m/s].
        held: names of the named coordinates, which are held.
        held_velocities: names of the named velocities, which are held.
    """

    distance: float = 0.0
    coordinate: str = ""
    moved: float = 0.0
    gap: float = 0.0
    iterations: int = 0
    nearest: bool = True
    velocity_distance: float = 0.0
    velocity_coordinate: str = ""
    velocity_changed: float = 0.0
    held: tuple[str, ...] = ()
    held_velocities: tuple[str, ...] = ()


def report_of(
    model: Model,
    unit: Array,
    mass: Callable[[Array], Array],
    start: tuple[Array, Array],
    projected: tuple[Array, Array],
    held: Held,
    gap: float = 0.0,
    iterations: int = 0,
    nearest: bool = True,
) -> ProjectionReport:
    """Return the report of one projection.

    Args:
        model: pinocchio.Model.
        unit: unit displacement of each coordinate, (nv,).
        mass: q -> M, (nv, nv).
        start: q (nq,) and v (nv,) before the projection.
        projected: q (nq,) and v (nv,) after the projection.
        held: named entries.
        gap: largest residual before [m or rad, in the scale of its row].
        iterations: steps of the search.
        nearest: whether the search confirms the configuration as nearest.
    """
    (q, v), (on, v_on) = start, projected
    move, change = pin.difference(model, q, on), v_on - v
    distance, max_change, moved = _largest_change(model, unit, mass, q, move)
    velocity_distance, fastest, changed = _largest_change(model, unit, mass, on, change)
    return ProjectionReport(
        distance,
        max_change,
        moved,
        gap,
        iterations if move.any() else 0,
        nearest or not move.any(),
        velocity_distance,
        fastest,
        changed,
        _names(model, held.q),
        _names(model, held.v),
    )


def _largest_change(
    model: Model, unit: Array, mass: Callable[[Array], Array], q: Array, change: Array
) -> tuple[float, str, float]:
    """Return the length of a change in the metric of M(q), and name and change of its largest coordinate."""
    if not change.any():
        return 0.0, "", 0.0
    dof = int(np.argmax(np.abs(change) / unit))
    largest = np.abs(change).max()
    part = change / largest
    length = float(largest * np.sqrt(max(float(part @ mass(q) @ part), 0.0)))
    return length, coordinate(model, dof), float(change[dof])


def _names(model: Model, named: NDArray[np.bool_] | None) -> tuple[str, ...]:
    """Return the names of the named entries."""
    return () if named is None else tuple(coordinate(model, int(dof)) for dof in np.flatnonzero(named))
