"""Springs, damping, friction, gravity compensation and fluid forces of a compiled MJCF model."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pin_nonideal.description.forces import Force, JointSpring, UserForce, Wrench
from pin_nonideal.description.laws import JointFriction, Law, UserFriction, UserLaw
from pin_nonideal.types import Array, Placement

from .motion import Motion
from .tendons import ConstantForce, polynomial
from .tree import BALL, FREE, Tree, actuator_share, placement, translation

MIN_MASS = 1e-15  # [kg] and [kg m^2]: MuJoCo's mjMINVAL; its fluid model ignores lighter bodies


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs of joints that `JointSpring` cannot represent: ball and free joints, and higher powers.

    Attributes:
        single: index in q, degree of freedom, stiffness, higher coefficients, rest position [rad or m].
        turning: the same values for rotations; the rest position is a rotation matrix.
        sliding: the same values for positions of free joints; the rest position is a point.
    """

    single: list[tuple[int, int, float, Array, float]]
    turning: list[tuple[int, int, float, Array, Array]]
    sliding: list[tuple[int, int, float, Array, Array]]

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the generalized force, (nv,)."""
        tau = np.zeros_like(v)
        for at, dof, stiffness, higher, rest in self.single:
            x = q[at] - rest
            tau[dof] -= x * polynomial(stiffness, higher, x)
        for at, dof, stiffness, higher, turned in self.turning:
            away = pin.log3(turned.T @ rotation(q, at))
            tau[dof : dof + 3] -= polynomial(stiffness, higher, float(np.linalg.norm(away))) * away
        for at, dof, stiffness, higher, place in self.sliding:
            away = q[at : at + 3] - place
            force = polynomial(stiffness, higher, float(np.linalg.norm(away))) * away
            tau[dof : dof + 3] -= rotation(q, at + 3).T @ force
        return tau


@dataclass(frozen=True, eq=False)
class Damping:
    """Damping of joints that `JointFriction` cannot represent: free joints, and higher velocity powers.

    Attributes:
        dofs: degrees of freedom with their linear and higher coefficients.
        floating: index of the quaternion in q, and first degree of freedom, of each free joint, whose linear
            velocities are damped along the world's axes.
    """

    dofs: list[tuple[int, float, Array]]
    floating: list[tuple[int, int]]

    def __call__(self, t: float, q: Array, v: Array, reactions: object) -> Array:
        """Return the generalized force, (nv,)."""
        rates, tau = np.array(v), np.zeros_like(v)
        turns = [(dof, rotation(q, at)) for at, dof in self.floating]
        for dof, turn in turns:
            rates[dof : dof + 3] = turn @ rates[dof : dof + 3]
        for dof, damping, higher in self.dofs:
            tau[dof] = -rates[dof] * polynomial(damping, higher, abs(rates[dof]))
        for dof, turn in turns:
            tau[dof : dof + 3] = turn.T @ tau[dof : dof + 3]
        return tau


@dataclass(frozen=True, eq=False)
class FloatingArmature:
    """Force that cancels the Coriolis terms of a free joint's armature: -m_a (w x v).

    Attributes:
        bodies: first degree of freedom and armature of each free joint.
    """

    bodies: list[tuple[int, float]]

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the generalized force, (nv,)."""
        tau = np.zeros_like(v)
        for dof, armature in self.bodies:
            tau[dof : dof + 3] = -armature * np.cross(v[dof + 3 : dof + 6], v[dof : dof + 3])
        return tau


@dataclass(frozen=True, eq=False)
class DofDirection:
    """Direction of the friction of one degree of freedom of a ball or free joint.

    Attributes:
        dof: degree of freedom.
        first: first of three degrees of freedom along the world's axes, or -1 for the joint's own axis.
        at: index of the quaternion in q.
        size: number of degrees of freedom.
    """

    dof: int
    first: int
    at: int
    size: int

    def __call__(self, t: float, q: Array) -> Array:
        """Return the row of the slip velocity, (nv,)."""
        row = np.zeros(self.size)
        if self.first < 0:
            row[self.dof] = 1.0
        else:
            row[self.first : self.first + 3] = rotation(q, self.at)[self.dof - self.first]
        return row


