"""Arrows of constraint, contact and friction forces in the replay: at anchors, contacts and joints.

The arrow at an anchor is the reaction on the body of frame1, from the rows of the anchor in `lam`. With
`lam_ideal` it is split into its ideal and its nonideal part. Its moment is an arc. `F_nonideal` and the
actuation torques `tau` are drawn at the joints. `F_ideal` is drawn at the joints if no constraint has a
position; user constraints have none. The arrow of a contact is its total force, normal and friction, on the
first body at the contact point, or at the center of pressure of several points. The force of a user-defined
gap is drawn at the joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts import UserContact
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.rows import rows_at
from pin_nonideal.trajectory.contact_points import contact_bodies
from pin_nonideal.trajectory.resultants import centers
from pin_nonideal.types import Array
from pin_nonideal.validation import axis_triad, unit_axis

from .contact_points import ContactPoint
from .frames import Motion
from .markers import Constraint, Side, constraints_of, side_of, sides_of
from .visuals import joint_axis

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


# Minimum of drawn forces and moments relative to the largest one. The scale of moments is the larger of the
# largest moment and the largest force times the length of a link.
MIN_RELATIVE_SIZE = 1e-9
# Joints of several degrees of freedom with constant directions of motion in their own frame.
CONSTANT_AXES_JOINTS = ("JointModelFreeFlyer", "JointModelSpherical", "JointModelTranslation")


@dataclass(frozen=True)
class Arrow:
    """Force that the replay draws.

    Attributes:
        name: name of the constraint or joint.
        kind: "total", "ideal", "nonideal", "drive", "spring", "drag" or "given".
        unit: "N" or "N m"; a moment is drawn as an arc about its axis.
        values: force or moment in world axes, (n, 3), or moment about the axis, (n,).
        joint: index of the joint that carries the point of action.
        origin: point of action in the world [m], (n, 3); None for the origin of the joint.
        axis: axis of a moment in the joint's frame, (3,); None if the values are vectors.
    """

    name: str
    kind: str
    unit: str
    values: Array
    joint: int = 0
    origin: Array | None = None
    axis: Array | None = None

    def largest(self) -> float:
        """Return the maximum magnitude over the run [N or N m]."""
        sizes = self.values if self.values.ndim == 1 else np.linalg.norm(self.values, axis=1)
        return float(np.abs(sizes).max(initial=0.0))


def arrows_of(
    run: Trajectory,
    motion: Motion,
    touches: Sequence[ContactPoint],
    more: Sequence[Arrow] = (),
    held: Sequence[Constraint] | None = None,
) -> list[Arrow]:
    """Return the arrows of the recorded forces that exceed rounding.

    Args:
        run: run of the replay; constraint forces need record "forces".
        motion: motion of the run.
        touches: contacts of the run.
        more: arrows of other forces.
        held: constraints of the scene, if they are known.
    """
    forces = getattr(run, "contact_forces", None) or {}
    arrows = list(_contact_arrows(run, motion, touches))
    if run.recorded("lam"):
        compiled = compiled_scene(run.scene)
        for constraint in constraints_of(compiled) if held is None else held:
            name, item, _ = constraint
            rows = compiled.multipliers.slices[name]
            parts = {"total": motion.of(run.lam[:, rows])}
            if run.recorded("lam_ideal"):
                ideal = motion.of(run.lam_ideal[:, rows])
                rest = parts["total"] - ideal
                acts = np.abs(rest).max(initial=0.0) > MIN_RELATIVE_SIZE * np.abs(ideal).max(initial=0.0)
                parts = {"ideal": ideal} | ({"nonideal": rest} if acts else {})
            if isinstance(item, UserContact):
                arrows += _user_gap_arrows(run, motion, name, motion.of(run.lam[:, rows]))
                continue
            for kind, lam in parts.items():
                arrows += _reaction(compiled, motion, constraint, kind, lam)
    # Friction of contacts is part of the contact forces.
    touching = {*forces, *(arrow.name for arrow in [*arrows, *more] if arrow.kind == "total")}
    drawn = [] if run.law_names and touching.issuperset(run.law_names) else [("nonideal", "F_nonideal")]
    if not arrows and not touching:
        drawn.append(("ideal", "F_ideal"))
    drawn.append(("drive", "tau"))
    for kind, field in drawn:
        if run.recorded(field):
            arrows += _at_joints(run.scene.model, motion, kind, motion.of(getattr(run, field)))
    return _above_rounding([*arrows, *more], run.scene.model, motion.size)


def _contact_arrows(run: Trajectory, motion: Motion, touches: Sequence[ContactPoint]) -> Iterator[Arrow]:
    """Yield the forces of contacts: at the contact point, or at the center of pressure of several points."""
    forces, points = getattr(run, "contact_forces", None) or {}, getattr(run, "points", None)
    compiled = compiled_scene(run.scene)
    by_contact: dict[str, list[ContactPoint]] = {}
    for touch in touches:
        if touch.contact in forces:
            by_contact.setdefault(touch.contact, []).append(touch)
    for contact, own in by_contact.items():
        joint, place = own[0].joint, own[0].place
        if contact in compiled.points and points is not None:
            columns = {points.names[k]: k for k in points.of(contact)}
            own = [touch for touch in own if touch.name in columns]
            if not own:  # it never touches
                continue
            joint, places = contact_bodies(compiled, contact).joint, np.stack([x.place for x in own], axis=1)
            loads = motion.of(points.loads[:, [columns[touch.name] for touch in own]])
            loads[~loads.any(axis=1)] = 1.0  # the middle of the points has no force
            place = centers(loads, places)
        yield Arrow(contact, "total", "N", motion.of(forces[contact]), joint, place)


def weight_scales(model: pin.Model, size: float) -> dict[str, float]:
    """Return the weight of all bodies [N], its moment at the size of the model [N m], and the lesser of both.

    Args:
        model: model of the scene.
        size: size of the model [m].
    """
    weight = sum(inertia.mass for inertia in model.inertias) * float(np.linalg.norm(model.gravity.linear))
    return {"N": weight, "N m": weight * size, "N, N m": weight * min(1.0, size)}


def _above_rounding(arrows: list[Arrow], model: pin.Model, size: float) -> list[Arrow]:
    """Return the arrows above rounding, relative to the largest arrows and to the weight of all bodies."""
    scales = weight_scales(model, size)
    force = max([scales["N"], *(arrow.largest() for arrow in arrows if arrow.unit == "N")])
    moment = max([scales["N m"], *(arrow.largest() for arrow in arrows if arrow.unit == "N m")])
    min_size = {
        "N": MIN_RELATIVE_SIZE * max(force, moment / size),
        "N m": MIN_RELATIVE_SIZE * max(moment, force * size),
    }
    return [arrow for arrow in arrows if arrow.largest() > min_size[arrow.unit]]


def _reaction(
    compiled: CompiledScene, motion: Motion, constraint: Constraint, kind: str, lam: Array
) -> list[Arrow]:
    """Return the arrows of one constraint: the force on its first body, or the force on its joints."""
    model, (name, item, shown) = compiled.model, constraint
    if hasattr(item, "lower"):  # the force of a stop points away from the stop
        way = -1.0 if name.endswith(" upper") else 1.0
        return along(model, motion, name, kind, model.getJointId(item.joint), way * lam[:, 0])
    if shown in (core.DisplayKind.anchor, core.DisplayKind.rod):
        return _connection_arrows(compiled, motion, constraint, kind, lam)
    if shown == core.DisplayKind.rolling:
        body = side_of(model, item.frame)
        force, place = _rolling_force(model, motion, item, lam)
        return [Arrow(name, kind, "N", force, body.joint, place)]
    if shown == core.DisplayKind.edge:
        edge = side_of(model, item.frame)
        force = edge.turned(motion, lam[:, :1] * np.array(unit_axis("axis", item.axis)))
        return [Arrow(name, kind, "N", force, edge.joint, motion.point(edge.joint, edge.point))]
    if shown == core.DisplayKind.drive:
        return along(model, motion, name, kind, model.getJointId(item.joint), lam[:, 0])
    if shown == core.DisplayKind.gear:
        driven = along(model, motion, name, kind, model.getJointId(item.joint1), lam[:, 0])
        leading = along(model, motion, name, kind, model.getJointId(item.joint2), -item.ratio * lam[:, 0])
        return driven + leading
    return []


def _user_gap_arrows(run: Trajectory, motion: Motion, name: str, lam: Array) -> list[Arrow]:
    """Return the arrows of the generalized force A^T lam of a user-defined gap, at the joints."""
    compiled = compiled_scene(run.scene)
    runner = compiled.program.runner()
    states = zip(motion.q, motion.of(run.v), motion.times, lam, strict=True)
    rows = compiled.slices[name]
    force = np.array([rows_at(runner, q, v, float(t))[0][rows].T @ own for q, v, t, own in states])
    arrows = _at_joints(compiled.model, motion, "total", force)
    return [replace(arrow, name=f"{name}, {arrow.name}") for arrow in arrows]


def _connection_arrows(
    compiled: CompiledScene, motion: Motion, constraint: Constraint, kind: str, lam: Array
) -> list[Arrow]:
    """Return the force on the first of two connected frames, and the moment if the constraint has one."""
    name, item, shown = constraint
    first, second = sides_of(compiled, item)
    origin = motion.point(first.joint, first.point)
    if shown == core.DisplayKind.rod:
        force = lam[:, :1] * _unit(origin - motion.point(second.joint, second.point))
        return [Arrow(name, kind, "N", force, first.joint, origin)]
    axes = ["xyz".index(axis) for axis in getattr(item, "axes", "xyz")]
    local = np.zeros((len(lam), 3))
    local[:, axes] = lam[:, : len(axes)]
    arrows = [Arrow(name, kind, "N", second.turned(motion, local), first.joint, origin)]
    if lam.shape[1] > 3:
        about = np.eye(3)  # a hinge has the two directions across its axis
        if lam.shape[1] == 5:
            about = np.array(axis_triad(unit_axis("axis", item.axis))[:2])
        moment = second.turned(motion, lam[:, 3:] @ about)
        arrows.append(Arrow(name, kind, "N m", moment, first.joint, origin))
    return arrows


def _rolling_force(model: pin.Model, motion: Motion, item: Any, lam: Array) -> tuple[Array, Array]:
    """Return the force on a rolling sphere or disk, and the contact point, (n, 3) each."""
    t1, t2, normal = (np.array(axis) for axis in axis_triad(unit_axis("normal", item.normal)))
    local = lam @ np.array([t1, t2, normal])
    body = side_of(model, item.frame)
    plane = Side(0, pin.SE3.Identity()) if item.plane is None else side_of(model, item.plane)
    up = plane.turned(motion, np.tile(normal, (len(lam), 1)))
    if item.axis is not None:  # lowest point of a disk
        axis = body.turned(motion, np.tile(unit_axis("axis", item.axis), (len(lam), 1)))
        up = _unit(up - np.sum(up * axis, axis=1, keepdims=True) * axis)
    return plane.turned(motion, local), motion.point(body.joint, body.point) - item.radius * up


def _unit(vectors: Array) -> Array:
    """Return vectors of length one; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0))


