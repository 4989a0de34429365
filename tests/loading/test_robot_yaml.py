"""robot.yaml: each key reaches the scene, each invalid value is an error, and no content is executed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import LoadingError

from ..support.refusals import refuses
from ..support.small_robots import ARM, DATA, folder, joint, link, robot

# Poses and energies of order one computed along two routes of some ten operations each.
ROUNDING = 1e-12


def test_community_folder_loads_as_it_is():
    scene = pn.load(DATA / "robot_delta")
    assert [type(c).__name__ for c in scene.constraints] == ["FrameAnchor"] * 3
    assert scene.constraints[0].frame1 == "closedloop1_A"
    assert scene.constraints[0].frame2 == "closedloop1_B"
    assert "actuated joints: mot1_rod1, mot1_rod2" in scene.notes


def test_community_types_and_joint_types(tmp_path):
    yaml = (
        "closed_loop: [[hand, wall], [lower, wall]]\ntype: ['3D', '6d']\nname_mot: [shoulder]\n"
        "joint_name: [elbow, shoulder]\njoint_type: [SPHERICAL, UJOINT_XY]\n"
    )
    scene = pn.load(folder(tmp_path, yaml))
    assert [type(c).__name__ for c in scene.constraints] == ["PointAnchor", "FrameAnchor"]
    names = dict(zip(scene.model.names, (j.shortname() for j in scene.model.joints), strict=True))
    assert names["elbow"] == "JointModelSpherical"
    assert (names["shoulder_X"], names["shoulder"]) == ("JointModelRX", "JointModelRY")


def test_fixed_joint_type(tmp_path):
    scene = pn.load(folder(tmp_path, "joint_name: [elbow]\njoint_type: [FIXED]\n"))
    assert list(scene.model.names)[1:] == ["shoulder"]


def test_screw(tmp_path):
    """A revolute joint becomes a screw about the same axis, in the same place."""
    urdf = robot(*ARM[:2], joint("shoulder", "base", "upper", axis="0.6 0 0.8", xyz="0.1 0.2 0.3"))
    turning = pn.load(folder(tmp_path, "{}", urdf)).model
    rising = pn.load(folder(tmp_path, "model: {helical: {shoulder: -0.02}}", urdf)).model
    assert rising.joints[1].shortname() == "JointModelHelicalUnaligned"
    q = np.array([0.7])
    placements = []
    for model in (turning, rising):
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        placements.append(data.oMi[1])
    np.testing.assert_allclose(placements[1].rotation, placements[0].rotation, atol=ROUNDING)
    rise = placements[1].translation - placements[0].translation
    np.testing.assert_allclose(rise, -0.02 * 0.7 * np.array([0.6, 0.0, 0.8]), atol=ROUNDING)


def test_a_slide_is_no_screw(tmp_path):
    urdf = robot(*ARM[:2], joint("shoulder", "base", "upper", kind="prismatic"))
    with refuses('joint "shoulder" must be revolute in the robot\'s file; it is JointModelPZ'):
        pn.load(folder(tmp_path, "model: {helical: {shoulder: 0.1}}", urdf))


def test_base(tmp_path):
    """The whole robot is moved: joints, frames of the ground and shapes."""
    box = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    urdf = robot(f'<link name="base">{box}</link>', *ARM[1:])
    plain = pn.load(folder(tmp_path, "{}", urdf))
    moved = pn.load(folder(tmp_path, "model: {base: {xyz: [0.1, 0.2, 1.5], rpy: [0.3, 0.4, 3.0]}}", urdf))
    base = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.4, 3.0), np.array([0.1, 0.2, 1.5]))
    q = np.array([0.7, -0.4])
    data = [scene.model.createData() for scene in (plain, moved)]
    shapes = [scene.visual_model.createData() for scene in (plain, moved)]
    for scene, d, shape in zip((plain, moved), data, shapes, strict=True):
        pin.framesForwardKinematics(scene.model, d, q)
        pin.updateGeometryPlacements(scene.model, d, scene.visual_model, shape)
    for name in ("wall", "hand", "elbow", "base"):
        frame = plain.model.getFrameId(name)
        expected = (base * data[0].oMf[frame]).homogeneous
        np.testing.assert_allclose(data[1].oMf[frame].homogeneous, expected, atol=ROUNDING)
    np.testing.assert_allclose(shapes[1].oMg[0].homogeneous, base.homogeneous, atol=ROUNDING)


FULL = """
description: an arm
source: this test
licence: BSD-3-Clause
notes: [built for a test]
gravity: [0, 0, -1.62]
constraints:
  - PointAnchor: {frame1: hand, frame2: wall, axes: xz, name: loop}
  - PrescribedMotion: {joint: shoulder, function: {sinusoid: {amplitude: 1e-1, omega: 2.0}}}
  - Distance: {frame1: hand, frame2: wall, length: {polynomial: {coefficients: [1.0, 0.5]}}, name: rope}
