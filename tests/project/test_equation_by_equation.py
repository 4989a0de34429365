"""The page of the paper's equations names functions and tests that exist, and leaves no number out."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "equation_by_equation.md"
LAST = 81  # number of the paper's last equation
HEADING = re.compile(r"^### \((\d+)\)(?:-\((\d+)\))? .+$", re.MULTILINE)
ITEM = re.compile(r"^- (Computed by|Tested by|Explained in)\s+(.+?)(?=^- |^#|\Z)", re.MULTILINE | re.DOTALL)
REFERENCE = re.compile(r"`([\w/]+\.(?:py|cpp|hpp))::([\w.:]+)`")
LINK = re.compile(r"\]\(([\w/.]+)#([\w-]+)\)")


class Section(NamedTuple):
    """The part of the page on one equation, or on the steps of one derivation."""

    first: int
    last: int
    text: str
    items: dict[str, str]

    def references(self, item: str) -> list[tuple[str, str]]:
        """Return the pairs of file and name of an item."""
        return REFERENCE.findall(self.items[item])


def sections() -> list[Section]:
    """Return the sections of the page in order."""
    text = PAGE.read_text(encoding="utf-8")
    headings = list(HEADING.finditer(text))
    ends = [heading.start() for heading in headings[1:]] + [len(text)]
    found = []
    for heading, end in zip(headings, ends, strict=True):
        body = text[heading.end() : end]
        numbers = int(heading[1]), int(heading[2] or heading[1])
        found.append(Section(*numbers, body, dict(ITEM.findall(body))))
    return found


SECTIONS = sections()


def section_name(section: Section) -> str:
    return f"{section.first}-{section.last}"


@functools.cache
def python_names(file: str) -> frozenset[str]:
    """Names of the functions, classes and methods of a source, methods behind their class and a point."""
    found = set()
    for node in ast.parse((ROOT / file).read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
    return frozenset(found)


def exists(file: str, name: str) -> bool:
    """Check if a source defines a function of this name."""
    if not (ROOT / file).is_file():
        return False
    if file.endswith(".py"):
        return name.replace("::", ".") in python_names(file)
    return re.search(rf"\b{name}\b", (ROOT / file).read_text(encoding="utf-8")) is not None


def test_every_number_of_the_paper_stands_once_and_in_order() -> None:
    listed = [number for section in SECTIONS for number in range(section.first, section.last + 1)]
    assert listed == list(range(1, LAST + 1))


@pytest.mark.parametrize("section", SECTIONS, ids=section_name)
def test_each_section_has_a_formula_and_three_items(section: Section) -> None:
    assert section.text.count("\n$$\n") == 2
    assert list(section.items) == ["Computed by", "Tested by", "Explained in"]


@pytest.mark.parametrize("section", SECTIONS, ids=section_name)
def test_functions_and_tests_exist(section: Section) -> None:
    computed, tested = section.references("Computed by"), section.references("Tested by")
    assert computed
    assert tested
    assert [pair for pair in computed + tested if not exists(*pair)] == []
    wrong = [name for file, name in tested if not (file.startswith("tests/") and "test_" in name)]
    assert wrong == []


@pytest.mark.parametrize("section", SECTIONS, ids=section_name)
def test_explanations_exist(section: Section) -> None:
    links = LINK.findall(section.items["Explained in"])
    assert links
    for page, anchor in links:
        headings = re.findall(r"^#+ (.+)$", (PAGE.parent / page).read_text(encoding="utf-8"), re.MULTILINE)
        assert anchor in [re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings]


def test_sources_of_the_core_with_a_number_are_listed() -> None:
    """A number at the end of a line of the core belongs to a section that lists a file of the core."""
    core = ROOT / "pin_nonideal" / "_core"
    computed: set[int] = set()
    for path in [*core.rglob("*.cpp"), *core.rglob("*.hpp")]:
        for line in path.read_text(encoding="utf-8").splitlines():
            if match := re.match(r"\s*[^/\s].*//.*\bEqs?\. (\(\d+\).*)", line):
                computed |= {int(number) for number in re.findall(r"\((\d+)\)", match[1])}
    listed = {
        number
        for section in SECTIONS
        if any("/_core/" in file for file, _ in section.references("Computed by"))
        for number in range(section.first, section.last + 1)
    }
    assert {2, 3, 39, 40} <= computed
    assert computed - listed == set()


@pytest.mark.parametrize(("ending", "comment"), [("py", "#"), ("cpp", "//")])
def test_a_search_for_the_equation_of_motion_finds_the_lines_that_compute_it(
    ending: str, comment: str
) -> None:
    code = [
        line.split(comment)[0].strip()
        for path in (ROOT / "pin_nonideal").rglob(f"*.{ending}")
        for line in path.read_text(encoding="utf-8").splitlines()
        if f"{comment} " in line and "Eq. (40)" in line.split(comment)[-1]
    ]
    assert any(code)
