"""The page on stopped runs treats every error of a run, and each of its examples raises this error."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from pin_nonideal.errors import RunError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how_to" / "stopped_runs.md"
SECTION = re.compile(r"^## `(\w+)`\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
EXAMPLE = re.compile(r"^<!-- runs -->\n```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def below(kind: type) -> set[str]:
    """Return the names of all subclasses of the package."""
    own = {each for each in kind.__subclasses__() if each.__module__.startswith("pin_nonideal")}
    return {each.__name__ for each in own}.union(*(below(each) for each in own))


SECTIONS = dict(SECTION.findall(PAGE.read_text(encoding="utf-8")))


def test_every_error_of_a_run_has_its_section() -> None:
    assert set(SECTIONS) == below(RunError)


@pytest.mark.parametrize("name", SECTIONS)
def test_a_section_has_meaning_checks_remedy_and_example(name: str) -> None:
    parts = re.findall(r"^\*\*(\w+)\.\*\* \S", SECTIONS[name], re.MULTILINE)
    assert parts == ["Meaning", "Check", "Remedy"]
    assert len(EXAMPLE.findall(SECTIONS[name])) == 1


def test_each_example_raises_its_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    script = "\n".join(EXAMPLE.findall(PAGE.read_text(encoding="utf-8")))
    (tmp_path / "examples.py").write_text(script, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    runpy.run_path("examples.py", run_name="__main__")
    out = capsys.readouterr().out
    printed = [re.match(r"(\w+(Error|Interrupted)): ", line) for line in out.splitlines()]
    assert [found[1] for found in printed if found] == list(SECTIONS)
