"""Where contacts touch in a run, and along which normals: from the rows that the core makes of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.kinematics import frame_on_joint
from pin_nonideal.types import Array

from .frames import Motion
from .markers import Mark

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Touch:
    """A contact between two frames, as the frames of a replay show it.

    Attributes:
        name: its unique name.
        item: its description.
        joint: index of the joint that carries the body it presses, 0 for the world.
        other: index of the joint that carries what it presses against.
        place: where it touches that body in the world [m], (n, 3).
        normal: along which it presses that body, unit, in world axes, (n, 3).
        closed: whether it is closed, (n,).
    """

    name: str
    item: Any
    joint: int
    other: int
    place: Array
    normal: Array
    closed: NDArray[np.bool_]

    @property
    def on_plane(self) -> bool:
        """Whether it touches a plane, and so has a place on its body however far the plane is."""
        return hasattr(self.item, "plane")


def touches_of(run: Trajectory, motion: Motion) -> list[Touch]:
    """The contacts between two frames: all with planes, and of others those that touched.

    A contact is closed from a sample to the next.  One that strikes and flies off between two samples is told
    by its event.

    Args:
        run: the run.
        motion: its motion.
    """
    compiled = compiled_scene(run.scene)
    names = [compiled.program.constraints[block].name for block in compiled.program.framed_contacts]
    struck = {str(event.element) for event in run.events}
    closed = {name: _closed(run, name) for name in names}
    chosen = [
        k
        for k, name in enumerate(names)
        if hasattr(compiled.described[name], "plane") or name in struck or closed[name].any()
    ]
    lines = _pressing_lines(run, motion, chosen)
    return [
        _touch(run, names[k], lines[:, column], closed[names[k]][motion.before])
        for column, k in enumerate(chosen)
    ]


def _closed(run: Trajectory, name: str) -> NDArray[np.bool_]:
    """Whether a contact is closed at each sample."""
    closed = getattr(run, "closed", None)
    if closed is None:
        return np.ones(len(run.t), dtype=bool)
    return np.asarray(closed)[:, run.scene.contact_names.index(name)]


def _pressing_lines(run: Trajectory, motion: Motion, chosen: list[int]) -> Array:
    """A point of the line along which each contact presses, and its normal, at each frame, (n, k, 6)."""
    if not chosen:
        return np.zeros((len(motion.times), 0, 6))
    runner, still = compiled_scene(run.scene).program.runner(), np.zeros(run.scene.model.nv)
    states = zip(motion.q, motion.times, strict=True)
    return np.array([runner.pressing_lines(q, still, float(t)).reshape(-1, 6)[chosen] for q, t in states])


def _touch(run: Trajectory, name: str, line: Array, closed: NDArray[np.bool_]) -> Touch:
    """A contact on its line: the surface of what has a radius lies so far from the point of its row."""
    item: Any = compiled_scene(run.scene).described[name]
    frames = (item.frame, item.plane) if hasattr(item, "plane") else (item.frame1, item.frame2)
    joint, other = (0 if frame is None else frame_on_joint(run.scene.model, frame)[0] for frame in frames)
    radius = getattr(item, "radius1", getattr(item, "radius", 0.0))
    return Touch(name, item, joint, other, line[:, :3] - radius * line[:, 3:], line[:, 3:], closed)


def touching_marks(touches: list[Touch], motion: Motion, marks: list[Mark]) -> list[Mark]:
    """Marks of the contacts that have none yet, because their places move over their bodies.

    Args:
        touches: the contacts.
        motion: the motion.
        marks: of the scene.
    """
    marked, found = {mark.name for mark in marks}, []
    for touch in touches:
        if touch.name not in marked:
            path = motion.local(touch.joint, touch.place)
            closed = None if touch.on_plane or touch.closed.all() else touch.closed
            start = path[int(np.argmax(touch.closed))]
            found.append(
                Mark(touch.name, "contact", touch.joint, start, touch.joint, start, path=path, closed=closed)
            )
    return found
