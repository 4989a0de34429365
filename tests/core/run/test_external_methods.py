"""SciPy's implicit methods on the core's right-hand side."""

from __future__ import annotations

import itertools
import os
import signal

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, NonFiniteError, RunInterrupted, StepSizeError, UserFunctionError

from ...support.refusals import refuses

METHODS = ["Radau", "BDF", "LSODA"]
# Global error over half a second at rtol 1e-8: multistep methods lose more of their tolerance than Radau.
REACHED = {"Radau": 1e-8, "BDF": 1e-5, "LSODA": 1e-5}
# Samples are projected by the core.
MET = 1e-12


def bare(name, **keywords):
    """A robot of the package without its laws and drives."""
    scene = pn.load(name)
    return pn.Scene(scene.model, constraints=scene.constraints, q0=scene.q0, v0=scene.v0, **keywords)


def slide(**keywords):
    """A mass of 1 kg on a prismatic joint, without gravity along it."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return pn.Scene(model, **keywords)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["four_bar", "rolling_disk", "solo12_standing"])
def test_agrees_with_the_core(method, name):
    scene = bare(name) if name == "four_bar" else pn.load(name)
    everything = {"record": ("a", "forces", "energy", "power"), "output_dt": 0.1}
    reference = pn.simulate(scene, 0.3, rtol=1e-11, atol=1e-12, **everything)
    run = pn.simulate(scene, 0.3, method=method, rtol=1e-8, atol=1e-9, **everything)
    np.testing.assert_allclose(run.t, reference.t, rtol=4e-16)
    size = np.abs(reference.v).max()
    for key in ("q", "v"):
        np.testing.assert_allclose(getattr(run, key), getattr(reference, key), atol=REACHED[method] * size)
    for key in ("a", "F_ideal", "lam"):
        expected = getattr(reference, key)
        scale = np.abs(expected).max() + np.abs(reference.a).max()
        np.testing.assert_allclose(getattr(run, key), expected, atol=10 * REACHED[method] * scale)
    assert run.violation.max() < MET
    assert run.violation_rate.max() < 10 * MET
    assert list(run.energy) == list(reference.energy)
    assert list(run.power) == list(reference.power)
    scale = np.abs(reference.energy["total"]).max()
    assert np.abs(run.energy["balance"]).max() < REACHED[method] * scale


def test_a_floating_base_keeps_unit_quaternions():
    run = pn.simulate(pn.load("solo12_standing"), 0.05, method="Radau", rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(run.q[:, 3:7], axis=1), 1.0, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("method", METHODS)
def test_stiff_viscous_friction_costs_few_steps(method):
    """v' = -1e7 v + 1: an explicit method needs steps of 1e-7 s, an implicit one does not."""
    scene = slide(laws=[pn.JointFriction("slide", viscous=1e7)], actuation=lambda t, q, v: [1.0])
    run = pn.simulate(scene, 1.0, method=method)
    assert run.stats.steps < 500
    assert run.v[-1, 0] == pytest.approx(1e-7, abs=1e-12)
    assert run.q[-1, 0] == pytest.approx(1e-7, rel=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_states_of_laws_are_integrated(method):
    """A Maxwell element, z' = v - z / tau, in series with the mass: a linear system with a closed form."""
    stiffness, tau = 4e4, 1e-3
    law = pn.UserLaw(
        lambda t, q, v, r, z: (-stiffness * z, v - z / tau), reaction=None, states=1, name="element"
    )
    run = pn.simulate(slide(laws=[law], v0=[1.0]), 0.1, method=method, output_dt=0.02, record="energy")
    matrix = np.array([[0.0, -stiffness], [1.0, -1.0 / tau]])
    values, vectors = np.linalg.eig(matrix)
    weights = np.linalg.solve(vectors, [1.0, 0.0])
    expected = np.real((vectors * weights) @ np.exp(np.outer(values, run.t)))
    np.testing.assert_allclose(run.v[:, 0], expected[0], atol=1e-5)
    np.testing.assert_allclose(run.z[:, 0], expected[1], atol=1e-5 / 200.0)
    assert np.abs(run.energy["balance"]).max() < 1e-5


@pytest.mark.parametrize("method", METHODS)
def test_an_angle_that_has_turned_many_times(method):
    """Differences of the right-hand side must not grow with the angle."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    rod = pin.Inertia(1.0, np.array([0.0, 0.0, -0.5]), 0.1 * np.eye(3))
    model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    law = pn.JointFriction("hinge", viscous=0.1)
    turned = 2.0 * np.pi * 1e6
    runs = [
        pn.simulate(pn.Scene(model, laws=[law]), 1.0, [start], [1.0], method=method, rtol=1e-6, atol=1e-7)
        for start in (1.0, 1.0 + turned)
    ]
    # An angle of 6e6 rad is known to 1e-9, and its relative tolerance is loose.
    assert runs[1].v[-1, 0] == pytest.approx(runs[0].v[-1, 0], abs=1e-3)
    assert runs[1].stats.evaluations < 3 * runs[0].stats.evaluations


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("t0", "duration", "output_dt"), [(0.0, 0.5, 0.125), (-1.3, 0.7, 0.3), (1e3, 0.2, 1.0)]
)
def test_output_grid_has_both_ends(method, t0, duration, output_dt):
    run = pn.simulate(slide(v0=[1.0]), duration, t0=t0, output_dt=output_dt, method=method)
    inside = [t0 + k * output_dt for k in range(int(np.ceil(duration / output_dt - 1e-9)))]
    np.testing.assert_allclose(run.t, [*inside, t0 + duration], rtol=4e-16)
    np.testing.assert_allclose(run.q[:, 0], run.t - t0, atol=1e-9)
    steps = pn.simulate(slide(v0=[1.0]), duration, t0=t0, method=method)
    assert len(steps) == steps.stats.steps + 1


def test_the_clock_of_functions_of_time():
    drive = pn.PrescribedMotion("slide", pn.sinusoid(0.3, 5.0))
    run = pn.simulate(slide(constraints=[drive]), 1.0, t0=0.4, method="Radau", output_dt=0.25)
    np.testing.assert_allclose(run.q[:, 0], 0.3 * np.sin(5.0 * run.t), atol=1e-12)


# --- Failing runs --------------------------------------------------------------------------------------


def test_sampled_control_is_refused():
    scene = slide(actuation=pn.SampledControl(lambda t, q, v: [1.0], 0.01))
    with refuses('simulate: SampledControl needs one of the core\'s methods; got "BDF"', InputError):
        pn.simulate(scene, 1.0, method="BDF")


@pytest.mark.parametrize("method", METHODS)
def test_a_failing_function_keeps_the_trajectory(method):
    def torque(t, q, v):
        if t > 0.02:
            raise ValueError("no more torque")
        return 0.0 * v

    scene = bare("four_bar", actuation=torque)
    with refuses("actuation raised ValueError: no more torque", UserFunctionError) as caught:
        pn.simulate(scene, 0.1, method=method, record="energy")
    run = caught.value.trajectory
    assert 0.0 < run.t[-1] <= 0.02
    assert run.violation.max() < MET
    assert caught.value.time == run.t[-1]
    assert isinstance(caught.value.__cause__, ValueError)


@pytest.mark.parametrize("method", ["Radau", "BDF"])
def test_a_motion_that_ends(method):
    """v' = v^3 reaches infinity at t = 0.5 s."""
    scene = slide(forces=[pn.UserForce(lambda t, q, v: v**3)], v0=[1.0])
    with pytest.raises((StepSizeError, NonFiniteError, UserFunctionError)) as caught:
        pn.simulate(scene, 1.0, method=method)
    run = caught.value.trajectory
    assert run.t[-1] == pytest.approx(0.5, abs=1e-3)
    assert np.isfinite(run.v).all()
    if isinstance(caught.value, StepSizeError):
        assert str(caught.value).startswith(f"{method} cannot continue at t = 0.")
        assert str(caught.value).endswith(
            "the motion is singular there; check the last samples, or loosen rtol and atol; the trajectory "
            "up to this time is in error.trajectory"
        )


@pytest.fixture
def interruptible():
    """Python's own answer to Ctrl-C: an event loop that a test left running has another one."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("calls", [300, 317, 1000])
def test_ctrl_c_keeps_what_was_computed(method, calls):
    counter = itertools.count()

    def torque(t, q, v):
        if next(counter) == calls:
            os.kill(os.getpid(), signal.SIGINT)
        return 0.0 * v

    with pytest.raises(RunInterrupted, match="the run was interrupted at t = ") as caught:
        pn.simulate(bare("four_bar", actuation=torque), 1e5, method=method, rtol=1e-9)
    assert len(caught.value.trajectory) > 2
    assert next(counter) < 2 * calls + 100  # the samples are evaluated once more
