"""All motions of a tree of joints at rest with dry friction: enumeration of modes and a scan of the loads.

A joint with friction sticks, or slips in one direction with the friction of its load.  Loads are sums of
norms of vectors that are affine in the friction forces.  Pinocchio's M and inverse dynamics give the vectors.
"""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

GRID = 600  # points of a scan of one load, from zero to infinity
HALVINGS = 60
# Relative margin of a condition below which rounding or the scan may decide.
CLOSE = 1e-5


class CloseError(Exception):
    """Two cases are too close to be distinguished."""


def joint_axis(model, joint):
    """Return the axis of a joint with one degree of freedom, in the joint frame."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, pin.neutral(model)[model.joints[joint].idx_q :][: model.joints[joint].nq])
    S = np.asarray(data.S).ravel()
    return S[3:] if np.any(S[3:]) else S[:3]


def bearing(model, law, wrench):
    """Return vectors whose norms add up to the load of a bearing, from its joint wrench (force, moment)."""
    joint = model.getJointId(law.joint)
    axis, f, m = joint_axis(model, joint), wrench[:3], wrench[3:]
    across = np.eye(3) - np.outer(axis, axis)
    inverse_span = 1.0 / law.span if law.span else 0.0
    if "P" in model.joints[joint].shortname().removeprefix("JointModel")[:1]:
        return [law.mu * across @ f, law.mu * inverse_span * m]
    rub = law.mu * law.radius
    return [rub * across @ f, rub * inverse_span * across @ m, law.mu * law.axial_radius * axis * (axis @ f)]


class RestingTree:
    """Tree at rest with joint friction: slip accelerations and load vectors are affine in the friction.

    Attributes:
        W, alpha0: slip accelerations are alpha0 + W f.
        constants: limits without load.
        loads: for each joint, pairs (vector without friction b, matrix B); its load is the sum of |b + B f|.
        a0, response: accelerations are a0 + response f.
    """

    def __init__(self, model, laws, q, tau):
        data, zero = model.createData(), np.zeros(model.nv)
        at = [model.joints[model.getJointId(law.joint)].idx_v for law in laws]
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        self.a0 = np.linalg.solve(M, tau - pin.rnea(model, data, q, zero, zero))
        self.response = np.linalg.solve(M, np.eye(model.nv)[:, at])
        self.W, self.alpha0 = self.response[at], self.a0[at]
        self.constants = np.array([law.coulomb + law.preload for law in laws])
        self.static_ratio = np.array([law.static_ratio for law in laws])

        def vectors(a):
            pin.rnea(model, data, q, zero, a)
            return [bearing(model, law, data.f[model.getJointId(law.joint)].vector) for law in laws]

        still, moved = vectors(self.a0), [vectors(self.a0 + column) for column in self.response.T]
        self.loads = [
            [(b, np.column_stack([m[i][k] - b for m in moved])) for k, b in enumerate(parts)]
            for i, parts in enumerate(still)
        ]

    def limits(self, f):
        """Return the kinetic limits under friction forces f, (n,) or (n, k)."""
        f = np.asarray(f)
        column = f.reshape(len(self.alpha0), -1)
        out = [
            c + sum(np.linalg.norm(b[:, None] + B @ column, axis=0) for b, B in parts)
            for c, parts in zip(self.constants, self.loads, strict=True)
        ]
        return np.array(out).reshape(f.shape)

    def solutions(self):
        """Return (modes, f) of all motions.

        Raises:
            CloseError: a case is too close to another case.
        """
        found = []
        for modes in itertools.product((0, 1, -1), repeat=len(self.alpha0)):
            for f in self.forces(np.array(modes)):
                alpha, limits = self.alpha0 + self.W @ f, self.limits(f)
                scale = np.abs(self.alpha0) + np.abs(self.W) @ np.abs(f)
                room = np.where(modes, modes * alpha / scale, 1.0 - np.abs(f) / (self.static_ratio * limits))
                if np.abs(room).min() < CLOSE:
                    raise CloseError
                if room.min() > 0.0:
                    found.append((modes, f))
        return found

    def forces(self, modes):
        """Return friction forces that hold sticking joints and are at the limit in slipping joints."""
        S, B = np.flatnonzero(modes == 0), np.flatnonzero(modes)

        def of(y):  # y: limits of slipping joints, (len(B), k)
            f = np.zeros((len(modes), y.shape[1]))
            f[B] = -modes[B, None] * y
            if len(S):
                right = self.alpha0[S, None] + self.W[np.ix_(S, B)] @ f[B]
                f[S] = -np.linalg.solve(self.W[np.ix_(S, S)], right)
            return f

        def image(y):
            return self.limits(of(y))[B]

        return [of(y[:, None])[:, 0] for y in fixed_points(image, len(B), 1.0 + self.constants.max())]


def fixed_points(image, n, size):
    """Return all y >= 0 with y = image(y) for convex components of image; n is at most 2.

    Raises:
        ValueError: n is larger than 2.
        CloseError: the scan cannot resolve the roots.
    """
    if n == 0:
        return [np.zeros(0)]
    if n == 1:
        lower, upper = convex_roots(lambda y: image(y[None])[0], 1, size)
        return [np.array([y[0]]) for y in (lower, upper) if np.isfinite(y[0])]
    if n > 2:
        raise ValueError(f"a scan of {n} loads")
    t = (np.arange(1, GRID) / GRID) ** 2
    outer = size * t / (1.0 - t)
    found = []

    def inner(y0, branch):
        """Return the limit of the second joint for limits of the first, on one of two branches."""
        return convex_roots(lambda y1: image(np.array([y0, y1]))[1], len(y0), size)[branch]

    for branch in (0, 1):

        def left(y0, branch=branch):
            y1 = inner(y0, branch)
            return np.where(
                np.isfinite(y1), image(np.array([y0, np.where(np.isfinite(y1), y1, 0.0)]))[0] - y0, np.nan
            )

        grid = refined(left, outer)
        values = left(grid)
        for k in np.flatnonzero(values[:-1] * values[1:] < 0.0):
            y0 = brentq(
                lambda y, left=left: left(np.array([y]))[0], grid[k], grid[k + 1], xtol=1e-15, rtol=1e-14
            )
            found.append(np.array([y0, inner(np.array([y0]), branch)[0]]))
        seen = np.isfinite(values)
        low = np.nanmin(np.abs(values) / (grid + size), initial=np.inf)
        if low < CLOSE and not len(found):
            raise CloseError
        for k in np.flatnonzero(seen[:-1] != seen[1:]):  # both branches meet and end there
            if abs(values[k if seen[k] else k + 1]) < 0.02 * (size + grid[k]):
                raise CloseError
    return found


def refined(function, grid):
    """Return the grid, refined at minima of |function| and at ends of its domain."""
    values = np.abs(function(grid))
    dips = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    ends = np.flatnonzero(np.isfinite(values[1:]) != np.isfinite(values[:-1]))
    more = [np.linspace(grid[max(k - 1, 0)], grid[min(k + 2, len(grid) - 1)], 400) for k in (*dips, *ends)]
    return np.unique(np.concatenate([grid, *more]))


def convex_roots(s, count, size):
    """Return both y >= 0 with y = s(y), else nan; s is convex in each of its `count` components."""

    def left(t):
        y = size * t / (1.0 - t)
        return (y - s(y)) * (1.0 - t)  # perspective of a concave function: concave in t

    low, high = np.zeros(count), np.full(count, 1.0 - 1e-9)
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    for _ in range(2 * HALVINGS):
        a, b = high - golden * (high - low), low + golden * (high - low)
        up = left(a) < left(b)
        low, high = np.where(up, a, low), np.where(up, high, b)
    top = 0.5 * (low + high)
    some = left(top) > 0.0
    roots = []
    for end in (np.zeros(count), np.full(count, 1.0 - 1e-12)):
        outside, inside = end.copy(), top.copy()
        there = some & (left(end) <= 0.0)
        for _ in range(HALVINGS):
            mid = 0.5 * (outside + inside)
            positive = left(mid) > 0.0
            inside, outside = np.where(positive, mid, inside), np.where(positive, outside, mid)
        roots.append(np.where(there, size * inside / (1.0 - inside), np.nan))
    return roots
