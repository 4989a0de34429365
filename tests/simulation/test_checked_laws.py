"""Every motion satisfies the laws before a run or a solution accepts it."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

SMALL = 1e-10  # residual of an accepted motion, relative to the largest force


def block(limit: object) -> pn.Scene:
    """A block of 1 kg that a force of 2 N pushes along a line with friction."""
    model = pin.Model()
    slide = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(slide, pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    return pn.Scene(model, laws=[pn.UserFriction(lambda t, q: [1.0], limit, name="rub")], actuation=[2.0])


def refusal(calls: int) -> pn.FrictionConvergenceError | None:
    """The error of a solution whose limit falls from 3 N to 1 N after a number of calls."""
    count = itertools.count()
    scene = block(lambda t, q, v, reactions: 3.0 if next(count) < calls else 1.0)
    count = itertools.count()
    try:
        scene.solve([0.0], [0.0])
    except pn.FrictionConvergenceError as error:
        return error
    return None


def test_a_limit_that_differs_from_call_to_call_gives_no_motion() -> None:
    """The block sticks with the limit that the search reads, and not with the limit that the check reads."""
    assert block(lambda t, q, v, reactions: 3.0).solve([0.0], [0.0]).modes[0] == 0
    told = 'that satisfies the limit of friction at "rub" was found at t = 0 s: the residual is 2.5e-01 of'
    errors = [error for calls in range(1, 12) if (error := refusal(calls)) and told in str(error)]
    assert errors
    assert {error.element for error in errors} == {"rub"}


@pytest.mark.parametrize("name", ["rough_four_bar", "solo12_dropped", "panda_settling", "belt_oscillator"])
def test_runs_report_their_largest_residuals(name: str) -> None:
    stats = pn.simulate(pn.load(name), 1.0).stats
    residuals = (stats.motion, stats.signorini, stats.coulomb, stats.dissipation)
    assert 0.0 < max(residuals) <= SMALL


def test_scenes_without_friction_and_contacts_have_no_residuals() -> None:
    stats = pn.simulate(pn.load("five_bar"), 0.1).stats
    assert (stats.motion, stats.signorini, stats.coulomb, stats.dissipation) == (0.0,) * 4
