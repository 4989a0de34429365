"""Accelerations of trees in long double, by the articulated-body recursion in body axes.

The recursion is Featherstone's, with 6 x 6 matrices and velocity products at each body. The recursion shares
no code with the core, which works in world axes and on the bias forces of the whole motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Long = NDArray[np.longdouble]


def _long(x: Any) -> Long:
    return np.asarray(x, dtype=np.longdouble)


def _skew(x: Long) -> Long:
    zero = x[0] * 0
    return np.array([[zero, -x[2], x[1]], [x[2], zero, -x[0]], [-x[1], x[0], zero]])


def _turned(axis: Long, cosine: Any, sine: Any) -> Long:
    K = _skew(axis)
    return _long(np.eye(3)) + sine * K + (1 - cosine) * K @ K


def _unit(x: Long) -> Long:
    return x / np.sqrt(x @ x)


def _of_quaternion(x: Long) -> Long:
    x = _unit(x)  # in double precision its length is 1 only to 1e-16
    K = _skew(x[:3])
    return _long(np.eye(3)) + 2 * x[3] * K + 2 * K @ K


def _motion_matrix(R: Long, p: Long) -> Long:
    """Return the matrix that transforms a twist (linear, angular) of the parent to a body at (R, p)."""
    X = np.zeros((6, 6), dtype=np.longdouble)
    X[:3, :3] = X[3:, 3:] = R.T
    X[:3, 3:] = -R.T @ _skew(p)
    return X


def _cross_motion(v: Long) -> Long:
    X = np.zeros((6, 6), dtype=np.longdouble)
    X[:3, :3] = X[3:, 3:] = _skew(v[3:])
    X[:3, 3:] = _skew(v[:3])
    return X


def _inertia(mass: float, lever: Any, about: Any) -> Long:
    c, Y = _skew(_long(lever)), np.zeros((6, 6), dtype=np.longdouble)
    Y[:3, :3] = mass * _long(np.eye(3))
    Y[:3, 3:], Y[3:, :3] = -mass * c, mass * c
    Y[3:, 3:] = _long(about) - mass * c @ c
    return Y


@dataclass
class _Link:
    parent: int
    R0: Long
    p0: Long
    kind: str
    S: Long
    iq: int
    iv: int
    inertia: Long


class LongTree:
    """Tree of a Pinocchio model; composite joints become chains of joints with massless bodies.

    Args:
        model: pinocchio.Model, used for its parameters only.
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self.links: list[_Link] = []
        self.body = [-1]  # link of each joint
        for i in range(1, model.njoints):
            place, Y = model.jointPlacements[i], model.inertias[i]
            inertia = _inertia(Y.mass, Y.lever, Y.inertia)
            self._add(
                self.body[model.parents[i]], model.joints[i], place.rotation, place.translation, inertia
            )
            self.body.append(len(self.links) - 1)

    def _add(self, parent: int, joint: Any, R0: Any, p0: Any, inertia: Long) -> None:
        name = joint.shortname()
        if "Composite" in name:
            parts = joint.extract()
            for k, part in enumerate(parts.joints):
                place = parts.jointPlacements[k]
                R1, p1 = _long(place.rotation), _long(place.translation)
                if k == 0:
                    R1, p1 = _long(R0) @ R1, _long(p0) + _long(R0) @ p1
                last = k + 1 == len(parts.joints)
                self._add(parent, part, R1, p1, inertia if last else np.zeros_like(inertia))
                parent = len(self.links) - 1
            return
        kinds = {"FreeFlyer": "pose", "Spherical": "ball", "Planar": "plane", "Translation": "slide"}
        kind = next((kind for part, kind in kinds.items() if part in name and "ZYX" not in name), "axis")
        data = joint.createData()
        q = np.zeros(self.model.nq)
        if joint.nq != joint.nv:
            q[joint.idx_q + {"pose": 6, "ball": 3, "plane": 2, "axis": 0}[kind]] = 1.0
        joint.calc(data, q, np.zeros(self.model.nv))
        if kind == "axis" and joint.nv != 1:
            raise ValueError(f"the recursion does not know joints of kind {name}")
        S = _long(np.reshape(data.S, (6, joint.nv)))
        kind = "circle" if kind == "axis" and joint.nq == 2 else kind
        self.links.append(_Link(parent, _long(R0), _long(p0), kind, S, joint.idx_q, joint.idx_v, inertia))

    @staticmethod
    def _moved(link: _Link, q: Long) -> tuple[Long, Long]:
        """Return rotation and translation of a joint's moving frame."""
        x, one, none = q[link.iq :], _long(np.eye(3)), _long(np.zeros(3))
        if link.kind == "pose":
            return _of_quaternion(x[3:7]), x[:3]
        if link.kind == "ball":
            return _of_quaternion(x[:4]), none
        if link.kind == "plane":
            return _turned(_long([0, 0, 1]), *_unit(x[2:4])), _long([x[0], x[1], 0])
        if link.kind == "slide":
            return one, x[:3]
        lin, ang = link.S[:3, 0], link.S[3:, 0]
        if link.kind == "circle":
            return _turned(ang, *_unit(x[:2])), none
        angle = x[0] if np.any(ang != 0) else x[0] * 0
        return _turned(ang, np.cos(angle), np.sin(angle)), lin * x[0]

    def acceleration(self, q: Any, v: Any, tau: Any, gravity: bool = True) -> Long:
        """Return the acceleration without constraints.

        Args:
            q: configuration.
            v: velocity.
            tau: joint torques.
            gravity: whether gravity acts.
        """
        q, v, tau = _long(q), _long(v), _long(tau)
        n, armature, found = len(self.links), _long(self.model.armature), _long(np.zeros(self.model.nv))
        X, velocity, c, P, p = ([None] * n for _ in range(5))
        for i, link in enumerate(self.links):
            R, r = self._moved(link, q)
            X[i] = _motion_matrix(link.R0 @ R, link.p0 + link.R0 @ r)
            rate = link.S @ v[link.iv : link.iv + link.S.shape[1]]
            before = X[i] @ velocity[link.parent] if link.parent >= 0 else rate * 0
            velocity[i] = before + rate
            turning = _cross_motion(velocity[i])
            c[i] = turning @ rate
            P[i] = link.inertia.copy()
            p[i] = -turning.T @ (link.inertia @ velocity[i])
        U, D, u = ([None] * self.model.nv for _ in range(3))
        for i in reversed(range(n)):  # one dof at a time: blocks lose digits if bodies are light
            link = self.links[i]
            for k in reversed(range(link.S.shape[1])):
                dof, s = link.iv + k, link.S[:, k]
                U[dof] = P[i] @ s
                D[dof], u[dof] = s @ U[dof] + armature[dof], tau[dof] - s @ p[i]
                P[i] = P[i] - np.outer(U[dof], U[dof]) / D[dof]
                p[i] = p[i] + U[dof] * u[dof] / D[dof]
            if link.parent >= 0:
                P[link.parent] = P[link.parent] + X[i].T @ P[i] @ X[i]
                p[link.parent] = p[link.parent] + X[i].T @ (p[i] + P[i] @ c[i])
        a = [None] * n
        fall = _long([*-self.model.gravity.linear, 0, 0, 0]) * (1 if gravity else 0)
        for i, link in enumerate(self.links):
            a[i] = X[i] @ (a[link.parent] if link.parent >= 0 else fall) + c[i]
            for k in range(link.S.shape[1]):
                dof = link.iv + k
                found[dof] = (u[dof] - U[dof] @ a[i]) / D[dof]
                a[i] = a[i] + link.S[:, k] * found[dof]
        return found

    def constrained(self, q: Any, v: Any, tau: Any, A: Any, b: Any) -> Long:
        """Return the acceleration under A a = b with independent rows."""
        A, free = _long(A), self.acceleration(q, v, tau)
        still = np.zeros(self.model.nv)
        response = np.array([self.acceleration(q, still, row, gravity=False) for row in A]).T
        return free + response @ _solver(A @ response)(_long(b) - A @ free)


def _solver(S: Long) -> Any:
    """Return a solver for a small matrix: x -> S^-1 x, by Gauss-Jordan elimination with pivoting."""
    inverse, n = np.hstack([S, _long(np.eye(len(S)))]), len(S)
    for k in range(n):
        best = k + int(np.argmax(np.abs(inverse[k:, k])))
        inverse[[k, best]] = inverse[[best, k]]
        inverse[k] = inverse[k] / inverse[k, k]
        for other in range(n):
            if other != k:
                inverse[other] = inverse[other] - inverse[other, k] * inverse[k]
    return lambda x: inverse[:, n:] @ x
