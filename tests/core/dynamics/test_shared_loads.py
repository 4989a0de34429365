"""Loads of redundant anchors, feet and gears against dense algebra, independent of the order of lists."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.applied_forces import given_force, mass_matrix
from oracles.hyperstatic import constraint_force, minimum_norm
from oracles.rows import rows

from ...support.mechanisms import GRAVITY, assert_close, body, empty, frame
from ...support.seeds import seeds

# Rounding of loads: products of a dozen numbers and a least-squares solution.
ROUNDING = 1e-9


def door(places, order=None, mu=0.3, radii=None, extra=(), **keywords):
    """A door that hangs on hinge anchors along one vertical axis, with friction in each."""
    model = empty()
    joint = body(
        model,
        0,
        pin.JointModelFreeFlyer(),
        "door",
        20.0,
        lever=(0.4, 0.05, 1.0),
        inertia=np.diag([3.0, 2.0, 1.0]),
    )
    for k, z in enumerate(places):
        frame(model, f"a{k}", joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, z])))
        frame(model, f"w{k}", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, z])))
    radii = radii or [0.02] * len(places)
    hinges = [pn.HingeAnchor(f"a{k}", f"w{k}", name=f"hinge{k}") for k in range(len(places))]
    laws = [
        pn.JointFriction(f"hinge{k}", mu=mu, radius=radii[k], axial_radius=0.5 * radii[k], name=f"rub{k}")
        for k in range(len(places))
    ]
    order = list(order or range(len(places)))
    said = [*(hinges[k] for k in order), *extra]
    return pn.Scene(
        model, constraints=said, laws=[laws[k] for k in order], v0=[0.0, 0.0, 0.0, 0.0, 0.0, 2.0], **keywords
    )


def by_name(scene, lam):
    return {name: lam[..., rows_of] for name, rows_of in scene.constraint_slices.items()}


@pytest.mark.parametrize("places", [(0.2, 1.8), (0.2, 1.0, 1.8), (0.0, 0.0), (0.5, 0.5, 1.5, 1.9)])
def test_equal_hinges_share_whatever_their_order(places):
    """Motion, friction of each hinge, and multipliers are the same for every order of the list."""
    orders = list(itertools.permutations(range(len(places))))[:6]
    runs = [
        pn.simulate(door(places, order), 0.3, record=("energy", "forces"), output_dt=0.1) for order in orders
    ]
    assert abs(runs[0].energy["rub0"][-1]) > 1e-3
    for run in runs[1:]:
        assert_close(run.q, runs[0].q, 1e-8)
        for k in range(len(places)):
            assert_close(run.energy[f"rub{k}"], runs[0].energy[f"rub{k}"], 1e-8)
            one, other = by_name(run.scene, run.lam), by_name(runs[0].scene, runs[0].lam)
            assert_close(one[f"hinge{k}"], other[f"hinge{k}"], 1e-6)


@pytest.mark.parametrize("places", [(0.2, 1.8), (0.2, 1.0, 1.8), (0.0, 0.0), (0.5, 0.5, 1.5, 1.9)])
def test_loads_of_hinges_are_the_least_ones(places):
    """lam is the minimum-norm solution for this motion, and friction follows from these loads."""
    radii = [0.02 * (k + 1) for k in range(len(places))]
    scene = door(places, radii=radii)
    q, v = scene.project(scene.q0, scene.v0)
    s = scene.solve(q, v)
    A, _ = rows(scene, q, v, 0.0)
    M, F = mass_matrix(scene.model, q), given_force(scene, q, v, 0.0)
    limits = 0.0
    for k in range(len(places)):
        lam = by_name(scene, s.lam)[f"hinge{k}"]
        limits += 0.3 * (radii[k] * np.hypot(lam[0], lam[1]) + 0.5 * radii[k] * abs(lam[2]))
    C = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -limits])
    assert_close(s.lam, minimum_norm(A, M @ s.a - F - C), ROUNDING * np.abs(s.lam).max())
    assert_close(A @ s.a, rows(scene, q, v, 0.0)[1], ROUNDING * GRAVITY)


def geared(seed):
    """Return joints with redundant couplings and drives, each with its own scale."""
    rng = np.random.default_rng(seed)
    model = empty()
    joint = 0
    for k in range(3):
        place = pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0]))
        joint = body(
            model,
            joint,
            pin.JointModelRY(),
            f"j{k}",
            1.0,
            place=place,
            lever=(0.2, 0.0, 0.0),
            inertia=0.1 * np.eye(3),
        )
    frame(model, "tip", joint, pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0])))
    model.addFrame(
        pin.Frame("tip2", joint, 0, pin.SE3(np.eye(3), np.array([0.4, 0.1, 0.0])), pin.FrameType.OP_FRAME)
    )
    ratio = float(rng.uniform(0.3, 3.0))
    said = [
        pn.JointCoupling("j1", "j0", ratio=ratio, name="gear"),
        pn.JointCoupling("j0", "j1", ratio=1.0 / ratio, name="back"),
        pn.JointCoupling("j1", "j0", ratio=ratio, name="again"),
        pn.PointContact("tip", normal="z", unilateral=False, name="foot"),
        pn.PointContact("tip2", normal="z", unilateral=False, name="other foot"),
        pn.PointContact("tip2", normal=(0.0, 0.0, -1.0), unilateral=False, name="ceiling"),
    ]
    order = rng.permutation(len(said))
    q = np.array([0.4, 0.4 * ratio, 0.3])
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    height = data.oMf[model.getFrameId("tip")].translation[2]
    for name in ("tip", "tip2"):
        frame(model, f"under {name}", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, height])))
    contacts = [
        pn.PointContact(c.frame, normal=c.normal, plane=f"under {c.frame}", unilateral=False, name=c.name)
        for c in (said[k] for k in order)
        if isinstance(c, pn.PointContact)
    ]
    constraints = [said[k] for k in order if isinstance(said[k], pn.JointCoupling)]
    tau = 20.0 * rng.standard_normal(3)
    return pn.Scene(model, constraints=constraints, contacts=contacts, actuation=tau, q0=q)


@pytest.mark.parametrize("seed", seeds(range(20)))
def test_scaled_copies_beside_dense_least_norm(seed):
    """A gear stated from the other side and a foot below a ceiling are copies with other scales and signs."""
    scene = geared(seed)
    q, v = scene.project(scene.q0, 0.3 * np.ones(3))
    s = scene.solve(q, v)
    A, force = constraint_force(scene, q, v, 0.0)
    expected = minimum_norm(A, force)
    assert_close(s.lam, expected, ROUNDING * np.abs(expected).max())
    assert len(scene.dropped) == 4
    assert_close(A.T @ s.lam, force, ROUNDING * np.abs(force).max())


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_two_feet_of_a_sledge_that_cannot_turn_carry_half_each(order):
    model = empty()
    x = body(model, 0, pin.JointModelPX(), "x", 0.0)
    z = body(model, x, pin.JointModelPZ(), "z", 2.0, inertia=np.eye(3))
    for k in (0, 1):
        frame(model, f"foot{k}", z, pin.SE3(np.eye(3), np.array([0.3 * k, 0.0, 0.0])))
    feet = [pn.PointContact(f"foot{k}", mu=0.2 * (k + 1), unilateral=False, name=f"foot{k}") for k in order]
    run = pn.simulate(pn.Scene(model, contacts=feet, v0=[3.0, 0.0]), 0.1, record=("energy", "forces", "a"))
    for k in (0, 1):
        way = run.q[-1, 0]
        assert run.energy[f"foot{k}"][-1] == pytest.approx(-0.2 * (k + 1) * GRAVITY * way, rel=1e-9)
    assert_close(run.lam, GRAVITY, 1e-9)


def gears(order):
    """Two wheels with three redundant couplings, one of them reversed, each with its losses."""
    model = empty()
    for k in (0, 1):
        body(model, 0, pin.JointModelRZ(), f"wheel{k}", 1.0, inertia=0.1 * np.eye(3))
    said = [
        pn.JointCoupling("wheel1", "wheel0", ratio=2.0, name="gear0"),
        pn.JointCoupling("wheel0", "wheel1", ratio=0.5, name="gear1"),
        pn.JointCoupling("wheel1", "wheel0", ratio=2.0, name="gear2"),
    ]
    laws = [pn.JointFriction(f"gear{k}", efficiency=0.9 - 0.1 * k, name=f"rub{k}") for k in range(3)]
    return pn.Scene(
        model,
        constraints=[said[k] for k in order],
        laws=[laws[k] for k in order],
        actuation=[3.0, -0.5],
        v0=[1.0, 2.0],
    )


@pytest.mark.parametrize("order", [(2, 0, 1), (1, 2, 0)])
def test_gears_that_say_the_same_rub_under_their_shares(order):
    plain, scene = gears(range(3)), gears(order)
    s = scene.solve(scene.q0, scene.v0)
    A, _ = rows(scene, scene.q0, scene.v0, 0.0)
    assert_close(s.lam, minimum_norm(A, A.T @ s.lam), 1e-12)
    loads = by_name(scene, s.lam)
    assert_close(loads["gear1"], -0.5 * loads["gear0"], 1e-12)
    one, other = (pn.simulate(each, 0.2, record="energy", output_dt=0.2) for each in (plain, scene))
    assert_close(other.q, one.q, 1e-9)
    for k in range(3):
        assert one.energy[f"rub{k}"][-1] < -1e-6
        assert_close(other.energy[f"rub{k}"], one.energy[f"rub{k}"], 1e-9)
