"""Results of a run by the names of its joints, frames, constraints and laws."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.every_joint import MODEL
from ..support.refusals import refuses


@pytest.fixture(scope="module")
def tree():
    """A run of an arm with joints of every kind, driven by torques."""
    torque = 0.1 * np.arange(1.0, MODEL.nv + 1.0)
    scene = pn.Scene(MODEL, actuation=torque, v0=0.5 * np.cos(np.arange(MODEL.nv)))
    return pn.simulate(scene, 0.5, output_dt=0.1, record=("a", "tau"))


@pytest.fixture(scope="module")
def loop():
    return pn.simulate(
        pn.load("rough_four_bar"), 0.5, output_dt=0.05, record=("forces", "reactions", "energy", "power")
    )


def test_joints(tree):
    for j in range(1, MODEL.njoints):
        joint, record = MODEL.joints[j], tree.joint(MODEL.names[j])
        v = tree.v[:, joint.idx_v : joint.idx_v + joint.nv]
        tau = np.tile(0.1 * np.arange(joint.idx_v + 1.0, joint.idx_v + joint.nv + 1.0), (len(tree), 1))
        a = tree.a[:, joint.idx_v : joint.idx_v + joint.nv]
        for values, expected in ((record.v, v), (record.a, a), (record.tau, tau)):
            assert values.shape == ((len(tree),) if joint.nv == 1 else expected.shape)
            np.testing.assert_array_equal(values.reshape(expected.shape), expected)
    np.testing.assert_array_equal(tree.joint("j0").q, tree.q[:, 0])
    np.testing.assert_array_equal(tree.joint("base").q, tree.q[:, 8:])
    np.testing.assert_allclose(np.cos(tree.joint("j3").q), tree.q[:, 6], atol=1e-15)
    with refuses('no joint "j9" in this run; nearest: "j4"', pn.UnknownNameError):
        tree.joint("j9")


@pytest.mark.parametrize("output_dt", [None, 0.01, 0.3])
def test_angles_count_whole_turns(output_dt):
    """An endless joint that turns at 30 rad/s, sampled more seldom than it turns."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "rotor")
    model.appendBodyToJoint(1, pin.Inertia.Random(), pin.SE3.Identity())
    model.gravity = pin.Motion.Zero()
    run = pn.simulate(pn.Scene(model, q0={"rotor": 1.0}, v0=[30.0]), 3.0, output_dt=output_dt)
    np.testing.assert_allclose(run.joint("rotor").q, 1.0 + 30.0 * run.t, rtol=0, atol=1e-3)


def test_planar_joints_show_their_angle():
    model = pin.Model()
    model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.gravity = pin.Motion.Zero()
    run = pn.simulate(pn.Scene(model, v0={"cart": {"angular": 9.0}}), 2.0)
    np.testing.assert_allclose(run.joint("cart").q[:, 2], 9.0 * run.t, rtol=0, atol=1e-3)
    assert run.joint("cart").q.shape == (len(run), 3)


def test_frames_move_as_pinocchio_says(tree):
    model = MODEL.copy()
    frame = pin.Frame("hand", 4, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME)
    model.addFrame(frame)
    run = pn.simulate(pn.Scene(model, v0=0.5 * np.cos(np.arange(model.nv))), 0.3, output_dt=0.1)
    hand, elbow, data = run.frame("hand"), run.frame("j3"), model.createData()
    for k in range(len(run)):
        pin.forwardKinematics(model, data, run.q[k], run.v[k])
        pin.updateFramePlacements(model, data)
        placement = data.oMf[model.getFrameId("hand")]
        velocity = pin.getFrameVelocity(model, data, model.getFrameId("hand"), pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(hand.velocity[k], velocity.vector, rtol=0, atol=1e-13)
        np.testing.assert_allclose(hand.placement[k].homogeneous, placement.homogeneous, rtol=0, atol=1e-13)
        np.testing.assert_allclose(elbow.translation[k], data.oMi[4].translation, rtol=0, atol=1e-13)
    with refuses('no frame "hnd" in model "arm"; nearest: "hand"', pn.UnknownNameError):
        run.frame("hnd")


def test_forces_of_constraints(loop):
    name = next(iter(loop.scene.constraint_slices))
    np.testing.assert_array_equal(loop.force(name), loop.lam[:, loop.scene.constraint_slices[name]])
    with refuses(f'no constraint or contact "{name}x" in this run; nearest: "{name}"', pn.UnknownNameError):
        loop.force(name + "x")
    bare = pn.simulate(loop.scene, 0.01)
    with refuses(f'force("{name}") needs a run with record="forces"', pn.InputError):
        bare.force(name)


def test_force_of_a_contact_is_that_of_a_block_on_a_plane():
    """A block of 2 kg slides along x with mu = 0.3: 2 g up, and 0.6 g against the motion."""
    model = pin.Model()
    x = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(x, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = pn.Scene(model, contacts=[pn.PointContact("block", mu=0.3, name="ground")], v0=[5.0, 0.0, 0.0])
    run = pn.simulate(scene, 0.5, record="reactions")
    g = 9.81
    np.testing.assert_allclose(
        run.force("ground"), np.tile([-0.6 * g, 0.0, 2.0 * g], (len(run), 1)), atol=1e-9
    )
    with refuses('reaction("ground") needs a run with record="reactions"', pn.InputError):
        pn.simulate(scene, 0.01).force("ground")


def test_columns_hold_all_that_was_recorded(loop):
    table = loop.columns()
    assert all(values.shape == (len(loop),) for values in table.values())
    joint = loop.joints[0]
    np.testing.assert_array_equal(table[f"{joint.name}.v"], loop.v[:, 0])
    total = sum(np.square(values).sum() for key, values in table.items() if key.endswith(".F_ideal"))
    assert total == pytest.approx(np.square(loop.F_ideal).sum())
    assert {"t", "energy.balance", "power.constraints", "violation"} <= set(table)
    law = loop.law_names[0]
    assert any(key.endswith(".C." + law.replace(" ", "_")) for key in table)


def test_dataframe(loop):
    pytest.importorskip("pandas")
    frame = loop.to_dataframe()
    assert frame.index.name == "t"
    np.testing.assert_array_equal(frame.index, loop.t)
    np.testing.assert_array_equal(frame["energy.total"], loop.energy["total"])


def test_without_pandas_the_columns_are_named():
    """As in an environment that lacks it."""
    code = """
import sys
sys.modules["pandas"] = None
import pin_nonideal as pn
try:
    pn.simulate(pn.load("four_bar"), 0.01).to_dataframe()
except pn.InputError as error:
    assert "pip install pandas, or take run.columns()" in str(error), error
else:
    raise SystemExit("no error")
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_a_file_keeps_the_names(loop, tmp_path):
    back = pn.Trajectory.load(loop.save(tmp_path / "run.npz"))
    name = next(iter(loop.rows))
    np.testing.assert_array_equal(back.force(name), loop.force(name))
    for key, values in loop.columns().items():
        np.testing.assert_array_equal(back.columns()[key], values, err_msg=key)
