"""Surfaces of contacts: the ground, patches of other planes, and stops of joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.description.contacts import JointLimit
from pin_nonideal.description.contacts.pair_of_shapes import BallContacts, CapsulePairs, contact_parts
from pin_nonideal.description.contacts.round import CapsuleContact, SphereContact
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.kinematics import frame_on_joint
from pin_nonideal.types import Array
from pin_nonideal.validation import axis_triad, unit_axis

from .frames import Motion
from .visuals import LINK_COLORS, Color, Shape, Visual, joint_axis

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Margin of a patch beyond the contact points, and maximum distance from their median, in model sizes.
PATCH_MARGIN, MAX_PATCH_REACH = 0.25, 2.5
PATCH: Color = (0.66, 0.46, 0.24, 0.6)
# Segment of a sphere in the axes of its frame [m].
CENTER = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
STOP: Color = (0.28, 0.33, 0.41, 1.0)


@dataclass(frozen=True)
class Plane:
    """Plane of one or more contacts.

    Attributes:
        joint: index of the joint that carries it, 0 for the world.
        point: point of the plane in that joint's frame [m], (3,).
        normal: unit normal in that joint's frame, (3,).
        touching: joint and position (3,) of each point that touches the plane.
    """

    joint: int
    point: Array
    normal: Array
    touching: list[tuple[int, Array]]

    def same(self, other: Plane) -> bool:
        """Check if both planes are equal."""
        return self.joint == other.joint and bool(
            self.normal @ other.normal > 1.0 - 1e-9
            and abs(self.normal @ (self.point - other.point)) < 1e-9 * (1.0 + np.abs(self.point).max())
        )


def planes_of(compiled: CompiledScene) -> list[Plane]:
    """Return the planes of all contacts and rolling bodies, without duplicates."""
    model, planes = compiled.model, list[Plane]()
    for part in [*contact_parts(compiled.spec.contacts), *compiled.spec.constraints]:
        item = part.like if isinstance(part, BallContacts) else part
        name = getattr(item, "plane", "")
        if not hasattr(item, "normal") or (name is not None and not (name and model.existFrame(name))):
            continue
        joint, place = (0, pin.SE3.Identity()) if name is None else frame_on_joint(model, name)
        normal = np.asarray(place.rotation) @ np.asarray(unit_axis("normal", item.normal))
        point = np.asarray(place.translation) + getattr(item, "height", 0.0) * normal
        plane = Plane(joint, point, normal, _touching(model, part))
        known = next((other for other in planes if other.same(plane)), None)
        if known is None:
            planes.append(plane)
        else:
            known.touching.extend(plane.touching)
    return planes


def _touching(model: pin.Model, part: Any) -> list[tuple[int, Array]]:
    """Return joint and position of the points that touch a plane."""
    joint, place = frame_on_joint(model, part.frame)
    offsets = part.offsets if isinstance(part, BallContacts) else [getattr(part, "offset", (0.0, 0.0, 0.0))]
    return [(joint, np.asarray(place.act(np.array(offset, dtype=float)))) for offset in offsets]


def ground_of(planes: list[Plane], up: Array) -> Plane | None:
    """Return the lowest horizontal plane of the world, or None."""
    level = [plane for plane in planes if not plane.joint and plane.normal @ up > 0.999]
    return min(level, key=lambda plane: float(plane.point @ up)) if level else None


def contact_surfaces(
    run: Trajectory, motion: Motion, visuals: list[Visual], up: Array, planes: list[Plane] | None = None
) -> list[Visual]:
    """Return patches of planes without shapes, and the stops of joints with impacts.

    Args:
        run: run of the replay.
        motion: motion of the run.
        visuals: existing shapes.
        up: direction against gravity, (3,).
        planes: planes of the contacts, if they are known.
    """
    compiled, shapes = compiled_scene(run.scene), run.scene.visual_model
    planes = planes_of(compiled) if planes is None else planes
    ground, drawn = ground_of(planes, up), {visual.joint for visual in visuals}
    hidden = [
        plane for plane in planes if plane is not ground and (plane.joint not in drawn or not plane.joint)
    ]
    patches = [
        _patch(number, plane, motion) for number, plane in enumerate(hidden) if 0 not in drawn or plane.joint
    ]
    round_bodies = [] if shapes is not None and len(shapes.geometryObjects) else _round_bodies(compiled)
    return patches + _stops(run, motion) + round_bodies


def _round_bodies(compiled: CompiledScene) -> list[Visual]:
    """Return the spheres and capsules in contact with each other, for a scene without shapes."""
    sides: dict[tuple[Any, ...], None] = {}  # ordered set, since many contacts share a shape
    for item in contact_parts(compiled.spec.contacts):
        if isinstance(item, SphereContact):
            sides[item.frame1, CENTER, item.radius1] = sides[item.frame2, CENTER, item.radius2] = None
        elif isinstance(item, CapsuleContact):
            sides[item.frame1, item.segment1, item.radius1] = None
            sides[item.frame2, item.segment2, item.radius2] = None
        elif isinstance(item, CapsulePairs):
            for frame, lines, radius in item.sides():
                sides |= {(frame, line, radius): None for line in lines}
    bodies: dict[tuple[str, bytes], Visual] = {}
    for frame, segment, radius in sides:
        start, end = np.array(segment)
        key = (frame, (end - start).tobytes())
        if radius > 0.0 and key not in bodies:  # corners and edges have radius 0
            bodies[key] = _round_body(compiled.model, frame, start, end, radius)
    return list(bodies.values())


def _round_body(model: pin.Model, frame: str, start: Array, end: Array, radius: float) -> Visual:
    """Return a sphere, or a capsule around the segment between two points."""
    joint, place = frame_on_joint(model, frame)
    way, turn, shape = end - start, np.eye(3), Shape("ellipsoid", (radius,) * 3)
    if way.any():
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).matrix()
        shape = Shape("capsule", (radius, float(np.linalg.norm(way))))
    middle = place * pin.SE3(turn, (start + end) / 2.0)
    return Visual(f"{frame} round", joint, middle, shape, LINK_COLORS[joint % len(LINK_COLORS)])


def _patch(number: int, plane: Plane, motion: Motion) -> Visual:
    """Return a thin plate on a plane around the path of its contact points."""
    t1, t2, _ = (np.asarray(axis) for axis in axis_triad(unit_axis("normal", plane.normal)))
    clouds = [motion.local(plane.joint, motion.point(joint, local)) for joint, local in plane.touching]
    cloud = np.concatenate(clouds) - plane.point
    along = np.column_stack([cloud @ t1, cloud @ t2])
    middle, reach = np.median(along, axis=0), MAX_PATCH_REACH * motion.size
    low = np.maximum(along.min(axis=0), middle - reach) - PATCH_MARGIN * motion.size
    high = np.minimum(along.max(axis=0), middle + reach) + PATCH_MARGIN * motion.size
    thick, center = 0.01 * motion.size, (low + high) / 2.0
    place = plane.point + center[0] * t1 + center[1] * t2 - 0.5 * thick * plane.normal
    turn = np.column_stack([t1, t2, plane.normal])
    shape = Shape("box", (float(high[0] - low[0]), float(high[1] - low[1]), thick))
    return Visual(f"plane {number + 1}", plane.joint, pin.SE3(turn, place), shape, PATCH)


def _stops(run: Trajectory, motion: Motion) -> list[Visual]:
    """Return the stops of joints with impacts: a bar for a revolute joint, a plate for a prismatic one."""
    struck = {str(event.element) for event in run.events if event.kind in ("impact", "touch_down")}
    stops = []
    model = run.scene.model
    limits = {"lower": model.lowerPositionLimit, "upper": model.upperPositionLimit}
    for name, item in compiled_scene(run.scene).described.single():
        if isinstance(item, JointLimit) and name in struck:
            joint, end = model.getJointId(item.joint), name.rpartition(" ")[2]
            stated = getattr(item, end)
            at = float(limits[end][model.joints[joint].idx_q] if stated is None else stated)
            stops.append(_stop(model, motion, name, joint, at))
    return stops


def _stop(model: pin.Model, motion: Motion, name: str, joint: int, at: float) -> Visual:
    axis, turning = joint_axis(model, joint)
    way, base, parent = np.asarray(axis), model.jointPlacements[joint], int(model.parents[joint])
    z, thick = np.array([0.0, 0.0, 1.0]), 0.012 * motion.size
    if not turning:
        turn = pin.Quaternion.FromTwoVectors(z, way).matrix()
        plate = Shape("box", (0.2 * motion.size, 0.2 * motion.size, 0.5 * thick))
        return Visual(name, parent, base * pin.SE3(turn, at * way), plate, STOP)
    ends = [np.asarray(model.inertias[joint].lever)]
    ends += [
        np.asarray(place.translation) for place in np.asarray(model.jointPlacements)[model.children[joint]]
    ]
    across = max((end - (end @ way) * way for end in ends), key=lambda end: float(np.linalg.norm(end)))
    length = float(np.linalg.norm(across)) or 0.5 * motion.size
    across = (
        across / length if np.linalg.norm(across) > 0.0 else np.array(axis_triad(unit_axis("axis", way))[0])
    )
    normal_of_angle = pin.AngleAxis(at, way).toRotationMatrix() @ across
    turn = pin.Quaternion.FromTwoVectors(z, normal_of_angle).matrix()
    bar = Shape("capsule", (0.5 * thick, 0.5 * length))
    return Visual(name, parent, base * pin.SE3(turn, 0.55 * length * normal_of_angle), bar, STOP)
