"""The examples are short, check their results, draw their figures and stand in `pin-nonideal list`."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from pin_nonideal.cli.examples import examples
from pin_nonideal.loading.library.example_scripts import example_files

FOLDER = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.stem for path in FOLDER.glob("*.py"))
MAX_LINES = 40


def test_all_are_listed_with_a_line() -> None:
    assert [name for name, _ in examples()] == NAMES
    assert all(0 < len(words) < 100 for _, words in examples())
    assert example_files()["gripper"].read_bytes() == (FOLDER / "gripper.py").read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_it_is_short_and_checks_its_results(name: str) -> None:
    text = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MAX_LINES
    assert "\nassert " in text or "\n    assert " in text


@pytest.mark.parametrize("name", NAMES)
def test_it_runs_and_draws_its_figure(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
    plt.close("all")
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}.png"]
    assert (tmp_path / f"{name}.png").stat().st_size > 5000
