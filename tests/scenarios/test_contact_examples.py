"""Examples of contact scenes with other numbers: weak pads lose the box, a weak push overturns nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pin_nonideal as pn

FOLDER = Path(__file__).parents[2] / "examples"


def scene_of(name: str, *changes: tuple[str, str]) -> dict[str, Any]:
    """Return the names of an example up to its simulation, with parts of its text changed."""
    text = (FOLDER / f"contact_{name}.py").read_text(encoding="utf-8").partition("\nrun = ")[0]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    names: dict[str, Any] = {}
    exec(compile(text, name, "exec"), names)
    return names


def moved(scene: pn.Scene, duration: float) -> Any:
    return pn.simulate(scene, duration, method="moreau", dt=1e-3, output_dt=0.05)


@pytest.mark.parametrize(("press", "lifted"), [(3.5, False), (5.0, True)])
def test_the_pads_lift_only_with_enough_pressure(press: float, lifted: bool) -> None:
    """Two pads hold 2 mu N: 4.2 N of the weight of 4.9 N, or 6 N."""
    names = scene_of("gripper", ("0.5, 0.6, 10.0", f"0.5, 0.6, {press}"))
    run = moved(names["scene"], 1.5)
    assert (run.joint("box").q[-1, 2] > 0.19) == lifted
    assert run.joint("lift").q[-1] > 0.19


def test_a_weak_push_overturns_no_domino() -> None:
    """The center of the first domino stays below the top of its arc, so that all dominoes stand."""
    names = scene_of("dominoes", ("spin = 0.02, 0.16, 0.08, 3.0", "spin = 0.02, 0.16, 0.08, 0.5"))
    run = moved(names["scene"], 1.0)
    turned = [2.0 * np.arctan2(run.joint(name).q[:, 4], run.joint(name).q[:, 6]) for name in names["names"]]
    assert np.abs(turned[0]).max() < 0.1
    assert abs(turned[0][-1]) < 0.02
    assert np.abs(turned[1:]).max() < 1e-12


def test_a_steep_stack_tips() -> None:
    """Shifts of 0.08 m to one side each put the center of four boxes beyond the edge of the lowest one."""
    names = scene_of(
        "stack", ("0.04 * (-1) ** k", "0.08 * k"), ("count, density = 0.2, 6", "count, density = 0.2, 4")
    )
    run = moved(names["scene"], 0.5)
    assert run.joint("box 3").q[-1, 2] < -0.02
