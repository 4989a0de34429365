"""Errors of states that cannot be projected onto the constraints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.errors import InconsistentConstraintsError, InputError, LoopClosureError
from pin_nonideal.types import Array

from .loop_closure import CLOSURE_TOLERANCE
from .rows import gap_rows, row_slices


def deepest_contact(phi: Array, program: core.Program, contact_of: Mapping[str, str]) -> tuple[str, float]:
    """Return the name and depth of the deepest penetrating contact, or ("", 0.0) without contacts.

    Args:
        phi: residuals of all rows, (m,).
        program: the core's program.
        contact_of: contact of each point of a pair of shapes.
    """
    gaps = phi[program.first_rows[program.first_gap :]]  # one row each
    if not len(gaps):
        return "", 0.0
    deepest = int(gaps.argmin())
    name = program.block_names[program.first_gap + deepest]
    return contact_of.get(name, name), -float(gaps[deepest])


def widest_loop(phi: Array, program: core.Program) -> tuple[str, float]:
    """Return the holonomic bilateral constraint with the largest residual, or ("", 0.0) without any.

    Args:
        phi: residuals or rates of all rows, (m,).
        program: the core's program.
    """
    loops = [c for c in program.bilateral if all(c.holonomic)]
    gaps = {c.name: _largest(phi[c.first : c.first + c.count]) for c in loops}
    name = max(gaps, key=lambda key: gaps[key], default="")
    return name, gaps.get(name, 0.0)


def refuse_deep_starts(
    phi: Array, program: core.Program, allowed: float, t: float, contact_of: Mapping[str, str]
) -> None:
    """Check that no unilateral contact starts with deep penetration, unless loops are open as well.

    Args:
        phi: residuals of all rows, (m,).
        program: the core's program.
        allowed: penetration that the projection may remove [m or rad].
        t: time [s].
        contact_of: contact of each point of a pair of shapes.

    Raises:
        InputError: a contact penetrates deeper.
    """
    if widest_loop(phi, program)[1] > allowed:
        return
    name, depth = deepest_contact(phi, program, contact_of)
    if name and depth > allowed:
        raise InputError(
            f'contact "{name}" starts with a penetration of {depth:.3g} (m or rad) at t = {t:.4g} s; it must '
            f"start open, closed, or with at most {allowed:.2g}, which is removed: change the start"
        )


def penetration_error(
    phi: Array, program: core.Program, t: float, contact_of: Mapping[str, str]
) -> InputError:
    """Return the error of a contact with initial penetration that no short displacement removes.

    Args:
        phi: residuals of all rows at the start, (m,).
        program: the core's program.
        t: time [s].
        contact_of: contact of each point of a pair of shapes.
    """
    name, depth = deepest_contact(phi, program, contact_of)
    return InputError(
        f'contact "{name}" starts with a penetration of {depth:.3g} (m or rad) at t = {t:.4g} s, and no '
        "short move that removes it was found: change the start"
    )


def open_loops(
    phi: Array, program: core.Program, t: float, contact_of: Mapping[str, str]
) -> LoopClosureError:
    """Return the error of loops that do not close.

    Args:
        phi: residuals of all rows, (m,).
        program: the core's program.
        t: time [s].
        contact_of: contact of each point of a pair of shapes.
    """
    left = np.where(gap_rows(program), np.minimum(phi, 0.0), phi)
    gaps = largest_by_contact(np.abs(left), row_slices(program), contact_of)
    largest = max(gaps.values())
    left_open = {name: gap for name, gap in gaps.items() if not gap <= min(CLOSURE_TOLERANCE, 0.5 * largest)}
    text = "; ".join(f'loop "{name}" does not close: gap {gap:.2g}' for name, gap in left_open.items())
    return LoopClosureError(
        f"{text} after several starts; check the lengths and frames, or start nearer", gaps=gaps, time=t
    )


def largest_by_contact(
    sizes: Array, slices: Mapping[str, slice], contact_of: Mapping[str, str]
) -> dict[str, float]:
    """Return the largest size of the rows of each constraint and contact, by name.

    Args:
        sizes: sizes of all rows, (m,).
        slices: rows of each constraint and contact point.
        contact_of: contact of each point of a pair of shapes.
    """
    gaps: dict[str, float] = {}
    for name, rows in slices.items():
        contact, largest = contact_of.get(name, name), float(sizes[rows].max(initial=0.0))
        gaps[contact] = max(gaps[contact], largest) if contact in gaps else largest
    return gaps


def velocity_error(
    rate: Array, program: core.Program, t: float, contact_of: Mapping[str, str]
) -> InconsistentConstraintsError:
    """Return the error of constraint rates that no velocity satisfies.

    Args:
        rate: rates of all rows, (m,).
        program: the core's program.
        t: time [s].
        contact_of: contact of each point of a pair of shapes.
    """
    slices = row_slices(program)
    worst = max(slices, key=lambda name: _largest(rate[slices[name]]))
    return InconsistentConstraintsError(
        f'no velocity satisfies the constraints at t = {t:.2f} s: "{contact_of.get(worst, worst)}" '
        f"violates its rate by "
        f"{_largest(rate):.1e}",
        time=t,
    )


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
