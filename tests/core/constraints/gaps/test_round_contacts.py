"""Contacts of spheres and capsules, against closed forms."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.mechanisms import GRAVITY, body, empty, frame
from ....support.seeds import seeds

ROUNDING = 1e-12


def place(x=0.0, y=0.0, z=0.0):
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def planar_ball(mass, inertia):
    """Return a planar ball in the x-z plane with a frame "ball" at its center, and a world frame "hub"."""
    model = empty((0.0, 0.0, -GRAVITY))
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    joint = body(model, joint, pin.JointModelPZ(), "z", 0.0)
    joint = body(model, joint, pin.JointModelRY(), "turn", mass, inertia=inertia * np.eye(3))
    frame(model, "ball", joint, place())
    frame(model, "hub", 0, place())
    return model


def leaving_angle(model, contact, distance, start, spin):
    """Return the angle from the top at which a ball leaves the hub, from a start with small speed."""
    q = [distance * np.sin(start), distance * np.cos(start), 0.0]
    speed = 1e-9 + np.sqrt(2.0 * GRAVITY * distance * (1.0 - np.cos(start)) / (1.0 + spin))
    v = [speed * np.cos(start), -speed * np.sin(start), speed / 0.1 * (spin > 0.0)]
    scene = pn.Scene(model, contacts=[contact])
    run = pn.simulate(scene, 3.0, q=q, v=v, rtol=1e-11, atol=1e-12)
    (leaves,) = [e for e in run.events if e.kind == "lift_off"][:1]
    at = np.argmin(np.abs(run.t - leaves.time))
    return np.arctan2(run.q[at, 0], run.q[at, 1])


def test_a_ball_slides_off_a_sphere_at_two_thirds():
    """Without friction the ball leaves at cos = 2/3 of the initial height (energy and N = 0)."""
    contact = pn.SphereContact("ball", "hub", 0.1, 0.9)
    start = 0.2
    angle = leaving_angle(planar_ball(1.0, 0.004), contact, 1.0, start, 0.0)
    # The initial speed is that of a fall from the top, so the energy equals that of rest at the top.
    assert np.cos(angle) == pytest.approx(2.0 / 3.0, abs=1e-8)


def test_a_ball_rolls_off_a_sphere_at_ten_seventeenths():
    """A rolling ball (I = 2/5 m r^2) leaves at cos = 10/17; mu = 1e6 prevents slip."""
    contact = pn.SphereContact("ball", "hub", 0.1, 0.9, mu=1e6)
    angle = leaving_angle(planar_ball(1.0, 0.4 * 0.01), contact, 1.0, 0.2, 0.4)
    assert np.cos(angle) == pytest.approx(10.0 / 17.0, abs=1e-6)


def test_two_touching_balls_share_an_impact():
    """A ball of 1 m/s strikes two touching balls at once: -1/3, 2/3, 2/3 m/s with e = 1."""
    model = empty((0.0, 0.0, 0.0))
    for k, x in enumerate((-0.5, 0.0, 0.2)):
        joint = body(model, 0, pin.JointModelPX(), f"x{k}", 1.0, place=place(x))
        frame(model, f"b{k}", joint, place())
    contacts = [pn.SphereContact(f"b{k}", f"b{k + 1}", 0.1, 0.1, restitution=1.0) for k in (0, 1)]
    run = pn.simulate(pn.Scene(model, contacts=contacts), 1.0, v=[1.0, 0.0, 0.0])
    assert run.events[0].time == pytest.approx(0.3, abs=1e-12)
    assert run.v[-1] == pytest.approx([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], abs=ROUNDING)


def test_a_fast_small_sphere_does_not_pass_a_thin_wall():
    """A sphere of 1 mm at 100 m/s strikes a sphere of 1 mm."""
    model = planar_ball(1.0, 1e-6)
    scene = pn.Scene(model, contacts=[pn.SphereContact("ball", "hub", 5e-4, 5e-4)])
    run = pn.simulate(scene, 0.1, q=[0.0, 2.0, 0.0], v=[0.0, -100.0, 0.0])
    assert run.q[:, 1].min() >= 1e-3 - 1e-10


def free_body(mass=1.0, inertia=0.02):
    model = empty((0.0, 0.0, -GRAVITY))
    joint = body(model, 0, pin.JointModelFreeFlyer(), "box", mass, inertia=inertia * np.eye(3))
    frame(model, "middle", joint, place())
    return model


def test_crossed_capsules_stop_each_other():
    """A capsule falls across the center of a fixed capsule and rests there."""
    model = free_body()
    frame(model, "bar", 0, place())
    along_x, along_y = ((-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)), ((0.0, -0.5, 0.0), (0.0, 0.5, 0.0))
    contact = pn.CapsuleContact("middle", "bar", along_x, along_y, 0.05, 0.1, mu=0.5)
    run = pn.simulate(pn.Scene(model, contacts=[contact]), 0.6, q=[0, 0, 0.5, 0, 0, 0, 1])
    assert run.q[-1, 2] == pytest.approx(0.15, abs=1e-10)
    (impact,) = [e for e in run.events if e.kind == "impact"]
    assert impact.time == pytest.approx(np.sqrt(2.0 * 0.35 / GRAVITY), abs=1e-11)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pn.SphereContact("a", "b", 0.0), "one of radius1 and radius2 must be positive"),
        (lambda: pn.SphereContact("a", "a", 0.1), 'frame1 and frame2 must differ; both are "a"'),
        (lambda: pn.SphereContact("a", "b", 0.1, mu=-1.0), "mu must not be negative"),
        (lambda: pn.SphereContact("a", "b", 0.1, restitution=1.5), "restitution must"),
    ],
)
def test_bad_descriptions(make, message):
    with pytest.raises(pn.InputError) as error:
        make()
    assert message in str(error.value)


def test_friction_of_an_impact_turns_a_ball_to_rolling():
    """A spinning ball falls on a fixed ball: 2/7 of its spin is left (I = 2/5 m r^2)."""
    model = planar_ball(1.0, 0.4 * 0.01)
    scene = pn.Scene(model, contacts=[pn.SphereContact("ball", "hub", 0.1, 0.9, mu=10.0)])
    run = pn.simulate(scene, 0.2, q=[0.0, 1.05, 0.0], v=[0.0, 0.0, 7.0])
    impact = next(e for e in run.events if e.kind == "impact")
    assert impact.v_plus == pytest.approx([0.1 * 2.0, 0.0, 2.0], abs=1e-10)


def capsule_distance(run, k, half1, half2):
    """Return the distance by Coal, whose capsules are along z."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    first, second = coal.Capsule(0.05, 2.0 * half1), coal.Capsule(0.1, 2.0 * half2)
    at = pin.XYZQUATToSE3(run.q[k])
    one = coal.Transform3s(at.rotation, at.translation)
    return coal.distance(first, one, second, coal.Transform3s(), request, result)


