"""Tables of a scene: parts, M(q), rows and energies, against Pinocchio."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.every_joint import MODEL
from ..support.refusals import refuses
from ..support.small_robots import folder, joint, link, robot

STATE = (
    pin.integrate(MODEL, pin.neutral(MODEL), 0.4 * np.cos(np.arange(MODEL.nv))),
    np.sin(np.arange(MODEL.nv)),
)


@pytest.mark.parametrize("terms", ["core", "pinocchio"])
def test_terms_are_those_of_pinocchio(terms):
    q, v = STATE
    scene, data = pn.Scene(MODEL, terms=terms), MODEL.createData()
    M = pin.crba(MODEL, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    np.testing.assert_allclose(scene.mass_matrix(q), M, rtol=0, atol=1e-13 * np.abs(M).max())
    bias = pin.nonLinearEffects(MODEL, data, q, v)
    np.testing.assert_allclose(scene.bias_forces(q, v), bias, rtol=0, atol=1e-12 * np.abs(bias).max())
    gravity = pin.computeGeneralizedGravity(MODEL, data, q)
    np.testing.assert_allclose(scene.bias_forces(q), gravity, rtol=0, atol=1e-12 * np.abs(gravity).max())
    energies = scene.energies(q, v)
    assert energies["kinetic"] == pytest.approx(pin.computeKineticEnergy(MODEL, data, q, v), rel=1e-13)
    assert energies["potential"] == pytest.approx(pin.computePotentialEnergy(MODEL, data, q), rel=1e-13)
    assert energies["total"] == energies["kinetic"] + energies["potential"]
    assert scene.energies(q)["kinetic"] == 0.0


def test_rows_are_the_derivative_of_the_residual():
    """The force of an anchor, A^T lam, is that of Pinocchio's frame Jacobian."""
    model = MODEL.copy()
    for name, parent in (("left", 4), ("right", 5)):
        model.addFrame(pin.Frame(name, parent, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    q = STATE[0]
    scene = pn.Scene(model, constraints=[pn.PointAnchor("left", name="held")], q0=q)
    data = model.createData()
    jacobian = pin.computeFrameJacobian(model, data, q, model.getFrameId("left"), pin.LOCAL_WORLD_ALIGNED)[:3]
    np.testing.assert_allclose(scene.jacobian("held", q), jacobian, rtol=0, atol=1e-13)
    np.testing.assert_allclose(scene.jacobian("held"), jacobian, rtol=0, atol=1e-10)
    named = {str(n): q[i : i + k] for n, i, k in zip(model.names, model.idx_qs, model.nqs, strict=True) if k}
    np.testing.assert_allclose(scene.jacobian("held", named), jacobian, rtol=0, atol=1e-13)
    with refuses('no constraint or contact "hel" in scene "arm"; nearest: "held"', pn.UnknownNameError):
        scene.jacobian("hel")


def test_without_a_state_the_closed_initial_one_is_taken():
    scene = pn.load("four_bar")
    q, v = scene.initial_state()
    np.testing.assert_array_equal(scene.mass_matrix(), scene.mass_matrix(q))
    np.testing.assert_array_equal(scene.bias_forces(), scene.bias_forces(q, np.zeros_like(v)))
    assert scene.energies() == scene.energies(q)


def test_the_description_holds_what_the_scene_was_made_with(tmp_path):
    parts = [
        link("z"),
        joint("z_arm", "base", "z", limits='lower="-1" upper="2"'),
        link("a"),
        joint("a_arm", "base", "a"),
    ]
    dynamics = '<dynamics damping="0.1" friction="0.2"/>'
    parts += [link("c"), joint("c_arm", "a", "c", kind="continuous", inside=dynamics)]
    path = folder(tmp_path, urdf=robot('<link name="base"/>', *parts))
    arm = pn.load(path)
    told = arm.describe()
    names = [str(n) for n in arm.model.names][1:]
    assert [j["name"] for j in told.joints] == names
    by_name = {j["name"]: j for j in told.joints}
    assert (by_name["z_arm"]["lower"], by_name["z_arm"]["upper"]) == ([-1.0], [2.0])
    assert by_name["z_arm"]["file_index"] == 0
    assert by_name["c_arm"]["lower"] is None
    assert (by_name["c_arm"]["damping"], by_name["c_arm"]["friction"]) == ([0.1], [0.2])
    assert (by_name["c_arm"]["q_first"], by_name["c_arm"]["nq"], by_name["c_arm"]["parent"]) == (
        1,
        2,
        "a_arm",
    )
    assert [law["kind"] for law in told.laws] == ["JointFriction"]
    assert "order in the file: z_arm, a_arm, c_arm" in str(told)


def test_the_description_is_plain_and_printed():
    for name in ("rough_four_bar", "rolling_disk", "belt_oscillator", "worm_drive", "delta"):
        scene = pn.load(name)
        told = scene.describe()
        assert json.loads(json.dumps(told.to_dict())) == told.to_dict()
        assert {c["name"] for c in told.constraints + told.contacts} == set(scene.constraint_slices)
        for row in told.constraints + told.contacts:
            s = scene.constraint_slices[row["name"]]
            assert (row["first"], row["rows"]) == (s.start, s.stop - s.start)
        assert all(joint["name"] in str(told) for joint in told.joints)
    dropped = {(row["name"], r) for row in pn.load("four_bar").describe().constraints for r in row["dropped"]}
    assert dropped == {(name, r) for name, r, _ in pn.load("four_bar").dropped}


def test_forces_and_actuation_are_told():
    spring = pn.JointSpring("j0", stiffness=3.0)
    for actuation, kind in (
        (np.ones(MODEL.nv), "constant torques"),
        (lambda t, q, v: v, "function (t, q, v)"),
        (pn.SampledControl(lambda t, q, v: v, 0.1), "SampledControl"),
    ):
        told = pn.Scene(MODEL, forces=[spring], actuation=actuation).describe()
        assert told.actuation["kind"] == kind
        assert told.forces == [
            {"kind": "JointSpring", "made_with": {**told.forces[0]["made_with"], "stiffness": 3.0}}
        ]
        assert json.dumps(told.to_dict())
    assert pn.Scene(MODEL).describe().actuation is None
