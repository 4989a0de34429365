"""Modes of friction against enumeration of all combinations.

Each element sticks, slips forward or slips backward: 3^n combinations, each a linear problem with conditions.
"""

from __future__ import annotations

import functools

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.modes import SLACK, combinations, enumerate_modes
from pin_nonideal._core import friction_program

from ...support.mechanisms import dof
from ...support.random_trees import add
from ...support.seeds import seeds

LARGEST = 8


def random_program(rng, n, rank):
    """Return W of given rank with badly scaled rows, accelerations in its range, and limits."""
    half = rng.standard_normal((n, rank)) * 10.0 ** rng.uniform(-1.0, 1.0, (n, 1))
    W = half @ half.T
    # alpha0 lies in the range of W: dependent slip velocities have dependent accelerations.
    alpha0 = W @ rng.standard_normal(n) * 10.0 ** rng.uniform(-0.5, 1.0)
    return W, alpha0, rng.exponential(1.0, n)


class TestProgram:
    @pytest.mark.parametrize("seed", seeds(range(120)))
    def test_independent_elements(self, seed):
        """W is positive definite: one combination, one force."""
        print("seed", seed)
        rng = np.random.default_rng(seed)
        n = 1 + seed % LARGEST
        W, alpha0, limits = random_program(rng, n, n)
        found = enumerate_modes(W, alpha0, limits)
        assert len(found) == 1
        f = friction_program(W, alpha0, [1] * n, limits)
        np.testing.assert_allclose(f, found[0][1], rtol=0.0, atol=SLACK * limits.max())

    @pytest.mark.parametrize("seed", seeds(range(120)))
    def test_redundant_elements(self, seed):
        """W is semidefinite: several forces, one motion."""
        print("seed", seed)
        rng = np.random.default_rng(1000 + seed)
        n = 2 + seed % (LARGEST - 1)
        W, alpha0, limits = random_program(rng, n, int(rng.integers(1, n)))
        if seed % 4 == 0:
            limits[rng.integers(n)] = 0.0
        found = enumerate_modes(W, alpha0, limits)
        f = friction_program(W, alpha0, [1] * n, limits)
        assert (np.abs(f) <= limits * (1.0 + SLACK)).all()
        size = np.abs(alpha0).max() + (np.abs(W) @ limits).max()
        for _, _, alpha in found:
            np.testing.assert_allclose(alpha0 + W @ f, alpha, rtol=0.0, atol=10.0 * SLACK * size)
        assert found

    @pytest.mark.parametrize("seed", seeds(range(60)))
    def test_accelerations_that_no_force_causes(self, seed):
        """alpha0 is not in the range of W, as at a dead point: some redundant elements slip.

        The conditions are those of the minimum of a convex program, so the solution is unique.
        """
        print("seed", seed)
        rng = np.random.default_rng(3000 + seed)
        n = 2 + seed % (LARGEST - 1)
        W, alpha0, limits = random_program(rng, n, int(rng.integers(1, n)))
        alpha0 += rng.standard_normal(n) * np.abs(alpha0).max()
        f = friction_program(W, alpha0, [1] * n, limits)
        alpha = alpha0 + W @ f
        size = np.abs(alpha0).max() + (np.abs(W) @ limits).max()
        inside = np.abs(f) < limits * (1.0 - SLACK)
        assert (np.abs(f) <= limits * (1.0 + SLACK)).all()
        np.testing.assert_allclose(alpha[inside], 0.0, rtol=0.0, atol=SLACK * size)
        assert (f * alpha <= SLACK * size * limits).all()
        assert not inside.all()

    @pytest.mark.parametrize("n", range(1, LARGEST + 1))
    def test_copies_share(self, n):
        """n equal brakes on one wheel act like one brake with the sum of their limits."""
        W, limits = np.full((n, n), 2.0), np.linspace(0.5, 1.0, n)
        total = limits.sum()
        for part, alpha in ((1.0 - 1e-9, 0.0), (1.5, total)):
            alpha0 = np.full(n, 2.0 * part * total)
            f = friction_program(W, alpha0, [1] * n, limits)
            np.testing.assert_allclose(alpha0 + W @ f, alpha, rtol=0.0, atol=1e-12 * n * total)
            assert (np.abs(f) <= limits * (1.0 + 1e-12)).all()

    @pytest.mark.parametrize("seed", seeds(range(60)))
    def test_elements_of_several_directions(self, seed):
        """Disks and balls: |f| <= s, and f = -s alpha/|alpha| or alpha = 0, unique by convexity."""
        print("seed", seed)
        rng = np.random.default_rng(2000 + seed)
        dims = [int(d) for d in rng.integers(1, 4, 1 + seed % 4)]
        n = sum(dims)
        W, alpha0, _ = random_program(rng, n, n if seed % 3 else int(rng.integers(1, n + 1)))
        limits = rng.exponential(1.0, len(dims))
        f = friction_program(W, alpha0, dims, limits)
        alpha = alpha0 + W @ f
        size = np.abs(alpha0).max() + (np.abs(W) @ np.abs(f)).max()
        ends = np.cumsum(dims)[:-1]
        for fe, ae, s in zip(np.split(f, ends), np.split(alpha, ends), limits, strict=True):
            assert np.linalg.norm(fe) <= s * (1.0 + SLACK)
            np.testing.assert_allclose(np.linalg.norm(ae) * fe, -s * ae, rtol=0.0, atol=1e-8 * s * size)

    @pytest.mark.parametrize("seed", seeds(range(120)))
    def test_shares_that_are_all_at_their_limits(self, seed):
        """The load is at the limit of disks and balls, or differs by a relative 1e-12 to 0.1.

        At slip onset both |f| = s and alpha = 0 hold.
        """
        print("seed", seed)
        rng = np.random.default_rng(4000 + seed)
        dims = [int(d) for d in rng.integers(1, 4, 2 + seed % 6)]
        n, ends = sum(dims), np.cumsum(dims)[:-1]
        half = rng.standard_normal((n, int(rng.integers(1, n + 1))))
        W, limits = half @ half.T, 10.0 ** rng.uniform(-2.0, 2.0, len(dims))
        forces = np.split(rng.standard_normal(n), ends)
        held = [s * part / np.linalg.norm(part) for s, part in zip(limits, forces, strict=True)]
        beside = rng.choice([-1.0, 0.0, 1.0], len(dims)) * 10.0 ** rng.uniform(-12.0, -1.0, len(dims))
        alpha0 = -W @ np.concatenate([(1.0 + e) * part for e, part in zip(beside, held, strict=True)])
        f = friction_program(W, alpha0, dims, limits)
        alpha = alpha0 + W @ f
        size = np.abs(alpha0).max() + (np.abs(W) @ np.repeat(limits, dims)).max()
        for fe, ae, s in zip(np.split(f, ends), np.split(alpha, ends), limits, strict=True):
            assert np.linalg.norm(fe) <= s * (1.0 + 1e-12)
            opposed = ae + np.linalg.norm(ae) * fe / s  # zero where alpha is
            np.testing.assert_allclose(opposed, 0.0, rtol=0.0, atol=SLACK * size)


