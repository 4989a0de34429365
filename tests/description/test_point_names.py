"""Names of contact points are made on request, and equal to names that are written out."""

from __future__ import annotations

import pytest

from pin_nonideal.description.contacts.point_names import (
    NO_POINTS,
    ContactOfPoint,
    NumberedNames,
    UsedNames,
    split_number,
)

POINTS = {"left on floor": 3, "right": 2}


def points() -> dict[str, NumberedNames]:
    """Return names of points by pair."""
    return {pair: NumberedNames(pair, range(1, count + 1)) for pair, count in POINTS.items()}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("left on floor 12", ("left on floor", 12)),
        ("left", ("left", 0)),
        ("left 0", ("left 0", 0)),
        ("left 07", ("left 07", 0)),
        ("left -1", ("left -1", 0)),
        ("left 1.5", ("left 1.5", 0)),
        ("left ²", ("left ²", 0)),
        ("left " + 5000 * "9", ("left " + 5000 * "9", 0)),
        ("left ", ("left ", 0)),
        (" 3", (" 3", 0)),
        ("3", ("3", 0)),
        ("", ("", 0)),
    ],
)
def test_a_name_with_a_number_is_split(name: str, expected: tuple[str, int]) -> None:
    assert split_number(name) == expected


def test_numbered_names_are_a_sequence_of_names() -> None:
    written = [f"left {k}" for k in range(4, 9)]
    names = NumberedNames("left", range(4, 9))
    assert list(names) == written
    assert [names[k] for k in range(-5, 5)] == [written[k] for k in range(-5, 5)]
    assert list(names[1:3]) == written[1:3]
    assert names.index("left 6") == written.index("left 6")
    assert [name in names for name in ("left 4", "left 9", "left", "right 4")] == [True, False, False, False]
    with pytest.raises(IndexError):
        names[5]


def test_points_belong_to_their_contacts() -> None:
    contact_of = ContactOfPoint(points())
    written = {name: pair for pair, names in points().items() for name in names}
    assert dict(contact_of) == written
    assert len(contact_of) == len(written)
    for name in (*written, "left on floor", "left on floor 4", "right 0", "right 03", "right one", "", "2"):
        assert contact_of.get(name) == written.get(name)
        assert (name in contact_of) == (name in written)
    assert [contact_of.following(name) for name in written] == [3, 2, 1, 2, 1]
    assert contact_of.following("right 3") == 0
    assert not NO_POINTS
    assert NO_POINTS.get("right 1") is None


def test_a_name_is_used_once() -> None:
    used = UsedNames()
    used.add("left 2")
    used.add("left")
    assert "left 2" in used
    assert "left 3" not in used
    before = used.copy()
    assert used.add_points(NumberedNames("left", range(1, 4))) == "left 2"
    assert used.add_points(NumberedNames("right", range(1, 4))) is None
    assert used.add_points(NumberedNames("right", range(4, 6))) is None
    assert used.add_points(NumberedNames("right", range(5, 8))) == "right 5"
    assert used.add_points(NumberedNames("right", range(3, 5))) == "right 3"
    assert "right 3" in used
    assert "right 9" not in used
    assert "right 3" not in before
    assert before.add_points(NumberedNames("left", range(3, 5))) is None
