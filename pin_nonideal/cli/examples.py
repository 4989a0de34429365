"""Example scripts: names, descriptions and execution."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

from pin_nonideal.errors import InputError, nearest
from pin_nonideal.loading.library.example_scripts import example_files


def examples() -> list[tuple[str, str]]:
    """Return the examples as pairs of name and one-line description, in alphabetical order."""
    return [(name, _description(path)) for name, path in example_files().items()]


def run_example(name: str) -> Path:
    """Run an example, which writes its figure into the current folder, and return the path of the figure.

    Args:
        name: name of the example.

    Raises:
        InputError: there is no example of that name; the message has the nearest name.
    """
    files = example_files()
    if name not in files:
        raise InputError(f'no example "{name}"{nearest(name, files)}')
    runpy.run_path(str(files[name]), run_name="__main__")
    return Path(f"{name}.png")


def _description(path: Path) -> str:
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0].rstrip(".")
