"""Any change of a model after the construction of its scene is an error, except reference configurations."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.refusals import refuses


def mass(model):
    model.inertias[2].mass += 1e-12


def lever(model):
    model.inertias[1] = pin.Inertia(model.inertias[1].mass, np.full(3, 1e-9), model.inertias[1].inertia)


def rotational_inertia(model):
    model.inertias[1] = model.inertias[1] + pin.Inertia(0.0, np.zeros(3), 1e-9 * np.eye(3))


def placement(model):
    model.jointPlacements[2] = pin.SE3(pin.utils.rotate("x", 1e-9), np.zeros(3)) * model.jointPlacements[2]


def frame(model):
    model.frames[-1].placement.translation = model.frames[-1].placement.translation + np.full(3, 1e-9)


def another_frame(model):
    model.addFrame(pin.Frame("late", 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))


def frame_name(model):
    model.frames[-1].name = "other"


def joint_name(model):
    model.names[1] = "other"


def another_joint(model):
    model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "late")


def axis(model):
    model.joints[1] = pin.JointModelRevoluteUnaligned(np.array([0.6, 0.8, 0.0]))


def gravity(model):
    model.gravity = pin.Motion(np.array([0.0, 0.0, -9.8, 0.0, 0.0, 0.0]))


def armature(model):
    model.armature = model.armature + 1e-9


def limits(model):
    model.upperPositionLimit = model.upperPositionLimit - 1e-9


def effort(model):
    model.upperEffortLimit = model.upperEffortLimit + 1.0


CHANGES = (
    mass, lever, rotational_inertia, placement, frame, another_frame, frame_name, joint_name, another_joint,
    axis, gravity, armature, limits, effort,
)  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_is_told(change):
    scene = pn.load("panda")
    q, v = scene.initial_state()
    kept = scene.model.copy()
    change(scene.model)
    assert scene.model != kept, "this test must change something"
    for act in (
        lambda: scene.step(q, v, None, 1e-3),
        lambda: scene.acceleration(q, v),
        lambda: pn.simulate(scene, 1e-3),
    ):
        with refuses("was changed after the scene was made", pn.InputError):
            act()


def test_what_is_put_back_is_no_change():
    scene = pn.load("panda")
    q, v = scene.initial_state()
    before = scene.step(q, v, None, 1e-3)
    was = scene.model.inertias[1].mass
    scene.model.inertias[1].mass = 2.0
    scene.model.inertias[1].mass = was
    for now, then in zip(scene.step(q, v, None, 1e-3), before, strict=True):
        assert now.tobytes() == then.tobytes()


def test_a_limit_that_is_no_number_is_no_change():
    model = pin.buildSampleModelManipulator()
    model.upperVelocityLimit = np.full(model.nv, np.nan)
    scene = pn.Scene(model)
    assert np.isfinite(scene.acceleration(scene.q0, scene.v0)).all()


def test_poses_may_be_named_afterwards():
    scene = pn.load("panda")
    pose = scene.initial_state()[0]
    pose[1] += 0.3
    scene.model.referenceConfigurations["leaning"] = pose
    q, _ = scene.project("leaning")
    assert q[1] == pose[1]
