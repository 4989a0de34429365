"""Friction with a limit for each direction of slip: one-way clutches, ratchets, sledges."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.one_way_friction import OneWayFriction

from ...support.mechanisms import body, empty, frame
from ...support.refusals import refuses
from ...support.seeds import seeds

METHODS = [{"method": m} for m in ("dop853", "dopri5", "Radau", "BDF", "LSODA")]
FIXED = [{"method": m, "dt": 1e-3} for m in ("rk4", "semi_implicit_euler", "moreau")]


def wheel(limit, torque, ratio=1.0):
    """A wheel of unit inertia on a clutch."""
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelRZ(), "wheel", 1.0, inertia=np.eye(3))
    law = pn.UserFriction(lambda t, q: np.array([1.0]), limit, static_ratio=ratio, name="clutch")
    return pn.Scene(model, laws=[law], actuation=torque)


def pulses(t, q, v):
    """Torque backward for 1 s, forward for 1 s, backward for 3 s, zero for 1 s, forward for 1 s."""
    ends, levels = (1.0, 2.0, 5.0, 6.0), (-2.0, 3.0, -1.0, 0.0, 1.0)
    return [levels[int(np.searchsorted(ends, t, side="right"))]]


# Locked; free to 1.5 rad and 3 rad/s; slowed at 1 rad/s^2 to rest after another 4.5 rad, which takes all 3 s;
# locked without a torque and free again.
ANGLES = {0.5: 0.0, 1.0: 0.0, 2.0: 1.5, 4.0: 1.5 + 6.0 - 2.0, 5.0: 6.0, 6.0: 6.0, 7.0: 6.5}


@pytest.mark.parametrize("how", METHODS + FIXED, ids=lambda how: how["method"])
@pytest.mark.parametrize("turned", [1, -1])
def test_a_freewheel_turns_one_way(how, turned):
    """Pulses of torque, and the same clutch put in the other way round with the torques turned as well."""
    limits = (0.0, 10.0) if turned > 0 else (10.0, 0.0)
    scene = wheel(lambda t, q, v, r: limits, lambda t, q, v: [turned * pulses(t, q, v)[0]])
    accuracy = 2e-2 if "dt" in how else 1e-6
    corners = (1.0, 2.0, 5.0, 6.0)
    q, v, t = [0.0], [0.0], 0.0
    for end in (*corners, 7.0):  # torques jump between the runs
        middle = 0.5 * (t + end)
        held = wheel(lambda t, q, v, r: limits, [turned * pulses(middle, q, v)[0]])
        run = pn.simulate(held, end - t, q, v, t0=t, output_dt=0.5, **how)
        for at, angle in ANGLES.items():
            k = np.flatnonzero(np.abs(run.t - at) < 1e-9)
            if len(k):
                assert run.q[k[0], 0] == pytest.approx(turned * angle, abs=accuracy)
        q, v, t = run.q[-1], run.v[-1], end
    assert scene.solve([0.0], [0.0], 0.5).modes[0] == 0
    assert scene.solve([0.0], [0.0], 1.5).modes[0] == turned


def test_a_locked_freewheel_has_no_velocity_at_all():
    scene = wheel(lambda t, q, v, r: (0.0, 10.0), [-2.0])
    run = pn.simulate(scene, 1.0, record="forces")
    assert (run.v == 0.0).all()
    np.testing.assert_allclose(run.F_nonideal + run.F_ideal, 2.0, rtol=0.0, atol=1e-14)


def test_one_number_and_two_equal_ones_are_the_same():
    one, two = (
        pn.simulate(
            wheel(lambda t, q, v, r, value=value: value, lambda t, q, v: [2.0 * np.sin(3.0 * t)]), 5.0
        )
        for value in (1.0, (1.0, 1.0))
    )
    np.testing.assert_array_equal(one.q, two.q)
    np.testing.assert_array_equal(one.t, two.t)


def random_system(seed, count):
    """Return masses on three slides, springs, an oscillating force, and elements along random directions."""
    draw = np.random.default_rng([count, seed])
    M = np.diag(draw.uniform(0.5, 3.0, 3)) if count > 1 else np.diag(draw.uniform(0.5, 3.0, 1))
    n = len(M)
    K = draw.normal(0.0, 1.0, (n, n))
    K = 0.5 * K @ K.T + 0.5 * np.eye(n)
    amplitude, frequency = draw.uniform(1.0, 4.0, n), draw.uniform(0.7, 3.0, n)
    D = draw.normal(0.0, 1.0, (count, n)) if n > 1 else np.array([[draw.choice([-1.0, 1.0])]])
    D = D / np.linalg.norm(D, axis=1)[:, None]
    forward, backward = draw.uniform(0.0, 2.0, count), draw.uniform(0.0, 2.0, count)
    forward[draw.random(count) < 0.3] = 0.0
    ratio = np.where(draw.random(count) < 0.5, 1.0, draw.uniform(1.0, 1.5, count))
    damping = draw.uniform(0.0, 0.3)

    def force(t, q, v):
        return amplitude * np.sin(frequency * t + 0.3) - K @ q - damping * v

    return OneWayFriction(M, force, D, forward, backward, ratio)


def scene_of(system):
    model, last = empty(gravity=(0.0, 0.0, 0.0)), 0
    n = len(system.M)
    kinds = (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ())[:n]
    for k, kind in enumerate(kinds):  # massless carriages with armature
        last = body(model, last, kind, f"slide{k}", 0.0)
    model.armature = np.diag(system.M).copy()
    laws = [
        pn.UserFriction(
            lambda t, q, d=d: d,
            lambda t, q, v, r, both=(float(f), float(b)): both,
            static_ratio=float(ratio),
            name=f"e{i}",
        )
        for i, (d, f, b, ratio) in enumerate(
            zip(system.D, system.forward, system.backward, system.ratio, strict=True)
        )
    ]
    return pn.Scene(model, laws=laws, forces=[pn.UserForce(system.force)])


# In systems 73, 129 and 174 an element reaches its limit while all elements at rest hold within rounding.
# In 213 one slips for 0.4 ms. In 117 several modes are possible at the start.
REACHED = (73, 117, 129, 174, 213)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("seed", seeds(range(300), always=REACHED))
def test_random_systems_move_as_by_scipy(seed, count):
    system = random_system(seed, count)
    times = np.linspace(0.0, 4.0, 9)
    n = len(system.M)
    expected, _ = system.run(np.zeros(n), np.zeros(n), times)
    run = pn.simulate(scene_of(system), 4.0, output_dt=0.5, rtol=1e-10, atol=1e-12)
    at = run.samples(run.grid)
    np.testing.assert_allclose(np.hstack([at.q, at.v]), expected, rtol=0.0, atol=2e-6)


def bead(limit, gravity=0.0, **state):
    """A bead on a circle of a meter about the origin, in a vertical plane."""
    model = empty(gravity=(0.0, -gravity, 0.0))
    slide = body(model, 0, pin.JointModelPX(), "x", 0.0)
    last = body(model, slide, pin.JointModelPY(), "y", 1.0)
    frame(model, "bead", last)

    def tangent(t, q):
        return np.array([-q[1], q[0]]) / np.hypot(*q)

    hoop = pn.Distance("bead", "universe", length=1.0, name="hoop")
    law = pn.UserFriction(tangent, limit, name="wire")
    return pn.Scene(model, constraints=[hoop], laws=[law], **state)


MU = (0.2, 0.6)


def by_load(t, q, v, reactions):
    load = abs(reactions["hoop"][0])
    return MU[0] * load, MU[1] * load


@pytest.mark.parametrize("way", [1, -1])
def test_a_limit_of_the_load_for_each_way(way):
    """v' = -mu v^2 of a bead on a hoop without gravity: v = v0 / (1 + mu v0 t)."""
    mu = MU[0] if way > 0 else MU[1]
    run = pn.simulate(bead(by_load), 2.0, [1.0, 0.0], [0.0, 3.0 * way], rtol=1e-11)
    assert np.linalg.norm(run.v[-1]) == pytest.approx(3.0 / (1.0 + 6.0 * mu), rel=1e-8)


