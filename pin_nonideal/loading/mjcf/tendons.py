"""Tendons of a compiled MJCF model: their lengths, springs, dampers and friction."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

from pin_nonideal.description.forces import Force, SpringDamper, UserForce
from pin_nonideal.description.laws import Law, UserFriction, UserLaw
from pin_nonideal.types import Array

from .motion import FixedTendon, SpatialTendon, Tendon
from .tree import Tree, actuator_share

FIXED = 0  # MuJoCo's mjtTendon
JOINT, PULLEY, SITE, SPHERE, CYLINDER = range(1, 6)  # MuJoCo's mjtWrap


def polynomial(linear: float, higher: Array, x: float) -> float:
    """Return the coefficient linear + higher[0] x + higher[1] x^2 of a force -coefficient x."""
    return float(linear + x * (higher[0] + x * higher[1]))


def read_tendons(tree: Tree) -> list[Tendon | None]:
    """Return the tendons, with None for tendons that wrap around geoms."""
    return [_tendon(tree, i) for i in range(tree.compiled.ntendon)]


def _tendon(tree: Tree, index: int) -> Tendon | None:
    m = tree.compiled
    parts = range(m.tendon_adr[index], m.tendon_adr[index] + m.tendon_num[index])
    kinds = [int(m.wrap_type[k]) for k in parts]
    if m.tendon_type[index] == FIXED:
        coefficients, row = np.zeros(tree.model.nq), np.zeros(tree.model.nv)
        for k in parts:
            joint = m.wrap_objid[k]
            coefficients[m.jnt_qposadr[joint]] += m.wrap_prm[k]
            row[m.jnt_dofadr[joint]] += m.wrap_prm[k]
        return FixedTendon(coefficients, row)
    if SPHERE in kinds or CYLINDER in kinds:
        return None
    segments, weight = [], 1.0
    for k, following in pairwise(parts):
        if m.wrap_type[k] == PULLEY:
            weight = 1.0 / float(m.wrap_prm[k])
        elif m.wrap_type[following] == SITE:
            ends = (*tree.on_site(m.wrap_objid[k]), *tree.on_site(m.wrap_objid[following]))
            segments.append((*ends, weight))
    return SpatialTendon(tree.motion, segments)


def tendon_name(tree: Tree, index: int) -> str:
    """Return the name of a tendon, or its number."""
    m = tree.compiled
    adr = m.name_tendonadr[index]
    return m.names[adr : m.names.index(b"\0", adr)].decode() or f"tendon_{index}"


@dataclass(frozen=True, eq=False)
class TendonSpring:
    """Force -k(x) x of a spring along a tendon, with a slack range of lengths.

    Attributes:
        tendon: tendon of the spring.
        stiffness: linear coefficient [N/m].
        higher: coefficients of the next powers.
        slack: lower and upper length of the range without force.
    """

    tendon: Tendon
    stiffness: float
    higher: Array
    slack: tuple[float, float]

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the generalized force, (nv,)."""
        length = self.tendon.length(q)
        x = length - min(max(length, self.slack[0]), self.slack[1])
        return -x * polynomial(self.stiffness, self.higher, x) * self.tendon.jacobian(q)


@dataclass(frozen=True, eq=False)
class TendonDamper:
    """Damping force -d(|u|) u for the rate u of a tendon's length."""

    tendon: Tendon
    damping: float
    higher: Array

    def __call__(self, t: float, q: Array, v: Array, reactions: object) -> Array:
        """Return the generalized force, (nv,)."""
        row = self.tendon.jacobian(q)
        rate = float(row @ v)
        return -rate * polynomial(self.damping, self.higher, abs(rate)) * row


@dataclass(frozen=True, eq=False)
class TendonDirection:
    """Direction of the friction of a tendon."""

    tendon: Tendon

    def __call__(self, t: float, q: Array) -> Array:
        """Return the row of the rate of the tendon's length, (nv,)."""
        return self.tendon.jacobian(q)


@dataclass(frozen=True)
class ConstantForce:
    """Constant friction force."""

    value: float

    def __call__(self, t: float, q: Array, v: Array, reactions: object) -> float:
        """Return the force [N or N m]."""
        return self.value


def tendon_forces(
    tree: Tree, tendons: list[Tendon | None], *, springs: bool, dampers: bool, friction: bool
) -> tuple[list[Law], list[Force]]:
    """Return springs as given forces, and dampers and friction as laws.

    Args:
        tree: compiled model and its tree.
        tendons: tendons from `read_tendons`; None entries are skipped.
        springs: whether springs are enabled.
        dampers: whether dampers are enabled.
        friction: whether dry friction is enabled.
    """
    m = tree.compiled
    share = actuator_share(m, np.column_stack([m.actuator_damping, m.actuator_dampingpoly]), joints=False)
    forces: list[Force] = []
    laws: list[Law] = []
    for i, tendon in enumerate(tendons):
        if tendon is None:
            continue
        name = tendon_name(tree, i)
        stiffness, stiff_poly = float(m.tendon_stiffness[i]) * springs, m.tendon_stiffnesspoly[i] * springs
        damping, damp_poly = (
            (float(m.tendon_damping[i]) + share[i, 0]) * dampers,
            (m.tendon_dampingpoly[i] + share[i, 1:]) * dampers,
        )
        slack = (float(m.tendon_lengthspring[i, 0]), float(m.tendon_lengthspring[i, 1]))
        if stiffness or stiff_poly.any():
            plain = stiffness > 0.0 and not stiff_poly.any() and slack[0] == slack[1]
            rod = _two_points(tree, i, tendon) if plain else None
            if rod is None:
                spring = TendonSpring(tendon, stiffness, np.array(stiff_poly), slack)
                forces.append(UserForce(spring, name=f"{name} spring"))
            else:
                forces.append(
                    SpringDamper(*rod, stiffness, rest_length=max(slack[0], 0.0), name=f"{name} spring")
                )
        if damping or damp_poly.any():
            damper = TendonDamper(tendon, damping, np.array(damp_poly))
            laws.append(UserLaw(damper, reaction=None, name=f"{name} damping"))
        if friction and m.tendon_frictionloss[i] > 0.0:
            level = ConstantForce(float(m.tendon_frictionloss[i]))
            laws.append(UserFriction(TendonDirection(tendon), level, name=f"{name} friction"))
    return laws, forces


def _two_points(tree: Tree, index: int, tendon: Tendon) -> tuple[str, str] | None:
    """Return the sites of a tendon that is one straight segment between bodies, for a native spring."""
    if not isinstance(tendon, SpatialTendon) or len(tendon.segments) != 1:
        return None
    joint1, _, joint2, _, weight = tendon.segments[0]
    m = tree.compiled
    if weight != 1.0 or joint1 == joint2 or m.tendon_num[index] != 2 or m.tendon_lengthspring[index, 0] < 0.0:
        return None
    first = int(m.tendon_adr[index])
    one, two = (tree.site_names[m.wrap_objid[k]] for k in (first, first + 1))
    sites = pin.FrameType.OP_FRAME
    has_unique_frames = all(sum(f.name == n for f in tree.model.frames) == 1 for n in (one, two))
    return (
        (one, two) if has_unique_frames and all(tree.model.existFrame(n, sites) for n in (one, two)) else None
    )
