"""States by joint name: one parser for Scene, simulate, project, solve, load and robot.yaml."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.every_joint import MODEL, Q, V
from ..support.refusals import refuses
from ..support.small_robots import ARM, folder, joint, link, robot

# Pinocchio sorts the joints that leave the base: "a_arm" comes before "z_arm".
SWAPPED = [
    '<link name="base"/>',
    link("z_link"),
    joint("z_arm", "base", "z_link", axis="0 1 0"),
    link("a_link"),
    joint("a_arm", "base", "a_link", axis="1 0 0"),
]
NAMED_Q = {
    "j0": 0.3,
    "j1": [-0.1],
    "j2": {"rpy": [0.1, 0.2, 0.3]},
    "j3": 2.5,
    "base": {"xyz": [1, 2, 3], "rpy": [0, 0, 0.5]},
}
NAMED_V = {
    "j0": 1,
    "j2": {"angular": [1, 2, 3]},
    "j3": [4],
    "base": {"linear": [5, 6, 7], "angular": [8, 9, 10]},
}


def coordinates():
    """Return the values of NAMED_Q and NAMED_V, by functions of Pinocchio."""
    q = np.concatenate(
        [
            [0.3, -0.1],
            pin.Quaternion(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3)).coeffs(),
            [np.cos(2.5), np.sin(2.5)],
            pin.SE3ToXYZQUAT(pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.5), np.array([1.0, 2.0, 3.0]))),
        ]
    )
    return q, np.array([1, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10.0])


def test_every_joint_goes_by_its_name():
    q, v = coordinates()
    scene = pn.Scene(MODEL)
    made = pn.Scene(MODEL, q0=NAMED_Q, v0=NAMED_V)
    np.testing.assert_allclose(made.q0, q, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(made.v0, v)
    np.testing.assert_array_equal(scene.project(NAMED_Q, NAMED_V)[0], made.q0)
    expected = scene.solve(made.q0, v).a
    np.testing.assert_array_equal(scene.solve(NAMED_Q, NAMED_V).a, expected)
    np.testing.assert_array_equal(scene.acceleration(NAMED_Q, NAMED_V), scene.acceleration(made.q0, v))
    run = pn.simulate(scene, 0.01, NAMED_Q, NAMED_V)
    np.testing.assert_array_equal(run.q, pn.simulate(made, 0.01).q)


@pytest.mark.parametrize("seed", range(5))
def test_values_of_a_joint_are_those_of_pinocchio(seed):
    q = pin.integrate(MODEL, Q, np.random.default_rng(seed).standard_normal(MODEL.nv))
    named = {name: q[i : i + n] for name, i, n in zip(MODEL.names, MODEL.idx_qs, MODEL.nqs, strict=True) if n}
    np.testing.assert_allclose(pn.Scene(MODEL, q0=named).q0, q, rtol=0, atol=1e-15)


def test_what_is_not_named_stays():
    scene = pn.Scene(MODEL, q0=NAMED_Q, v0=NAMED_V)
    q, v = scene.project({"j0": 0.7, "j4": {"xyz": [0, 0, 9]}}, {"base": {"linear": [0, 0, 0]}})
    expected, speed = coordinates()
    expected[0], expected[8:11], speed[6:9] = 0.7, [0, 0, 9], 0.0
    np.testing.assert_allclose(q, expected, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(v, speed)
    np.testing.assert_array_equal(pn.Scene(MODEL, q0={}).q0, Q)
    np.testing.assert_array_equal(pn.Scene(MODEL, v0={}).v0, V)


def test_references_placements_planar_joints_and_bodies():
    model = pin.Model()
    free = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "cart")
    for j in (1, 2):
        model.appendBodyToJoint(j, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("trunk", free, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    placement = pin.SE3.Random()
    model.referenceConfigurations["home"] = np.concatenate([pin.SE3ToXYZQUAT(placement), [1, 2, 0, 1]])
    cart = {"xy": [1, 2], "angle": np.pi / 2}
    by_place = pn.Scene(model, q0={"trunk": placement, "cart": cart}, v0={"cart": {"linear": [1, 2]}})
    np.testing.assert_allclose(by_place.q0, pn.Scene(model, q0="home").q0, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(by_place.v0[6:], [1, 2, 0])
    np.testing.assert_array_equal(pn.Scene(model, q0={"cart": [1, 2, 0.0]}).q0[7:], [1, 2, 1, 0])


def test_lists_that_may_be_in_the_order_of_the_file_are_told(tmp_path):
    folder(tmp_path, urdf=robot(*SWAPPED), yaml="initial: {v: [1, 2]}")
    scene = pn.load(tmp_path)
    np.testing.assert_array_equal(scene.v0, [1, 2])
    words = (
        "a list is taken in the order of the model (a_arm, z_arm), which is not the order of the file "
        "(z_arm, a_arm)"
    )
    assert any(note.endswith(words) for note in scene.notes)
    advice = '; name the joints, such as v={"a_arm": ...}, or pass an array in the order of the model'
    with pytest.warns(pn.JointOrderWarning) as told:
        scene.project(v=[1.0, 2.0])
    assert str(told[0].message) == f"v: {words}{advice}"
    assert told[0].filename == __file__
    for call in (
        lambda: pn.Scene(scene.model, q0=[0.1, 0.2]),
        lambda: pn.load(tmp_path, q0=[0.1, 0.2]),
        lambda: pn.load(tmp_path, v0=(0.1, 0.2)),
        lambda: pn.simulate(scene, 0.01, v=[0.1, 0.2]),
        lambda: scene.solve([0.1, 0.2], np.zeros(2)),
    ):
        with pytest.warns(pn.JointOrderWarning):
            call()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.project(np.zeros(2), {"z_arm": 1.0})
        pn.load(tmp_path, q0={"z_arm": 0.2}, v0={"z_arm": 0.3})


def test_lists_in_the_same_order_pass_without_a_word(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = pn.load(folder(tmp_path), q0=[0.1, 0.2])
        scene.project([0.3, 0.4], [1.0, 2.0])


def test_load_takes_velocities_by_name(tmp_path):
    scene = pn.load(folder(tmp_path), v0={"elbow": 2.0})
    np.testing.assert_array_equal(scene.v0, [0, 2])
    with refuses('load: v0: no joint "elbw"; nearest: "elbow"', pn.UnknownNameError):
        pn.load(tmp_path, v0={"elbw": 2.0})
    with refuses(
        'load: q0: joint "hand_joint" is fixed (locked) and cannot move; leave it out', pn.UnknownNameError
    ):
        pn.load(tmp_path, q0={"hand_joint": 2.0})


def test_pieces_are_read_from_robot_yaml(tmp_path):
    yaml = "model: {free_flyer: true}\ninitial: {q: {base: {xyz: [0, 0, 1], rpy: [0, 0, 1]}, elbow: 0.5}}"
    scene = pn.load(folder(tmp_path, yaml, robot(link("base"), *ARM[1:5])))
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0, 0, 1.0)).coeffs()
    np.testing.assert_allclose(scene.q0, [0, 0, 1, *turn, 0, 0.5], rtol=0, atol=1e-15)
