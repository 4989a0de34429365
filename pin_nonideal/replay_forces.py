"""What the replay shows of constraints: marks where bodies meet, and arrows of the forces there.

The arrow at an anchor is the reaction on the body of frame1, from the anchor's rows of `lam`; when the run
holds `lam_ideal` as well it is split into its ideal and its nonideal part.  `F_nonideal` (and, in a scene
without anchors, `F_ideal`) is drawn at the joints of one degree of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .checks import axis_triad, unit_axis
from .constraints import Distance, FrameAnchor, HingeAnchor, PointAnchor, Rolling
from .contacts import PointContact
from .forces import SpringDamper
from .replay_geometry import joint_axis
from .replay_motion import Motion

if TYPE_CHECKING:
    from .scene import Scene
    from .trajectory import Trajectory

Array = NDArray[np.float64]

# A generalized force below this part of the largest one is rounding and gets no arrow.
SMALLEST = 1e-9


@dataclass(frozen=True)
class Mark:
    """Two points that a constraint or a spring ties together.

    Attributes:
        name: name of the constraint, contact or force.
        kind: "anchor", "rod", "spring" or "contact".
        joint1: index of the joint that carries the first point, 0 for the world.
        point1: the point in that joint's frame [m], (3,).
        joint2: index of the joint that carries the second point.
        point2: the second point [m], (3,).
    """

    name: str
    kind: str
    joint1: int
    point1: Array
    joint2: int
    point2: Array


@dataclass(frozen=True)
class Arrow:
    """A force that the replay draws.

    Attributes:
        name: name of the constraint or joint.
        kind: "total", "ideal" or "nonideal".
        unit: "N" or "N m"; a moment is drawn as an arc about its axis.
        values: force in world axes, (n, 3), or moment about the axis, (n,).
        origin: where a force acts in the world [m], (n, 3); None for a moment.
        joint: index of the joint of a moment, which acts at the joint's origin.
        axis: axis of a moment in the joint's frame, (3,); None for a force.
    """

    name: str
    kind: str
    unit: str
    values: Array
    origin: Array | None = None
    joint: int = 0
    axis: Array | None = None


def marks_of(scene: Scene) -> list[Mark]:
    """Marks of all anchors, rods, contacts and springs of a scene."""
    marks = []
    for name, item in _named(scene):
        if isinstance(item, (PointAnchor, FrameAnchor, HingeAnchor)):
            marks.append(_mark(scene, name, "anchor", item.frame1, item.frame2))
        elif isinstance(item, Distance):
            marks.append(_mark(scene, name, "rod", item.frame1, item.frame2))
        elif isinstance(item, SpringDamper):
            marks.append(_mark(scene, name, "spring", item.frame1, item.frame2))
        elif isinstance(item, PointContact):
            joint, point = _place(scene.model, item.frame)
            marks.append(Mark(name, "contact", joint, point, joint, point))
    return marks


def _named(scene: Scene) -> list[tuple[str, Any]]:
    """Constraints, contacts and forces with the names that they go by."""
    items = [*scene.constraints, *scene.contacts, *scene.forces]
    return [(getattr(item, "name", None) or type(item).__name__, item) for item in items]


def _place(model: pin.Model, frame: str) -> tuple[int, Array]:
    """Joint that carries a frame, and the frame's origin in the joint's frame."""
    found = model.frames[model.getFrameId(frame)]
    return int(found.parentJoint), np.asarray(found.placement.translation)


def _mark(scene: Scene, name: str, kind: str, frame1: str, frame2: str | None) -> Mark:
    model = scene.model
    joint1, point1 = _place(model, frame1)
    if frame2 is not None:
        return Mark(name, kind, joint1, point1, *_place(model, frame2))
    data = model.createData()
    pin.framesForwardKinematics(model, data, scene.q0)
    return Mark(name, kind, joint1, point1, 0, np.array(data.oMf[model.getFrameId(frame1)].translation))


def arrows_of(run: Trajectory, motion: Motion, marks: list[Mark]) -> list[Arrow]:
    """Arrows of the forces that the run recorded; none without record "forces"."""
    arrows: list[Arrow] = []
    if run.lam is not None and len(run.lam):
        ideal = getattr(run, "lam_ideal", None)
        for name, item in _named(run.scene):
            rows = run.scene.constraint_slices.get(name)
            if rows is None:
                continue
            total = motion.of(np.asarray(run.lam)[:, rows])
            parts = {"total": total}
            if ideal is not None:
                part = motion.of(np.asarray(ideal)[:, rows])
                parts = {"ideal": part, "nonideal": total - part}
            for kind, lam in parts.items():
                arrows.extend(_reaction(run.scene, motion, name, kind, item, lam))
    drawn = [("nonideal", run.F_nonideal)]
    if not any(mark.kind in ("anchor", "rod") for mark in marks):
        drawn.append(("ideal", run.F_ideal))
    for kind, force in drawn:
        if force is not None and len(force):
            arrows.extend(_joint_forces(run.scene.model, motion, kind, motion.of(np.asarray(force))))
    return arrows


def _reaction(scene: Scene, motion: Motion, name: str, kind: str, item: Any, lam: Array) -> list[Arrow]:
    """The force of one constraint on the body of its first frame; none for constraints without a place."""
    model = scene.model
    if isinstance(item, (PointAnchor, FrameAnchor, HingeAnchor)):
        local = np.zeros((len(lam), 3))
        axes = ["xyz".index(axis) for axis in getattr(item, "axes", "xyz")]
        local[:, axes] = lam[:, : len(axes)]
        force = _turned(model, motion, item.frame2, local)
        return [Arrow(name, kind, "N", force, motion.point(*_place(model, item.frame1)))]
    if isinstance(item, Distance):
        mark = _mark(scene, name, "rod", item.frame1, item.frame2)
        origin = motion.point(mark.joint1, mark.point1)
        along = _unit(origin - motion.point(mark.joint2, mark.point2))
        return [Arrow(name, kind, "N", lam[:, :1] * along, origin)]
    if isinstance(item, (Rolling, PointContact)):
        t1, t2, normal = (np.array(axis) for axis in axis_triad(unit_axis("normal", item.normal)))
        local = lam[:, -1:] * normal
        if lam.shape[1] == 3:
            local = local + lam[:, :1] * t1 + lam[:, 1:2] * t2
        force = _turned(model, motion, item.plane, local)
        up = _turned(model, motion, item.plane, np.tile(normal, (len(lam), 1)))
        if isinstance(item, Rolling) and item.axis is not None:  # a disk: its lowest point
            axis = _turned(model, motion, item.frame, np.tile(item.axis, (len(lam), 1)))
            up = _unit(up - np.sum(up * axis, axis=1, keepdims=True) * axis)
        origin = motion.point(*_place(model, item.frame)) - item.radius * up
        return [Arrow(name, kind, "N", force, origin)]
    return []


def _unit(vectors: Array) -> Array:
    """Vectors of length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0))


