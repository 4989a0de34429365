"""Marks where bodies meet: the places of anchors, rods, contacts and springs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts import PointContact
from pin_nonideal.description.forces import SpringDamper
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.kinematics import frame_on_joint, joint_placements
from pin_nonideal.types import Array

from .frames import Motion


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
        axes: unit vectors in the second joint's frame along which the points must coincide, (k, 3).
        path: of a place that moves over its body, where it is in the first joint's frame at each frame of the
            replay [m], (n, 3); None of one that stays.
        closed: while what is drawn, of a contact whose place means nothing while it is open, (n,); None for
            always.
    """

    name: str
    kind: str
    joint1: int
    point1: Array
    joint2: int
    point2: Array
    axes: Array = field(default_factory=lambda: np.zeros((0, 3)))
    path: Array | None = None
    closed: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Side:
    """One side of a constraint: a placement fixed to a joint.

    Attributes:
        joint: its index, 0 for the world.
        placement: in the joint's frame.
    """

    joint: int
    placement: pin.SE3

    @property
    def point(self) -> Array:
        """Its origin in the joint's frame [m], (3,)."""
        return np.asarray(self.placement.translation)

    def turned(self, motion: Motion, local: Array) -> Array:
        """Vectors in the axes of this side as vectors in world axes, (n, 3).

        Args:
            motion: the motion.
            local: the vectors, (n, 3).
        """
        turn = motion.rotation(self.joint) @ np.asarray(self.placement.rotation)
        return np.asarray(np.einsum("nij,nj->ni", turn, local))


def marks_of(scene: Scene) -> list[Mark]:
    """Marks of all anchors, rods, points and spheres on planes, and springs of a scene.

    Args:
        scene: the scene.
    """
    marks = []
    for name, item, shown in constraints_of(scene):
        if isinstance(item, PointContact):
            side = side_of(scene.model, item.frame)
            point = side.placement.act(np.array(item.offset))
            marks.append(Mark(name, "contact", side.joint, point, side.joint, point))
        elif shown in (core.Shown.anchor, core.Shown.rod):
            marks.append(_tie(scene, name, shown.name, item))
    springs = [item for item in scene.forces if isinstance(item, SpringDamper)]
    return marks + [_tie(scene, item.name or f"spring {item.frame1}", "spring", item) for item in springs]


def _tie(scene: Scene, name: str, kind: str, item: Any) -> Mark:
    """The mark of what ties two frames."""
    first, second = sides_of(scene, item)
    held = ["xyz".index(axis) for axis in getattr(item, "axes", "xyz")] if kind == "anchor" else []
    axes = np.asarray(second.placement.rotation).T[held]
    return Mark(name, kind, first.joint, first.point, second.joint, second.point, axes)


def constraints_of(scene: Scene) -> list[tuple[str, Any, core.Shown]]:
    """Constraints and contacts with the names of their rows, and what the core says is shown of them.

    Args:
        scene: the scene.
    """
    compiled = compiled_scene(scene)
    shown = {c.name: c.shown for c in compiled.program.constraints}
    return [(name, compiled.described[name], shown[name]) for name in scene.constraint_slices]


def side_of(model: pin.Model, frame: str) -> Side:
    """The side of a frame.

    Args:
        model: the model.
        frame: name.
    """
    return Side(*frame_on_joint(model, frame))


def sides_of(scene: Scene, item: Any) -> tuple[Side, Side]:
    """Both sides of what ties two frames.

    Args:
        scene: the scene.
        item: the constraint, contact or spring.
    """
    model = scene.model
    if hasattr(item, "joint1_placement"):  # a constraint model of Pinocchio
        return (
            Side(int(item.joint1_id), item.joint1_placement),
            Side(int(item.joint2_id), item.joint2_placement),
        )
    first = side_of(model, item.frame1)
    if item.frame2 is not None:
        return first, side_of(model, item.frame2)
    here = joint_placements(model, scene.q0)[first.joint].act(first.point)
    return first, Side(0, pin.SE3(np.eye(3), here))
