"""The tables of docs/how_to/methods.md agree with the package."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pin_nonideal as pn

PAGE = (Path(__file__).parents[2] / "docs" / "how_to" / "methods.md").read_text(encoding="utf-8")
TABLE = re.compile(r"<!-- table: (\S+) (\S+) -->\n\|.*\n\| ---.*\n((?:\|.*\n)+)")
# Rounding differs between processors: a step more or fewer, and another error below the tolerance.
EVALUATIONS, ERROR = 0.03, 3.0


def tables():
    return [(m[1], float(m[2]), m[3].splitlines()) for m in TABLE.finditer(PAGE)]


def test_there_are_tables():
    assert [robot for robot, _, _ in tables()] == ["n_four_bar", "rough_four_bar"]


@pytest.mark.parametrize(
    ("robot", "duration", "rows"), tables(), ids=lambda x: x if isinstance(x, str) else ""
)
def test_measured_again(robot, duration, rows):
    scene = pn.load(robot)
    exact = pn.simulate(scene, duration, rtol=1e-13, atol=1e-14).q[-1]
    for row in rows:
        method, setting, evaluations, error = (cell.strip() for cell in row.strip("|").split("|"))
        fixed = method in ("rk4", "semi_implicit_euler")
        step = {"dt": float(setting)} if fixed else {"rtol": float(setting), "atol": 1e-2 * float(setting)}
        run = pn.simulate(scene, duration, method=method, **step)
        assert run.stats.evaluations == pytest.approx(int(evaluations), rel=EVALUATIONS), row
        found = np.abs(run.q[-1] - exact).max()
        assert float(error) / ERROR < found < float(error) * ERROR + 1e-12, (row, found)
