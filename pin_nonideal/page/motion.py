"""How the replay moves: a run sampled at even frames, as placements of all joints, and where to look from."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.states.placements import joint_placements
from pin_nonideal.types import Array

from .geometry import Visual

if TYPE_CHECKING:
    from pin_nonideal.trajectory import Trajectory


# More frames than this make a page that no browser opens: an hour at 50 frames a second.
MAX_FRAMES = 200_000
# The bounding box of the motion is taken over so many frames.
BOX_FRAMES = 40


@dataclass(frozen=True)
class Motion:
    """A run at the frames of the replay.

    Attributes:
        times: time of each frame [s], (n,), from the first to the last sample of the run.
        poses: placement of each joint in the world as x, y, z, qx, qy, qz, qw, (n, njoints, 7); joint 0 is
            the world itself.
        before: sample of the run before each frame, (n,).
        part: how far the frame lies between that sample and the next, 0 to 1, (n,).
    """

    times: Array
    poses: Array
    before: NDArray[np.int64]
    part: Array

    def of(self, values: Array) -> Array:
        """Samples of the run at the frames, by linear interpolation; (nt, ...) gives (n, ...)."""
        part = self.part.reshape(-1, *[1] * (values.ndim - 1))
        after = np.minimum(self.before + 1, len(values) - 1)
        return np.asarray((1.0 - part) * values[self.before] + part * values[after])

    def rotation(self, joint: int) -> Array:
        """Orientation of a joint in the world at each frame, (n, 3, 3)."""
        x, y, z, w = self.poses[:, joint, 3:].T
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return np.moveaxis(np.array(rows), -1, 0)

    def point(self, joint: int, local: Array) -> Array:
        """World position of a point fixed to a joint at each frame [m], (n, 3)."""
        return np.asarray(self.poses[:, joint, :3] + self.rotation(joint) @ np.asarray(local))


def sample(run: Trajectory, fps: float) -> Motion:
    """The run at `fps` frames a second.

    Raises:
        InputError: the run has no sample or is not finite, or it needs more than `MAX_FRAMES` frames.
    """
    model, t = run.scene.model, np.asarray(run.t, dtype=np.float64)
    if len(t) == 0:
        raise InputError("a replay needs a run with at least one sample; this one has none")
    if not (np.isfinite(run.q).all() and np.isfinite(run.v).all()):
        raise InputError("a replay needs finite q and v; this run holds NaN or infinity")
    duration = float(t[-1] - t[0])
    if duration * fps > MAX_FRAMES:
        raise InputError(
            f"fps * duration must be at most {MAX_FRAMES} frames; got {fps:g} * {duration:g} s: lower fps"
        )
    count = int(np.ceil(duration * fps - 1e-9)) + 1
    times = t[0] + np.minimum(np.arange(count) / fps, duration)
    before = np.clip(np.searchsorted(t, times, side="right") - 1, 0, max(len(t) - 2, 0))
    length = t[np.minimum(before + 1, len(t) - 1)] - t[before]
    part = np.divide(times - t[before], length, out=np.zeros(count), where=length > 0.0)

    poses = np.empty((count, model.njoints, 7))
    for frame in range(count):
        q = _configuration(model, run, int(before[frame]), float(part[frame]))
        poses[frame] = [pin.SE3ToXYZQUAT(placement) for placement in joint_placements(model, q)]
    # q and -q are one rotation: neighbors in time take the nearer sign, so that they can be blended.
    turned = np.sum(poses[1:, :, 3:] * poses[:-1, :, 3:], axis=2) < 0.0
    poses[1:, :, 3:] *= np.cumprod(np.where(turned, -1.0, 1.0), axis=0)[:, :, None]
    return Motion(times, poses, before, part)


def _configuration(model: pin.Model, run: Trajectory, k: int, s: float) -> Array:
    """Configuration at the part s between samples k and k + 1: the cubic with their q and v at its ends.

    The cubic runs in the tangent space at sample k, where the rate at k + 1 is d difference/d q_1 times v.
    """
    if s == 0.0 or len(run.t) == 1:
        return np.asarray(run.q[k])
    q0, q1, v0, v1 = run.q[k], run.q[k + 1], run.v[k], run.v[k + 1]
    if s == 1.0:
        return np.asarray(q1)
    h = run.t[k + 1] - run.t[k]
    step = pin.difference(model, q0, q1)
    for joint in model.joints:
        if joint.nq == 2 and joint.nv == 1:  # a continuous joint may turn more than once in a long step
            i = joint.idx_v
            step[i] += 2.0 * np.pi * np.round((h * (v0[i] + v1[i]) / 2.0 - step[i]) / (2.0 * np.pi))
    end_rate = pin.dDifference(model, q0, q1, pin.ARG1) @ v1
    xi = h * s * (1.0 - s) ** 2 * v0 + s * s * (3.0 - 2.0 * s) * step - h * s * s * (1.0 - s) * end_rate
    return np.asarray(pin.integrate(model, q0, xi))


@dataclass(frozen=True)
class View:
    """Where to look from.

    Attributes:
        up: direction against gravity, (3,).
        direction: from the target to the camera, unit, (3,).
        start: outermost points of what is drawn at the start [m], (k, 3).
        motion: the same over the whole run.
        size: diagonal of the model at the start [m].
        ground: height of the ground along `up` [m].
        follow: whether the model travels so far that the camera should go with it.
    """

    up: Array
    direction: Array
    start: Array
    motion: Array
    size: float
    ground: float
    follow: bool


def view(model: pin.Model, motion: Motion, visuals: list[Visual], marks: list[tuple[int, Array]]) -> View:
    """The view that shows the whole motion.

    Args:
        model: the model, for its gravity.
        motion: its motion.
        visuals: what is drawn.
        marks: further points, as joint index and position in its frame [m].
    """
    gravity = np.asarray(model.gravity.linear)
    up = np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(gravity) > 0.0:
        up = -gravity / np.linalg.norm(gravity)

    chosen = np.unique(np.linspace(0, len(motion.times) - 1, BOX_FRAMES).astype(int))
    coarse = Motion(motion.times[chosen], motion.poses[chosen], motion.before[chosen], motion.part[chosen])
    clouds = [coarse.point(joint, np.zeros(3)) for joint in range(1, model.njoints)]
    clouds += [coarse.point(joint, local) for joint, local in marks]
    moving = [visual for visual in visuals if visual.joint > 0]
    clouds += [cloud for visual in moving for cloud in _corners(coarse, visual)]
    reach = 1.5 * _diagonal(np.array(clouds)) if clouds else 0.0
    for visual in visuals:
        # A large floor would make all that moves on it small.
        if visual.joint == 0 and np.linalg.norm(visual.shape.half_extent()[1]) < reach:
            clouds += _corners(coarse, visual)
    points = np.array(clouds) if clouds else np.zeros((1, len(chosen), 3))
    size = _diagonal(points[:, 0])
    heights = points @ up
    lowest = float(heights[:, 0].min())
    ground = 0.0 if -0.02 * size <= lowest <= size else float(heights.min()) - 0.03 * size
    return View(
        up=up,
        direction=_direction(points, up),
        start=_outermost(points[:, 0]),
        motion=_outermost(points),
        size=size,
        ground=ground,
        follow=_diagonal(points) > 4.0 * size,
    )


def _corners(motion: Motion, visual: Visual) -> list[Array]:
    """Corners of the box around a visual at each frame [m], (n, 3) each; none of a plane."""
    center, half = visual.shape.half_extent()
    if not half.any():
        return []
    signs = product((-1.0, 1.0), repeat=3)
    return [motion.point(visual.joint, visual.placement.act(center + half * np.array(s))) for s in signs]


def _diagonal(points: Array) -> float:
    """Diagonal of the box around a cloud [m], at least a millimeter."""
    return max(float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0))), 1e-3)


def _outermost(points: Array) -> Array:
    """The points of a cloud that reach farthest in each of 98 directions [m], (k, 3)."""
    cloud = points.reshape(-1, 3)
    grid = np.array(list(product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=3)))
    shell = grid[np.abs(grid).max(axis=1) == 1.0]
    reach = cloud @ (shell / np.linalg.norm(shell, axis=1, keepdims=True)).T
    return np.asarray(cloud[np.unique(np.argmax(reach, axis=0))])


def _direction(points: Array, up: Array) -> Array:
    """Direction to the camera: across a motion that is nearly planar, else from the front and the right."""
    centered = points.reshape(-1, 3) - points.reshape(-1, 3).mean(axis=0)
    _, spread, axes = np.linalg.svd(centered[:: max(1, len(centered) // 5000)], full_matrices=False)
    front = np.array([0.75, -1.0, 0.5]) if abs(up[2]) > 0.9 else np.array([0.5, 0.3, 1.0])
    if len(spread) == 3 and spread[2] < 0.15 * spread[1] and spread[1] > 0.05 * spread[0]:
        normal = axes[2]
        if abs(normal @ up) > 0.9:  # a plane seen from above
            front = up + 0.6 * np.cross(up, np.cross([0.0, -1.0, 0.0], up))
        else:
            right = np.cross(up, normal)  # to the right on the screen when looking against the normal
            front = normal * (1.0 if right.sum() > 0.0 else -1.0)
            front = front + 0.25 * up + 0.25 * np.cross(up, front)
    return np.asarray(front / np.linalg.norm(front))
