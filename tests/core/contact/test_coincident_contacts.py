"""Coincident contacts act as one contact: declared several times, or coincident points of two shapes."""

from __future__ import annotations

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...geometry.test_geometry_pairs import convex
from ...geometry.test_solid_contacts import pair, thrown
from ...support.contact_points import closed_points
from ...support.mechanisms import GRAVITY, body, empty, frame

# Difference of motions of the order of a meter at the tolerances of the steps.
SAME = 1e-12
METHODS = {"dop853": {"rtol": 1e-10, "atol": 1e-12}, "moreau": {"method": "moreau", "dt": 1e-3}}


def copies(contacts, count):
    return [replace(c, name=f"contact {k}, copy {j}") for j in range(count) for k, c in enumerate(contacts)]


def free(contacts, count, inertia, gravity=(0.0, 0.0, -GRAVITY), **start):
    model = empty(gravity)
    joint = body(model, 0, pin.JointModelFreeFlyer(), "thing", 1.0, inertia=inertia)
    frame(model, "middle", joint)
    frame(model, "ground", 0)
    return pn.Scene(model, contacts=copies(contacts, count), **start)


RADIUS = 0.1


def bounces_and_rolls(count):
    """Return a ball with spin: flight, impacts, sliding and rolling."""
    ball = pn.PointContact("middle", radius=RADIUS, mu=0.3, restitution=0.4)
    v = [1.0, 0.4, 0.0, 2.0, -3.0, 1.0]
    return free([ball], count, 0.4 * RADIUS**2 * np.eye(3), q0=[0, 0, 0.3, 0, 0, 0, 1], v0=v)


def slides_to_rest(count):
    """Return a box on four corners that slides to rest."""
    corners = [c for c in pn.box_contacts("middle", (0.4, 0.2, 0.2), mu=0.5) if c.offset[2] < 0.0]
    inertia = np.diag([0.0067, 0.0167, 0.0167])
    return free(corners, count, inertia, q0=[0, 0, 0.1, 0, 0, 0, 1], v0=[1.5, 0, 0, 0, 0, 0])


def stands_on_a_slope(count):
    corners = [c for c in pn.box_contacts("middle", (0.4, 0.2, 0.2), mu=0.5) if c.offset[2] < 0.0]
    gravity = GRAVITY * np.array([np.sin(0.3), 0.0, -np.cos(0.3)])
    return free(corners, count, np.diag([0.0067, 0.0167, 0.0167]), gravity, q0=[0, 0, 0.1, 0, 0, 0, 1])


def rolls_off(count):
    """Return a ball that rolls on a horizontal cylinder until it leaves the cylinder."""
    place = {"length": 4.0, "below": 0.9, "radius1": RADIUS, "rpy": (0.5 * np.pi, 0.0, 0.0)}
    contact = pn.CylinderContact("middle", "ground", mu=5.0, **place)
    start, speed = 0.3, 0.8
    v = [speed * np.cos(start), 0.0, -speed * np.sin(start), 0.0, speed / RADIUS, 0.0]
    q = [np.sin(start), 0.3, np.cos(start), 0, 0, 0, 1]
    return free([contact], count, 0.4 * RADIUS**2 * np.eye(3), q0=q, v0=v)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("make", [bounces_and_rolls, slides_to_rest, stands_on_a_slope, rolls_off])
def test_copies_move_as_one(make, method):
    """Contacts declared once, twice and four times give the same motion."""
    runs = [pn.simulate(make(count), 1.0, output_dt=0.01, **METHODS[method]) for count in (1, 2, 4)]
    for run in runs[1:]:
        assert run.q.shape == runs[0].q.shape
        assert np.abs(run.q - runs[0].q).max() < SAME
        assert np.abs(run.v - runs[0].v).max() < SAME
    if make is rolls_off:
        assert not runs[0].closed[-1].any()
    if make is slides_to_rest:
        assert np.abs(runs[0].v[-1]).max() == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_one_of_them_carries_the_load(method):
    scene = free(
        [pn.PointContact("middle", radius=RADIUS, mu=0.3)], 3, 0.004 * np.eye(3), q0=[0, 0, 0.1, 0, 0, 0, 1]
    )
    run = pn.simulate(scene, 0.1, record="forces", **METHODS[method])
    assert run.closed[-1].sum() == 1
    assert run.lam[-1].sum() == pytest.approx(GRAVITY, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_stops_declared_twice(method):
    """A slide that falls on its stop, bounces and rests there."""
    model = empty((0.0, 0.0, -GRAVITY))
    body(model, 0, pin.JointModelPZ(), "slide", 1.0)
    runs = []
    for count in (1, 2, 4):
        stops = copies([pn.JointLimit("slide", lower=0.0, restitution=0.5)], count)
        scene = pn.Scene(model, contacts=stops, q0=[0.2], v0=[0.3])
        runs.append(pn.simulate(scene, 2.0, output_dt=0.01, **METHODS[method]))
    for run in runs[1:]:
        assert np.abs(run.q - runs[0].q).max() < SAME


def test_a_capsule_falls_on_a_corner():
    """One of the coincident points at the tip of four mesh edges takes the impact."""
    tip = [[0, 0, 0.2], [0.3, 0, -0.2], [-0.3, 0, -0.2], [0, 0.3, -0.2], [0, -0.3, -0.2]]
    scene = pair(coal.Capsule(0.04, 0.3), convex(tip), mu=0.4)
    turned = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.5 * np.pi, 0.3)).coeffs()
    run = pn.simulate(scene, 0.4, q=[0.01, 0.0, 0.3, *turned], v=[0, 0, 0, 0.5, 0, 0.2])
    first = next(event.time for event in run.events if event.kind == "impact")
    assert closed_points(run)[np.searchsorted(run.t, first, side="right") - 1].sum() == 1
    assert run.t[-1] == 0.4


