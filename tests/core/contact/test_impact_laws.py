"""Newton's and Poisson's laws of restitution, against enumeration of all modes and closed forms."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.impacts import velocities_after

from ...support.mechanisms import GRAVITY, body, empty, frame, planar
from ...support.same_run import assert_same_run
from ...support.seeds import seeds

ROUNDING = 1e-11


def struck(corners, inertia, v, mu, e, law, mass=1.0):
    """Return the impact events at t = 0 of corners that lie on the floor."""
    model = planar(mass, inertia, corners, (0.0, 0.0, 0.0))
    for k in range(len(corners)):
        frame(model, f"floor {k}", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, corners[k][1]])))
    contacts = [
        pn.PointContact(f"c{k}", plane=f"floor {k}", mu=mu[k], restitution=e[k]) for k in range(len(corners))
    ]
    scene = pn.Scene(model, contacts=contacts, impact=law)
    run = pn.simulate(scene, 1e-9, v=v, record="energy")
    return run, [event for event in run.events if event.kind == "impact"]


def rows(corners):
    """Return normal and tangent rows of each corner for (x, z, rotation about y)."""
    return np.array([row for x, z in corners for row in ([0.0, 1.0, -x], [1.0, 0.0, z])])


@pytest.mark.parametrize("law", ["newton", "poisson"])
@pytest.mark.parametrize("seed", seeds(range(25)))
def test_random_impacts(law, seed):
    """One or two corners collide at once; the enumeration gives all solutions."""
    rng = np.random.default_rng(seed)
    count = 1 + seed % 2
    corners = [(x, z) for x, z in rng.uniform(-1.0, 1.0, (count, 2)) - [0.0, 1.2]]
    inertia, v = rng.uniform(0.02, 0.5), rng.normal(size=3)
    v[1] = -abs(v[1]) - np.abs(v[2])
    mu, e = rng.uniform(0.0, 0.8, count), rng.uniform(0.0, 1.0, count)
    A, M = rows(corners), np.diag([1.0, 1.0, inertia])
    known = velocities_after(A @ np.linalg.solve(M, A.T), A @ v, mu, e, law)
    _, impacts = struck(corners, inertia, v, mu, e, law)
    after = A @ impacts[0].v_plus
    assert min(np.abs(after - each).max() for each in known) < ROUNDING * 10.0


def test_poisson_in_closed_form():
    """A rod's end slides forward through both phases; the impulse is (1 + e) times that of compression."""
    half, angle, mu, e = 0.5, np.deg2rad(60.0), 0.2, 0.6
    x, z = -half * np.cos(angle), -half * np.sin(angle)
    inertia, v = half**2 / 3.0, np.array([4.0, -1.0, 0.0])
    _, (impact,) = struck([(x, z)], inertia, v, [mu], [e], "poisson")
    normal = 1.0 + x * x / inertia + mu * x * z / inertia  # change of u_n by unit P_n with P_t = -mu P_n
    P = (1.0 + e) / normal
    assert impact.impulse == pytest.approx([P, -mu * P, 0.0], abs=ROUNDING)
    assert impact.energy_change == pytest.approx(
        0.5 * (impact.v_plus @ (impact.v_plus * [1.0, 1.0, inertia]) - 17.0), abs=ROUNDING
    )


@pytest.mark.parametrize("seed", range(10))
def test_without_friction_both_laws_agree(seed):
    """Three approaching corners have the same e."""
    rng = np.random.default_rng(100 + seed)
    corners = [(x, -1.0) for x in rng.uniform(-1.0, 1.0, 3)]
    v = np.array([0.3, -1.5, rng.uniform(-1.0, 1.0)])
    e = rng.uniform(0.0, 1.0)
    after = [struck(corners, 0.2, v, [0.0] * 3, [e] * 3, law)[1][0].v_plus for law in ("newton", "poisson")]
    assert after[0] == pytest.approx(after[1], abs=ROUNDING)


class TestKane:
    """A double pendulum strikes a rough floor: energy grows by Newton's law, not by Poisson's.

    After Kane and Levinson, Dynamics: Theory and Applications, 1985, problem 5.
    """

    Q, V, MU, E = (0.30828222, -0.07642873), (-1.50345131, -0.73129222), 0.39206371686085, 0.98483341395302

    def run(self, law, **more):
        model = empty()
        thin = {"lever": (0.0, 0.0, -0.5), "inertia": np.eye(3) / 12.0}
        down = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
        joint = body(model, 0, pin.JointModelRY(), "upper", 1.0, **thin)
        joint = body(model, joint, pin.JointModelRY(), "lower", 1.0, place=down, **thin)
        frame(model, "tip", joint, down)
        height = -np.cos(self.Q[0]) - np.cos(sum(self.Q))
        frame(model, "floor", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, height])))
        contact = pn.PointContact("tip", plane="floor", mu=self.MU, restitution=self.E)
        scene = pn.Scene(model, contacts=[contact], q0=self.Q, v0=self.V, impact=law)
        return pn.simulate(scene, 1e-9, **more)

    def test_energy(self):
        (newton,), (poisson,) = (
            [e.energy_change for e in self.run(law).events if e.kind == "impact"]
            for law in ("newton", "poisson")
        )
        assert newton > 40.0
        assert poisson < -2.0

    def test_gains_are_errors_where_asked(self):
        self.run("poisson", strict=True)
        message = (
            'the impact at "PointContact(tip)" (the body of joint "lower" on the world) at t = 0 s gains'
        )
        with pytest.raises(pn.ImpactEnergyError, match=re.escape(message)):
            self.run("newton", strict=True)


