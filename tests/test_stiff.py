"""SciPy's implicit methods on the core's right-hand side."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

# Global error over a second of motion at rtol 1e-8: multistep methods lose more of it than Radau.
REACHED = {"Radau": 1e-7, "BDF": 1e-4, "LSODA": 1e-4}


def bare(name):
    scene = pn.load(name)
    return pn.Scene(scene.model, constraints=scene.constraints, q0=scene.q0, v0=scene.v0)


@pytest.mark.parametrize("method", REACHED)
def test_agrees_with_the_core(method):
    scene = bare("four_bar")
    reference = pn.simulate(scene, 1.0, rtol=1e-12, atol=1e-13)
    run = pn.simulate(scene, 1.0, method=method, rtol=1e-8, atol=1e-9, output_dt=0.25, record=("a", "forces"))
    np.testing.assert_allclose(run.t, [0.0, 0.25, 0.5, 0.75, 1.0])
    assert np.abs(run.q[-1] - reference.q[-1]).max() < REACHED[method]
    assert run.violation.max() < 1e-12
    assert run.a.shape == run.F_ideal.shape == run.v.shape
    assert run.lam.shape == (5, 2)


def test_a_floating_base_keeps_unit_quaternions():
    scene = pn.load("solo12_standing")
    run = pn.simulate(scene, 0.05, method="Radau", rtol=1e-6)
    reference = pn.simulate(scene, 0.05)
    np.testing.assert_allclose(np.linalg.norm(run.q[:, 3:7], axis=1), 1.0, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(run.q[-1], reference.q[-1], rtol=0.0, atol=1e-7)


def test_stiff_viscous_friction_costs_few_steps():
    """v' = -1e7 v + 1: an explicit method needs steps of 1e-7 s, an implicit one does not."""
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = pn.Scene(model, laws=[pn.JointFriction("slide", viscous=1e7)], actuation=lambda t, q, v: [1.0])
    run = pn.simulate(scene, 1.0, method="Radau")
    assert run.stats.steps < 500
    assert abs(run.v[-1, 0] - 1e-7) < 1e-12


def test_what_only_the_core_does_is_refused():
    scene = bare("four_bar")
    message = 'simulate: record "energy" needs one of the core\'s methods; got Radau'
    with pytest.raises(pn.InputError, match=f"^{re.escape(message)}$"):
        pn.simulate(scene, 1.0, method="Radau", record="energy")


def test_a_failing_function_keeps_the_trajectory():
    model = pn.load("panda_friction").model

    def torque(t, q, v):
        if t > 0.02:
            raise ValueError("no more torque")
        return 0.0 * v

    scene = pn.Scene(model, actuation=torque)
    with pytest.raises(pn.UserFunctionError, match="no more torque") as caught:
        pn.simulate(scene, 0.1, method="BDF")
    assert caught.value.trajectory.t[-1] <= 0.02
    assert len(caught.value.trajectory) >= 1
