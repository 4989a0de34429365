"""Equalities of a compiled MJCF model as exact constraints: connect, weld, joint and tendon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pin_nonideal.description.constraints import (
    Constraint,
    FrameAnchor,
    JointCoupling,
    PointAnchor,
    PrescribedMotion,
    UserConstraint,
)
from pin_nonideal.description.time_functions import Constant
from pin_nonideal.types import Array, Placement

from .motion import FixedTendon, Tendon
from .tree import Tree, placement, translation

CONNECT, WELD, JOINT, TENDON = range(4)  # MuJoCo's mjtEq; later values are of flexes
SITE = 6  # MuJoCo's mjtObj


def equality_name(tree: Tree, index: int) -> str:
    """Return the name of an equality, or its kind and number."""
    m = tree.compiled
    adr = m.name_eqadr[index]
    kinds = ("connect", "weld", "joint", "tendon")
    kind = kinds[m.eq_type[index]] if m.eq_type[index] < len(kinds) else "flex"
    return m.names[adr : m.names.index(b"\0", adr)].decode() or f"{kind} {index + 1}"


def read_equality(tree: Tree, index: int, tendons: list[Tendon | None]) -> Constraint | None:
    """Return one equality as a constraint.

    Args:
        tree: compiled model and its tree, which receives frames.
        index: index of the equality.
        tendons: tendons from `read_tendons`.

    Returns:
        Constraint, or None for the unsupported equalities of flexes and wrapping tendons.
    """
    m, name = tree.compiled, equality_name(tree, index)
    one, two = int(m.eq_obj1id[index]), int(m.eq_obj2id[index])
    kind, numbers = int(m.eq_type[index]), np.array(m.eq_data[index])
    if kind in (CONNECT, WELD):
        return _anchor(tree, kind, one, two, numbers, m.eq_objtype[index] == SITE, name)
    if kind == JOINT:
        return _coupling(tree, one, two, numbers, name)
    if kind != TENDON or tendons[one] is None or (two >= 0 and tendons[two] is None):
        return None
    lengths = [tendons[i] for i in (one, two) if i >= 0]
    rests = [float(m.tendon_length0[i]) for i in (one, two) if i >= 0]
    return _lengths(lengths, rests, numbers, name)


def _anchor(tree: Tree, kind: int, one: int, two: int, numbers: Array, sites: bool, name: str) -> Constraint:
    """Return an anchor of points or frames, from sites or from positions on both bodies."""
    m = tree.compiled
    sides: list[tuple[int, Placement]]
    if sites:
        sides = [(int(m.site_bodyid[s]), placement(m.site_pos[s], m.site_quat[s])) for s in (one, two)]
    elif kind == CONNECT:
        sides = [(one, translation(numbers[:3])), (two, translation(numbers[3:6]))]
    else:
        sides = [(one, placement(numbers[3:6], numbers[6:10])), (two, translation(numbers[:3]))]
    first, second = (tree.add_frame(f"{name}/{i + 1}", *side) for i, side in enumerate(sides))
    whole = kind == WELD and numbers[10] != 0.0  # torquescale, zero if the weld fixes the position only
    return (FrameAnchor if whole else PointAnchor)(first, second, name=name)


def _coupling(tree: Tree, one: int, two: int, c: Array, name: str) -> Constraint:
    """Return Y - y0 = c0 + c1 (x - x0) + ... + c4 (x - x0)^4, with the reference positions x0 and y0."""
    m = tree.compiled
    y0 = float(m.qpos0[m.jnt_qposadr[one]])
    if two < 0 or not c[1:5].any():
        return PrescribedMotion(tree.joint_name(one), Constant(y0 + float(c[0])), name=name)
    x0 = float(m.qpos0[m.jnt_qposadr[two]])
    if not c[2:5].any():
        joints = tree.joint_name(one), tree.joint_name(two)
        return JointCoupling(*joints, float(c[1]), y0 + float(c[0]) - float(c[1]) * x0, name=name)
    sides = []
    for joint in (one, two):
        coefficients, row = np.zeros(tree.model.nq), np.zeros(tree.model.nv)
        coefficients[m.jnt_qposadr[joint]] = row[m.jnt_dofadr[joint]] = 1.0
        sides.append(FixedTendon(coefficients, row))
    return _lengths(sides, [y0, x0], c, name)


@dataclass(frozen=True, eq=False)
class Lengths:
    """Row Y - y0 = c0 + c1 (X - x0) + ... for two lengths, or Y - y0 = c0 for one.

    Attributes:
        lengths: Y and X, or Y only.
        rests: y0 and x0.
        c: five coefficients of the polynomial.
        needs_data: whether the row needs Pinocchio's kinematics.
    """

    needs_data: ClassVar[bool] = False
    lengths: list[Any]
    rests: list[float]
    c: Array

    def residual(self, t: float, q: Array) -> Array:
        """Return the residual, (1,)."""
        away = self.lengths[0].length(q) - self.rests[0]
        return np.array([away - (self._derivatives(q)[0] if len(self.lengths) == 2 else self.c[0])])

    def rate(self, t: float, q: Array, v: Array) -> Array:
        """Return the rate of the residual, (1,)."""
        return np.array([self._row(q) @ v])

    def __call__(self, t: float, q: Array, v: Array, data: object) -> tuple[Array, Array]:
        """Return the row and the right-hand side for the acceleration, (1, nv) and (1,)."""
        b = -self.lengths[0].drift(q, v)
        if len(self.lengths) == 2:
            _, slope, bend = self._derivatives(q)
            speed = self.lengths[1].jacobian(q) @ v
            b += slope * self.lengths[1].drift(q, v) + bend * speed**2
        return self._row(q)[None, :], np.array([b])

    def _derivatives(self, q: Array) -> tuple[float, float, float]:
        """Return the polynomial of the second length, with its first and second derivative."""
        x = self.lengths[1].length(q) - self.rests[1]
        a, b, c, d, e = self.c[:5].tolist()
        value = a + x * (b + x * (c + x * (d + x * e)))
        return value, b + x * (2.0 * c + x * (3.0 * d + x * 4.0 * e)), 2.0 * c + x * (6.0 * d + x * 12.0 * e)

    def _row(self, q: Array) -> Array:
        row = self.lengths[0].jacobian(q)
        if len(self.lengths) == 2:
            row = row - self._derivatives(q)[1] * self.lengths[1].jacobian(q)
        return np.asarray(row)


def _lengths(lengths: list[Any], rests: list[float], c: Array, name: str) -> UserConstraint:
    rows = Lengths(lengths, rests, np.array(c))
    return UserConstraint(rows, 1, residual=rows.residual, rate=rows.rate, name=name)