class RandomTree:
    """Revolute and prismatic joints with load-dependent friction; some joints are at rest."""

    def __init__(self, seed, n):
        rng = np.random.default_rng(seed)
        self.model = pin.Model()
        self.kinds = []
        for i in range(n):
            kind = "revolute unaligned" if rng.random() < 0.7 else "prismatic unaligned"
            self.kinds.append(kind.split()[0])
            add(self.model, f"j{i}", kind, int(rng.integers(0, i + 1)), rng)
        self.laws = [
            pn.JointFriction(
                f"j{i}",
                coulomb=rng.exponential(3.0),
                mu=rng.uniform(0.0, 0.2),
                radius=rng.uniform(0.0, 0.1),
                axial_radius=rng.uniform(0.0, 0.1),
                span=rng.uniform(0.2, 1.0),
                static_ratio=float(rng.choice([1.0, 1.3])),
            )
            for i in range(n)
        ]
        self.scene = pn.Scene(self.model, laws=self.laws)
        self.q = rng.standard_normal(n)
        self.v = rng.standard_normal(n) * (rng.random(n) < 0.3)
        self.tau = rng.standard_normal(n) * rng.exponential(2.0)

    def limits(self, a):
        """Return the kinetic limit of each joint from the wrench of pin.rnea in the joint frame."""
        data = self.model.createData()
        pin.rnea(self.model, data, self.q, self.v, a)
        axis = np.array([0.36, 0.48, 0.8])
        limits = []
        for i, (law, kind) in enumerate(zip(self.laws, self.kinds, strict=True), start=1):
            force, moment = data.f[i].linear, data.f[i].angular
            axial = force @ axis
            radial = np.linalg.norm(force - axial * axis)
            if kind == "revolute":
                bending = np.linalg.norm(moment - (moment @ axis) * axis) / law.span
                load = law.radius * (radial + bending) + law.axial_radius * abs(axial)
            else:
                load = radial + np.linalg.norm(moment) / law.span
            limits.append(law.coulomb + law.mu * load)
        return np.array(limits)

    def keeps(self, modes, solution):
        """Check if modes meet their conditions."""
        limits, friction, a = self.limits(solution.a), solution.F_nonideal, solution.a
        for mode, law, limit, f, slip in zip(modes, self.laws, limits, friction, a, strict=True):
            if mode == 0:
                if abs(f) > law.static_ratio * limit * (1.0 + SLACK) or slip != 0.0:
                    return False
            elif abs(f + mode * limit) > 1e-8 * limit:
                return False
        resting = np.flatnonzero((self.v == 0.0) & (np.array(modes) != 0))
        return all(modes[k] * a[k] >= -SLACK * np.abs(a).max() for k in resting)


