"""Statics with contacts: open ones change no answer, and a motion may open them."""

from __future__ import annotations

import coal
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
    with pytest.raises(pn.InputError, match='"ground" violates it by'):
        pn.inverse_dynamics(scene, [0.0], [0.0], [-1.0])


# --- Stacks and piles, whose contacts share loads -----------------------------------------------------------


@pytest.mark.parametrize("yaw", [0.0, 0.3])
@pytest.mark.parametrize("tilt", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("shape", [coal.Box(0.2, 0.2, 0.1), coal.Cylinder(0.1, 0.1)], ids=["box", "cylinder"])
def test_the_margin_of_a_stack_is_that_of_its_slope(shape, count, tilt, yaw):
    model, shapes = pin.Model(), pin.GeometryModel()
    model.gravity.linear = G * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    shapes.addGeometryObject(pn.ground())
    for k in range(count):
        place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, k * yaw), np.array([0.0, 0.0, 0.05 + 0.1 * k]))
        pn.free_body(model, f"body {k}", shape, mass=2.0, collision_model=shapes, place=place)
    below = ["ground", *(f"body {k}" for k in range(count - 1))]
    contacts = [pn.GeometryContact(f"body {k}", below[k], mu=0.5) for k in range(count)]
    scene = pn.Scene(model, contacts=contacts, collision_model=shapes)
    tips = 0.05 * count * np.tan(tilt) > 0.1
    found = pn.rest(scene)
    if tips:
        assert found.margin == -np.inf
        assert "would have to pull" in found.reason
        return
    assert found.margin == pytest.approx(1.0 - np.tan(tilt) / 0.5, abs=1e-8)
    carried = 2.0 * G * np.cos(tilt) * np.arange(count, 0, -1)
    assert found.lam == pytest.approx(carried, rel=1e-9)
    held = [np.linalg.norm(force) for force in found.friction.values()]
    assert held == pytest.approx(carried * np.tan(tilt), rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("seed", seeds(range(60), always=[56]))
def test_the_margin_of_a_bridge_of_balls_is_exact(seed):
    """One ball on two needs a friction coefficient of tan(theta/2) between the balls, and less on the floor.

    Each lower ball has equal friction at both of its contacts, as its moments balance. The balls press on
    each other with half the weight of the upper ball. The line of their centers is theta off the vertical.
    """
    rng = np.random.default_rng(seed)
    theta, mu, on_floor = rng.uniform(0.53, 1.0), rng.uniform(0.1, 1.0), rng.uniform(0.05, 0.5)
    top, radius = rng.uniform(0.2, 5.0), 0.05
    model, shapes = pin.Model(), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    turn = pin.rpy.rpyToMatrix(0.0, 0.0, rng.uniform(-3.0, 3.0))
    apart, high = 2.0 * radius * np.sin(theta), radius + 2.0 * radius * np.cos(theta)
    for name, x, z, mass in (("a", -apart, radius, 1.0), ("b", apart, radius, 1.0), ("top", 0.0, high, top)):
        place = pin.SE3(np.eye(3), turn @ np.array([x, 0.0, z]))
        pn.free_body(model, name, coal.Sphere(radius), mass=mass, collision_model=shapes, place=place)
    pairs = [("a", "ground", on_floor), ("b", "ground", on_floor), ("top", "a", mu), ("top", "b", mu)]
    contacts = [pn.GeometryContact(one, other, mu=value) for one, other, value in pairs]
    found = pn.rest(pn.Scene(model, contacts=contacts, collision_model=shapes))
    between = np.tan(0.5 * theta)
    factor = max(between / mu, 0.5 * top * between / (1.0 + 0.5 * top) / on_floor)
    assert found.margin == pytest.approx(1.0 - factor, rel=1e-7, abs=1e-7)
    assert found.rests == (factor <= 1.0)
