"""Slip that reverses twice inside one step is an event, for all kinds of elements."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.coulomb_partner import Partner

from ....support.mechanisms import body, empty, frame

# Allowed error in tolerances.  The error between events is the tolerance of step control, and grows with the
# number of events.  A missed reversal is an error of at least 1e-3.
ALLOWED = 1e3
DURATION = 2.0


def rotor(model, drive):
    """Return a driven rotor about z, and its prescribed motion."""
    joint = body(model, 0, pin.JointModelRZ(), "rotor", 1.0, inertia=np.eye(3))
    return joint, [pn.PrescribedMotion("rotor", drive)]


def joint_between(drive, u, w, c):
    model = empty(gravity=(0.0, 0.0, 0.0))
    parent, driven = rotor(model, drive)
    body(model, parent, pin.JointModelRZ(), "body", 1.0, inertia=np.eye(3))
    laws = [pn.JointFriction("body", coulomb=c)]
    return pn.Scene(model, constraints=driven, laws=laws, v0=[u, w - u]), [1.0, 1.0]


def user_friction(drive, u, w, c):
    model = empty(gravity=(0.0, 0.0, 0.0))
    _, driven = rotor(model, drive)
    body(model, 0, pin.JointModelRZ(), "body", 1.0, inertia=np.eye(3))
    laws = [pn.UserFriction(lambda t, q: np.array([-1.0, 1.0]), lambda t, q, v, reactions: c)]
    return pn.Scene(model, constraints=driven, laws=laws, v0=[u, w]), [0.0, 1.0]


def hinge_anchor(drive, u, w, c):
    model = empty(gravity=(0.0, 0.0, 0.0))
    parent, driven = rotor(model, drive)
    flyer = body(model, 0, pin.JointModelFreeFlyer(), "body", 1.0, inertia=np.eye(3))
    frame(model, "a", flyer)
    frame(model, "b", parent)
    constraints = [*driven, pn.HingeAnchor("a", "b", axis="z", name="pin")]
    v0 = [u, 0.0, 0.0, 0.0, 0.0, 0.0, w]
    return pn.Scene(model, constraints=constraints, laws=[pn.JointFriction("pin", coulomb=c)], v0=v0), v0_of(
        6
    )


def contact(drive, u, w, c):
    model = empty(gravity=(0.0, 0.0, -10.0))
    plate = body(model, 0, pin.JointModelPX(), "rotor", 1.0)
    slide = body(model, 0, pin.JointModelPX(), "x", 0.0)
    lift = body(model, slide, pin.JointModelPZ(), "z", 1.0)
    frame(model, "plate", plate)
    frame(model, "foot", lift)
    feet = [pn.PointContact("foot", plane="plate", mu=c / 10.0)]
    driven = [pn.PrescribedMotion("rotor", drive)]
    return pn.Scene(model, constraints=driven, contacts=feet, v0=[u, w, 0.0]), v0_of(1, 3)


def v0_of(index, size=7):
    """Return the row that selects one velocity."""
    row = np.zeros(size)
    row[index] = 1.0
    return row


KINDS = {"joint": joint_between, "hinge": hinge_anchor, "user": user_friction, "contact": contact}


def wrong(kind, seed, rtol):
    """Return the error of the body's final velocity over the allowed error."""
    rng = np.random.default_rng(seed)
    omega, phase, w = rng.uniform(2.0, 40.0), rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-1.5, 1.5)
    c = rng.uniform(0.05, 1.0) if rng.random() < 0.5 else rng.uniform(0.05, 20.0)
    drive = pn.sinusoid(1.0 / omega, omega, phase=phase)
    scene, row = KINDS[kind](drive, np.cos(phase), w, c)
    run = pn.simulate(scene, DURATION, rtol=rtol, atol=1e-2 * rtol)
    exact, _, changes = Partner(omega, phase, c).body(w, DURATION)
    assert len(run.events) == changes
    return abs(run.v[-1] @ row - exact) / (ALLOWED * rtol)


CASES = [(kind, rtol) for kind in KINDS for rtol in (1e-8, 1e-6)]


@pytest.mark.parametrize("seed", [13, 91, 178, 351, 556, 809, 860])
def test_a_contact_that_slips_for_less_than_a_step(seed):
    """At a loose tolerance one step may contain the start and the end of a slip."""
    assert wrong("contact", seed, 1e-6) < 1.0


@pytest.mark.parametrize(("kind", "rtol"), CASES)
@pytest.mark.parametrize("count", [10, pytest.param(60, marks=pytest.mark.slow)])
def test_every_reversal_is_seen(kind, rtol, count):
    assert max(wrong(kind, seed, rtol) for seed in range(count)) < 1.0


@pytest.mark.stress
@pytest.mark.parametrize(("kind", "rtol"), CASES)
def test_every_reversal_of_a_thousand_cases_is_seen(kind, rtol):
    assert max(wrong(kind, seed, rtol) for seed in range(1000)) < 1.0
