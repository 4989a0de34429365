"""Arrows of applied forces at their points of action: springs, wrenches and drag."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.description.forces import JointSpring, SpringDamper, Wrench
from pin_nonideal.description.laws import Drag
from pin_nonideal.states.kinematics import frame_on_joint
from pin_nonideal.types import Array

from .force_arrows import Arrow, along
from .frames import Motion
from .markers import Mark

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


def applied_force_arrows(run: Trajectory, motion: Motion, marks: list[Mark]) -> list[Arrow]:
    """Return the arrows of the springs, wrenches and drag laws of a scene, at their points of action.

    Args:
        run: run of the replay.
        motion: motion of the run.
        marks: marks of the scene, for the ends of springs.
    """
    ends, twists = {mark.name: mark for mark in marks if mark.kind == "spring"}, _Twists(run, motion)
    arrows: list[Arrow] = []
    for item in run.scene.forces:
        if isinstance(item, SpringDamper):
            arrows.append(_spring(motion, twists, item, ends[item.name or f"spring {item.frame1}"]))
        elif isinstance(item, JointSpring):
            joint = run.scene.model.getJointId(item.joint)
            q, v = run.scene.model.joints[joint].idx_q, run.scene.model.joints[joint].idx_v
            if run.scene.model.joints[joint].nq == 1:
                torque = (
                    -item.stiffness * (motion.q[:, q] - item.rest) - item.damping * motion.of(run.v)[:, v]
                )
                name = item.name or f"spring {item.joint}"
                arrows += along(run.scene.model, motion, name, "spring", joint, torque)
        elif isinstance(item, Wrench):
            arrows += _wrench(run, motion, item)
    for law in run.scene.laws:
        if isinstance(law, Drag):
            joint, place = frame_on_joint(run.scene.model, law.frame)
            point = np.asarray(place.translation)
            slip = twists.velocity(joint, point)
            speed = np.linalg.norm(slip, axis=1, keepdims=True)
            push = np.where(
                speed > 0.0, -law.coefficient * np.maximum(speed, 1e-300) ** (law.exponent - 1.0) * slip, 0.0
            )
            arrows.append(
                Arrow(law.name or f"drag {law.frame}", "drag", "N", push, joint, motion.point(joint, point))
            )
    return arrows


def _spring(motion: Motion, twists: _Twists, item: SpringDamper, mark: Mark) -> Arrow:
    """Return the arrow of the force on the body of the spring's first frame."""
    first, second = motion.point(mark.joint1, mark.point1), motion.point(mark.joint2, mark.point2)
    length = np.linalg.norm(first - second, axis=1, keepdims=True)
    way = np.divide(first - second, length, out=np.zeros_like(first), where=length > 0.0)
    rate = twists.velocity(mark.joint1, mark.point1) - twists.velocity(mark.joint2, mark.point2)
    size = item.stiffness * (length - item.rest_length) + item.damping * np.sum(
        rate * way, axis=1, keepdims=True
    )
    return Arrow(mark.name, "spring", "N", -size * way, mark.joint1, first)


def _wrench(run: Trajectory, motion: Motion, item: Wrench) -> list[Arrow]:
    joint, place = frame_on_joint(run.scene.model, item.frame)
    source: Any = item.value
    values = np.array(
        [np.asarray(source(t) if callable(source) else source, dtype=float) for t in motion.times]
    )
    origin, name = motion.point(joint, np.asarray(place.translation)), item.name or f"wrench {item.frame}"
    return [
        Arrow(name, "given", unit, part, joint, origin)
        for unit, part in (("N", values[:, :3]), ("N m", values[:, 3:]))
    ]


class _Twists:
    """Velocities of all joints at the frames, computed on first access."""

    def __init__(self, run: Trajectory, motion: Motion) -> None:
        self.run, self.motion = run, motion

    @cached_property
    def own(self) -> Array:
        """Linear and angular velocity of each joint in its own axes, (n, njoints, 6)."""
        model, v = self.run.scene.model, self.motion.of(self.run.v)
        data, twists = model.createData(), np.zeros((len(v), model.njoints, 6))
        moving = range(1, model.njoints)
        for k, q in enumerate(self.motion.q):
            pin.forwardKinematics(model, data, q, v[k])
            for joint in moving:
                twists[k, joint] = data.v[joint].vector
        return twists

    def velocity(self, joint: int, point: Array) -> Array:
        """Return the velocity of a point on a joint at each frame, in world axes [m/s], (n, 3)."""
        if not joint:
            return np.zeros((len(self.motion.times), 3))
        linear, angular = np.split(self.own[:, joint], 2, axis=1)
        return np.asarray(
            np.einsum("nij,nj->ni", self.motion.rotation(joint), linear + np.cross(angular, point))
        )
