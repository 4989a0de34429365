"""Coordinates of the joints of a tree, which a page interpolates in time and converts to placements.

A joint that rotates about or slides along one axis has one coordinate. Other joints have the placement of
their frame after the joint relative to the frame before it. Interpolated coordinates keep joints connected
for any distance of the frames of a replay.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array

from .visuals import joint_axis

# Joints with one axis through the origin of their frame.
ONE_AXIS = re.compile(r"JointModel(R[XYZ]|RUB[XYZ]|P[XYZ]|Revolute|Prismatic)")


@dataclass(frozen=True)
class Track:
    """Coordinates of one joint.

    Attributes:
        parent: index of the parent joint.
        place: fixed placement on the parent joint, as x, y, z, qx, qy, qz, qw, (7,).
        first: column of the first coordinate.
        axis: axis in the joint's own frame, (3,); None for a joint whose seven coordinates are its placement.
        turning: whether the joint rotates about its axis, or slides along it.
    """

    parent: int
    place: Array
    first: int
    axis: Array | None
    turning: bool

    @property
    def columns(self) -> slice:
        """Return the columns of the joint's coordinates."""
        return slice(self.first, self.first + (7 if self.axis is None else 1))


class Tracks:
    """Coordinates of the joints of a model; index 0 is the world."""

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        self.joints: list[Track | None] = [None]
        self.width = 0
        for joint in range(1, model.njoints):
            one = ONE_AXIS.match(model.joints[joint].shortname()) and model.joints[joint].nv == 1
            axis, turning = joint_axis(model, joint) if one else (None, False)
            place = pin.SE3ToXYZQUAT(model.jointPlacements[joint])
            track = Track(int(model.parents[joint]), place, self.width, axis, turning)
            self.joints.append(track)
            self.width = track.columns.stop

    def moving(self) -> list[tuple[int, Track]]:
        """Return all joints except the world, with their indices."""
        return [(number, track) for number, track in enumerate(self.joints) if track is not None]

    def coordinates(self, q: Array) -> Array:
        """Return the coordinates of configurations, (n, nq) to (n, width)."""
        coordinates = np.empty((len(q), self.width))
        for number, track in self.moving():
            joint = self.model.joints[number]
            part = q[:, joint.idx_q : joint.idx_q + joint.nq]
            if track.axis is not None:
                coordinates[:, track.first] = (
                    part[:, 0] if joint.nq == 1 else np.arctan2(part[:, 1], part[:, 0])
                )
            elif joint.shortname() == "JointModelFreeFlyer":
                coordinates[:, track.columns] = part
            else:
                data = joint.createData()
                for k, row in enumerate(q):
                    joint.calc(data, row)
                    coordinates[k, track.columns] = pin.SE3ToXYZQUAT(pin.SE3(data.M))
        return coordinates

    def near(self, coordinates: Array, others: Array) -> Array:
        """Shift angles by full turns and flip quaternions to the values nearest to given coordinates."""
        result = coordinates.copy()
        for number, track in self.moving():
            c = track.columns
            if track.axis is None:
                away = np.sum(result[:, c][:, 3:] * others[:, c][:, 3:], axis=1) < 0.0
                result[away, c.start + 3 : c.stop] *= -1.0
            elif track.turning and self.model.joints[number].nq == 2:
                turns = np.round((others[:, c] - result[:, c]) / (2.0 * np.pi))
                result[:, c] += 2.0 * np.pi * turns
        return np.asarray(result)

    def steady(self, coordinates: Array) -> Array:
        """Shift the coordinates of each frame to the nearest equivalent of the frame before it."""
        result = coordinates.copy()
        for number, track in self.moving():
            c = track.columns
            if track.axis is None:
                rotate_vectors = np.sum(result[1:, c][:, 3:] * result[:-1, c][:, 3:], axis=1) < 0.0
                result[1:, c.start + 3 : c.stop] *= np.cumprod(np.where(rotate_vectors, -1.0, 1.0))[:, None]
            elif track.turning and self.model.joints[number].nq == 2:
                result[:, c] = np.unwrap(result[:, c], axis=0)
        return np.asarray(result)

    def placements(self, coordinates: Array) -> Array:
        """Return the placement of each joint in the world as x, y, z, qx, qy, qz, qw, (n, njoints, 7)."""
        world = np.zeros((len(coordinates), len(self.joints), 7))
        world[:, 0, 6] = 1.0
        for number, track in self.moving():
            start = _placement_products(world[:, track.parent], np.broadcast_to(track.place, (len(world), 7)))
            values = coordinates[:, track.columns]
            move = values
            if track.axis is not None:
                move = np.zeros((len(world), 7))
                move[:, 6] = 1.0
                if track.turning:
                    move[:, 3:6], move[:, 6] = np.sin(values / 2.0) * track.axis, np.cos(values[:, 0] / 2.0)
                else:
                    move[:, :3] = values * track.axis
            world[:, number] = _placement_products(start, move)
        return world

    def reaches(self, poses: Array) -> Array:
        """Return the maximum distance of the points that a joint moves from its origin [m], (njoints,)."""
        levers = np.array([inertia.lever for inertia in self.model.inertias])
        ends = poses[:, :3] + rotate_vectors(poses[:, 3:], levers)
        lengths = np.zeros(len(self.joints))
        for frame in self.model.frames:
            joint = frame.parentJoint
            lengths[joint] = max(lengths[joint], float(np.linalg.norm(frame.placement.translation)))
        for number in range(1, len(self.joints)):
            above = number
            while above:
                away = np.linalg.norm([ends[number], poses[number, :3]] - poses[above, :3], axis=1).max()
                lengths[above] = max(lengths[above], float(away))
                above = int(self.model.parents[above])
        return lengths

    def distance(self, one: Array, other: Array, reach: Array) -> Array:
        """Return an upper bound on the displacement of points between two sets of coordinates [m], (n,).

        Args:
            one: coordinates, (n, width).
            other: coordinates, (n, width).
            reach: result of `reaches` [m], (njoints,).
        """
        gap = np.abs(one - other)
        total = np.zeros((len(gap), len(self.joints)))
        for number, track in self.moving():
            joint_gap = gap[:, track.columns]
            if track.axis is None:
                moved = np.linalg.norm(joint_gap[:, :3], axis=1) + 2.0 * reach[number] * np.linalg.norm(
                    joint_gap[:, 3:], axis=1
                )
            else:
                moved = joint_gap[:, 0] * (reach[number] if track.turning else 1.0)
            total[:, number] = total[:, track.parent] + moved
        return np.asarray(total.max(axis=1))


