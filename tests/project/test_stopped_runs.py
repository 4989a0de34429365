"""The page on stopped runs treats every error of a run, and each of its examples raises this error."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from pin_nonideal.errors import RunError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how_to" / "stopped_runs.md"
SECTION = re.compile(r"^## `(\w+)`\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
EXAMPLE = re.compile(r"^<!-- runs -->\n```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
RUN_SECONDS = 120


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


def test_each_example_raises_its_error(tmp_path: Path) -> None:
    script = "\n".join(EXAMPLE.findall(PAGE.read_text(encoding="utf-8")))
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=RUN_SECONDS,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    printed = [re.match(r"(\w+(Error|Interrupted)): ", line) for line in done.stdout.splitlines()]
    assert [found[1] for found in printed if found] == list(SECTIONS)
