"""Coordinates given by joint name are held; the others follow the constraints by the least move."""

from __future__ import annotations

import copy
import pickle
import re
import warnings

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import body, empty, frame
from ..support.refusals import refuses
from ..support.seeds import seeds
from .test_held_velocities import chain

CLOSED = 1e-10  # residual of chains of 1 m [m]
STATIONARY = 1e-6  # gradient tolerance; the search ends at a relative gradient of 1e-10


def loop_at(scene, q):
    """Gap of the loop and its derivatives by Pinocchio's kinematics of both frames, (3,) and (3, nv)."""
    model, data = scene.model, scene.model.createData()
    pin.forwardKinematics(model, data, q)
    pin.updateFramePlacements(model, data)
    tip, ground = model.getFrameId("tip"), model.getFrameId("ground")
    J = pin.computeFrameJacobian(model, data, q, tip, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3]
    return data.oMf[tip].translation - data.oMf[ground].translation, J


def named_near(scene, seed):
    """Some joints of a chain, a little or far from where it is closed."""
    draw, count = np.random.default_rng([7, seed]), scene.model.nv
    away = 10.0 ** draw.uniform(-3.0, -0.5)
    dofs = draw.permutation(count)[: int(draw.integers(1, count - 2))]
    return {f"j{k}": float(scene.q0[k] + away * draw.uniform(-1.0, 1.0)) for k in dofs}


# In chain 255 only the 25th or a later start finds a closure.
@pytest.mark.parametrize("seed", seeds(range(300), always=(255,)))
def test_the_others_follow_by_the_least_move(seed):
    """The move d is stationary in d^T M d under the closed loop and the named values."""
    scene, _ = chain(seed)
    named, model = named_near(scene, seed), scene.model
    if nearest_by_descent(scene, named) > 1e3 * CLOSED:  # out of reach
        with refuses("no configuration on the constraints has", pn.InputError):
            scene.project(q=named)
        return
    q, _, report = scene.project(q=named, report=True)
    dofs = [int(name[1:]) for name in named]
    assert [q[k] for k in dofs] == list(named.values())
    assert set(report.held) == set(named)
    gap, J = loop_at(scene, q)
    assert np.abs(gap).max() < CLOSED
    asked = np.array(scene.q0)
    asked[dofs] = list(named.values())
    free = np.setdiff1d(np.arange(model.nv), dofs)
    M = pin.crba(model, model.createData(), asked)
    M = (np.triu(M) + np.triu(M, 1).T)[np.ix_(free, free)]
    gradient, rows = M @ (q - asked)[free], J[:, free]
    left = gradient - rows.T @ np.linalg.lstsq(rows.T, gradient, rcond=1e-10)[0]
    assert np.abs(left).max() <= STATIONARY * (np.abs(M).max() * np.abs(q - asked).max() + 1e-6)


def nearest_by_descent(scene, named, starts=40):
    """The least gap that least squares find by moving the joints that are not named."""
    from scipy.optimize import least_squares

    dofs = [int(name[1:]) for name in named]
    free = np.setdiff1d(np.arange(scene.model.nv), dofs)
    draw, least = np.random.default_rng(0), np.inf

    def whole(x):
        q = np.array(scene.q0)
        q[dofs], q[free] = list(named.values()), x
        return q

    for k in range(starts):
        start = scene.q0[free] + (draw.normal(0.0, 1.0, len(free)) if k else 0.0)
        found = least_squares(
            lambda x: loop_at(scene, whole(x))[0], start, jac=lambda x: loop_at(scene, whole(x))[1][:, free]
        )
        least = min(least, float(np.abs(found.fun).max()))
        if least < CLOSED:
            break
    return least


def test_a_named_crank_has_its_angle():
    scene = pn.load("four_bar")
    for angle in (0.3, 1.0, 2.5, -1.0):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            run = pn.simulate(scene, 0.01, q={"crank_joint": angle}, v={"crank_joint": 2.0})
        assert run.q[0, 0] == angle
        assert run.v[0, 0] == 2.0
        assert run.violation[0] < CLOSED
        told = [note for note in run.notes if note.startswith("the coordinates that were named are held")]
        assert len(told) == 1
        assert f'"crank_joint" = {angle:.4g}, and others follow them: "coupler_joint" = ' in told[0]


