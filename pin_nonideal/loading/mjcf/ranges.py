"""Ranges of tendons and ball joints of a compiled MJCF model as unilateral contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pin_nonideal.description.contacts import UserContact
from pin_nonideal.types import Array

from .motion import Tendon
from .tendons import tendon_name
from .tree import BALL, Tree


@dataclass(frozen=True, eq=False)
class TendonBound:
    """Gap sign (L - bound) of one bound of a tendon's length L.

    Attributes:
        tendon: tendon of the bound.
        bound: length [m or rad].
        sign: 1 for a lower bound, -1 for an upper bound.
    """

    needs_data: ClassVar[bool] = False
    tendon: Tendon
    bound: float
    sign: float

    def gap(self, t: float, q: Array) -> float:
        """Return the gap [m or rad]."""
        return self.sign * (self.tendon.length(q) - self.bound)

    def rate(self, t: float, q: Array, v: Array) -> float:
        """Return the rate of the gap."""
        return float(self.sign * (self.tendon.jacobian(q) @ v))

    def __call__(self, t: float, q: Array, v: Array, data: object) -> tuple[Array, Array]:
        """Return the row and the right-hand side for the acceleration, (1, nv) and (1,)."""
        row = self.sign * self.tendon.jacobian(q)
        return row[None, :], np.array([-self.sign * self.tendon.drift(q, v)])


@dataclass(frozen=True, eq=False)
class BallBound:
    """Gap between the rotation angle of a ball joint and its largest value.

    The angle theta of a rotation with the unit quaternion (x, w) is 2 arccos |w|, where w is the scalar. The
    gap is 2 (|w| - cos(bound/2)) / sin(bound/2), which is smooth at theta = 0. The derivative of the gap with
    respect to theta is -1 at the bound, so the multiplier is the torque of the stop [N m].

    Attributes:
        first: index of the quaternion in q, in the order x, y, z, w.
        dof: index of the angular velocity in v, in axes of the body.
        nv: degrees of freedom of the model.
        bound: largest angle [rad], above 0 and below pi.
    """

    needs_data: ClassVar[bool] = False
    first: int
    dof: int
    nv: int
    bound: float

    def gap(self, t: float, q: Array) -> float:
        """Return the gap [rad], to first order at the bound."""
        return self._scale * (abs(float(q[self.first + 3])) - math.cos(0.5 * self.bound))

    def rate(self, t: float, q: Array, v: Array) -> float:
        """Return the rate of the gap [rad/s]."""
        return float(self._row(q) @ v)

    def __call__(self, t: float, q: Array, v: Array, data: object) -> tuple[Array, Array]:
        """Return the row and the right-hand side for the acceleration, (1, nv) and (1,)."""
        turning = v[self.dof : self.dof + 3]
        b = 0.25 * self._scale * abs(float(q[self.first + 3])) * float(turning @ turning)
        return self._row(q)[None, :], np.array([b])

    @property
    def _scale(self) -> float:
        return 2.0 / math.sin(0.5 * self.bound)

    def _row(self, q: Array) -> Array:
        x, w = q[self.first : self.first + 3], q[self.first + 3]
        row = np.zeros(self.nv)
        row[self.dof : self.dof + 3] = -0.5 * self._scale * math.copysign(1.0, w) * x
        return row


def read_ranges(tree: Tree, tendons: list[Tendon | None]) -> list[UserContact]:
    """Return the ranges of tendons and ball joints, "NAME lower" and "NAME upper", as contacts.

    Ranges of tendons that wrap, ranges of equal bounds, and angles from pi on give no contact.

    Args:
        tree: compiled model and its tree.
        tendons: tendons from `read_tendons`.
    """
    m, model = tree.compiled, tree.model
    contacts = []
    for j in np.flatnonzero(m.jnt_limited).tolist():
        bound = float(max(m.jnt_range[j]))
        if m.jnt_type[j] == BALL and 0.0 < bound < math.pi:
            joint = model.getJointId(tree.joint_name(j))
            ball = BallBound(model.idx_qs[joint], model.idx_vs[joint], model.nv, bound)
            contacts.append(_contact(ball, f"{tree.joint_name(j)} upper"))
    for i in np.flatnonzero(m.tendon_limited).tolist():
        tendon, (lower, upper) = tendons[i], m.tendon_range[i].tolist()
        if tendon is not None and lower < upper:
            name = f"tendon {tendon_name(tree, i)}"
            contacts.append(_contact(TendonBound(tendon, lower, 1.0), f"{name} lower"))
            contacts.append(_contact(TendonBound(tendon, upper, -1.0), f"{name} upper"))
    return contacts


def _contact(bound: TendonBound | BallBound, name: str) -> UserContact:
    return UserContact(bound, bound.gap, bound.rate, name=name)
