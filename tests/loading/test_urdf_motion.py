"""Random URDF files against MuJoCo's own reading of them: mass matrix and gravity."""

from __future__ import annotations

import random

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import pin_nonideal as pn
from oracles import mujoco_urdf

KINDS = ("revolute", "continuous", "prismatic", "planar", "fixed")


def vector(rnd, low=-1.0, high=1.0, n=3):
    return " ".join(repr(round(rnd.uniform(low, high), 4)) for _ in range(n))


def inertial(rnd):
    a, b = rnd.uniform(0.05, 0.2), rnd.uniform(0.05, 0.2)
    c = rnd.uniform(abs(a - b) + 0.01, a + b - 0.01)  # a body's: no moment exceeds the sum of the others
    moments = f'ixx="{a}" iyy="{b}" izz="{c}" ixy="0" ixz="0" iyz="0"'
    origin = f'<origin xyz="{vector(rnd, -0.3, 0.3)}" rpy="{vector(rnd)}"/>'
    return f'<inertial>{origin}<mass value="{rnd.uniform(0.5, 3)}"/><inertia {moments}/></inertial>'


def urdf(seed):
    """A random tree; every other origin or axis is left to its default."""
    rnd = random.Random(seed)
    parts, kinds = [f'<link name="l0">{inertial(rnd)}</link>'], {}
    for k in range(1, rnd.randint(3, 8)):
        kind = kinds[f"j{k}"] = KINDS[-1] if k == 2 else rnd.choice(KINDS)
        axis = rnd.choice(
            [f'<axis xyz="{vector(rnd, 0.1)}"/>', '<axis xyz="0 -1 0"/>', '<axis xyz="0 0 -2"/>', ""]
        )
        turn = rnd.choice([f' rpy="{vector(rnd, -3, 3)}"', f' quat_xyzw="{vector(rnd, 0.1, 2, 4)}"', ""])
        place = rnd.choice([f' xyz="{vector(rnd)}"', ""])
        limit = (
            '<limit lower="-4" upper="4" effort="1" velocity="1"/>'
            if kind in ("revolute", "prismatic")
            else ""
        )
        parts.append(f'<link name="l{k}">{inertial(rnd)}</link>')
        parts.append(
            f'<joint name="j{k}" type="{kind}"><parent link="l{rnd.randrange(k)}"/><child link="l{k}"/>'
            f"<origin{place}{turn}/>{axis}{limit}</joint>"
        )
    rnd.shuffle(parts)
    return f'<robot name="r" version="1.1">{"".join(parts)}</robot>', kinds


def compare(path, seed):
    text, kinds = urdf(seed)
    path.write_text(text)
    moving = [name for name, kind in kinds.items() if kind != "fixed"]
    if not moving:
        return
    scene, rng = pn.load(path), np.random.default_rng(seed)
    model = scene.model.copy()
    model.gravity = pin.Motion(np.array(mujoco_urdf.GRAVITY), np.zeros(3))
    positions = {name: rng.uniform(-2, 2, 3 if kinds[name] == "planar" else 1) for name in moving}
    names = sorted(moving, key=model.getJointId)
    q = pin.neutral(model)
    for name in names:
        x, j = positions[name], model.getJointId(name)
        circle = [np.cos(x[-1]), np.sin(x[-1])]
        value = [*x[:2], *circle] if len(x) == 3 else circle if model.nqs[j] == 2 else x
        q[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]] = value
    M, gravity = mujoco_urdf.terms(mujoco_urdf.compiled(text), names, positions)
    ours = pin.crba(model, model.createData(), q)
    np.testing.assert_allclose(np.triu(ours) + np.triu(ours, 1).T, M, rtol=0, atol=1e-12 * np.abs(M).max())
    ours = pin.computeGeneralizedGravity(model, model.createData(), q)
    np.testing.assert_allclose(ours, gravity, rtol=0, atol=1e-12 * np.abs(M).max() * 10.0)


@settings(max_examples=100, deadline=None, phases=[Phase.generate], derandomize=True)
@given(seed=st.integers(0, 2**32))
def test_random_urdf_files_move_as_in_mujoco(tmp_path_factory, seed):
    compare(tmp_path_factory.mktemp("urdf") / "robot.urdf", seed)


@pytest.mark.slow
@settings(max_examples=2000, deadline=None, phases=[Phase.generate], derandomize=True)
@given(seed=st.integers(0, 2**32))
def test_many_random_urdf_files_move_as_in_mujoco(tmp_path_factory, seed):
    compare(tmp_path_factory.mktemp("urdf") / "robot.urdf", seed)


def test_frames_and_shapes_stay_on_the_link_of_a_planar_joint(tmp_path):
    """At rest all links, frames and shapes are where the file has them, whatever the plane."""
    inside = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    shape = (
        '<visual><origin xyz="0 0 0.5" rpy="0.1 0.2 0.3"/><geometry><box size="1 2 3"/></geometry></visual>'
    )
    text = (
        f'<robot name="r"><link name="a"/><link name="b">{inside}{shape}</link><link name="c"/>'
        f'<link name="d">{inside}</link><joint name="p" type="planar"><parent link="a"/><child link="b"/>'
        '<origin xyz="1 0 0"/><axis xyz="0 1 0"/></joint><joint name="f" type="fixed"><parent link="b"/>'
        '<child link="c"/><origin xyz="0 0 2" rpy="0 0 1"/></joint><joint name="e" type="continuous">'
        '<parent link="b"/><child link="d"/><origin xyz="0 3 0"/></joint></robot>'
    )
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    scene = pn.load(path)
    model = scene.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    expected = {
        "b": ([1, 0, 0], np.eye(3)),
        "c": ([1, 0, 2], pin.exp3(np.array([0, 0, 1.0]))),
        "d": ([1, 3, 0], np.eye(3)),
    }
    for name, (place, turn) in expected.items():
        found = data.oMf[model.getFrameId(name, pin.FrameType.BODY)]
        np.testing.assert_allclose(found.translation, place, atol=1e-15)
        np.testing.assert_allclose(found.rotation, turn, atol=1e-15)
    (item,) = scene.visual_model.geometryObjects
    found = data.oMi[item.parentJoint] * item.placement
    np.testing.assert_allclose(found.translation, [1, 0, 0.5], atol=1e-15)
    np.testing.assert_allclose(found.rotation, pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), atol=1e-15)
    note = (
        'planar joint "p" moves in the plane normal to its axis 0 1 0: its x and y are along 1 0 0 and '
        "0 0 -1 in the joint's frame"
    )
    assert note in scene.notes
