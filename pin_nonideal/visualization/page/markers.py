"""Marks of anchors, rods, contacts and springs at their points of action."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts import PointContact
from pin_nonideal.description.forces import SpringDamper
from pin_nonideal.states.kinematics import frame_on_joint, joint_placements
from pin_nonideal.types import Array

from .frames import Motion

# Name of the rows of a constraint, its description, and its display kind.
Constraint = tuple[str, Any, core.DisplayKind]


@dataclass(frozen=True)
class Mark:
    """Two points that a constraint or a spring connects.

    Attributes:
        name: name of the constraint, contact or force.
        kind: "anchor", "rod", "spring" or "contact".
        joint1: index of the joint that carries the first point, 0 for the world.
        point1: first point in that joint's frame [m], (3,).
        joint2: index of the joint that carries the second point.
        point2: second point in that joint's frame [m], (3,).
        axes: unit vectors in the second joint's frame along which the points must coincide, (k, 3).
        path: positions of a moving first point in the first joint's frame at each frame of the replay [m],
            (n, 3); None for a fixed point.
        closed: whether a contact mark is drawn at each frame, (n,), if the point is undefined for an open
            contact; None to draw it always.
        contact: name of the contact of a contact point, as events have it; empty for other marks.
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
    contact: str = ""


@dataclass(frozen=True)
class Side:
    """Side of a constraint: a placement fixed to a joint.

    Attributes:
        joint: index of the joint, 0 for the world.
        placement: placement in the joint's frame.
    """

    joint: int
    placement: pin.SE3

    @property
    def point(self) -> Array:
        """Return the origin of the side in the joint's frame [m], (3,)."""
        return np.asarray(self.placement.translation)

    def turned(self, motion: Motion, local: Array) -> Array:
        """Transform vectors from the axes of this side to world axes, (n, 3).

        Args:
            motion: motion of the run.
            local: vectors in the axes of this side, (n, 3).
        """
        turn = motion.rotation(self.joint) @ np.asarray(self.placement.rotation)
        return np.asarray(np.einsum("nij,nj->ni", turn, local))


def marks_of(compiled: CompiledScene, held: Sequence[Constraint] | None = None) -> list[Mark]:
    """Return the marks of all anchors, rods, points and spheres on planes, and springs of a scene.

    Args:
        compiled: compiled scene of the run.
        held: its constraints, if they are known.
    """
    marks = [
        _tie(compiled, name, shown.name, item)
        for name, item, shown in (constraints_of(compiled) if held is None else held)
        if shown in (core.DisplayKind.anchor, core.DisplayKind.rod)
    ]
    for name, item in compiled.described.single():
        if isinstance(item, PointContact):
            side = side_of(compiled.model, item.frame)
            point, contact = side.placement.act(np.array(item.offset)), compiled.contact_of.get(name, name)
            marks.append(Mark(name, "contact", side.joint, point, side.joint, point, contact=contact))
    springs = [item for item in compiled.spec.forces if isinstance(item, SpringDamper)]
    return marks + [_tie(compiled, item.name or f"spring {item.frame1}", "spring", item) for item in springs]


def _tie(compiled: CompiledScene, name: str, kind: str, item: Any) -> Mark:
    """Return the mark of a connection of two frames."""
    first, second = sides_of(compiled, item)
    held = ["xyz".index(axis) for axis in getattr(item, "axes", "xyz")] if kind == "anchor" else []
    axes = np.asarray(second.placement.rotation).T[held]
    return Mark(name, kind, first.joint, first.point, second.joint, second.point, axes)


def constraints_of(compiled: CompiledScene) -> list[Constraint]:
    """Return the constraints with the names of their rows and their display kinds from the core.

    Contacts that are drawn at their points are left out.

    Args:
        compiled: compiled scene of the run.
    """
    kinds = ((c.name, c.shown) for c in compiled.program.constraints)
    shown = {name: kind for name, kind in kinds if kind != core.DisplayKind.contact}
    return [(name, compiled.described[name], shown[name]) for name in compiled.rows if name in shown]


def side_of(model: pin.Model, frame: str) -> Side:
    """Return the side of a frame.

    Args:
        model: model of the scene.
        frame: name of the frame.
    """
    return Side(*frame_on_joint(model, frame))


def sides_of(compiled: CompiledScene, item: Any) -> tuple[Side, Side]:
    """Return both sides of a connection of two frames.

    Args:
        compiled: compiled scene of the run.
        item: constraint, contact or spring.
    """
    model = compiled.model
    if hasattr(item, "joint1_placement"):  # constraint model of Pinocchio
        return (
            Side(int(item.joint1_id), item.joint1_placement),
            Side(int(item.joint2_id), item.joint2_placement),
        )
    first = side_of(model, item.frame1)
    if item.frame2 is not None:
        return first, side_of(model, item.frame2)
    placement = joint_placements(model, compiled.q0)[first.joint].act(first.point)
    return first, Side(0, pin.SE3(np.eye(3), placement))
