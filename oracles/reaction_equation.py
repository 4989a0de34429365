"""Implicit reaction equation y = g(y) of slipping friction by inverse dynamics, and all its roots.

y contains the friction limit of each element.  Given y, each element slips along its velocity, and the
motion and every load vector are affine in y: g_i(y) = c_i + sum_k w_k |b_k + P_k y|.  A dense scan covers all
y >= 0, mapped onto a unit box.  Newton's method starts in every cell where all components change sign.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from .applied_forces import applied_force, mass_matrix
from .frames import Frames
from .rows import rows

# Points of the scan along each axis, by the number of unknowns: about 10^4 values of g in total.
SCAN = {1: 4001, 2: 101, 3: 25}
MOST_CELLS = 150  # cells of the scan, sampled at random
STARTS = 40  # random starts of Newton's method in addition to the scan
SOLVED = 1e-12  # relative residual of a root
SAME = 1e-7  # relative distance below which two roots are one
# Determinant or smallest residual of a scan below which the number of solutions is uncertain.
DOUBTFUL = 1e-4
UNLOADED = 1e-10  # friction limit of an unloaded bearing [N m or N]


@dataclass
class Equation:
    """Constants c and, for each norm of a load, its element, weight w, offset b (3,) and columns P (3, n)."""

    constant: np.ndarray
    element: list[int] = field(default_factory=list)
    weight: list[float] = field(default_factory=list)
    offset: list[np.ndarray] = field(default_factory=list)
    columns: list[np.ndarray] = field(default_factory=list)

    @property
    def n(self):
        return len(self.constant)

    def image(self, y):
        """Return g at many points, (m, n)."""
        g = np.broadcast_to(self.constant, y.shape).copy()
        for i, w, b, P in zip(self.element, self.weight, self.offset, self.columns, strict=True):
            g[:, i] += w * np.linalg.norm(b + y @ P.T, axis=1)
        return g

    def slope(self, y):
        """Return dg/dy at one point."""
        J = np.zeros((self.n, self.n))
        for i, w, b, P in zip(self.element, self.weight, self.offset, self.columns, strict=True):
            load = b + P @ y
            J[i] += w * load @ P / max(np.linalg.norm(load), 1e-300)
        return J

    def steepest(self):
        """Return an upper bound of |dg_i/dy_j| over all y."""
        L = np.zeros((self.n, self.n))
        for i, w, P in zip(self.element, self.weight, self.columns, strict=True):
            L[i] += w * np.linalg.norm(P, axis=0)
        return L

    def scale(self):
        """Return g(0), the limits for loads without friction, at least 1e-12."""
        return np.maximum(self.image(np.zeros((1, self.n)))[0], 1e-12)

    def polished(self, y):
        """Return the root that Newton's method reaches from y, or None."""
        for _ in range(60):
            residual = self.image(y[None])[0] - y
            if not np.isfinite(residual).all() or np.abs(y).max() > 1e12:
                return None
            if np.abs(residual).max() <= SOLVED * np.abs(y).max():
                return y if (y >= -SOLVED * np.abs(y).max()).all() else None
            try:
                y = y + np.linalg.solve(np.eye(self.n) - self.slope(y), residual)
            except np.linalg.LinAlgError:
                return None
        return None

    def leaves_unloaded(self):
        """Check if some bearing is unloaded without friction: rounding then decides its load direction."""
        return bool((self.image(np.zeros((1, self.n))) < UNLOADED).any())

    def roots(self, rng, others=()):
        """Return all solutions y, (k, n), and whether their number is uncertain.

        Newton's method also starts from `others`, solutions from another source.
        """
        scale, points = self.scale(), SCAN[self.n]
        axis = (np.arange(points) + 0.31) / points
        grid = np.stack(np.meshgrid(*[axis / (1.0 - axis)] * self.n, indexing="ij"), axis=-1) * scale
        F = (self.image(grid.reshape(-1, self.n)).reshape(grid.shape) - grid) / (scale + grid)
        turns = np.ones((points - 1,) * self.n, dtype=bool)
        for i in range(self.n):
            low, high = np.full(turns.shape, np.inf), np.full(turns.shape, -np.inf)
            for corner in itertools.product((slice(None, -1), slice(1, None)), repeat=self.n):
                low, high = np.minimum(low, F[(*corner, i)]), np.maximum(high, F[(*corner, i)])
            turns &= (low <= 0.0) & (high >= 0.0)
        cells = np.argwhere(turns)
        if len(cells) > MOST_CELLS:
            cells = cells[rng.choice(len(cells), MOST_CELLS, replace=False)]
        starts = [grid[tuple(cell)] for cell in cells]
        starts += [scale * 10.0 ** rng.uniform(-2.0, 3.0, self.n) for _ in range(STARTS)]
        starts += [np.asarray(y, dtype=float) for y in others]
        found = []
        for start in starts:
            y = self.polished(start)
            if y is not None and not any(np.abs(y - x).max() <= SAME * np.abs(x).max() for x in found):
                found.append(y)
        dets = [np.linalg.det(np.eye(self.n) - self.slope(y)) for y in found]
        touches = not found and float(np.abs(F).max(axis=-1).min()) < DOUBTFUL
        infinite = abs(np.linalg.det(np.eye(self.n) - self.steepest())) < DOUBTFUL
        doubtful = touches or infinite or any(abs(d) < DOUBTFUL for d in dets)
        return np.array(found).reshape(-1, self.n), doubtful


