"""Hook of mkdocs: adds docstrings below the tables of the reference, and linked files outside of docs/."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

OUTSIDE = re.compile(r"\]\(\.\./([^)#]+)(#[^)]*)?\)")
TABLE = re.compile(r"(?:^\| `\w+` \|.*\n)+", re.MULTILINE)
ROOT = Path(__file__).resolve().parent.parent


def _place(target: str) -> str:
    """Return the path on the site of a file of the checkout."""
    return f"source/{target}.txt"


def _with_docstrings(table: re.Match[str]) -> str:
    """Return a table of names, with the directives of mkdocstrings for each name."""
    names = re.findall(r"^\| `(\w+)`", table[0], re.MULTILINE)
    return "\n\n".join([table[0], *(f"::: pin_nonideal.{name}" for name in names), ""])


def on_files(files: Files, config: Any) -> Files:
    """Add the files that pages link to."""
    for page in files.documentation_pages():
        for target, _ in OUTSIDE.findall(page.content_string):
            path = ROOT / target
            if path.is_file() and files.get_file_from_path(_place(target)) is None:
                text = path.read_text(encoding="utf-8")
                files.append(File.generated(config, _place(target), content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Redirect links to the added files; links to folders are removed and their names kept."""
    if page.file.src_uri == "reference.md":
        return TABLE.sub(_with_docstrings, markdown)

    def moved(match: re.Match[str]) -> str:
        return f"]({_place(match[1])})" if (ROOT / match[1]).is_file() else "]"

    return OUTSIDE.sub(moved, markdown)