def _turned(model: pin.Model, motion: Motion, frame: str | None, local: Array) -> Array:
    """Vectors in the axes of a frame as vectors in world axes, (n, 3)."""
    if frame is None:
        return local
    found = model.frames[model.getFrameId(frame)]
    turn = motion.rotation(int(found.parentJoint)) @ np.asarray(found.placement.rotation)
    return np.asarray(np.einsum("nij,nj->ni", turn, local))


def _joint_forces(model: pin.Model, motion: Motion, kind: str, force: Array) -> list[Arrow]:
    """Generalized force at each joint of one degree of freedom, along or about its axis."""
    arrows: list[Arrow] = []
    largest = float(np.abs(force).max(initial=0.0))
    for joint in range(1, model.njoints):
        axis, turning = joint_axis(model, joint)
        if axis is None:
            continue
        values = force[:, model.joints[joint].idx_v]
        if np.abs(values).max() <= SMALLEST * largest:
            continue
        name = str(model.names[joint])
        if turning:
            arrows.append(Arrow(name, kind, "N m", values, joint=joint, axis=axis))
        else:
            force_along = (motion.rotation(joint) @ axis) * values[:, None]
            arrows.append(Arrow(name, kind, "N", force_along, motion.poses[:, joint, :3]))
    return arrows
