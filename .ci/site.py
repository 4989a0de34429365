"""Hook of mkdocs: docstrings of the reference, formulas as MathML, linked files outside of docs/."""

from __future__ import annotations

import html
import posixpath
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files

LINK = re.compile(r"\]\((\.\./[^)#]+)(#[^)]*)?\)")
TABLE = re.compile(r"(?:^\| `\w+` \|.*\n)+", re.MULTILINE)
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\(?:\(|\[)(.*?)\\(?:\)|\])</\1>', re.DOTALL)
NAMES = "reference/names/"
ROOT = Path(__file__).resolve().parent.parent


def _outside(page: str, link: str) -> str | None:
    """Return the path in the checkout that a link leads to, None if it leads to a page or picture."""
    target = posixpath.normpath(posixpath.join("docs", posixpath.dirname(page), link))
    return None if target.startswith("docs/") else target


def _place(target: str) -> str:
    """Return the path on the site of a file of the checkout."""
    return f"source/{target}.txt"


def _with_docstrings(table: re.Match[str]) -> str:
    """Return a table of names followed by the docstring of each name."""
    names = re.findall(r"^\| `(\w+)`", table[0], re.MULTILINE)
    return "\n\n".join([table[0], *(f"::: pin_nonideal.{name}" for name in names), ""])


def on_files(files: Files, config: Any) -> Files:
    """Add the files of the checkout that pages link to."""
    for page in files.documentation_pages():
        for link, _ in LINK.findall(page.content_string):
            target = _outside(page.src_uri, link)
            if target is None:
                continue
            path = ROOT / target
            if path.is_file() and files.get_file_from_path(_place(target)) is None:
                text = path.read_text(encoding="utf-8")
                files.append(File.generated(config, _place(target), content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Redirect the links of a page to these files, and add the docstrings of the reference.

    A folder has no page, so its name stays without a link.
    """
    source = page.file.src_uri
    if source.startswith(NAMES):
        markdown = TABLE.sub(_with_docstrings, markdown)

    def moved(match: re.Match[str]) -> str:
        target = _outside(source, match[1])
        if target is None:
            return match[0]
        if not (ROOT / target).is_file():
            return "]"
        return f"]({posixpath.relpath(_place(target), posixpath.dirname(source))})"

    return LINK.sub(moved, markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Write the formulas of a page as MathML, which browsers show without scripts and without a network."""

    def formula(match: re.Match[str]) -> str:
        display = "block" if match[1] == "div" else "inline"
        shown = convert(html.unescape(match[2]).strip(), display=display)
        # Browsers read the style of a cell, not its `columnalign`.
        return re.sub(r'columnalign="(left|right)"', r'style="text-align: \1"', shown)

    return FORMULA.sub(formula, content)
