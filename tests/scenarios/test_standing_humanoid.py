"""A humanoid on two feet with dry friction in all joints: nearly singular postures with many sticking joints.

The pitch axes of two straight legs are parallel but for the little by which the pelvis leans.  When the other
joints stick, the feet then hold that little by a millionth of their forces.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import lsq_linear

import pin_nonideal as pn
from pin_nonideal.description.actuation import Table

SOLES = ("left_sole_link", "right_sole_link")
# Maximum drift of a sole [m]: far above rounding, far below the drift with dropped rows.
KEPT = 1e-9


def standing(coulomb: float, kp: float, kd: float, **more) -> pn.Scene:
    """Talos, held by a controller of positions."""
    talos = pn.load("talos")
    model = talos.model
    return pn.Scene(
        model,
        constraints=[pn.FrameAnchor(sole) for sole in SOLES],
        laws=[pn.JointFriction(name, coulomb=coulomb) for name in list(model.names)[2:]],
        actuation=pn.HoldPosition(kp=kp, kd=kd),
        q0=talos.q0,
        **more,
    )


@pytest.mark.parametrize(
    ("coulomb", "kp", "kd", "seed"),
    [(20.0, 500.0, 20.0, 1), (20.0, 500.0, 20.0, 2), (20.0, 200.0, 5.0, 1), (5.0, 200.0, 5.0, 1)],
)
def test_stands_on_both_soles(coulomb: float, kp: float, kd: float, seed: int) -> None:
    scene = standing(coulomb, kp, kd)
    model = scene.model
    rng = np.random.default_rng(seed)
    bent = np.concatenate([np.zeros(6), 0.02 * rng.standard_normal(model.nv - 6)])
    q, v = scene.project(pin.integrate(model, scene.q0, bent), np.zeros(model.nv))
    run = pn.simulate(scene, 1.0, q=q, v=v, max_steps=2000, record="energy")
    assert run.t[-1] == 1.0
    data = model.createData()
    for k in range(0, len(run), 5):
        pin.framesForwardKinematics(model, data, run.q[k])
        places = [data.oMf[model.getFrameId(sole)].copy() for sole in SOLES]
        if k == 0:
            first = places
        for now, then in zip(places, first, strict=True):
            assert np.abs(pin.log6(then.actInv(now)).vector).max() < KEPT
    rubbed = np.sum([run.energy[name] for name in scene.law_names], axis=0)
    assert (np.diff(rubbed) < 1e-9).all()  # friction only takes
    assert np.abs(run.energy["balance"]).max() < 1e-5


def held_arm(**more) -> pn.Scene:
    """Two links that friction holds up against their weight."""
    model, joint, place = pin.Model(), 0, pin.SE3.Identity()
    for name in ("shoulder", "elbow"):
        joint = model.addJoint(joint, pin.JointModelRY(), place, name)
        lever = np.array([0.0, 0.0, -0.5])
        model.appendBodyToJoint(joint, pin.Inertia(1.0, lever, 0.1 * np.eye(3)), pin.SE3.Identity())
        place = pin.SE3(np.eye(3), 2.0 * lever)
    model.addFrame(pin.Frame("push", joint, 0, place, pin.FrameType.OP_FRAME))
    laws = [pn.JointFriction(name, coulomb=20.0) for name in ("shoulder", "elbow")]
    return pn.Scene(model, laws=laws, q0=np.array([0.3, 0.4]), **more)


MOREAU = {"method": "moreau", "dt": 1e-3}


def test_time_stepping_stands_still() -> None:
    """At rest no step changes a bit of the state, also with a callback, which takes each step."""
    scene = standing(40.0, 500.0, 20.0)
    bent = np.concatenate([np.zeros(6), 0.02 * np.random.default_rng(1).standard_normal(scene.model.nv - 6)])
    q, v = scene.project(pin.integrate(scene.model, scene.q0, bent), np.zeros(scene.model.nv))
    run = pn.simulate(scene, 1.0, q, v, **MOREAU, record=("energy", "a"))
    stepped = pn.simulate(scene, 1.0, q, v, **MOREAU, record=("energy", "a"), callback=lambda t, q, v: None)
    rest = run.t > 0.9
    assert (run.v[rest] == 0.0).all()
    assert (run.a[rest] == 0.0).all()
    assert (run.q[rest] == run.q[-1]).all()
    np.testing.assert_allclose(run.q, stepped.q, rtol=0, atol=KEPT)
    np.testing.assert_array_equal(run.modes, stepped.modes)
    np.testing.assert_allclose(run.energy["total"], stepped.energy["total"], rtol=0, atol=1e-8)
    assert run.stats.evaluations < stepped.stats.evaluations


def test_a_far_contact_changes_no_step() -> None:
    """Friction forces of closed legs are not unique; a contact elsewhere leaves their solution alone."""
    scene = standing(20.0, 500.0, 20.0)
    far = standing(20.0, 500.0, 20.0, contacts=[pn.PointContact("gripper_left_base_link", height=-9.0)])
    bent = np.concatenate([np.zeros(6), 0.02 * np.random.default_rng(3).standard_normal(scene.model.nv - 6)])
    q, v = scene.project(pin.integrate(scene.model, scene.q0, bent), np.zeros(scene.model.nv))
    run, beside = (pn.simulate(each, 0.1, q, v, **MOREAU, output_dt=0.1) for each in (scene, far))
    np.testing.assert_allclose(beside.q, run.q, rtol=0, atol=1e-12)


@pytest.mark.parametrize("late", ["table", "stepper", "wrench"])
def test_what_stands_is_moved_by_what_begins_to_push(late: str) -> None:
    times, torques = np.array([0.0, 0.1, 0.2]), np.array([[0.0, 0.0], [60.0, 0.0], [0.0, 0.0]])
    if late == "stepper":
        stepper = held_arm().stepper(1e-3, method="moreau")
        for _ in range(50):
            q, v = stepper.step()
        assert (q == [0.3, 0.4]).all()
        assert (v == 0.0).all()
        _, v = stepper.step([60.0, 0.0])
        assert v[0] > 0.01
        return
    if late == "table":
        scene = held_arm(actuation=Table(times, torques))
    else:
        scene = held_arm(forces=[pn.Wrench("push", lambda t: [0.0, 0.0, 0.0, 0.0, 60.0 * (t > 0.1), 0.0])])
    run = pn.simulate(scene, 0.2, **MOREAU)
    assert (run.q[run.t < 0.03] == [0.3, 0.4]).all()
    assert np.abs(run.q[-1] - [0.3, 0.4]).max() > 0.01


@pytest.mark.parametrize("seed", [1, 2, 5, 6])
def test_sinks_as_friction_lets_it(seed: int) -> None:
    """The acceleration from rest follows Gauss's principle: the least |R^T a|^2 over friction within its
    limits.

    Sticking in a leg depends on accelerations of legs, not on those of a much lighter wrist.
    """
    limit, kp = 20.0, 500.0
    scene = standing(limit, kp, 20.0)
    model = scene.model
    bent = np.concatenate([np.zeros(6), 0.02 * np.random.default_rng(seed).standard_normal(model.nv - 6)])
    q, v = scene.project(pin.integrate(model, scene.q0, bent), np.zeros(model.nv))
    data = model.createData()
    M = pin.crba(model, data, q)
    R = np.linalg.cholesky(np.triu(M) + np.triu(M, 1).T)
    tau = np.zeros(model.nv)
    tau[6:] = kp * pin.difference(model, q, scene.q0)[6:]
    feet = [pin.computeFrameJacobian(model, data, q, model.getFrameId(sole), pin.LOCAL) for sole in SOLES]
    B = np.linalg.solve(R, np.vstack(feet).T)
    free = np.eye(model.nv) - B @ np.linalg.pinv(B)
    X = free @ np.linalg.solve(R, np.eye(model.nv)[:, 6:])
    given = free @ np.linalg.solve(R, tau - pin.nonLinearEffects(model, data, q, 0.0 * v))
    friction = lsq_linear(X, -given, (-limit, limit), method="bvls", tol=1e-16, max_iter=5000).x
    a = np.linalg.solve(R.T, given + X @ friction)
    dt = 1e-8  # the step takes the control implicitly, which differs by dt kd / inertia
    step = pn.simulate(scene, dt, q, v, method="moreau", dt=dt)
    start = pn.simulate(scene, dt, q, v, record="a")
    assert a[2] < -2.0  # it sinks
    np.testing.assert_allclose(step.v[-1] / dt, a, rtol=0, atol=1e-4 * np.abs(a).max())
    np.testing.assert_allclose(start.a[0], a, rtol=0, atol=1e-4 * np.abs(a).max())


def test_a_jam_of_joints_is_told_as_one() -> None:
    """For bearings as wide as the links, none of the 27 modes of three joints at rest is a solution."""
    talos = pn.load("talos")
    model, names = talos.model, list(talos.model.names)[2:]
    bearings = [pn.JointFriction(name, mu=0.1, radius=0.05) for name in names]
    scene = pn.Scene(model, constraints=[pn.FrameAnchor(s) for s in SOLES], laws=bearings, q0=talos.q0)
    bend = np.concatenate([np.zeros(6), 0.02 * np.random.default_rng(1).standard_normal(model.nv - 6)])
    q, v = scene.project(pin.integrate(model, scene.q0, bend), np.zeros(model.nv))
    with pytest.raises(pn.FrictionParadoxError, match="has no solution at") as told:
        pn.simulate(scene, 1.0, q, v)
    run = told.value.trajectory
    joints = [model.joints[model.getJointId(name)].idx_v for name in names]
    q, v = run.q[-1], run.v[-1]
    resting = np.flatnonzero(np.abs(v[joints]) < 1e-8)
    assert len(resting) == 3
    for chosen in product((-1, 0, 1), repeat=3):
        modes = np.sign(v[joints]).astype(int)
        modes[resting] = chosen
        try:
            a = scene.solve(q, v, run.t[-1], modes=modes.tolist()).a[joints][resting]
        except pn.FrictionParadoxError:
            continue
        assert (np.array(chosen) * a < -1e-3).any()  # one of them would go against its mode
