"""Loops with rounded frames: detection of rows that depend on others within the assembly tolerance.

CAD exports round frames to about 1e-8 m. A loop that closes in theory then has a gap that no motion can
close, and dependent rows become slightly independent. Such rounding would determine rank and reactions.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import Constraint, FrameAnchor, JointCoupling, PointAnchor
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.loop_closure import CLOSURE_TOLERANCE
from pin_nonideal.states.projection import closure_nearby
from pin_nonideal.states.rows import rows_at
from pin_nonideal.types import Array, Model

# Rounding error of rows of A, and of singular values of its rows at unit length. Values between this bound
# and the assembly tolerance result from rounded frames.
ROUNDING = 1e-11
MAX_ROWS = 200  # for the rank decision on a dense matrix
MAX_PROBES = 3  # closed configurations at which the rank is computed, since a single one can be singular
# larger singular values need no note; values between the tolerance and this bound indicate links of nearly
# equal length
MAX_NOTED = 1e-4
PROBE_RANGE = 0.2  # range of the probes [m or rad]


class IndependentRows(NamedTuple):
    """Constraints of a scene without the rows that depend on others within the assembly tolerance.

    Attributes:
        model: model of the scene, with frames for the points of welds that lose rows.
        constraints: remaining constraints.
        q: configuration with the smallest gaps, (nq,).
        note: note on the removed rows.
    """

    model: Model
    constraints: list[Constraint]
    q: Array
    note: str


# Point anchors that replace a weld, so that each row can be removed separately. With the origin O, and the
# points X and Y at unit length on the axes x and y, O fixes the position, X along y and z fixes the rotations
# about z and y, and Y along z fixes the rotation about x.
_Points = tuple[PointAnchor, ...]


def remove_dependent_rows(compiled: CompiledScene, tolerance: float) -> IndependentRows | None:
    """Return the constraints of a scene with rounded loops, or None if no row depends on rounding.

    Args:
        compiled: compiled scene of the file.
        tolerance: accuracy of lengths and angles of the loops [m or rad].
    """
    model, q0, constraints = compiled.model, compiled.q0, list(compiled.spec.constraints)
    program = compiled.program
    holonomic = all(holds for c in program.constraints for holds in c.holonomic)
    looped = [isinstance(c, (PointAnchor, JointCoupling, FrameAnchor)) for c in constraints]
    if sum(looped) < 2 or not holonomic or len(program.constraints) != len(looped) or program.rows > MAX_ROWS:
        return None
    independent, q, gap, nearly = _independent_rows(compiled, tolerance)
    if independent is None:
        return IndependentRows(model, constraints, q0, nearly) if nearly else None
    model, welds = _split_welds(model, constraints, [c.name for c in program.constraints])
    if welds:
        split = [part for c in constraints for part in (welds.get(id(c), (c,)))]
        divided = compiled_scene(Scene(model, constraints=split, q0=q0, assembly_tolerance=tolerance))
        program = divided.program
        independent, q, gap, nearly = _independent_rows(divided, tolerance)
        if independent is None:
            return IndependentRows(model, constraints, q0, nearly) if nearly else None
    left, removed_rows = _remaining_constraints(constraints, welds, program, independent)
    if not removed_rows:
        return None
    note = (
        f"loops close to {gap:.1e} m or rad, within the tolerance of the assembly ({tolerance:g}): rows "
        f"{', '.join(removed_rows)} depend on others and are left out"
    )
    return IndependentRows(model, left, q, "; ".join(filter(None, (note, nearly))))


def _split_welds(
    model: Model, constraints: list[Constraint], names: list[str]
) -> tuple[Model, dict[int, _Points]]:
    """Return the model with frames for the points of all two-frame welds, and the points by the weld's id."""
    welds: dict[int, _Points] = {}
    model = model.copy()
    for c, name in zip(constraints, names, strict=True):
        if not isinstance(c, FrameAnchor) or c.frame2 is None:
            continue
        points = [PointAnchor(c.frame1, c.frame2, name=name)]
        for axis, rows in (("x", "yz"), ("y", "z")):
            offset = pin.SE3(np.eye(3), np.eye(3)["xyz".index(axis)])
            ends = [f"{side} of {name}, {axis}" for side in (c.frame1, c.frame2)]
            for side, end in zip((c.frame1, c.frame2), ends, strict=True):
                frame = model.frames[model.getFrameId(side)]
                place = frame.placement * offset
                model.addFrame(pin.Frame(end, frame.parentJoint, place, pin.FrameType.OP_FRAME), False)
            points.append(PointAnchor(ends[0], ends[1], axes=rows, name=f"{name}, {axis}"))
        welds[id(c)] = tuple(points)
    return model, welds