@dataclass(frozen=True, eq=False)
class Fluid:
    """Drag and viscous resistance on each body's box of equal inertia, MuJoCo's inertia model.

    The edges of the box are r, with the mean d; the velocities of the center of mass relative to the fluid
    are u and w:

        f_i = -1/2 density r_j r_k |u_i| u_i - 3 pi viscosity d u_i
        g_i = -1/64 density r_i (r_j^4 + r_k^4) |w_i| w_i - pi viscosity d^3 w_i

    Attributes:
        motion: kinematics of the bodies.
        boxes: joint, placement of the principal axes, and edges (3,) [m] of each box.
        density: density of the fluid [kg/m^3].
        viscosity: viscosity of the fluid [Pa s].
        wind: velocity of the fluid, (3,) [m/s].
    """

    motion: Motion
    boxes: list[tuple[int, Placement, Array]]
    density: float
    viscosity: float
    wind: Array

    def __call__(self, t: float, q: Array, v: Array, reactions: object) -> Array:
        """Return the generalized force, (nv,)."""
        self.motion.update(q, v)
        forces = []
        for joint, local, r in self.boxes:
            turn, moving = self.motion.place(joint, local).rotation, self.motion.velocity(joint, local)
            u, w = moving.linear - turn.T @ self.wind, moving.angular
            d, (rx, ry, rz) = r.mean(), r
            sides, quartic = np.array([ry * rz, rx * rz, rx * ry]), r**4
            arms = r * (quartic.sum() - quartic)
            f = -0.5 * self.density * sides * np.abs(u) * u - 3.0 * math.pi * self.viscosity * d * u
            g = -self.density * arms * np.abs(w) * w / 64.0 - math.pi * self.viscosity * d**3 * w
            forces.append((joint, local, turn @ f, turn @ g))
        return self.motion.generalized(q, forces)


def rotation(q: Array, at: int) -> Array:
    """Return the rotation matrix of the quaternion (x, y, z, w) at an index of q."""
    x, y, z, w = q[at : at + 4]
    return np.asarray(pin.Quaternion(w, x, y, z).matrix())


def joint_springs(tree: Tree) -> list[Force]:
    """Return the springs of the joints as given forces."""
    m = tree.compiled
    result: list[Force] = []
    springs = Springs([], [], [])
    for j in range(m.njnt):
        stiffness, higher = float(m.jnt_stiffness[j]), np.array(m.jnt_stiffnesspoly[j])
        at, dof, kind = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j]), m.jnt_type[j]
        if stiffness == 0.0 and not higher.any():
            continue
        rest = np.array(m.qpos_spring[at:])
        if kind > BALL and stiffness > 0.0 and not higher.any():
            name = tree.joint_name(j)
            result.append(JointSpring(name, stiffness, float(rest[0]), name=f"{name} spring"))
        elif kind > BALL:
            springs.single.append((at, dof, stiffness, higher, float(rest[0])))
        else:
            shift = 3 if kind == FREE else 0
            turned = placement(np.zeros(3), rest[shift : shift + 4]).rotation
            springs.turning.append((at + shift, dof + shift, stiffness, higher, turned))
            if kind == FREE:
                springs.sliding.append((at, dof, stiffness, higher, rest[:3]))
    if springs.single or springs.turning:
        result.append(UserForce(springs, name="springs"))
    return result


def joint_resistance(tree: Tree, *, dampers: bool, friction: bool) -> list[Law]:
    """Return damping and dry friction of the joints as laws.

    Args:
        tree: compiled model and its tree.
        dampers: whether dampers are enabled.
        friction: whether dry friction is enabled.
    """
    m = tree.compiled
    share = actuator_share(m, np.column_stack([m.actuator_damping, m.actuator_dampingpoly]), joints=True)
    laws: list[Law] = []
    rest = Damping([], [])
    for j in range(m.njnt):
        name, kind, first = tree.joint_name(j), m.jnt_type[j], int(m.jnt_dofadr[j])
        dofs = range(first, first + (6 if kind == FREE else 3 if kind == BALL else 1))
        factors = [(m.dof_damping[i] + share[j, 0], m.dof_dampingpoly[i] + share[j, 1:]) for i in dofs]
        factors = [(float(linear) * dampers, np.array(higher) * dampers) for linear, higher in factors]
        dry = [float(m.dof_frictionloss[i]) * friction for i in dofs]
        linear = factors[0][0]
        same = all(one == linear and not higher.any() for one, higher in factors)
        native = linear if kind != FREE and same and linear >= 0.0 else 0.0
        coulomb = dry[0] if kind > BALL else 0.0
        if native or coulomb:
            laws.append(JointFriction(name, coulomb=coulomb, viscous=native, name=f"{name} dynamics"))
        if native == 0.0 and any(one or higher.any() for one, higher in factors):
            rest.dofs.extend((i, *factor) for i, factor in zip(dofs, factors, strict=True))
            if kind == FREE:
                rest.floating.append((int(m.jnt_qposadr[j]) + 3, first))
        if kind <= BALL:
            laws += _dof_friction(tree, j, dofs, dry)
    if rest.dofs:
        laws.append(UserLaw(rest, reaction=None, name="damping"))
    return laws


