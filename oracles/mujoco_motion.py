"""MuJoCo's M, bias, forces and accelerations at a state, for scenes loaded from MJCF.

Contacts and limits are disabled, dry friction is sliding friction, and equalities hold exactly, by a dense
KKT system of MuJoCo's Jacobians.  The results are transformed to Pinocchio's velocity coordinates.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

OFF = mujoco.mjtDisableBit
CONNECT, WELD, JOINT, TENDON = range(
    4
)  # values of MuJoCo's mjtEq; later values are of flexes, which no scene has
RANK = 1e-6  # rows and singular values below this relative size are zero: frames are rounded to 1e-8


class Instant(NamedTuple):
    """MuJoCo's terms in Pinocchio's velocity coordinates.

    Attributes:
        q: configuration, (nq,).
        v: velocity, (nv,).
        M: mass matrix, (nv, nv).
        bias: Coriolis and gravity forces, (nv,).
        passive: springs, dampers, gravity compensation, fluid, (nv,).
        actuator: actuator forces, (nv,).
        a: acceleration under all forces, sliding friction and exact equalities, (nv,).
    """

    q: np.ndarray
    v: np.ndarray
    M: np.ndarray
    bias: np.ndarray
    passive: np.ndarray
    actuator: np.ndarray
    a: np.ndarray


def free_rotations(model, qpos):
    """Return T of qvel = T v, and the rotation matrix of each free joint, keyed by its first dof."""
    T, turns = np.eye(model.nv), {}
    for j in np.flatnonzero(model.jnt_type == 0):
        at, dof = model.jnt_qposadr[j], model.jnt_dofadr[j]
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, qpos[at + 3 : at + 7] / np.linalg.norm(qpos[at + 3 : at + 7]))
        T[dof : dof + 3, dof : dof + 3] = turns[int(dof)] = R.reshape(3, 3)
    return T, turns


def pinocchio_q(model, qpos):
    q = np.array(qpos)
    for j in np.flatnonzero(model.jnt_type <= 1):
        at = model.jnt_qposadr[j] + (3 if model.jnt_type[j] == 0 else 0)
        q[at : at + 4] = np.roll(q[at : at + 4] / np.linalg.norm(q[at : at + 4]), -1)
    return q


def mujoco_state(model, q, v):
    """Return MuJoCo's qpos and qvel for Pinocchio's q and v."""
    qpos = np.array(q)
    for j in np.flatnonzero(model.jnt_type <= 1):
        at = model.jnt_qposadr[j] + (3 if model.jnt_type[j] == 0 else 0)
        qpos[at : at + 4] = np.roll(qpos[at : at + 4], 1)
    return qpos, free_rotations(model, qpos)[0] @ v


def random_state(model, rng, spread=1.0):
    """Return a random qpos around the reference, and a random qvel."""
    qpos = np.array(model.qpos0)
    mujoco.mj_integratePos(model, qpos, spread * rng.uniform(-1.0, 1.0, model.nv), 1.0)
    return qpos, rng.uniform(-1.0, 1.0, model.nv)


def instant(model, qpos, qvel, ctrl=None, act=None, *, actuation=True):
    """Return MuJoCo's terms at one state.

    Args:
        model: mujoco.MjModel; its flags are changed during the call.
        qpos: MuJoCo's configuration.
        qvel: MuJoCo's velocity.
        ctrl: controls; None for zero.
        act: activations; None for zero.
        actuation: whether actuators act.
    """
    flags = model.opt.disableflags
    model.opt.disableflags = flags | int(OFF.mjDSBL_CONTACT) | int(OFF.mjDSBL_LIMIT)
    if not actuation:
        model.opt.disableflags |= int(OFF.mjDSBL_ACTUATION)
    try:
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = qpos, qvel
        if ctrl is not None:
            data.ctrl[:] = ctrl
        if act is not None:
            data.act[:] = act
        mujoco.mj_forward(model, data)
        return _terms(model, data, flags)
    finally:
        model.opt.disableflags = flags


def _terms(model, data, flags):
    nv = model.nv
    M = np.zeros((nv, nv))
    mujoco.mj_fullM(model, data, M)
    T, turns = free_rotations(model, data.qpos)
    friction = np.zeros(nv)
    if not flags & (int(OFF.mjDSBL_FRICTIONLOSS) | int(OFF.mjDSBL_CONSTRAINT)):
        friction -= model.dof_frictionloss * np.sign(data.qvel)
        for i in range(model.ntendon):
            row = tendon_row(model, data, i)
            friction -= model.tendon_frictionloss[i] * np.sign(row @ data.qvel) * row
    force = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias + friction
    A, b = equality_rows(model, data, flags)
    acc = kkt(M, force, A, b)
    v = T.T @ data.qvel  # T is orthogonal
    armature = np.diag(model.dof_armature)
    a, bias = T.T @ acc, np.array(data.qfrc_bias)
    for dof in turns:  # the axes of v rotate with the body
        spin = np.cross(v[dof + 3 : dof + 6], v[dof : dof + 3])
        a[dof : dof + 3] -= spin
        rigid = M[:, dof : dof + 3] - armature[:, dof : dof + 3]  # armature has no Coriolis force in MuJoCo
        bias += rigid @ (turns[dof] @ spin)
    forces = (T.T @ f for f in (bias, data.qfrc_passive, data.qfrc_actuator))
    return Instant(pinocchio_q(model, data.qpos), v, T.T @ M @ T, *forces, a)


def kkt(M, force, A, b):
    """Return a of M a = force + A^T lam, A a = b, by Gauss's principle; rows may be redundant."""
    L = np.linalg.cholesky(M)
    free = np.linalg.solve(M, force)
    if len(b) == 0:
        return free
    B = np.linalg.solve(L, A.T).T
    scale = np.linalg.norm(B, axis=1)
    length = np.linalg.norm(A, axis=1)
    scale[length < RANK * length.max(initial=0.0)] = np.inf  # zero rows of planar loops
    x = np.linalg.pinv(B / scale[:, None], rcond=RANK) @ ((b - A @ free) / scale)
    return free + np.linalg.solve(L.T, x)


