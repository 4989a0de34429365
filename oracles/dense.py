"""Reference mechanics in a few lines: body by body, dense, in world axes, by no algorithm of Pinocchio.

M = sum_i m_i J_c^T J_c + J_w^T I_i J_w, and the same sums with the accelerations at rest give the bias force.
The constrained acceleration solves [M A^T; A 0] [a; -lam] = [F; b] as one dense system.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]


def skew(w: Array) -> Array:
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def turned(axis: Array, angle: float) -> Array:
    """Rotation matrix of an angle about a unit axis (Rodrigues)."""
    K = skew(axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def of_quaternion(x: Array) -> Array:
    """Rotation matrix of the quaternion (x, y, z, w)."""
    u, w = x[:3], x[3]
    K = skew(u)
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


class DenseTree:
    """A tree of revolute joints, on the ground or on one floating base.

    Args:
        model: pinocchio.Model; only its numbers are read.
        anchors: (joint 1, point in it, joint 2 or 0 for the world, point in it, axes as indices).
        forces: (t, tree) -> generalized force, (nv,), after `update`.
    """

    def __init__(
        self, model: Any, anchors: Sequence[tuple[int, Array, int, Array, list[int]]] = (), forces: Any = None
    ):
        self.n, self.nv, self.nq = model.njoints, model.nv, model.nq
        self.anchors, self.forces = list(anchors), forces
        self.gravity = np.array(model.gravity.linear)
        self.armature = np.array(model.armature)
        self.parents = list(model.parents)
        self.places = [(M.rotation.copy(), M.translation.copy()) for M in model.jointPlacements]
        self.bodies = [(Y.mass, Y.lever.copy(), Y.inertia.copy()) for Y in model.inertias]
        self.iq, self.iv = [j.idx_q for j in model.joints], [j.idx_v for j in model.joints]
        self.free, self.axes = [False] * self.n, [np.zeros(3)] * self.n
        for i in range(1, self.n):
            kind = model.joints[i].shortname()
            if kind == "JointModelFreeFlyer":
                self.free[i] = True
            elif kind in ("JointModelRX", "JointModelRY", "JointModelRZ"):
                self.axes[i] = np.eye(3)["XYZ".index(kind[-1])]
            else:
                raise ValueError(
                    f"the reference knows revolute joints about x, y, z and free flyers; got {kind}"
                )

    def update(self, q: Array, v: Array) -> None:
        """Placements, velocities, Jacobians and accelerations at zero joint acceleration."""
        n, nv = self.n, self.nv
        self.q, self.v = q, v
        self.R, self.p = [np.eye(3)] * n, [np.zeros(3)] * n
        self.w, self.u, self.dw, self.du = (
            [np.zeros(3)] * n for _ in range(4)
        )  # rates of turning, of the origin
        self.Jw, self.Jp = [np.zeros((3, nv))] * n, [np.zeros((3, nv))] * n
        for i in range(1, n):
            k, j, j0 = self.parents[i], self.iv[i], self.iq[i]
            R0, p0 = self.places[i]
            arm = self.R[k] @ p0
            W = skew(self.w[k])
            R, p = self.R[k] @ R0, self.p[k] + arm
            u = self.u[k] + W @ arm
            du = self.du[k] + skew(self.dw[k]) @ arm + W @ W @ arm
            Jw, Jp = self.Jw[k].copy(), self.Jp[k] - skew(arm) @ self.Jw[k]
            if self.free[i]:  # on the ground only: q = (place, quaternion), v in the moving axes
                p = p + R @ q[j0 : j0 + 3]
                R = R @ of_quaternion(q[j0 + 3 : j0 + 7])
                u, w = R @ v[j : j + 3], R @ v[j + 3 : j + 6]
                du, dw = np.cross(w, u), np.zeros(3)
                Jp[:, j : j + 3], Jw[:, j + 3 : j + 6] = R, R
            else:
                axis = R @ self.axes[i]
                R = R @ turned(self.axes[i], q[j0])
                w = self.w[k] + axis * v[j]
                dw = self.dw[k] + np.cross(self.w[k], axis) * v[j]
                Jw[:, j] = axis
            self.R[i], self.p[i], self.u[i], self.w[i], self.du[i], self.dw[i] = R, p, u, w, du, dw
            self.Jw[i], self.Jp[i] = Jw, Jp

    def mass_and_bias(self) -> tuple[Array, Array]:
        """M, and the forces of gravity and of the motion itself."""
        M, h = np.diag(self.armature), np.zeros(self.nv)
        for i in range(1, self.n):
            mass, lever, inertia = self.bodies[i]
            arm = self.R[i] @ lever
            turn = self.R[i] @ inertia @ self.R[i].T
            J = self.Jp[i] - skew(arm) @ self.Jw[i]
            W = skew(self.w[i])
            acceleration = self.du[i] + skew(self.dw[i]) @ arm + W @ W @ arm - self.gravity
            M += mass * J.T @ J + self.Jw[i].T @ turn @ self.Jw[i]
            h += mass * J.T @ acceleration + self.Jw[i].T @ (turn @ self.dw[i] + W @ turn @ self.w[i])
        return M, h

    def point(self, joint: int, place: Array) -> tuple[Array, Array, Array, Array]:
        """Position, velocity, acceleration at rest and Jacobian of a point of a body."""
        arm = self.R[joint] @ place
        W = skew(self.w[joint])
        return (
            self.p[joint] + arm,
            self.u[joint] + W @ arm,
            self.du[joint] + skew(self.dw[joint]) @ arm + W @ W @ arm,
            self.Jp[joint] - skew(arm) @ self.Jw[joint],
        )

    def rows(self) -> tuple[Array, Array]:
        """A and b of the anchors; a joint 2 other than the world must share the plane or all axes."""
        A, b = [], []
        for joint1, place1, joint2, place2, axes in self.anchors:
            one, two = self.point(joint1, place1), self.point(joint2, place2)
            A.append((one[3] - two[3])[axes])
            b.append((two[2] - one[2])[axes])
        return np.vstack(A), np.concatenate(b)

    def acceleration(self, t: float, q: Array, v: Array, held: Sequence[int] = ()) -> tuple[Array, Array]:
        """Acceleration, and the force that every held degree of freedom needs to stay at rest.

        Args:
            t: time [s].
            q: configuration.
            v: velocity.
            held: degrees of freedom without acceleration.
        """
        self.update(q, v)
        M, h = self.mass_and_bias()
        force = -h if self.forces is None else self.forces(t, self) - h
        A, b = self.rows() if self.anchors else (np.zeros((0, self.nv)), np.zeros(0))
        A, b = np.vstack([A, np.eye(self.nv)[list(held)]]), np.concatenate([b, np.zeros(len(held))])
        m = len(b)
        x = np.linalg.solve(np.block([[M, A.T], [A, np.zeros((m, m))]]), np.concatenate([force, b]))
        return x[: self.nv], -x[self.nv + m - len(held) :]

    def rate(self, t: float, y: Array) -> Array:
        """dy/dt of y = (q, v)."""
        q, v = y[: self.nq].copy(), y[self.nq :]
        dq = np.zeros(self.nq)
        for i in range(1, self.n):
            j, j0 = self.iv[i], self.iq[i]
            if self.free[i]:
                x = q[j0 + 3 : j0 + 7] / np.linalg.norm(q[j0 + 3 : j0 + 7])
                q[j0 + 3 : j0 + 7] = x
                w = v[j + 3 : j + 6]
                dq[j0 : j0 + 3] = of_quaternion(x) @ v[j : j + 3]
                dq[j0 + 3 : j0 + 6] = 0.5 * (x[3] * w + np.cross(x[:3], w))
                dq[j0 + 6] = -0.5 * x[:3] @ w
            else:
                dq[j0] = v[j]
        return np.concatenate([dq, self.acceleration(t, q, v)[0]])

    def motion(self, q: Array, v: Array, times: Array, rtol: float = 1e-13) -> Array:
        """Configurations at some times, by SciPy's DOP853, started anew at each of them.

        Args:
            q: configuration at time zero.
            v: velocity at time zero.
            times: [s], (k,).
            rtol: relative tolerance; the absolute one is a tenth of it.

        Returns:
            Configurations, (k, nq).
        """
        t, y, found = 0.0, np.concatenate([q, v]), []
        for end in times:
            out = solve_ivp(self.rate, (t, end), y, method="DOP853", rtol=rtol, atol=0.1 * rtol)
            if not out.success:
                raise RuntimeError(f"the reference did not reach its end: {out.message}")
            t, y = float(end), out.y[:, -1]
            found.append(y[: self.nq])
        return np.array(found)
