"""Deep trees with the articulated-body factorization, against long double, with locked joints and loops."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn
from oracles.long_recursion import LongTree

from ...support.random_trees import AXIS, JOINTS, add, state
from ...support.seeds import seeds

# Rounding of one evaluation relative to the largest acceleration, for sweeps along 300 links with rounded
# angles.
ROUNDING = 2e-12
# Rounding in a ring: A and b contain rounded sums along all links.
LOOP = 2e-11
# Difference from another algorithm in double precision, which has more rounding.
BESIDE = 1e-9
PARTS = [
    "revolute x",
    "revolute unaligned",
    "endless z",
    "prismatic y",
    "spherical",
    "helical z",
    "planar",
    "composite",
]
KNOWN = [*PARTS, "free flyer", "translation", "endless unaligned", "prismatic unaligned"]


@pytest.fixture(params=["core", "pinocchio"])
def terms(request):
    """Return the provider of kinematics and inertias."""
    return request.param


def chain(n, length=0.1, turn=0.0, axes="xyz"):
    """Return a chain of equal links with cycling joint axes."""
    model, parent = pin.Model(), 0
    kinds = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
    for i in range(n):
        place = pin.SE3(
            pin.rpy.rpyToMatrix(0.0, turn if i else 0.0, 0.0), np.array([0, 0, -length if i else 0.0])
        )
        parent = model.addJoint(parent, kinds[axes[i % len(axes)]](), place, f"j{i}")
        solid = pin.Inertia(0.1, np.array([0, 0, -0.5 * length]), np.diag([1e-4, 1e-4, 1e-5]))
        model.appendBodyToJoint(parent, solid, pin.SE3.Identity())
        end = pin.SE3(np.eye(3), np.array([0, 0, -length]))
        model.addFrame(pin.Frame(f"j{i} tip", parent, 0, end, pin.FrameType.OP_FRAME))
    return model


def deep_tree(rng, kinds=KNOWN, joints=70, branches=2):
    """Return a trunk with branches at its end, or with more than two anywhere, and a small separate tree."""
    model, trunk = pin.Model(), 0
    for k in range(joints):
        trunk = add(model, f"j{k}", str(rng.choice(kinds)), trunk, rng, mass=float(rng.uniform(0.2, 3.0)))
    for k in range(branches):
        add(
            model,
            f"b{k}",
            "revolute y",
            trunk if branches == 2 else int(rng.integers(joints // 2, joints)),
            rng,
        )
    add(model, "smaller", "prismatic x", add(model, "small", "spherical", 0, rng), rng)
    model.gravity = pin.Motion(9.81 * AXIS, np.zeros(3))
    model.armature = rng.uniform(0.0, 0.1, model.nv)
    return model


def error(found, expected):
    expected = np.asarray(expected)
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("n", [80, 300])
def test_acceleration_of_a_chain(n, terms):
    model, rng = chain(n), np.random.default_rng(n)
    scene, exact = pn.Scene(model, terms=terms), LongTree(model)
    for _ in range(2):
        q, v, tau = 0.3 * rng.standard_normal(n), rng.standard_normal(n), rng.standard_normal(n)
        assert error(scene.acceleration(q, v, tau), exact.acceleration(q, v, tau)) < ROUNDING


@pytest.mark.parametrize("seed", range(3))
def test_acceleration_with_every_joint_the_recursion_knows(seed, terms):
    rng = np.random.default_rng(seed)
    model = deep_tree(rng, branches=2 if terms == "pinocchio" else 5)  # crba needs joints branch by branch
    scene, exact = pn.Scene(model, terms=terms), LongTree(model)
    q, v = state(model, rng, spread=0.3)
    tau = rng.standard_normal(model.nv)
    assert error(scene.acceleration(q, v, tau), exact.acceleration(q, v, tau)) < ROUNDING


def test_acceleration_mass_matrix_and_bias_with_all_other_joints(terms):
    rng = np.random.default_rng(4)
    model = deep_tree(rng, list(JOINTS), 60)
    scene, data = pn.Scene(model, terms=terms), model.createData()
    q, v = state(model, rng, spread=0.3)
    tau = rng.standard_normal(model.nv)
    assert error(scene.acceleration(q, v, tau), pin.aba(model, data, q, v, tau)) < BESIDE
    M, bias = scene._compiled.program.runner().terms(q, v)
    expected = pin.crba(model, data, q, pin.Convention.WORLD)
    expected = np.triu(expected) + np.triu(expected, 1).T
    assert error(M.reshape(model.nv, -1), expected) < BESIDE
    assert error(bias, pin.nonLinearEffects(model, data, q, v)) < BESIDE


def unit_rows(dofs, nv):
    return np.eye(nv)[dofs]


def test_joints_that_stick_are_locked(terms):
    """Locked dofs are rows in long double; the friction forces equal those of inverse dynamics."""
    rng = np.random.default_rng(8)
    model = deep_tree(rng, ["revolute x", "revolute y", "spherical"], 60)
    held = [model.joints[i].idx_v for i in range(1, model.njoints) if model.joints[i].nv == 1][::3]
    names = [model.names[i] for i in range(1, model.njoints) if model.joints[i].nv == 1][::3]
    laws = [pn.JointFriction(name, coulomb=1e6) for name in names]
    scene, exact = pn.Scene(model, laws=laws, terms=terms), LongTree(model)
    q, v = state(model, rng, spread=0.3)
    v[held] = 0.0
    found = scene.solve(q, v)
    expected = exact.constrained(q, v, np.zeros(model.nv), unit_rows(held, model.nv), np.zeros(len(held)))
    assert error(found.a, expected) < ROUNDING
    np.testing.assert_array_equal(found.a[held], 0.0)
    torque = pin.rnea(model, model.createData(), q, v, found.a)
    assert error(found.F_nonideal, torque) < BESIDE


@pytest.mark.parametrize("n", [100, pytest.param(300, marks=pytest.mark.slow)])
def test_ring(n, terms):
    model = chain(n, turn=2.0 * np.pi / n, axes="yyx")
    scene = pn.Scene(model, constraints=[pn.PointAnchor(f"j{n - 1} tip", None)], terms=terms)
    q, v = np.zeros(n), 0.2 * np.cos(np.arange(n))
    runner = scene._compiled.program.runner()
    A = runner.rows(q, v, 0.0)[0].reshape(3, n)
    v -= np.linalg.lstsq(A, A @ v, rcond=None)[0]
    A, b = runner.rows(q, v, 0.0)[:2]
    expected = LongTree(model).constrained(q, v, np.zeros(n), A.reshape(3, n), b)
    assert error(scene.acceleration(q, v), expected) < LOOP


def test_loop_between_a_deep_tree_and_a_small_one():
    rng = np.random.default_rng(11)
    model = deep_tree(rng, ["revolute x", "revolute unaligned", "spherical"])
    gear = (
        pn.JointCoupling("j0", "b0", ratio=0.5)
        if model.joints[1].nv == 1
        else pn.JointCoupling("b1", "b0", ratio=0.5)
    )
    scene = pn.Scene(model, constraints=[pn.PointAnchor("j69 tip", "smaller tip"), gear])
    q, v = state(model, rng, spread=0.2)
    runner = scene._compiled.program.runner()
    A, b = runner.rows(q, v, 0.0)[:2]
    expected = LongTree(model).constrained(q, v, np.zeros(model.nv), A.reshape(4, -1), b)
    assert error(scene.acceleration(q, v), expected) < ROUNDING


def test_small_tree_beside_a_deep_one_keeps_its_numbers():
    rng = np.random.default_rng(3)
    alone = pin.Model()
    add(alone, "second", "revolute y", add(alone, "first", "universal", 0, rng), rng)
    both = pin.appendModel(chain(60), alone, 0, pin.SE3.Identity())
    q, v = state(alone, rng)
    expected = pn.Scene(alone).acceleration(q, v)
    found = pn.Scene(both).acceleration(np.concatenate([np.zeros(60), q]), np.concatenate([np.zeros(60), v]))
    np.testing.assert_array_equal(found[60:], expected)


def test_given_forces_and_drag_enter_as_wrenches(terms):
    rng = np.random.default_rng(6)
    model = chain(120)
    q, v = 0.3 * rng.standard_normal(120), rng.standard_normal(120)
    wrench = np.array([1.0, -2.0, 0.5, 0.1, 0.2, -0.3])
    forces = [pn.Wrench("j99 tip", wrench)]
    scene = pn.Scene(model, forces=forces, laws=[pn.Drag("j119 tip", 0.7, 1.0)], terms=terms)
    data = model.createData()
    pin.computeAllTerms(model, data, q, v)
    pin.updateFramePlacements(model, data)
    tau = np.zeros(120)
    for name, six in (("j99 tip", wrench), ("j119 tip", None)):
        J = pin.getFrameJacobian(model, data, model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED)
        tau += J.T @ six if six is not None else -0.7 * J[:3].T @ (J[:3] @ v)
    expected = LongTree(model).acceleration(q, v, tau)
    assert error(scene.acceleration(q, v), expected) < BESIDE  # J^T f was summed in double precision


def test_what_joints_carry(terms):
    """Joint wrenches equal Pinocchio's recursive Newton-Euler results, in the axes of each joint."""
    rng = np.random.default_rng(2)
    model = deep_tree(rng, ["revolute x", "prismatic y", "spherical"], 60)
    scene = pn.Scene(model, terms=terms)
    q, v = state(model, rng, spread=0.3)
    run = pn.simulate(scene, 1e-3, q=q, v=v, record=("reactions", "a"), progress=False)
    data = model.createData()
    bodiless = model.copy()
    bodiless.armature = np.zeros(model.nv)
    pin.rnea(bodiless, data, run.q[0], run.v[0], run.a[0])
    for name in ("j0", "j30", "j59", "b0"):
        carried = run.reaction(name)[0]
        expected = data.f[model.getJointId(name)].vector
        assert error(carried, expected) < BESIDE


