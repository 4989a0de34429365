"""All fields of MuJoCo's compiled model are listed, and each supported field affects a scene."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import pin_nonideal as pn
from oracles import mujoco_motion
from pin_nonideal.errors import LoadingError
from pin_nonideal.loading.mjcf import fields
from pin_nonideal.loading.mjcf.reader import translate
from pin_nonideal.loading.mjcf.unsupported import IGNORABLE_FEATURES, UnsupportedFeatures
from pin_nonideal.loading.yaml.assembly import scene_arguments

from ..support.refusals import refuses

ROUNDING = 1e-9  # error of accelerations of order 1 to 100, by two methods

# Every supported element of MJCF, each with different numbers.
RICH = """<mujoco><compiler angle="radian"/>
<option gravity="0.3 0.2 -9" density="30" viscosity="0.4" wind="0.3 -0.2 0.1"/>
<worldbody><site name="ground" pos="0.1 0.2 0.3"/>
  <body name="box" pos="0 0 1" quat="1 0.2 0.1 0"><joint name="free" type="free" damping="0.2" armature="0.1"
    frictionloss="0.05" stiffness="0.3"/>
    <inertial pos="0.1 0.02 0.03" mass="2" fullinertia="0.3 0.4 0.5 0.01 0.02 0.03"/><geom size="0.1"/>
    <site name="on_box" pos="0.2 0.1 0"/>
    <body name="ball_body" pos="0.4 0 0.1" quat="0.9 0 0.1 0.2" gravcomp="0.7"><joint name="ball" type="ball"
      stiffness="1 0.2 0.1" damping="0.3 0.1 0.02" frictionloss="0.02" armature="0.05" pos="0.05 0 0.02"/>
      <geom type="box" size="0.1 0.2 0.1" pos="0.1 0 0"/>
      <site name="on_ball" pos="0 0.2 0.1" euler="0.1 0.2 0.3"/></body></body>
  <body name="arm" pos="1 0 0"><joint name="turn" axis="0.1 1 0.2" pos="0.1 0 0.05" ref="0.2" springref="0.1"
      stiffness="2" damping="0.4" frictionloss="0.1" armature="0.2" actuatorfrcrange="-0.6 0.5"/>
    <joint name="slide" type="slide" axis="1 0 0.3" stiffness="3 0.5 0.2" damping="0.5 0.1 0.2" ref="0.1"/>
    <geom type="capsule" size="0.05 0.3"/><site name="on_arm" pos="0 0.1 0.2"/>
    <body name="hand" pos="0.3 0 0.2" gravcomp="0.4">
      <joint name="wrist" axis="0 0 1" actuatorgravcomp="true"/>
      <geom size="0.1" pos="0.1 0 0"/></body></body></worldbody>
<tendon><fixed name="sum" stiffness="2" damping="0.3" springlength="0.05 0.1" frictionloss="0.02">
    <joint joint="turn" coef="0.5"/><joint joint="slide" coef="-1.5"/></fixed>
  <spatial name="rope" stiffness="4 0.1 0.2" damping="0.2" springlength="0.2" frictionloss="0.01">
    <site site="ground"/><site site="on_box"/><pulley divisor="2"/><site site="on_arm"/><site site="on_ball"/>
  </spatial></tendon>
<actuator><motor joint="wrist" gear="1.5" ctrlrange="-0.5 0.5"/>
  <position joint="turn" kp="3" kv="0.2" forcerange="-0.4 0.3"/><velocity tendon="sum" kv="0.7" gear="2"/>
  <general site="on_ball" refsite="on_arm" gear="1 0.5 0 0 0 0" gaintype="affine" gainprm="1 0.1 0.2"
    biastype="affine" biasprm="0.1 -0.2 -0.3"/><motor joint="free" gear="1 2 3 0.1 0.2 0.3"/>
  <motor jointinparent="ball" gear="0.3 0.2 0.1"/></actuator>