@pytest.mark.parametrize("seed", [43, 117])
def test_capsules_that_come_to_a_corner(seed):
    scene, _, _, start = thrown("capsule at mesh", seed)
    run = pn.simulate(scene, 0.5, output_dt=0.002, max_steps=20000, **start)
    assert run.t[-1] == 0.5
    assert np.isfinite(run.q).all()


def test_places_that_differ_are_kept():
    """Four corners of a cube carry the load, with or without a duplicate corner."""
    corners = [c for c in pn.box_contacts("middle", (0.2, 0.2, 0.2), mu=0.5) if c.offset[2] < 0.0]
    again = replace(corners[0], name="again")
    rougher = replace(corners[1], mu=0.7, name="rougher")
    scene = free(corners, 1, 0.0067 * np.eye(3), q0=[0, 0, 0.1, 0, 0, 0, 1])
    scene = pn.Scene(scene.model, contacts=[*corners, again, rougher], q0=scene.q0)
    run = pn.simulate(scene, 0.1, record="forces")
    assert run.closed[-1].sum() == 5  # one contact has another friction
    assert run.lam[-1].sum() == pytest.approx(GRAVITY, rel=1e-12)


def slider(*coefficients):
    contacts = [pn.PointContact("middle", mu=mu, name=f"foot {k}") for k, mu in enumerate(coefficients)]
    return free(contacts, 1, 0.1 * np.eye(3), q0=[0, 0, 0, 0, 0, 0, 1], v0=[1.0, 0, 0, 0, 0, 0])


def test_copies_that_a_run_tells_apart():
    """Duplicates with friction from run parameters act like duplicates with the same declared friction."""
    names = slider(0.2, 0.2).contact_names
    given = {names[1]: {"mu": [0.2, 0.4]}}
    alike, apart = pn.rollout(slider(0.2, 0.2), None, None, 0.1, parameters=given)
    assert alike.v[-1][0] == pytest.approx(1.0 - 0.2 * GRAVITY * 0.1, abs=1e-10)
    declared = pn.simulate(slider(0.2, 0.4), 0.1)
    assert apart.v[-1] == pytest.approx(declared.v[-1], abs=1e-12)
    assert apart.closed[-1].sum() == 2


def test_places_that_resist_spinning_otherwise_are_kept():
    contacts = [
        pn.PointContact("middle", mu=0.2, torsional=r, name=f"foot {r}") for r in (0.0, 0.01, 0.01, 0.03)
    ]
    scene = free(contacts, 1, 0.1 * np.eye(3), q0=[0, 0, 0, 0, 0, 0, 1], v0=[0, 0, 0, 0, 0, 1.0])
    assert pn.simulate(scene, 0.01).closed[-1].sum() == 3


@pytest.mark.parametrize("method", METHODS)
def test_a_cube_on_a_cube(method):
    """One contact remains of the coincident points of edges and faces, and the cube does not drift."""
    size = 0.2
    model, geometry = empty(), pin.GeometryModel()
    for k in range(2):
        pn.free_body(model, f"cube {k}", coal.Box(size, size, size), mass=1.0, collision_model=geometry)
    geometry.addGeometryObject(pn.ground("floor"))
    pairs = [pn.GeometryContact("cube 0", "floor", mu=0.5), pn.GeometryContact("cube 1", "cube 0", mu=0.5)]
    q0 = [0, 0, 0.5 * size, 0, 0, 0, 1, 0, 0, 1.5 * size, 0, 0, 0, 1]
    scene = pn.Scene(model, contacts=pairs, collision_model=geometry, q0=q0)
    run = pn.simulate(scene, 0.2, record="forces", **METHODS[method])
    assert np.abs(run.q - q0).max() < SAME
    assert run.lam[-1].sum() == pytest.approx(3.0 * GRAVITY, rel=1e-12)
    assert closed_points(run)[-1].sum() == 12
    assert run.closed[-1].tolist() == [True, True]
