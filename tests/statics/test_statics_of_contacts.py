"""Statics with contacts: open ones change no answer, and a motion may open them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import again, body, empty, frame
from ..support.row_cases import ROBOTS
from ..support.seeds import seeds

G = 9.81


def beside(scene, height):
    """The scene with a contact of its last joint on a plane so far below the world's origin."""
    model = scene.model.copy()
    frame(model, "probe", model.njoints - 1)
    frame(model, "deep plane", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, -height])))
    contact = pn.PointContact("probe", 0.7, plane="deep plane", torsional=0.1, name="far")
    return pn.Scene(
        model,
        constraints=scene.constraints,
        laws=scene.laws,
        forces=scene.forces,
        contacts=[*scene.contacts, contact],
        actuation=scene.actuation,
        q0=scene.initial_state()[0],
        v0=scene.initial_state()[1],
    )


def plain(scene):
    return again(scene, q0=scene.initial_state()[0], v0=scene.initial_state()[1])


@pytest.mark.parametrize("name", ROBOTS)
def test_a_far_contact_does_not_change_whether_a_robot_rests(name):
    alone = plain(pn.load(name))
    one, other = (pn.rest(scene) for scene in (alone, beside(alone, 50.0)))
    assert other.rests == one.rests
    assert other.margin == pytest.approx(one.margin, rel=1e-6, abs=1e-6)
    if len(other.lam):
        assert other.lam[beside(alone, 50.0).constraint_slices["far"]] == pytest.approx(0.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_far_contact_does_not_change_the_torques_of_a_motion(name):
    alone = plain(pn.load(name))
    far = beside(alone, 50.0)
    q, v = alone.initial_state()
    tau = np.random.default_rng(len(name)).standard_normal(alone.model.nv)
    a = alone.acceleration(q, v, tau=tau)
    one, other = (pn.inverse_dynamics(scene, q, v, a) for scene in (alone, far))
    assert other.tau == pytest.approx(one.tau, rel=1e-8, abs=1e-8 * (1.0 + np.abs(one.tau).max()))
    assert other.lam[far.constraint_slices["far"]] == pytest.approx(0.0)


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "delta"])
def test_a_far_contact_does_not_change_an_equilibrium(name):
    scene = pn.load(name)
    alone = again(scene, laws=[], actuation=None)
    one, other = (pn.equilibrium(s) for s in (alone, beside(alone, 50.0)))
    assert other.q == pytest.approx(one.q, abs=1e-8)
    assert other.stable == one.stable
    assert other.lam[: len(one.lam)] == pytest.approx(one.lam, rel=1e-6, abs=1e-8)


def block(height):
    """A block of 2 kg on a vertical slide, so far above the ground."""
    model = empty()
    joint = body(model, 0, pin.JointModelPZ(), "block", 2.0)
    frame(model, "sole", joint)
    frame(model, "ground", 0)
    contact = pn.PointContact("sole", 0.5, plane="ground", name="ground")
    return pn.Scene(model, contacts=[contact], q0=[height])


@pytest.mark.parametrize("seed", seeds(range(30)))
def test_a_block_on_the_ground_and_above_it(seed):
    height = 10.0 ** np.random.default_rng(seed).uniform(-6.0, 1.0)
    on, above = block(0.0), block(height)
    assert pn.rest(on).rests
    assert pn.rest(on).lam == pytest.approx([2.0 * G])
    assert not pn.rest(above).rests
    found = pn.equilibrium(above)
    assert found.q == pytest.approx([0.0], abs=1e-9)
    assert found.lam == pytest.approx([2.0 * G])
    hover = pn.inverse_dynamics(above, [height], [0.0], [0.0])
    assert (hover.tau, hover.lam) == (pytest.approx([2.0 * G]), pytest.approx([0.0]))


def test_a_motion_opens_a_contact_and_never_enters_it():
    scene = block(0.0)
    held = pn.inverse_dynamics(scene, [0.0], [0.0], [0.0])
    assert (held.tau, held.lam) == (pytest.approx([0.0]), pytest.approx([2.0 * G]))
    for v, a in ((0.0, 1.5), (0.3, 1.5), (0.3, -2.0)):
        lifted = pn.inverse_dynamics(scene, [0.0], [v], [a])
        assert lifted.tau == pytest.approx([2.0 * (G + a)])
        assert lifted.lam == pytest.approx([0.0])
        assert scene.acceleration([0.0], [v], tau=lifted.tau) == pytest.approx([a])
    with pytest.raises(pn.InputError, match='"ground" misses it by'):
        pn.inverse_dynamics(scene, [0.0], [0.0], [-1.0])