<equality><joint joint1="wrist" joint2="slide" polycoef="0.1 0.5 0.2 0 0"/></equality>
<keyframe><key name="home" qpos="0 0 2 1 0 0 0 1 0 0 0 0.1 0.2 0.3"/></keyframe></mujoco>"""


def fields_of(thing):
    return [name for name in dir(thing) if not name.startswith("_") and not callable(getattr(thing, name))]


def test_every_field_of_the_model_is_on_a_list():
    model = mujoco.MjModel.from_xml_string(RICH)
    assert [name for name in fields_of(model) if not fields.is_listed(name)] == []
    listed = " ".join((fields.CONVERTED_FIELDS, fields.REPORTED_FIELDS, fields.DERIVED_FIELDS)).split()
    assert [name for name in set(listed) if listed.count(name) > 1] == []
    assert [name for name in listed if not hasattr(model, name)] == []


def test_every_option_and_flag_is_on_a_list():
    options = " ".join((fields.CONVERTED_OPTIONS, fields.REPORTED_OPTIONS, fields.IGNORED_OPTIONS)).split()
    assert sorted(options) == sorted(fields_of(mujoco.MjOption()))
    heeded = "CONSTRAINT EQUALITY FRICTIONLOSS LIMIT CONTACT SPRING DAMPER GRAVITY CLAMPCTRL ACTUATION"
    numerics = "WARMSTART FILTERPARENT REFSAFE SENSOR MIDPHASE EULERDAMP AUTORESET NATIVECCD ISLAND MULTICCD"
    known = {f"mjDSBL_{name}" for name in f"{heeded} {numerics}".split()}
    assert known == set(mujoco.mjtDisableBit.__members__) - {"mjNDISABLE"}


def numbers_of(text):
    """Names of the carried fields of floats that a file of this text fills."""
    model = mujoco.MjModel.from_xml_string(text)
    names = fields.CONVERTED_FIELDS.split()
    arrays = {name: np.asarray(getattr(model, name)) for name in names if name != "opt"}
    return [name for name, a in arrays.items() if a.dtype.kind == "f" and a.size and a.ndim]


def accelerations(model):
    unsupported = UnsupportedFeatures("", IGNORABLE_FEATURES, [])
    robot, _ = translate(mujoco, model, "rich", unsupported)
    robot.q0 = None
    scene = pn.Scene(**scene_arguments(robot, {}, "rich", merge=False))
    rng = np.random.default_rng(4)
    state = mujoco_motion.instant(
        model, *mujoco_motion.random_state(mujoco.MjModel.from_xml_string(RICH), rng, 0.3)
    )
    qpos, qvel = mujoco_motion.mujoco_state(model, *scene.project(state.q, state.v))
    ctrl = np.array([0.9, 0.4, -0.3, 0.7, 0.2, -0.6])
    scene.actuation.set_control(ctrl)
    theirs = mujoco_motion.instant(model, qpos, qvel, ctrl)
    return scene.solve(theirs.q, theirs.v).a, theirs.a


@pytest.mark.parametrize("field", numbers_of(RICH))
def test_each_number_that_is_carried_moves_a_scene_as_it_moves_mujoco(field):
    """Every entry of a field that MuJoCo's acceleration depends on changes ours by the same."""
    model = mujoco.MjModel.from_xml_string(RICH)
    values = np.asarray(getattr(model, field))
    if field in ("key_qpos", "key_qvel", "key_act", "key_ctrl", "geom_friction"):
        pytest.skip("starts and facts, not forces")
    rng = np.random.default_rng(7)
    if field.endswith("quat"):
        values += rng.uniform(-0.1, 0.1, values.shape)
        values /= np.linalg.norm(values, axis=-1, keepdims=True)
    elif field == "jnt_axis":
        values += rng.uniform(-0.2, 0.2, values.shape)
        values /= np.linalg.norm(values, axis=-1, keepdims=True)
    elif field == "dof_armature":  # a file gives a joint one armature
        values *= 1.1
    elif field not in ("qpos0", "qpos_spring", "geom_fluid"):
        values *= 1.0 + rng.uniform(0.05, 0.2, values.shape)
    else:
        values[-3:] += 0.1 * (field != "geom_fluid")
    for shortcut in ("body_sameframe", "body_simple", "site_sameframe", "geom_sameframe", "dof_simplenum"):
        np.asarray(getattr(model, shortcut))[:] = 0  # shortcut flags of MuJoCo for the values of the file
    ours, theirs = accelerations(model)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=ROUNDING * np.abs(theirs).max())


TOLD_FILES = {
    "muscle": (
        '<actuator><muscle joint="j" lengthrange="0.5 1"/></actuator>',
        'muscles "actuator_0"',
        "muscle",
    ),
    "controller": (
        '<actuator><dcmotor joint="j" motorconst="0.1" resistance="1"/></actuator>',
        'actuators with a controller, a delay or a special law "actuator_0"',
        "actuator",
    ),
    "wrapping tendon": (
        '<tendon><spatial stiffness="3"><site site="a"/><geom geom="g"/><site site="b"/></spatial></tendon>',
        'springs, damping or friction of tendons that wrap "tendon_0"',
        "tendon",
    ),
    "drive of a wrapping tendon": (
        """<tendon><spatial name="t"><site site="a"/><geom geom="g"/><site site="b"/></spatial></tendon>
        <actuator><motor tendon="t"/></actuator>""",
        'actuators on tendons that wrap "actuator_0"',
        "tendon",
    ),
    "equality of a wrapping tendon": (
        """<tendon><spatial name="t"><site site="a"/><geom geom="g"/><site site="b"/></spatial></tendon>
        <equality><tendon name="taut" tendon1="t"/></equality>""",
        'equality "taut" of tendons that wrap',
        "tendon",
    ),
    "elastic flex": (
        """<worldbody><flexcomp name="string" type="grid" count="3 1 1" spacing="0.1 0.1 0.1" mass="1"
        dim="1"><edge stiffness="10"/></flexcomp></worldbody>""",
        "elasticity of 1 flexes",
        "flex",
    ),
    "equality of a flex": (
        """<worldbody><flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" mass="1" dim="2">
        <edge equality="true"/></flexcomp></worldbody>""",
        'equality "flex 1" of a flex',
        "flex",
    ),
    "tendon armature": (
        '<tendon><fixed armature="0.2"><joint joint="j" coef="1"/></fixed></tendon>',
        'armature of tendons "tendon_0", which the mass matrix of a tree cannot contain',
        "tendon",
    ),
}
WORLD = """<worldbody><site name="a" pos="0 1 1"/><geom name="g" size="0.1" pos="0 0 3"/><body name="body">
    <joint name="j" {joint}/><geom size="0.1" {geom}/><site name="b" pos="1 0 1"/></body></worldbody>"""


