"""Loops whose frames were rounded: which rows depend on others within the tolerance of the assembly.

Exports of CAD round frames to 1e-8 m or so.  A loop that closes in theory then has a gap that no motion can
close, and rows that depend on others gain a tiny part of their own, which would decide rank and reactions.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.constraints import FrameAnchor, JointCoupling, PointAnchor
from pin_nonideal.core import core
from pin_nonideal.scene import Scene, program_of
from pin_nonideal.states.closure import CLOSURE_TOLERANCE
from pin_nonideal.states.projection import nearest_closure
from pin_nonideal.states.rows import rows_at
from pin_nonideal.types import Array, Model

# Singular values of A, its rows at unit length, that are zero to rounding; those between this and the
# assembly's tolerance are rounded frames.
ROUNDING = 1e-11
MOST_ROWS = 200  # whose rank is decided on a dense matrix
PROBES = 3  # closed configurations at which the rank is looked at: one may be singular
REACH = 0.2  # of the probes [m or rad]


class Relaxed(NamedTuple):
    """Constraints of a scene without the rows that depend on others to the tolerance of the assembly.

    Attributes:
        constraints: what remains of them.
        q: configuration with the smallest gaps, (nq,).
        note: what was left out.
    """

    constraints: list[Any]
    q: Array
    note: str


def relaxed(scene: Scene, tolerance: float) -> Relaxed | None:
    """The constraints of a scene whose loops were rounded; None where rounding plays no part.

    Args:
        scene: as the file states it.
        tolerance: to which lengths and angles of the loops are given [m or rad].
    """
    program = program_of(scene)
    names = [c.name for c in program.constraints]
    anchored = [isinstance(c, (PointAnchor, JointCoupling, FrameAnchor)) for c in scene.constraints]
    holonomic = all(holds for c in program.constraints for holds in c.holonomic)
    if (
        sum(anchored) < 2
        or not holonomic
        or len(program.constraints) != len(anchored)
        or program.rows > MOST_ROWS
    ):
        return None
    kept, q, gap = _independent_rows(scene, program, tolerance)
    if kept is None:
        return None
    left, gone, first = [], [], 0
    for name, c, rows in zip(names, scene.constraints, program.constraints, strict=True):
        mine = kept[first : first + rows.count]
        first += rows.count
        remaining = c if mine.all() else _part(c, mine)
        if remaining is not None:
            left.append(remaining)
        if not mine.all() and remaining is not c:
            gone.append(f"{name}[{', '.join(map(str, np.flatnonzero(~mine)))}]")
    if not gone:
        return None
    note = (
        f"loops close to {gap:.1e} m or rad, within the tolerance of the assembly ({tolerance:g}): rows "
        f"{', '.join(gone)} depend on others and are left out"
    )
    return Relaxed(left, q, note)


def _part(c: Any, kept: NDArray[np.bool_]) -> Any:
    """A constraint with some of its rows, None with none; whole where a part of it has no description."""
    if not kept.any():
        return None
    if isinstance(c, PointAnchor):
        return replace(c, axes="".join(axis for axis, stays in zip(c.axes, kept, strict=True) if stays))
    if isinstance(c, FrameAnchor) and not kept[3:].any():
        axes = "".join(axis for axis, stays in zip("xyz", kept[:3], strict=True) if stays)
        return PointAnchor(c.frame1, c.frame2, axes=axes, name=c.name)
    return c


def _independent_rows(
    scene: Scene, program: core.Program, tolerance: float
) -> tuple[NDArray[np.bool_] | None, Array, float]:
    """Which rows are independent, the configuration with the smallest gaps, and the largest gap there.

    There are none to name where the loops close and no row depends on others by rounded frames alone.
    """
    model, runner = scene.model, program.runner()
    q, gap = nearest_closure(model, program, runner, scene.q0, tolerance)
    if gap > tolerance:
        return None, q, gap
    generator = np.random.default_rng(5)
    independent, rank, rounded = _independent(model, runner, q, tolerance)
    for _ in range(PROBES):
        free = _null_space(model, runner, q, tolerance)
        if not free.shape[1]:
            break
        step = free @ generator.uniform(-REACH, REACH, free.shape[1])
        probe, apart = nearest_closure(model, program, runner, pin.integrate(model, q, step), tolerance)
        if apart <= tolerance:
            found = _independent(model, runner, probe, tolerance)
            rounded = rounded or found[2]
            if found[1] > rank:
                independent, rank = found[:2]
    return (independent if rounded or gap > CLOSURE_TOLERANCE else None), q, gap


def _unit_rows(model: Model, runner: core.Runner, q: Array) -> Array:
    """A at q with rows of unit length, but for those that vanish beside the longest."""
    A = rows_at(runner, q, np.zeros(model.nv), 0.0)[0]
    length = np.linalg.norm(A, axis=1)
    return np.asarray(A / np.maximum(length, ROUNDING * length.max(initial=1.0))[:, None])


def _independent(
    model: Model, runner: core.Runner, q: Array, tolerance: float
) -> tuple[NDArray[np.bool_], int, bool]:
    """Which rows are independent, longest remainders first; how many; and whether rounding counts more."""
    rest = _unit_rows(model, runner, q)
    values = np.linalg.svd(rest, compute_uv=False) if rest.size else np.zeros(0)
    rounded = bool(((values > ROUNDING) & (values <= tolerance)).any())
    kept = np.zeros(len(rest), dtype=bool)
    while True:
        length = np.linalg.norm(rest, axis=1)
        best = int(np.argmax(length)) if len(rest) else 0
        if not len(rest) or length[best] <= tolerance:
            return kept, int(kept.sum()), rounded
        kept[best] = True
        direction = rest[best] / length[best]
        rest = rest - np.outer(rest @ direction, direction)
        rest[kept] = 0.0


def _null_space(model: Model, runner: core.Runner, q: Array, tolerance: float) -> Array:
    """Directions of motion that the rows leave free, (nv, freedoms)."""
    _, values, directions = np.linalg.svd(_unit_rows(model, runner, q))
    return np.asarray(directions[int((values > tolerance).sum()) :].T)
