"""Tree of a compiled MJCF model as a Pinocchio model: bodies, joints, inertias, frames and states.

Joints keep MuJoCo's order and coordinates, including `ref`, so that joint j of the compiled model is joint j
+ 1 of Pinocchio. There are two differences. Quaternions are (x, y, z, w) instead of (w, x, y, z). The linear
velocity of a free joint is in the body's axes, in MuJoCo in the world's axes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, JointModel, Model, Placement

from .motion import Motion
from .mujoco_types import MjModel, Mujoco

FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's mjtJoint
GROUND = "universe"  # name that Pinocchio reserves


def placement(position: Array, quaternion: Array) -> Placement:
    """Return a pinocchio.SE3 from a position and a quaternion (w, x, y, z)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(position))


def translation(position: Array) -> Placement:
    """Return a pinocchio.SE3 without rotation."""
    return pin.SE3(np.eye(3), np.array(position))


@dataclass
class Tree:
    """Compiled model and the Pinocchio model of its tree.

    Attributes:
        compiled: mujoco.MjModel.
        model: pinocchio.Model.
        bodies: joint that carries each body, and placement of the body on the joint.
        body_names: names of the bodies' frames.
        site_names: names of the sites' frames.
        key_names: names of the keyframes.
    """

    compiled: MjModel
    model: Model
    bodies: list[tuple[int, Placement]] = field(default_factory=list)
    body_names: list[str] = field(default_factory=list)
    site_names: list[str] = field(default_factory=list)
    key_names: list[str] = field(default_factory=list)

    @cached_property
    def motion(self) -> Motion:
        """Return the kinematics for forces computed in Python; the tree must be complete."""
        return Motion(self.model)

    def joint_name(self, joint: int) -> str:
        """Return the name of a joint by its index in the compiled model."""
        return str(self.model.names[int(joint) + 1])

    def on_body(self, body: int, local: Placement) -> tuple[int, Placement]:
        """Return the joint that carries a placement given on a body, and the placement on that joint."""
        joint, place = self.bodies[body]
        return joint, place * local

    def on_site(self, site: int) -> tuple[int, Placement]:
        """Return the joint that carries a site, and the placement of the site on the joint."""
        m = self.compiled
        return self.on_body(m.site_bodyid[site], placement(m.site_pos[site], m.site_quat[site]))

    def add_frame(self, name: str, body: int, local: Placement) -> str:
        """Add a frame on a body and return its name."""
        joint, place = self.on_body(body, local)
        self.model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME), False)
        return name

    def q(self, qpos: Array) -> Array:
        """Return the Pinocchio configuration of MuJoCo's `qpos`."""
        result = np.array(qpos, dtype=float)
        for start in self._quaternions():
            w, x, y, z = result[start : start + 4] / np.linalg.norm(result[start : start + 4])
            result[start : start + 4] = x, y, z, w
        return result

    def v(self, qpos: Array, qvel: Array) -> Array:
        """Return the Pinocchio velocity of MuJoCo's `qpos` and `qvel`."""
        result = np.array(qvel, dtype=float)
        m = self.compiled
        for j in np.flatnonzero(m.jnt_type == FREE):
            at, dof = m.jnt_qposadr[j], m.jnt_dofadr[j]
            turn = placement(np.zeros(3), qpos[at + 3 : at + 7]).rotation
            result[dof : dof + 3] = turn.T @ result[dof : dof + 3]
        return result

    def _quaternions(self) -> Iterable[int]:
        m = self.compiled
        return [
            int(m.jnt_qposadr[j]) + (3 if m.jnt_type[j] == FREE else 0)
            for j in range(m.njnt)
            if m.jnt_type[j] <= BALL
        ]


def build_tree(mujoco: Mujoco, compiled: MjModel, name: str) -> Tree:
    """Return the tree of a compiled model: bodies, joints, inertias, gravity, limits, sites and keyframes.

    Args:
        mujoco: Python package.
        compiled: mujoco.MjModel.
        name: name of a model without a name.
    """
    m = compiled
    model = pin.Model()
    model.name = m.names[: m.names.index(b"\0")].decode() or name
    weightless = m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    model.gravity = pin.Motion(np.zeros(3) if weightless else np.array(m.opt.gravity), np.zeros(3))
    tree = Tree(m, model)
    tree.body_names = _names(m, m.nbody, m.name_bodyadr, "body")
    tree.site_names = _names(m, m.nsite, m.name_siteadr, "site")
    joint_names = _names(m, m.njnt, m.name_jntadr, "joint", GROUND)
    for body in range(m.nbody):
        tree.bodies.append(_add_body(tree, body, joint_names))
    for site in range(m.nsite):
        local = placement(m.site_pos[site], m.site_quat[site])
        tree.add_frame(tree.site_names[site], m.site_bodyid[site], local)
    model.armature[:] = (
        m.dof_armature + actuator_share(m, m.actuator_armature[:, None], joints=True)[m.dof_jntid, 0]
    )
    tree.key_names = _names(m, m.nkey, m.name_keyadr, "key")
    for key, key_name in enumerate(tree.key_names):
        model.referenceConfigurations[key_name] = tree.q(m.key_qpos[key])
    return tree