def _placement_products(first: Array, second: Array) -> Array:
    """Return products of placements, (n, 7) each."""
    moved = first[:, :3] + rotate_vectors(first[:, 3:], second[:, :3])
    return np.column_stack([moved, _product(first[:, 3:], second[:, 3:])])


def rotate_vectors(quaternions: Array, vectors: Array) -> Array:
    """Return vectors (n, 3) rotated by quaternions x, y, z, w, (n, 4)."""
    x, y, z, w = quaternions.T
    a, b, c = vectors.T
    u, v, t = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)  # 2 axis x vector
    turns = (a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u)
    return np.stack(turns, axis=-1)


def _product(a: Array, b: Array) -> Array:
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    return np.column_stack([vector, a[:, 3] * b[:, 3] - np.sum(a[:, :3] * b[:, :3], axis=1)])


def slopes(times: Array, values: Array) -> tuple[Array, Array]:
    """Return the rates of change at both ends of every interval, (n - 1, c) each, for the page.

    Inner frames have the rate of the parabola through three frames. Frames with equal times, as at an impact,
    and the ends of the run have the one-sided rate of the adjacent parabola.
    """
    h = np.diff(times)[:, None]
    chord = np.divide(np.diff(values, axis=0), h, out=np.zeros((len(h), values.shape[1])), where=h > 0.0)
    left, right = chord.copy(), chord.copy()
    inner = (h[:-1] > 0.0) & (h[1:] > 0.0)
    whole = np.where(inner, h[:-1] + h[1:], 1.0)
    middle = (chord[:-1] * h[1:] + chord[1:] * h[:-1]) / whole
    right[:-1], left[1:] = np.where(inner, middle, chord[:-1]), np.where(inner, middle, chord[1:])
    smooth = inner[:, 0]
    starts, ends = np.append(False, smooth), np.append(smooth, False)
    left = np.where((~starts & ends)[:, None], 2.0 * chord - right, left)
    right = np.where((starts & ~ends)[:, None], 2.0 * chord - left, right)
    return left, right


def halfway(times: Array, values: Array) -> Array:
    """Return the values at the middle of every interval, (n - 1, c), by cubic Hermite interpolation."""
    left, right = slopes(times, values)
    h = np.diff(times)[:, None]
    return np.asarray((values[1:] + values[:-1]) / 2.0 + h * (left - right) / 8.0)
