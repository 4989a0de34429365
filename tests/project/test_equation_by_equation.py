"""The page "equation by equation" lists each equation once, with functions and tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pin_nonideal as pn

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "explanation" / "equation_by_equation.md"
LAST = 81  # equations of the paper
CODE = re.compile(r"`([^`]+)`")


def rows() -> list[list[str]]:
    cells = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith("|")
    ]
    return [row for row in cells if row[0][0].isdigit()]


def test_each_equation_of_the_paper_is_listed_once() -> None:
    numbers = [int(number) for row in rows() for number in row[0].split(",")]
    assert sorted(numbers) == list(range(1, LAST + 1))


def test_functions_exist() -> None:
    for row in rows():
        for name in CODE.findall(row[2]):
            thing = pn
            for part in name.split("."):
                thing = getattr(thing, part)


def test_tests_exist() -> None:
    defined = {
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"def (test_\w+)\(", path.read_text(encoding="utf-8"))
    }
    named = {name for row in rows() for name in CODE.findall(row[3])}
    assert named
    assert named - defined == set()
