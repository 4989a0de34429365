"""User functions are checked near the start of runs only, and wrong derivatives end the first run."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import body, empty
from ..support.refusals import refuses

NEAR = 0.6  # distance of calls from the unit circle, including search steps and probes


def plane():
    model = empty(gravity=(0.0, 0.0, 0.0))
    slide = body(model, 0, pin.JointModelPX(), "x", 0.0)
    body(model, slide, pin.JointModelPY(), "y", 1.0)
    return model


class Circle:
    """Constraint x^2 + y^2 = 1 as a distance, which is singular at the center; records its calls."""

    def __init__(self, bias=1.0):
        self.bias, self.called = bias, []

    def distance(self, q):
        self.called.append(np.array(q))
        r = float(np.hypot(*q))
        if r < 0.1:
            raise ZeroDivisionError("no direction")
        return r

    def residual(self, t, q):
        return np.array([self.distance(q) - 1.0])

    def rows(self, t, q, v, data=None):
        r = self.distance(q)
        e = q / r
        return e[None], np.array([self.bias * -(v @ v - (e @ v) ** 2) / r])

    def directions(self, t, q):
        e = q / self.distance(q)
        return np.array([[-e[1], e[0]]])


START = {"q": [1.0, 0.0], "v": [0.0, 1.0]}
WRONG = "d rate/dt must equal A a - b; row 0:"


def constraint(circle):
    return {"constraints": [pn.UserConstraint(circle.rows, 1, residual=circle.residual, name="circle")]}


def contact(circle):
    return {"contacts": [pn.UserContact(circle.rows, circle.residual, name="circle")]}


def rubbing_contact(circle):
    made = pn.UserContact(circle.rows, circle.residual, directions=circle.directions, mu=0.3, name="circle")
    return {"contacts": [made]}


def friction(circle):
    law = pn.UserFriction(
        lambda t, q: circle.directions(t, q)[0], lambda t, q, v, r: 0.1 / circle.distance(q)
    )
    return {"laws": [law]}


def force(circle):
    return {"forces": [pn.UserForce(lambda t, q, v: -q / circle.distance(q) ** 3)]}


def drive(circle):
    return {"actuation": lambda t, q, v: -q / circle.distance(q) ** 3}


@pytest.mark.parametrize("what", [constraint, contact, friction, force, drive])
def test_a_scene_without_a_start_calls_nothing(what):
    circle = Circle()
    scene = pn.Scene(plane(), **what(circle))
    assert circle.called == []
    run = pn.simulate(scene, 0.3, **START)
    assert run.t[-1] == 0.3
    assert np.isfinite(run.q).all()
    assert all(abs(np.hypot(*q) - 1.0) < NEAR for q in circle.called)


def test_how_many_directions_a_contact_rubs_along_is_asked_where_they_are():
    circle = Circle()
    scene = pn.Scene(plane(), **rubbing_contact(circle))
    assert pn.simulate(scene, 0.3, **START).t[-1] == 0.3
    circle = Circle()
    pn.Scene(plane(), **rubbing_contact(circle), q0=[1.0, 0.0])
    assert all(abs(np.hypot(*q) - 1.0) < NEAR for q in circle.called)


@pytest.mark.parametrize("what", [constraint, contact, friction, force, drive])
def test_a_start_that_is_given_is_where_they_are_called(what):
    circle = Circle()
    scene = pn.Scene(plane(), **what(circle), q0=[0.0, 1.0], v0=[1.0, 0.0])
    assert pn.simulate(scene, 0.3).t[-1] == 0.3
    assert all(abs(np.hypot(*q) - 1.0) < NEAR for q in circle.called)


def test_a_circle_is_followed():
    run = pn.simulate(pn.Scene(plane(), **constraint(Circle())), 1.0, **START)
    np.testing.assert_allclose(run.q[-1], [np.cos(1.0), np.sin(1.0)], rtol=0.0, atol=1e-8)


FIRST = {
    "simulate": lambda s: pn.simulate(s, 1.0, **START),
    "project": lambda s: s.project(**START),
    "solve": lambda s: s.solve(**START),
    "acceleration": lambda s: s.acceleration(np.array(START["q"]), np.array(START["v"])),
    "step": lambda s: s.step(np.array(START["q"]), np.array(START["v"]), None, 0.01),
    "stepper": lambda s: s.stepper(0.1, **START),
    "rollout": lambda s: pn.rollout(s, np.array([START["q"]]), np.array([START["v"]]), 0.1),
    "BDF": lambda s: pn.simulate(s, 1.0, **START, method="BDF"),
}


@pytest.mark.parametrize("first", list(FIRST))
def test_wrong_derivatives_end_the_first_call(first):
    scene = pn.Scene(plane(), **constraint(Circle(bias=1.5)))
    with refuses(f'UserConstraint "circle": {WRONG}', pn.InputError):
        FIRST[first](scene)


@pytest.mark.parametrize("what", [constraint, contact])
def test_wrong_derivatives_end_a_scene_with_a_start(what):
    with refuses(WRONG, pn.InputError):
        pn.Scene(plane(), **what(Circle(bias=1.5)), q0=[1.0, 0.0])


def test_a_drive_may_end_before_any_instant_but_those_of_the_run():
    """A function of time is defined for the 0.1 s of the run only."""

    def pulse(t):
        if not -1e-3 <= t <= 0.101:
            raise ValueError("after the pulse")
        return 0.1 * t**2, 0.2 * t, 0.2

    scene = pn.Scene(plane(), constraints=[pn.PrescribedMotion("x", pulse)])
    run = pn.simulate(scene, 0.1)
    assert run.q[-1, 0] == pytest.approx(1e-3, abs=1e-10)
