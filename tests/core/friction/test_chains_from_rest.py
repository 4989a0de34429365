"""Long chains of joints whose friction follows loads, from rest: far from the base loads are rounding."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

DURATION = 2e-3  # [s]
MASS, LENGTH = 0.1, 0.1  # of a link [kg], [m]


def chain(links: int) -> pn.Scene:
    model, parent = pin.Model(), 0
    inertia = pin.Inertia(MASS, np.array([0.5 * LENGTH, 0.0, 0.0]), np.diag([1e-5, 1e-4, 1e-4]))
    for k in range(links):
        place = pin.SE3(np.eye(3), np.array([LENGTH if k else 0.0, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{k}")
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    laws = [pn.JointFriction(f"joint{k}", mu=0.2, radius=0.01) for k in range(links)]
    return pn.Scene(model, laws=laws)


@pytest.mark.parametrize("links", [10, 20, pytest.param(40, marks=pytest.mark.slow)])
def test_steps_in_time_meet_the_event_driven_motion(links):
    scene = chain(links)
    exact = pn.simulate(scene, DURATION, rtol=1e-9, progress=False)
    speed = np.abs(exact.v[-1]).max()
    errors = [
        np.abs(pn.simulate(scene, DURATION, method="moreau", dt=dt, progress=False).v[-1] - exact.v[-1]).max()
        for dt in (1e-4, 1e-5)
    ]
    assert errors[0] <= 1e-3 * speed
    assert errors[1] <= 0.3 * errors[0]


@pytest.mark.parametrize("links", [20, 60, pytest.param(100, marks=pytest.mark.slow)])
def test_a_release_takes_few_evaluations(links):
    run = pn.simulate(chain(links), DURATION, progress=False)
    assert run.stats.evaluations <= 30 * (len(run.events) + 20)
    assert np.abs(run.v[-1]).max() > 0.1


@pytest.mark.parametrize("links", [20, 60])
def test_short_steps_in_time_find_their_loads(links):
    run = pn.simulate(chain(links), 2e-5, method="moreau", dt=1e-6, progress=False)
    assert len(run.t) == 21
