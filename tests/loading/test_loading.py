"""Loading by name and path, mass matrices and ball joints: nothing in a file is dropped in silence."""

from __future__ import annotations

import sys

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, SingularMassError, UnknownNameError
from pin_nonideal.loading.edit.model import ball_chains, edit_joints
from pin_nonideal.loading.library.example_robots import example_names, example_robots
from pin_nonideal.loading.urdf.inertia import mass_diagnosis
from pin_nonideal.loading.urdf.reader import read_urdf

from ..support.refusals import refuses
from ..support.small_robots import ARM, DATA, folder, joint, link, robot

# Poses and energies of order one computed along two routes of some ten operations each.
ROUNDING = 1e-12


# names and paths


def test_unknown_robot_names_the_nearest():
    with refuses('no robot "four_baar"; nearest: "four_bar"', UnknownNameError):
        pn.load("four_baar")
    with refuses('no robot "contact_stack"; it is an example: pin-nonideal example', UnknownNameError):
        pn.load("contact_stack")


def test_a_folder_does_not_shadow_a_name_without_a_word(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("four_bar", "double_pendulum"):
        (tmp_path / name).mkdir()
        folder(tmp_path / name)
        scene = pn.load(name)
        assert any(
            f'"{name}" of the working directory is not loaded, since it is the name of a robot' in n
            for n in scene.notes
        )
        assert list(scene.model.names) != list(pn.load(f"./{name}").model.names)


def test_start_by_joint_name_by_numbers_and_by_reference(tmp_path):
    file = folder(tmp_path)
    np.testing.assert_array_equal(pn.load(file, q0={"elbow": 0.5}).q0, [0, 0.5])
    np.testing.assert_array_equal(pn.load(file, q0=[0.1, 0.2]).q0, [0.1, 0.2])
    with refuses('load: q0: no joint "elbw"; nearest: "elbow"', UnknownNameError):
        pn.load(file, q0={"elbw": 0.5})


def test_missing_path_is_said(tmp_path):
    with refuses("no file or folder"):
        pn.load(tmp_path / "nowhere.urdf")
    with refuses("no file or folder"):
        pn.load(str(tmp_path / "nowhere"))


def test_other_files_are_refused(tmp_path):
    (tmp_path / "robot.sdf").write_text("<sdf/>")
    with refuses('must be a folder, a .urdf file or a .xml file (MJCF); got ".sdf"'):
        pn.load(tmp_path / "robot.sdf")


@pytest.mark.parametrize("name", ["", None, 3, b"four_bar"])
def test_name_must_be_a_name(name):
    with refuses(f"name must be the name of a robot or a path; got {name!r}", InputError):
        pn.load(name)


def test_folder_without_urdf_points_at_the_one_it_has(tmp_path):
    (tmp_path / "arm.urdf").write_text(robot(*ARM))
    with refuses('must hold a robot.urdf; there is none; load "'):
        pn.load(tmp_path)


def test_unknown_parameter_names_the_nearest(tmp_path):
    with refuses('takes no parameter "free_flier"; nearest: "free_flyer"', InputError):
        pn.load(folder(tmp_path), free_flier=True)
    with refuses("free_flyer must be True or False; got 1", InputError):
        pn.load(folder(tmp_path), free_flyer=1)
    with refuses("package_dirs must be folders; got [3]", InputError):
        pn.load(folder(tmp_path), package_dirs=[3])


def test_urdf_path_and_folder_agree(tmp_path):
    one, two = pn.load(folder(tmp_path)), pn.load(tmp_path / "robot.urdf")
    assert one.model == two.model
    assert one.name == tmp_path.name
    assert two.name == "robot"


def test_free_flyer(tmp_path):
    heavy = robot(link("base"), *ARM[1:])
    scene = pn.load(folder(tmp_path, urdf=heavy), free_flyer=True)
    assert (scene.model.nq, scene.model.nv) == (9, 8)


def test_example_robot_data_couples_mimic_joints():
    scene = pn.load("panda")
    assert [(c.joint1, c.joint2, c.ratio) for c in scene.constraints] == [
        ("panda_finger_joint2", "panda_finger_joint1", 1.0)
    ]
    assert {law.joint: law.viscous for law in scene.laws}["panda_finger_joint1"] == 0.3 + 0.3


def test_example_robot_data_with_a_loader_of_its_own(monkeypatch):
    """A robot with its own loader class is the same robot."""
    from example_robot_data import robots_loader

    class Own(robots_loader.DoublePendulumLoader):
        def __init__(self, verbose=False):
            super().__init__(verbose)

    monkeypatch.setitem(robots_loader.ROBOTS, "own", Own)
    own, listed = pn.load("own"), pn.load("double_pendulum")
    assert own.model == listed.model
    np.testing.assert_array_equal(own.q0, listed.q0)
    assert own.visual_model.ngeoms == listed.visual_model.ngeoms > 0


def test_example_robot_data_that_cannot_be_read(monkeypatch):
    """Errors of example-robot-data are named, and a file with unreadable mimic joints gives a note."""
    from example_robot_data import robots_loader

    class Broken(robots_loader.DoublePendulumLoader):
        def __init__(self, verbose=False):
            raise RuntimeError("no mesh\nhere")

    monkeypatch.setitem(robots_loader.ROBOTS, "broken", Broken)
    with refuses('example-robot-data cannot load "broken": no mesh here'):
        pn.load("broken")

    def unreadable(path):
        raise pn.LoadingError("a mimic joint follows nothing")

    monkeypatch.setattr("pin_nonideal.loading.library.example_robots.read_mimics", unreadable)
    notes = pn.load("double_pendulum").notes
    assert "mimic joints are left free: a mimic joint follows nothing" in notes


def test_without_example_robot_data_its_robots_are_named_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "example_robot_data", None)
    with refuses('robot "panda" may be one of example-robot-data, which cannot be imported'):
        pn.load("panda")
    with refuses("pip install example-robot-data-loaders"):
        example_robots()
    assert example_names() == ()
    assert pn.load("four_bar").model.nv == 3


