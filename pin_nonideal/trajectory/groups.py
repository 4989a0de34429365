"""Quantities of a run that are recorded by name: tables that explain a missing name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.types import Table

from .missing_array import RunField

# Groups of a Trajectory, with the value of `record` that records them.
RECORD_OF = {
    "energy": "energy",
    "power": "power",
    "law_forces": "laws",
    "reactions": "reactions",
    "contact_forces": "forces",
    "contact_torques": "forces",
    "contact_points": "contact_points",
}
Value = TypeVar("Value")


class Group(dict[str, Value]):
    """Arrays or records by name; empty, and false in a condition, if they were not recorded.

    Args:
        field: field of the Trajectory.
        arrays: arrays by name, (nt,) or (nt, n), or None if they were not recorded.

    Attributes:
        field: see above.
        recorded: whether the run recorded them.
    """

    def __init__(self, field: str, arrays: Mapping[str, Value] | None) -> None:
        super().__init__(arrays or {})
        self.field, self.recorded = field, arrays is not None

    def __missing__(self, name: object) -> Value:
        if not self.recorded:
            raise InputError(
                f'run.{self.field} was not recorded; pass record="{RECORD_OF[self.field]}" to simulate'
            )
        raise UnknownNameError(f'run.{self.field} has no "{name}"{nearest(str(name), self)}')


class GroupField(RunField):
    """Attribute of a Trajectory that returns its `Group`."""

    def value(self, fields: Table) -> Group[object]:
        """Return the group, and store it if its arrays were recorded."""
        arrays = fields[self._field]
        if isinstance(arrays, Group):
            return arrays
        group: Group[object] = Group(self._field, arrays)
        if group.recorded:
            fields[self._field] = group
        return group

    def __set__(self, run: object, arrays: Mapping[str, object] | None) -> None:
        empty = isinstance(arrays, Group) and not arrays.recorded
        vars(run)[self._field] = None if empty else arrays
