"""Rows A a = b of every kind of constraint against differences, and solutions of the core with them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.differences import MET, assert_rows_match_differences, consistent, rows_at
from oracles.solutions import assert_solves_its_rows

from ...support.random_trees import AXIS, attach, place_of, state, three_trees
from ...support.row_cases import ROBOTS, TREES, kept

# Pinocchio's constraintDynamics ends its iteration at a relative error of 1e-12.
PINOCCHIO = 1e-9


@pytest.mark.parametrize("kind", TREES)
def test_each_kind_on_random_trees(kind):
    rng = np.random.default_rng(len(kind))
    for _ in range(2):
        scene = TREES[kind](rng)
        for t in (0.0, 0.63):
            q, v = consistent(scene, rng, t)
            assert_rows_match_differences(scene, q, v, t, rng.standard_normal(scene.model.nv))
            assert_solves_its_rows(scene, q, v, t)


@pytest.mark.parametrize("name", ROBOTS)
def test_each_robot(name):
    rng = np.random.default_rng(1)
    scene = kept(pn.load(name))
    for t in (0.0, 0.4):
        q, v = scene.project(*scene.initial_state(), t) if t == 0.0 else consistent(scene, rng, t)
        assert_rows_match_differences(scene, q, v, t, rng.standard_normal(scene.model.nv))
        assert_solves_its_rows(scene, q, v, t)


def material_velocity(model, q, v, frame, point):
    """Return the velocity of the body-fixed point at `point` in the world; zero for the world."""
    if frame is None:
        return np.zeros(3)
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    joint = model.frames[model.getFrameId(frame)].parentJoint
    motion = data.oMi[joint].act(data.v[joint])
    return motion.linear + np.cross(motion.angular, point)


@pytest.mark.parametrize("kind", [k for k in TREES if k.startswith(("disk", "sphere"))])
def test_rolling_rates_are_the_slip_of_the_contact_point(kind):
    rng = np.random.default_rng(3)
    scene = TREES[kind](rng)
    (rolling,) = scene.constraints
    q, _ = consistent(scene, rng, 0.0)
    v = rng.standard_normal(scene.model.nv)
    body = place_of(scene.model, q, rolling.frame)
    plane = pin.SE3.Identity() if rolling.plane is None else place_of(scene.model, q, rolling.plane)
    n = plane.rotation[:, 2]
    down = -n
    if rolling.axis is not None:
        e = body.rotation @ np.array(rolling.axis)
        down = -(n - (n @ e) * e) / np.linalg.norm(n - (n @ e) * e)
    contact = body.translation + rolling.radius * down
    assert (contact - plane.translation) @ n == pytest.approx(0.0, abs=MET)
    slip = material_velocity(scene.model, q, v, rolling.frame, contact)
    slip = slip - material_velocity(scene.model, q, v, rolling.plane, contact)
    rate = rows_at(scene, scene._compiled.program.runner(), q, v, 0.0)[3]
    np.testing.assert_allclose(rate, plane.rotation.T @ slip, atol=10 * MET)


def test_knife_edge_rate_is_the_velocity_along_its_axis():
    rng = np.random.default_rng(4)
    scene = TREES["knife edge"](rng)
    q, v = state(scene.model, rng)
    tip = place_of(scene.model, q, "b2 tip")
    u = material_velocity(scene.model, q, v, "b2 tip", tip.translation)
    rate = rows_at(scene, scene._compiled.program.runner(), q, v, 0.0)[3]
    np.testing.assert_allclose(rate, [u @ tip.rotation @ AXIS], atol=10 * MET)


# --- Pinocchio's own constraint dynamics ---------------------------------------------------


def pinocchio_acceleration(model, q, v, tau, constraints):
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for constraint in constraints:
        models.append(constraint)
        datas.append(constraint.createData())
    data = model.createData()
    settings = pin.ProximalSettings(1e-14, 1e-14, 1e-10, 200)  # absolute, relative, mu, iterations
    pin.initConstraintDynamics(model, data, models, datas)
    return np.array(pin.constraintDynamics(model, data, q, v, tau, models, datas, settings))


@pytest.mark.parametrize("contact", ["CONTACT_3D", "CONTACT_6D"])
@pytest.mark.parametrize(("one", "other"), [("a3", "b2"), ("c3", "b1"), ("a3", None), ("c3", "c0")])
def test_anchors_against_pinocchio(contact, one, other):
    rng = np.random.default_rng(5)
    model, q = three_trees(rng)
    here = place_of(model, q, f"{one} tip")
    joint = 0 if other is None else model.getJointId(other)
    end = here
    if other is not None:
        end = model.frames[model.getFrameId(attach(model, "meet", joint, q, here))].placement
    tip = model.frames[model.getFrameId(f"{one} tip")]
    kind = getattr(pin.ContactType, contact)
    local = pin.ReferenceFrame.LOCAL
    rigid = pin.RigidConstraintModel(kind, model, tip.parentJoint, tip.placement, joint, end, local)
    make = pn.PointAnchor if contact == "CONTACT_3D" else pn.FrameAnchor
    ours = pn.Scene(model, constraints=[make(f"{one} tip", None if other is None else "meet")], q0=q)
    wrapped = pn.Scene(model, constraints=[rigid], q0=q)
    for _ in range(3):
        q, v = consistent(ours, rng, 0.0)
        tau = rng.standard_normal(model.nv)
        expected = pinocchio_acceleration(model, q, v, tau, [rigid])
        for scene in (ours, wrapped):
            a = scene.acceleration(q, v, tau)
            np.testing.assert_allclose(a, expected, rtol=0, atol=PINOCCHIO * np.abs(expected).max())


def test_a_standing_quadruped_against_pinocchio():
    rng = np.random.default_rng(6)
    scene = pn.load("solo12_standing")
    model = scene.model
    rigid = []
    for foot in scene.constraints:
        frame = model.frames[model.getFrameId(foot.frame1)]
        place = place_of(model, scene.q0, foot.frame1)
        rigid.append(
            pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D,
                model,
                frame.parentJoint,
                frame.placement,
                0,
                pin.SE3(np.eye(3), place.translation),
                pin.ReferenceFrame.LOCAL,
            )
        )
    q, v = consistent(scene, rng, 0.0)
    tau = rng.standard_normal(model.nv)
    expected = pinocchio_acceleration(model, q, v, tau, rigid)
    a = scene.acceleration(q, v, tau)
    np.testing.assert_allclose(a, expected, rtol=0, atol=PINOCCHIO * np.abs(expected).max())


@pytest.mark.parametrize("rtol", [1e-10, 1e-11])
def test_a_rate_that_is_not_given_is_exact_enough_for_tight_tolerances(rtol):
    """A rod of a pendulum in space whose length swings, with and without its rate."""
    model = pin.Model()
    ball = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(ball, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())

    def length(t):
        return 1.0 + 0.1 * np.sin(3.0 * t), 0.3 * np.cos(3.0 * t), -0.9 * np.sin(3.0 * t)

    def rows(t, q, v, data):
        r, dr, ddr = length(t)
        return q[None], [dr * dr + r * ddr - v @ v]

    def residual(t, q):
        return [0.5 * (q @ q - length(t)[0] ** 2)]

    def rate(t, q, v):
        return [q @ v - length(t)[0] * length(t)[1]]

    runs = []
    for given in (None, rate):
        rod = pn.UserConstraint(rows, 1, residual=residual, rate=given, name="rod")
        scene = pn.Scene(model, constraints=[rod], q0=[0.6, 0.0, -0.8])
        runs.append(pn.simulate(scene, 0.3, rtol=rtol, atol=0.01 * rtol, output_dt=0.1, max_steps=1000))
    found, expected = runs
    assert found.stats.steps + found.stats.rejected <= 2 * (expected.stats.steps + expected.stats.rejected)
    np.testing.assert_allclose(found.q[-1], expected.q[-1], rtol=0.0, atol=1e2 * rtol)