def test_example_robot_data_by_name():
    scene = pn.load("double_pendulum")
    assert scene.model.nv == 2
    assert scene.visual_model is not None


# mass matrix


def test_massless_link_that_a_loop_holds_names_joint_and_link(tmp_path):
    text = robot(*ARM, '<link name="tip"/>', joint("wrist", "lower", "tip"))
    with refuses(
        'joint "wrist" moves no inertia: give link "tip" a mass and a moment of inertia', SingularMassError
    ):
        pn.load(folder(tmp_path, "constraints: [{PointAnchor: {frame1: tip}}]", text))


def test_parallel_axes_around_a_massless_link_name_the_joints(tmp_path):
    text = robot(
        *ARM, '<link name="mid"/>', joint("a", "lower", "mid"), link("tip"), joint("b", "mid", "tip")
    )
    with refuses('a motion of joints "a", "b" meets no inertia', SingularMassError) as caught:
        pn.load(folder(tmp_path, urdf=text))
    assert 'give link "mid" a mass' in str(caught.value)


def test_light_links_beside_heavy_ones_are_no_fault():
    model = read_urdf(DATA / "robot_delta" / "robot.urdf").model
    assert mass_diagnosis(model) is None
    M = pin.crba(model, model.createData(), pin.neutral(model))
    assert np.linalg.eigvalsh(np.triu(M) + np.triu(M, 1).T)[0] < 1e-10  # light indeed


# ball joints


def test_three_revolutes_of_a_ball_joint_are_merged():
    scene = pn.load(DATA / "digit_like")
    assert sum("Spherical" in j.shortname() for j in scene.model.joints) == 6
    assert scene.model.nv == 27
    note = next(n for n in scene.notes if "become one ball joint" in n)
    assert '"hip_x_toe_a_2/2"' in note
    assert pn.load(DATA / "digit_like", merge_ball_joints=False).model.nq == 27