class TestScenes:
    @pytest.mark.parametrize("seed", seeds(range(60)))
    def test_random_trees(self, seed):
        """solve returns modes that meet every condition, and no other combination does.

        With static friction above kinetic friction several combinations may be valid, including the result.
        """
        print("seed", seed)
        tree = RandomTree(seed, 2 + seed % 4)
        found = tree.scene.solve(tree.q, tree.v, tau=tree.tau)
        consistent = []
        for modes in combinations(tree.v):
            try:
                solution = tree.scene.solve(tree.q, tree.v, tau=tree.tau, modes=modes)
            except pn.FrictionParadoxError:
                continue
            if tree.keeps(modes, solution):
                consistent.append((modes, solution))
        assert tuple(found.modes) in [modes for modes, _ in consistent]
        if all(law.static_ratio == 1.0 for law in tree.laws):
            assert len(consistent) == 1
        a = next(solution.a for modes, solution in consistent if modes == tuple(found.modes))
        np.testing.assert_allclose(found.a, a, rtol=1e-9, atol=1e-9)

    @pytest.mark.parametrize("seed", seeds(range(20)))
    def test_linkage_of_one_freedom(self, seed):
        """Three pins of a four-bar stick or slip together: |n . F| against sum |n_k| limit_k.

        n is the motion that the loop allows.
        """
        print("seed", seed)
        rng = np.random.default_rng(seed)
        robot = pn.load("four_bar")
        limits = rng.exponential(1.0, 3)
        joints = ("crank_joint", "coupler_joint", "rocker_joint")
        laws = [pn.JointFriction(j, coulomb=s) for j, s in zip(joints, limits, strict=True)]
        scene = pn.Scene(robot.model, constraints=robot.constraints, laws=laws)
        crank = rng.uniform(-np.pi, np.pi)
        q = scene.project([crank, *robot.q0[1:]])[0]
        at = [dof(scene, j) for j in joints]
        loop = robot.constraints[0]
        model, data = scene.model, scene.model.createData()
        pin.computeJointJacobians(model, data, q)
        pin.framesForwardKinematics(model, data, q)
        tips = [
            pin.getFrameJacobian(model, data, model.getFrameId(f), pin.LOCAL_WORLD_ALIGNED)[[0, 2]]
            for f in (loop.frame1, loop.frame2)
        ]
        n = np.linalg.svd(tips[0] - tips[1])[2][-1]
        holds = np.abs(n[at]) @ limits
        weight = -n @ pin.rnea(model, data, q, np.zeros(3), np.zeros(3))
        for wanted in (0.0, 0.9, 1.0 - 1e-6, -1.0 + 1e-6, 1.0 + 1e-6, -1.0 - 1e-6, 5.0, -5.0):
            tau = n * (wanted * holds - weight)
            s = scene.solve(q, np.zeros(3), tau=tau)
            if abs(wanted) < 1.0:
                assert (s.modes == 0).all()
                np.testing.assert_array_equal(s.a, 0.0)
            else:
                np.testing.assert_array_equal(s.modes, np.sign(wanted * n[at]))
                excess = (wanted - np.sign(wanted)) * holds
                inertia = n @ pin.crba(model, data, q) @ n
                np.testing.assert_allclose(s.a @ n, excess / inertia, rtol=1e-6)


