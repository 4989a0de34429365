"""Contact points of the core: bodies, positions, normals and gaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.states.kinematics import frame_on_joint
from pin_nonideal.types import Array


class ContactBodies(NamedTuple):
    """Bodies of a contact between two frames.

    Attributes:
        joint: index of the joint of the body on which the contact force acts, 0 for the world.
        other: index of the joint of the other body.
        radius: distance of the contact point from the point of the row, against the normal [m].
    """

    joint: int
    other: int
    radius: float


def contact_bodies(compiled: CompiledScene, name: str) -> ContactBodies:
    """Return the bodies of a contact between two frames.

    The force of a pair of shapes with several points acts on the body of the later joint of the model, since
    some points of two boxes are on the first box and others on the second.

    Args:
        compiled: the compiled scene.
        name: name of a contact, or of a point of a pair of shapes.
    """
    if name in compiled.points:
        joints = contact_bodies(compiled, compiled.points[name][0])[:2]
        return ContactBodies(max(joints), min(joints), 0.0)
    item = compiled.described[name]
    first, second = ("frame", "plane") if hasattr(item, "plane") else ("frame1", "frame2")
    frames = getattr(item, first), getattr(item, second)
    joint, other = (0 if frame is None else frame_on_joint(compiled.model, frame)[0] for frame in frames)
    return ContactBodies(joint, other, getattr(item, "radius1", getattr(item, "radius", 0.0)))


def side_of_point(compiled: CompiledScene, name: str) -> float:
    """Return 1 if the forces of a point and of its contact act on the same body, else -1.

    Args:
        compiled: the compiled scene.
        name: name of the point, or of a contact of one point.
    """
    contact = compiled.contact(name)
    return 1.0 if contact_bodies(compiled, contact).joint == contact_bodies(compiled, name).joint else -1.0


def contact_lines(compiled: CompiledScene, q: Array, t: Array, names: Sequence[str]) -> tuple[Array, Array]:
    """Return contact points [m] and unit normals of contacts in world axes, (n, contacts, 3) each.

    Args:
        compiled: the compiled scene.
        q: configurations, (n, nq).
        t: times [s], (n,).
        names: names of points or contacts of one point between two frames.
    """
    if not names:
        return np.zeros((len(t), 0, 3)), np.zeros((len(t), 0, 3))
    blocks = {compiled.block_names[block]: block for block in compiled.program.framed_contacts}
    lines = core.action_lines(compiled.program, q, t, [blocks[name] for name in names])
    lines = lines.reshape(len(t), len(names), 6)
    radii = np.array([contact_bodies(compiled, name).radius for name in names])
    return lines[..., :3] - radii[:, None] * lines[..., 3:], lines[..., 3:]


def slip_axes(compiled: CompiledScene, q: Array, t: float, elements: Sequence[int]) -> Array:
    """Return the slip directions of friction elements of two directions in world axes, (elements, 2, 3).

    Friction forces push the body of the force of their contact along these directions.

    Args:
        compiled: the compiled scene.
        q: configuration, (nq,).
        t: time [s].
        elements: indices of the elements in the core's program, each of a point of a pair of shapes.
    """
    program = compiled.program
    axes = core.slip_axes(program, np.ascontiguousarray(q[None]), np.array([t]), list(elements))
    sides = [side_of_point(compiled, compiled.element_names[e]) for e in elements]
    return np.asarray(axes.reshape(-1, 2, 3) * np.reshape(sides, (-1, 1, 1)))


def gaps_of_points(compiled: CompiledScene, q: Array, t: Array, names: Sequence[str]) -> Array:
    """Return the gaps of contacts [m or rad], (n, contacts).

    Args:
        compiled: the compiled scene.
        q: configurations, (n, nq).
        t: times [s], (n,).
        names: names of points or contacts of one point.
    """
    blocks = {name: block for block, name in enumerate(compiled.block_names)}
    q = np.ascontiguousarray(q, dtype=float)
    return np.asarray(core.gap_values(compiled.program, q, t, [blocks[name] for name in names]))
