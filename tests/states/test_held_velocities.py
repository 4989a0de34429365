"""Velocities given by joint name are held; the others follow the constraints."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import body, empty, frame
from ..support.refusals import refuses
from ..support.seeds import seeds

ROUNDING = 1e-9  # error of rates and velocities of about 10


def rates(scene, q, v):
    """A v + phi_t of all rows."""
    return scene._compiled.program.runner().rows(q, v, 0.0)[3]


@pytest.mark.parametrize(("name", "joint"), [("four_bar", "crank_joint"), ("slider_crank", "crank_joint")])
def test_a_named_crank_has_its_speed(name, joint):
    scene = pn.load(name)
    dof = scene.model.joints[scene.model.getJointId(joint)].idx_v
    for speed in (10.0, -3.0, 0.0):
        run = pn.simulate(scene, 0.01, v={joint: speed})
        assert run.v[0, dof] == speed
        assert np.abs(rates(scene, run.q[0], run.v[0])).max() < ROUNDING
        told = [note for note in run.notes if "that were named are held" in note]
        assert len(told) == 1
        assert f'"{joint}" = {speed:.4g}' in told[0]


def chain(seed, *, length=1.0, mass=1.0, mount=None, times=1):
    """A chain of four to seven links in space, closed by a ball, with some joints named.

    In another unit of length or of mass, on a mount that is turned, its loop stated several times.
    """
    draw = np.random.default_rng(seed)
    model, last = empty(), 0
    count = int(draw.integers(4, 8))
    for k in range(count):
        axis = draw.normal(size=3)
        joint = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
        place = pin.SE3(pin.exp3(draw.normal(size=3)), length * draw.normal(0.0, 0.3, 3))
        place = mount * place if mount is not None and k == 0 else place
        last = model.addJoint(last, joint, place, f"j{k}")
        lever, moments = length * draw.normal(0.0, 0.1, 3), mass * length**2 * 0.01 * np.eye(3)
        model.appendBodyToJoint(last, pin.Inertia(mass, lever, moments), pin.SE3.Identity())
    q = draw.uniform(-1.0, 1.0, count)
    frame(model, "tip", last, pin.SE3(np.eye(3), length * draw.normal(0.0, 0.3, 3)))
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    frame(model, "ground", 0, pin.SE3(np.eye(3), data.oMf[model.getFrameId("tip")].translation))
    loops = [pn.PointAnchor("tip", "ground", name=f"loop {k}") for k in range(times)]
    scene = pn.Scene(model, constraints=loops, q0=q)
    named = draw.permutation(count)[: int(draw.integers(1, count - 2))]
    return scene, {f"j{k}": float(draw.normal(0.0, 5.0)) for k in named}


@pytest.mark.parametrize("seed", seeds(range(300)))
def test_the_others_follow_by_the_least_change(seed):
    """The change d has the least d^T M d under A v = 0 and the named values, by its KKT equations."""
    scene, named = chain(seed)
    q, v = scene.project(v=named)
    model, n = scene.model, scene.model.nv
    assert {name: v[model.joints[model.getJointId(name)].idx_v] for name in named} == named
    A = scene._compiled.program.runner().rows(q, v, 0.0)[0].reshape(-1, n)
    M = pin.crba(model, model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    dofs = [model.joints[model.getJointId(name)].idx_v for name in named]
    rows = np.vstack([A, np.eye(n)[dofs]])
    asked = np.zeros(n)
    asked[dofs] = list(named.values())
    right = np.concatenate([-A @ asked, np.zeros(len(dofs))])
    kkt = np.block([[M, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    expected = asked + np.linalg.lstsq(kkt, np.concatenate([np.zeros(n), right]), rcond=1e-13)[0][:n]
    np.testing.assert_allclose(v, expected, rtol=0.0, atol=1e-7 * (1.0 + np.abs(expected).max()))


TURNED = pin.SE3(pin.exp3(np.array([0.3, -1.1, 0.7])), np.array([2.0, -1.0, 0.5]))
SAME = [{"length": 1e-3}, {"length": 1e3}, {"mass": 1e-3}, {"mass": 1e3}, {"mount": TURNED}, {"times": 2}]


@pytest.mark.parametrize("changed", SAME, ids=lambda changed: next(iter(changed)))
@pytest.mark.parametrize("seed", seeds(range(60)))
def test_units_mount_and_copies_of_rows_change_nothing(seed, changed):
    scene, named = chain(seed)
    other, _ = chain(seed, **changed)
    _, v = scene.project(v=named)
    _, same = other.project(v=named)
    np.testing.assert_allclose(same, v, rtol=0.0, atol=1e-6 * (1.0 + np.abs(v).max()))


@pytest.mark.parametrize("length", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("seed", range(6))
def test_too_many_named_are_refused_in_any_unit(seed, speed, length):
    """Random velocities of all joints are named, which no velocity on the constraints has."""
    scene, _ = chain(seed, length=length)
    draw = np.random.default_rng(seed)
    named = {f"j{k}": speed * float(draw.normal()) for k in range(scene.model.nv)}
    with refuses("v: no velocity on the constraints has", pn.InputError):
        scene.project(v=named)


def pinned(scene):
    """The scene with a wheel on its last body that is held still by a drive, and by a weld as well."""
    model = scene.model.copy()
    wheel = body(model, model.njoints - 1, pin.JointModelRX(), "wheel", 0.3, inertia=0.01 * np.eye(3))
    frame(model, "rim", wheel)
    frame(model, "hub", model.njoints - 2)
    held = [pn.FrameAnchor("rim", "hub"), pn.PrescribedMotion("wheel", pn.constant(0.0))]
    return pn.Scene(model, constraints=[*scene.constraints, *held], q0=np.append(scene.q0, 0.0))


@pytest.mark.parametrize("seed", seeds(range(60)))
def test_bodies_that_are_held_still_change_nothing(seed):
    """Rows of such bodies have no velocity except for rounding."""
    scene, named = chain(seed)
    heavier = scene.model.copy()
    Y = pin.Inertia(0.3, np.zeros(3), 0.01 * np.eye(3))
    heavier.appendBodyToJoint(heavier.njoints - 1, Y, pin.SE3.Identity())
    _, v = pn.Scene(heavier, constraints=scene.constraints, q0=scene.q0).project(v=named)
    _, same = pinned(scene).project(v=named)
    np.testing.assert_allclose(same, np.append(v, 0.0), rtol=0.0, atol=1e-9 * (1.0 + np.abs(v).max()))


@pytest.mark.parametrize("seed", range(6))
def test_a_disk_rolls_on_any_mount(seed):
    """Rows of the disk's contact point have small entries for an upright disk, for any axes."""
    scene = pn.load("rolling_disk")
    turn = pin.SE3(pin.exp3(np.random.default_rng(seed).normal(size=3)), np.zeros(3))
    model = scene.model.copy()
    model.jointPlacements[1] = turn * model.jointPlacements[1]
    frame(model, "floor", 0, turn)
    rolls = [dataclasses.replace(c, plane="floor") for c in scene.constraints]
    turned = pn.Scene(model, constraints=rolls, q0=scene.q0, v0=scene.v0)
    for name in ("spin", "x"):
        v = float(scene.v0[model.joints[model.getJointId(name)].idx_v])
        _, expected = scene.project(v={name: 1.3 * v})
        np.testing.assert_allclose(turned.project(v={name: 1.3 * v})[1], expected, rtol=0.0, atol=1e-9)


