"""Shafts with two and three Cardan joints, driven at the input or free, against the closed form."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.cardan_shafts import Shafts

from ..support.seeds import ranges

DURATION = 2.0
# Errors without integration, for no degree of freedom: rounding through loops at up to 60 rad/s.
POSITION, VELOCITY, FORCE = 1e-9, 1e-8, 1e-6


def drive(rng):
    if rng.random() < 0.5:
        return pn.polynomial([0.0, rng.uniform(5.0, 60.0)])
    return pn.sinusoid(rng.uniform(1.0, 10.0), rng.uniform(1.0, 6.0))


def scene(shafts, function=None):
    bearings = [pn.HingeAnchor(frame, axis=axis, name=f"{frame}_bearing") for frame, axis in shafts.bearings]
    driven = [] if function is None else [pn.PrescribedMotion("input", function, name="drive")]
    return pn.Scene(shafts.model, constraints=[*bearings, *driven])


def turned(axis, angle):
    return pin.AngleAxis(float(angle), axis).matrix()


def misses(shafts, run, jets):
    """Largest misses of orientation, of rates, and of accelerations and torque, as parts of the largest."""
    angles, rates, accelerations, torque = shafts.motion(*np.array(jets).T)
    data = shafts.model.createData()
    place = speed = force = 0.0
    for i in range(len(run.t)):
        pin.forwardKinematics(shafts.model, data, run.q[i], run.v[i], run.a[i])
        for k in range(shafts.crosses):
            joint, axis = shafts.model.getJointId(f"second_pin{k}"), shafts.axes[k + 1]
            R = data.oMi[joint].rotation
            place = max(place, np.abs(R - turned(axis, angles[k + 1, i])).max())
            speed = max(speed, abs(axis @ R @ data.v[joint].angular - rates[k + 1, i]))
            force = max(force, abs(axis @ R @ data.a[joint].angular - accelerations[k + 1, i]))
    force /= 1.0 + np.abs(accelerations).max()
    if "drive" in run.rows:
        lam = run.lam[:, run.rows["drive"][0]]
        force = max(force, np.abs(lam - torque).max() / (1e-3 + np.abs(torque).max()))
    return place, speed / (1.0 + np.abs(rates).max()), force


@pytest.mark.parametrize("crosses", [2, 3])
@pytest.mark.parametrize("many", ranges(4, 40, 300))
def test_a_driven_shaft_is_where_the_closure_has_it(many, crosses):
    for seed in many:
        rng = np.random.default_rng(seed)
        shafts, function = Shafts(rng, crosses), drive(rng)
        for options in (
            {"rtol": 1e-6},
            {"rtol": 1e-12, "atol": 1e-14},
            {"rtol": 1e-8, "output_dt": 0.01},
            {"method": "dopri5", "rtol": 1e-8},
            {"method": "rk4", "dt": 2e-3},
        ):
            run = pn.simulate(scene(shafts, function), DURATION, record=("forces", "a"), **options)
            place, speed, force = misses(shafts, run, [function(t) for t in run.t])
            assert place < POSITION, (seed, options)
            assert speed < VELOCITY, (seed, options)
            assert force < FORCE, (seed, options)


def by_rows(shafts, function):
    """The drive of the input as rows of the user's."""
    joint = shafts.model.joints[1]
    row = np.zeros((1, shafts.model.nv))
    row[0, joint.idx_v] = 1.0
    return pn.UserConstraint(
        lambda t, q, v, data: (row, [function(t)[2]]),
        1,
        residual=lambda t, q: [q[joint.idx_q] - function(t)[0]],
        rate=lambda t, q, v: [v[joint.idx_v] - function(t)[1]],
        name="drive",
    )


@pytest.mark.parametrize("many", ranges(2, 20, 300))
def test_a_shaft_that_rows_of_the_users_drive(many):
    for seed in many:
        rng = np.random.default_rng(seed)
        shafts, function = Shafts(rng, 2), drive(rng)
        driven = pn.Scene(shafts.model, constraints=[*scene(shafts).constraints, by_rows(shafts, function)])
        for method, rtol in (("dop853", 1e-6), ("dop853", 1e-12), ("dopri5", 1e-8)):
            run = pn.simulate(driven, DURATION, method=method, rtol=rtol, record=("forces", "a"))
            place, speed, force = misses(shafts, run, [function(t) for t in run.t])
            assert max(place / POSITION, speed / VELOCITY, force / FORCE) < 1.0, (seed, method, rtol)


@pytest.mark.parametrize("many", ranges(3, 30, 300))
def test_a_driven_shaft_at_any_time(many):
    for seed in many:
        rng = np.random.default_rng(seed)
        shafts, function = Shafts(rng, 2), drive(rng)
        run = pn.simulate(scene(shafts, function), DURATION, record=("forces", "a", "dense"))
        inside = run.at(np.sort(rng.uniform(0.0, DURATION, 50)))
        place, speed, force = misses(shafts, inside, [function(t) for t in inside.t])
        assert max(place / POSITION, speed / VELOCITY, force / FORCE) < 1.0, seed


@pytest.mark.parametrize("crosses", [2, 3])
@pytest.mark.parametrize("many", ranges(3, 30, 300))
def test_a_free_shaft_keeps_its_energy(many, crosses):
    """0.5 J(angle) rate^2 is constant."""
    for seed in many:
        rng = np.random.default_rng(seed)
        shafts = Shafts(rng, crosses)
        free = scene(shafts)
        rate = rng.uniform(5.0, 30.0)
        run = pn.simulate(free, DURATION, v={"input": rate}, rtol=1e-10, atol=1e-12)
        angle = run.q[:, shafts.model.joints[1].idx_q]
        start = shafts.inertia(np.zeros(1))[0]
        assert run.v[:, 0] == pytest.approx(rate * np.sqrt(start / shafts.inertia(angle)), rel=1e-7), seed
