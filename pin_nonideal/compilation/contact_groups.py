"""Contacts of the user and their points in the core: a pair of shapes is one contact with several points.

The core has a row, a friction element and a law for each contact point. No other module relates the entries
of the core to the contacts of the user.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts import JointLimit
from pin_nonideal.description.contacts.pair_of_shapes import ContactGroup, PairOfShapes
from pin_nonideal.description.contacts.point_names import ContactOfPoint, split_number
from pin_nonideal.states.rows import names_by_row
from pin_nonideal.types import Array

STOPS = ("lower", "upper")  # sides of a joint limit, which end the names of its stops

# Modes of friction elements.
SLIP_PLUS, SLIP_MINUS = int(core.Mode.slip_plus), int(core.Mode.slip_minus)
STICK, OPEN = int(core.Mode.sticking), int(core.Mode.unloaded)


class Groups:
    """Entries of the core by the contacts of the user; the points of a contact follow each other.

    Args:
        names: name of each entry, such as a row, a friction element or a law. All points of a contact have an
            entry, or none.
        contact_of: contact of each point of the pairs of shapes with several points.

    Attributes:
        names: name of each group: of the contact, or of its only entry.
        starts: first entry of each group, (n,).
        count: number of entries.
        single: whether each group has one entry.
    """

    def __init__(self, names: Sequence[str], contact_of: ContactOfPoint) -> None:
        self.names: list[str] = []
        self.count, starts, k = len(names), [], 0
        while k < self.count:
            points = contact_of.following(names[k])
            starts.append(k)
            self.names.append(contact_of[names[k]] if points else names[k])
            k += points or 1
        self.starts = np.array(starts, dtype=np.intp)
        self.single = len(starts) == self.count

    @property
    def index(self) -> NDArray[np.intp]:
        """Group of each entry, (count,)."""
        return np.repeat(np.arange(len(self.starts)), self.sizes)

    @property
    def sizes(self) -> NDArray[np.intp]:
        """Number of entries of each group, (n,)."""
        return np.diff(np.append(self.starts, self.count))

    def slices(self) -> dict[str, slice]:
        """Return the entries of each group by name."""
        ends = (self.starts + self.sizes).tolist()
        return {n: slice(a, b) for n, a, b in zip(self.names, self.starts.tolist(), ends, strict=True)}

    def any(self, values: NDArray[np.bool_], axis: int = -1) -> NDArray[np.bool_]:
        """Check if any entry of each group is true.

        Args:
            values: values of the entries.
            axis: axis of the entries.
        """
        return values if self.single else np.logical_or.reduceat(values, self.starts, axis)

    def sum(self, values: Array, axis: int = -1) -> Array:
        """Compute the sum over the entries of each group.

        Args:
            values: values of the entries.
            axis: axis of the entries.
        """
        return values if self.single else np.add.reduceat(values, self.starts, axis)

    def least(self, values: Array, axis: int = -1) -> Array:
        """Return the least value of each group.

        Args:
            values: values of the entries.
            axis: axis of the entries.
        """
        return values if self.single else np.minimum.reduceat(values, self.starts, axis)

    def modes(self, modes: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return the mode of each group: slip if any entry slips, else stick if any sticks, else open.

        Args:
            modes: modes by entry, (..., count).
        """
        if self.single:
            return modes
        found = [self.any(modes == mode) for mode in (SLIP_PLUS, SLIP_MINUS, STICK)]
        return np.select(found, [SLIP_PLUS, SLIP_MINUS, STICK], OPEN).astype(np.int8)


class Descriptions(Mapping[str, object]):
    """Description of each constraint and contact point by name; both stops of a joint share one.

    Args:
        described: descriptions that were added one by one.
        pairs: pairs of shapes, whose points are described on request.
        contact_of: contact of each point of the pairs with several points.
        names: names of all constraints and contact points.
    """

    def __init__(
        self,
        described: Mapping[str, object],
        pairs: Iterable[PairOfShapes],
        contact_of: Mapping[str, str],
        names: Collection[str],
    ) -> None:
        self._described, self._contact_of, self._names = described, contact_of, names
        self._pairs = {pair.name: pair for pair in pairs}
        limits = (name for name, c in described.items() if isinstance(c, JointLimit))
        self._stops = {f"{name} {side}" for name in limits for side in STOPS}

    def __getitem__(self, name: str) -> object:
        """Return the description of a constraint or contact point."""
        if name in self._contact_of:
            pair, number = split_number(name)
            return self._pairs[pair].points[number - 1]
        return self._described[name if name in self._described else name.rpartition(" ")[0]]

    def single(self) -> Iterator[tuple[str, object]]:
        """Yield names and descriptions, without contacts of a `ContactGroup`."""
        for name in self._names:
            if name in self._described:
                if not isinstance(self._described[name], ContactGroup):
                    yield name, self._described[name]
            elif name in self._stops:
                yield name, self[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self._names)


class RowGroups(NamedTuple):
    """Rows of the core by the rows of the user: a pair of shapes has one, and its multiplier is a sum.

    Attributes:
        groups: groups of the rows of the core.
        slices: rows of the user of each constraint and contact, by name.
    """

    groups: Groups
    slices: dict[str, slice]


def grouped_rows(program: core.Program | core.Builder, contact_of: ContactOfPoint) -> RowGroups:
    """Return the rows of `lam` of each constraint and contact of the user, as groups of rows of the core.

    Args:
        program: the core's program, finished or under construction.
        contact_of: contact of each point; a point has one row.
    """
    names, counts = names_by_row(program)
    owners = Groups(names, contact_of)
    row_names = [name for name, count in zip(names, counts, strict=True) for _ in range(count)]
    first, shown = 0, {}
    for name, owner in zip(owners.names, owners.starts.tolist(), strict=True):
        shown[name] = slice(first, first + counts[owner])
        first = shown[name].stop
    return RowGroups(Groups(row_names, contact_of), shown)


def points_by_pair(contacts: Iterable[object]) -> dict[str, Sequence[str]]:
    """Return the names of the points of each pair of shapes with several points.

    Args:
        contacts: descriptions, with pairs of shapes in place of their descriptions.
    """
    named = ((c.name, c.names) for c in contacts if isinstance(c, PairOfShapes))
    return {pair: names for pair, names in named if len(names) > 1}


def contact_names(names: Iterable[str], contact_of: Mapping[str, str]) -> list[str]:
    """Return names with contacts in place of their points, each once.

    Args:
        names: names of points, contacts and other parts.
        contact_of: contact of each point.
    """
    return list(dict.fromkeys(contact_of.get(name, name) for name in names))