@pytest.mark.parametrize("tilt", [0.1, 0.18, 0.22, 0.5, 0.58, -0.1, -0.18, -0.22, -0.58, 0.65, -0.65])
def test_a_bead_that_rests_holds_up_to_the_angle_of_its_way(tilt):
    """A bead at an angle from the lowest point holds while |tan| is below mu of the downward direction."""
    q = np.array([np.sin(tilt), -np.cos(tilt)])
    now = bead(by_load, gravity=10.0).solve(q, [0.0, 0.0])
    forward = tilt < 0.0  # slip down, along the tangent that turns counterclockwise
    expected = 0 if np.tan(abs(tilt)) <= (MU[0] if forward else MU[1]) else (1 if forward else -1)
    assert now.modes[0] == expected


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ((1.0, -2.0), 'UserFriction "clutch": limit must not be negative; got -2'),
        ((1.0, np.nan), 'UserFriction "clutch": limit must return finite numbers; got [ 1. nan]'),
        ((1.0, 2.0, 3.0), 'UserFriction "clutch": limit must return shape (2,); got shape (3,)'),
    ],
)
def test_limits_that_are_none_are_refused(limit, words):
    with refuses(words, pn.UserFunctionError):
        pn.simulate(wheel(lambda t, q, v, r: limit, [1.0]), 1.0)
