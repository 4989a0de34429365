"""Sentences name their subjects: the style of CONTRIBUTING.md, counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.prose import Sentence, bullets_of, count, literal_sentences_of, sentences_of, sources_below

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
ROOMS += [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/index.md")]
ROOMS += [*sorted(PACKAGE.glob("*.py")), PACKAGE / "_core.pyi"]
LIMITS = ROOT / "docs" / "reference" / "limits.md"
MAX_SENTENCES_OF_LIMIT = 2
MIN_MESSAGES, MIN_LIMITS = 500, 100  # fewer would mean that the reader of literals or items fails


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_sentences_name_their_subjects(room: Path) -> None:
    found = [sentence for path in sources_below(room) for sentence in sentences_of(path)]
    counts = count(found)
    listed = [f"{s.path}:{s.line}: {s.text}" for s in found if s.has_what or s.has_opener]
    assert counts.whats_per_100 <= MAX_WHATS_PER_100, listed
    assert counts.openers_percent <= MAX_OPENERS_PERCENT, listed


def test_messages_name_their_subjects() -> None:
    found = [
        sentence
        for path in sources_below(PACKAGE)
        if path.suffix in {".py", ".pyi", ".hpp", ".cpp", ".js"}
        for sentence in literal_sentences_of(path)
    ]
    assert len(found) > MIN_MESSAGES
    assert not [f"{s.path}:{s.line}: {s.text}" for s in found if s.has_what or s.has_opener]


def test_limits_have_at_most_two_sentences() -> None:
    items = list(bullets_of(LIMITS))
    assert len(items) > MIN_LIMITS
    assert not [(line, len(item), item) for line, item in items if len(item) > MAX_SENTENCES_OF_LIMIT]


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


def test_string_literals_are_read(tmp_path: Path) -> None:
    source = tmp_path / "a.py"
    source.write_text(
        '"""Page."""\nx = f"joint {1} has too many bounds; " "remove one"\ny = "plot: what must be str"\n'
    )
    assert [s.text for s in literal_sentences_of(source)] == [
        "joint `x` has too many bounds; remove one",
    ]
    header = tmp_path / "a.hpp"
    header.write_text(
        '// "One comment of words".\nf("Mode of an element", "slip");\ng("two halves "\n "of one text");\n'
    )
    assert [s.text for s in literal_sentences_of(header)] == ["Mode of an element", "two halves of one text"]


def test_items_of_a_list_are_split_into_sentences(tmp_path: Path) -> None:
    page = tmp_path / "a.md"
    page.write_text("Text. Text.\n\n- **One.** Two, e.g. this.\n  3 more. `Four`.\n- One.\n\nText.\n")
    assert [(line, len(item)) for line, item in bullets_of(page)] == [(3, 4), (5, 1)]
