"""Sentences name their subjects: the style of CONTRIBUTING.md, counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.prose import Sentence, count, sentences_of, sources_below

ROOT = Path(__file__).parents[2]
MAX_WHATS_PER_100 = 1.0
MAX_OPENERS_PERCENT = 2.0

PACKAGE = ROOT / "pin_nonideal"
ROOMS = [
    PACKAGE / "_core" / room.name if room.parent.name == "_core" else room
    for parent in (PACKAGE, PACKAGE / "_core")
    for room in sorted(parent.iterdir())
    if room.is_dir() and room.name not in {"_core", "__pycache__", "robots"}
]
ROOMS += [ROOT / name for name in ("benchmarks", "examples", "oracles", "tests")]
ROOMS += [ROOT / "docs" / name for name in ("explanation", "how_to", "reference", "tutorials")]
ROOMS += [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "docs" / "index.md"]


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_sentences_name_their_subjects(room: Path) -> None:
    found = [sentence for path in sources_below(room) for sentence in sentences_of(path)]
    counts = count(found)
    listed = [f"{s.path}:{s.line}: {s.text}" for s in found if s.has_what or s.has_opener]
    assert counts.whats_per_100 <= MAX_WHATS_PER_100, listed
    assert counts.openers_percent <= MAX_OPENERS_PERCENT, listed


def test_relative_clauses_in_place_of_nouns_are_counted() -> None:
    riddle = Sentence(Path("x"), 1, "What rests goes on resting of those that stick.")
    plain = Sentence(Path("x"), 1, "A contact at rest stays at rest if its friction holds.")
    assert riddle.has_what
    assert riddle.has_opener
    assert not plain.has_what
    assert not plain.has_opener
    assert count([riddle, plain]).whats_per_100 == 50.0


def test_comments_and_docstrings_are_read(tmp_path: Path) -> None:
    source = tmp_path / "a.py"
    source.write_text(
        '"""One sentence about a thing.\n\nAnother sentence about it."""\n# A comment over\n# two lines.\n'
    )
    assert [s.text for s in sentences_of(source)] == [
        "One sentence about a thing.",
        "Another sentence about it.",
        "A comment over two lines.",
    ]
    header = tmp_path / "a.hpp"
    header.write_text(
        "int x;  // first line of a\n        // longer comment here.\n/* Block of four words. */\n"
    )
    assert [s.text for s in sentences_of(header)] == [
        "first line of a longer comment here.",
        "Block of four words.",
    ]
