"""Drawers that jam between guides and are pulled loose: the instant does not depend on the steps of a run."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from tests.support.seeds import seeds

SAME_INSTANT = 1e-6  # [s], for runs of other lengths, whose steps differ
INEXACT = {(49, True), (133, True)}  # located to 3e-5 s: loads of the last step's interpolant decide


def drawer(seed, is_loaded):
    """Return a drawer between two guides, two contacts on each, under a pull that changes direction."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.gravity.linear[:] = [0.0, 0.0, -9.81]
    joint = 0
    for name, kind in (
        ("along", pin.JointModelPX()),
        ("across", pin.JointModelPY()),
        ("yaw", pin.JointModelRZ()),
    ):
        joint = model.addJoint(joint, kind, pin.SE3.Identity(), name)
    mass, half_width, half_length = rng.uniform(0.5, 3.0), rng.uniform(0.1, 0.2), rng.uniform(0.05, 0.3)
    model.appendBodyToJoint(
        joint, pin.Inertia(mass, np.zeros(3), 0.02 * mass * np.eye(3)), pin.SE3.Identity()
    )

    def add_frame(name, parent, point):
        place = pin.SE3(np.eye(3), np.array(point))
        model.addFrame(pin.Frame(name, parent, 0, place, pin.FrameType.OP_FRAME))

    contacts, mu = [], rng.uniform(0.2, 1.2)
    for side in (1.0, -1.0):
        add_frame(f"guide {side:g}", 0, [0.0, side * half_width, 0.0])
        for end in (1.0, -1.0):
            name = f"{side:g} {end:g}"
            add_frame(name, joint, [end * half_length, side * half_width, 0.0])
            plane = {"plane": f"guide {side:g}", "normal": [0.0, -side, 0.0]}
            contacts.append(pn.PointContact(name, mu=mu, **plane))
    add_frame("handle", joint, [rng.uniform(0.0, 0.5), rng.uniform(-0.4, 0.4), 0.0])
    pull, rate = rng.uniform(3.0, 20.0), rng.uniform(3.0, 10.0)
    wrench = pn.Wrench(
        "handle",
        lambda t: [pull * np.sin(rate * t + 0.3), 0.5 * pull * np.cos(rate * t), 0.0, 0.0, 0.0, 0.0],
    )
    bearing = pn.JointFriction("along", mu=rng.uniform(0.05, 0.3), coulomb=0.1)
    return pn.Scene(model, contacts=contacts, forces=[wrench], laws=[bearing] if is_loaded else [])


def first_slip(scene, duration):
    """Return the time of the first slip from rest, or None."""
    run = pn.simulate(scene, duration, several="continue", progress=False)
    return next((event.time for event in run.events if event.kind == "slip"), None)


@pytest.mark.parametrize("is_loaded", [False, True], ids=["contacts alone", "a loaded bearing beside"])
@pytest.mark.parametrize("seed", seeds(range(200), count=20))
def test_the_instant_of_release_does_not_depend_on_the_steps(seed, is_loaded, request):
    if (seed, is_loaded) in INEXACT:
        request.applymarker(pytest.mark.xfail(strict=True, raises=AssertionError))
    scene = drawer(seed, is_loaded)
    times = [first_slip(scene, duration) for duration in (0.25, 0.29)]
    if None in times:
        return
    assert times[0] == pytest.approx(times[1], abs=SAME_INSTANT)