laws:
  - JointFriction: {joint: elbow, mu: 0.1, radius: 0.02}
  - Drag: {frame: hand, coefficient: 0.5, exponent: 2}
contacts:
  - PointContact: {frame: hand, mu: 0.4}
forces:
  - SpringDamper: {frame1: hand, frame2: wall, stiffness: 10}
  - Wrench: {frame: hand, value: [0, 0, 1, 0, 0, 0]}
actuation:
  HoldPosition: {kp: {shoulder: 5}, kd: 0.5}
initial:
  q: {elbow: 0.25}
  v: {shoulder: -1}
"""


def test_everything_a_file_can_say(tmp_path):
    scene = pn.load(folder(tmp_path, FULL))
    assert (scene.source, scene.licence) == ("this test", "BSD-3-Clause")
    assert "built for a test" in scene.notes
    np.testing.assert_array_equal(scene.model.gravity.linear, [0, 0, -1.62])
    assert scene.constraints[1].function(0.0) == (0.0, 0.2, 0.0)
    assert scene.constraints[2].length(2.0) == (2.0, 0.5, 0.0)
    assert [type(x).__name__ for x in (*scene.laws, *scene.contacts, *scene.forces)] == [
        "JointFriction",
        "Drag",
        "PointContact",
        "SpringDamper",
        "Wrench",
    ]
    np.testing.assert_array_equal(scene.actuation.kp, [5.0, 0.0])
    np.testing.assert_array_equal(scene.v0, [-1.0, 0.0])
    assert scene.q0[1] == 0.25


BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
BALL_ARM = robot(*ARM[:3], link("lower", inside=BALL), *ARM[4:])


@pytest.mark.parametrize(("height", "closed"), [(-0.1, True), (-0.2, False)])
def test_the_ground_of_a_contact(tmp_path, height, closed):
    """The lowest point of a ball of radius 0.1 m is at height -0.1 m."""
    entry = f"geometry1: lower_0, geometry2: {{ground: {{name: floor, height: {height}}}}}, mu: 0.5"
    scene = pn.load(folder(tmp_path, f"contacts:\n  - GeometryContact: {{{entry}}}", BALL_ARM))
    assert list(scene.contact_names) == ["lower_0 on floor"]
    assert list(scene.solve(scene.q0, scene.v0).closed) == [closed]


@pytest.mark.parametrize(
    ("ground", "message"),
    [
        ("{ground: {heigth: 1.0}}", 'geometry2: ground: unknown key "heigth"; nearest: "height"'),
        ("{ground: {normal: [0, 0, 0]}}", "geometry2: ground: normal must have a direction"),
        ("{ground: 3}", "geometry2: ground must be a table of arguments; got an int"),
        ("{plane: {}}", 'geometry2 must be the name of a shape, or a table "{ground: '),
    ],
)
def test_a_ground_that_is_none(tmp_path, ground, message):
    with refuses(message):
        pn.load(
            folder(
                tmp_path,
                f"contacts:\n  - GeometryContact: {{geometry1: lower_0, geometry2: {ground}}}",
                BALL_ARM,
            )
        )


def test_gains_go_to_the_motors(tmp_path):
    yaml = "name_mot: [elbow]\nactuation:\n  HoldPosition: {kp: 5.0, kd: 0.5}\n"
    actuation = pn.load(folder(tmp_path, yaml)).actuation
    np.testing.assert_array_equal(actuation.kp, [0.0, 5.0])
    np.testing.assert_array_equal(actuation.kd, [0.0, 0.5])


def test_torques_by_joint_name(tmp_path):
    scene = pn.load(folder(tmp_path, "actuation:\n  torques: {elbow: -0.5}\n"))
    np.testing.assert_array_equal(scene.actuation, [0.0, -0.5])


def test_a_list_of_drives_by_joint_name(tmp_path):
    drives = """
