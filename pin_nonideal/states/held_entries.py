"""Projection onto the constraints with held entries of a configuration or a velocity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Model

from .joint_layout import JointPlace, joint_places
from .rows import MIN_SINGULAR_VALUE, minimum_norm, row_lengths, rows_at
from .scales import coordinate

# Tolerance of row rates divided by their greatest lengths, relative to the scale of the velocities.
RATE_TOL = 1e-9
# Rounding error of a projection, relative to the largest velocity or to the unit of a coordinate.
ROUNDING = 1e-12
# Changes of free entries are reported above this fraction of the largest velocity or of a unit.
REPORTED_CHANGE = 1e-3
# Maximum number of Newton steps after a search, which squares the residual in each step.
MAX_NEWTON_STEPS = 8


class Held(NamedTuple):
    """Named entries of a state that a projection holds.

    Attributes:
        q: mask of held tangent coordinates of the configuration, (nv,), or None.
        v: mask of held entries of the velocity, (nv,), or None.
        firm_q: whether an error is raised if coordinates cannot be held. Otherwise, if the coordinates cannot
            be held, all coordinates are projected, for example because the entries hold at another time.
        firm_v: whether an error is raised if velocities cannot be held.
    """

    q: NDArray[np.bool_] | None = None
    v: NDArray[np.bool_] | None = None
    firm_q: bool = True
    firm_v: bool = True


NOTHING_HELD = Held()


def changes(before: Array, after: Array, held: NDArray[np.bool_]) -> bool:
    """Check if a projection has changed held entries by more than rounding.

    Args:
        before: velocity before, (nv,).
        after: velocity after, (nv,).
        held: mask of held entries, (nv,).
    """
    change = np.abs(after - before)[held].max(initial=0.0)
    return bool(change > ROUNDING * np.abs(before).max(initial=0.0))


def moved_mask(model: Model, q: Array, on: Array, unit: Array) -> NDArray[np.bool_]:
    """Return the mask of coordinates that a projection has moved by more than rounding, (nv,).

    Args:
        model: pinocchio.Model.
        q: configuration before, (nq,).
        on: configuration after, (nq,).
        unit: unit displacement of each coordinate, (nv,).
    """
    away: NDArray[np.bool_] = np.abs(pin.difference(model, q, on)) > ROUNDING * unit
    return away


def moves(model: Model, q: Array, on: Array, held: NDArray[np.bool_], unit: Array) -> bool:
    """Check if a projection has moved held coordinates by more than rounding.

    Args:
        model: pinocchio.Model.
        q: configuration before, (nq,).
        on: configuration after, (nq,).
        held: mask of held coordinates, (nv,).
        unit: unit displacement of each coordinate, (nv,).
    """
    return bool((moved_mask(model, q, on, unit) & held).any())


def polish_free(
    model: Model,
    runner: core.Runner,
    q: Array,
    free: NDArray[np.bool_],
    rows: NDArray[np.bool_],
    t: float,
) -> Array:
    """Move free coordinates onto nearby constraints, to rounding, by Newton's method.

    Args:
        model: pinocchio.Model.
        runner: a workspace of the core.
        q: configuration, (nq,).
        free: mask of coordinates that move, (nv,).
        rows: mask of rows that must hold, (m,).
        t: time [s].

    Returns:
        The configuration, (nq,).
    """
    zero = np.zeros(model.nv)
    gap = np.inf
    for _ in range(MAX_NEWTON_STEPS):
        A, _, phi, _ = rows_at(runner, q, zero, t)
        now = float(np.abs(phi[rows]).max(initial=0.0))
        if not now < gap:
            break
        gap, best, move = now, q, np.zeros(model.nv)
        move[free] = np.linalg.lstsq(A[np.ix_(rows, free)], -phi[rows], rcond=MIN_SINGULAR_VALUE)[0]
        q = pin.integrate(model, q, move)
    return best


def with_entries(model: Model, q: Array, source: Array, held: NDArray[np.bool_]) -> Array:
    """Return a configuration with the held coordinates bitwise equal to the given values.

    Args:
        model: pinocchio.Model.
        q: configuration whose held coordinates differ by rounding, (nq,).
        source: the given configuration, (nq,).
        held: mask of held coordinates, (nv,).

    Returns:
        The configuration, (nq,).
    """
    out = np.array(q)
    for place in joint_places(model):
        entries = held[place.v_first : place.v_first + place.nv]
        if entries.all():
            part = slice(place.q_first, place.q_first + place.nq)
            out[part] = source[part]
            continue
        for k in np.flatnonzero(entries[: _coordinate_count(place)]):
            out[place.q_first + k] = source[place.q_first + k]
    return out


def _coordinate_count(place: JointPlace) -> int:
    """Return the number of leading values of a joint that are coordinates and no part of an orientation."""
    if place.nq == place.nv:
        return place.nq
    kinds = {"JointModelFreeFlyer": 3, "JointModelPlanar": 2}
    return next((count for kind, count in kinds.items() if place.kind.startswith(kind)), 0)


def require_rounding(
    model: Model, q: Array, on: Array, held: NDArray[np.bool_], little: Array, t: float
) -> None:
    """Check that a projection has moved held coordinates at most by the rounding error of written numbers.

    Args:
        model: pinocchio.Model.
        q: configuration before, (nq,).
        on: nearest configuration on the constraints, (nq,).
        held: mask of held coordinates, (nv,).
        little: largest displacement of each held coordinate, (nv,).
        t: time [s].

    Raises:
        InputError: a held coordinate has moved farther.
    """
    move = pin.difference(model, q, on)
    if not (held & (np.abs(move) > little)).any():
        return
    raise InputError(
        f"q: no configuration on the constraints has {_list_names(model, _coordinates(model, q), held)} at t "
        f"= {t:.2f} s; name fewer entries, so that the others can follow, or give a configuration that is "
        "consistent"
    )


def coordinate_notes(
    model: Model, before: Array, after: Array, held: NDArray[np.bool_], unit: Array
) -> list[str]:
    """Return notes on changes of held coordinates, and of other coordinates.

    Args:
        model: pinocchio.Model.
        before: requested configuration, (nq,).
        after: configuration at the start of the run, (nq,).
        held: mask of named coordinates, (nv,).
        unit: unit displacement of each coordinate, (nv,).
    """
    move = np.abs(pin.difference(model, before, after))
    follows, gave_way = ~held & (move > REPORTED_CHANGE * unit), held & (move > ROUNDING * unit)
    now, notes = _coordinates(model, after), []
    if gave_way.any():
        notes.append(
            "the coordinates that were named are rounded, since the constraints do not allow them together "
            f"to the last digit: the run starts with {_list_names(model, now, gave_way)}"
        )
    if follows.any():
        notes.append(
            f"the coordinates that were named are held, {_list_names(model, now, held)}, and others follow "
            f"them: {_list_names(model, now, follows)}"
        )
    return notes


def _coordinates(model: Model, q: Array) -> Array:
    """Return a configuration as numbers for a message, (nv,): positions, angles, rotation vectors."""
    out: Array = pin.difference(model, pin.neutral(model), q)
    for place in joint_places(model):
        count = _coordinate_count(place)
        out[place.v_first : place.v_first + count] = q[place.q_first : place.q_first + count]
    return out


def holding(
    model: Model,
    program: core.Program,
    q: Array,
    v: Array,
    held: NDArray[np.bool_],
    rows: NDArray[np.bool_],
    metric: Array,
    unit: Array,
    t: float,
) -> Array:
    """Compute v' with A v' + phi_t = 0, v' = v in held entries, and least d^T M d, where d = v' - v.

    Args:
        model: pinocchio.Model.
        program: the core's program.
        q: configuration on the constraints, (nq,).
        v: requested velocity, (nv,).
        held: mask of held entries, (nv,).
        rows: mask of rows that must hold, (m,).
        metric: M, positive definite, (nv, nv).
        unit: unit displacement of each coordinate, (nv,).
        t: time [s].

    Returns:
        v', (nv,).

    Raises:
        InputError: the constraints do not admit the held entries together.
    """
    runner, free = program.runner(), ~held
    A, _, _, rate = rows_at(runner, q, v, t)
    lengths, all_root = row_lengths(runner, q, v, t)[: len(A)], np.linalg.cholesky(metric)
    whole = np.linalg.norm(np.linalg.solve(all_root, A.T), axis=0)
    acting = np.flatnonzero(rows & (lengths > 0.0) & (whole > MIN_SINGULAR_VALUE * lengths))
    A, rate, lengths = A[acting], rate[acting], lengths[acting]
    root = np.linalg.cholesky(metric[np.ix_(free, free)])
    B = np.linalg.solve(root, A[:, free].T).T
    moved = np.linalg.norm(B, axis=1) > MIN_SINGULAR_VALUE * lengths
    scale = lengths[moved]
    x = minimum_norm(B[moved] / scale[:, None], -rate[moved] / scale, np.ones(B.shape[1]))
    velocity: Array = v.copy()
    velocity[free] += np.linalg.solve(root.T, x)
    missed = np.abs(rows_at(runner, q, velocity, t)[3][acting]) / lengths
    in_play = sum(float(np.linalg.norm(all_root.T @ x)) for x in (v, velocity, unit))  # one unit per second
    if (missed > RATE_TOL * max(in_play, float(np.abs((rate - A @ v) / lengths).max(initial=0.0)))).any():
        raise InputError(
            f"v: no velocity on the constraints has {_list_names(model, v, held)} at t = {t:.2f} s; name "
            "fewer entries, so that the others can follow, or give velocities that are consistent"
        )
    return velocity


def change_note(model: Model, before: Array, after: Array) -> list[str]:
    """Return a note on a velocity that the projection changed notably, or no note.

    Args:
        model: pinocchio.Model.
        before: requested velocity, (nv,).
        after: velocity at the start of the run, (nv,).
    """
    change = np.abs(after - before)
    much = change > REPORTED_CHANGE * max(np.abs(before).max(initial=0.0), np.abs(after).max(initial=0.0))
    if not much.any():
        return []
    return [
        "the initial velocity did not satisfy the constraints and was projected onto them: the run starts "
        f"with {_list_names(model, after, much)}; Scene.project(report=True) returns details"
    ]


def held_notes(model: Model, before: Array, after: Array, held: NDArray[np.bool_]) -> list[str]:
    """Return a note on velocities that follow held entries, or no note.

    Args:
        model: pinocchio.Model.
        before: requested velocity, (nv,).
        after: velocity at the start of the run, (nv,).
        held: mask of held entries, (nv,).
    """
    change = np.abs(after - before)
    follows = ~held & (
        change > REPORTED_CHANGE * max(np.abs(before).max(initial=0.0), np.abs(after).max(initial=0.0))
    )
    if not follows.any():
        return []
    return [
        f"the velocities that were named are held, {_list_names(model, after, held)}, and others follow "
        f"them: {_list_names(model, after, follows)}"
    ]


def _list_names(model: Model, v: Array, which: NDArray[np.bool_]) -> str:
    dofs = list(map(int, np.flatnonzero(which)))
    shown = ", ".join(f'"{coordinate(model, dof)}" = {v[dof]:.4g}' for dof in dofs[:4])
    return f"{shown} and {len(dofs) - 4} more" if len(dofs) > 4 else shown
