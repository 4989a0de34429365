"""Friction conditions at one instant of a run, by Pinocchio's inverse dynamics and closed forms of the laws.

The module takes the recorded motion, the multipliers and the matrix A from the core.  `differences` checks A.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

# Slip speed below which the slip direction is undefined, relative to 1 + the largest speed.
UNDIRECTED = 1e-8
# Residual of the equation of motion with recorded values, relative to its terms.
BALANCED = 1e-9
# Relative excess of a shared friction force over its limit, and number of starts of the search.
SHARED, STARTS = 1e-9, 20


@dataclass
class Instant:
    """State with the acceleration and the multipliers of a motion."""

    t: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    lam: np.ndarray


class Conditions:
    """Friction force, limit and slip velocity of every friction element of a scene, at instants of its runs.

    Args:
        scene: scene with laws, constraints and forces of the kinds in tests/support/random_mechanisms.py.
        slips: maps the name of each element to a function (data, v) -> slip velocity.
        places: maps the name of an element that is one of several of its law to the name of the law and a
            function (instant, wrenches) -> load-dependent part of the limit.
    """

    def __init__(self, scene, slips, places=None):
        self.places = places or {}
        self.scene, self.slips, self.model = scene, slips, scene.model
        self.data, self.runner = scene.model.createData(), scene._compiled.program.runner()
        self.laws = {law.name: law for law in scene.laws}
        self.anchors = {c.name: c for c in scene.constraints}

    def at(self, run, i):
        """Return slip velocity, friction force and limit of each element, and the size of all forces.

        Returns:
            slips, forces: arrays (dim,) by element. limits: numbers by element. size: [N m or N].
        """
        total = Instant(run.t[i], run.q[i], run.v[i], run.a[i], run.lam[i])
        pin.computeJointJacobians(self.model, self.data, total.q)
        pin.forwardKinematics(self.model, self.data, total.q, total.v)
        pin.updateFramePlacements(self.model, self.data)
        M = pin.crba(self.model, self.data, total.q, pin.Convention.WORLD)
        M = np.triu(M) + np.triu(M, 1).T
        a_ideal = total.a - np.linalg.solve(M, run.F_nonideal[i])
        ideal = Instant(total.t, total.q, total.v, a_ideal, run.lam_ideal[i])
        loads = {"total": self._wrenches(total, dragged=True), "ideal": self._wrenches(ideal, dragged=False)}
        slips, limits, directions = {}, {}, []
        for name, slip in self.slips.items():
            slips[name] = slip(self.data, total.v)
            law = self.law_of(name)
            instant = ideal if getattr(law, "reaction", "total") == "ideal" else total
            if name in self.places:
                load = self.places[name][1](instant, loads[law.reaction])
                limits[name] = law.coulomb + law.preload + load
            else:
                limits[name] = self._limit(law, instant, loads)
            directions.append(np.column_stack([slip(self.data, e) for e in np.eye(self.model.nv)]))
        rows = self.runner.rows(total.q, total.v, float(total.t))[0].reshape(-1, self.model.nv)
        pull = rows.T @ total.lam
        held = run.F_ideal[i] + run.F_nonideal[i]
        z = None if run.z is None else run.z[i]
        friction = held - pull - self._smooth(total, z)
        size = np.abs(held).max() + (np.abs(rows.T) @ np.abs(total.lam)).max(initial=0.0) + 1.0
        return (
            slips,
            self._share(friction, directions, slips, limits, run.modes[i], rows, np.abs(total.v).max(), size),
            limits,
            size,
        )

    def law_of(self, name):
        """Return the law of an element."""
        return self.laws[self.places[name][0] if name in self.places else name]

    def _share(self, friction, directions, slips, limits, modes, rows, speed, size):
        """Return the forces of the elements, whose sum is the generalized friction force.

        Elements with a defined slip direction follow their law.  The remainder acts at the other elements.
        If these are redundant with each other or with constraints, any forces within their limits are
        accepted.
        """
        forces, left, names = {}, friction.copy(), list(slips)
        for name, S, mode in zip(slips, directions, modes, strict=True):
            u = slips[name]
            if mode != 0 and not self.undirected(u, speed):
                along = u / np.linalg.norm(u) if len(u) > 1 else np.array([float(mode)])
                forces[name] = -limits[name] * self._stribeck(name, u) * along
                left -= S.T @ forces[name]
        stuck = [k for k, name in enumerate(names) if name not in forces]
        S = np.vstack([directions[k] for k in stuck]) if stuck else np.zeros((0, len(left)))
        x = np.linalg.lstsq(S.T, left, rcond=1e-10)[0] if stuck else np.zeros(0)
        np.testing.assert_allclose(S.T @ x, left, rtol=0.0, atol=BALANCED * size)
        both = np.vstack([S, rows])
        if np.linalg.matrix_rank(both, tol=1e-8) < np.linalg.matrix_rank(rows, tol=1e-8) + len(S):
            basis = np.linalg.svd(both.T, full_matrices=False)[0][:, : np.linalg.matrix_rank(both, tol=1e-8)]
            slipping = [modes[k] != 0 for k in stuck]
            most = [
                self.kinetic_limit(names[k], slips[names[k]], limits)
                if moves
                else self.static_limit(names[k], limits) + BALANCED * size
                for k, moves in zip(stuck, slipping, strict=True)
            ]
            x = shares(basis.T @ both.T, basis.T @ left, [len(directions[k]) for k in stuck], most, slipping)
            assert x is not None, f"no friction within the limits holds {[names[k] for k in stuck]}"
        for k in stuck:
            forces[names[k]], x = x[: len(directions[k])], x[len(directions[k]) :]
        return forces

    @staticmethod
    def undirected(slip, speed):
        """Check if a slip of several components is too slow for a direction: rounding in v dominates."""
        return len(slip) > 1 and np.linalg.norm(slip) <= UNDIRECTED * (1.0 + speed)

    def _stribeck(self, name, slip):
        """Return the Stribeck factor of the limit of a slipping element."""
        law = self.law_of(name)
        if isinstance(law, pn.UserFriction) or law.stribeck_velocity is None:
            return 1.0
        return 1.0 + (law.static_ratio - 1.0) * np.exp(-((np.linalg.norm(slip) / law.stribeck_velocity) ** 2))

    def kinetic_limit(self, name, slip, limits):
        """Return the friction force of a slipping element."""
        return limits[name] * self._stribeck(name, slip)

    def static_limit(self, name, limits):
        """Return the largest friction force of a sticking element."""
        return limits[name] * getattr(self.law_of(name), "static_ratio", 1.0)

    def _limit(self, law, instant, loads):
        """Return the load-dependent limit, without the static ratio and the Stribeck factor."""
        if isinstance(law, pn.UserFriction):
            return law.limit(instant.t, instant.q, instant.v, _Wrenches(self.model, loads["total"]))
        constant = law.coulomb + law.preload
        anchor = self.anchors.get(law.joint)
        if anchor is not None:
            lam = instant.lam[self.scene.constraint_slices[law.joint]]
            axial = lam[:3] @ np.asarray(anchor.axis)
            radial = np.linalg.norm(lam[:3] - axial * np.asarray(anchor.axis))
            bending = np.linalg.norm(lam[3:]) / law.span if law.span else 0.0
            return constant + law.mu * (law.radius * (radial + bending) + law.axial_radius * abs(axial))
        joint = self.model.getJointId(law.joint)
        f = loads[law.reaction][joint]
        kind = self.model.joints[joint].shortname()
        if "Spherical" in kind:
            return constant + law.mu * law.radius * np.linalg.norm(f.linear)
        axis = _axis(self.model.joints[joint])
        axial = f.linear @ axis
        radial = np.linalg.norm(f.linear - axial * axis)
        if kind.startswith("JointModelP"):
            moment = np.linalg.norm(f.angular) / law.span if law.span else 0.0
            return constant + law.mu * (radial + moment)
        bending = np.linalg.norm(f.angular - (f.angular @ axis) * axis) / law.span if law.span else 0.0
        return constant + law.mu * (law.radius * (radial + bending) + law.axial_radius * abs(axial))

    def _wrenches(self, instant, *, dragged):
        """Return the wrench of each joint on its child body, in the joint frame."""
        outside = [pin.Force.Zero() for _ in range(self.model.njoints)]

        def push(frame, force, moment=(0.0, 0.0, 0.0)):
            joint = self.model.frames[frame].parentJoint
            here = pin.SE3(self.data.oMi[joint].rotation.T, np.zeros(3))
            local = here.act(pin.Force(np.asarray(force, float), np.asarray(moment, float)))
            lever = self.model.frames[frame].placement.translation
            outside[joint] += pin.Force(local.linear, local.angular + np.cross(lever, local.linear))

        for c in self.scene.constraints:
            if isinstance(c, pn.JointCoupling):
                continue
            one, two = (self.model.getFrameId(f) for f in (c.frame1, c.frame2))
            lam = instant.lam[self.scene.constraint_slices[c.name]]
            x1, x2 = (self.data.oMf[f].translation for f in (one, two))
            if isinstance(c, pn.Distance):
                force = lam[0] * (x1 - x2) / np.linalg.norm(x1 - x2)
            else:
                axes = "xyz" if isinstance(c, pn.HingeAnchor) else c.axes
                force = self.data.oMf[two].rotation[:, ["xyz".index(k) for k in axes]] @ lam[: len(axes)]
            push(one, force)
            push(two, -force, np.cross(x1 - x2, -force))
        for f in self.scene.forces:
            if isinstance(f, pn.Wrench):
                push(self.model.getFrameId(f.frame), f.value[:3], f.value[3:])
            elif isinstance(f, pn.SpringDamper):
                one, two = (self.model.getFrameId(x) for x in (f.frame1, f.frame2))
                gap = self.data.oMf[one].translation - self.data.oMf[two].translation
                length = np.linalg.norm(gap)
                rate = gap @ (self._speed(one) - self._speed(two)) / length
                force = -(f.stiffness * (length - f.rest_length) + f.damping * rate) * gap / length
                push(one, force)
                push(two, -force)
        for law in self.scene.laws:
            if dragged and isinstance(law, pn.Drag):
                frame = self.model.getFrameId(law.frame)
                push(frame, self._drag(law, frame))
        data = self.model.createData()
        pin.rnea(self.model, data, instant.q, instant.v, instant.a, outside)
        return data.f

    def _speed(self, frame):
        return pin.getFrameVelocity(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED).linear

    def _drag(self, law, frame):
        u = self._speed(frame)
        speed = np.linalg.norm(u)
        return -law.coefficient * speed ** (law.exponent - 1.0) * u if speed else np.zeros(3)

    def _smooth(self, instant, z):
        """Return the generalized force of the smooth laws and of viscous friction."""
        C, v, state = np.zeros(self.model.nv), instant.v, 0
        for law in self.scene.laws:
            if isinstance(law, pn.Drag):
                frame = self.model.getFrameId(law.frame)
                J = pin.computeFrameJacobian(self.model, self.data, instant.q, frame, pin.LOCAL_WORLD_ALIGNED)
                C += J[:3].T @ self._drag(law, frame)
                continue
            for name, slip in self.slips.items():
                if law.name == self.law_of(name).name and getattr(law, "viscous", 0.0):
                    S = np.column_stack([slip(self.data, e) for e in np.eye(self.model.nv)])
                    C -= law.viscous * S.T @ slip(self.data, v)
            if isinstance(law, pn.SigmoidFriction):
                dof = self.model.joints[self.model.getJointId(law.joint)].idx_v
                C[dof] -= law.phi1 / (1.0 + np.exp(-law.phi2 * v[dof])) - law.phi1 / 2.0
            if isinstance(law, pn.LuGre):
                dof = self.model.joints[self.model.getJointId(law.joint)].idx_v
                level = law.coulomb
                rate = v[dof] - law.stiffness * abs(v[dof]) * z[state] / level
                C[dof] -= law.stiffness * z[state] + law.damping * rate
                state += 1
        return C


def shares(A, b, dims, most, slipping):
    """Return x = (f, lam) with A x = b, |f_e| <= most[e] and free multipliers lam, or None.

    Args:
        A: matrix of full row rank.
        b: right-hand side.
        dims: number of components of each element; their forces are the first unknowns.
        most: maximum force of each element.
        slipping: whether the force of each element equals its maximum.
    """
    from scipy.optimize import least_squares, linprog

    if max(dims) == 1:
        bounds = [(-x, x) for x in most] + [(None, None)] * (A.shape[1] - len(most))
        found = linprog(np.zeros(A.shape[1]), A_eq=A, b_eq=b, bounds=bounds)
        return found.x if found.success else None
    x0 = np.linalg.lstsq(A, b, rcond=None)[0]
    free = np.linalg.svd(A)[2][len(A) :].T
    first = np.cumsum([0, *dims])
    parts = [slice(i, j) for i, j in itertools.pairwise(first)]

    def beyond(y):
        x = x0 + free @ y
        sizes = [np.linalg.norm(x[part]) / limit - 1.0 for part, limit in zip(parts, most, strict=True)]
        return [size if moves else max(size, 0.0) for size, moves in zip(sizes, slipping, strict=True)]

    starts = np.random.default_rng(0).normal(0.0, 1.0, (STARTS, free.shape[1]))
    starts[0] = 0.0
    for start in starts * max(most):
        found = least_squares(beyond, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if np.abs(found.fun).max() < SHARED:
            return x0 + free @ found.x
    return None


class _Wrenches:
    """Reactions in the interface of user-defined laws."""

    def __init__(self, model, forces):
        self.model, self.forces = model, forces

    def wrench(self, name):
        return self.forces[self.model.getJointId(name)].vector


def _axis(joint):
    """Return the axis of a joint with one degree of freedom, in the joint frame."""
    motion = joint.createData()
    joint.calc(motion, np.zeros(joint.nq))
    S = np.asarray(motion.S).ravel()
    return S[3:] / np.linalg.norm(S[3:]) if np.any(S[3:]) else S[:3] / np.linalg.norm(S[:3])
