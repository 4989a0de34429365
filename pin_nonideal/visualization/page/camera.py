"""View of a replay: camera direction, tracked bodies, and height of the ground."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array

from .contact_surfaces import Plane, ground_of
from .frames import Motion
from .visuals import Visual

# Number of frames from which the bounding box of the motion is computed.
BOX_FRAMES = 200
# Number of points of a cloud that are compared at once, so that their projections stay in the cache.
CLOUD_PART = 2048
# Bodies with a longer travel than this multiple of the model's size leave a fixed view.
MAX_FIXED_TRAVEL = 4.0


@dataclass(frozen=True)
class View:
    """Camera direction and content of the view.

    Attributes:
        up: direction against gravity, (3,).
        direction: unit vector from the target to the camera, (3,).
        outline: extreme points of the drawn bodies over the whole run [m], (k, 3), relative to the tracked
            center of mass if the camera follows it.
        size: diagonal of the model at the start [m].
        link: typical length of a link, for the size of marks [m].
        ground: height of the ground along `up` [m], or None without a ground.
        follow: whether the model travels so far that the camera follows it.
        stays: whether the camera keeps each joint in view, (njoints,); False for belts that leave the view.
    """

    up: Array
    direction: Array
    outline: Array
    size: float
    link: float
    ground: float | None
    follow: bool
    stays: list[bool]


def view(
    model: pin.Model,
    motion: Motion,
    visuals: list[Visual],
    marks: list[tuple[int, Array]],
    shown: Array,
    planes: list[Plane],
) -> View:
    """Return the view that shows the whole motion.

    Args:
        model: model with gravity and masses.
        motion: motion of the run.
        visuals: drawn shapes.
        marks: additional points, as joint index and position in its frame [m].
        shown: additional points of the world in the view [m], (k, 3).
        planes: planes of the contacts.
    """
    up = up_direction(model)
    coarse = motion.only(np.unique(np.linspace(0, len(motion.times) - 1, BOX_FRAMES).astype(int)))
    clouds = [(joint, coarse.point(joint, np.zeros(3))) for joint in range(1, model.njoints)]
    clouds += [(joint, coarse.point(joint, local)) for joint, local in marks]
    clouds += [(v.joint, cloud) for v in visuals if v.joint for cloud in _corners(coarse, v)]
    clouds = clouds or [(0, np.zeros((len(coarse.times), 3)))]
    size = _diagonal(np.array([cloud[0] for _, cloud in clouds]))
    # A particle has the size of its path; a distant or traveling body has the size of its shape.
    if motion.size <= MAX_FIXED_TRAVEL * size or not any(v.joint for v in visuals):
        size = max(size, motion.size)
    stays, follow = _joints_in_view(model.njoints, clouds, size)
    if not all(stays):
        size = _diagonal(np.array([cloud[0] for joint, cloud in clouds if stays[joint]]))
    points = np.array([cloud for joint, cloud in clouds if stays[joint]])
    if follow:
        points = points - center_of_mass(model, coarse, stays)[None]
    else:
        points = np.vstack([points, *_fixed_corners(coarse, visuals, points)])
    beside = points if follow else np.vstack([points.reshape(-1, 3), shown])
    return View(
        up=up,
        direction=_direction(points, up, 0.25 if not len(shown) else 0.6),
        outline=_extreme_points(beside),
        size=max(size, 0.05 * _diagonal(points)),
        link=link_length(model, marks, max(size, 0.05 * _diagonal(points))),
        ground=_ground(planes, visuals, points, size, up, follow),
        follow=follow,
        stays=stays,
    )


def up_direction(model: pin.Model) -> Array:
    """Return the direction against gravity, (3,), or z without gravity.

    Args:
        model: the model.
    """
    gravity = np.asarray(model.gravity.linear)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def center_of_mass(model: pin.Model, motion: Motion, stays: list[bool]) -> Array:
    """Return the center of mass of some joints at each frame [m], (n, 3), or of their origins if massless."""
    moving = [joint for joint in range(1, model.njoints) if stays[joint]]
    mass = np.array([model.inertias[joint].mass for joint in moving])
    mass = mass if mass.sum() > 0.0 else np.ones(len(moving))
    places = np.array([motion.point(joint, model.inertias[joint].lever) for joint in moving])
    return np.asarray(np.einsum("j,jni->ni", mass / mass.sum(), places))


def link_length(model: pin.Model, marks: list[tuple[int, Array]], size: float) -> float:
    """Return a typical link length [m]: twice the median distance of joints, at most the model's size."""
    lengths = [float(np.linalg.norm(place.translation)) for place in model.jointPlacements[1:]]
    lengths += [float(np.linalg.norm(point)) for joint, point in marks if joint]
    real = [length for length in lengths if 1e-3 * size < length <= size]
    return min(float(np.median(real)) * 2.0, size) if real else size


def _fixed_corners(motion: Motion, visuals: list[Visual], points: Array) -> list[Array]:
    """Return the corners of fixed visuals, (8, n, 3) each, that leave half of the view to the moving ones.

    A large floor would make the moving bodies small.
    """
    lower, upper = points.reshape(-1, 3).min(axis=0), points.reshape(-1, 3).max(axis=0)
    room, boxes = 2.0 * float(np.linalg.norm(upper - lower)), []
    for visual in (v for v in visuals if v.joint == 0):
        corners = np.array(_corners(motion, visual))
        if not len(corners):
            continue
        low = np.minimum(lower, corners[:, 0].min(axis=0))
        high = np.maximum(upper, corners[:, 0].max(axis=0))
        if np.linalg.norm(high - low) <= room:
            lower, upper = low, high
            boxes.append(corners)
    return boxes