def along(model: pin.Model, motion: Motion, name: str, kind: str, joint: int, values: Array) -> list[Arrow]:
    """Return the force or torque of a joint with one degree of freedom, along or about its axis.

    Args:
        model: model of the scene.
        motion: motion of the run.
        name: name of the arrow.
        kind: kind of the arrow.
        joint: index of the joint.
        values: force or torque at each frame [N or N m], (n,).
    """
    axis, turning = joint_axis(model, joint)
    if axis is None:
        return []
    if turning:
        return [Arrow(name, kind, "N m", values, int(joint), axis=axis)]
    force = motion.rotation(joint) @ axis * values[:, None]
    return [Arrow(name, kind, "N", force, int(joint), motion.poses[:, joint, :3])]


def _at_joints(model: pin.Model, motion: Motion, kind: str, force: Array) -> list[Arrow]:
    """Return the arrows of a generalized force (n, nv) at all joints, along the directions of their motion.

    Consecutive prismatic joints without mass in between move one particle, and their forces are one arrow.
    """
    arrows: list[Arrow] = []
    covered: set[int] = set()
    for joint in reversed(range(1, model.njoints)):
        if joint in covered:
            continue
        chain = _particle_joints(model, joint)
        covered.update(chain)
        name = ", ".join(str(model.names[j]) for j in reversed(chain))
        if len(chain) > 1:
            parts = [along(model, motion, name, kind, j, force[:, model.joints[j].idx_v])[0] for j in chain]
            total = np.sum([part.values for part in parts], axis=0)
            own = [Arrow(name, kind, "N", total, joint, parts[0].origin)]
        elif model.joints[joint].nv == 1:
            own = along(model, motion, name, kind, joint, force[:, model.joints[joint].idx_v])
        else:
            own = _wrench(model, motion, kind, joint, force)
        arrows = own + arrows
    return arrows