def tendon_row(model, data, i):
    row, adr = np.zeros(model.nv), model.ten_J_rowadr[i]
    for k in range(adr, adr + model.ten_J_rownnz[i]):
        row[model.ten_J_colind[k]] += np.ravel(data.ten_J)[k]
    return row


def equality_rows(model, data, flags):
    """Return the rows A of MuJoCo's active equalities, and b = -(dA/dt) v of A a = b."""
    if flags & (int(OFF.mjDSBL_EQUALITY) | int(OFF.mjDSBL_CONSTRAINT)) or model.neq == 0:
        return np.zeros((0, model.nv)), np.zeros(0)
    rows = _rows_at(model, data.qpos)
    step = 1e-5  # step of a fourth-order central difference in time [s]
    rates = [_rows_at(model, _moved(model, data, h * step)) @ data.qvel for h in (-2, -1, 1, 2)]
    rate = (rates[0] - 8 * rates[1] + 8 * rates[2] - rates[3]) / (12 * step)
    return rows, -rate


def _moved(model, data, dt):
    qpos = np.array(data.qpos)
    mujoco.mj_integratePos(model, qpos, data.qvel, dt)
    return qpos


def _rows_at(model, qpos):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    rows = [_equality(model, data, i) for i in np.flatnonzero(data.eq_active) if model.eq_type[i] <= TENDON]
    return np.vstack([np.zeros((0, model.nv)), *rows])


def _equality(model, data, i):
    kind, one, two = model.eq_type[i], model.eq_obj1id[i], model.eq_obj2id[i]
    numbers = model.eq_data[i]
    if kind in (CONNECT, WELD):
        return _anchor_rows(model, data, kind, one, two, numbers, model.eq_objtype[i])
    lengths, rows = [], []
    for k in (one, two):
        if k < 0:
            continue
        if kind == JOINT:
            rows.append(np.eye(model.nv)[model.jnt_dofadr[k]])
            at = model.jnt_qposadr[k]
            lengths.append(data.qpos[at] - model.qpos0[at])
        else:
            rows.append(tendon_row(model, data, k))
            lengths.append(data.ten_length[k] - model.tendon_length0[k])
    if len(rows) == 1:
        return rows[0][None]
    slope = np.polynomial.Polynomial(numbers[:5]).deriv()(lengths[1])
    return (rows[0] - slope * rows[1])[None]


def _anchor_rows(model, data, kind, one, two, numbers, objtype):
    """Return rows of the relative velocity of the points and, for a weld, of the relative angular velocity.

    The rows are in world axes.  On the manifold they span the same space as any exact form of the anchor.
    """
    if objtype == mujoco.mjtObj.mjOBJ_SITE:
        bodies = [model.site_bodyid[s] for s in (one, two)]
        points = [np.array(data.site_xpos[s]) for s in (one, two)]
    else:
        bodies = [one, two]
        local = (numbers[:3], numbers[3:6]) if kind == CONNECT else (numbers[3:6], numbers[:3])
        points = [data.xpos[b] + data.xmat[b].reshape(3, 3) @ p for b, p in zip(bodies, local, strict=True)]
    jacobians = []
    for body, point in zip(bodies, points, strict=True):
        jp, jr = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jp, jr, point, body)
        jacobians.append((jp, jr))
    place = jacobians[0][0] - jacobians[1][0]
    turns = kind == WELD and numbers[10] != 0.0  # torque scale
    return place if not turns else np.vstack([place, jacobians[0][1] - jacobians[1][1]])