actuation:
  - torques: {elbow: -0.5}
  - Table: {times: [0.0, 1.0], values: {shoulder: [1.0, 2.0]}, interpolation: hold}
"""
    torques, table = pn.load(folder(tmp_path, drives)).actuation
    assert torques == {"elbow": -0.5}
    assert table.interpolation == "hold"
    np.testing.assert_array_equal(table.values["shoulder"], [1.0, 2.0])
    held = """
actuation:
  - torques: {elbow: 1.0}
  - HoldPosition: {kp: {shoulder: 5.0}, kd: {shoulder: 0.5}}
"""
    assert pn.load(folder(tmp_path, held)).actuation[1].kp == {"shoulder": 5.0}
    both = "actuation:\n  - torques: {elbow: 1.0}\n  - HoldPosition: {kp: 5.0, kd: 0.5}\n"
    with pytest.raises(pn.PinNonidealError, match=r'"elbow" is commanded by drive 0 \(constant torques\)'):
        pn.load(folder(tmp_path, both))


def test_angles_of_continuous_joints_and_quaternions(tmp_path):
    text = robot(link("base"), link("wheel"), joint("spin", "base", "wheel", kind="continuous"))
    yaml = "model: {free_flyer: true}\ninitial:\n  q: {spin: 0.5, root_joint: [0, 0, 1, 0, 0, 0, 1.0001]}\n"
    scene = pn.load(folder(tmp_path, yaml, text))
    np.testing.assert_allclose(scene.q0[7:], [np.cos(0.5), np.sin(0.5)], rtol=1e-15)
    np.testing.assert_allclose(scene.q0[:7], [0, 0, 1, 0, 0, 0, 1], rtol=1e-15)


def test_locked_joints_stay_where_they_start(tmp_path):
    text = robot(*ARM, link("x"), joint("j", "base", "x", inside='<mimic joint="elbow"/>'))
    yaml = "model: {locked: [elbow, j]}\ninitial:\n  q: {elbow: 0.5, shoulder: 0.1}\n  v: {shoulder: 2}\n"
    scene = pn.load(folder(tmp_path, yaml, text))
    np.testing.assert_array_equal(scene.q0, [0.1])
    np.testing.assert_array_equal(scene.v0, [2.0])
    assert len(scene.constraints) == 0
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, np.zeros(1))
    hand = data.oMf[scene.model.getFrameId("hand")].translation
    np.testing.assert_allclose(hand, [1 + np.cos(0.5), 0, -np.sin(0.5)], atol=ROUNDING)


YAML_REFUSED = {
    "unknown key": ("closed_lop: []", 'unknown key "closed_lop"; nearest: "closed_loop"'),
    "unknown model key": ("model: {urfd: x}", 'model: unknown key "urfd"; nearest: "urdf"'),
    "two models": (
        "model: {urdf: robot.urdf, generator: n_four_bar}",
        "model must name one of urdf, example_robot_data, generator; got urdf, generator",
    ),
    "model outside": ("model: {urdf: ../../robot.urdf}", "model: urdf must lie in the folder"),
    "not a table": ("- a\n- b", "must be a table of keys; got a list"),
    "a key twice": ("source: a\nsource: b", 'key "source" appears twice (line 2)'),
    "a list for a key": ("? [a, b]\n: c", "a key must be a word (line 1)"),
    "an anchor": ("source: &a x\nlicence: *a", "anchors and aliases are not read (line 1)"),
    "unknown kind": (
        "constraints:\n  - PointAncor: {frame1: hand}",
        'constraints[0]: unknown kind "PointAncor"; nearest: "PointAnchor"',
    ),
    "unknown argument": (
        "constraints:\n  - PointAnchor: {frame: hand}",
        'PointAnchor: unknown key "frame"; nearest: "frame',
    ),
    "missing argument": (
        "constraints:\n  - JointCoupling: {joint1: a, joint2: b}",
        'JointCoupling needs the key "ratio"',
    ),
    "argument refused": (
        "laws:\n  - JointFriction: {joint: elbow, mu: -1}",
        "laws[0]: JointFriction: mu must not be negative; got -1",
    ),
    "a Python kind": (
        "laws:\n  - UserLaw: {function: os.system}",
        "laws[0]: UserLaw holds Python functions, which a file cannot hold; add it to a Scene in Python",
    ),
    "a Python torque": (
        "actuation:\n  function: f",
        "function holds a Python function, which a file cannot hold",
    ),
    "a list for a table": ("constraints: {PointAnchor: {}}", "constraints must be a list; got a dict"),
    "two kinds in one entry": (
        "constraints:\n  - {PointAnchor: {}, FrameAnchor: {}}",
        "constraints[0] must be a table with one key, the kind",
    ),
    "unknown function": (
        "constraints:\n  - PrescribedMotion: {joint: elbow, function: {sinus: {}}}",
        'no function of time "sinus"; nearest: "sinusoid"',
    ),
    "unknown motor": ("name_mot: [elbo]", 'name_mot: no joint "elbo"; nearest: "elbow"'),
    "unknown joint in initial": ("initial: {q: {elbo: 1}}", 'initial: q: no joint "elbo"; nearest: "elbow"'),
    "wrong size in initial": (
        "initial: {q: {elbow: [1, 2]}}",
        'q of "elbow" must have shape (1,); got shape (2,)',
    ),
    "nan in initial": ("initial: {v: {elbow: .nan}}", 'v of "elbow" must be finite; entry [0] is nan'),
    "unknown reference": ("initial: {reference: home}", 'no reference configuration "home"; there is none'),
    "unknown key in initial": ("initial: {qq: {}}", 'initial: unknown key "qq"'),
    "unknown torque joint": ("actuation: {torques: {elbo: 1}}", 'torques: no joint "elbo"; nearest: "elbow"'),
    "negative gain": (
        "actuation: {HoldPosition: {kp: {elbow: -1}, kd: 0}}",
        'kp of "elbow" must not be negative; got -1',
    ),
    "unknown actuation": (
        "actuation: {HoldPositon: {}}",
        'unknown kind "HoldPositon"; nearest: "HoldPosition"',
    ),
    "loop not a pair": ("closed_loop: [[a]]", "closed_loop[0] must be a pair of frame names; got ['a']"),
    "loop types too few": (
        "closed_loop: [[a, b]]\ntype: []",
        "type must have one entry for each of the 1 loops; got 0",
    ),
    "loop type unknown": ("closed_loop: [[a, b]]\ntype: ['4d']", 'type[0] must be "3d" or "6d"; got \'4d\''),
    "types without loops": ("type: ['6d']", "type is given without closed_loop"),
    "joint types of unequal length": (
        "joint_name: [elbow]\njoint_type: []",
        "joint_name and joint_type must have the same length; got 1 and 0",
    ),
    "joint type unknown": (
        "joint_name: [elbow]\njoint_type: [BALL]",
        'joint_type: type of "elbow" must be one of SPHERICAL, FIXED, CARDAN',
    ),
    "joint of type unknown": (
        "joint_name: [elbo]\njoint_type: [FIXED]",
        'joint_name: no joint "elbo" in the robot',
    ),
    "locked not a list": (
        "model: {locked: elbow}",
        "model: locked must be a list of joint names; got 'elbow'",
    ),
    "free flyer not true": (
        "model: {free_flyer: maybe}",
        "model: free_flyer must be true or false; got 'maybe'",
    ),
    "base not a table": (
        "model: {base: [0, 0, 1]}",
        "model: base must be a table with the keys xyz, rpy; got [0, 0, 1]",
    ),
    "base of two": ("model: {base: {xyz: [0, 1]}}", "model: base: xyz must have shape (3,); got shape (2,)"),
    "base with another key": ("model: {base: {xy: [0, 1]}}", 'model: base: unknown key "xy"; nearest: "xyz"'),
    "helical not a table": (
        "model: {helical: elbow}",
        "model: helical must be a table by joint name; got 'elbow'",
    ),
    "helical without pitch": (
        "model: {helical: {elbow: 0}}",
        'pitch of "elbow" must not be zero; a joint without a rise is revolute',
    ),
    "pitch no number": (
        "model: {helical: {elbow: .nan}}",
        'model: helical: pitch of "elbow" must be finite; got nan',
    ),
    "helical joint unknown": (
        "model: {helical: {elbo: 0.1}}",
        'model: helical: no joint "elbo" in the robot',
    ),
    "unknown generator": (
        "model: {generator: n_five_bar}",
        'no generator "n_five_bar"; nearest: "n_four_bar"',
    ),
    "gravity of two": ("gravity: [0, 1]", "gravity must have shape (3,); got shape (2,)"),
    "source not a text": ("source: [a]", "source must be a text; got a list"),
}


@pytest.mark.parametrize(("yaml", "message"), YAML_REFUSED.values(), ids=YAML_REFUSED)
def test_bad_robot_yaml_is_refused(tmp_path, yaml, message):
    with refuses(message):
        pn.load(folder(tmp_path, yaml))


def test_far_from_unit_quaternion_is_refused(tmp_path):
    yaml = "model: {free_flyer: true}\ninitial:\n  q: {root_joint: [0, 0, 0, 0, 0, 0, 2]}\n"
    with refuses('quaternion [x, y, z, w] of joint "root_joint" must have length 1; got 2'):
        pn.load(folder(tmp_path, yaml))


def test_one_of_two_coupled_joints_cannot_be_locked(tmp_path):
    text = robot(*ARM, link("x"), joint("j", "base", "x", inside='<mimic joint="elbow"/>'))
    with refuses('joint "elbow" follows the locked joint "j"; lock both or neither'):
        pn.load(folder(tmp_path, "model: {locked: [j]}", text))


@pytest.mark.parametrize(
    "hostile",
    [
        "!!python/object/apply:os.system ['touch {path}']",
        "!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{path}']]",
        "!!python/name:os.system",
        "!!python/module:os",
        "!!python/object/new:os.system ['touch {path}']",
    ],
)
def test_files_never_run_code(tmp_path, hostile):
    trace = tmp_path / "ran"
    for yaml in (hostile, f"source: {hostile}", f"initial: {{q: {hostile}}}"):
        with refuses("cannot be read as plain YAML"):
            pn.load(folder(tmp_path, yaml.replace("{path}", str(trace))))
        assert not trace.exists()


def test_deep_nesting_is_refused(tmp_path):
    with refuses("is nested too deeply"):
        pn.load(folder(tmp_path, "source: " + "[" * 5000))


@pytest.mark.parametrize("stride", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_truncated_yaml_loads_or_is_refused_by_name(tmp_path, stride):
    messages, ends = [], range(0, len(FULL), stride)
    for end in ends:
        try:
            pn.load(folder(tmp_path, FULL[:end]))
        except LoadingError as error:
            messages.append(str(error))
    assert len(messages) > len(ends) // 2
    assert all("robot.yaml" in message for message in messages)


def test_a_folder_is_only_read(tmp_path):
    folder(tmp_path, FULL)
    before = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")}
    pn.load(tmp_path)
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")} == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gravity: [yes, 0, 0]", "gravity must hold numbers; got [True, 0, 0]"),
        (
            "forces: [{Wrench: {frame: hand, force: [0, on, 1]}}]",
            "forces: 0: Wrench: force must hold numbers; got [0, True, 1]",
        ),
        ("description: 3", "description must be a text; got an int"),
    ],
)
def test_words_that_are_no_numbers_are_refused(tmp_path, text, message):
    with refuses(message):
        pn.load(folder(tmp_path, text))


def test_keys_of_the_model_that_are_left_empty_are_absent(tmp_path):
    text = "model: {urdf: , example_robot_data: , free_flyer: , locked: , base: }"
    assert pn.load(folder(tmp_path, text)).model.nv == 2
