"""Shapes for a model without geometry: bars between joints, and hulls of end points on bodies."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array

from .visuals import JOINT_COLOR, LINK_COLORS, Shape, Visual, joint_axis


def link_bars(model: pin.Model, ends: list[tuple[int, Array]], size: float) -> list[Visual]:
    """Return visuals for a model without geometry: bars between joints, hubs at joints, point masses.

    Args:
        model: the model.
        ends: additional end points of bars on bodies, as joint index and position in its frame [m], (3,).
        size: typical length of a link, which determines the thickness [m].
    """
    radius = 0.02 * size
    points: list[list[Array]] = [[] for _ in range(model.njoints)]
    for joint in range(1, model.njoints):
        points[int(model.parents[joint])].append(np.asarray(model.jointPlacements[joint].translation))
    solids = {joint: solid for joint in range(1, model.njoints) if (solid := _solid(joint, ends)) is not None}
    for joint, point in ends:
        if joint not in solids:
            points[joint].append(np.asarray(point))

    visuals: list[Visual] = []
    for joint in range(1, model.njoints):
        if joint in solids:
            color = LINK_COLORS[(joint - 1) % len(LINK_COLORS)]
            visuals.append(
                Visual(f"{model.names[joint]} solid", joint, pin.SE3.Identity(), solids[joint], color)
            )
            if not points[joint]:
                continue
        color = LINK_COLORS[(joint - 1) % len(LINK_COLORS)]
        name = str(model.names[joint])
        lever, mass = np.asarray(model.inertias[joint].lever), float(model.inertias[joint].mass)
        reach = points[joint] or [
            np.asarray(frame.placement.translation) for frame in model.frames if frame.parentJoint == joint
        ]
        reach = [point for point in reach if np.linalg.norm(point) > radius]
        if not reach and np.linalg.norm(lever) > radius:
            reach = [2.0 * lever]  # a uniform bar is twice as long as the distance of its center of mass
        for number, point in enumerate(reach):
            visuals.append(Visual(f"{name} bar {number}", joint, *_bar(point, radius), color))
        if not reach and mass > 0.0:
            ball = Shape("ellipsoid", (1.5 * radius,) * 3)
            visuals.append(Visual(f"{name} mass", joint, pin.SE3(np.eye(3), lever), ball, color))
        elif reach or mass > 0.0 or not points[joint]:
            visuals.append(_hub(model, joint, radius))
    return visuals


def _solid(joint: int, ends: list[tuple[int, Array]]) -> Shape | None:
    """Return the convex hull of the given points of a body, or None if they span no solid."""
    joint_ends = np.array([point for other, point in ends if other == joint]).reshape(-1, 3)
    if len(joint_ends) < 4:
        return None
    from scipy.spatial import ConvexHull, QhullError  # imported for solids only, because the import is slow

    try:
        hull = ConvexHull(joint_ends)
    except QhullError:  # coplanar points
        return None
    number = {old: new for new, old in enumerate(hull.vertices)}
    corners = joint_ends[hull.vertices]
    triangles = np.array([[number[corner] for corner in face] for face in hull.simplices])
    a, b, c = corners[triangles].transpose(1, 0, 2)
    inward = np.sum(np.cross(b - a, c - a) * (a - corners.mean(axis=0)), axis=1) < 0.0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    return Shape("mesh", vertices=corners, triangles=triangles, parts=((len(triangles), None),))


def _bar(end: Array, radius: float) -> tuple[pin.SE3, Shape]:
    """Return a rounded bar from the origin to a point."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end).matrix()
    return pin.SE3(turn, end / 2.0), Shape("capsule", (radius, float(np.linalg.norm(end))))


def _hub(model: pin.Model, joint: int, radius: float) -> Visual:
    """Return the shape of a joint: a drum along a revolute axis, a block on a prismatic one, else a ball."""
    name = f"{model.names[joint]} joint"
    axis, turning = joint_axis(model, joint)
    if axis is None:
        ball = Shape("ellipsoid", (1.7 * radius,) * 3)
        return Visual(name, joint, pin.SE3.Identity(), ball, JOINT_COLOR)
    turn = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix(), np.zeros(3))
    shape = Shape("cylinder", (1.6 * radius, 3.4 * radius))
    if not turning:
        shape = Shape("box", (3.4 * radius, 3.4 * radius, 5.0 * radius))
    return Visual(name, joint, turn, shape, JOINT_COLOR)
