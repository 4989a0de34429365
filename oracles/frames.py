"""Kinematics of a model's frames in world axes, by Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin


@dataclass
class Frame:
    """Frame of a body or of the world.

    Attributes:
        p: position of the origin.
        R: axes of the frame, as columns.
        J: Jacobian of the origin's velocity, (3, nv).
        Jw: Jacobian of the angular velocity, (3, nv).
        u: velocity of the origin.
        w: angular velocity.
        du: acceleration of the origin at zero joint acceleration.
        dw: angular acceleration at zero joint acceleration.
    """

    p: np.ndarray
    R: np.ndarray
    J: np.ndarray
    Jw: np.ndarray
    u: np.ndarray
    w: np.ndarray
    du: np.ndarray
    dw: np.ndarray


class Frames:
    """Frames of a model at one state; `data` is computed for (q, v) and zero acceleration."""

    def __init__(self, model, q, v):
        self.model, self.data, self.q, self.v = model, model.createData(), q, v
        pin.forwardKinematics(model, self.data, q, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, self.data, q)
        pin.updateFramePlacements(model, self.data)

    def __call__(self, name):
        """Return the frame of a name; None is the world."""
        nv, zero = self.model.nv, np.zeros(3)
        if name is None:
            return Frame(zero, np.eye(3), np.zeros((3, nv)), np.zeros((3, nv)), zero, zero, zero, zero)
        at = (self.model, self.data, self.model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED)
        place = self.data.oMf[at[2]]
        p, R, J = place.translation.copy(), place.rotation.copy(), pin.getFrameJacobian(*at).reshape(6, -1)
        u, du = pin.getFrameVelocity(*at), pin.getFrameClassicalAcceleration(*at)
        return Frame(p, R, J[:3], J[3:], u.linear, u.angular, du.linear, du.angular)

    def at(self, q):
        """Return the frames of the same model at another configuration, at rest."""
        return Frames(self.model, q, np.zeros(self.model.nv))

    def dof(self, joint):
        """Return the index of a joint's first velocity in v."""
        return self.model.joints[self.model.getJointId(joint)].idx_v