@functools.cache
def five_bar():
    return pn.load("five_bar")


class Loop:
    """Five-bar without drives: two degrees of freedom, load-dependent friction in two pins."""

    AXIS = np.array([0.0, -1.0, 0.0])

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        robot = five_bar()
        self.model, self.tip = robot.model, robot.constraints[0]
        self.joints = [str(j) for j in rng.permutation(["motor1", "elbow1", "motor2", "elbow2"])[:2]]
        self.laws = [
            pn.JointFriction(j, coulomb=rng.exponential(0.5), mu=0.2, radius=rng.uniform(0.0, 0.02))
            for j in self.joints
        ]
        self.scene = pn.Scene(self.model, constraints=[self.tip], laws=self.laws)
        self.q = self.scene.project(robot.q0 + 0.2 * rng.standard_normal(4))[0]
        self.tau = 0.2 * rng.standard_normal(4)

    def friction_and_limits(self, s):
        """Return friction torque and limit of each pin, from the equation of motion and pin.rnea.

        The anchor exerts lam, in the axes of frame2, on frame1's body, and the opposite on frame2's body.
        """
        model, data, rest = self.model, self.model.createData(), np.zeros(4)
        pin.framesForwardKinematics(model, data, self.q)
        first, second = (model.getFrameId(f) for f in (self.tip.frame1, self.tip.frame2))
        force = data.oMf[second].rotation[:, [0, 2]] @ s.lam
        forces = [pin.Force.Zero() for _ in range(model.njoints)]
        for tip, sign in ((first, 1.0), (second, -1.0)):
            here = pin.SE3(data.oMi[model.frames[tip].parentJoint].rotation, np.zeros(3))
            pull = here.actInv(pin.Force(sign * force, np.zeros(3)))
            lever = model.frames[tip].placement.translation
            forces[model.frames[tip].parentJoint] += pin.Force(pull.linear, np.cross(lever, pull.linear))
        friction = pin.rnea(model, data, self.q, rest, s.a, forces) - self.tau
        limits = []
        for joint, law in zip(self.joints, self.laws, strict=True):
            f = data.f[model.getJointId(joint)].linear
            limits.append(law.coulomb + law.mu * law.radius * np.linalg.norm(f - f @ self.AXIS * self.AXIS))
        at = [dof(self.scene, joint) for joint in self.joints]
        free = [k for k in range(4) if k not in at]
        np.testing.assert_allclose(friction[free], 0.0, rtol=0.0, atol=1e-10)
        return friction[at], np.array(limits), s.a[at]


@pytest.mark.parametrize("seed", seeds(range(40)))
def test_loop(seed):
    """At rest under random torques solve returns the unique combination that meets every condition."""
    print("seed", seed)
    loop = Loop(seed)
    rest = np.zeros(4)
    consistent = []
    for modes in combinations([0.0, 0.0]):
        s = loop.scene.solve(loop.q, rest, tau=loop.tau, modes=modes)
        friction, limits, slip = loop.friction_and_limits(s)
        m = np.array(modes)
        np.testing.assert_allclose(np.where(m, friction + m * limits, slip), 0.0, rtol=0.0, atol=1e-10)
        size = SLACK * np.abs(s.a).max()
        if all(np.where(m == 0, np.abs(friction) <= limits * (1.0 + SLACK), m * slip >= -size)):
            consistent.append(modes)
    assert consistent == [tuple(loop.scene.solve(loop.q, rest, tau=loop.tau).modes)]