def _particle_joints(model: pin.Model, joint: int) -> list[int]:
    """Return a joint and the prismatic joints before it that only massless links separate from it."""
    chain = [joint]
    while _slides(model, joint):
        joint = int(model.parents[joint])
        if not _slides(model, joint) or model.inertias[joint].mass > 0.0:
            break
        chain.append(joint)
    return chain


def _slides(model: pin.Model, joint: int) -> bool:
    axis, turning = joint_axis(model, joint) if joint else (None, False)
    return axis is not None and not turning


def _wrench(model: pin.Model, motion: Motion, kind: str, joint: int, force: Array) -> list[Arrow]:
    """Return the least force and moment S^T w = tau of a joint with several degrees of freedom."""
    item, name = model.joints[joint], str(model.names[joint])
    data, own = item.createData(), force[:, item.idx_v : item.idx_v + item.nv]
    item.calc(data, motion.q[0])
    if item.shortname() in CONSTANT_AXES_JOINTS:
        local = own @ np.linalg.pinv(np.asarray(data.S))
    else:
        local = np.empty((len(force), 6))
        for k, row in enumerate(own):
            item.calc(data, motion.q[k])
            local[k] = np.linalg.pinv(np.asarray(data.S)).T @ row
    turn = motion.rotation(joint)
    linear, angular = (np.einsum("nij,nj->ni", turn, part) for part in np.hsplit(local, 2))
    place = motion.poses[:, joint, :3]
    return [Arrow(name, kind, "N", linear, joint, place), Arrow(name, kind, "N m", angular, joint, place)]