def _remaining_constraints(
    constraints: list[Constraint],
    welds: dict[int, _Points],
    program: core.Program,
    independent: NDArray[np.bool_],
) -> tuple[list[Constraint], list[str]]:
    """Return the remaining constraints, and descriptions of removed rows; complete welds stay welds."""
    left: list[Constraint] = []
    removed_rows: list[str] = []
    described = iter(program.constraints)
    first = 0
    for c in constraints:
        parts = welds.get(id(c), (c,))
        remaining = []
        for part in parts:
            rows = next(described)
            of_part = independent[first : first + rows.count]
            first += rows.count
            stays = part if of_part.all() else _select_rows(part, of_part)
            if stays is not None:
                remaining.append(stays)
            if stays is not part:
                removed_rows.append(f"{rows.name}[{', '.join(map(str, np.flatnonzero(~of_part)))}]")
        left += [c] if remaining == list(parts) else remaining
    return left, removed_rows


def _select_rows(c: Constraint, independent: NDArray[np.bool_]) -> Constraint | None:
    """Return a constraint with some of its rows, or None without rows; unchanged if it cannot be divided."""
    if not independent.any():
        return None
    if isinstance(c, PointAnchor):
        return replace(
            c, axes="".join(axis for axis, stays in zip(c.axes, independent, strict=True) if stays)
        )
    return c


def _independent_rows(
    compiled: CompiledScene, tolerance: float
) -> tuple[NDArray[np.bool_] | None, Array, float, str]:
    """Return the mask of independent rows, the configuration with the smallest gaps, the gap, and a note.

    The note reports rows that depend on others nearly, but not within the tolerance, if the loops close. The
    mask is None if the loops do not close, or if no row depends on others because of rounded frames.
    """
    model, program, runner = compiled.model, compiled.program, compiled.program.runner()
    q, gap = closure_nearby(model, program, runner, compiled.q0, tolerance)
    if gap > tolerance:
        return None, q, gap, ""
    generator = np.random.default_rng(5)
    independent, rank, rounded, smallest = _independent(model, runner, q, tolerance)
    nearest = [smallest]
    for _ in range(MAX_PROBES):
        free = _null_space(model, runner, q, tolerance)
        if not free.shape[1]:
            break
        step = free @ generator.uniform(-PROBE_RANGE, PROBE_RANGE, free.shape[1])
        moved = pin.integrate(model, q, step)
        probe, distance = closure_nearby(model, program, runner, moved, tolerance, is_nearest=False)
        if distance <= tolerance:
            at_probe = _independent(model, runner, probe, tolerance)
            rounded = rounded or at_probe[2]
            nearest.append(at_probe[3])
            if at_probe[1] > rank:
                independent, rank = at_probe[:2]
    nearly, distance = "", max(nearest)
    if distance <= MAX_NOTED:
        nearly = (
            f"rows of the loops depend on others to {distance:.1e} m or rad, beyond the tolerance of the "
            f"assembly ({tolerance:g}): they may lock intended motion; "
            f"load(..., assembly_tolerance={MAX_NOTED:g}) leaves such rows out"
        )
    return (independent if rounded or gap > CLOSURE_TOLERANCE else None), q, gap, nearly


def _unit_rows(model: Model, runner: core.Runner, q: Array, tolerance: float) -> tuple[Array, bool]:
    """Return A(q) with rows of unit length, and whether the length of a row is due to rounding.

    Rows that are shorter than the tolerance relative to the longest one are set to zero. Such short rows have
    no effect, and their direction outside the plane of a planar linkage is arbitrary.
    """
    A = rows_at(runner, q, np.zeros(model.nv), 0.0)[0]
    length = np.linalg.norm(A, axis=1)
    longest = length.max(initial=0.0)
    short = length <= tolerance * longest
    A = np.where(short[:, None], 0.0, A / np.where(short, 1.0, length)[:, None])
    return np.asarray(A), bool((short & (length > ROUNDING * longest)).any())


def _independent(
    model: Model, runner: core.Runner, q: Array, tolerance: float
) -> tuple[NDArray[np.bool_], int, bool, float]:
    """Return a mask of independent rows, their number, whether rounding adds rows, and a singular value.

    Rows are chosen by the largest remainder. The singular value is the smallest one above the tolerance.
    """
    rest, rounded = _unit_rows(model, runner, q, tolerance)
    values = np.linalg.svd(rest, compute_uv=False) if rest.size else np.zeros(0)
    rounded = rounded or bool(((values > ROUNDING) & (values <= tolerance)).any())
    smallest = float(values[values > tolerance].min(initial=np.inf))
    independent = np.zeros(len(rest), dtype=bool)
    while True:
        length = np.linalg.norm(rest, axis=1)
        best = int(np.argmax(length)) if len(rest) else 0
        if not len(rest) or length[best] <= tolerance:
            return independent, int(independent.sum()), rounded, smallest
        independent[best] = True
        direction = rest[best] / length[best]
        rest = rest - np.outer(rest @ direction, direction)
        rest[independent] = 0.0


def _null_space(model: Model, runner: core.Runner, q: Array, tolerance: float) -> Array:
    """Return a basis of the motions that the rows leave free, (nv, freedoms)."""
    _, values, directions = np.linalg.svd(_unit_rows(model, runner, q, tolerance)[0])
    return np.asarray(directions[int((values > tolerance).sum()) :].T)
