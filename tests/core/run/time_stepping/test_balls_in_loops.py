"""Time steps of loops that a ball joint with load-dependent friction closes, beside adaptive steps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support import loops

DURATION = 1.5
# Steps of 1 ms through a slip and a stick. The stick ends up to a step later.
ERROR = 0.1
JAMS = 46  # the loads of adaptive steps jam the ball at its first stick, and those of least norm do not
PARADOX = 5  # the adaptive steps end in a FrictionParadoxError


def check(seed: int) -> None:
    scene = loops.ball_loop(seed)
    exact = pn.simulate(scene, DURATION, rtol=1e-8)
    run = pn.simulate(scene, DURATION, method="moreau", dt=1e-3)
    assert np.abs(pin.difference(scene.model, exact.q[-1], run.q[-1])).max() < ERROR, seed


@pytest.mark.parametrize(
    "many",
    [
        pytest.param((0, 2, 3, 13, 19, 38), id="6"),
        pytest.param(range(100), id="100", marks=pytest.mark.slow),
    ],
)
def test_a_ball_sticks_in_a_loop(many: range) -> None:
    for seed in many:
        if seed not in (JAMS, PARADOX):
            check(seed)


def test_a_ball_that_may_jam_slips_on() -> None:
    pn.simulate(loops.ball_loop(JAMS), DURATION, method="moreau", dt=1e-3)
