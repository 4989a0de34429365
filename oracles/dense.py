"""Reference mechanics with dense matrices in world axes, body by body, without algorithms of Pinocchio.

M = sum_i m_i J_c^T J_c + J_w^T I_i J_w.  The same sums with the accelerations at zero joint acceleration give
the bias force.  The constrained acceleration solves the dense system [M A^T; A 0] [a; -lam] = [F; b].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import qr

from .applied_forces import applied_force
from .frames import Frame
from .rows import rows_of_frames, skew

Array = NDArray[np.float64]

REDUNDANT = 1e-9  # remainder of a redundant row, relative to its length


def turned(axis: Array, angle: float) -> Array:
    """Return the rotation matrix of an angle about a unit axis (Rodrigues)."""
    K = skew(axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def of_quaternion(x: Array) -> Array:
    """Return the rotation matrix of the quaternion (x, y, z, w)."""
    u, w = x[:3], x[3]
    K = skew(u)
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


def quaternion_rate(x: Array, w: Array) -> Array:
    """Return the time derivative of the quaternion x for the angular velocity w in body axes."""
    return 0.5 * np.append(x[3] * w + np.cross(x[:3], w), -x[:3] @ w)


class DenseTree:
    """Tree of one-axis joints, spherical joints, and free-flyer joints attached to the world.

    After `update`, a call with a frame name returns a `Frame`; None is the world.

    Args:
        model: pinocchio.Model, used for its parameters only.
    """

    def __init__(self, model: Any) -> None:
        self.model, self.n, self.nv, self.nq = model, model.njoints, model.nv, model.nq
        self.gravity = np.array(model.gravity.linear)
        self.armature = np.array(model.armature)
        self.parents = list(model.parents)
        self.places = [(M.rotation.copy(), M.translation.copy()) for M in model.jointPlacements]
        self.bodies = [(Y.mass, Y.lever.copy(), Y.inertia.copy()) for Y in model.inertias]
        frames = (
            (f.name, (f.parentJoint, f.placement.rotation, f.placement.translation)) for f in model.frames
        )
        self.frames = dict(frames)
        self.joints = {name: i for i, name in enumerate(model.names)}
        self.iq, self.iv = [j.idx_q for j in model.joints], [j.idx_v for j in model.joints]
        self.kinds, self.axes = ["world"], [np.zeros(6)]  # axes: linear and angular velocity for v = 1
        for joint in list(model.joints)[1:]:
            kind, axis = joint.shortname(), np.zeros(6)
            if kind in ("JointModelFreeFlyer", "JointModelSpherical"):
                self.kinds.append("base" if kind.endswith("Flyer") else "ball")
            elif joint.nq == joint.nv == 1 and "Composite" not in kind:
                self.kinds.append("axis")
                numbers = joint.createData()
                joint.calc(numbers, np.zeros(model.nq))
                axis = np.array(numbers.S).ravel()
            else:
                raise ValueError(f"the reference knows joints of one axis, balls and free flyers; got {kind}")
            self.axes.append(axis)

    def update(self, q: Array, v: Array) -> None:
        """Compute placements, velocities, Jacobians and accelerations at zero joint acceleration."""
        n, nv = self.n, self.nv
        self.q, self.v = q, v
        self.R, self.p = [np.eye(3)] * n, [np.zeros(3)] * n
        self.w, self.u, self.dw, self.du = ([np.zeros(3)] * n for _ in range(4))  # angular, linear; rates
        self.Jw, self.Jp = [np.zeros((3, nv))] * n, [np.zeros((3, nv))] * n
        for i in range(1, n):
            k, j, j0 = self.parents[i], self.iv[i], self.iq[i]
            R0, p0 = self.places[i]
            R, W = self.R[k] @ R0, skew(self.w[k])
            slide, spin = R @ self.axes[i][:3], R @ self.axes[i][3:]  # zero except for one-axis joints
            arm = self.R[k] @ p0
            if self.kinds[i] == "axis":
                arm = arm + slide * q[j0]
            p = self.p[k] + arm
            u = self.u[k] + W @ arm + slide * v[j]
            du = self.du[k] + skew(self.dw[k]) @ arm + W @ W @ arm + 2.0 * W @ slide * v[j]
            Jw, Jp = self.Jw[k].copy(), self.Jp[k] - skew(arm) @ self.Jw[k]
            if self.kinds[i] == "axis":
                R = R @ turned(self.axes[i][3:], q[j0])
                w = self.w[k] + spin * v[j]
                dw = self.dw[k] + W @ spin * v[j]
                Jw[:, j], Jp[:, j] = spin, slide
            elif self.kinds[i] == "ball":  # v in body axes
                R = R @ of_quaternion(q[j0 : j0 + 4])
                spin = R @ v[j : j + 3]
                w, dw = self.w[k] + spin, self.dw[k] + W @ spin
                Jw[:, j : j + 3] = R
            else:  # attached to the world only: q = (position, quaternion), v in body axes
                p = p + R @ q[j0 : j0 + 3]
                R = R @ of_quaternion(q[j0 + 3 : j0 + 7])
                u, w = R @ v[j : j + 3], R @ v[j + 3 : j + 6]
                du, dw = np.cross(w, u), np.zeros(3)
                Jp[:, j : j + 3], Jw[:, j + 3 : j + 6] = R, R
            self.R[i], self.p[i], self.u[i], self.w[i], self.du[i], self.dw[i] = R, p, u, w, du, dw
            self.Jw[i], self.Jp[i] = Jw, Jp

    def mass_and_bias(self) -> tuple[Array, Array]:
        """Return M and the bias force of gravity and velocity."""
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

    def __call__(self, name: str | None) -> Frame:
        """Return the frame of a name; None is the world."""
        i, R, p = (0, np.eye(3), np.zeros(3)) if name is None else self.frames[name]
        arm, W = self.R[i] @ p, skew(self.w[i])
        return Frame(
            p=self.p[i] + arm,
            R=self.R[i] @ R,
            J=self.Jp[i] - skew(arm) @ self.Jw[i],
            Jw=self.Jw[i],
            u=self.u[i] + W @ arm,
            w=self.w[i],
            du=self.du[i] + skew(self.dw[i]) @ arm + W @ W @ arm,
            dw=self.dw[i],
        )

    def at(self, q: Array) -> DenseTree:
        """Return the same tree at another configuration, at rest."""
        other = DenseTree(self.model)
        other.update(q, np.zeros(self.nv))
        return other

    def dof(self, joint: str) -> int:
        """Return the index of a joint's first velocity in v."""
        return self.iv[self.joints[joint]]

    def moving(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q with normalized quaternions, and dq/dt."""
        q, dq = q.copy(), np.zeros(self.nq)
        for i in range(1, self.n):
            j, j0 = self.iv[i], self.iq[i]
            if self.kinds[i] == "axis":
                dq[j0] = v[j]
                continue
            if self.kinds[i] == "base":
                place, j0, j = slice(j0, j0 + 3), j0 + 3, j + 3
                dq[place] = of_quaternion(q[j0 : j0 + 4] / np.linalg.norm(q[j0 : j0 + 4])) @ v[j - 3 : j]
            q[j0 : j0 + 4] /= np.linalg.norm(q[j0 : j0 + 4])
            dq[j0 : j0 + 4] = quaternion_rate(q[j0 : j0 + 4], v[j : j + 3])
        return q, dq


class DenseScene:
    """Motion of a scene's tree, constraints, forces and actuation; the caller supplies the laws.

    Args:
        scene: pn.Scene, used for its descriptions only.
        laws: (t, q, v) -> nonideal force C, (nv,); None for zero.
    """

    def __init__(self, scene: Any, laws: Callable[[float, Array, Array], Array] | None = None) -> None:
        self.scene, self.laws, self.tree = scene, laws, DenseTree(scene.model)
        self.nv, self.nq = self.tree.nv, self.tree.nq
        self.independent: list[int] | None = None  # independent rows, selected at the first state

    def terms(self, t: float, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Return M, F, A and b."""
        self.tree.update(q, v)
        M, h = self.tree.mass_and_bias()
        return M, applied_force(self.scene, self.tree, t) - h, *rows_of_frames(self.scene, self.tree, t)

    def acceleration(self, t: float, q: Array, v: Array, held: Sequence[int] = ()) -> tuple[Array, Array]:
        """Return the acceleration, and the force that keeps each held degree of freedom at rest.

        Args:
            t: time [s].
            q: configuration.
            v: velocity.
            held: degrees of freedom with zero acceleration.
        """
        M, force, A, b = self.terms(t, q, v)
        if self.laws is not None:
            force = force + self.laws(t, q, v)
        if self.independent is None:
            self.independent = _independent(A / np.sqrt(np.diag(M)))
        A, b = A[self.independent], b[self.independent]
        A, b = np.vstack([A, np.eye(self.nv)[list(held)]]), np.concatenate([b, np.zeros(len(held))])
        m = len(b)
        x = np.linalg.solve(np.block([[M, A.T], [A, np.zeros((m, m))]]), np.concatenate([force, b]))
        return x[: self.nv], -x[self.nv + m - len(held) :]

    def rate(self, t: float, y: Array) -> Array:
        """Return dy/dt of y = (q, v)."""
        q, dq = self.tree.moving(y[: self.nq], y[self.nq :])
        return np.concatenate([dq, self.acceleration(t, q, y[self.nq :])[0]])

    def motion(self, q: Array, v: Array, times: Array, rtol: float = 1e-13) -> Array:
        """Integrate with SciPy's DOP853, restarted at each output time.

        Args:
            q: configuration at time zero.
            v: velocity at time zero.
            times: output times [s], (k,).
            rtol: relative tolerance; the absolute tolerance is a tenth of it.

        Returns:
            Configurations, (k, nq).
        """
        t, y, found = 0.0, np.concatenate([q, v]), []
        for end in times:
            out = solve_ivp(self.rate, (t, end), y, method="DOP853", rtol=rtol, atol=0.1 * rtol)
            if not out.success:
                raise RuntimeError(f"the reference did not reach its end: {out.message}")
            t, y = float(end), out.y[:, -1]
            found.append(self.tree.moving(y[: self.nq], y[self.nq :])[0])
        return np.array(found)


def _independent(A: Array) -> list[int]:
    """Return the indices of independent rows that span all rows; rows are scaled to unit length."""
    length = np.linalg.norm(A, axis=1)
    long = np.flatnonzero(length > REDUNDANT * length.max(initial=0.0))
    if not len(long):
        return []
    _, R, order = qr((A[long] / length[long, None]).T, mode="economic", pivoting=True)
    return sorted(long[order[: np.count_nonzero(np.abs(np.diag(R)) > REDUNDANT)]].tolist())