def equation(scene, q, v, t=0.0):
    """Return the equation of a scene in which every friction element slips.

    Args:
        scene: scene with JointFriction at joints of the tree, or at hinge anchors only.
        q: configuration.
        v: velocity.
        t: time [s].
    """
    slips, laws = _slips(scene, q, v), scene.laws
    n = len(laws)
    motions = [_loads(scene, q, v, t, -np.asarray(slips).T @ y) for y in (np.zeros(n), *np.eye(n))]
    made = Equation(np.zeros(n))
    for i, law in enumerate(laws):
        factor = 1.0
        if law.stribeck_velocity is not None:
            speed = np.linalg.norm(_speed(scene, law, q, v))
            factor += (law.static_ratio - 1.0) * np.exp(-((speed / law.stribeck_velocity) ** 2))
        made.constant[i] = factor * (law.coulomb + law.preload)
        for k, (weight, offset) in enumerate(motions[0][0][i]):
            made.element.append(i)
            made.weight.append(factor * weight)
            made.offset.append(offset)
            made.columns.append(np.column_stack([motions[1 + j][0][i][k][1] - offset for j in range(n)]))
    return made


def acceleration(scene, q, v, y, t=0.0):
    """Return the acceleration under friction with the limits y."""
    return _loads(scene, q, v, t, -np.asarray(_slips(scene, q, v)).T @ y)[1]


def _speed(scene, law, q, v):
    """Return the slip velocity of an element."""
    anchor = {c.name: c for c in scene.constraints}.get(law.joint)
    if anchor is None:
        joint = scene.model.joints[scene.model.getJointId(law.joint)]
        return v[joint.idx_v : joint.idx_v + joint.nv]
    return np.atleast_1d(_turning(scene, anchor, q, v) @ v)


def _turning(scene, anchor, q, v):
    """Return the row of the relative angular velocity about the axis of a hinge anchor."""
    frames = Frames(scene.model, q, v)
    one, two = frames(anchor.frame1), frames(anchor.frame2)
    return one.R[:, 2] @ (one.Jw - two.Jw)


def _slips(scene, q, v):
    """Return the generalized slip direction of each element, (n, nv)."""
    anchors = {c.name: c for c in scene.constraints}
    found = []
    for law in scene.laws:
        u = _speed(scene, law, q, v)
        if law.joint in anchors:
            found.append(np.sign(u[0]) * _turning(scene, anchors[law.joint], q, v))
            continue
        joint = scene.model.joints[scene.model.getJointId(law.joint)]
        row = np.zeros(scene.model.nv)
        row[joint.idx_v : joint.idx_v + joint.nv] = u / np.linalg.norm(u)
        found.append(row)
    return found


def _loads(scene, q, v, t, C):
    """Return (weight, vector) of each norm in each load, and the acceleration, under the force C."""
    model, data = scene.model, scene.model.createData()
    M, given = mass_matrix(model, q), applied_force(scene, Frames(model, q, v), t)
    bias = pin.nonLinearEffects(model, data, q, v)
    A, b = rows(scene, q, v, t)
    if len(A):
        K = np.block([[M, -A.T], [A, np.zeros((len(A), len(A)))]])
        x = np.linalg.solve(K, np.concatenate([given - bias + C, b]))
        a, lam = x[: model.nv], x[model.nv :]
        return [_anchor_loads(law, lam[scene.constraint_slices[law.joint]]) for law in scene.laws], a
    a = np.linalg.solve(M, given - bias + C)
    pin.framesForwardKinematics(model, data, q)
    outside = [pin.Force.Zero() for _ in range(model.njoints)]
    for force in scene.forces:
        placement = data.oMf[model.getFrameId(force.frame)]
        joint = model.frames[model.getFrameId(force.frame)].parentJoint
        value = np.asarray(force.value, float)
        at_joint = pin.SE3(data.oMi[joint].rotation.T, np.zeros(3)).act(pin.Force(value[:3], value[3:]))
        lever = data.oMi[joint].actInv(placement.translation)
        outside[joint] += pin.Force(at_joint.linear, at_joint.angular + np.cross(lever, at_joint.linear))
    pin.rnea(model, data, q, v, a, outside)
    return [_joint_loads(model, law, data.f[model.getJointId(law.joint)]) for law in scene.laws], a


def _joint_loads(model, law, f):
    joint = model.joints[model.getJointId(law.joint)]
    if joint.nv == 3:
        return [(law.mu * law.radius, f.linear.copy())]
    axis = _axis(joint)
    axial = (f.linear @ axis) * axis
    if joint.shortname().startswith("JointModelP"):
        moment = [(law.mu / law.span, f.angular.copy())] if law.span else []
        return [(law.mu, f.linear - axial), *moment]
    bending = f.angular - (f.angular @ axis) * axis
    bends = [(law.mu * law.radius / law.span, bending)] if law.span else []
    return [(law.mu * law.radius, f.linear - axial), *bends, (law.mu * law.axial_radius, axial)]


def _axis(joint):
    """Return the axis of a joint with one degree of freedom, in the joint frame."""
    data = joint.createData()
    joint.calc(data, np.zeros(joint.nq), np.zeros(joint.nv))
    S = np.asarray(data.S).reshape(6, -1)[:, 0]
    part = S[:3] if np.linalg.norm(S[:3]) > 0.5 else S[3:]
    return part / np.linalg.norm(part)


def _anchor_loads(law, lam):
    axial = np.array([0.0, 0.0, lam[2]])  # the hinge axis of the anchors is z
    bends = [(law.mu * law.radius / law.span, np.array([*lam[3:], 0.0]))] if law.span else []
    return [(law.mu * law.radius, np.array([*lam[:2], 0.0])), *bends, (law.mu * law.axial_radius, axial)]
