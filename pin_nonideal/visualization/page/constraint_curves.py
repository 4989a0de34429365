"""Curves and surfaces of user constraints, traced from the constraint rows near the path of a point.

A constraint on the position of one point, A = N J with the Jacobian J of the point, is a curve or a surface
in space. Tangents are in the null space of N, and Newton's method on the residual corrects each step. A
constraint on velocities, which has no residual, is shown as the disk of allowed directions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from pin_nonideal.description.constraints import UserConstraint
from pin_nonideal.errors import PinNonidealError
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.kinematics import joint_placements
from pin_nonideal.states.rows import holonomic_rows, rows_at
from pin_nonideal.types import Array

from .frames import Motion

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Steps of a curve over the extent of the path, maximum extents in each direction, and steps across a surface.
CURVE_STEPS, MAX_EXTENTS, SURFACE_STEPS = 60, 16, 6
# Tolerance of A = N J, relative to A.
POINT_TOLERANCE = 1e-6
# Step of difference quotients of placements; their error is near 1e-9.
DIFFERENCE_STEP = 1e-6
# Maximum number of degrees of freedom for which points are searched.
MAX_DOFS = 30


@dataclass(frozen=True)
class Guide:
    """Curve, surface or disk to which a constraint restricts a point.

    Attributes:
        name: name of the constraint.
        kind: "curve", "surface" (a grid of points, row by row), or "disk" (of allowed directions).
        joint: index of the joint that carries the point.
        point: position of the point in the frame of that joint [m], (3,).
        points: points of the curve or surface in the world at the first frame [m], (k, 3); empty for a disk.
        columns: points in a row of the grid; 2 for a curve in a plane, which is drawn as a band across it,
            else 1.
        closed: whether the curve is closed.
        shift: translation over time [m], (n, 3), or None if there is none.
        normals: unit normal of the disk at each frame, (n, 3), or None.
        size: radius of the disk, or extent of the path [m].
    """

    name: str
    kind: str
    joint: int
    point: Array
    points: Array
    columns: int = 1
    closed: bool = False
    shift: Array | None = None
    normals: Array | None = None
    size: float = 1.0


def guides_of(run: Trajectory, motion: Motion) -> list[Guide]:
    """Return a guide for each user constraint that restricts one point."""
    scene, guides = run.scene, []
    items = [(name, c) for name, c in zip(scene.constraint_slices, scene.constraints, strict=False)]
    if scene.model.nv > MAX_DOFS:
        return []
    for name, item in items:
        if isinstance(item, UserConstraint):
            try:
                guide = _Tracer(run, motion, name).guide()
            except (PinNonidealError, RuntimeError, np.linalg.LinAlgError):
                guide = None  # a function that fails for states beside the path
            guides += [guide] if guide is not None else []
    return guides


class _Tracer:
    """Rows of one constraint and the point on which they act."""

    def __init__(self, run: Trajectory, motion: Motion, name: str) -> None:
        self.run, self.motion, self.name = run, motion, name
        self.model = run.scene.model
        program = compiled_scene(run.scene).program
        self.runner, self.rows = program.runner(), run.scene.constraint_slices[name]
        self.holonomic = bool(holonomic_rows(program)[self.rows].all())
        self.joint, self.local = 0, np.zeros(3)

    def at(self, q: Array, t: float, v: Array | None = None) -> tuple[Array, Array]:
        """Return rows and residual."""
        A, _, phi, _ = rows_at(self.runner, q, np.zeros(self.model.nv) if v is None else v, t)
        return A[self.rows], phi[self.rows]

    def place(self, q: Array) -> Array:
        return np.asarray(joint_placements(self.model, q)[self.joint].act(self.local))

    def jacobian(self, q: Array) -> Array:
        nudges = DIFFERENCE_STEP * np.eye(self.model.nv)
        ends = [
            self.place(pin.integrate(self.model, q, d)) - self.place(pin.integrate(self.model, q, -d))
            for d in nudges
        ]
        return np.asarray(np.array(ends).T / (2.0 * DIFFERENCE_STEP))

    def normals(self, q: Array, t: float, v: Array | None = None) -> tuple[Array, Array] | None:
        """Return N with A = N J, and J, or None if the rows act on more than the position of the point."""
        A, _ = self.at(q, t, v)
        J = self.jacobian(q)
        N = A @ np.linalg.pinv(J, rcond=1e-8)
        off = np.abs(A - N @ J).max(initial=0.0)
        return (N, J) if off <= POINT_TOLERANCE * np.abs(A).max(initial=1e-300) else None

    def guide(self) -> Guide | None:
        q, t = np.asarray(self.run.q[0]), float(self.run.t[0])
        A, _ = self.at(self.run.q[len(self.run.t) // 2], t, self.run.v[len(self.run.t) // 2])
        joints = [
            j
            for j in range(1, self.model.njoints)
            if np.abs(A[:, _dofs(self.model, j)]).max(initial=0.0) > 0.0
        ]
        if not joints:
            return None
        self.joint, self.local = joints[-1], np.asarray(self.model.inertias[joints[-1]].lever)
        normals = self.normals(q, t, self.run.v[0])
        if normals is None:
            return None
        N, J = normals
        space, rank = np.linalg.matrix_rank(J, tol=1e-6), np.linalg.matrix_rank(N, tol=1e-9)
        path = self.motion.point(self.joint, self.local)
        extent = float(np.linalg.norm(np.ptp(path, axis=0))) or self.motion.size
        if not self.holonomic:
            return self.disk(extent) if (space, rank) == (3, 1) else None
        shift = self.shift(q, N)
        blank = Guide(self.name, "curve", self.joint, self.local, np.zeros((0, 3)), shift=shift, size=extent)
        if space - rank == 1:
            points, closed = self.curve(q, t, path, extent)
            if space == 2:
                across = np.linalg.svd(J.T)[2][2] * 0.15 * extent
                band = np.stack([points - across, points + across], axis=1).reshape(-1, 3)
                return replace(blank, points=band, columns=2, closed=closed)
            return replace(blank, points=points, closed=closed)
        if space - rank == 2:
            return replace(blank, kind="surface", points=self.surface(extent), columns=2 * SURFACE_STEPS + 1)
        return None

    def disk(self, extent: float) -> Guide | None:
        """Return the disk of directions that a constraint on velocities allows along the run."""
        chosen = np.unique(np.linspace(0, len(self.motion.times) - 1, 200).astype(int))
        normals = []
        for frame in chosen:
            k = int(self.motion.before[frame])
            factors = self.normals(self.run.q[k], float(self.run.t[k]), self.run.v[k])
            if factors is None:
                return None
            normals.append(factors[0][0] / (np.linalg.norm(factors[0][0]) or 1.0))
        filled = np.array(
            [np.interp(np.arange(len(self.motion.times)), chosen, x) for x in np.array(normals).T]
        ).T
        return Guide(
            self.name, "disk", self.joint, self.local, np.zeros((0, 3)), normals=filled, size=0.12 * extent
        )

    def shift(self, q: Array, N: Array) -> Array | None:
        """Return the displacement of the constraint surface along its normals at each frame, or None."""
        back = -np.linalg.pinv(N)
        first = self.at(q, float(self.motion.times[0]))[1]
        moved = np.array([back @ (self.at(q, float(t))[1] - first) for t in self.motion.times])
        return moved if np.abs(moved).max(initial=0.0) > 1e-9 * self.motion.size else None

    def step(self, q: Array, t: float, along: Array) -> Array:
        """Return a configuration after a tangent step of the point, projected onto the constraint."""
        q = pin.integrate(self.model, q, np.linalg.pinv(self.jacobian(q), rcond=1e-8) @ along)
        for _ in range(3):
            A, phi = self.at(q, t)
            q = pin.integrate(self.model, q, -np.linalg.pinv(A) @ phi)
        return np.asarray(q)

    def tangents(self, q: Array, t: float) -> Array:
        """Return unit vectors of the allowed velocities of the point, (k, 3)."""
        factors = self.normals(q, t)
        if factors is None:
            return np.zeros((0, 3))
        N, J = factors
        _, spread, axes = np.linalg.svd(
            np.vstack([N / (np.abs(N).max() or 1.0), np.eye(3) - J @ np.linalg.pinv(J, rcond=1e-8)])
        )
        return np.asarray(axes[spread < 1e-6]) if len(spread) == 3 else np.zeros((0, 3))

    def walk(self, q: Array, t: float, heading: Array, length: float, count: int) -> list[Array]:
        """Return the configurations of straight steps along a tangent, up to the closure of the curve."""
        start, steps = self.place(q), []
        for number in range(count):
            tangents = self.tangents(q, t)
            if not len(tangents):
                break
            ahead = tangents.T @ (tangents @ heading)
            heading = ahead / (np.linalg.norm(ahead) or 1.0)
            q = self.step(q, t, length * heading)
            steps.append(q)
            if number > 8 and np.linalg.norm(self.place(q) - start) < 0.8 * length:
                break
        return steps

    def curve(self, q: Array, t: float, path: Array, extent: float) -> tuple[Array, bool]:
        """Return the points of a closed curve, or of the part of an open curve near the path."""
        length, (first,) = extent / CURVE_STEPS, self.tangents(q, t)[:1]
        ahead = [self.place(x) for x in self.walk(q, t, first, length, CURVE_STEPS * MAX_EXTENTS)]
        start = self.place(q)
        if (
            ahead
            and len(ahead) < CURVE_STEPS * MAX_EXTENTS
            and np.linalg.norm(ahead[-1] - start) < 0.8 * length
        ):
            return np.array([start, *ahead[:-1], start]), True
        back = [self.place(x) for x in self.walk(q, t, -first, length, 2 * CURVE_STEPS)]
        points = np.array([*reversed(back), start, *ahead])
        thin = path[:: max(1, len(path) // 300)]
        near = np.linalg.norm(points[:, None] - thin[None], axis=2).min(axis=1) < 0.35 * extent
        near_path = np.flatnonzero(near)
        return points[near_path.min() : near_path.max() + 1], False

    def surface(self, extent: float) -> Array:
        """Return the points of a strip of the surface along the path, in rows across it."""
        rows, length = [], 0.25 * extent / SURFACE_STEPS
        path = self.motion.q
        chosen = np.unique(np.linspace(0, len(path) - 1, CURVE_STEPS).astype(int))
        t, across = float(self.run.t[0]), np.zeros(3)
        for k in chosen:
            q = self.step(np.asarray(path[k]), t, np.zeros(3))
            tangents = self.tangents(q, t)
            if len(tangents) < 2:
                continue
            N, _ = self.normals(q, t) or (np.zeros((1, 3)), None)
            ahead = self.place(path[min(k + 1, len(path) - 1)]) - self.place(path[max(k - 1, 0)])
            side = np.cross(N[0], ahead)
            side = side / np.linalg.norm(side) if np.linalg.norm(side) > 0.0 else tangents[0]
            across = side if side @ across >= 0.0 else -side
            left = [self.place(x) for x in self.walk(q, t, across, length, SURFACE_STEPS)]
            right = [self.place(x) for x in self.walk(q, t, -across, length, SURFACE_STEPS)]
            if len(left) == len(right) == SURFACE_STEPS:
                rows += [*reversed(right), self.place(q), *left]
        return np.array(rows).reshape(-1, 3)


def _dofs(model: pin.Model, joint: int) -> slice:
    if not joint:
        return slice(0, 0)
    return slice(model.joints[joint].idx_v, model.joints[joint].idx_v + model.joints[joint].nv)
