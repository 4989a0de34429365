"""Trajectories as tables of named columns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pin_nonideal.types import Array


def columns(run: Any) -> dict[str, Array]:
    """Return all recorded values as named columns, (nt,) each.

    Args:
        run: trajectory of the run.
    """
    table: dict[str, Array] = {"t": run.t}
    for place in run.joints:
        record = run.joint(place.name)
        for field in ("q", "v", "a", "tau"):
            table |= _numbered(f"{place.name}.{field}", getattr(record, field))
    for field, values in _by_dof(run):
        for place in run.joints:
            part = values[:, place.v_first : place.v_first + place.nv]
            table |= _numbered(f"{place.name}.{field}", part[:, 0] if place.nv == 1 else part)
    for name, (first, end, _) in run.rows.items():
        for field in ("lam", "lam_ideal"):
            values = getattr(run, field)
            table |= _numbered(f"{name}.{field}", None if values is None else values[:, first:end])
    for k, name in enumerate(run.element_names):
        for field, values in (("mode", run.modes), ("limit", run.limits)):
            table |= {} if values is None else {f"{name}.{field}": values[:, k]}
    for name, values in (run.reactions or {}).items():
        table |= _numbered(f"{name}.reaction", values[:, :6])
    for field in ("energy", "power"):
        table |= {f"{field}.{name}": values for name, values in (getattr(run, field) or {}).items()}
    table |= _numbered("z", run.z)
    return table | {"violation": run.violation, "violation_rate": run.violation_rate}


def _by_dof(run: Any) -> Iterator[tuple[str, Array]]:
    """Yield the fields that have a column for each degree of freedom."""
    for field in ("F_ideal", "F_nonideal"):
        if getattr(run, field) is not None:
            yield field, getattr(run, field)
    for name in run.law_forces or ():
        force = run.law(name).force
        assert force is not None
        yield f"C {name}", np.asarray(force)


def _numbered(name: str, values: Array | None) -> dict[str, Array]:
    """Return one column under the given name, several columns under numbered names, or no column for None."""
    if values is None or values.ndim == 1:
        return {} if values is None else {name: values}
    return {f"{name}.{k}": values[:, k] for k in range(values.shape[1])}
