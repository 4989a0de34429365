"""Example scripts, by name."""

from __future__ import annotations

from pathlib import Path


def example_files() -> dict[str, Path]:
    """Return the example scripts by name: installed with the package, or beside it in a checkout."""
    here = Path(__file__).resolve().parents[2]
    for folder in (here / "examples", here.parent / "examples"):
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.glob("*.py"))}
    return {}
