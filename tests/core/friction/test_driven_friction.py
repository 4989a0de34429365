"""Friction in joints with prescribed motion, which cannot stick."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn


def soft(t):
    """At rest until t = 0.5 s, then s^3."""
    s = max(t - 0.5, 0.0)
    return (s**3, 3.0 * s**2, 6.0 * s)


DRIVES = {
    "sinusoid": pn.sinusoid(0.4, 3.0),
    "from rest by a function": soft,
    "from rest by a polynomial": pn.polynomial([0.0, 0.0, 0.0, 0.1]),
    "through rests by a spline": pn.spline([0.0, 1.0, 2.0, 3.0], [0.0, 0.5, 0.2, 1.0]),
    "held still": pn.constant(0.0),
}
LIMIT = 0.5


def double_pendulum():
    model = pin.Model()
    body = pin.Inertia(1.0, np.array([0.0, 0.1, 0.0]), 0.1 * np.eye(3))
    parent = 0
    for name, offset in (("driven", 0.0), ("free", 0.3)):
        place = pin.SE3(np.eye(3), np.array([0.0, offset, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRX(), place, name)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    return model


@pytest.mark.parametrize("kind", DRIVES)
def test_the_drive_does_the_work_that_friction_takes(kind):
    function = DRIVES[kind]
    path = covered(function, 3.0)
    drive = pn.PrescribedMotion("driven", function)
    options = {"rtol": 1e-9, "atol": 1e-10, "record": ("energy", "forces"), "output_dt": 0.05}
    smooth = pn.simulate(pn.Scene(double_pendulum(), constraints=[drive]), 3.0, **options)
    rough = pn.Scene(
        double_pendulum(),
        constraints=[drive],
        laws=[pn.JointFriction("driven", coulomb=LIMIT, static_ratio=1.4, name="rub")],
    )
    run = pn.simulate(rough, 3.0, **options)
    # The motion is the same, and the drive does the work of friction.
    np.testing.assert_allclose(run.q[-1], smooth.q[-1], atol=1e-6)
    assert run.energy["rub"][-1] == pytest.approx(-LIMIT * path, abs=1e-6)
    size = np.abs(run.energy["kinetic"]).max() + np.ptp(run.energy["potential"]) + LIMIT * path
    assert np.abs(run.energy["balance"]).max() < 1e-7 * size
    assert run.violation.max() < 1e-13


def covered(function, duration):
    """Length of the path, by the trapezoidal rule on |rate|: 1e-9 for these functions."""
    t = np.linspace(0.0, duration, 60001)
    return float(np.trapezoid([abs(function(x)[1]) for x in t], t))


def test_reversals_happen_where_the_drive_turns():
    drive = pn.PrescribedMotion("driven", pn.sinusoid(0.4, 3.0))
    scene = pn.Scene(double_pendulum(), constraints=[drive], laws=[pn.JointFriction("driven", coulomb=LIMIT)])
    run = pn.simulate(scene, 3.0)
    assert [e.kind for e in run.events] == ["reverse"] * 3
    turns = (np.arange(3) + 0.5) * np.pi / 3.0
    np.testing.assert_allclose([e.time for e in run.events], turns, atol=1e-9)


@pytest.mark.parametrize("method", ["rk4", "moreau"])
def test_fixed_steps(method):
    drive = pn.PrescribedMotion("driven", pn.sinusoid(0.4, 3.0))
    law = pn.JointFriction("driven", coulomb=LIMIT, name="rub")
    scene = pn.Scene(double_pendulum(), constraints=[drive], laws=[law])
    run = pn.simulate(scene, 3.0, method=method, dt=1e-3, record="energy")
    assert run.energy["rub"][-1] == pytest.approx(-LIMIT * covered(DRIVES["sinusoid"], 3.0), rel=2e-3)


def test_a_joint_geared_to_a_drive_rubs_as_well():
    """No single row acts on the joint alone, but the constraints together prescribe its motion."""
    model = double_pendulum()
    scene = pn.Scene(
        model,
        constraints=[
            pn.PrescribedMotion("driven", pn.sinusoid(0.4, 3.0)),
            pn.JointCoupling("free", "driven", -2.0),
        ],
        laws=[pn.JointFriction("free", coulomb=LIMIT, name="rub")],
    )
    run = pn.simulate(scene, 3.0, rtol=1e-9, record="energy")
    assert run.energy["rub"][-1] == pytest.approx(-2.0 * LIMIT * covered(DRIVES["sinusoid"], 3.0), abs=1e-7)
    assert [e.kind for e in run.events] == ["reverse"] * 3


def test_solve_at_the_turn():
    """At rest under a drive that accelerates, friction opposes the motion to come."""
    drive = pn.PrescribedMotion("driven", pn.polynomial([0.0, 0.0, -1.0]), name="drive")
    law = pn.JointFriction("driven", coulomb=LIMIT)
    rough = pn.Scene(double_pendulum(), constraints=[drive], laws=[law])
    smooth = pn.Scene(double_pendulum(), constraints=[drive])
    zero = np.zeros(2)
    s, plain = rough.solve(zero, zero), smooth.solve(zero, zero)
    assert s.modes.tolist() == [-1]
    np.testing.assert_allclose(s.a, plain.a, rtol=1e-12)
    assert s.lam[0] == pytest.approx(plain.lam[0] - LIMIT, rel=1e-12)
