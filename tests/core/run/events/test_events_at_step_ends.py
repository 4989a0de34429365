"""Events where a step ends by itself: at the instant of a sampled control, some spacings of time about it.

The control gives no torque, so that the motion is the one without it, whose events lie inside steps.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.mechanisms import GRAVITY, TIGHT, body, empty, planar, point_mass

STATE = 1e-9


def slides_on_a_plane():
    """A point mass with two directions of slip."""
    scene = {"contacts": [pn.PointContact("mass", mu=0.3)], "v0": [1.0, 0.7, 0.0]}
    return point_mass(), scene


def slides_on_a_line():
    model = point_mass("X", gravity=(0.0, 0.0, 0.0))
    return model, {"laws": [pn.JointFriction("x", coulomb=2.0)], "v0": [1.0]}


def slides_to_rolling():
    model = planar(2.0, 0.4 * 2.0 * 0.01, [(0.0, 0.0)])
    return model, {
        "contacts": [pn.PointContact("c0", radius=0.1, mu=0.2)],
        "q0": [0.0, 0.1, 0.0],
        "v0": [1.0, 0.0, 2.0],
    }


def spins_in_a_ball_joint():
    model = empty((0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelSpherical(), "ball", 1.0, inertia=np.diag([0.1, 0.1, 0.1]))
    return model, {"laws": [pn.JointFriction("ball", coulomb=0.5)], "v0": [1.0, 2.0, -1.0]}


def turns_back():
    """A block that slides up a steep slope rests for an instant only, and slides back."""
    model = point_mass("X", gravity=(-8.0, 0.0, 0.0))
    return model, {"laws": [pn.JointFriction("x", coulomb=2.0)], "v0": [1.5]}


def falls():
    model = point_mass("Z")
    return model, {"contacts": [pn.PointContact("mass", restitution=0.6)], "q0": [0.3]}


def gives_way():
    """Return a sticking body under a growing force."""
    model = point_mass("X", gravity=(0.0, 0.0, 0.0))
    push = pn.Wrench("mass", lambda t: [3.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0])
    return model, {"laws": [pn.JointFriction("x", coulomb=2.0)], "forces": [push]}


def is_lifted():
    model = point_mass("Z")
    push = pn.Wrench("mass", lambda t: [0.0, 0.0, 2.0 * GRAVITY * t, 0.0, 0.0, 0.0])
    return model, {"contacts": [pn.PointContact("mass")], "forces": [push]}


SCENES = (
    slides_on_a_plane,
    slides_on_a_line,
    slides_to_rolling,
    spins_in_a_ball_joint,
    turns_back,
    falls,
    gives_way,
    is_lifted,
)


def slow(value):
    return pytest.param(value, marks=pytest.mark.slow)


def no_torque(nv):
    return lambda t, q, v: np.zeros(nv)


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4"])
@pytest.mark.parametrize("spacings", [slow(-3), -1, 0, 1, slow(3)])
@pytest.mark.parametrize("periods", [1, slow(2), 3])
@pytest.mark.parametrize("make", SCENES, ids=lambda make: make.__name__)
def test_a_step_that_ends_at_an_event(make, periods, spacings, method):
    model, parts = make()
    alone = pn.Scene(model, **parts)
    more = {"dt": 1e-3} if method == "rk4" else TIGHT
    whole = pn.simulate(alone, 3.0, method=method, **more)
    instant = whole.events[0].time
    period = instant / periods
    for _ in range(abs(spacings)):
        period = np.nextafter(period, np.copysign(np.inf, spacings))
    control = pn.SampledControl(no_torque(model.nv), period=period)
    scene = pn.Scene(model, actuation=control, **parts)
    ends = 1.4 * instant
    run = pn.simulate(scene, ends, method=method, **more)
    other = pn.simulate(alone, ends, method=method, **more)
    tolerance = STATE if method != "rk4" else 1e-6
    assert [event.kind for event in run.events] == [event.kind for event in other.events]
    assert [event.time for event in run.events] == pytest.approx(
        [event.time for event in other.events], abs=tolerance
    )
    assert run.q[-1] == pytest.approx(other.q[-1], abs=tolerance)
    assert run.v[-1] == pytest.approx(other.v[-1], abs=tolerance)