def test_energy_balance():
    model = chain(60)
    scene = pn.Scene(model)
    q, v = np.full(60, 0.01), np.zeros(60)
    run = pn.simulate(scene, 0.1, q=q, v=v, record="energy", progress=False)
    data = model.createData()
    for k in (0, -1):
        kinetic = pin.computeKineticEnergy(model, data, run.q[k], run.v[k])
        assert run.energy["kinetic"][k] == pytest.approx(kinetic, rel=BESIDE, abs=1e-12)
    assert np.abs(run.energy["balance"]).max() < 1e-7


def test_steps_are_those_that_the_motion_needs():
    """The number of steps is that of SciPy's DOP853 with Pinocchio's aba, up to rules of step control."""
    model = chain(80, axes="y")
    q, v, data = np.full(80, 0.002), np.zeros(80), model.createData()

    def rate(t, y):
        return np.concatenate([y[80:], pin.aba(model, data, y[:80], y[80:], np.zeros(80))])

    beside = solve_ivp(rate, (0.0, 0.1), np.concatenate([q, v]), method="DOP853", rtol=1e-12, atol=1e-12)
    run = pn.simulate(pn.Scene(model), 0.1, q=q, v=v, rtol=1e-12, atol=1e-12, progress=False)
    assert run.stats.steps <= 1.6 * (beside.t.size - 1)
    assert run.stats.rejected <= 3


