"""Speeds that grow without bound end a run with a named error; falls, motors and pendulums do not."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import DivergenceError

from ....support.mechanisms import body, empty

ADAPTIVE = ["dop853", "dopri5", "Radau"]


def slide(**parts):
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "slide", 1.0)
    return pn.Scene(model, **parts)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_an_unstable_spring_is_named_with_its_growth(method):
    """x'' = 100 x - 0.1 x' grows as exp(9.95 t)."""
    scene = slide(forces=[pn.UserForce(lambda t, q, v: 100.0 * q - 0.1 * v)], q0=[1e-3])
    with pytest.raises(DivergenceError) as caught:
        pn.simulate(scene, 100.0, method=method)
    error = caught.value
    assert re.match(
        r'the speed of joint "slide" grows without bound by t = [\d.]+ s, by a factor of e every 0\.1 s, '
        r'over many decades, and force "UserForce[^"]*" does the most work on it: the motion is unstable; '
        r"check the signs, gains and delays there, or allow the motion with max_steps; the "
        r"trajectory up to",
        str(error),
    )
    assert error.joint == "slide"
    assert error.rate == pytest.approx(-0.05 + np.sqrt(0.0025 + 100.0), rel=1e-3)
    assert 1e6 <= error.trajectory.v[-1, 0] < 1e9
    assert pn.simulate(scene, 3.0, method=method, max_steps=1e6).t[-1] == 3.0


def late_impedance(model, delay, stiffness, damping, period=1e-3):
    """Torques that hold joints still by their states some periods ago."""
    kept = []

    def torque(t, q, v):
        kept.append((np.array(q), np.array(v)))
        then = kept[max(0, len(kept) - 1 - round(delay / period))]
        return -stiffness * then[0] - damping * then[1]

    return pn.SampledControl(torque, period)


def test_an_impedance_that_is_late_is_named():
    """A stiff controller holds the joints of a Panda by measurements that are 5 ms old."""
    panda = pn.load("panda_friction")
    model = panda.model
    M = pin.crba(model, model.createData(), panda.q0)
    inertia = np.diag(M)
    control = late_impedance(model, 5e-3, 9e4 * inertia, 6e2 * inertia)
    scene = pn.Scene(model, actuation=control, q0=panda.q0, v0=0.01 * np.ones(model.nv))
    with pytest.raises(DivergenceError) as caught:
        pn.simulate(scene, 60.0)
    error = caught.value
    assert error.joint in list(model.names)
    assert error.source == "the actuation"
    assert "Radau" not in str(error)
    assert len(error.trajectory) < 10**5


def falling(**start):
    model = empty()
    body(model, 0, pin.JointModelPZ(), "drop", 1.0)
    return pn.Scene(model, **start)


def pendulum():
    model = empty()
    body(model, 0, pin.JointModelRY(), "pivot", 1.0, lever=(0.0, 0.0, 1.0))
    return pn.Scene(model, q0=[1e-12])


def catapult():
    """A light link thrown by a heavy one, and a whip of ten links that falls."""
    model, joint = empty(), 0
    for k in range(10):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3 if k else 0.0]))
        joint = body(
            model, joint, pin.JointModelRY(), f"j{k}", 10.0 * 0.2**k, place=place, lever=(0.0, 0.0, -0.15)
        )
    return pn.Scene(model, q0=0.9 * np.ones(10))


def swung_rotor():
    """A motor of constant torque, and a pendulum on its arm."""
    model = empty(gravity=(0.0, 0.0, 0.0))
    arm = body(model, 0, pin.JointModelRY(), "arm", 1.0, lever=(0.2, 0.0, 0.0))
    tip = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    body(model, arm, pin.JointModelRY(), "bob", 0.1, place=tip, lever=(0.1, 0.0, 0.0))
    return pn.Scene(model, actuation=[1e4, 0.0])


LEGITIMATE = {
    "a fall of days": (falling, 1e6),
    "a fall that begins fast": (lambda: falling(v0=[-1e5]), 1e7),
    "a motor with constant torque": (lambda: slide(actuation=[1e3]), 1e6),
    "a strong push of a light body": (lambda: slide(actuation=[1e9]), 10.0),
    "a push that grows with time": (lambda: slide(actuation=lambda t, q, v: [t**3]), 1e3),
    "an inverted pendulum": (pendulum, 30.0),
    "a whip": (catapult, 2.0),
    "a motor that throws a pendulum around": (swung_rotor, 0.3),
    "a drag that holds a fall": (
        lambda: slide(laws=[pn.JointFriction("slide", viscous=1e-3)], actuation=[1e5]),
        1e5,
    ),
}


@pytest.mark.parametrize("name", list(LEGITIMATE))
def test_legitimate_motions_go_on(name):
    make, duration = LEGITIMATE[name]
    for method in ("dop853", "dopri5"):
        assert pn.simulate(make(), duration, method=method, rtol=1e-6).t[-1] == duration
