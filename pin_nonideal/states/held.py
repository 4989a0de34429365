"""Projection onto the constraints with some entries of a configuration or a velocity held."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Model

from .joint_layout import JointPlace, joint_places
from .rows import DEPENDENT, row_lengths, rows_at, shortest
from .scales import coordinate

# Part of the velocities in play by which rows over their greatest lengths may miss their rates.
MISSED = 1e-9
# Part of the largest velocity by which a projection changes velocities that meet the constraints already.
ROUNDING = 1e-12
# Part of the largest velocity above which the change of a free entry is reported.
LITTLE = 1e-3
# Newton steps from a closure that a search has found, which is near enough for each to square its gap.
SETTLINGS = 8


class Held(NamedTuple):
    """Entries of a state that were named and stay.

    Attributes:
        q: tangent coordinates of the configuration, (nv,), or None.
        v: entries of the velocity, (nv,), or None.
        firm_q: whether it is an error that they cannot stay; else all are projected then, as entries that
            were named for another time.
        firm_v: the same of the velocity.
    """

    q: NDArray[np.bool_] | None = None
    v: NDArray[np.bool_] | None = None
    firm_q: bool = True
    firm_v: bool = True


NOTHING_HELD = Held()


def changes(asked: Array, found: Array, held: NDArray[np.bool_]) -> bool:
    """Whether a projection has changed held entries by more than rounding.

    Args:
        asked: velocity before, (nv,).
        found: velocity after, (nv,).
        held: entries to be held, (nv,).
    """
    change = np.abs(found - asked)[held].max(initial=0.0)
    return bool(change > ROUNDING * np.abs(asked).max(initial=0.0))


def moving(model: Model, q: Array, on: Array, unit: Array) -> NDArray[np.bool_]:
    """Which coordinates a projection has moved by more than rounding, (nv,).

    Args:
        model: pinocchio.Model.
        q: configuration before, (nq,).
        on: configuration after, (nq,).
        unit: a long move of each coordinate, (nv,).
    """
    away: NDArray[np.bool_] = np.abs(pin.difference(model, q, on)) > ROUNDING * unit
    return away


def moves(model: Model, q: Array, on: Array, held: NDArray[np.bool_], unit: Array) -> bool:
    """Whether it has moved held ones.

    Args:
        model: pinocchio.Model.
        q: configuration before, (nq,).
        on: configuration after, (nq,).
        held: coordinates to be held, (nv,).
        unit: a long move of each coordinate, (nv,).
    """
    return bool((moving(model, q, on, unit) & held).any())


def settled(
    model: Model,
    runner: core.Runner,
    q: Array,
    free: NDArray[np.bool_],
    rows: NDArray[np.bool_],
    t: float,
) -> Array:
    """Free coordinates near the constraints brought onto them to rounding, by Newton's method.

    Args:
        model: pinocchio.Model.
        runner: a workspace of the core.
        q: configuration, (nq,).
        free: coordinates that move, (nv,).
        rows: rows that must hold, (m,).
        t: time [s].

    Returns:
        The configuration, (nq,).
    """
    zero = np.zeros(model.nv)
    gap = np.inf
    for _ in range(SETTLINGS):
        A, _, phi, _ = rows_at(runner, q, zero, t)
        now = float(np.abs(phi[rows]).max(initial=0.0))
        if not now < gap:
            break
        gap, kept, move = now, q, np.zeros(model.nv)
        move[free] = np.linalg.lstsq(A[np.ix_(rows, free)], -phi[rows], rcond=DEPENDENT)[0]
        q = pin.integrate(model, q, move)
    return kept


def with_entries(model: Model, q: Array, given: Array, held: NDArray[np.bool_]) -> Array:
    """A configuration with the held coordinates as they were given, to the last digit.

    Args:
        model: pinocchio.Model.
        q: configuration whose held coordinates differ by rounding, (nq,).
        given: the configuration that was given, (nq,).
        held: coordinates, (nv,).

    Returns:
        The configuration, (nq,).
    """
    out = np.array(q)
    for place in joint_places(model):
        own = held[place.v_first : place.v_first + place.nv]
        if own.all():
            part = slice(place.q_first, place.q_first + place.nq)
            out[part] = given[part]
            continue
        for k in np.flatnonzero(own[: _plain(place)]):
            out[place.q_first + k] = given[place.q_first + k]
    return out


def _plain(place: JointPlace) -> int:
    """How many values of a joint are coordinates themselves, before those of an orientation."""
    if place.nq == place.nv:
        return place.nq
    kinds = {"JointModelFreeFlyer": 3, "JointModelPlanar": 2}
    return next((count for kind, count in kinds.items() if place.kind.startswith(kind)), 0)


def require_rounding(
    model: Model, q: Array, on: Array, held: NDArray[np.bool_], little: Array, t: float
) -> None:
    """Refuses a configuration that has moved held entries by more than written numbers are rounded.

    Args:
        model: pinocchio.Model.
        q: configuration as it was given, (nq,).
        on: the nearest one on the constraints, (nq,).
        held: coordinates to be held, (nv,).
        little: rounding of each coordinate, (nv,).
        t: time [s].

    Raises:
        InputError: one is.
    """
    move = pin.difference(model, q, on)
    if not (held & (np.abs(move) > little)).any():
        return
    raise InputError(
        f"q: no configuration on the constraints has {_told(model, _coordinates(model, q), held)} at t = "
        f"{t:.2f} s; name fewer entries, so that the others can follow, or give a configuration that is "
        "consistent"
    )


def told_coordinates(
    model: Model, asked: Array, found: Array, held: NDArray[np.bool_], unit: Array
) -> list[str]:
    """A note that names the coordinates that follow held ones, and another on held ones that moved; or none.

    Args:
        model: pinocchio.Model.
        asked: configuration as asked for, (nq,).
        found: configuration at the start of the run, (nq,).
        held: coordinates that were named, (nv,).
        unit: a long move of each coordinate, (nv,).
    """
    move = np.abs(pin.difference(model, asked, found))
    follows, gave_way = ~held & (move > LITTLE * unit), held & (move > ROUNDING * unit)
    now, notes = _coordinates(model, found), []
    if gave_way.any():
        notes.append(
            "the coordinates that were named are rounded, since the constraints do not allow them together "
            f"to the last digit: the run starts with {_told(model, now, gave_way)}"
        )
    if follows.any():
        notes.append(
            f"the coordinates that were named are held, {_told(model, now, held)}, and others follow them: "
            f"{_told(model, now, follows)}"
        )
    return notes


def _coordinates(model: Model, q: Array) -> Array:
    """A configuration as numbers for a message, (nv,): positions, angles, rotation vectors."""
    out: Array = pin.difference(model, pin.neutral(model), q)
    for place in joint_places(model):
        count = _plain(place)
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
    """The velocity v' with A v' + phi_t = 0, v' = v in held entries and the least d^T M d, d = v' - v.

    Args:
        model: pinocchio.Model.
        program: the scene as the core knows it.
        q: configuration on the constraints, (nq,).
        v: velocity as asked for, (nv,).
        held: entries that stay, (nv,).
        rows: rows that must hold, (m,).
        metric: M, positive definite, (nv, nv).
        unit: a long move of each coordinate, (nv,).
        t: time [s].

    Returns:
        v', (nv,).

    Raises:
        InputError: the constraints do not allow the held entries together.
    """
    runner, free = program.runner(), ~held
    A, _, _, rate = rows_at(runner, q, v, t)
    lengths, all_root = row_lengths(runner, q, v, t)[: len(A)], np.linalg.cholesky(metric)
    whole = np.linalg.norm(np.linalg.solve(all_root, A.T), axis=0)
    acting = np.flatnonzero(rows & (lengths > 0.0) & (whole > DEPENDENT * lengths))
    A, rate, lengths = A[acting], rate[acting], lengths[acting]
    root = np.linalg.cholesky(metric[np.ix_(free, free)])
    B = np.linalg.solve(root, A[:, free].T).T
    moved = np.linalg.norm(B, axis=1) > DEPENDENT * lengths
    scale = lengths[moved]
    x = shortest(B[moved] / scale[:, None], -rate[moved] / scale, np.ones(B.shape[1]))
    found: Array = v.copy()
    found[free] += np.linalg.solve(root.T, x)
    missed = np.abs(rows_at(runner, q, found, t)[3][acting]) / lengths
    in_play = sum(float(np.linalg.norm(all_root.T @ x)) for x in (v, found, unit))  # one unit per second
    if (missed > MISSED * max(in_play, float(np.abs((rate - A @ v) / lengths).max(initial=0.0)))).any():
        raise InputError(
            f"v: no velocity on the constraints has {_told(model, v, held)} at t = {t:.2f} s; name fewer "
            "entries, so that the others can follow, or give velocities that are consistent"
        )
    return found


def changed(model: Model, asked: Array, found: Array) -> list[str]:
    """A note on a velocity that did not meet the constraints and was changed more than a little; or none.

    Args:
        model: pinocchio.Model.
        asked: velocity as asked for, (nv,).
        found: velocity at the start of the run, (nv,).
    """
    change = np.abs(found - asked)
    much = change > LITTLE * max(np.abs(asked).max(initial=0.0), np.abs(found).max(initial=0.0))
    if not much.any():
        return []
    return [
        "the initial velocity did not satisfy the constraints and was projected onto them: the run starts "
        f"with {_told(model, found, much)}; Scene.project(report=True) says more"
    ]


def told(model: Model, asked: Array, found: Array, held: NDArray[np.bool_]) -> list[str]:
    """A note that names the entries that follow held ones; none where no entry had to.

    Args:
        model: pinocchio.Model.
        asked: velocity as asked for, (nv,).
        found: velocity at the start of the run, (nv,).
        held: entries that stay, (nv,).
    """
    change = np.abs(found - asked)
    follows = ~held & (change > LITTLE * max(np.abs(asked).max(initial=0.0), np.abs(found).max(initial=0.0)))
    if not follows.any():
        return []
    return [
        f"the velocities that were named are held, {_told(model, found, held)}, and others follow them: "
        f"{_told(model, found, follows)}"
    ]


def _told(model: Model, v: Array, which: NDArray[np.bool_]) -> str:
    dofs = list(map(int, np.flatnonzero(which)))
    shown = ", ".join(f'"{coordinate(model, dof)}" = {v[dof]:.4g}' for dof in dofs[:4])
    return f"{shown} and {len(dofs) - 4} more" if len(dofs) > 4 else shown