def _names(m: MjModel, count: int, addresses: Array, kind: str, barred: str = "") -> list[str]:
    """Return the names of all objects of a kind, with a new name for an unnamed object or a reserved name."""
    names = [m.names[adr : m.names.index(b"\0", adr)].decode() for adr in addresses[:count]]
    used_names = {*names, barred}
    for i, old in enumerate(names):
        name = "" if old == barred else old
        while not name or (name != old and name in used_names):
            name = f"{name}_" if name else f"{old or kind}_{i}"
        names[i] = name
        used_names.add(name)
    return names


def _add_body(tree: Tree, body: int, joint_names: list[str]) -> tuple[int, Placement]:
    """Add one body with its joints, each in the frame of the joints before it."""
    m, model = tree.compiled, tree.model
    if body == 0:
        return 0, pin.SE3.Identity()
    carrier, place = tree.bodies[m.body_parentid[body]]
    place = place * placement(m.body_pos[body], m.body_quat[body])
    first = int(m.body_jntadr[body])
    for j in range(first, first + int(m.body_jntnum[body])):
        anchor = translation(m.jnt_pos[j])
        if m.jnt_type[j] == FREE:  # its coordinates are the body's pose in the world
            place, anchor = pin.SE3.Identity(), pin.SE3.Identity()
        carrier = model.addJoint(
            carrier, _joint(m, j), place * anchor * _reference_offset(m, j), joint_names[j]
        )
        model.addJointFrame(carrier)
        place = anchor.inverse()
        _set_limits(model, m, j, carrier)
    if carrier:
        model.appendBodyToJoint(carrier, _inertia(m, body), place)
    model.addBodyFrame(tree.body_names[body], carrier, place, -1)
    return carrier, place


def _joint(m: MjModel, j: int) -> JointModel:
    kind, axis = m.jnt_type[j], np.array(m.jnt_axis[j])
    if kind == FREE:
        return pin.JointModelFreeFlyer()
    if kind == BALL:
        return pin.JointModelSpherical()
    letters = {(1.0, 0.0, 0.0): "X", (0.0, 1.0, 0.0): "Y", (0.0, 0.0, 1.0): "Z"}
    x, y, z = (float(component) for component in axis)
    letter = letters.get((x, y, z))
    if letter is not None:
        return getattr(pin, f"JointModel{'R' if kind == HINGE else 'P'}{letter}")()
    return (pin.JointModelRevoluteUnaligned if kind == HINGE else pin.JointModelPrismaticUnaligned)(axis)


def _reference_offset(m: MjModel, j: int) -> Placement:
    """Return the placement from the reference pose of the file to the pose at coordinate zero."""
    axis, reference = np.array(m.jnt_axis[j]), float(m.qpos0[m.jnt_qposadr[j]])
    if m.jnt_type[j] == HINGE:
        return pin.SE3(pin.exp3(-reference * axis), np.zeros(3))
    return translation(-reference * axis) if m.jnt_type[j] == SLIDE else pin.SE3.Identity()


def _inertia(m: MjModel, body: int) -> pin.Inertia:
    """Return the inertia of a body in its own frame, from its principal moments."""
    turn = placement(np.zeros(3), m.body_iquat[body]).rotation
    moments = turn @ np.diag(m.body_inertia[body]) @ turn.T
    return pin.Inertia(float(m.body_mass[body]), np.array(m.body_ipos[body]), 0.5 * (moments + moments.T))


def _set_limits(model: Model, m: MjModel, j: int, joint: int) -> None:
    """Set the ranges of position and of the total force of the drives; they do not affect the motion."""
    if m.jnt_type[j] <= BALL:
        return
    i, k = model.idx_vs[joint], model.idx_qs[joint]
    if m.jnt_limited[j]:
        model.lowerPositionLimit[k], model.upperPositionLimit[k] = m.jnt_range[j]
    if m.jnt_actfrclimited[j]:
        model.lowerEffortLimit[i], model.upperEffortLimit[i] = m.jnt_actfrcrange[j]


def actuator_share(m: MjModel, values: Array, *, joints: bool) -> Array:
    """Return the armature or damping that actuators add to their joints or tendons.

    Args:
        m: mujoco.MjModel.
        values: row of values for each actuator, (nactuator, k).
        joints: whether to return rows for joints, or for tendons.

    Returns:
        Sum of the rows for each joint or tendon, multiplied by the squared gear ratio.
    """
    result = np.zeros((m.njnt if joints else m.ntendon, values.shape[1]))
    driven = m.jnt_actuatorid if joints else m.tendon_actuatorid
    for a in range(m.nactuator):
        target = int(m.actuator_trnid[a, 0])
        if (m.actuator_trntype[a] in ((0, 1) if joints else (3,))) and driven[target] != -1:
            result[target] += values[a] * m.actuator_gear[m.actuator_outadr[a], 0] ** 2
    return result
