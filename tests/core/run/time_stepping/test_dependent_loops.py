"""Time steps of loops with more rows than independent ones, beside adaptive steps.

Between the ends of a step the bodies leave the constraints, and dependent rows seem independent there.
"""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn

from ....scene.test_symmetries import case as symmetric_case
from ....scene.test_symmetries import check
from ....support import loops
from ....support.cases import case_of
from ....support.seeds import ranges
from ....support.symmetries import ALL

DURATION, ANGLE = 0.1, 0.05  # s, and the largest angle of a joint in a step [rad]
# The error of a second-order method falls by four with half the step. In an error below the floor, parts of
# second and third order may cancel.
LEAST_RATIO, FLOOR = 2.5, 1e-5


def error(scene: pn.Scene, exact: pn.Trajectory, dt: float) -> float:
    run = pn.simulate(scene, DURATION, method="moreau", dt=dt)
    return float(np.abs(run.q[-1] - exact.q[-1]).max())


@pytest.mark.parametrize("far_contact", [False, True])
@pytest.mark.parametrize("many", ranges(12, 100, 300))
def test_a_shaft_with_light_and_heavy_parts_turns_on(many: range, far_contact: bool) -> None:
    for seed in many:
        case = case_of(loops.cardan(seed, driven=False))
        if far_contact:
            case = ALL["a far contact"].make(case).case
        exact = pn.simulate(case.scene, DURATION, rtol=1e-10, atol=1e-12)
        dt = min(0.1 * DURATION, ANGLE / float(np.abs(exact.v).max()))
        once, halved = (error(case.scene, exact, step) for step in (dt, 0.5 * dt))
        assert halved < max(once / LEAST_RATIO, FLOOR), seed


@pytest.mark.parametrize("many", ranges(6, 60, 100))
def test_a_far_contact_does_not_change_how_a_jamming_loop_shares_loads(many: range) -> None:
    for seed in many:
        case = symmetric_case(f"ball loop {seed}")
        q0, v0 = case.scene.project(t=case.t0)
        run, beside = (
            pn.simulate(scene, case.duration, q0, v0, t0=case.t0, method="moreau", dt=case.dt)
            for scene in (case.scene, ALL["a far contact"].make(case).case.scene)
        )
        np.testing.assert_allclose(beside.q, run.q, atol=1e-7, err_msg=str(seed))


@pytest.mark.parametrize(
    ("scene", "transformation", "method"),
    [
        ("side rods 24", "rows by hand, times 1e-4", "moreau"),
        ("Bennett 31", "a far contact", "semi_implicit_euler"),
        ("free Cardan 8", "a far contact", "moreau"),
        ("places 1", "turned mount", "moreau"),
        ("law UserLaw", "accelerated", "moreau"),
    ],
)
def test_fixed_steps_of_loops_do_not_depend_on_how_a_scene_is_written(
    scene: str, transformation: str, method: str
) -> None:
    check(scene, transformation, [f"simulate {method}"])


@pytest.mark.parametrize("seed", range(3))
def test_records_beside_a_callback_change_no_step(seed: int) -> None:
    case = ALL["a far contact"].make(symmetric_case(f"ball loop {seed}")).case
    options = {
        "method": "moreau",
        "dt": case.dt,
        "output_dt": 10.0 * case.dt,
        "callback": lambda t, q, v: None,
    }
    run, recorded = (pn.simulate(case.scene, 0.3, record=record, **options) for record in ((), "forces"))
    np.testing.assert_array_equal(recorded.q, run.q)
    np.testing.assert_array_equal(recorded.v, run.v)
    assert recorded.events == run.events