def _joints_in_view(njoints: int, clouds: list[tuple[int, Array]], size: float) -> tuple[list[bool], bool]:
    """Return the joints that stay in view, and whether the camera must follow."""
    travel = np.zeros(njoints)
    for joint, cloud in clouds:
        travel[joint] = max(travel[joint], _diagonal(cloud))
    far = travel > MAX_FIXED_TRAVEL * size
    if not far[1:].any():
        return [True] * njoints, False
    if np.count_nonzero(far[1:]) * 2 <= njoints - 1:
        near = [cloud for joint, cloud in clouds if not far[joint]]
        if _diagonal(np.array(near)) > 1e-6 * size:
            return [not is_far for is_far in far], False
    return [True] + [bool(is_far) for is_far in far[1:]], True


def _ground(
    planes: list[Plane], visuals: list[Visual], points: Array, size: float, up: Array, follow: bool
) -> float | None:
    """Return the height of the ground plane in contact, or of a floor below a robot near height zero."""
    touched = ground_of(planes, up)
    if touched is not None:
        return float(touched.point @ up)
    if any(v.joint == 0 and v.shape.kind == "plane" for v in visuals) or follow:
        return None
    lowest = float((points @ up).min())
    return 0.0 if -0.02 * size <= lowest <= 0.5 * size else None


def _corners(motion: Motion, visual: Visual) -> list[Array]:
    """Return the corners of the box around a visual at each frame [m], (n, 3) each; none for a plane."""
    center, half = visual.shape.half_extent()
    if not half.any():
        return []
    corners = center + half * np.array(list(product((-1.0, 1.0), repeat=3)))
    local = corners @ visual.placement.rotation.T + visual.placement.translation
    world = np.einsum("nij,kj->kni", motion.rotation(visual.joint), local) + motion.poses[:, visual.joint, :3]
    return list(world)


def _diagonal(points: Array) -> float:
    """Return the diagonal of the box around a cloud [m], at least a nanometer."""
    return max(float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0))), 1e-9)


def _extreme_points(points: Array) -> Array:
    """Return the extreme points of a cloud in 98 directions [m], (k, 3)."""
    cloud = points.reshape(-1, 3)
    grid = np.array(list(product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=3)))
    shell = grid[np.abs(grid).max(axis=1) == 1.0]
    shell = shell[: len(shell) // 2]  # the others are opposite
    ways = shell / np.linalg.norm(shell, axis=1, keepdims=True)
    far, chosen = np.full((2, len(ways)), -np.inf), np.zeros((2, len(ways)), dtype=int)
    for first in range(0, len(cloud), CLOUD_PART):
        reach = ways @ cloud[first : first + CLOUD_PART].T
        for side, best in enumerate((reach.argmax(axis=1), reach.argmin(axis=1))):
            nearest = np.take_along_axis(reach, best[:, None], axis=1)[:, 0] * (1.0 - 2.0 * side)
            farther = nearest > far[side]
            far[side, farther], chosen[side, farther] = nearest[farther], first + best[farther]
    return np.asarray(cloud[np.unique(chosen)])


def _direction(points: Array, up: Array, aslant: float) -> Array:
    """Return the direction to the camera: normal to a nearly planar motion, else from the front right."""
    centered = points.reshape(-1, 3) - points.reshape(-1, 3).mean(axis=0)
    _, spread, axes = np.linalg.svd(centered[:: max(1, len(centered) // 5000)], full_matrices=False)
    front = np.array([0.75, -1.0, 0.0]) if abs(up[2]) > 0.9 else np.array([0.5, 0.0, 1.0])
    front = front + 0.5 * up
    if len(spread) == 3 and spread[2] < 0.15 * spread[1] and spread[1] > 0.05 * spread[0]:
        normal = axes[2]
        if abs(normal @ up) > 0.9:  # a horizontal plane
            front = up + 0.6 * np.cross(up, np.cross([0.0, -1.0, 0.0], up))
        else:
            right = np.cross(up, normal)  # to the right on the screen if the view is against the normal
            front = normal * (1.0 if right.sum() > 0.0 else -1.0)
            front = front + aslant * (up + np.cross(up, front))
    return np.asarray(front / np.linalg.norm(front))


def pattern_spacings(motion: Motion, visuals: list[Visual], axes: dict[int, Array]) -> dict[int, float]:
    """Return the pattern spacing of visuals that slide with a joint farther than their own extent [m].

    A belt with evenly spaced ribs looks the same after a shift by one spacing, and the shifted belt stays on
    its rollers.

    Args:
        motion: motion of the run.
        visuals: drawn shapes.
        axes: axis of each prismatic joint in its own frame, by index.

    Returns:
        Spacing by number of the visual.
    """
    spacings: dict[int, float] = {}
    for joint, axis in axes.items():
        body_visuals = [k for k, visual in enumerate(visuals) if visual.joint == joint]
        if len(body_visuals) < 4:
            continue
        along = np.array([visuals[k].placement.translation @ axis for k in body_visuals])
        if _diagonal(motion.poses[:, joint, :3]) <= np.ptp(along):
            continue
        same: dict[Any, list[float]] = {}
        for k, place in zip(body_visuals, along, strict=True):
            shape = visuals[k].shape
            same.setdefault((shape.kind, shape.size, len(shape.vertices)), []).append(float(place))
        steps = [np.diff(sorted(places)) for places in same.values() if len(places) >= 3]
        if steps and all(np.ptp(step) < 1e-3 * step.mean() for step in steps):
            spacings |= dict.fromkeys(body_visuals, max(float(step.mean()) for step in steps))
    return spacings
