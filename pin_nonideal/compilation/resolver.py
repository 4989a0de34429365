"""Resolution of names: frames, joints and axes of descriptions, and unique names of descriptions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import HingeAnchor, Rolling
from pin_nonideal.description.contacts import PointContact
from pin_nonideal.description.contacts.pair_of_shapes import BallContacts, CapsulePairs, ContactGroup
from pin_nonideal.description.contacts.point_names import UsedNames
from pin_nonideal.description.contacts.round import (
    BoxContact,
    CapsuleContact,
    Segment,
    SphereContact,
    segments,
)
from pin_nonideal.description.contacts.solids import (
    CylinderContact,
    EllipsoidContact,
    HullContact,
    RevolvedContact,
    RimContact,
    core_hull,
)
from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.states.kinematics import frame_index, frame_on_joint, joint_placements
from pin_nonideal.types import Array, Model, Placement
from pin_nonideal.validation import Vector3, axis_triad, unit_axis, unit_vector

# A frame in the form of the core: joint index, rotation matrix by rows, translation [m].
Frame = tuple[int, list[float], list[float]]
# Right-handed unit vectors (tangent, tangent, normal).
Axes = tuple[Vector3, Vector3, Vector3]

WORLD: Frame = (0, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0])


def placed_on(joint: int, placement: Placement) -> Frame:
    """Return a placement on a joint's body in the form of the core.

    Args:
        joint: index of the joint.
        placement: pinocchio.SE3.
    """
    return (int(joint), placement.rotation.ravel().tolist(), placement.translation.tolist())


class Resolver:
    """Lookup of frames and joints of a model by name.

    Args:
        model: pinocchio.Model.
        q0: configuration at which `frame2=None` and lengths left out are read, (nq,).
    """

    def __init__(self, model: Model, q0: Array) -> None:
        self.model, self.q0 = model, q0
        self._placements = joint_placements(model, q0)
        self._frames: dict[str, Frame] = {}
        self._placed_frames: dict[tuple[str, Vector3, Vector3], Frame] = {}  # shared by contacts
        self._segments: dict[tuple[str, tuple[Segment, ...]], list[tuple[Frame, float]]] = {}
        self._balls: dict[tuple[str, tuple[Vector3, ...]], list[Frame]] = {}
        self._planes: dict[tuple[str | None, float, Vector3], tuple[Frame, Axes]] = {}

    def frame_id(self, name: str, who: str) -> int:
        """Return the index of a frame; a joint's name selects the frame of the joint."""
        if self.model.existFrame(name):
            return frame_index(self.model, name)
        names = [f.name for f in self.model.frames]
        raise UnknownNameError(f'{who}: no frame "{name}" in model "{self.model.name}"{nearest(name, names)}')

    def frame(self, name: str, who: str) -> Frame:
        """Return a frame, or the frame of a joint, in the form of the core."""
        if name not in self._frames:
            if not self.model.existJointName(name):
                self.frame_id(name, who)  # raises if there is no such frame
            self._frames[name] = placed_on(*frame_on_joint(self.model, name))
        return self._frames[name]

    def plane(self, name: str | None, who: str) -> Frame:
        """Return the frame of a plane: the world frame if the name is None."""
        return WORLD if name is None else self.frame(name, who)

    def in_world(self, frame: Frame) -> Placement:
        """Return the placement of a frame in the world at q0, pinocchio.SE3."""
        joint, R, p = frame
        return self._placements[joint] * pin.SE3(np.reshape(R, (3, 3)), np.array(p))

    def joint(self, name: str, who: str, *, freedoms: tuple[int, ...] = (1,)) -> int:
        """Return the index of a joint with an allowed number of degrees of freedom."""
        model = self.model
        if not model.existJointName(name) or name == "universe":
            if model.existFrame(name, pin.FrameType.FIXED_JOINT):
                raise InputError(
                    f'{who}: joint "{name}" is fixed (locked) and cannot move; unlock it or leave it out'
                )
            raise UnknownNameError(
                f'{who}: no joint "{name}" in model "{model.name}"{nearest(name, list(model.names)[1:])}'
            )
        index = int(model.getJointId(name))
        if model.joints[index].nv not in freedoms:
            degrees = "1 degree" if freedoms == (1,) else f"{' or '.join(map(str, freedoms))} degrees"
            raise InputError(
                f'{who}: joint "{name}" must have {degrees} of freedom; it has {model.joints[index].nv}'
            )
        return index

    def pair(self, description: Any, who: str) -> tuple[Frame, Frame]:
        """Return both frames of an anchor.

        Without a second frame, both frames have world axes at q0, and the second is fixed to the world.
        """
        first = self.frame(description.frame1, who)
        if description.frame2 is not None:
            return first, self.frame(description.frame2, who)
        here = self.in_world(first)
        joint, R, p = first
        level = np.reshape(R, (3, 3)) @ here.rotation.T  # world axes at q0
        return (joint, level.ravel().tolist(), p), (0, WORLD[1], here.translation.tolist())

    def hinge_axis(self, hinge: HingeAnchor, who: str) -> Vector3:
        """Return the hinge axis in the axes of frame2, or in world axes without frame2."""
        axis = unit_axis(who, hinge.axis)
        if hinge.frame2 is not None:
            return axis
        x, y, z = (float(x) for x in self.in_world(self.frame(hinge.frame1, who)).rotation @ np.array(axis))
        return (x, y, z)

    def contact(self, c: PointContact | EllipsoidContact | Rolling, who: str) -> tuple[Frame, Frame, Axes]:
        """Return frame, plane, and right-handed (tangent, tangent, normal) in the axes of the plane."""
        key = c.plane, getattr(c, "height", 0.0), unit_axis(who, c.normal)
        if key not in self._planes:
            axes = axis_triad(key[2])
            self._planes[key] = translated_frame(self.plane(c.plane, who), np.array(axes[2]) * key[1]), axes
        plane, axes = self._planes[key]
        frame = self.placed(c.frame, getattr(c, "offset", (0.0, 0.0, 0.0)), who)
        if frame[0] == plane[0]:
            raise InputError(f"{who}: frame and plane are on the same body, which cannot touch itself")
        return frame, plane, axes

    def capsules(self, c: SphereContact | CapsuleContact, who: str) -> tuple[Frame, Frame, float, float]:
        """Return frames at the segment centers, z along the segments, and the half lengths [m]."""
        self._two_bodies(c, who)
        ends1, ends2 = segments(c)
        ((first, half1),) = self.segments(c.frame1, (ends1,), who)
        ((second, half2),) = self.segments(c.frame2, (ends2,), who)
        return first, second, half1, half2

    def capsule_pairs(
        self, pairs: CapsulePairs, who: str
    ) -> tuple[list[tuple[Frame, float]], list[tuple[Frame, float]]]:
        """Return frames at the centers of all segments, z along them, and the half lengths [m]."""
        c = pairs.like
        self._two_bodies(c, who)
        return self.segments(c.frame1, pairs.lines1, who), self.segments(c.frame2, pairs.lines2, who)

    def segments(self, frame: str, lines: tuple[Segment, ...], who: str) -> list[tuple[Frame, float]]:
        """Return frames at the centers of segments, z along them, and the half lengths [m]."""
        key = frame, lines
        if key not in self._segments:
            self._segments[key] = [along(self.frame(frame, who), ends) for ends in lines]
        return self._segments[key]

    def other_balls(self, balls: BallContacts, who: str) -> list[Frame]:
        """Return the frames at the centers of all spheres but the first."""
        key = balls.frame, balls.offsets
        if key not in self._balls:
            self._balls[key] = [self.placed(balls.frame, offset, who) for offset in balls.offsets[1:]]
        return self._balls[key]

    def box(self, c: BoxContact, who: str) -> tuple[Frame, Frame, list[float]]:
        """Return frames at the centers of sphere and box, and half edges minus the rounding radius [m]."""
        self._two_bodies(c, who)
        half = [0.5 * edge - c.radius2 for edge in c.size]
        return self.placed(c.frame1, c.offset, who), self.placed(c.frame2, c.xyz, who, c.rpy), half

    def hull(
        self, c: HullContact, who: str
    ) -> tuple[Frame, Frame, tuple[list[float], list[float], list[int]]]:
        """Return the frame at the sphere's center, the frame of the hull, and the hull in the core's form."""
        second = self._two_bodies(c, who)[1]
        return self.placed(c.frame1, c.offset, who), second, core_hull(c)

    def cylinder(
        self, c: CylinderContact, who: str
    ) -> tuple[Frame, Frame, tuple[float, float, float], float]:
        """Return the frames of capsule and solid of revolution, the solid, and the half capsule length [m].

        Both frames are at the centers, with z along the axes. The solid is (half length, lower radius, upper
        radius) [m]. A sphere is a capsule with zero half length.
        """
        first, second = self._two_bodies(c, who)
        above = c.below if c.above is None else c.above
        first, half1 = along(first, (c.offset, c.offset if c.end is None else c.end))
        return (
            first,
            rotated_frame(translated_frame(second, c.xyz), c.rpy),
            (0.5 * c.length, c.below, above),
            half1,
        )

    def rim(self, c: RimContact, who: str) -> tuple[Frame, Frame, tuple[list[float], list[float], list[int]]]:
        """Return the frame at the disk's center, z along its axis, the frame of the hull, and the hull."""
        first, second = self._two_bodies(c, who)
        return rotated_frame(translated_frame(first, c.offset), c.rpy), second, core_hull(c)

    def rims(self, c: RevolvedContact, who: str) -> tuple[Frame, Frame, Vector3, Vector3]:
        """Return frames at both centers, z along the axes, and (half length, radius, radius) of both [m]."""
        first, second = self._two_bodies(c, who)
        (length1, *radii1), (length2, *radii2) = c.solid1, c.solid2
        one, other = (0.5 * length1, radii1[0], radii1[1]), (0.5 * length2, radii2[0], radii2[1])
        return (
            rotated_frame(translated_frame(first, c.xyz1), c.rpy1),
            rotated_frame(translated_frame(second, c.xyz2), c.rpy2),
            one,
            other,
        )

    def placed(self, frame: str, by: Vector3, who: str, rpy: Vector3 = (0.0, 0.0, 0.0)) -> Frame:
        """Return a frame translated in its axes and then rotated; contacts of the same shapes share it."""
        key = frame, by, rpy
        if key not in self._placed_frames:
            moved = translated_frame(self.frame(frame, who), by)
            self._placed_frames[key] = rotated_frame(moved, rpy) if any(rpy) else moved
        return self._placed_frames[key]

    def _two_bodies(self, c: Any, who: str) -> list[Frame]:
        ends = [self.frame(c.frame1, who), self.frame(c.frame2, who)]
        if ends[0][0] == ends[1][0]:
            raise InputError(f"{who}: frame1 and frame2 are on the same body, which cannot touch itself")
        return ends

    def bearing(self, joint: int) -> tuple[core.Load, list[float]]:
        """Return the kind of bearing load of a joint, and the bearing axis in the joint's frame, (3,).

        Args:
            joint: index.

        Returns:
            revolute (helical joints too), prismatic, spherical, or none for all others, and the axis.
        """
        item = self.model.joints[joint]
        data = item.createData()
        item.calc(data, pin.neutral(self.model), np.zeros(self.model.nv))
        S = np.asarray(data.S).reshape(6, -1)
        if item.nv == 3:
            spherical = "Spherical" in item.shortname() and "ZYX" not in item.shortname()
            return (core.Load.spherical if spherical else core.Load.none), [0.0, 0.0, 1.0]
        if item.nv != 1 or "Composite" in item.shortname():
            return core.Load.none, [0.0, 0.0, 1.0]
        lin, ang = S[:3, 0], S[3:, 0]
        if np.linalg.norm(ang) > 0.5:
            return core.Load.revolute, (ang / np.linalg.norm(ang)).tolist()
        return core.Load.prismatic, (lin / np.linalg.norm(lin)).tolist()


