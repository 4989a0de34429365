"""Implicit springs, dampers and position control of semi-implicit Euler steps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

DT = 1e-3
INERTIA = 0.05  # smallest inertia that a joint of the double pendulum moves [kg m^2]
TARGET = np.array([0.3, 0.2])


def double_pendulum() -> pin.Model:
    model = pin.Model()
    joint = 0
    for name, height in (("upper", 0.0), ("lower", -1.0)):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, name)
        center = np.array([0.0, 0.0, -0.5])
        model.appendBodyToJoint(joint, pin.Inertia(1.0, center, 0.01 * np.eye(3)), pin.SE3.Identity())
    return model


@pytest.mark.parametrize("times", [10.0, 1e3, 1e6])
def test_gains_above_the_explicit_limit_hold_their_position(times: float) -> None:
    kp = times * 4.0 * INERTIA / DT**2
    drive = pn.actuation.HoldPosition(kp=kp, kd=2.0 * np.sqrt(kp * INERTIA), q=TARGET)
    scene = pn.Scene(double_pendulum(), actuation=drive, q0=[1.0, -0.5])
    run = pn.simulate(scene, 2.0, method="semi_implicit_euler", dt=DT)
    assert np.abs(run.v).max() < 10.0 / DT
    assert run.v[-1] == pytest.approx([0.0, 0.0], abs=1e-9)
    gravity = pin.computeGeneralizedGravity(scene.model, scene.model.createData(), run.q[-1])
    assert run.q[-1] == pytest.approx(TARGET - gravity / kp, abs=1e-9)


@pytest.mark.parametrize(
    "part",
    [
        {"actuation": pn.actuation.HoldPosition(kp=30.0, kd=3.0, q=TARGET)},
        {"forces": [pn.JointSpring("upper", 20.0, damping=1.0)]},
        {"laws": [pn.LuGre("lower", stiffness=1e3, damping=10.0, coulomb=0.3)]},
        {"laws": [pn.SigmoidFriction("lower", phi1=1.0, phi2=20.0, phi3=0.05)]},
    ],
    ids=["position control", "spring", "bristles", "sigmoid"],
)
def test_steps_are_at_least_of_first_order(part: dict) -> None:
    scene = pn.Scene(double_pendulum(), q0=[1.0, -0.5], **part)
    exact = pn.simulate(scene, 0.5, method="Radau", rtol=1e-10, atol=1e-12).q[-1]
    coarse, fine = (
        np.abs(pn.simulate(scene, 0.5, method="semi_implicit_euler", dt=dt).q[-1] - exact).max()
        for dt in (DT, DT / 8)
    )
    assert coarse / fine > 6.8


def test_stiff_bristles_take_steps_of_a_millisecond() -> None:
    law = pn.LuGre("upper", stiffness=1e6, damping=1e3, coulomb=0.3)
    scene = pn.Scene(double_pendulum(), laws=[law], q0=[1.0, -0.5])
    exact = pn.simulate(scene, 1.0, method="Radau", rtol=1e-8)
    run = pn.simulate(scene, 1.0, method="semi_implicit_euler", dt=DT)
    assert run.q[-1] == pytest.approx(exact.q[-1], abs=2e-2)


@pytest.mark.parametrize("method", ["semi_implicit_euler", "moreau"])
@pytest.mark.parametrize(("stiffness", "damping"), [(1e5, 10.0), (1e6, 10.0), (1e8, 1e4)])
def test_stiff_bristles_hold_a_load_at_rest(stiffness: float, damping: float, method: str) -> None:
    law = pn.LuGre("upper", stiffness=stiffness, damping=damping, coulomb=0.9)
    scene = pn.Scene(double_pendulum(), laws=[law, pn.JointFriction("lower", viscous=1.0)], q0=[0.02, -0.02])
    run = pn.simulate(scene, 2.0, method=method, dt=DT)
    assert abs(run.v[-1, 0]) < 1e-6
    assert run.q[-1, 0] == pytest.approx(0.02, abs=1e-4)


@pytest.mark.parametrize("coefficient", [0.0, 1e-300])
def test_laws_of_nothing_change_no_step_before_an_event(coefficient: float) -> None:
    scene = pn.load("rough_four_bar")
    joint = scene.model.names[-1]
    law = pn.SigmoidFriction(joint, coefficient, 1.0)
    more = scene.replace(laws=[*scene.laws, law])
    options = {"method": "semi_implicit_euler", "dt": 1e-3}
    run, again = (pn.simulate(one, 0.5, **options) for one in (scene, more))
    assert len(run.events) > 2
    np.testing.assert_allclose(again.q, run.q, rtol=0, atol=1e-11)