def write(path, extra="", joint="", geom="", option=""):
    text = f"<mujoco>{option}{WORLD.format(joint=joint, geom=geom)}{extra}</mujoco>"
    (path / "robot.xml").write_text(text)
    return path / "robot.xml"


@pytest.mark.parametrize(("text", "message", "key"), TOLD_FILES.values(), ids=TOLD_FILES)
def test_what_moves_the_robot_and_cannot_be_converted_is_an_error_until_it_is_allowed(
    tmp_path, text, message, key
):
    file = write(tmp_path, text)
    with refuses(
        f"cannot be converted: {message}; remove it from the file, or leave it out with "
        f"load(..., allow=('{key}',))"
    ):
        pn.load(file)
    assert f"left out, as allowed: {message}" in pn.load(file, allow=key).notes


def test_ellipsoids_are_a_note_without_a_fluid_and_an_error_in_one(tmp_path):
    geom = 'fluidshape="ellipsoid"'
    words = 'fluid forces on ellipsoids of bodies "body"'
    assert (
        f"{words} do not act, because density and viscosity are zero"
        in pn.load(write(tmp_path, geom=geom)).notes
    )
    file = write(tmp_path, geom=geom, option='<option density="1"/>')
    with refuses(f"cannot be converted: {words}"):
        pn.load(file)
    scene = pn.load(file, allow=("fluid",))
    assert f"left out, as allowed: {words}" in scene.notes
    assert scene.laws == ()


def test_springs_that_yield(tmp_path):
    file = write(tmp_path, joint='stiffness="1" springyield="0.1"')
    with refuses('springs that yield "j"'):
        pn.load(file)


def test_all_that_is_active_is_named_at_once(tmp_path):
    file = write(tmp_path, TOLD_FILES["muscle"][0] + TOLD_FILES["wrapping tendon"][0])
    with pytest.raises(LoadingError, match=r"allow=\('muscle', 'tendon'\)"):
        pn.load(file)


def test_notes_of_what_plays_no_part(tmp_path):
    extra = """<sensor><jointpos joint="j"/></sensor><tendon><spatial limited="true" range="0 1">
        <site site="a"/><geom geom="g"/><site site="b"/></spatial></tendon>"""
    file = write(tmp_path, extra, joint='range="-30 30"', option='<option><flag sleep="enable"/></option>')
    notes = "\n".join(pn.load(file).notes)
    for words in (
        "sensors (1) are not read",
        'tendons that wrap around geoms are left out: "tendon_0"',
        "bounds of the positions of 1 joints are not used; limits=True makes them stops",
        'ranges of tendons that wrap around geoms are left out: "tendon_0"',
        "bodies do not sleep here",
        "contacts between geoms (1 pairs) are not transferred",
    ):
        assert words in notes


def test_notes_of_bodies_and_drives_that_play_no_part(tmp_path):
    extra = """<worldbody><body name="hand" mocap="true"><geom size="0.1" pos="0 0 5"/></body></worldbody>
        <actuator><adhesion name="suction" body="body" ctrlrange="0 1" gain="1"/></actuator>"""
    rigid = """<worldbody><flexcomp name="net" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" dim="2"
        rigid="true"/></worldbody>"""
    notes = pn.load(write(tmp_path, extra + rigid)).notes
    assert "flexes have no effect: their contacts are not transferred" in notes
    assert 'mocap bodies "hand" are held where they start' in notes
    assert 'adhesion actuators "suction" act on contacts, which are not transferred' in notes


def test_a_file_without_contacts_has_no_note_of_them(tmp_path):
    flag = '<option><flag contact="disable"/></option>'
    assert any("contacts between geoms" in note for note in pn.load(write(tmp_path)).notes)
    assert not any("contacts between geoms" in note for note in pn.load(write(tmp_path, option=flag)).notes)


def test_fields_of_a_newer_mujoco_are_noted(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "pin_nonideal.loading.mjcf.unsupported.is_listed", lambda field: field != "jnt_margin"
    )
    (note,) = [note for note in pn.load(write(tmp_path)).notes if "unknown fields" in note]
    assert note.endswith("has unknown fields, which may affect the motion: jnt_margin")


def test_unknown_allowance_is_refused(tmp_path):
    with refuses("allow must be one of 'actuator', 'flex', 'fluid', 'muscle'", pn.InputError):
        pn.load(write(tmp_path), allow=("muscles",))
