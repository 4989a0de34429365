"""Robots whose wheels are prescribed, driven by motors or coast, beside planar kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles import wheeled_robots

from ..support.orders import SIZES, is_of_order
from ..support.seeds import ranges, seeds

FUNCTIONS = (pn.sinusoid, pn.polynomial)
# Casters have the most joints; the other robots run for long with -m slow.
OTHERS = [kind for kind in wheeled_robots.KINDS if kind != "casters"]
LONG = ["casters", *(pytest.param(kind, marks=pytest.mark.slow) for kind in OTHERS)]
ORDERED = [
    pytest.param(kind, marks=pytest.mark.slow) if kind == "ackermann" else kind
    for kind in wheeled_robots.KINDS
]
# Over 20 s to 200 s the errors of all steps add up, to so many tolerances of a step and a meter of the way.
ADDED = 1e3
# Rounding of accelerations, which light wheels magnify beyond the tightest tolerance.
FLOOR = 1e-9


def scene(robot, **more):
    rolling = [pn.Rolling(frame, radius, name=f"{frame}_rolls") for frame, radius in robot.wheels]
    motions = [pn.PrescribedMotion(joint, function, name=f"{joint}_moves") for joint, function in robot.moved]
    if robot.omni is not None:
        rows, none = robot.omni, np.zeros(len(robot.omni))
        rolling.append(
            pn.UserConstraint(
                lambda t, q, v, data: (rows, none), 3, rate=lambda t, q, v: rows @ v, name="omni"
            )
        )
    return pn.Scene(robot.model, constraints=[*rolling, *motions], q0=robot.q0, **more)


def miss(seed, kind, duration, **options):
    robot = wheeled_robots.robot(np.random.default_rng(seed), kind, FUNCTIONS)
    run = pn.simulate(scene(robot), duration, robot.q0, max_steps=10**6, **options)
    return robot.miss(run.q[-1], duration)


@pytest.mark.parametrize("kind", wheeled_robots.KINDS)
@pytest.mark.parametrize("many", ranges(1, 40, 300))
def test_prescribed_wheels_go_where_they_roll(kind, many):
    for seed in many:
        for method in ("dop853", "dopri5"):
            for rtol in (1e-6, 1e-9, 1e-12):
                found = miss(seed, kind, 20.0, method=method, rtol=rtol, atol=1e-2 * rtol)
                assert found < max(ADDED * rtol, FLOOR), (seed, method, rtol)


@pytest.mark.parametrize("kind", LONG)
@pytest.mark.parametrize("many", ranges(1, 5, 30))
def test_prescribed_wheels_go_where_they_roll_for_long(kind, many):
    for seed in many:
        assert miss(seed, kind, 200.0, rtol=1e-9, atol=1e-11) < ADDED * 1e-9, seed


@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
@pytest.mark.parametrize("kind", wheeled_robots.KINDS)
@pytest.mark.parametrize("seed", seeds(range(10), always=[9], count=1))  # 9: off by 0.2 m without restarts
def test_prescribed_wheels_by_methods_outside_the_core(kind, method, seed):
    assert miss(seed, kind, 20.0, method=method, rtol=1e-7, atol=1e-9) < ADDED * 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("kind", ORDERED)
@pytest.mark.parametrize("seed", seeds(range(30), always=[0])[:1])
def test_fixed_steps_have_their_order(kind, seed):
    for method, order, dt in (("rk4", 4, 0.02), ("semi_implicit_euler", 1, 4e-3)):
        misses = [miss(seed, kind, 5.0, method=method, dt=dt * size) for size in SIZES]
        assert is_of_order(misses, order, FLOOR), method


@pytest.mark.parametrize("seed", seeds(range(300)))
def test_a_car_that_coasts_or_is_driven_by_a_motor_goes_round(seed):
    """The car moves in a circle, at constant speed or with the torque over its total inertia."""
    rng = np.random.default_rng(seed)
    robot, angle, length = wheeled_robots.ackermann(rng, FUNCTIONS, drives=False)
    torque = np.zeros(robot.model.nv)
    car = scene(robot)
    v0 = car.project(robot.q0, np.concatenate([[1.0], np.zeros(robot.model.nv - 1)]))[1]
    unit = v0 / v0[0]
    mass = 2.0 * pin.computeKineticEnergy(robot.model, robot.model.createData(), robot.q0, unit)
    drive = robot.model.joints[robot.model.getJointId("rear_left")].idx_v
    torque[drive] = rng.choice([0.0, 1.0]) * rng.uniform(-0.1, 0.1) * mass / unit[drive]
    duration, rtol = 20.0, 10.0 ** rng.uniform(-12.0, -6.0)
    run = pn.simulate(scene(robot, actuation=torque), duration, robot.q0, v0, rtol=rtol, atol=1e-2 * rtol)
    way = v0[0] * duration + 0.5 * torque[drive] * unit[drive] / mass * duration**2
    heading = way * np.tan(angle) / length
    place = robot.place(run.q[-1])
    at = length / np.tan(angle) * np.array([np.sin(heading), 1.0 - np.cos(heading)])
    assert np.abs(place[:2] - at).max() < max(ADDED * rtol, FLOOR) * max(1.0, abs(way))
