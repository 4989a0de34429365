"""Kinematics of bodies and generalized forces, for the forces of MJCF files that are computed in Python."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, Model, Placement


class Motion:
    """Kinematics of a model without gravity, with a separate state for each thread.

    Args:
        model: pinocchio.Model.
    """

    def __init__(self, model: Model) -> None:
        self.model = model.copy()
        self.model.gravity = pin.Motion.Zero()
        self._threads = threading.local()
        self._none = np.zeros(model.nv)

    def __reduce__(self) -> tuple[type[Motion], tuple[Model]]:
        return Motion, (self.model,)

    @property
    def data(self) -> pin.Data:
        """Return the pinocchio.Data of the current thread."""
        if not hasattr(self._threads, "data"):
            self._threads.data = self.model.createData()
        return self._threads.data

    def update(self, q: Array, v: Array | None = None) -> None:
        """Compute placements, velocities and accelerations of all joints, for zero joint accelerations."""
        pin.forwardKinematics(self.model, self.data, q, self._none if v is None else v, self._none)

    def place(self, joint: int, local: Placement) -> Placement:
        """Return the world placement of a placement on a joint."""
        return self.data.oMi[joint] * local

    def velocity(self, joint: int, local: Placement) -> pin.Motion:
        """Return the velocity of a placement on a joint, a pinocchio.Motion in its own axes."""
        return local.actInv(self.data.v[joint])

    def drift(self, joint: int, local: Placement) -> Array:
        """Return the acceleration of a placement's origin for zero joint accelerations, in world axes."""
        v, a = local.actInv(self.data.v[joint]), local.actInv(self.data.a[joint])
        drift = a.linear + np.cross(v.angular, v.linear)
        return np.asarray(self.place(joint, local).rotation @ drift)

    def generalized(self, q: Array, forces: Iterable[tuple[int, Placement, Array, Array]]) -> Array:
        """Return the generalized force of forces and moments in world axes at placements on joints, (nv,).

        Args:
            q: configuration of the last call of `update`.
            forces: joint, placement on the joint, force and moment.
        """
        on = [pin.Force.Zero() for _ in range(self.model.njoints)]
        for joint, local, force, moment in forces:
            turn = self.place(joint, local).rotation.T
            on[joint] += local.act(pin.Force(turn @ force, turn @ moment))
        total = pin.StdVec_Force()
        total.extend(on)
        return -np.asarray(pin.computeStaticTorque(self.model, self.data, q, total))


@dataclass(frozen=True, eq=False)
class FixedTendon:
    """Length that is a weighted sum of joint coordinates.

    Attributes:
        coefficients: weights of the coordinates, (nq,).
        row: weights by degree of freedom, (nv,).
    """

    coefficients: Array
    row: Array

    def length(self, q: Array) -> float:
        """Return the length [m or rad]."""
        return float(self.coefficients @ q)

    def jacobian(self, q: Array) -> Array:
        """Return the row of d length/dt = row . v, (nv,)."""
        del q
        return self.row

    def drift(self, q: Array, v: Array) -> float:
        """Return the second derivative of the length for zero acceleration."""
        del q, v
        return 0.0


@dataclass(frozen=True, eq=False)
class SpatialTendon:
    """Weighted length of straight segments between points on bodies.

    Attributes:
        motion: kinematics of the bodies.
        segments: joint and placement of both ends, and the weight (one over the divisor of the pulley).
    """

    motion: Motion
    segments: Sequence[tuple[int, Placement, int, Placement, float]]

    def length(self, q: Array) -> float:
        """Return the length [m]."""
        self.motion.update(q)
        return sum(weight * float(np.linalg.norm(self._across(s))) for *s, weight in self.segments)

    def jacobian(self, q: Array) -> Array:
        """Return the row of d length/dt = row . v, (nv,)."""
        self.motion.update(q)
        forces = []
        for joint1, p1, joint2, p2, weight in self.segments:
            along = self._across((joint1, p1, joint2, p2))
            distance = float(np.linalg.norm(along))
            if joint1 == joint2 or distance == 0.0:
                continue
            pull = weight / distance * along
            forces += [(joint1, p1, -pull, np.zeros(3)), (joint2, p2, pull, np.zeros(3))]
        return self.motion.generalized(q, forces)

    def drift(self, q: Array, v: Array) -> float:
        """Return the second derivative of the length for zero acceleration [m/s^2]."""
        self.motion.update(q, v)
        total = 0.0
        for joint1, p1, joint2, p2, weight in self.segments:
            along = self._across((joint1, p1, joint2, p2))
            distance = float(np.linalg.norm(along))
            if joint1 == joint2 or distance == 0.0:
                continue
            along = along / distance
            rate = self._velocity(joint2, p2) - self._velocity(joint1, p1)
            across = rate - (rate @ along) * along
            curve = self.motion.drift(joint2, p2) - self.motion.drift(joint1, p1)
            total += weight * float(along @ curve + across @ across / distance)
        return total

    def _across(self, ends: Sequence[Any]) -> Array:
        joint1, p1, joint2, p2 = ends
        first, second = self.motion.place(joint1, p1), self.motion.place(joint2, p2)
        return np.asarray(second.translation - first.translation)

    def _velocity(self, joint: int, local: Placement) -> Array:
        return np.asarray(
            self.motion.place(joint, local).rotation @ self.motion.velocity(joint, local).linear
        )


Tendon = FixedTendon | SpatialTendon
