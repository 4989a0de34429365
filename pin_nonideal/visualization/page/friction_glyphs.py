"""Friction elements at their positions: rings with mode and used part of the limit, and cones of contacts.

The arrows of contact forces, friction included, are in `force_arrows.py`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.kinematics import frame_on_joint
from pin_nonideal.trajectory.contact_points import contact_bodies
from pin_nonideal.types import Array
from pin_nonideal.validation import unit_axis

from .contact_points import ContactPoint
from .frames import Motion
from .markers import Mark
from .mode_timeline import bands_of, point_bands_of
from .visuals import joint_axis
from .xy_plots import friction_joints

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Element:
    """Friction element of the replay.

    Attributes:
        name: name of the element in the run.
        band: index among the modes of the run, followed by the modes of points of pairs of shapes.
        joint: index of the joint that carries the element's position, 0 for the world.
        point: position in that joint's frame [m], (3,), or at each frame, (n, 3), if it moves.
        axis: axis of the joint or normal of the contact, in the frame of `axis_joint`, (3,) or (n, 3).
        axis_joint: index of the joint that carries the axis.
        mu: friction coefficient, the ratio of the radius of the friction cone to its height; 0 for a joint.
        share: ratio of friction to its limit at each frame, 0 to 1, (n,), or None if it was not recorded.
        normal: normal force of a contact at each frame [N], (n,), or None.
        stays: whether the element is also drawn while its contact is open.
        contact: name of the contact of which the element is a point; empty for other elements.
    """

    name: str
    band: int
    joint: int
    point: Array
    axis: Array
    axis_joint: int
    mu: float = 0.0
    share: Array | None = None
    normal: Array | None = None
    stays: bool = True
    contact: str = ""


def elements_of(
    run: Trajectory, motion: Motion, marks: list[Mark], touches: Sequence[ContactPoint] = ()
) -> list[Element]:
    """Return the elements with a position: friction in joints and at anchors, and contacts.

    Args:
        run: run of the replay.
        motion: motion of the run.
        marks: marks of the scene.
        touches: contacts of the run.
    """
    joints, elements = friction_joints(run), []
    contacts = {touch.name: touch for touch in touches}
    bands, pairs = bands_of(run), {touch.contact for touch in touches if touch.name != touch.contact}
    places = {mark.name: mark for mark in marks}
    laws = dict(zip(run.element_names, run.element_laws, strict=False))
    counts = Counter(run.element_laws)
    for band, (name, _) in enumerate(point_bands_of(run), len(bands)):
        if name in contacts:
            point = _contact(run, motion, name, band, contacts[name], True)
            elements.append(replace(point, contact=contacts[name].contact))
    for band, (name, _) in enumerate(bands):
        law = run.law_names[laws[name]] if name in laws else name
        whole = name not in laws or counts[laws[name]] == 1
        if law in joints:
            at, share = joints[law], _joint_share(run, law, joints[law], run.element_names.index(name))
            axis, part = joint_axis(run.scene.model, at)[0], None if share is None else motion.of(share)
            elements.append(Element(name, band, at, np.zeros(3), np.asarray(axis), at, share=part))
        elif law in contacts and law not in pairs:
            elements.append(_contact(run, motion, name, band, contacts[law], whole))
        elif (mark := places.get(_anchor(run, law))) is not None:
            along = _hinge_axis(run, mark.name)
            elements.append(Element(name, band, mark.joint1, mark.point1, along, mark.joint1))
    return elements


def _anchor(run: Trajectory, law: str) -> str:
    """Return the name of the anchor of a friction law, or ""."""
    for item in run.scene.laws:
        label = getattr(item, "name", None) or f"{type(item).__name__}({getattr(item, 'joint', '')})"
        if label == law:
            return str(getattr(item, "joint", ""))
    return ""


def _hinge_axis(run: Trajectory, anchor: str) -> Array:
    """Return the axis of a hinge in the frame of the joint of frame1, (3,), or z for other anchors."""
    item = dict(zip(run.scene.constraint_slices, run.scene.constraints, strict=False)).get(anchor)
    if item is None or not hasattr(item, "frame1"):
        return np.array([0.0, 0.0, 1.0])
    _, place = frame_on_joint(run.scene.model, item.frame1)
    return np.asarray(place.rotation @ np.asarray(unit_axis("axis", getattr(item, "axis", "z"))))


def _joint_share(run: Trajectory, law: str, joint: int, element: int) -> Array | None:
    """Return the ratio of the friction in a joint to its limit, (nt,)."""
    if not (run.recorded("law_forces") and run.recorded("limits")):
        return None
    force = run.law(law).force[:, run.scene.model.joints[joint].idx_v]
    return _part(np.abs(force), run.limits[:, element])


def _part(size: Array, limit: Array) -> Array:
    return np.clip(np.divide(size, limit, out=np.zeros_like(size), where=limit > 0.0), 0.0, 1.0)


def _force(run: Trajectory, touch: ContactPoint) -> Array | None:
    """Return the force of a contact point on the body of the point, (nt, 3), or None without forces."""
    forces, points = getattr(run, "contact_forces", None) or {}, getattr(run, "points", None)
    if touch.name == touch.contact or not forces or points is None:
        return forces.get(touch.name)
    side = 1.0 if contact_bodies(compiled_scene(run.scene), touch.contact).joint == touch.joint else -1.0
    force: Array = points.forces[:, points.names.index(touch.name)]
    return side * force


def _contact(
    run: Trajectory, motion: Motion, name: str, band: int, touch: ContactPoint, whole: bool
) -> Element:
    """Return a contact with its cone, and with the ratio of friction to its limit if forces were recorded."""
    share = pressing = None
    mu = float(getattr(touch.item, "mu", 0.0)) if whole or name == touch.name else 0.0
    force = _force(run, touch)
    if force is not None:
        force = motion.of(force)
        pressing = np.sum(force * touch.normal, axis=1)
        across = np.linalg.norm(force - pressing[:, None] * touch.normal, axis=1)
        if mu > 0.0:
            share = _part(across, mu * np.abs(pressing))
    point, axis = motion.local(touch.joint, touch.place), motion.along(touch.other, touch.normal)
    return Element(
        name, band, touch.joint, point, axis, touch.other, mu, share, pressing, stays=touch.on_plane
    )
