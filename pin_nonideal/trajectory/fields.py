"""Fields of a run: the data of a `Trajectory`, which its records, columns and files read."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.errors import UnknownNameError, nearest
from pin_nonideal.states.joint_layout import JointPlace
from pin_nonideal.types import Array, Table

from .dense_output import DenseOutput
from .groups import RECORD_OF, Group, GroupField
from .lazy_fields import LazyFields
from .missing_array import REASONS, ArrayField
from .point_samples import PointSamples
from .records import ContactPoints, Event, Stats, UserEventRecord

_MISSING: Any = None  # the attribute returns a MissingArray instead


@dataclass(frozen=True, eq=False, repr=False)
class RunFields(LazyFields):
    """Fields of a run. `Trajectory` documents each field and adds the public methods."""

    t: Array
    q: Array
    v: Array
    violation: Array
    violation_rate: Array
    a: Array = _MISSING
    tau: Array = _MISSING
    F_ideal: Array = _MISSING
    F_nonideal: Array = _MISSING
    lam: Array = _MISSING
    lam_ideal: Array = _MISSING
    energy: dict[str, Array] | None = None
    power: dict[str, Array] | None = None
    z: Array | None = None
    modes: NDArray[np.int8] | None = None
    closed: NDArray[np.bool_] | None = None
    limits: Array = _MISSING
    law_forces: dict[str, Array] | None = None
    reactions: dict[str, Array] | None = None
    contact_forces: dict[str, Array] | None = None
    contact_torques: dict[str, Array] | None = None
    contact_points: dict[str, ContactPoints] | None = None
    points: PointSamples | None = None
    grid: NDArray[np.bool_] | None = None
    dense: DenseOutput | None = None
    user_events: list[UserEventRecord] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    stats: Stats = field(default_factory=Stats)
    scene: Any = None
    element_names: list[str] = field(default_factory=list)
    element_laws: list[int] = field(default_factory=list)
    law_names: list[str] = field(default_factory=list)
    law_dofs: list[list[int]] = field(default_factory=list)
    joints: list[JointPlace] = field(default_factory=list)
    rows: dict[str, tuple[int, int, bool]] = field(default_factory=dict)
    name: str = ""
    notes: list[str] = field(default_factory=list)
    failure: str | None = None

    def attributes(self) -> Table:
        """Return all fields by name, with stand-ins for arrays that the run did not record."""
        return {name: getattr(self, name) for name in vars(self)}

    def recorded(self, field: str) -> bool:
        """Return whether the run has a field, such as "lam"; see the attributes of this class.

        Args:
            field: name of the attribute.

        Raises:
            UnknownNameError: there is no such attribute.
        """
        fields = vars(self)
        if field not in fields:
            raise UnknownNameError(f'recorded: no field "{field}" of a run{nearest(field, fields)}')
        return fields[field] is not None


_DEFAULTS: Table = {}
_MAKERS: dict[str, Callable[[], object]] = {}
for _field in dataclasses.fields(RunFields):
    if _field.default is not dataclasses.MISSING:
        _DEFAULTS[_field.name] = _field.default
        # attributes of the class would hide the fields that `later` computes
        delattr(RunFields, _field.name)
    elif _field.default_factory is not dataclasses.MISSING and _field.name != "stats":
        _MAKERS[_field.name] = _field.default_factory

for _name in RECORD_OF:
    setattr(RunFields, _name, GroupField(_name))
for _name in REASONS:
    setattr(RunFields, _name, ArrayField(_name))


def with_defaults(fields: Table) -> Table:
    """Return all fields of a Trajectory except its counters: given fields, and defaults for the others."""
    missing = {name: make() for name, make in _MAKERS.items() if name not in fields}
    return {**_DEFAULTS, **missing, **fields}


def reactions_of(run: RunFields) -> Group[Array]:
    """Return the wrenches of a run by name, in a table whose errors name the missing record.

    Args:
        run: fields of the run.
    """
    group = run.reactions
    assert isinstance(group, Group)  # a GroupField returns no other type
    return group
