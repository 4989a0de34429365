"""Examples in Markdown files: Python blocks compile, marked blocks run, links are valid.

Marks are HTML comments right above a block: `runs` for a block that runs, after the ones before it in the
same document, and `file: NAME` for the text of a file that they read.
"""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import NamedTuple

import pytest

from pin_nonideal.loading.load import load
from pin_nonideal.loading.robot_files import robots

from .test_stopped_runs import EXAMPLE

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
BLOCK = re.compile(
    r"^(?:<!-- (?P<mark>[a-z:._ ]+) -->\n)?```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
LINK = re.compile(r"\]\((?!https?:|mailto:|#)([^)#\s]+)")


class Block(NamedTuple):
    """A fenced block of a Markdown file: `document` is its path, `mark` the comment right above it."""

    document: str
    line: int
    mark: str
    language: str
    text: str


def place(path: Path) -> str:
    """Return the path of a document in the checkout."""
    return path.relative_to(ROOT).as_posix()


def blocks() -> list[Block]:
    found = []
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        for match in BLOCK.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            found.append(Block(place(path), line, match["mark"] or "", match["language"], match["text"]))
    return found


PYTHON = [block for block in blocks() if block.language == "python"]
RUNNABLE = [block for block in PYTHON if block.mark == "runs"]
# Pages whose blocks run elsewhere: in README.md, in `test_stopped_runs.py` and in `test_examples.py`.
RUN_ELSEWHERE = {"docs/index.md", "docs/how_to/stopped_runs.md", "docs/tutorials/worked_examples.md"}


def name(block: Block) -> str:
    return f"{block.document}:{block.line}"


def test_there_are_blocks_to_check() -> None:
    assert any(block.document == "README.md" for block in RUNNABLE)


@pytest.mark.parametrize("block", PYTHON, ids=name)
def test_python_block_compiles(block: Block) -> None:
    compile(block.text, name(block), "exec")


@pytest.mark.parametrize("document", sorted({block.document for block in RUNNABLE} - RUN_ELSEWHERE))
def test_marked_python_blocks_run(document: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    for block in blocks():
        if block.document == document and block.mark.startswith("file: "):
            (tmp_path / block.mark.removeprefix("file: ")).write_text(block.text, encoding="utf-8")
    script = ""
    for block in RUNNABLE:
        if block.document == document:
            # Line numbers of a traceback are those of the document: two lines for the mark and the fence.
            script += "\n" * (block.line + 1 - script.count("\n")) + block.text
    (tmp_path / "document.py").write_text(script, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    runpy.run_path("document.py", run_name="__main__")
    plt.close("all")


def test_blocks_that_run_elsewhere_are_the_same() -> None:
    texts: dict[str, set[str]] = {}
    for block in RUNNABLE:
        texts.setdefault(block.document, set()).add(block.text)
    assert texts["docs/index.md"] <= texts["README.md"]
    examples = {path.read_text(encoding="utf-8") for path in (ROOT / "examples").glob("*.py")}
    assert texts["docs/tutorials/worked_examples.md"] <= examples
    page = (ROOT / "docs" / "how_to" / "stopped_runs.md").read_text(encoding="utf-8")
    assert texts["docs/how_to/stopped_runs.md"] == set(EXAMPLE.findall(page))


@pytest.mark.parametrize("path", DOCUMENTS, ids=place)
def test_links_lead_to_files(path: Path) -> None:
    broken = [
        link for link in LINK.findall(path.read_text(encoding="utf-8")) if not (path.parent / link).exists()
    ]
    assert broken == []


def test_explanations_link_to_the_headers_of_the_core() -> None:
    """A slip header stands beside that of its gap. The rows of bilateral constraints are one folder."""
    core = ROOT / "pin_nonideal" / "_core"
    pages = (ROOT / "docs" / "explanation").glob("*.md")
    links = [(page, link) for page in pages for link in LINK.findall(page.read_text(encoding="utf-8"))]
    linked = {(page.parent / link).resolve() for page, link in links}
    headers = {path for path in core.rglob("*.hpp") if path.parent not in {core / "python", *linked}}
    gaps = {path for path in core.glob("constraints/gaps/*.hpp") if not path.stem.endswith("_slip")}
    assert gaps
    assert sorted((headers | gaps) - linked) == []


def test_the_folder_of_the_robots_page_loads(tmp_path: Path) -> None:
    files = {(b.document, b.mark): b.text for b in blocks() if b.mark.startswith("file: ")}
    (tmp_path / "robot.urdf").write_text(
        files["docs/tutorials/first_use.md", "file: linkage.urdf"], encoding="utf-8"
    )
    (tmp_path / "robot.yaml").write_text(files["docs/how_to/robots.md", "file: robot.yaml"], encoding="utf-8")
    scene = load(tmp_path)
    assert [c.name for c in scene.constraints] == ["loop"]
    assert [law.joint for law in scene.laws] == ["rocker_joint"]
    assert len(scene.forces) == 1


def test_every_robot_is_in_the_table() -> None:
    text = (ROOT / "docs" / "how_to" / "robots.md").read_text(encoding="utf-8")
    assert [name for name, _ in robots() if f"| `{name}` |" not in text] == []


def test_the_two_commands_of_the_readme_are_marked() -> None:
    marks = [block.mark for block in blocks() if block.document == "README.md" and block.language == "sh"]
    assert [mark for mark in marks if mark.startswith("command:")] == ["command: run", "command: test"]


def test_contributing_has_five_commands() -> None:
    commands = [b for b in blocks() if b.document == "CONTRIBUTING.md" and b.language == "sh"]
    assert len(commands) == 5
    assert all(len(block.text.splitlines()) == 1 for block in commands)


def test_the_readme_is_short_and_its_blocks_have_ten_lines() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120
    runnable = [block for block in RUNNABLE if block.document == "README.md"]
    assert len(runnable) == 5
    assert [block.line for block in runnable if len(block.text.splitlines()) > 10] == []


def test_the_readme_and_the_first_page_have_the_same_answers() -> None:
    pages = [(ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "docs/index.md")]
    readme, index = (
        page.split("<!-- answers: begin -->")[1].split("<!-- answers: end -->")[0] for page in pages
    )
    assert readme.replace("](docs/", "](") == index


def test_the_changelog_has_one_line_an_entry() -> None:
    lines = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    released = lines[lines.index("## [Unreleased]") :]
    entries = [line for line in released if line.startswith("- ")]
    assert len(entries) > 50
    assert [line for line in released if line.startswith(" ")] == []
    plain = [re.sub(r"\]\([^)]*\)", "]", line) for line in entries]
    assert [line for line in plain if len(line.split()) > 21] == []  # 20 words and the dash
    assert [line for line in entries if not re.match(r"- [A-Z][\w ]*: ", line)] == []
    sections = [line.removeprefix("### ") for line in released if line.startswith("### ")]
    assert set(sections) <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
