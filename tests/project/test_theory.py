"""The pages of the theory and the sources agree on the headers of the core and the lines of each equation."""

from __future__ import annotations

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "pin_nonideal" / "_core"
EXPLANATION = ROOT / "docs" / "explanation"
THEORY = [
    EXPLANATION / f"{name}.md"
    for name in ("equation_of_motion", "contact_mechanics", "stick_and_slip", "integration_and_events")
]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PYTHON = sorted(
    p for room in ("pin_nonideal", "oracles", "examples", "tests") for p in (ROOT / room).rglob("*.py")
)
HEADERS = sorted(CORE.rglob("*.hpp"))
MODULE = CORE / "python" / "module.cpp"  # list of Python bindings
SOURCES = sorted(p for p in CORE.rglob("*.cpp") if p != MODULE)
MENTION = re.compile(r"Eqs?\. \(\d+\)(?:(?:-|, | and )\(\d+\))*")


def numbers(text):
    """Numbers of the equations that a text mentions, `Eq. (7)`, `Eqs. (41)-(46)`, `Eqs. (3), (9)`."""
    found = set()
    for mention in MENTION.findall(text):
        for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", mention):
            found |= set(range(int(first), int(last or first) + 1))
    return found


def trailing_comments(path):
    """Return trailing comments of Python code."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and lines[token.start[0] - 1][: token.start[1]].strip():
            yield token.string


def computed_in_core(path):
    """Numbers of the equations at the end of the lines of a C++ file that compute them."""
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line.split("//", 1)[1] for line in lines if re.match(r"\s*[^/\s].*//", line)]
    return numbers("\n".join(comments))


def table():
    """Rows of the tables of the core: headers (a folder stands for its own), and their equations."""
    for line in "\n".join(page.read_text(encoding="utf-8") for page in THEORY).splitlines():
        named = re.findall(r"\]\(\.\./\.\./pin_nonideal/_core/([\w/.]+)\)", line)
        if line.startswith("| ") and named:
            files = []
            for name in named:
                files += [CORE / name] if name.endswith(".hpp") else sorted((CORE / name).glob("*.hpp"))
            equations = re.findall(r"\((\d+)\)", line.rstrip(" |").rsplit("|", 1)[1])
            yield files, {int(n) for n in equations}


def test_the_tables_have_every_header_of_the_core_once():
    """A table of shapes may name headers of the folder of gaps again, each once."""
    named = [str(file.relative_to(CORE)) for files, _ in table() for file in files]
    mechanics = [file for file in HEADERS if file.parent != MODULE.parent]  # the door to Python holds none
    assert sorted(set(named)) == sorted(str(file.relative_to(CORE)) for file in mechanics)
    twice = [name for name in set(named) if named.count(name) > 1]
    assert all(name.startswith("constraints/gaps/") and named.count(name) == 2 for name in twice)


@pytest.mark.parametrize("header", HEADERS, ids=lambda p: p.stem)
def test_every_header_opens_with_what_it_is(header):
    assert re.match(r"// .{20,}", header.read_text(encoding="utf-8"))


@pytest.mark.parametrize("source", SOURCES, ids=lambda p: p.stem)
def test_every_source_has_its_own_header(source):
    header = source.with_suffix(".hpp")
    assert header.is_file()
    first = re.search(r'#include "(.+)"', source.read_text(encoding="utf-8"))
    assert first is not None
    assert first[1] == str(header.relative_to(CORE))


def test_equations_of_the_tables_stand_in_their_files():
    credited = [(files, equations) for files, equations in table() if equations]
    assert {39, 40} <= set().union(*(equations for _, equations in credited))
    for files, equations in credited:
        both = [p for file in files for p in (file, file.with_suffix(".cpp")) if p.is_file()]
        missing = equations - set().union(*map(computed_in_core, both))
        assert not missing, f"{files[0].stem}: no line ends with Eq. {sorted(missing)}"


def test_equations_of_the_documents_stand_in_python():
    lines = set().union(*(numbers(comment) for path in PYTHON for comment in trailing_comments(path)))
    mentioned = set().union(*(equations for _, equations in table()))
    for path in DOCUMENTS:
        mentioned |= numbers(path.read_text(encoding="utf-8"))
    assert {1, 3, 4, 7, 9, 33, 39, 40} <= mentioned
    assert mentioned - lines == set()


def test_equations_are_written_so_that_a_search_finds_them():
    files = [*DOCUMENTS, *PYTHON, *HEADERS, *SOURCES]
    wrong = [p.name for p in files if re.search(r"\bEqs?\.? ?\d", p.read_text(encoding="utf-8"))]
    assert wrong == []
