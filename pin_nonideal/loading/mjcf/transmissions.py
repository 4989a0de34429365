"""Transmissions of MJCF actuators: length and moment arms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, Placement

from .forces import rotation
from .motion import FixedTendon, Motion, Tendon
from .tree import BALL, FREE, Tree

JOINT, JOINT_IN_PARENT, SLIDER_CRANK, TENDON, SITE, BODY = range(6)  # MuJoCo's mjtTrn


@dataclass(frozen=True, eq=False)
class GearedLength:
    """Tendon, or joint of one degree of freedom, with a gear."""

    tendon: Tendon
    gear: float

    def rows(self, q: Array) -> tuple[float, Array]:
        """Return length and moment arms, (nv,)."""
        return self.gear * self.tendon.length(q), self.gear * self.tendon.jacobian(q)


@dataclass(frozen=True, eq=False)
class _OnTurn:
    """Joint with a quaternion.

    Attributes:
        at: index of the quaternion in q.
        dof: first degree of freedom.
        gear: gear vector, (3,) for a ball joint, (6,) for a free joint.
        in_parent: whether the rotational gear is given in the axes of the parent or the world, or of the
            body.
        size: number of degrees of freedom.
    """

    at: int
    dof: int
    gear: Array
    in_parent: bool
    size: int


class OnBall(_OnTurn):
    """Ball joint: rotation vector along the gear's axis, in the axes of the body or its parent."""

    def rows(self, q: Array) -> tuple[float, Array]:
        """Return length and moment arms, (nv,)."""
        turn, row = rotation(q, self.at), np.zeros(self.size)
        row[self.dof : self.dof + 3] = axis = turn.T @ self.gear if self.in_parent else self.gear
        return float(pin.log3(turn) @ axis), row


class OnFree(_OnTurn):
    """Free joint: a force in world axes and a moment in axes of the body or the world, without a length."""

    def rows(self, q: Array) -> tuple[float, Array]:
        """Return length and moment arms, (nv,)."""
        back, row = rotation(q, self.at).T, np.zeros(self.size)
        row[self.dof : self.dof + 3] = back @ self.gear[:3]
        row[self.dof + 3 : self.dof + 6] = back @ self.gear[3:] if self.in_parent else self.gear[3:]
        return 0.0, row


@dataclass(frozen=True, eq=False)
class OnSite:
    """Wrench on a site in its own axes, or between a site and a reference site in the axes of the latter.

    Attributes:
        motion: kinematics of the bodies.
        site: joint and placement of the site.
        reference: joint and placement of the reference site, or None.
        gear: force and moment, (6,).
        shared: degrees of freedom that move both sites, and are not loaded by the wrench.
    """

    motion: Motion
    site: tuple[int, Placement]
    reference: tuple[int, Placement] | None
    gear: Array
    shared: Array

    def rows(self, q: Array) -> tuple[float, Array]:
        """Return length and moment arms, (nv,)."""
        self.motion.update(q)
        placement = self.motion.place(*self.site)
        frame = placement if self.reference is None else self.motion.place(*self.reference)
        force, moment = frame.rotation @ self.gear[:3], frame.rotation @ self.gear[3:]
        forces = [(*self.site, force, moment)]
        if self.reference is None:
            return 0.0, self.motion.generalized(q, forces)
        row = self.motion.generalized(q, [*forces, (*self.reference, -force, -moment)])
        row[self.shared] = 0.0
        between = frame.actInv(placement)
        length = between.translation @ self.gear[:3] + pin.log3(between.rotation) @ self.gear[3:]
        return float(length), row


@dataclass(frozen=True, eq=False)
class SliderCrank:
    """Crank pin on a rod of given length to a slider along the z axis of a site.

    Attributes:
        motion: kinematics of the bodies.
        crank: joint and placement of the pin.
        slider: joint and placement of the slider's axis.
        rod: length of the rod [m].
        gear: gear ratio of the transmission.
    """

    motion: Motion
    crank: tuple[int, Placement]
    slider: tuple[int, Placement]
    rod: float
    gear: float

    def rows(self, q: Array) -> tuple[float, Array]:
        """Return length and moment arms, (nv,)."""
        self.motion.update(q)
        pin_place, guide = self.motion.place(*self.crank), self.motion.place(*self.slider)
        vector, axis = pin_place.translation - guide.translation, guide.rotation[:, 2]
        along = float(vector @ axis)
        inside = along**2 + self.rod**2 - float(vector @ vector)
        length, by_axis, by_vector = along, vector, axis
        if inside > 0.0:
            root = float(np.sqrt(inside))
            length -= root
            by_axis = (1.0 - along / root) * vector
            by_vector = (1.0 - along / root) * axis + vector / root
        force, moment = self.gear * by_vector, self.gear * np.cross(axis, by_axis)
        forces = [(*self.crank, force, np.zeros(3)), (*self.slider, -force, moment)]
        return self.gear * length, self.motion.generalized(q, forces)


Transmission = GearedLength | OnBall | OnFree | OnSite | SliderCrank


def read_transmission(tree: Tree, actuator: int, tendons: list[Tendon | None]) -> Transmission | None:
    """Return the transmission of an actuator, or None if unsupported (tendons that wrap, bodies, SO(3))."""
    m, nv = tree.compiled, tree.model.nv
    kind, (one, two) = int(m.actuator_trntype[actuator]), m.actuator_trnid[actuator]
    gear = np.array(m.actuator_gear[m.actuator_outadr[actuator]])
    if kind in (JOINT, JOINT_IN_PARENT):
        at, dof = int(m.jnt_qposadr[one]), int(m.jnt_dofadr[one])
        if m.jnt_type[one] == FREE:
            return OnFree(at + 3, dof, gear, kind == JOINT_IN_PARENT, nv)
        if m.jnt_type[one] == BALL:
            return OnBall(at, dof, gear[:3], kind == JOINT_IN_PARENT, nv)
        coordinate, row = np.zeros(tree.model.nq), np.zeros(nv)
        coordinate[at] = row[dof] = 1.0
        return GearedLength(FixedTendon(coordinate, row), float(gear[0]))
    if kind == TENDON:
        tendon = tendons[one]
        return None if tendon is None else GearedLength(tendon, float(gear[0]))
    if kind == SITE:
        reference = None if two < 0 else tree.on_site(two)
        shared = np.zeros(0, dtype=int) if reference is None else _common_dofs(tree, one, two)
        return OnSite(tree.motion, tree.on_site(one), reference, gear, shared)
    if kind == SLIDER_CRANK:
        rod = float(m.actuator_cranklength[actuator])
        return SliderCrank(tree.motion, tree.on_site(one), tree.on_site(two), rod, float(gear[0]))
    return None


def _common_dofs(tree: Tree, one: int, two: int) -> Any:
    """Return the degrees of freedom of the joints that move both sites."""
    model = tree.model
    chains = [set(model.supports[tree.on_site(site)[0]]) - {0} for site in (one, two)]
    joints = chains[0] & chains[1]
    return np.array(
        [i for j in joints for i in range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])], dtype=int
    )