def test_what_cannot_be_together_is_named():
    scene = pn.load("four_bar")
    words = (
        'q: no configuration on the constraints has "crank_joint" = 0.3, "coupler_joint" = 1 at t = 0.00 s; '
        "name fewer entries, so that the others can follow, or give a configuration that is consistent"
    )
    with refuses(words, pn.InputError):
        pn.simulate(scene, 0.1, q={"crank_joint": 0.3, "coupler_joint": 1.0})
    with refuses(words, pn.InputError):
        made = pn.Scene(
            scene.model, constraints=scene.constraints, q0={"crank_joint": 0.3, "coupler_joint": 1.0}
        )
        made.initial_state()


def test_rounded_numbers_of_all_joints_are_taken_for_rounded():
    scene = pn.load("four_bar")
    rounded = {str(name): round(float(x), 4) for name, x in zip(scene.model.names[1:], scene.q0, strict=True)}
    run = pn.simulate(scene, 0.01, q=rounded)
    assert run.violation[0] < CLOSED
    assert np.abs(run.q[0] - list(rounded.values())).max() < 1e-3
    assert any("the coordinates that were named are rounded" in note for note in run.notes)


def test_a_scene_its_copies_and_its_file_hold_the_same():
    scene = pn.load("four_bar", q0={"crank_joint": 0.3}, v0={"crank_joint": 5.0})
    q, v = scene.initial_state()
    assert (q[0], v[0]) == (0.3, 5.0)
    for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        np.testing.assert_array_equal(other.initial_state()[0], q)
    model = scene.model
    made = pn.Scene(model, constraints=scene.constraints, q0={"crank_joint": 0.3})
    assert made.initial_state()[0][0] == 0.3


@pytest.mark.parametrize(
    "name", ["four_bar", "slider_crank", "rough_four_bar", "delta", "rolling_disk", "solo12_standing"]
)
def test_files_start_with_the_numbers_that_they_name(name):
    scene = pn.load(name)
    q, v, report = scene.project(report=True)
    assert np.abs(pin.difference(scene.model, scene.q0, q)).max() < 1e-12
    named = set(report.held_velocities)
    for joint, first, size in zip(scene.model.names, scene.model.idx_vs, scene.model.nvs, strict=True):
        for k in range(size):
            if (str(joint) if size == 1 else f"{joint}[{k}]") in named:
                assert v[first + k] == scene.v0[first + k]


def test_a_named_place_stays_while_the_body_turns_onto_its_anchor():
    """Named pieces of a floating base are held: here a rod hangs from a point by a distance."""
    model = empty()
    rod = body(model, 0, pin.JointModelFreeFlyer(), "rod", 1.0, inertia=np.diag([0.1, 0.2, 0.3]))
    frame(model, "end", rod, pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0])))
    scene = pn.Scene(model, constraints=[pn.Distance("end", "universe", length=1.0)])
    q, _ = scene.project(q={"rod": {"xyz": [1.0, 0.2, 0.0]}})
    np.testing.assert_array_equal(q[:3], [1.0, 0.2, 0.0])
    tip = q[:3] + pin.Quaternion(q[3:]).matrix() @ [0.5, 0.0, 0.0]
    assert np.linalg.norm(tip) == pytest.approx(1.0, abs=CLOSED)
    turned = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, 1.0)).coeffs()
    q, _ = scene.project(q={"rod": {"rpy": [0.0, 0.0, 1.0]}})
    np.testing.assert_allclose(q[3:], turned, rtol=0.0, atol=1e-15)


def test_reports_and_notes_tell_of_velocities_as_of_configurations():
    scene = pn.load("four_bar")
    v = np.array([10.0, 0.0, 0.0])
    q, on, report = scene.project(q=scene.q0, v=v, report=True)
    M = pin.crba(scene.model, scene.model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    assert report.velocity_distance == pytest.approx(np.sqrt((on - v) @ M @ (on - v)), rel=1e-12)
    k = int(np.argmax(np.abs(on - v)))
    assert report.velocity_coordinate == scene.model.names[1 + k]
    assert report.velocity_changed == on[k] - v[k]
    assert (report.held, report.held_velocities) == ((), ())
    words = (
        "the initial velocity did not satisfy the constraints and was projected onto them: the run starts "
    )
    with pytest.warns(RuntimeWarning, match=re.escape(words)):
        run = pn.simulate(scene, 0.01, v=v)
    assert any(note.startswith(words) for note in run.notes)


def test_entries_of_the_scene_do_not_bind_another_start():
    """A file that states all velocities at its own configuration; another one is given."""
    scene = pn.load("four_bar")
    run = pn.simulate(scene, 0.01, q={"crank_joint": 0.3})
    assert run.q[0, 0] == 0.3
    assert any("initial velocity did not satisfy" in note for note in run.notes)
