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
# The ball may stick or slip under the loads of either mode, and no limit is found.
UNSOLVED = (38, 46)
PARADOX = 5  # the adaptive steps end in a FrictionParadoxError


def check(seed: int) -> None:
    scene = loops.ball_loop(seed)
    exact = pn.simulate(scene, DURATION, rtol=1e-8)
    run = pn.simulate(scene, DURATION, method="moreau", dt=1e-3)
    assert np.abs(pin.difference(scene.model, exact.q[-1], run.q[-1])).max() < ERROR, seed


@pytest.mark.parametrize(
    "many",
    [
        pytest.param((0, 2, 3, 13, 19), id="5"),
        pytest.param(range(100), id="100", marks=pytest.mark.slow),
    ],
)
def test_a_ball_sticks_in_a_loop(many: range) -> None:
    for seed in many:
        if seed not in (*UNSOLVED, PARADOX):
            check(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", UNSOLVED)
@pytest.mark.xfail(strict=True, raises=pn.FrictionConvergenceError)
def test_a_ball_whose_limit_is_not_found(seed: int) -> None:
    check(seed)