@pytest.mark.parametrize("seed", seeds(range(20)))
def test_poisson_gains_no_energy(seed):
    """Three corners with different friction and restitution collide at once."""
    rng = np.random.default_rng(200 + seed)
    corners = [(x, z) for x, z in rng.uniform(-1.0, 1.0, (3, 2)) - [0.0, 1.2]]
    v = rng.normal(size=3)
    v[1] = -abs(v[1]) - np.abs(v[2])
    mu, e = rng.uniform(0.0, 0.5, 3), np.full(3, rng.uniform(0.0, 1.0))
    _, impacts = struck(corners, rng.uniform(0.1, 0.5), v, mu, e, "poisson")
    before, after = impacts[0].v_minus, impacts[0].v_plus
    assert sum(event.energy_change for event in impacts) < 1e-12
    assert after @ after > 0.0
    assert before == pytest.approx(v, abs=0.0)


def on_belt(law):
    """Return a block that bounces on a belt with prescribed motion, on an arm with a sticking joint."""
    model = empty()
    frame(model, "belt", body(model, 0, pin.JointModelPX(), "drive", 1.0))
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    joint = body(model, joint, pin.JointModelPZ(), "z", 0.5)
    joint = body(
        model, joint, pin.JointModelRY(), "arm", 1.0, lever=(0.2, 0.0, 0.0), inertia=0.01 * np.eye(3)
    )
    frame(model, "block", joint, pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])))
    return pn.Scene(
        model,
        constraints=[pn.PrescribedMotion("drive", pn.polynomial([0.0, 1.5]))],
        laws=[pn.JointFriction("arm", coulomb=8.0)],
        contacts=[pn.PointContact("block", plane="belt", mu=0.4, restitution=0.5)],
        q0=[0.0, 0.0, 0.5, 0.0],
        v0=[1.5, 0.0, 0.0, 0.0],
        impact=law,
    )


@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_energy_is_booked(law):
    """The energy ledger closes with a prescribed motion and a sticking joint, and for a pickled scene."""
    run = pn.simulate(on_belt(law), 1.0, record="energy")
    assert sum(event.kind == "impact" for event in run.events) > 2
    assert np.abs(run.energy["balance"]).max() < 1e-8
    assert all(event.energy_change < 0.0 for event in run.events if event.kind == "impact")
    assert_same_run(run, pn.simulate(on_belt(law), 1.0, record="energy"))


def test_unknown_law():
    with pytest.raises(pn.InputError, match="Scene: impact must be one of 'newton', 'poisson'; got 'hertz'"):
        pn.Scene(empty((0.0, 0.0, -GRAVITY)), impact="hertz")


def between_plates(law):
    """Return a point that leaves a floor under a ceiling that touches it."""
    model = empty()
    frame(model, "point", body(model, 0, pin.JointModelPZ(), "z", 1.0))
    contacts = [
        pn.PointContact("point", restitution=0.5, name="floor"),
        pn.PointContact("point", normal=(0.0, 0.0, -1.0), restitution=0.5, name="ceiling"),
    ]
    return pn.Scene(model, contacts=contacts, v0=[-1.0], impact=law)


def test_no_rebound_where_another_contact_is_in_the_way():
    message = (
        'the bodies at "floor" and "ceiling" (the body of joint "z" on the world) cannot separate with their '
        "restitution at t = 0.00 s: other constraints keep them from moving apart; lower restitution, "
        'or use Scene(..., impact="poisson")'
    )
    with pytest.raises(pn.InconsistentConstraintsError, match=re.escape(message)):
        pn.simulate(between_plates("newton"), 0.1)
    run = pn.simulate(between_plates("poisson"), 0.1)
    assert run.v[-1][0] == 0.0


@pytest.mark.parametrize("e", [0.5, 0.8, 1.0])
def test_struck_onto_a_plane_that_it_was_leaving(e):
    """A heavier mass strikes a mass 2e-12 m above the floor, which touches again within a picosecond."""
    model = empty((0.0, 0.0, 0.0))
    for name, mass in (("lower", 1.0), ("upper", 10.0)):
        frame(model, name, body(model, 0, pin.JointModelPZ(), f"{name} slide", mass))
    contacts = [
        pn.PointContact("lower", restitution=e, name="floor"),
        pn.SphereContact("upper", "lower", 0.1, name="between"),
    ]
    later = 2e-12
    q0, v0 = [1.0, 0.1 + later * e + 5.0 * (1.0 + later)], [-1.0, -5.0]
    run = pn.simulate(pn.Scene(model, contacts=contacts, q0=q0, v0=v0), 1.0 + 1e-6, record="energy")
    together = (e - 50.0) / 11.0
    first = [event for event in run.events if event.kind == "impact" and event.time > 1.0 - 1e-9]
    lost = sum(event.energy_change for event in first)
    assert np.abs(run.energy["balance"]).max() < ROUNDING * 125.5
    np.testing.assert_allclose(lost, run.energy["impacts"][-1], rtol=ROUNDING)
    if e > 0.5:  # else the rebound of the floor ends before it
        np.testing.assert_allclose(run.v[-1], [-e * together] * 2, rtol=ROUNDING)
