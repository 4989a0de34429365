"""Motion of the replay: frames of a run, closer together in fast motion, as placements of all joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.types import Array

from .between_samples import Cubics
from .joint_tracks import Tracks, halfway, rotate_vectors

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


# Maximum number of frames that a browser can open: an hour at 50 frames per second.
MAX_FRAMES = 200_000
# Minimum number of frames, also for slow motions, and maximum number of values in all frames.
MIN_FRAMES, MAX_NUMBERS = 600, 400_000
# Interpolation tolerance between frames, relative to the smallest link.
POSITION_TOLERANCE = 2e-3
# Tolerance between the end rates and the displacement of an interval [rad, or relative to the size]. If the
# difference or the projection onto the loops exceeds it, the sampling is too coarse to show the motion.
MAX_MISMATCH = 0.3
# Width of tables from which columns of zeros, such as those of open contacts, are not interpolated.
MIN_WIDTH = 100
# Rounds of bisection: up to 2^12 frames between two samples.
MAX_BISECTIONS = 12


@dataclass(frozen=True)
class Motion:
    """Run at the frames of the replay.

    Attributes:
        times: time of each frame [s], (n,), from the first to the last sample of the run.
        poses: placement of each joint in the world as x, y, z, qx, qy, qz, qw, (n, njoints, 7); joint 0 is
            the world.
        before: index of the sample before each frame, (n,).
        part: relative position of the frame between that sample and the next, 0 to 1, (n,).
        q: configurations, (n, nq).
        coordinates: coordinates of all joints, (n, width), see `Tracks`.
        held: intervals that are sampled too coarsely, (n - 1,); the page shows their first frame.
        size: diagonal of the model at the start [m].
        cubics: cubics between the samples of the run.
    """

    times: Array
    poses: Array
    before: NDArray[np.int64]
    part: Array
    q: Array
    coordinates: Array
    held: NDArray[np.bool_]
    size: float = 1.0
    cubics: Cubics | None = None

    def of(self, values: Array) -> Array:
        """Return samples of the run at the frames, by linear interpolation; (nt, ...) gives (n, ...)."""
        if values.ndim == 2 and values.shape[1] > MIN_WIDTH and not (used := values.any(axis=0)).all():
            # Column-major order, in which columns of zeros take no memory.
            out = np.zeros((len(self.before), values.shape[1]), np.result_type(values, self.part), order="F")
            out[:, used] = self.of(values[:, used])
            return out
        at_frames = values[self.before].astype(np.result_type(values, self.part), copy=False)
        inner = np.flatnonzero(self.part)
        if len(inner):
            part = self.part[inner].reshape(-1, *[1] * (values.ndim - 1))
            after = np.minimum(self.before[inner] + 1, len(values) - 1)
            at_frames[inner] = (1.0 - part) * at_frames[inner] + part * values[after]
        return at_frames

    def only(self, chosen: NDArray[np.int64]) -> Motion:
        """Return the motion at some of the frames."""
        return Motion(
            times=self.times[chosen],
            poses=self.poses[chosen],
            before=self.before[chosen],
            part=self.part[chosen],
            q=self.q[chosen],
            coordinates=self.coordinates[chosen],
            held=np.zeros(max(len(chosen) - 1, 0), dtype=bool),
            size=self.size,
        )

    def rotation(self, joint: int) -> Array:
        """Return the orientation of a joint in the world at each frame, (n, 3, 3)."""
        columns = [
            rotate_vectors(self.poses[:, joint, 3:], np.tile(axis, (len(self.times), 1)))
            for axis in np.eye(3)
        ]
        return np.stack(columns, axis=-1)

    def point(self, joint: int, local: Array) -> Array:
        """Return the world position of a point on a joint at each frame [m], (n, 3)."""
        moved = np.broadcast_to(np.asarray(local, dtype=float), (len(self.times), 3))
        return np.asarray(self.poses[:, joint, :3] + rotate_vectors(self.poses[:, joint, 3:], moved))

    def along(self, joint: int, vectors: Array) -> Array:
        """Transform vectors from world axes to the axes of a joint, (n, 3)."""
        return rotate_vectors(
            self.poses[:, joint, 3:] * np.array([-1.0, -1.0, -1.0, 1.0]), np.asarray(vectors)
        )

    def local(self, joint: int, points: Array) -> Array:
        """Transform points from the world to the frame of a joint [m], (n, 3)."""
        return self.along(joint, np.asarray(points) - self.poses[:, joint, :3])


def sample(run: Trajectory, fps: float | None = None, share: int = 1) -> Motion:
    """Return the run at the frames of a replay.

    Args:
        run: run of the replay.
        fps: frames per second; None for the samples of the run, and frames between them that keep the
            interpolation of the page within `POSITION_TOLERANCE` of the smallest link.
        share: number of runs that share a page.

    Raises:
        InputError: the run has no sample or is not finite, or it needs more than `MAX_FRAMES` frames.
    """
    t = np.asarray(run.t, dtype=np.float64)
    if len(t) == 0:
        raise InputError("a replay needs a run with at least one sample; this one has none")
    if not (np.isfinite(run.q).all() and np.isfinite(run.v).all()):
        raise InputError("a replay needs finite q and v; this run holds NaN or infinity")
    frames = _Frames(run, share)
    if fps is None:
        frames.choose()
    else:
        frames.even(fps)
    return frames.motion()


class _Frames:
    """Frames of a run during their selection: sample before, relative position, and coordinates."""

    def __init__(self, run: Trajectory, share: int) -> None:
        # Many ghosts have fewer frames each.
        self.min_frames = max(MIN_FRAMES // max(share // 4, 1), 60)
        self.max_frames = MAX_NUMBERS // share
        self.run, self.t, self.cubics = run, np.asarray(run.t, dtype=np.float64), Cubics(run)
        self.tracks = Tracks(run.scene.model)
        start = self.tracks.placements(self.tracks.coordinates(run.q[:1]))[0]
        self.size, self.link = _sizes(run.scene.model, start)
        if self.size == 0.0:  # a particle is as large as its path
            every = np.unique(np.linspace(0, len(self.t) - 1, MIN_FRAMES).astype(int))
            path = self.tracks.placements(self.tracks.coordinates(run.q[every]))[:, 1:, :3]
            self.size = self.link = float(np.linalg.norm(np.ptp(path.reshape(-1, 3), axis=0))) or 1.0
        self.reach = np.minimum(np.maximum(self.tracks.reaches(start), self.link), self.size)
        self.dense = getattr(run, "dense", None) is not None
        self.well_sampled = (
            np.ones(max(len(self.t) - 1, 0), dtype=bool)
            if self.dense
            else _resolved_intervals(run, self.size)
        )
        self.before, self.part = np.zeros(0, dtype=np.int64), np.zeros(0)
        self.q, self.rows = np.zeros((0, run.q.shape[1])), np.zeros((0, self.tracks.width))

    def times(self) -> Array:
        after = np.minimum(self.before + 1, len(self.t) - 1)
        return np.asarray(self.t[self.before] + self.part * (self.t[after] - self.t[self.before]))

    def even(self, fps: float) -> None:
        """Set a constant number of frames per second."""
        t, duration = self.t, float(self.t[-1] - self.t[0])
        if duration * fps > MAX_FRAMES:
            raise InputError(
                f"fps * duration must be at most {MAX_FRAMES} frames; got {fps:g} * {duration:g} s: lower fps"
            )
        count = int(np.ceil(duration * fps - 1e-9)) + 1
        times = t[0] + np.minimum(np.arange(count) / fps, duration)
        self.before = np.clip(np.searchsorted(t, times, side="right") - 1, 0, max(len(t) - 2, 0))
        length = t[np.minimum(self.before + 1, len(t) - 1)] - t[self.before]
        self.part = np.divide(times - t[self.before], length, out=np.zeros(count), where=length > 0.0)
        self.q = self._configurations(self.before, self.part)
        self.rows = self.tracks.steady(self.tracks.coordinates(self.q))

    def choose(self) -> None:
        """Set the samples, thinned if there are too many, and frames in between where the motion is fast."""
        max_frames = int(
            np.clip(self.max_frames // max(self.tracks.width, 1), 2 * self.min_frames, MAX_FRAMES // 10)
        )
        self.before = _base(self.run, self.size, max_frames)
        self.part = np.zeros(len(self.before))
        self.q = np.asarray(self.run.q[self.before])
        self.rows = self.tracks.steady(self.tracks.coordinates(self.q))
        longest = (self.t[-1] - self.t[0]) / self.min_frames
        open_ones = np.ones(max(len(self.before) - 1, 0), dtype=bool)
        for _ in range(MAX_BISECTIONS):
            room = max_frames - len(self.before)
            where = np.flatnonzero(open_ones & self._divisible())
            if room <= 0 or not len(where):
                return
            before, part = self._middle(where)
            q, times = self._configurations(before, part), self.times()
            blended = halfway(times, self.rows)[where]
            rows = self.tracks.near(self.tracks.coordinates(q), blended)
            gap = self.tracks.distance(rows, blended, self.reach)
            wrong = (gap > POSITION_TOLERANCE * self.link) | (np.diff(times)[where] > longest)
            new = np.flatnonzero(wrong)
            new = np.sort(new[np.argsort(-gap[new], kind="stable")[:room]])
            # Accurate intervals leave the search; both halves of divided intervals remain in it.
            open_ones[where[~wrong]] = False
            open_ones = np.insert(open_ones, where[new], True)
            at = where[new] + 1
            self.before, self.part = (
                np.insert(self.before, at, before[new]),
                np.insert(self.part, at, part[new]),
            )
            self.q = np.insert(self.q, at, q[new], axis=0)
            self.rows = self.tracks.steady(np.insert(self.rows, at, rows[new], axis=0))

    def _divisible(self) -> NDArray[np.bool_]:
        """Return the intervals with a positive length and sufficient sampling."""
        last = len(self.well_sampled) - 1
        is_adjacent = self.before[:-1] == np.where(self.part[1:] == 0.0, self.before[1:] - 1, self.before[1:])
        is_resolved = ~is_adjacent | (
            self.well_sampled[np.clip(self.before[:-1], 0, last)] if last >= 0 else False
        )
        return np.asarray((np.diff(self.times()) > 1e-12 * (1.0 + abs(self.t[-1]))) & is_resolved)

    def _middle(self, where: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array]:
        """Return the middle sample of each interval, or the middle between two samples."""
        k0, k1 = self.before[where], self.before[where + 1]
        s0, s1 = self.part[where], self.part[where + 1]
        inside = (k1 == k0) | ((k1 == k0 + 1) & (s1 == 0.0))
        part = np.where(inside, (s0 + np.where(k1 == k0, s1, 1.0)) / 2.0, 0.0)
        return np.where(inside, k0, (k0 + k1 + 1) // 2), part

    def _configurations(self, before: NDArray[np.int64], part: Array) -> Array:
        configurations, inner = (
            self.run.q[np.where(part < 1.0, before, before + 1)],
            (part > 0.0) & (part < 1.0),
        )
        if not inner.any():
            return np.asarray(configurations)
        k, s = before[inner], part[inner]
        if self.dense:
            configurations[inner] = self.run.at(self.t[k] + s * (self.t[k + 1] - self.t[k])).q
            return np.asarray(configurations)
        configurations[inner], moved = self.cubics.closed(k, s, self.size, POSITION_TOLERANCE * self.link)
        self.well_sampled[k[~(moved <= MAX_MISMATCH * min(1.0, self.size))]] = False
        return np.asarray(configurations)

    def motion(self) -> Motion:
        poses = self.tracks.placements(self.rows)
        # q and -q are equal rotations: adjacent frames get the nearer sign.
        turned_over = np.sum(poses[1:, :, 3:] * poses[:-1, :, 3:], axis=2) < 0.0
        poses[1:, :, 3:] *= np.cumprod(np.where(turned_over, -1.0, 1.0), axis=0)[:, :, None]
        held = np.zeros(max(len(self.before) - 1, 0), dtype=bool)
        if len(self.well_sampled):
            held = ~self.well_sampled[np.minimum(self.before[:-1], len(self.well_sampled) - 1)]
        return Motion(
            self.times(), poses, self.before, self.part, self.q, self.rows, held, self.size, self.cubics
        )


def _resolved_intervals(run: Trajectory, size: float) -> NDArray[np.bool_]:
    """Return the intervals between samples that are sampled finely enough, (nt - 1,).

    In such an interval the displacement is the mean rate times the duration, up to the curvature. Continuous
    joints and spatial orientations are not checked.
    """
    model, h = run.scene.model, np.diff(np.asarray(run.t, dtype=float))[:, None]
    is_resolved = np.ones(len(h), dtype=bool)
    for joint in list(model.joints)[1:]:
        if joint.nq != 1 or joint.nv != 1:
            continue
        q, v = run.q[:, joint.idx_q : joint.idx_q + 1], run.v[:, joint.idx_v : joint.idx_v + 1]
        mean = h * (v[1:] + v[:-1]) / 2.0
        scale = 1.0 if "P" not in joint.shortname().removeprefix("JointModel")[:1] else size
        is_resolved &= (np.abs(np.diff(q, axis=0) - mean) < MAX_MISMATCH * scale)[:, 0]
    # Among coarse intervals, some agree by chance.
    beside = np.convolve(~is_resolved, np.ones(7), mode="same") if len(is_resolved) else np.zeros(0)
    return np.asarray(
        beside[: len(is_resolved)] == 0.0
        if len(is_resolved) >= 7
        else np.full(len(is_resolved), is_resolved.all())
    )


def _base(run: Trajectory, size: float, max_frames: int) -> NDArray[np.int64]:
    """Return all samples, or half of the maximum number of frames, evenly along the motion."""
    count = len(run.t)
    if count <= max_frames // 2:
        return np.arange(count)
    speed = np.abs(run.v).max(axis=1, initial=0.0) / min(1.0, size)
    h = np.diff(np.asarray(run.t, dtype=float))
    way = np.append(0.0, np.cumsum(h * (speed[1:] + speed[:-1]) / 2.0))
    way = way / (way[-1] or 1.0) + np.linspace(0.0, 1.0, count) / 4.0
    even = np.searchsorted(way, np.linspace(0.0, way[-1], max_frames // 2))
    return np.unique(np.clip(np.append(even, [0, count - 1]), 0, count - 1))


def _sizes(model: pin.Model, poses: Array) -> tuple[float, float]:
    """Return the diagonal of the box around all joints and centers of mass, and the smallest link [m]."""
    levers = np.array([model.inertias[joint].lever for joint in range(model.njoints)])
    centers = poses[:, :3] + rotate_vectors(poses[:, 3:], levers)
    frames = [
        poses[f.parentJoint, :3]
        + rotate_vectors(poses[f.parentJoint, None, 3:], f.placement.translation[None])[0]
        for f in model.frames
    ]
    size = float(np.linalg.norm(np.ptp(np.vstack([poses[:, :3], centers, *frames]), axis=0)))
    lengths = np.linalg.norm(
        np.array([m.translation for m in model.jointPlacements][1:]).reshape(-1, 3), axis=1
    )
    lengths = np.append(lengths, np.linalg.norm(levers[1:], axis=1))
    real = lengths[lengths > 1e-3 * size]
    return (size, float(real.min())) if len(real) and size > 1e-6 else (size if size > 1e-6 else 0.0, size)
