"""Forward kinematics of frames and joints without Pinocchio's Data.

Data holds tensors of nv^3 numbers, which take gigabytes above about 500 degrees of freedom.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, Model, Placement


def joint_placements(model: Model, q: Array) -> list[Placement]:
    """Compute the placements of all joints in the world: oM_i = oM_parent  M_i  J_i(q), universe first.

    Args:
        model: pinocchio.Model.
        q: configuration, shape (nq,).

    Returns:
        A pinocchio.SE3 for every joint, as `Data.oMi` after `pinocchio.forwardKinematics`.
    """
    placements = [pin.SE3.Identity()]
    for index in range(1, model.njoints):
        joint = model.joints[index]
        data = joint.createData()
        joint.calc(data, q)
        placements.append(placements[model.parents[index]] * model.jointPlacements[index] * pin.SE3(data.M))
    return placements


def frame_on_joint(model: Model, name: str) -> tuple[int, Placement]:
    """Return the joint that carries a frame, and the placement of the frame on the joint.

    The name of a joint without a frame is accepted as well; hand-built models may have such joints.

    Args:
        model: pinocchio.Model.
        name: name of a frame or a joint of the model.

    Returns:
        Index of the joint, and a pinocchio.SE3.
    """
    if not model.existFrame(name) and model.existJointName(name):
        return int(model.getJointId(name)), pin.SE3.Identity()
    frame = model.frames[frame_index(model, name)]
    return int(frame.parentJoint), frame.placement


def frame_index(model: Model, name: str) -> int:
    """Return the index of a frame; among frames of one name, bodies come before joints and other kinds.

    Args:
        model: pinocchio.Model.
        name: name of a frame of the model.
    """
    kinds = (pin.FrameType.BODY, pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT, pin.FrameType.OP_FRAME)
    indices = (int(model.getFrameId(name, kind)) for kind in kinds if model.existFrame(name, kind))
    return next(indices, None) or int(model.getFrameId(name))


def frame_motion(model: Model, name: str, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Compute placement and twist of a frame at many states, from the joints between frame and world.

    The recursion is v_i = X_i^-1 v_parent + S_i(q) dq_i in body axes. The twist of the frame is then rotated
    into world axes.

    Args:
        model: pinocchio.Model.
        name: name of a frame or a joint of the model.
        q: configurations, (n, nq).
        v: velocities, (n, nv).

    Returns:
        Position of the origin [m], (n, 3); axes by columns, (n, 3, 3); linear velocity of the origin and
        angular velocity in world axes [m/s; rad/s], (n, 6).
    """
    carrier, local = frame_on_joint(model, name)
    chain = [int(i) for i in model.supports[carrier]][1:]
    datas = {i: model.joints[i].createData() for i in chain}
    places, axes, rates = np.empty((len(q), 3)), np.empty((len(q), 3, 3)), np.empty((len(q), 6))
    for k, (q_k, v_k) in enumerate(zip(q, v, strict=True)):
        placement, velocity = pin.SE3.Identity(), pin.Motion.Zero()
        for i in chain:
            model.joints[i].calc(datas[i], q_k, v_k)
            step = model.jointPlacements[i] * pin.SE3(datas[i].M)
            placement, velocity = placement * step, step.actInv(velocity) + pin.Motion(datas[i].v)
        placement, velocity = placement * local, local.actInv(velocity)
        places[k], axes[k] = placement.translation, placement.rotation
        rates[k] = np.concatenate([axes[k] @ velocity.linear, axes[k] @ velocity.angular])
    return places, axes, rates


class BodyMotions:
    """Placements, velocities and accelerations of bodies at one state, each computed when it is needed.

    The recursion is a_i = X_i^-1 a_parent + S_i dv_i + c_i + v_i x (S_i v_i), in body axes.

    Args:
        model: pinocchio.Model.
        q: configuration, (nq,).
        v: velocity, (nv,).
        a: acceleration, (nv,).
    """

    def __init__(self, model: Model, q: Array, v: Array, a: Array) -> None:
        self._model, self._q, self._v, self._a = model, q, v, a
        world = (pin.SE3.Identity(), pin.Motion.Zero(), pin.Motion(-model.gravity.vector))
        self._known: dict[int, tuple[Placement, pin.Motion, pin.Motion]] = {0: world}

    def placement(self, joint: int) -> Placement:
        """Return the placement of a body in the world, pinocchio.SE3.

        Args:
            joint: index of the joint that moves it.
        """
        return self._motion(joint)[0]

    def velocity(self, joint: int) -> pin.Motion:
        """Return the twist of a body in its own axes.

        Args:
            joint: index of the joint that moves it.
        """
        return self._motion(joint)[1]

    def acceleration(self, joint: int) -> pin.Motion:
        """Return the spatial acceleration of a body relative to free fall, in its own axes.

        Args:
            joint: index of the joint that moves it.
        """
        return self._motion(joint)[2]

    def point(self, frame: tuple[int, list[float], list[float]]) -> Array:
        """Return the origin of a frame in the world [m], (3,).

        Args:
            frame: joint index, rotation by rows and translation.
        """
        return np.asarray(self.placement(frame[0]).act(np.array(frame[2])))

    def point_velocity(self, frame: tuple[int, list[float], list[float]]) -> Array:
        """Return the velocity of the origin of a frame in world axes [m/s], (3,).

        Args:
            frame: joint index, rotation by rows and translation.
        """
        twist, lever = self.velocity(frame[0]), np.array(frame[2])
        return np.asarray(self.placement(frame[0]).rotation @ (twist.linear + np.cross(twist.angular, lever)))

    def _motion(self, joint: int) -> tuple[Placement, pin.Motion, pin.Motion]:
        if joint not in self._known:
            model = self._model
            item, parent = model.joints[joint], self._motion(int(model.parents[joint]))
            data = item.createData()
            item.calc(data, self._q, self._v)
            step, own = model.jointPlacements[joint] * pin.SE3(data.M), pin.Motion(data.v)
            rates = self._a[item.idx_v : item.idx_v + item.nv]
            velocity = step.actInv(parent[1]) + own
            gained = pin.Motion(np.asarray(data.S).reshape(6, -1) @ rates) + pin.Motion(data.c)
            acceleration = step.actInv(parent[2]) + gained + velocity.cross(own)
            self._known[joint] = (parent[0] * step, velocity, acceleration)
        return self._known[joint]
