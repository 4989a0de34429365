"""Checks before the first step: invalid numbers in the model, zero or duplicate rows, wrong derivatives.

User functions are called near states of a run only. Rows of user functions are never removed.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import Distance, PrescribedMotion, UserConstraint
from pin_nonideal.description.contacts import UserContact
from pin_nonideal.description.laws import UserFriction
from pin_nonideal.description.scene_spec import SceneSpec
from pin_nonideal.description.time_functions import Constant, Polynomial, Sinusoid, Spline
from pin_nonideal.errors import InconsistentConstraintsError, InputError, LoopClosureError, UserFunctionError
from pin_nonideal.states.loop_closure import CLOSURE_TOLERANCE
from pin_nonideal.states.rows import duplicate_rows, row_lengths, row_slices, rows_at
from pin_nonideal.types import Array, Model
from pin_nonideal.validation import array

Rows = NDArray[np.bool_]

# Functions of time without user code.
CORE_FUNCTIONS = (Constant, Polynomial, Sinusoid, Spline)
# A row vanishes structurally if its length stays below this fraction of its greatest possible length at
# random states. The value covers rounding error of the kinematics.
VANISHING_LENGTH = 1e-11
# Right-hand side of a vanishing row, relative to the largest right-hand side: rounding error of long sums.
SUM_ROUNDING = 1e-9
# Tolerance between derivatives of user functions and central differences: relative error of the differences.
DERIVATIVE_TOLERANCE = 1e-4
# Step of the central differences [s], the cube root of unit roundoff, and their time after the start [s].
# User functions are unlikely to have a corner at this time.
DIFFERENCE, AFTER_START = 1e-5, 0.21
# Scales of random displacements [rad or m] around a start. If a function raises, the next smaller is tried.
START_DISPLACEMENTS = (0.1, 1e-2, 1e-3, 1e-4)


def check_model(model: Model) -> None:
    """Check that all numbers of a model are finite and valid.

    Masses and armatures must not be negative. Gravity must have no angular part.

    Args:
        model: pinocchio.Model.

    Raises:
        InputError: a number is invalid.
    """
    for i in range(1, model.njoints):
        Y, name = model.inertias[i], model.names[i]
        for what, value in (("mass", Y.mass), ("center of mass", Y.lever), ("inertia", Y.inertia)):
            array(f'Scene: the {what} moved by joint "{name}"', value, np.shape(value))
        if Y.mass < 0.0:
            raise InputError(
                f'Scene: the mass moved by joint "{name}" must not be negative; got {Y.mass:g} kg'
            )
        array(f'Scene: the place of joint "{name}"', model.jointPlacements[i].homogeneous, (4, 4))
    for frame in model.frames:
        array(f'Scene: the place of frame "{frame.name}"', frame.placement.homogeneous, (4, 4))
    gravity = array("Scene: the gravity of the model", model.gravity.vector, (6,))
    if gravity[3:].any():
        raise InputError(
            "Scene: the gravity of the model must have no angular part, which has no potential energy; got "
            f"{gravity[3:]} rad/s^2: set it to zero, and turn the ground by a joint instead"
        )
    armature = array("Scene: the armature of the model", model.armature, (model.nv,))
    if (armature < 0.0).any():
        raise InputError(
            f"Scene: the armature of the model must not be negative; got {armature.min():g} kg m^2"
        )


def without_functions(spec: SceneSpec, nv: int) -> SceneSpec | None:
    """Return a scene with the same rows but without user functions, or None if no description has one.

    Args:
        spec: descriptions of the scene.
        nv: number of degrees of freedom.
    """
    constraints = tuple(_without_function(c, nv) for c in spec.constraints)
    contacts = tuple(_without_function(c, nv) for c in spec.contacts)
    laws = tuple(_without_function(law, nv) for law in spec.laws)
    pairs = zip(
        (*constraints, *contacts, *laws), (*spec.constraints, *spec.contacts, *spec.laws), strict=True
    )
    if all(one is other for one, other in pairs):
        return None
    return spec._replace(constraints=constraints, contacts=contacts, laws=laws)


def _without_function(c: object, nv: int) -> Any:
    """Return a copy with zeros for user rows, gaps and directions, and constants for functions of time."""
    if isinstance(c, UserConstraint):
        rows, zeros = (np.zeros((c.size, nv)), np.zeros(c.size)), np.zeros(c.size)
        return replace(
            c,
            function=lambda t, q, v, data: rows,
            residual=None if c.residual is None else lambda t, q: zeros,
            rate=None if c.rate is None else lambda t, q, v: zeros,
        )
    if isinstance(c, UserContact):
        rows, zeros = (np.zeros((1, nv)), np.zeros(1)), np.zeros(1)
        return replace(
            c,
            function=lambda t, q, v, data: rows,
            gap=lambda t, q: zeros,
            rate=None if c.rate is None else lambda t, q, v: zeros,
            directions=None if c.directions is None else lambda t, q: np.zeros((1, nv)),
        )
    if isinstance(c, UserFriction):
        return replace(c, direction=lambda t, q: np.zeros(nv))
    if isinstance(c, PrescribedMotion) and not isinstance(c.function, CORE_FUNCTIONS):
        return replace(c, function=Constant(0.0))
    if isinstance(c, Distance) and callable(c.length) and not isinstance(c.length, CORE_FUNCTIONS):
        return replace(c, length=Constant(1.0))
    return c


def zero_rows(
    model: Model,
    q0: Array,
    program: core.Program,
    sampled: core.Program,
    tolerance: float = CLOSURE_TOLERANCE,
) -> tuple[list[tuple[str, int, str]], list[tuple[int, int, float]]]:
    """Return the rows that can never act: zero at every state, or duplicates of other rows.

    Args:
        model: pinocchio.Model.
        q0: configuration around which the rows are sampled, (nq,).
        program: the scene with all its rows.
        sampled: the same scene without user functions, see `without_functions`.
        tolerance: residual that a vanishing row may have [m or rad].

    Returns:
        (name, row, reason) of each removed row, and (row, original row, factor) of each duplicate, where
        row = factor * original row. Duplicates are numbered as in `lam`.

    Raises:
        InconsistentConstraintsError: a vanishing row has a nonzero right-hand side.
        LoopClosureError: a vanishing row has a residual above the tolerance.
    """
    free_gaps = set(program.free_gaps)
    chosen = [block for block in range(len(program.first_rows)) if block not in free_gaps]
    if not chosen:
        return [], []
    first_rows = program.first_rows
    chosen.sort(key=lambda block: first_rows[block])
    blocks = program.constraint_rows(chosen)
    owners = [(c.name, row) for c in blocks for row in range(c.count)]
    # Rows that move in time may vanish at a few states only, so they stay. Gaps are never duplicates.
    fixed = np.array([c.moves_in_time for c in blocks for _ in range(c.count)], dtype=bool)
    opens = np.repeat([block >= program.first_gap for block in chosen], [c.count for c in blocks])
    if fixed.all():
        return [], []
    runner, generator, samples = sampled.runner(), np.random.default_rng(1), []
    vanishing = ~fixed
    for _ in range(3):
        q = pin.integrate(model, q0, generator.standard_normal(model.nv))
        v = generator.standard_normal(model.nv)
        samples.append(rows_at(runner, q, v, 0.37, chosen)[:3])
        own, greatest = (row_lengths(runner, q, v, 0.37, own=own, blocks=chosen) for own in (True, False))
        vanishing &= own <= VANISHING_LENGTH * greatest
    wide = np.hstack([A for A, _, _ in samples])
    right = np.column_stack([b for _, b, _ in samples])
    gaps = np.abs(np.column_stack([phi for _, _, phi in samples])).max(axis=1)
    dropped = []
    for row in map(int, np.flatnonzero(vanishing)):
        gap = 0.0 if opens[row] else gaps[row]
        _check_vanishing(*owners[row], np.abs(right[row]).max(), np.abs(right).max(), gap, tolerance)
        dropped.append((*owners[row], "vanishes"))
    pairs = duplicate_rows(np.hstack([wide, right]), ~vanishing & ~fixed & ~opens, wide.shape[1])
    numbers = [c.first + row for c in blocks for row in range(c.count)]
    dropped += [(*owners[row], f'copy of a row of "{owners[first][0]}"') for row, first, _ in pairs]
    rows = {owner: row for row, owner in enumerate(owners)}
    duplicates = [(numbers[row], numbers[first], factor) for row, first, factor in pairs]
    return sorted(dropped, key=lambda entry: rows[entry[:2]]), duplicates


def _check_vanishing(
    name: str, local: int, acceleration: float, largest: float, gap: float, tolerance: float
) -> None:
    """Check that a vanishing row has zero right-hand side and a residual within the tolerance."""
    if acceleration > SUM_ROUNDING * max(1.0, largest):
        raise InconsistentConstraintsError(
            f'row {local} of constraint "{name}" moves nothing and requires the acceleration '
            f"{acceleration:.1e}; the joints leave that direction no freedom: remove the row or free a joint"
        )
    if gap > tolerance:
        raise LoopClosureError(
            f'loop "{name}" does not close: gap {gap:.2g} in row {local}, a direction in which no joint '
            "moves; correct the placement of the frames",
            gaps={name: float(gap)},
        )


def has_rates(c: object) -> bool:
    """Check if a description holds user functions that are derivatives of each other.

    Args:
        c: constraint or contact.
    """
    return isinstance(c, UserContact) or (
        isinstance(c, UserConstraint) and (c.residual is not None or c.rate is not None)
    )


def check_user_functions(
    model: Model, q0: Array, v0: Array, t0: float, described: Mapping[str, object], program: core.Program
) -> None:
    """Check by central differences that d residual/dt = rate and d rate/dt = A a - b.

    The residual of a contact is its gap. Functions that raise around the start are not checked.

    Args:
        model: pinocchio.Model.
        q0: start configuration, near which the functions are compared, (nq,).
        v0: velocity, (nv,).
        t0: time of the start [s].
        described: constraints and contacts by their names.
        program: the core's program.

    Raises:
        InputError: a function differs from the difference quotient.
    """
    slices = row_slices(program)
    runner, generator = program.runner(), np.random.default_rng(3)
    for name, c in described.items():
        if not has_rates(c):
            continue
        moves = [generator.standard_normal(model.nv) for _ in range(3)]
        for part in START_DISPLACEMENTS:
            q, t = pin.integrate(model, q0, part * moves[0]), t0 + part / START_DISPLACEMENTS[0] * AFTER_START
            with suppress(UserFunctionError), np.errstate(all="ignore"):
                _check_derivatives(model, runner, q, v0 + moves[1], moves[2], t, slices[name], name, c)
                break


def _check_derivatives(
    model: Model,
    runner: core.Runner,
    q: Array,
    v: Array,
    a: Array,
    t: float,
    rows: slice,
    name: str,
    c: Any,
) -> None:
    """Check the derivatives at one state, along a motion with constant acceleration."""
    h, who = DIFFERENCE, f'{type(c).__name__} "{name}"'
    A, b, _, rate = (x[rows] for x in rows_at(runner, q, v, t))
    ends = []
    for s in (h, -h):
        ahead = pin.integrate(model, q, s * v + 0.5 * s * s * a)
        ends.append(rows_at(runner, ahead, v + s * a, t + s))
    size = float(np.abs(A).max()) * (1.0 + float(np.abs(v).max())) ** 2
    scale = 1.0 + size + float(np.abs(b).max())
    if isinstance(c, UserContact) or c.residual is not None:
        difference = (ends[0][2] - ends[1][2])[rows] / (2.0 * h)
        of_what = "d gap/dt" if isinstance(c, UserContact) else "d residual/dt"
        _compare(who, of_what, difference, "rate", rate, scale)
    difference = (ends[0][3] - ends[1][3])[rows] / (2.0 * h)
    _compare(who, "d rate/dt", difference, "A a - b", A @ a - b, scale)


def _compare(name: str, left: str, x: Array, right: str, y: Array, scale: float) -> None:
    miss = np.abs(x - y)
    if float(miss.max(initial=0.0)) > DERIVATIVE_TOLERANCE * scale:
        k = int(np.argmax(miss))
        raise InputError(
            f"{name}: {left} must equal {right}; row {k}: {x[k]:.6g} by differences against {y[k]:.6g}; "
            "correct the function, the residual or gap, or the rate"
        )
