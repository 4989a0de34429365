"""The report of a projection: how far it moved a state, and which named entries it held."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.types import Array, Model

from .held import Held
from .scales import coordinate


@dataclass(frozen=True)
class ProjectionReport:
    """How far a projection moved a state.

    Attributes:
        distance: sqrt(d^T M(q) d) of the move d = q' - q in tangent coordinates [sqrt(kg) m].
        coordinate: the one that moved most, by the name of its joint, with a number from 0 on where the joint
            has several; of lengths and angles the one that moved by more of its unit, a radian or the length
            of the mechanism.  Empty where nothing moved.
        moved: how far that one moved [rad or m].
        gap: largest residual before [m or rad, in the scale of its row].
        iterations: steps of the search; 0 where Newton's method sufficed.
        nearest: whether this is the nearest consistent configuration as far as can be told: no nearer one
            lies around it, nor was one found from other starts, of which two ended here.
        velocity_distance: sqrt(d^T M d) of the change d = v' - v of the velocity [sqrt(kg) m/s].
        velocity_coordinate: the one whose velocity changed most, as `coordinate`; empty where none changed.
        velocity_changed: by how much that one did [rad/s or m/s].
        held: coordinates whose values were named and stayed as they were, by the same names.
        held_velocities: the same of velocities.
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
    given: tuple[Array, Array],
    found: tuple[Array, Array],
    held: Held,
    gap: float = 0.0,
    iterations: int = 0,
    nearest: bool = True,
) -> ProjectionReport:
    """The report of one projection.

    Args:
        model: pinocchio.Model.
        unit: a long move of each coordinate, (nv,).
        mass: q -> M, (nv, nv).
        given: q (nq,) and v (nv,) before.
        found: the same after.
        held: named entries.
        gap: largest residual before [m or rad, in the scale of its row].
        iterations: steps of the search.
        nearest: whether the configuration is known to be the nearest.
    """
    (q, v), (on, v_on) = given, found
    move, change = pin.difference(model, q, on), v_on - v
    distance, most, moved = _farthest(model, unit, mass, q, move)
    velocity_distance, fastest, changed = _farthest(model, unit, mass, on, change)
    return ProjectionReport(
        distance,
        most,
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


def _farthest(
    model: Model, unit: Array, mass: Callable[[Array], Array], q: Array, change: Array
) -> tuple[float, str, float]:
    """Length of a change in the metric of M(q), the coordinate that changes most of its unit, its change."""
    if not change.any():
        return 0.0, "", 0.0
    dof = int(np.argmax(np.abs(change) / unit))
    largest = np.abs(change).max()
    part = change / largest
    length = float(largest * np.sqrt(max(float(part @ mass(q) @ part), 0.0)))
    return length, coordinate(model, dof), float(change[dof])


def _names(model: Model, named: NDArray[np.bool_] | None) -> tuple[str, ...]:
    """Named entries as `ProjectionReport` lists them."""
    return () if named is None else tuple(coordinate(model, int(dof)) for dof in np.flatnonzero(named))
