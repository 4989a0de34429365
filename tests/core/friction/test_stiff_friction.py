"""Stiff scenes with dry friction: SciPy's methods stick and slip at located events, as the core's own do."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.driven_slider import DrivenSlider

from ...support.mechanisms import body, empty

METHODS = ["Radau", "BDF", "LSODA"]
# Error of the end and of events over five seconds, at a tolerance of 1e-9.
REACHED = {"Radau": 1e-8, "BDF": 1e-6, "LSODA": 1e-6}


def slider(viscous, limit, ratio, frequency):
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "rail", 1.0)
    law = pn.JointFriction("rail", coulomb=limit, static_ratio=ratio, viscous=viscous)
    return pn.Scene(model, laws=[law], actuation=lambda t, q, v: [np.sin(frequency * t)])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("viscous", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("ratio", [1.0, 1.15])
def test_a_driven_slider(method, viscous, ratio):
    """Events and speeds of the closed form; speeds of 1/viscous are resolved to a millionth."""
    limit, frequency, duration = 0.3, 6.0, 2.0
    exact = DrivenSlider(1.0, 1.0, frequency, viscous, limit, ratio)
    tolerance = 1e-8 / viscous
    run = pn.simulate(
        slider(viscous, limit, ratio, frequency), duration, method=method, rtol=1e-9, atol=tolerance
    )
    expected = exact.events(duration)
    assert [event.kind for event in run.events] == [kind for _, kind in expected]
    times = [time for time, _ in expected]
    np.testing.assert_allclose([event.time for event in run.events], times, atol=1e-6)
    middle = 0.5 * (times[2] + times[3])  # middle of the second slip, in the opposite direction
    k = int(np.argmin(np.abs(run.t - middle)))
    speed = exact.speed(run.t[k], times[2], -1)
    assert run.v[k, 0] == pytest.approx(speed, abs=1e-6 / viscous)
    sticks = (run.modes[:, 0] == 0) & (run.t > times[1]) & (run.t < times[2])
    assert sticks.any()
    assert (run.v[sticks] == 0.0).all()


def chain(viscous, gravity=9.81):
    """Rods in a row with friction that depends on the load of each hinge."""
    model, joint = empty(gravity=(0.0, 0.0, -gravity)), 0
    for k in range(len(viscous)):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5 if k else 0.0]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, f"j{k}")
        rod = pin.Inertia(1.0, np.array([0.0, 0.0, -0.25]), 0.02 * np.eye(3))
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    laws = [
        pn.JointFriction(f"j{k}", mu=0.2, radius=0.05, coulomb=0.1, viscous=c, static_ratio=1.2)
        for k, c in enumerate(viscous)
    ]
    return pn.Scene(model, laws=laws, q0=np.linspace(1.4, 0.6, len(viscous)))


def linkage():
    four_bar = pn.load("four_bar")
    names = four_bar.model.names
    laws = [
        pn.JointFriction(names[1], coulomb=0.3, static_ratio=1.2, viscous=0.1),
        pn.JointFriction(names[2], mu=0.1, radius=0.03, static_ratio=1.1, viscous=20.0),
    ]
    return pn.Scene(
        four_bar.model,
        constraints=four_bar.constraints,
        laws=laws,
        actuation=lambda t, q, v: [8.0 * np.sin(3.0 * t), 0.0, 0.0],
        q0=four_bar.q0,
        v0=four_bar.v0,
    )


def sledge():
    """A body that slides and turns on three feet, braked at one of them."""
    model = empty()
    sledge = body(model, 0, pin.JointModelFreeFlyer(), "sledge", 2.0, inertia=0.05 * np.eye(3))
    for k, place in enumerate([(0.2, 0.1, -0.1), (-0.2, 0.1, -0.1), (0.0, -0.2, -0.1)]):
        frame = pin.Frame(f"f{k}", sledge, 0, pin.SE3(np.eye(3), np.array(place)), pin.FrameType.OP_FRAME)
        model.addFrame(frame)
    q0 = pin.neutral(model)
    q0[2] = 0.1
    contacts = [pn.PointContact(f"f{k}", mu=0.3, static_ratio=1.1, unilateral=False) for k in range(3)]
    brake = pn.Drag("f0", 50.0, 1.0)
    return pn.Scene(model, contacts=contacts, q0=q0, v0=[1.0, 0.3, 0.0, 0.0, 0.0, 2.0], laws=[brake])


SCENES = {"chain": lambda: chain([0.01, 0.02]), "stiff chain": lambda: chain([0.01, 100.0]), "loop": linkage}


# The loop takes seconds.
ANSWERED = [
    pytest.param(name, method, marks=[pytest.mark.slow] * (name == "loop"))
    for name in (*SCENES, "sledge")
    for method in METHODS
]


@pytest.mark.parametrize(("name", "method"), ANSWERED)
def test_the_answer_of_dop853(method, name):
    scene = sledge() if name == "sledge" else SCENES[name]()
    options = {"output_dt": 0.25, "record": "energy"}
    reference = pn.simulate(scene, 5.0, rtol=1e-11, atol=1e-12, **options)
    run = pn.simulate(scene, 5.0, method=method, rtol=1e-9, atol=1e-11, **options)
    kinds = [(event.kind, event.element) for event in run.events]
    assert kinds == [(event.kind, event.element) for event in reference.events]
    assert len(kinds) > 2
    times = [event.time for event in reference.events]
    np.testing.assert_allclose([event.time for event in run.events], times, atol=1e-6)
    np.testing.assert_allclose(run.q[-1], reference.q[-1], atol=10.0 * REACHED[method])
    np.testing.assert_array_equal(run.modes[-1], reference.modes[-1])
    scale = np.abs(reference.energy["total"]).max() + 1.0
    assert np.abs(run.energy["balance"]).max() < 10.0 * REACHED[method] * scale
    if name == "stiff chain":
        explicit = pn.simulate(scene, 5.0, rtol=1e-9, atol=1e-11, **options)
        assert run.stats.evaluations < explicit.stats.evaluations
    assert run.violation.max() < 1e-12


def test_one_thread_of_blas():
    """Factors of small matrices are computed in one thread, since threads would wait for each other."""
    threadpoolctl = pytest.importorskip("threadpoolctl")
    seen = []

    def torque(t, q, v):
        pools = [pool for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]
        seen.append({pool["num_threads"] for pool in pools})
        return [0.0]

    model = empty()
    body(model, 0, pin.JointModelRY(), "j", 1.0, lever=(0.5, 0.0, 0.0))
    before = threadpoolctl.threadpool_info()
    pn.simulate(pn.Scene(model, actuation=torque, v0=[1.0]), 0.1, method="Radau")
    assert all(threads == {1} for threads in seen[-5:])
    assert threadpoolctl.threadpool_info() == before