def test_merging_keeps_places_and_energies():
    file = read_urdf(DATA / "digit_like" / "robot.urdf")
    old, chains = file.model, ball_chains(file.model)
    new, _ = edit_joints(old, [], chains, {})
    rng = np.random.default_rng(3)
    q, v = rng.uniform(-1, 1, old.nq), rng.uniform(-1, 1, old.nv)
    before, after = old.createData(), new.createData()
    pin.forwardKinematics(old, before, q, v)
    pin.updateFramePlacements(old, before)
    q_new, v_new = pin.neutral(new), np.zeros(new.nv)
    balls = {c.name: c for c in chains}
    for j in range(1, new.njoints):
        at_q, at_v = (
            slice(new.idx_qs[j], new.idx_qs[j] + new.nqs[j]),
            slice(new.idx_vs[j], new.idx_vs[j] + new.nvs[j]),
        )
        if new.names[j] in balls:
            first, _, last = balls[new.names[j]].joints
            parent = old.parents[first]
            turn = before.oMi[parent].rotation.T @ before.oMi[last].rotation
            q_new[at_q] = pin.Quaternion(new.jointPlacements[j].rotation.T @ turn).coeffs()
            v_new[at_v] = before.v[last].angular - turn.T @ before.v[parent].angular
        else:
            i = old.getJointId(new.names[j])
            q_new[at_q], v_new[at_v] = q[old.idx_qs[i]], v[old.idx_vs[i]]
    pin.forwardKinematics(new, after, q_new, v_new)
    pin.updateFramePlacements(new, after)
    shared = [f for f in new.frames if old.existFrame(f.name, f.type)]
    assert len(shared) > 40
    for f in shared:
        a, b = after.oMf[new.getFrameId(f.name, f.type)], before.oMf[old.getFrameId(f.name, f.type)]
        np.testing.assert_allclose(a.homogeneous, b.homogeneous, atol=ROUNDING)
    assert pin.computeKineticEnergy(new, after) == pytest.approx(
        pin.computeKineticEnergy(old, before), rel=ROUNDING
    )
    assert pin.computePotentialEnergy(new, after) == pytest.approx(
        pin.computePotentialEnergy(old, before), rel=ROUNDING
    )


def ball_robot(middle_mass=0.0, second_axis="0 1 0", xyz="0 0 0", inside="", limits=""):
    return robot(
        *ARM,
        link("m1", middle_mass, middle_mass),
        joint("c_rev0", "lower", "m1", axis="1 0 0", limits=""),
        link("m2", middle_mass, middle_mass),
        joint("c_rev1", "m1", "m2", axis=second_axis, xyz=xyz, limits=""),
        link("ball"),
        joint("c_rev2", "m2", "ball", inside=inside, limits=limits),
    )


def test_ball_joints_are_named_by_what_the_joints_share(tmp_path):
    scene = pn.load(folder(tmp_path, urdf=ball_robot()))
    assert list(scene.model.names)[1:] == ["shoulder", "elbow", "c_rev2"]  # common part "c" is too short
    named = ball_robot().replace("c_rev", "wrist_rev")
    assert "wrist" in list(pn.load(folder(tmp_path, urdf=named)).model.names)


@pytest.mark.parametrize(
    ("text", "yaml"),
    [
        (ball_robot(middle_mass=0.1), None),
        (ball_robot(second_axis="0 1 0.1"), None),
        (ball_robot(xyz="0 0.1 0.1"), None),
        (ball_robot(inside='<dynamics damping="0.1"/>'), None),
        (ball_robot(limits='lower="-1" upper="1"'), None),
        (ball_robot(), "name_mot: [c_rev1]"),
        (ball_robot(), "initial: {q: {c_rev2: 0.1}}"),
    ],
    ids=["massive", "skew", "apart", "damped", "limited", "driven", "named"],
)
def test_other_chains_of_revolutes_stay(tmp_path, text, yaml):
    assert pn.load(folder(tmp_path, yaml, text)).model.nq == 5
