"""Scenes, trajectories and errors in other processes and as copies: equal bits after."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.refusals import refuses
from ..support.same_run import assert_same_run
from ..support.small_robots import ARM, folder, robot


def push(t, q, v):
    """A controller that pickle finds by its name."""
    return -0.1 * v


def ways():
    return {"pickle": lambda x: pickle.loads(pickle.dumps(x)), "deepcopy": copy.deepcopy}


@pytest.mark.parametrize("way", ways())
@pytest.mark.parametrize("name", ["rough_four_bar", "rolling_disk", "delta", "worm_drive", "loaded_joint"])
def test_robots_run_the_same(name, way):
    scene = pn.load(name)
    again = ways()[way](scene)
    assert again.report() == scene.report()
    assert again.notes == scene.notes
    assert_same_run(pn.simulate(again, 0.2, record=("forces",)), pn.simulate(scene, 0.2, record=("forces",)))
    assert again.model is not scene.model


@pytest.mark.parametrize("way", ways())
@pytest.mark.parametrize(
    "actuation",
    [push, lambda t, q, v: -0.2 * v, pn.SampledControl(push, 0.01), np.ones(3), None],
    ids=["function", "lambda", "sampled", "constant", "none"],
)
def test_functions_travel(actuation, way):
    """By name where pickle can, else by cloudpickle."""
    scene = pn.load("four_bar")
    law = pn.UserLaw(lambda t, q, v, r, z: (-z * np.ones(3), [v[0]]), states=1)
    made = pn.Scene(scene.model, constraints=scene.constraints, laws=[law], actuation=actuation, q0=scene.q0)
    again = ways()[way](made)
    assert_same_run(pn.simulate(again, 0.1), pn.simulate(made, 0.1))


def test_a_copy_is_independent():
    scene = pn.load("four_bar")
    again = copy.deepcopy(scene)
    again.model.gravity = pin.Motion.Zero()
    assert len(pn.simulate(scene, 0.01)) > 1
    with refuses("was changed after the scene was made", pn.InputError):
        pn.simulate(again, 0.01)


def test_shapes_and_orders_come_along(tmp_path):
    path = folder(tmp_path, urdf=robot(*ARM[:1], *ARM[3:4], *ARM[1:3], *ARM[4:]))
    scene = pickle.loads(pickle.dumps(pn.load(path)))
    assert (scene.visual_model is None) == (pn.load(path).visual_model is None)
    disk = pickle.loads(pickle.dumps(pn.load("rolling_disk")))
    assert disk.visual_model.ngeoms == pn.load("rolling_disk").visual_model.ngeoms
    squeezer = pickle.loads(pickle.dumps(pn.load("andrews_squeezer")))
    with pytest.warns(pn.JointOrderWarning):
        squeezer.project(v=[0.0] * squeezer.model.nv)


def test_what_cannot_travel_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    scene = pn.load("four_bar")
    torque = pn.SampledControl(lambda t, q, v: v, 0.1, name="motor")
    for kind, what in ((torque, "actuation"), (lambda t, q, v: v, "actuation")):
        with refuses(f'scene "four_bar" cannot be pickled: {what} cannot (', pn.InputError):
            pickle.dumps(pn.Scene(scene.model, actuation=kind, name="four_bar"))
    law = pn.UserLaw(lambda t, q, v, r: v, name="wind")
    with refuses('cannot be pickled: UserLaw "wind" cannot (', pn.InputError):
        pickle.dumps(pn.Scene(scene.model, laws=[law], name="four_bar"))


def test_another_process_runs_the_same(tmp_path):
    scene = pn.load("rough_four_bar")
    (tmp_path / "scene.pkl").write_bytes(pickle.dumps(scene))
    code = f"""
import pickle, sys
import pin_nonideal as pn
scene = pickle.load(open(r"{tmp_path / "scene.pkl"}", "rb"))
pn.simulate(scene, 0.2).save(r"{tmp_path / "run.npz"}")
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
    assert_same_run(pn.Trajectory.load(tmp_path / "run.npz"), pn.simulate(scene, 0.2))


@pytest.mark.parametrize("way", ways())
def test_trajectories_keep_their_scene(way):
    run = pn.simulate(pn.load("rough_four_bar"), 0.1, record=("forces", "dense", "energy"))
    again = ways()[way](run)
    assert_same_run(again, run)
    assert again.scene.name == "rough_four_bar"
    np.testing.assert_array_equal(again.at([0.05]).q, run.at([0.05]).q)


def test_a_trajectory_whose_scene_cannot_travel_leaves_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    scene = pn.Scene(pn.load("four_bar").model, actuation=lambda t, q, v: v)
    again = pickle.loads(pickle.dumps(pn.simulate(scene, 0.01)))
    assert again.scene is None


@pytest.mark.parametrize("way", ways())
def test_errors_travel_with_what_they_tell(way):
    made = [
        pn.InputError("bad"),
        pn.UnknownNameError('no joint "a"'),
        pn.LoopClosureError("open", gaps={"loop": 0.1}, time=1.0),
        pn.FrictionParadoxError("two", element="pin", determinant=-1.0, time=2.0, solutions=[np.ones(2)]),
        pn.StiffnessError("stiff", joint="j", rate=1e9, time=0.0),
    ]
    for error in made:
        again = ways()[way](error)
        assert type(again) is type(error)
        assert str(again) == str(error)
        assert repr(vars(again)) == repr(vars(error))
    with pytest.raises(pn.WallTimeError) as stopped:
        pn.simulate(pn.load("four_bar"), 1e5, method="rk4", dt=1e-4, output_dt=0.1, max_wall=0.05)
    again = ways()[way](stopped.value)
    assert_same_run(again.trajectory, stopped.value.trajectory)


# --- Files with their scene --------------------------------------------------------------------------------


def test_a_file_knows_what_it_was_made_from(tmp_path):
    run = pn.simulate(pn.load("n_four_bar", N=2), 0.05, record="dense")
    path = run.save(tmp_path / "run.npz")
    back = pn.Trajectory.load(path)
    assert back.scene.model == run.scene.model
    np.testing.assert_array_equal(back.at(0.02).q, run.at(0.02).q)
    pn.replay(back, tmp_path / "run.html")
    assert (tmp_path / "run.html").stat().st_size > 1e5
    assert pn.Trajectory.load(path, scene=None).scene is None
    assert pn.Trajectory.load(path, scene=run.scene).scene is run.scene
    with refuses('the scene "four_bar" is not the one of the run in "', pn.InputError):
        pn.Trajectory.load(path, scene=pn.load("four_bar"))


def test_a_robot_that_is_gone_or_has_changed_is_noted(tmp_path):
    (tmp_path / "robot").mkdir()
    path = folder(tmp_path / "robot")
    saved = pn.simulate(pn.load(path), 0.01).save(tmp_path / "run.npz")
    assert pn.Trajectory.load(saved).scene is not None
    (path / "robot.urdf").write_text(robot(*ARM[:3]))
    changed = pn.Trajectory.load(saved)
    assert changed.scene is None
    assert "is no longer the one of the run" in changed.notes[-1]
    (path / "robot.urdf").unlink()
    gone = pn.Trajectory.load(saved)
    assert gone.scene is None
    assert "cannot be loaded again" in gone.notes[-1]


def test_a_scene_of_ones_own_is_passed_again(tmp_path):
    scene = pn.Scene(pn.load("four_bar").model)
    path = pn.simulate(scene, 0.01).save(tmp_path / "run.npz")
    assert pn.Trajectory.load(path).scene is None
    assert pn.Trajectory.load(path, scene=scene).frame("crank").translation.shape[1] == 3