@pytest.mark.parametrize("seed", seeds(range(12)))
def test_tumbling_capsules_do_not_pass_through_each_other(seed):
    """A capsule with spin strikes a fixed capsule; penetration is below 1e-8 m by Coal's distance."""
    rng = np.random.default_rng(seed)
    model = free_body()
    frame(model, "bar", 0, place())
    half1, half2 = rng.uniform(0.05, 0.6, 2)
    ends = [((0.0, 0.0, -h), (0.0, 0.0, h)) for h in (half1, half2)]
    contact = pn.CapsuleContact("middle", "bar", *ends, 0.05, 0.1, mu=0.4, restitution=0.5)
    toward = rng.normal(size=3)
    toward /= np.linalg.norm(toward)
    turn = pin.Quaternion(pin.exp3(rng.normal(size=3) * 2.0)).coeffs()
    q = np.concatenate([-2.0 * toward, turn])
    spin = rng.normal(size=3) * 5.0
    v = np.concatenate([pin.Quaternion(turn).toRotationMatrix().T @ (10.0 * toward), spin])
    run = pn.simulate(pn.Scene(model, contacts=[contact]), 0.5, q=q, v=v, output_dt=0.002)
    assert any(e.kind == "impact" for e in run.events)
    assert min(capsule_distance(run, k, half1, half2) for k in range(len(run.t))) > -1e-8
