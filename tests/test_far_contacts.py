"""Contacts that are far away are not looked at: what comes near is found all the same."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from .mechanisms import GRAVITY, body, empty, frame, hinge

INSTANT = 1e-9  # of the time itself


def flying(contacts, q0, v0, gravity=GRAVITY):
    """A point of 1 kg that moves along the axes of the world, and a target that stands still."""
    model = empty((0.0, 0.0, -gravity))
    joint = body(model, 0, pin.JointModelTranslation(), "point", 1.0)
    frame(model, "tip", joint)
    frame(model, "target", 0)
    return pn.Scene(model, contacts=contacts, q0=q0, v0=v0)


def first(run, kind="impact"):
    return next((e.time for e in run.events if e.kind == kind), None)


@pytest.mark.parametrize("height", [1e-3, 1.0, 1e2, 1e4])
@pytest.mark.parametrize("speed", [-300.0, 0.0, 50.0])
def test_a_fall_ends_on_the_floor(height, speed):
    """Others that stay far do not hide it."""
    floor = pn.PointContact("tip")
    others = [pn.PointContact("tip", height=-1e5 * (k + 1), name=f"below {k}") for k in range(5)]
    scene = flying([*others, floor], [0.0, 0.0, height], [0.0, 0.0, speed])
    ends = (speed + np.sqrt(speed**2 + 2.0 * GRAVITY * height)) / GRAVITY
    run = pn.simulate(scene, 1.5 * ends)
    assert first(run) == pytest.approx(ends, rel=INSTANT)


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4"])
@pytest.mark.parametrize("miss", [-1e-6, 1e-6])
def test_a_fast_point_grazes_a_small_ball(method, miss):
    """1 mm across, 100 m away, 1 km/s."""
    radius = 0.5e-3
    ball = pn.SphereContact("target", "tip", radius)
    scene = flying([ball], [-100.0, radius + miss, 0.0], [1e3, 0.0, 0.0], gravity=0.0)
    more = {"dt": 1e-3} if method == "rk4" else {}
    run = pn.simulate(scene, 0.2, method=method, **more)
    if miss > 0.0:
        assert run.events == []
    else:
        ends = (100.0 - np.sqrt(radius**2 - (radius + miss) ** 2)) / 1e3
        assert first(run) == pytest.approx(ends, rel=INSTANT)


def test_a_long_arm_comes_round():
    """Its tip is far from the plane most of the time, and strikes it once in each turn."""
    model = empty((0.0, 0.0, 0.0))
    arm = body(model, 0, hinge(0, 1, 0), "arm", 1.0, inertia=np.eye(3))
    frame(model, "tip", arm, pin.SE3(np.eye(3), np.array([10.0, 0.0, 0.0])))
    frame(model, "near", arm, pin.SE3(np.eye(3), np.array([1e-3, 0.0, 0.0])))
    plane = -9.999
    contacts = [pn.PointContact(name, height=plane, restitution=1.0) for name in ("near", "tip")]
    run = pn.simulate(pn.Scene(model, contacts=contacts, v0=[1.0]), 30.0)
    strikes = [e.time for e in run.events if e.kind == "impact"]
    there = np.arcsin(-plane / 10.0)
    assert strikes[0] == pytest.approx(there, rel=INSTANT)
    np.testing.assert_allclose(np.diff(strikes), np.pi + 2.0 * there, rtol=INSTANT)


def far_shapes(count):
    """A ball over a floor, and so many other shapes around that it does not come near."""
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    ball = body(model, 0, pin.JointModelFreeFlyer(), "ball", 1.0, inertia=0.02 * np.eye(3))
    shapes = [coal.Sphere(0.25), coal.Box(0.5, 0.4, 0.3), coal.Cylinder(0.2, 0.4), coal.Cone(0.2, 0.4)]
    floor = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    geometry.addGeometryObject(pin.GeometryObject("ball", ball, pin.SE3.Identity(), coal.Sphere(0.1)))
    geometry.addGeometryObject(pin.GeometryObject("floor", 0, pin.SE3.Identity(), floor))
    contacts = [pn.GeometryContact("ball", "floor", mu=0.5, restitution=0.6)]
    for k in range(count):
        at = pin.SE3(np.eye(3), np.array([3.0 + k % 20, float(k // 20), 0.3]))
        geometry.addGeometryObject(pin.GeometryObject(f"far {k}", 0, at, shapes[k % len(shapes)]))
        contacts.append(pn.GeometryContact("ball", f"far {k}", mu=0.5))
    start = {"q0": [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], "v0": [0.3, 0.0, 0.0, 1.0, 2.0, 3.0]}
    return pn.Scene(model, contacts=contacts, collision_model=geometry, **start)


@pytest.mark.parametrize("count", [4, 40, 400])
def test_pairs_that_are_far_change_no_bit(count):
    """It bounces, slips, rolls and rests as if they were not there."""
    alone, among = (pn.simulate(far_shapes(k), 3.0) for k in (0, count))
    np.testing.assert_array_equal(alone.t, among.t)
    np.testing.assert_array_equal(alone.q, among.q)
    np.testing.assert_array_equal(alone.v, among.v)
    assert [(e.time, e.kind) for e in alone.events] == [(e.time, e.kind) for e in among.events]
    assert alone.stats.steps == among.stats.steps
