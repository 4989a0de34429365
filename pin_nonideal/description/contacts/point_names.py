"""Names of contact points: the name of the pair of shapes and a number.

A scene of many shapes has a hundred thousand points, nearly all open, so their names are made on request.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import overload

# Maximum digits of the number of a point. Longer numbers are part of a name.
MAX_DIGITS = 9


def split_number(name: str) -> tuple[str, int]:
    """Return the name and the number of "NAME NUMBER", or (name, 0) for a name without a number.

    Args:
        name: any name.
    """
    base, _, number = name.rpartition(" ")
    is_number = number.isascii() and number.isdecimal() and number[0] != "0" and len(number) <= MAX_DIGITS
    return (base, int(number)) if base and is_number else (name, 0)


@dataclass(frozen=True)
class NumberedNames(Sequence[str]):
    """Names "NAME 1", "NAME 2" and so on.

    Attributes:
        name: name of the pair of shapes.
        numbers: numbers of the points.
    """

    name: str
    numbers: range

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, k: int) -> str: ...
    @overload
    def __getitem__(self, k: slice) -> NumberedNames: ...
    def __getitem__(self, k: int | slice) -> str | NumberedNames:
        """Return the name of one point, or the names of several points."""
        if isinstance(k, slice):
            return NumberedNames(self.name, self.numbers[k])
        return f"{self.name} {self.numbers[k]}"

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return (f"{self.name} {number}" for number in self.numbers)

    def __contains__(self, name: object) -> bool:
        """Check if a point has this name."""
        base, number = split_number(str(name))
        return base == self.name and number in self.numbers


class ContactOfPoint(Mapping[str, str]):
    """Contact of each point of the pairs of shapes with several points, by the name of the point.

    Args:
        points: names of points by pair, see `points_by_pair`.
    """

    def __init__(self, points: Mapping[str, Sequence[str]]) -> None:
        self._counts = {pair: len(names) for pair, names in points.items()}

    def __getitem__(self, name: str) -> str:
        """Return the contact of a point.

        Args:
            name: name of the point.

        Raises:
            KeyError: no pair of shapes with several points has a point of this name.
        """
        if not self.following(name):
            raise KeyError(name)
        return split_number(name)[0]

    def __contains__(self, name: object) -> bool:
        """Check if a name belongs to a point."""
        return isinstance(name, str) and self.following(name) > 0

    def following(self, name: str) -> int:
        """Return the number of points of a contact from this point on, or 0 for other names.

        Args:
            name: name of a point, or of another part of a scene.
        """
        if not self._counts:
            return 0
        base, number = split_number(name)
        count = self._counts.get(base, 0)
        return count - number + 1 if 1 <= number <= count else 0

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the points."""
        for pair, count in self._counts.items():
            yield from NumberedNames(pair, range(1, count + 1))

    def __len__(self) -> int:
        """Return the number of points."""
        return sum(self._counts.values())


NO_POINTS = ContactOfPoint({})


class UsedNames:
    """Names of the parts of a scene, among them the points of its pairs of shapes."""

    def __init__(self) -> None:
        self._names: set[str] = set()
        self._numbers: dict[str, set[int]] = {}  # of names with a number, by their base
        self._points: dict[str, list[range]] = {}

    def __contains__(self, name: object) -> bool:
        """Check if a part has this name."""
        base, number = split_number(str(name))
        return name in self._names or any(number in points for points in self._points.get(base, ()))

    def add(self, name: str) -> None:
        """Add the name of a part.

        Args:
            name: its name.
        """
        self._names.add(name)
        base, number = split_number(name)
        if number:
            self._numbers.setdefault(base, set()).add(number)

    def add_points(self, names: NumberedNames) -> str | None:
        """Add the names of points and return one that is used already, or None.

        Args:
            names: names of points of a pair of shapes.
        """
        taken = [number for number in self._numbers.get(names.name, ()) if number in names.numbers]
        before = self._points.setdefault(names.name, [])
        taken += [points[0] for points in before if points[0] in names.numbers]
        taken += [names.numbers[0] for points in before if names.numbers[0] in points]
        before.append(names.numbers)
        return f"{names.name} {min(taken)}" if taken else None

    def copy(self) -> UsedNames:
        """Return a copy."""
        return deepcopy(self)
