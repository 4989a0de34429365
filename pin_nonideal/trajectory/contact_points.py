"""Contact points over a run: bodies, positions, normals and forces, and the resultants of pairs of shapes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.kinematics import frame_on_joint
from pin_nonideal.types import Array
from pin_nonideal.validation import text

from .fields import RunFields
from .records import ContactRecord

NUMBER = re.compile(r" \d+$")  # end of the name of one point of a pair of shapes


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


def contact_bodies(scene: Scene, name: str) -> ContactBodies:
    """Return the bodies of a contact between two frames.

    Args:
        scene: the scene.
        name: name of the contact.
    """
    item: Any = compiled_scene(scene).described[name]
    frames = (item.frame, item.plane) if hasattr(item, "plane") else (item.frame1, item.frame2)
    joint, other = (0 if frame is None else frame_on_joint(scene.model, frame)[0] for frame in frames)
    return ContactBodies(joint, other, getattr(item, "radius1", getattr(item, "radius", 0.0)))


def contact_lines(scene: Scene, q: Array, t: Array, names: Sequence[str]) -> tuple[Array, Array]:
    """Return contact points [m] and unit normals of contacts in world axes, (n, contacts, 3) each.

    Args:
        scene: the scene.
        q: configurations, (n, nq).
        t: times [s], (n,).
        names: names of contacts between two frames.
    """
    if not names:
        return np.zeros((len(t), 0, 3)), np.zeros((len(t), 0, 3))
    compiled = compiled_scene(scene)
    blocks = {compiled.block_names[block]: block for block in compiled.program.framed_contacts}
    lines = core.action_lines(compiled.program, q, t, [blocks[name] for name in names])
    lines = lines.reshape(len(t), len(names), 6)
    radii = np.array([contact_bodies(scene, name).radius for name in names])
    return lines[..., :3] - radii[:, None] * lines[..., 3:], lines[..., 3:]


def contact_record(run: RunFields, name: str) -> ContactRecord:
    """Return the record of one contact, or of all points of a pair of shapes; see `Trajectory.contact`."""
    name = text("contact: name", name)
    if run.scene is None:
        raise InputError(f'contact("{name}") needs the scene of the run, which this one has lost')
    if not run.recorded("contact_forces"):
        raise InputError(f'contact("{name}") needs a run with record="forces"')
    scene, framed = run.scene, run.contact_forces or {}
    points = [name] if name in framed else [key for key in framed if is_point_of(name, key)]
    if not points:
        if name in scene.contact_names:
            raise InputError(f'contact("{name}") has no contact point; see run.force("{name}")')
        known = {NUMBER.sub("", key): key for key in framed}
        raise UnknownNameError(f'no contact "{name}" in this run{nearest(name, [*framed, *known])}')
    bodies = [contact_bodies(scene, key) for key in points]
    joint, other = bodies[0].joint, bodies[0].other
    if len({frozenset(body[:2]) for body in bodies}) > 1:
        raise InputError(
            f'contact("{name}") must name the points of two bodies; "{points[0]}" and others are on several '
            "bodies: name one of them"
        )
    if len(points) > 1:  # some points of two boxes are on the first box and others on the second
        joint, other = max(joint, other), min(joint, other)
    sign = np.array([1.0 if body.joint == joint else -1.0 for body in bodies])
    forces = np.stack([framed[key] for key in points], axis=1) * sign[:, None]
    loads = np.stack([run.lam[:, run.rows[key][1] - 1] for key in points], axis=1)
    places, _ = contact_lines(scene, np.asarray(run.q, dtype=float), run.t, points)
    total = loads.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        center = np.einsum("ik,ikj->ij", loads, places) / total[:, None]
    levers = places - np.where(np.isfinite(center), center, 0.0)[:, None]
    columns = {key: k for k, key in enumerate(scene.contact_names)}
    closed: NDArray[np.bool_] = np.ones((len(run.t), len(points)), dtype=bool)
    if run.closed is not None:
        closed = run.closed[:, [columns[key] for key in points]]
    return ContactRecord(
        name=name,
        points=points,
        bodies=(str(scene.model.names[joint]), str(scene.model.names[other])),
        closed=np.any(closed, axis=1),
        force=forces.sum(axis=1),
        torque=np.cross(levers, forces).sum(axis=1),
        normal_force=total,
        center=center,
        gap=_gaps(run, points).min(axis=1),
    )


def is_point_of(pair: str, name: str) -> bool:
    """Check if a contact is a numbered point of a pair of shapes.

    Args:
        pair: name of a `GeometryContact`.
        name: name of a contact.
    """
    return name.startswith(pair) and NUMBER.fullmatch(name, len(pair)) is not None


def _gaps(run: RunFields, names: Sequence[str]) -> Array:
    """Return the gaps of contacts at each sample [m], (nt, n)."""
    compiled = compiled_scene(run.scene)
    blocks = {name: block for block, name in enumerate(compiled.block_names)}
    q = np.ascontiguousarray(run.q, dtype=float)
    return np.asarray(core.gap_values(compiled.program, q, run.t, [blocks[name] for name in names]))
