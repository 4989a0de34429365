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
    except LoopClosureError:  # a random loop that closes at no configuration
        return


# A hand on an arm, a wheel on a ball joint, and a guide on the ground.
BODIES = """<body name="arm"><joint name="a" axis="0 1 0.2"/><geom size="0.1" pos="0.5 0 0.1"/>
  <site name="elbow" pos="0.6 0 0"/><site name="shoulder" pos="0.1 0 0.1"/>
  <body name="hand" pos="0.8 0 0"><joint name="b" axis="0.1 1 0"/><geom size="0.1" pos="0.3 0.1 0"/>
    <site name="tip" pos="0.4 0 0.1"/></body></body>
<body name="wheel" pos="0 1 0"><joint name="ball" type="ball"/><geom size="0.1" pos="0 0.1 0.2"/>
  <site name="rim" pos="0.1 0.2 0"/></body>
<site name="guide" pos="1.5 0.2 0.1" euler="90 10 0"/>"""
CRANK = 'cranksite="tip" slidersite="guide"'
ROPE = '<site site="tip"/><site site="rim"/>'
BENT_ROPE = '<site site="shoulder"/><site site="elbow"/><site site="rim"/>'  # one piece lies on one body
FILES = {
    "slider-crank": f'<actuator><motor {CRANK} cranklength="2.5" gear="2"/></actuator>',
    "slider-crank servo": f'<actuator><position {CRANK} cranklength="2.5" kp="3" kv="0.2"/></actuator>',
    "crank beyond its rod": f'<actuator><motor {CRANK} cranklength="0.1" gear="2"/></actuator>',
    # The set angles lie beyond half a turn of these gears.
    "servo of a ball joint": '<actuator><position joint="ball" kp="5" gear="0.03 0.04 0.1"/></actuator>',
    "servo of an angle between sites": """<actuator><position site="tip" refsite="guide" kp="3"
        gear="0 0 0 0 0.1 0.05"/></actuator>""",
    "servo of a place between sites": """<actuator><position site="tip" refsite="guide" kp="3"
        gear="0.2 0 0 0 0.1 0.05"/></actuator>""",
    "drives that share a limited tendon": """<tendon><fixed name="t" actuatorfrclimited="true"
        actuatorfrcrange="-0.2 0.2"><joint joint="a" coef="1"/><joint joint="b" coef="-2"/></fixed></tendon>
        <actuator><motor tendon="t"/><motor tendon="t" gear="2"/></actuator>""",
    "elastic rope": f'<tendon><spatial stiffness="30" springlength="0.5">{ROPE}</spatial></tendon>',
    "elastic rope with a bend": f"""<tendon><spatial stiffness="30" springlength="0.5" damping="0.3">
        {BENT_ROPE}</spatial></tendon>""",
    "rope on one body": """<tendon><spatial stiffness="30" springlength="0.1"><site site="shoulder"/>
        <site site="elbow"/></spatial></tendon>""",
    "driven rope": f"""<tendon><spatial name="t">{ROPE}</spatial></tendon>
        <actuator><motor tendon="t" gear="3"/></actuator>""",
    "rope of constant length": f"""<tendon><spatial name="t">{BENT_ROPE}</spatial></tendon>
        <equality><tendon tendon1="t"/></equality>""",
    "armature and damping of a drive": """<actuator><motor joint="a" armature="0.3" damping="0.5" gear="2"/>
        </actuator>""",
    "equalities switched off": """<equality><joint joint1="a" joint2="b"/></equality>
        <option><flag equality="disable"/></option>""",
    "weightless bodies": """<equality><joint joint1="a" joint2="b"/></equality><option gravity="0 0 0"/>""",
}


@pytest.mark.parametrize("name", FILES)
def test_drives_and_tendons(tmp_path, name):
    file = tmp_path / "robot.xml"
    bodies = BODIES.replace('name="wheel"', 'name="wheel" gravcomp="0.7"')
    file.write_text(f"<mujoco><worldbody>{bodies}</worldbody>{FILES[name]}</mujoco>")
    compare(file)


def test_a_rope_between_two_bodies_is_a_spring_of_the_core(tmp_path):
    file = tmp_path / "robot.xml"
    file.write_text(f"<mujoco><worldbody>{BODIES}</worldbody>{FILES['elastic rope']}</mujoco>")
    (rope,) = pn.load(file).forces
    assert (type(rope), rope.frame1, rope.frame2) == (pn.SpringDamper, "tip", "rim")
    assert (rope.stiffness, rope.rest_length) == (30.0, 0.5)


def test_a_keyframe_gives_a_floating_body_its_velocity(tmp_path):
    """MuJoCo's linear velocity is in world axes, Pinocchio's in those of the body."""
    file, turn = tmp_path / "robot.xml", "0.5 0.5 0.5 0.5"
    body = '<body pos="0 0 1"><freejoint/><geom size="0.1" pos="0.3 0 0"/></body>'
    key = f'<keyframe><key name="thrown" qpos="0 0 2 {turn}" qvel="1 2 3 4 5 6"/></keyframe>'
    file.write_text(f"<mujoco><worldbody>{body}</worldbody>{key}</mujoco>")
    scene = pn.load(file, q0="thrown")
    np.testing.assert_array_equal(scene.q0[:3], [0, 0, 2])
    rotation = pin.Quaternion(scene.q0[3:]).toRotationMatrix()
    np.testing.assert_allclose(rotation @ scene.v0[:3], [1, 2, 3], atol=ROUNDING)
    np.testing.assert_array_equal(scene.v0[3:], [4, 5, 6])