def test_copies_files_and_other_processes_hold_the_same():
    scene = pn.load("four_bar", v0={"crank_joint": 5.0})
    q, v = scene.initial_state()
    assert v[0] == 5.0
    for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        np.testing.assert_array_equal(other.initial_state()[1], v)
    assert np.abs(rates(scene, q, v)).max() < ROUNDING


def test_what_cannot_be_together_is_named():
    scene = pn.load("four_bar")
    words = 'no velocity on the constraints has "crank_joint" = 10, "coupler_joint" = 3 at t = 0.00 s'
    with refuses(words, pn.InputError):
        pn.simulate(scene, 0.1, v={"crank_joint": 10.0, "coupler_joint": 3.0})


def test_arrays_and_nothing_are_projected_as_before():
    scene = pn.load("four_bar")
    v = np.array([10.0, 0.0, 0.0])
    assert np.abs(rates(scene, *scene.project(v=v))).max() < ROUNDING
    assert scene.project(v=v)[1][0] != 10.0


def test_a_scene_begins_with_the_velocity_it_names():
    model = empty()
    crank = body(model, 0, pin.JointModelRZ(), "crank", 1.0, inertia=np.eye(3))
    wheel = body(model, 0, pin.JointModelRZ(), "wheel", 5.0, inertia=np.eye(3))
    assert (crank, wheel) == (1, 2)
    coupling = pn.JointCoupling("wheel", "crank", ratio=0.5)
    scene = pn.Scene(model, constraints=[coupling], v0={"crank": 4.0})
    np.testing.assert_allclose(scene.initial_state()[1], [4.0, 2.0], rtol=0.0, atol=ROUNDING)
    assert any("that were named are held" in note for note in pn.simulate(scene, 0.01).notes)
