"""Example scripts, by name."""

from __future__ import annotations

from pathlib import Path


def example_files() -> dict[str, Path]:
    """Return the example scripts by name: installed with the package, or beside it in a checkout."""
    root = Path(__file__).resolve().parents[2]
    for folder in (root / "examples", root.parent / "examples"):
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.glob("*.py"))}
    return {}
