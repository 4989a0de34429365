"""Where the frames and joints of a tree are, without Pinocchio's Data.

Data holds tensors of nv^3 numbers, gigabytes from some five hundred degrees of freedom on.
"""

from __future__ import annotations

import pinocchio as pin

from pin_nonideal.types import Array, Model, Placement


def joint_placements(model: Model, q: Array) -> list[Placement]:
    """Frames of all joints in the world: oM_i = oM_parent  M_i  J_i(q), the universe's first.

    Args:
        model: pinocchio.Model.
        q: configuration, shape (nq,).

    Returns:
        A pinocchio.SE3 for every joint, as `Data.oMi` after `pinocchio.forwardKinematics`.
    """
    found = [pin.SE3.Identity()]
    for index in range(1, model.njoints):
        joint = model.joints[index]
        data = joint.createData()
        joint.calc(data, q)
        found.append(found[model.parents[index]] * model.jointPlacements[index] * pin.SE3(data.M))
    return found


def frame_on_joint(model: Model, name: str) -> tuple[int, Placement]:
    """The joint that carries a frame, and the frame's placement on it.

    A joint without a frame of its own, which a model built by hand may hold, is found by its name as well.

    Args:
        model: pinocchio.Model.
        name: of a frame or a joint of the model.

    Returns:
        Index of the joint, and a pinocchio.SE3.
    """
    if not model.existFrame(name) and model.existJointName(name):
        return int(model.getJointId(name)), pin.SE3.Identity()
    frame = model.frames[frame_index(model, name)]
    return int(frame.parentJoint), frame.placement


def frame_index(model: Model, name: str) -> int:
    """Index of the frame of that name; of several, a body's before a joint's, and those before all others.

    Args:
        model: pinocchio.Model.
        name: of a frame of the model.
    """
    kinds = (pin.FrameType.BODY, pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT, pin.FrameType.OP_FRAME)
    found = (int(model.getFrameId(name, kind)) for kind in kinds if model.existFrame(name, kind))
    return next(found, None) or int(model.getFrameId(name))
