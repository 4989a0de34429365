"""The documentation site: its pages, their names and tables, and that it is built without a warning."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pin_nonideal as pn

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
NAMES = sorted((DOCS / "reference" / "names").glob("*.md"))
# Objects in pages and their classes, and instance attributes, which the class does not have.
OWNERS = {"pn": pn, "scene": pn.Scene, "run": pn.Trajectory}
INSTANCE = {"scene": {"model", "constraints", "laws", "forces", "contacts", "actuation", "name", "notes"}}
INSTANCE["scene"] |= set(
    re.findall(r"^        (\w+): ", inspect.getdoc(pn.Scene).replace("\n", "\n    "), re.M)
)
INSTANCE["run"] = set(pn.Trajectory.__dataclass_fields__)


def text(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


def test_the_reference_has_every_public_name() -> None:
    pages = "".join(text(f"reference/names/{page.name}") for page in NAMES)
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", pages, re.MULTILINE))
    first = {
        n: (inspect.getdoc(getattr(pn, n)) or "").split("\n\n")[0].replace("\n", " ") for n in pn.__all__
    }
    assert {name: words.replace("|", "\\|") for name, words in first.items()} == rows


@pytest.mark.parametrize("page", sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")))
def test_names_on_pages_exist(page: str) -> None:
    unknown = []
    for owner, name in re.findall(r"\b(pn|scene|run)\.([a-zA-Z]\w*)", text(page)):
        if not hasattr(OWNERS[owner], name) and name not in INSTANCE.get(owner, set()):
            unknown.append(f"{owner}.{name}")
    assert [name for name in unknown if not name.endswith((".html", ".npz", ".yaml", ".py"))] == []


def test_worked_examples_are_short_and_checked() -> None:
    blocks = re.findall(r"```python\n(.*?)```", text("tutorials/worked_examples.md"), re.DOTALL)
    assert len(blocks) == 5
    names = ("gough_platform", "engine", "cart", "hanging_chain", "gripper")
    assert blocks == [(ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8") for name in names]
    assert all(block.count("\nassert ") >= 2 for block in blocks)


def test_the_gallery_shows_every_robot() -> None:
    shown = set(re.findall(r"stills/(\w+)\.jpg", text("reference/gallery.md")))
    assert {name for name, _ in pn.robots()} <= shown
    assert {path.stem for path in (DOCS / "reference" / "stills").glob("*.jpg")} == shown


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    for package in ("mkdocstrings", "latex2mathml"):
        pytest.importorskip(package, reason="the site takes pip install '.[docs]'")
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--quiet",
        "--site-dir",
        str(tmp_path / "site"),
    ]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=quiet)
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site" / "reference" / "names"
    pages = "".join(page.read_text(encoding="utf-8") for page in site.glob("*.html"))
    assert [name for name in pn.__all__ if f'id="pin_nonideal.{name}"' not in pages] == []
    assert (tmp_path / "site" / "source" / "pin_nonideal" / "equation.py.txt").exists()
