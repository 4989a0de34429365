"""Conditions of friction at one instant of a run, by Pinocchio's inverse dynamics and the laws' closed forms.

Nothing here comes from the core but the motion and the multipliers that it recorded, and the matrix A, which
is compared with differences elsewhere.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

# Part of the speeds in play that leaves a slip its direction.
UNDIRECTED = 1e-8
# Part of the forces in play to which the equation of motion is balanced by what was recorded.
BALANCED = 1e-9
# Part of a limit by which shares of a load may pass it, and starts from which such shares are sought.
SHARED, STARTS = 1e-9, 20


@dataclass
class Instant:
    """A state with the accelerations and multipliers of a motion through it."""

    t: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    lam: np.ndarray


class Conditions:
    """Friction force, limit and slip velocity of every element of a scene, at instants of its runs.

    Args:
        scene: its laws, constraints and forces are of the kinds in tests/support/random_mechanisms.py.
        slips: name of each element to a function (data, v) -> its slip velocity.
        places: name of an element that is not all of its law in a joint or hinge, to that law's name and a
            function (instant, wrenches) -> what its load adds to the constant part of the limit.
    """

    def __init__(self, scene, slips, places=None):
        self.places = places or {}
        self.scene, self.slips, self.model = scene, slips, scene.model
        self.data, self.runner = scene.model.createData(), scene._compiled.program.runner()
        self.laws = {law.name: law for law in scene.laws}
        self.anchors = {c.name: c for c in scene.constraints}

    def at(self, run, i):
        """Slip velocity, friction force and limit of each element, and the size of the forces in play.

        Returns:
            slips, forces: arrays (dim,) by element; limits: numbers by element; size [N m or N].
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
        """The law that an element belongs to."""
        return self.laws[self.places[name][0] if name in self.places else name]

    def _share(self, friction, directions, slips, limits, modes, rows, speed, size):
        """Forces of the elements that make up the generalized friction force.

        Those that slip in a clear direction follow their law.  What is left is shared among those that stick;
        where they are redundant, with each other or with the constraints, any share within their limits will
        do.
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
        """A slip of several directions that has just begun: rounding in v hides where it goes."""
        return len(slip) > 1 and np.linalg.norm(slip) <= UNDIRECTED * (1.0 + speed)

    def _stribeck(self, name, slip):
        """Factor of the limit while it slips."""
        law = self.law_of(name)
        if isinstance(law, pn.UserFriction) or law.stribeck_velocity is None:
            return 1.0
        return 1.0 + (law.static_ratio - 1.0) * np.exp(-((np.linalg.norm(slip) / law.stribeck_velocity) ** 2))

    def kinetic_limit(self, name, slip, limits):
        """Friction force while it slips."""
        return limits[name] * self._stribeck(name, slip)

    def static_limit(self, name, limits):
        """Largest force with which an element can stick."""
        return limits[name] * getattr(self.law_of(name), "static_ratio", 1.0)

    def _limit(self, law, instant, loads):
        """Limit for the load, before the static ratio or Stribeck's factor."""
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
        """Wrench that each joint exerts on the body that it moves, in the joint's frame."""
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
        """Generalized force of the laws that never stick."""
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
    """Forces f, and free multipliers behind them, with A (f, lam) = b and |f_e| <= most_e, or None.

    Args:
        A: rows of full rank.
        b: right-hand side.
        dims: directions of each element; their forces come first among the unknowns.
        most: largest force of each element.
        slipping: elements whose force is as large as that.
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
    """Reactions as a user's law sees them."""

    def __init__(self, model, forces):
        self.model, self.forces = model, forces

    def wrench(self, name):
        return self.forces[self.model.getJointId(name)].vector


def _axis(joint):
    """Axis of a joint of one degree of freedom in its frame."""
    motion = joint.createData()
    joint.calc(motion, np.zeros(joint.nq))
    S = np.asarray(motion.S).ravel()
    return S[3:] / np.linalg.norm(S[3:]) if np.any(S[3:]) else S[:3] / np.linalg.norm(S[:3])