def translated_frame(frame: Frame, by: Sequence[float] | Array) -> Frame:
    """Return the frame translated on its body.

    Args:
        frame: the frame.
        by: translation in the axes of the frame [m], (3,).
    """
    joint, R, p = frame
    return (joint, R, [x + move for x, move in zip(p, _rotated(R, by), strict=True)]) if any(by) else frame


def along(frame: Frame, ends: Segment) -> tuple[Frame, float]:
    """Return a frame at the center of a segment, with z along it, and its half length [m].

    Args:
        frame: a frame on the same body.
        ends: ends of the segment in the axes of the frame [m].
    """
    first, last = ends
    half = 0.5 * math.dist(first, last)
    joint, R, p = translated_frame(frame, [0.5 * (a + b) for a, b in zip(first, last, strict=True)])
    if half > 0.0:
        x, y, z = (b - a for a, b in zip(first, last, strict=True))
        columns = [_rotated(R, axis) for axis in axis_triad(unit_vector((x, y, z)))]
        R = [column[row] for row in range(3) for column in columns]
    return (joint, R, p), half


def _rotated(R: Sequence[float], vector: Sequence[float] | Array) -> list[float]:
    """Return the product of a rotation matrix, by rows, and a vector."""
    x, y, z = map(float, vector)
    return [R[k] * x + R[k + 1] * y + R[k + 2] * z for k in (0, 3, 6)]


