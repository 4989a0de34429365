"""Scenes loaded from MJCF against MuJoCo's own mass matrix, bias, forces and accelerations."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import pin_nonideal as pn
from oracles import mujoco_motion
from pin_nonideal.errors import LoopClosureError

from ..support.random_mjcf import mjcf_files

# Both sides evaluate some hundred products of numbers of order one; the condition of M multiplies the rest.
ROUNDING = 1e-9
EPS = float(np.finfo(float).eps)


@pytest.fixture(autouse=True, scope="module")
def _no_log():
    """Install a warning handler: without it MuJoCo writes warnings to a file in the working directory."""
    mujoco.set_mju_user_warning(lambda text: None)
    yield
    mujoco.set_mju_user_warning(None)


def same(ours, theirs, scale=1.0):
    np.testing.assert_allclose(
        ours, theirs, rtol=0, atol=ROUNDING * (1.0 + scale * np.abs(theirs).max(initial=0))
    )


def compare(path, seed=0, states=2, spread=0.4, **parameters):
    """A loaded scene beside MuJoCo at random states, which are closed first where loops are."""
    scene, compiled = pn.load(path, **parameters), mujoco.MjModel.from_xml_path(str(path))
    rng = np.random.default_rng(seed)
    for _ in range(states):
        qpos, qvel = mujoco_motion.random_state(compiled, rng, spread)
        ctrl = rng.uniform(-1.0, 1.0, compiled.nu)
        if scene.constraints:
            start = mujoco_motion.instant(compiled, qpos, qvel)
            qpos, qvel = mujoco_motion.mujoco_state(compiled, *scene.project(start.q, start.v))
        theirs = mujoco_motion.instant(compiled, qpos, qvel, ctrl)
        M = pin.crba(scene.model, scene.model.createData(), theirs.q)
        same(np.triu(M) + np.triu(M, 1).T, theirs.M)
        same(pin.nonLinearEffects(scene.model, scene.model.createData(), theirs.q, theirs.v), theirs.bias)
        if scene.actuation is not None:
            scene.actuation.set_control(ctrl)
            same(scene.actuation(0.0, theirs.q, theirs.v), theirs.actuator)
        condition = np.linalg.cond(theirs.M)
        same(scene.solve(theirs.q, theirs.v).a, theirs.a, max(1.0, EPS * condition / ROUNDING))


@pytest.mark.slow
@settings(max_examples=300, deadline=None, phases=[Phase.generate], derandomize=True)
@given(text=mjcf_files(), seed=st.integers(0, 1000))
def test_many_random_files(tmp_path_factory, text, seed):
    compare_file(tmp_path_factory, text, seed)


@settings(max_examples=10, deadline=None, phases=[Phase.generate], derandomize=True)
@given(text=mjcf_files(), seed=st.integers(0, 1000))
def test_random_files(tmp_path_factory, text, seed):
    compare_file(tmp_path_factory, text, seed)


def compare_file(tmp_path_factory, text, seed):
    path = tmp_path_factory.mktemp("mjcf") / "robot.xml"
    path.write_text(text)
    try:
        compare(path, seed)
    except LoopClosureError:  # a loop drawn by lot that closes nowhere
        return
