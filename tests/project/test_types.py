"""Signatures name real types: uses of `Any` are counted, and the count may only shrink."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "pin_nonideal"
MAX_ANY = 250  # lines with the word `Any`, including imports; lower this number after a removal


def lines_with_any(text: str) -> int:
    """Return the number of lines that contain the word `Any`."""
    return sum(bool(re.search(r"\bAny\b", line)) for line in text.splitlines())


def test_any_becomes_rarer() -> None:
    counts = {
        str(path.relative_to(PACKAGE)): lines_with_any(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
    }
    most = sorted(counts.items(), key=lambda item: -item[1])[:10]
    assert sum(counts.values()) <= MAX_ANY, f"replace Any by a type; most uses: {most}"


def test_words_that_contain_any_do_not_count() -> None:
    assert lines_with_any("from typing import Any\nx: Any = anything(Anything)\nmany = 1") == 2