def rotated_frame(frame: Frame, rpy: Sequence[float] | Array) -> Frame:
    """Return the frame rotated about its origin.

    Args:
        frame: the frame.
        rpy: roll, pitch and yaw of the new axes relative to the old axes [rad], (3,).
    """
    joint, R, p = frame
    return joint, (np.reshape(R, (3, 3)) @ pin.rpy.rpyToMatrix(*rpy)).ravel().tolist(), p


def unique_names(descriptions: Sequence[object], used_names: UsedNames) -> list[str]:
    """Return a unique name for each description: the user's name, or the kind with its frames or joints.

    Args:
        descriptions: constraints, laws or contacts; a `ContactGroup` gets the name of its first contact.
        used_names: names in use; extended by this function.

    Raises:
        InputError: two descriptions have the same name.
    """
    names = []
    for d in descriptions:
        if isinstance(d, ContactGroup):
            if taken := used_names.add_points(d.names):
                raise InputError(f'names must be unique in a scene; "{taken}" is used twice')
            names.append(d.names[0])
            continue
        own = getattr(d, "name", None)
        if own:
            if own in used_names:
                raise InputError(f'names must be unique in a scene; "{own}" is used twice')
            name = str(own)
        else:
            keys = ("frame1", "frame2", "joint1", "joint2", "joint", "frame")
            parts = [str(getattr(d, k)) for k in keys if getattr(d, k, None) is not None]
            base = name = type(d).__name__ + (f"({', '.join(parts)})" if parts else "")
            count = 1
            while name in used_names:
                count += 1
                name = f"{base} #{count}"
        used_names.add(name)
        names.append(name)
    return names


def words(description: object, name: str | None = None) -> str:
    """Return the label of a description in messages: its class and its name.

    Args:
        description: any description in a scene.
        name: unique name in the scene, used if the description has no name.
    """
    own = getattr(description, "name", None) or name
    kind = type(description).__name__
    return f'{kind} "{own}"' if own and not str(own).startswith(kind) else str(own or kind)
