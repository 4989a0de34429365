"""Contact points and normals in a run, from the rows of the core."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.trajectory.columns import open_contacts
from pin_nonideal.trajectory.contact_points import contact_bodies, contact_lines
from pin_nonideal.types import Array

from .frames import Motion
from .markers import Mark

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class ContactPoint:
    """Contact point between two frames at the frames of a replay.

    Attributes:
        name: unique name of the point.
        contact: name of its contact.
        item: description of the contact at the point.
        joint: index of the joint of the body on which the contact force acts, 0 for the world.
        other: index of the joint of the other body.
        place: contact point on that body in the world [m], (n, 3).
        normal: unit normal of the force on that body, in world axes, (n, 3).
        closed: whether the contact is closed, (n,).
    """

    name: str
    contact: str
    item: Any
    joint: int
    other: int
    place: Array
    normal: Array
    closed: NDArray[np.bool_]

    @property
    def on_plane(self) -> bool:
        """Check if the contact is with a plane, so that its point is defined at any distance."""
        return hasattr(self.item, "plane")


def contact_points(run: Trajectory, motion: Motion) -> list[ContactPoint]:
    """Return the contact points between two frames: all points on planes, and others that were closed.

    The state of a contact holds from a sample to the next. Impacts between two samples are found from their
    events.

    Args:
        run: run of the replay.
        motion: motion of the run.
    """
    compiled = compiled_scene(run.scene)
    names = [compiled.block_names[block] for block in compiled.program.framed_contacts]
    struck, points = {str(event.element) for event in run.events}, getattr(run, "points", None)
    touched = set() if points is None else set(points.names)
    single = set(run.scene.contact_names).difference(compiled.points)
    touched |= single.intersection(names) - (open_contacts(run) - struck)
    on_planes = {name for name, item in compiled.described.single() if hasattr(item, "plane")}
    chosen = [k for k, name in enumerate(names) if name in on_planes or name in touched]
    chosen_names = [names[k] for k in chosen]
    places, normals = contact_lines(compiled, motion.q, motion.times, chosen_names)
    closed = _closed_mask(run, chosen_names)
    return [
        ContactPoint(
            name,
            compiled.contact(name),
            compiled.described[name],
            *contact_bodies(compiled, name)[:2],
            places[:, column],
            normals[:, column],
            closed[motion.before, column],
        )
        for column, name in enumerate(chosen_names)
    ]


def _closed_mask(run: Trajectory, names: list[str]) -> NDArray[np.bool_]:
    """Check if contact points are closed at each sample, (nt, n)."""
    closed, points = getattr(run, "closed", None), getattr(run, "points", None)
    if closed is None:
        return np.ones((len(run.t), len(names)), dtype=bool)
    column = {name: np.asarray(closed)[:, k] for k, name in enumerate(run.scene.contact_names)}
    if points is not None:
        column |= {name: points.closed[:, k] for k, name in enumerate(points.names)}
    still_open = np.zeros(len(run.t), dtype=bool)
    columns = [column.get(name, still_open) for name in names]
    return np.asarray(np.array(columns, dtype=bool).reshape(len(names), len(run.t)).T)


def contact_point_marks(touches: list[ContactPoint], motion: Motion, marks: list[Mark]) -> list[Mark]:
    """Return marks of contact points without a mark, because they move over their bodies.

    Args:
        touches: contacts of the run.
        motion: motion of the run.
        marks: marks of the scene.
    """
    marked, points = {mark.name for mark in marks}, []
    for touch in touches:
        if touch.name not in marked:
            path = motion.local(touch.joint, touch.place)
            closed = None if touch.on_plane or touch.closed.all() else touch.closed
            start = path[int(np.argmax(touch.closed))]
            mark = Mark(touch.name, "contact", touch.joint, start, touch.joint, start, path=path)
            points.append(replace(mark, closed=closed, contact=touch.contact))
    return points
