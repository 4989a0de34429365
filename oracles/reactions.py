"""Joint wrenches of cut loops, by Pinocchio's recursive Newton-Euler algorithm."""

from __future__ import annotations

import numpy as np
import pinocchio as pin


class CutTree:
    """Model with a state, an acceleration and external forces.

    Wrenches are [force; moment] about a point, in world axes.
    """

    def __init__(self, model, q, v, a):
        self.model, self.data, self.state = model, model.createData(), (q, v, a)
        pin.forwardKinematics(model, self.data, q, v, a)
        pin.updateFramePlacements(model, self.data)
        self.external = [pin.Force.Zero() for _ in range(model.njoints)]

    def placement(self, frame):
        """Return the world placement of a frame."""
        return self.data.oMf[self.model.getFrameId(frame)]

    def joint(self, frame):
        """Return the index of a frame's parent joint."""
        return self.model.frames[self.model.getFrameId(frame)].parentJoint

    def velocity(self, frame):
        """Return the velocity of a frame's origin, in world axes."""
        of = self.model.getFrameId(frame)
        return pin.getFrameVelocity(self.model, self.data, of, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED).linear

    def push(self, joint, wrench, point):
        """Add a wrench on the body of a joint."""
        at_point = pin.SE3(np.eye(3), np.asarray(point, dtype=float))
        in_world = at_point.act(pin.Force(np.asarray(wrench, dtype=float)))
        self.external[joint] += self.data.oMi[joint].actInv(in_world)

    def push_frames(self, frame1, frame2, wrench):
        """Add a wrench at frame1's origin on its body, and the opposite on frame2's (None: the world)."""
        point = self.placement(frame1).translation
        for frame, sign in ((frame1, 1.0), (frame2, -1.0)):
            if frame is not None:
                self.push(self.joint(frame), sign * np.asarray(wrench), point)

    def generalized(self, frame1, frame2, wrench):
        """Return the generalized force of the wrench pair of `push_frames`, (nv,)."""
        pin.computeJointJacobians(self.model, self.data, self.state[0])
        point, total = self.placement(frame1).translation, np.zeros(self.model.nv)
        for frame, sign in ((frame1, 1.0), (frame2, -1.0)):
            if frame is None:
                continue
            joint = self.joint(frame)
            J = pin.getJointJacobian(self.model, self.data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            lever = point - self.data.oMi[joint].translation
            force, moment = wrench[:3], wrench[3:] + np.cross(lever, wrench[:3])
            total += sign * J.T @ np.concatenate([force, moment])
        return total

    def joint_wrenches(self):
        """Return the wrench of each joint on its body, in the joint frame, (njoints - 1, 6)."""
        pin.rnea(self.model, self.data, *self.state, self.external)
        return np.array([self.data.f[i].vector for i in range(1, self.model.njoints)])