def _dof_friction(tree: Tree, j: int, dofs: range, dry: list[float]) -> list[Law]:
    """Return separate dry friction for each degree of freedom of a ball or free joint, as in MuJoCo."""
    at = int(tree.compiled.jnt_qposadr[j]) + 3
    laws: list[Law] = []
    for k, (dof, level) in enumerate(zip(dofs, dry, strict=True)):
        if level > 0.0:
            world = len(dofs) == 6 and k < 3
            direction = DofDirection(dof, dofs[0] if world else -1, at, tree.model.nv)
            laws.append(
                UserFriction(direction, ConstantForce(level), name=f"{tree.joint_name(j)} friction {k}")
            )
    return laws


def floating_armature(tree: Tree) -> list[Force]:
    """Return the given force that reproduces MuJoCo's armature of free joints."""
    m, model = tree.compiled, tree.model
    bodies = [
        (int(m.jnt_dofadr[j]), float(model.armature[m.jnt_dofadr[j]]))
        for j in np.flatnonzero(m.jnt_type == FREE)
        if model.armature[m.jnt_dofadr[j]]
    ]
    return [UserForce(FloatingArmature(bodies), name="armature of free joints")] if bodies else []


@dataclass(frozen=True, eq=False)
class GravityCompensation:
    """Generalized force of constant forces at centers of mass, on selected degrees of freedom.

    Attributes:
        motion: kinematics of the bodies.
        lifts: joint, placement of the center of mass, and force [N].
        on: 1 for each selected degree of freedom, else 0, (nv,).
    """

    motion: Motion
    lifts: list[tuple[int, Placement, Array]]
    on: Array

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the generalized force, (nv,)."""
        self.motion.update(q)
        forces = [(joint, local, lift, np.zeros(3)) for joint, local, lift in self.lifts]
        return self.on * self.motion.generalized(q, forces)


def gravity_compensation(tree: Tree) -> tuple[list[Force], GravityCompensation | None]:
    """Return the forces at the centers of mass that compensate gravity.

    Returns:
        Given forces, and the compensation that acts through the drives of joints, whose limits apply to it.
    """
    m, lifts = tree.compiled, []
    forces: list[Force] = []
    gravity = np.array(tree.model.gravity.linear)
    driven = np.repeat(m.jnt_actgravcomp, [6 if k == FREE else 3 if k == BALL else 1 for k in m.jnt_type])
    for body in np.flatnonzero(m.body_gravcomp).tolist():
        lift = -float(m.body_mass[body] * m.body_gravcomp[body]) * gravity
        if not lift.any() or tree.bodies[body][0] == 0:
            continue
        center = translation(m.body_ipos[body])
        lifts.append((*tree.on_body(body, center), lift))
        if not driven.any():
            name = f"{tree.body_names[body]} gravity compensation"
            forces.append(Wrench(tree.add_frame(name, body, center), (*lift, 0.0, 0.0, 0.0), name=name))
    if not lifts or not driven.any():
        return forces, None
    passive = GravityCompensation(tree.motion, lifts, 1.0 - driven)
    through_drives = GravityCompensation(tree.motion, lifts, driven.astype(float))
    return [UserForce(passive, name="gravity compensation")], through_drives


def fluid_forces(tree: Tree) -> list[Law]:
    """Return the fluid forces on bodies without ellipsoids, as a law."""
    m = tree.compiled
    if not (m.opt.density or m.opt.viscosity):
        return []
    elliptic = set(m.geom_bodyid[m.geom_fluid[:, 0] > 0.0].tolist())
    boxes = []
    for body in range(1, m.nbody):
        mass, moments = float(m.body_mass[body]), np.array(m.body_inertia[body])
        if mass < MIN_MASS or body in elliptic or tree.bodies[body][0] == 0:
            continue
        edges = np.sqrt(np.maximum(MIN_MASS, moments.sum() - 2.0 * moments) / mass * 6.0)
        boxes.append((*tree.on_body(body, placement(m.body_ipos[body], m.body_iquat[body])), edges))
    law = Fluid(tree.motion, boxes, float(m.opt.density), float(m.opt.viscosity), np.array(m.opt.wind))
    return [UserLaw(law, reaction=None, name="fluid")] if boxes else []
