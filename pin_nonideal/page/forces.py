"""What the replay shows of constraints: marks where bodies meet, and arrows of the forces there.

The arrow at an anchor is the reaction on the body of frame1, from the anchor's rows of `lam`, split by
`lam_ideal` into its ideal and its nonideal part.  `F_nonideal` is drawn at the joints of one degree of
freedom; so is `F_ideal` when no constraint has a place of its own (those of a user have none).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.checks import axis_triad, unit_axis
from pin_nonideal.core import core
from pin_nonideal.forces import SpringDamper
from pin_nonideal.states.placements import frame_on_joint, joint_placements
from pin_nonideal.types import Array

from .geometry import joint_axis
from .motion import Motion

if TYPE_CHECKING:
    from pin_nonideal.scene import Scene
    from pin_nonideal.trajectory import Trajectory


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


@dataclass(frozen=True)
class _Side:
    """One side of a constraint: a placement fixed to a joint."""

    joint: int
    placement: pin.SE3

    @property
    def point(self) -> Array:
        return np.asarray(self.placement.translation)

    def turned(self, motion: Motion, local: Array) -> Array:
        """Vectors in the axes of this side as vectors in world axes, (n, 3)."""
        turn = motion.rotation(self.joint) @ np.asarray(self.placement.rotation)
        return np.asarray(np.einsum("nij,nj->ni", turn, local))


def marks_of(scene: Scene) -> list[Mark]:
    """Marks of all anchors, rods, contacts and springs of a scene."""
    marks = []
    for name, item, shown in _constraints(scene):
        if shown == core.Shown.contact:
            side = _side(scene.model, item.frame)
            marks.append(Mark(name, "contact", side.joint, side.point, side.joint, side.point))
        elif shown in (core.Shown.anchor, core.Shown.rod):
            marks.append(_tie(scene, name, shown.name, item))
    springs = [item for item in scene.forces if isinstance(item, SpringDamper)]
    return marks + [_tie(scene, item.name or f"spring {item.frame1}", "spring", item) for item in springs]


def _tie(scene: Scene, name: str, kind: str, item: Any) -> Mark:
    """The mark of what ties two frames."""
    first, second = _sides(scene, item)
    return Mark(name, kind, first.joint, first.point, second.joint, second.point)


def _constraints(scene: Scene) -> list[tuple[str, Any, core.Shown]]:
    """Constraints and contacts with the names of their rows, and what the core says is shown of them."""
    known = [c.shown for c in scene._compiled.program.constraints]
    return list(zip(scene.constraint_slices, [*scene.constraints, *scene.contacts], known, strict=True))


def _side(model: pin.Model, frame: str) -> _Side:
    return _Side(*frame_on_joint(model, frame))


def _sides(scene: Scene, item: Any) -> tuple[_Side, _Side]:
    """Both sides of what ties two frames."""
    model = scene.model
    if hasattr(item, "joint1_placement"):  # a constraint model of Pinocchio
        return (
            _Side(int(item.joint1_id), item.joint1_placement),
            _Side(int(item.joint2_id), item.joint2_placement),
        )
    first = _side(model, item.frame1)
    if item.frame2 is not None:
        return first, _side(model, item.frame2)
    here = joint_placements(model, scene.q0)[first.joint].act(first.point)
    return first, _Side(0, pin.SE3(np.eye(3), here))


def arrows_of(run: Trajectory, motion: Motion, marks: list[Mark]) -> list[Arrow]:
    """Arrows of the forces that the run recorded; none without record "forces"."""
    arrows: list[Arrow] = []
    if run.lam is not None:
        for name, item, shown in _constraints(run.scene):
            rows = run.scene.constraint_slices[name]
            parts = {"total": motion.of(run.lam[:, rows])}
            if run.lam_ideal is not None:
                ideal = motion.of(run.lam_ideal[:, rows])
                rest = parts["total"] - ideal
                acts = np.abs(rest).max(initial=0.0) > SMALLEST * np.abs(ideal).max(initial=0.0)
                parts = {"ideal": ideal} | ({"nonideal": rest} if acts else {})
            for kind, lam in parts.items():
                arrows += _reaction(run.scene, motion, name, kind, item, shown, lam)
    drawn = [("nonideal", run.F_nonideal)]
    if not arrows:
        drawn.append(("ideal", run.F_ideal))
    for kind, force in drawn:
        if force is None:
            continue
        joints = motion.of(force)
        largest = float(np.abs(joints).max(initial=0.0))
        for joint in range(1, run.scene.model.njoints):
            values = joints[:, run.scene.model.joints[joint].idx_v]
            if np.abs(values).max() > SMALLEST * largest:
                arrows += _at_joint(run.scene.model, motion, None, kind, joint, values)
    return arrows


def _reaction(
    scene: Scene, motion: Motion, name: str, kind: str, item: Any, shown: core.Shown, lam: Array
) -> list[Arrow]:
    """Arrows of one constraint: the force on its first body, or the force on its joints."""
    model = scene.model
    if shown in (core.Shown.anchor, core.Shown.rod):
        return [Arrow(name, kind, "N", *_between(scene, motion, item, shown, lam))]
    if shown in (core.Shown.rolling, core.Shown.contact):
        return [Arrow(name, kind, "N", *_on_plane(model, motion, item, lam))]
    if shown == core.Shown.edge:
        edge = _side(model, item.frame)
        force = edge.turned(motion, lam[:, :1] * np.array(unit_axis("axis", item.axis)))
        return [Arrow(name, kind, "N", force, motion.point(edge.joint, edge.point))]
    if shown == core.Shown.drive:
        return _at_joint(model, motion, name, kind, model.getJointId(item.joint), lam[:, 0])
    if shown == core.Shown.gear:
        driven = _at_joint(model, motion, name, kind, model.getJointId(item.joint1), lam[:, 0])
        leading = _at_joint(model, motion, name, kind, model.getJointId(item.joint2), -item.ratio * lam[:, 0])
        return driven + leading
    return []


def _between(scene: Scene, motion: Motion, item: Any, shown: core.Shown, lam: Array) -> tuple[Array, Array]:
    """Force on the first of two frames that are tied, and the place of that frame, (n, 3) each."""
    first, second = _sides(scene, item)
    origin = motion.point(first.joint, first.point)
    if shown == core.Shown.rod:
        return lam[:, :1] * _unit(origin - motion.point(second.joint, second.point)), origin
    axes = ["xyz".index(axis) for axis in getattr(item, "axes", "xyz")]
    local = np.zeros((len(lam), 3))
    local[:, axes] = lam[:, : len(axes)]
    return second.turned(motion, local), origin


def _on_plane(model: pin.Model, motion: Motion, item: Any, lam: Array) -> tuple[Array, Array]:
    """Force on what touches a plane, and the place where it touches, (n, 3) each."""
    t1, t2, normal = (np.array(axis) for axis in axis_triad(unit_axis("normal", item.normal)))
    local = lam[:, -1:] * normal
    if lam.shape[1] == 3:
        local = local + lam[:, :1] * t1 + lam[:, 1:2] * t2
    body = _side(model, item.frame)
    plane = _Side(0, pin.SE3.Identity()) if item.plane is None else _side(model, item.plane)
    up = plane.turned(motion, np.tile(normal, (len(lam), 1)))
    if getattr(item, "axis", None) is not None:  # a disk: its lowest point
        axis = body.turned(motion, np.tile(unit_axis("axis", item.axis), (len(lam), 1)))
        up = _unit(up - np.sum(up * axis, axis=1, keepdims=True) * axis)
    return plane.turned(motion, local), motion.point(body.joint, body.point) - item.radius * up


def _unit(vectors: Array) -> Array:
    """Vectors of length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0))


def _at_joint(
    model: pin.Model, motion: Motion, name: str | None, kind: str, joint: int, values: Array
) -> list[Arrow]:
    """Generalized force on a joint of one degree of freedom, along or about its axis; else nothing."""
    axis, turning = joint_axis(model, joint)
    if axis is None:
        return []
    name = name or str(model.names[joint])
    if turning:
        return [Arrow(name, kind, "N m", values, joint=int(joint), axis=axis)]
    along = motion.rotation(joint) @ axis
    return [Arrow(name, kind, "N", along * values[:, None], motion.poses[:, joint, :3])]
