"""Gaps as user functions, against the package's contacts and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import pin_nonideal as pn

from ....support.mechanisms import GRAVITY, TIGHT, point_mass

TIME = 1e-9


def events(run, *kinds):
    return [(e.kind, e.element, e.time) for e in run.events if not kinds or e.kind in kinds]


def on_floor(**more):
    """Return the plane z = 0 under a point mass on three sliding joints."""
    return pn.UserContact(
        lambda t, q, v, data: ([[0.0, 0.0, 1.0]], [0.0]),
        gap=lambda t, q: q[2],
        directions=lambda t, q: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        name="floor",
        **more,
    )


@pytest.mark.parametrize("impact", ["newton", "poisson"])
def test_a_plane_is_a_point_contact(impact):
    """An oblique throw bounces, slips and sticks at the same times and positions."""
    start = {"q0": [0.0, 0.0, 0.5], "v0": [1.0, -0.7, 0.3]}
    numbers = {"mu": 0.3, "restitution": 0.6, "static_ratio": 1.2}
    own, known = (
        pn.simulate(
            pn.Scene(point_mass("XYZ"), contacts=[contact], impact=impact, **start),
            4.0,
            record="energy",
            **TIGHT,
        )
        for contact in (on_floor(**numbers), pn.PointContact("mass", name="floor", **numbers))
    )
    mine, theirs = events(own), events(known)
    assert [e[:2] for e in mine] == [e[:2] for e in theirs]
    assert [e[2] for e in mine] == pytest.approx([e[2] for e in theirs], abs=TIME)
    assert own.q[-1] == pytest.approx(known.q[-1], abs=1e-7)
    assert np.abs(own.energy["balance"]).max() < 1e-9
    first, other = (next(e for e in run.events if e.kind == "impact") for run in (own, known))
    assert first.impulse == pytest.approx(other.impulse, abs=1e-10)


def hill(mu=0.0):
    """Return a circle of 1 m in the x-z plane, about the origin."""

    def rows(t, q, v, data):
        r = np.hypot(*q)
        n = q / r
        u = v - (n @ v) * n
        return [n], [-(u @ u) / r]

    return pn.UserContact(
        rows,
        gap=lambda t, q: np.hypot(*q) - 1.0,
        directions=lambda t, q: [[q[1] / np.hypot(*q), -q[0] / np.hypot(*q)]],
        mu=mu,
        name="hill",
    )


def test_leaves_a_hill_at_two_thirds():
    start, run = 0.2, None
    speed = np.sqrt(2.0 * GRAVITY * (1.0 - np.cos(start)))
    q0, v0 = [np.sin(start), np.cos(start)], [speed * np.cos(start), -speed * np.sin(start)]
    run = pn.simulate(
        pn.Scene(point_mass("XZ"), contacts=[hill()], q0=q0, v0=v0), 1.0, rtol=1e-11, atol=1e-12
    )
    (leaves,) = [e for e in run.events if e.kind == "lift_off"]
    at = np.argmin(np.abs(run.t - leaves.time))
    assert run.q[at, 1] == pytest.approx(2.0 / 3.0, abs=1e-8)


@pytest.mark.parametrize("side", [-1e-9, 1e-9])
def test_sticks_on_a_hill_up_to_the_angle_of_friction(side):
    angle = np.arctan(0.4) + side
    scene = pn.Scene(point_mass("XZ"), contacts=[hill(0.4)], q0=[np.sin(angle), np.cos(angle)])
    now = scene.solve(scene.q0, scene.v0)
    assert now.modes.tolist() == [0 if side < 0.0 else 1]
    assert now.lam == pytest.approx([GRAVITY * np.cos(angle)], abs=1e-9)


def test_a_table_that_moves():
    """A ball falls on an oscillating table: the first impact time is a root, with Newton's law there."""
    amplitude, omega, e = 0.1, 8.0, 0.4
    contact = pn.UserContact(
        lambda t, q, v, data: ([[1.0]], [-amplitude * omega**2 * np.sin(omega * t)]),
        gap=lambda t, q: q[0] - amplitude * np.sin(omega * t),
        restitution=e,
        name="table",
    )
    run = pn.simulate(pn.Scene(point_mass("Z"), contacts=[contact], q0=[1.0]), 2.0, record="energy", **TIGHT)
    first = next(event for event in run.events if event.kind == "impact")
    time = brentq(lambda t: 1.0 - 0.5 * GRAVITY * t * t - amplitude * np.sin(omega * t), 0.2, 0.5, xtol=1e-14)
    assert first.time == pytest.approx(time, abs=TIME)
    table = amplitude * omega * np.cos(omega * time)
    assert first.v_plus[0] - table == pytest.approx(-e * (first.v_minus[0] - table), abs=1e-7)
    assert (run.q[:, 0] - amplitude * np.sin(omega * run.t)).min() > -1e-10
    assert np.abs(run.energy["balance"]).max() < 1e-8


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pn.UserContact(1, lambda t, q: 0.0), "UserContact: function must be a function"),
        (
            lambda: pn.UserContact(lambda *_: 0, lambda t, q: 0.0, mu=0.1),
            "UserContact: friction needs directions of slip; give directions, or leave mu out",
        ),
        (
            lambda: pn.Scene(
                point_mass("Z"),
                contacts=[pn.UserContact(lambda *_: ([[1.0]], [0.0]), lambda t, q: 2.0 * q[0], name="own")],
            ),
            'UserContact "own": d gap/dt must equal rate',
        ),
        (
            lambda: pn.Scene(
                point_mass("Z"),
                contacts=[
                    pn.UserContact(
                        lambda *_: ([[1.0]], [0.0]),
                        lambda t, q: q[0],
                        lambda t, q, v: v[0] * v[0],
                        name="own",
                    )
                ],
            ),
            'UserContact "own": d gap/dt must equal rate',
        ),
        (
            lambda: pn.Scene(
                point_mass("Z"),
                contacts=[pn.UserContact(lambda *_: ([[1.0]], [3.0]), lambda t, q: q[0], name="own")],
            ),
            'UserContact "own": d rate/dt must equal A a - b',
        ),
        (
            lambda: pn.Scene(
                point_mass("Z"),
                contacts=[
                    pn.UserContact(
                        lambda *_: ([[1.0]], [0.0]),
                        lambda t, q: q[0],
                        directions=lambda t, q: [1.0],
                        mu=0.2,
                        name="own",
                    )
                ],
            ),
            'UserContact "own": directions must return one or two rows of 1 numbers each; got shape (1,)',
        ),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(pn.InputError) as error:
        make().project()
    assert message in str(error.value)