def test_massless_end_is_named():
    model = chain(60)
    model.inertias[60] = pin.Inertia.Zero()
    with pytest.raises(pn.PinNonidealError, match="j59"):
        pn.Scene(model).acceleration(np.zeros(60), np.zeros(60))


@pytest.mark.stress
@pytest.mark.parametrize("seed", seeds(range(40)))
def test_many_random_deep_trees(seed):
    rng = np.random.default_rng(1000 + seed)
    model = deep_tree(rng, KNOWN, int(rng.integers(30, 200)), branches=5)
    held = rng.choice(model.nv, 3, replace=False)
    rows = np.vstack([unit_rows(held, model.nv)])
    scene, exact = pn.Scene(model), LongTree(model)
    q, v = state(model, rng, spread=0.3)
    assert error(scene.acceleration(q, v), exact.acceleration(q, v, np.zeros(model.nv))) < ROUNDING
    drive = pn.UserConstraint(lambda t, q, v, data: (rows, np.zeros(3)), 3, rate=lambda t, q, v: rows @ v)
    scene = pn.Scene(model, constraints=[drive])
    v[held] = 0.0
    expected = exact.constrained(q, v, np.zeros(model.nv), rows, np.zeros(3))
    assert error(scene.acceleration(q, v), expected) < ROUNDING
