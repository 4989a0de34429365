"""Trajectories as tables of named columns with units."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterator, Sequence
from itertools import compress
from typing import cast

import numpy as np

from pin_nonideal.states.joint_layout import JointPlace
from pin_nonideal.types import Array

from .by_name import joint_record
from .fields import RunFields

# Kinds of joints by prefix, with the units of their positions in a `JointRecord` and of their rates.
# Kinds that are not listed, such as composites, have unknown units.
KINDS = (
    ("JointModelFreeFlyer", ("m",) * 3 + ("1",) * 4, ("m",) * 3 + ("rad",) * 3),
    ("JointModelPlanar", ("m", "m", "rad"), ("m", "m", "rad")),
    ("JointModelTranslation", ("m",) * 3, ("m",) * 3),
    ("JointModelSphericalZYX", ("rad",) * 3, ("rad",) * 3),
    ("JointModelSpherical", ("1",) * 4, ("rad",) * 3),
    ("JointModelEllipsoid", ("rad",) * 3, ("rad",) * 3),
    ("JointModelUniversal", ("rad",) * 2, ("rad",) * 2),
    ("JointModelR", ("rad",), ("rad",)),
    ("JointModelH", ("rad",), ("rad",)),
    ("JointModelP", ("m",), ("m",)),
)
JointEntry = tuple[
    str, int, int, list[str]
]  # name of a joint, first dof, nv, units of its generalized forces
FORCE_OF = {"m": "N", "rad": "N m"}  # unit of a force by that of the motion on which it does work
RATES = {"v": "/s", "a": "/s^2"}
EITHER_FORCE = (
    "N or N m"  # of rows and elements, some of which are along a displacement and some about an axis
)


def columns(run: RunFields) -> dict[str, Array]:
    """Return all recorded values as named columns, (nt,) each.

    Args:
        run: trajectory of the run.
    """
    return {name: values for name, (values, _) in _with_units(_all(run)).items()}


def acting_columns(run: RunFields) -> dict[str, Array]:
    """Return the columns of a run that may change, (nt,) each.

    Forces of laws in joints on which the laws do not act are left out, and the columns of contacts that are
    open at all samples.

    Args:
        run: trajectory of the run.
    """
    left_out = open_contacts(run)
    return {name: values for name, (values, _) in _with_units(_all(run, True, left_out)).items()}


def open_contacts(run: RunFields) -> frozenset[str]:
    """Return the names of the contacts that are open at all samples of a run.

    Args:
        run: trajectory of the run.
    """
    if run.scene is None or not run.recorded("closed"):
        return frozenset()
    return frozenset(compress(run.scene.contact_names, ~np.any(run.closed, axis=0)))


def motion_columns(run: RunFields, fields: Collection[str]) -> dict[str, Array]:
    """Return the columns of some fields of the joints and of the energies, (nt,) each.

    Energies of contacts that are open at all samples are left out.

    Args:
        run: trajectory of the run.
        fields: fields out of "q", "v", "a", "tau" and "energy".
    """
    table = {
        column_name(name): values
        for name, values, _ in _joints(run)
        if name.removesuffix(_number(name)).rpartition(".")[2] in fields
    }
    energy, left_out = run.energy or {}, open_contacts(run)
    if "energy" in fields:
        table |= {column_name(f"energy.{name}"): energy[name] for name in energy if name not in left_out}
    return table


def units(run: RunFields) -> dict[str, str]:
    """Unit of each column, "1" for numbers without one and empty if it is unknown.

    Args:
        run: the Trajectory.
    """
    return {name: unit for name, (_, unit) in _with_units(_all(run)).items()}


def column_name(name: str) -> str:
    """Return a name as columns contain it: each space becomes "_".

    Args:
        name: name of a joint, constraint, law or ledger.
    """
    return "_".join(name.split())


def _number(name: str) -> str:
    """Return the number of a component at the end of a column's name, such as ".2", or ""."""
    _, dot, last = name.rpartition(".")
    return dot + last if last.isdigit() else ""


def _with_units(entries: Iterator[tuple[str, Array, str]]) -> dict[str, tuple[Array, str]]:
    """Columns and their units by name without spaces."""
    table: dict[str, tuple[Array, str]] = {}
    for words, values, unit in entries:
        base = column_name(words)
        name, number = base, 1
        while name in table:
            number += 1
            name = f"{base}_{number}"
        table[name] = (values, unit)
    return table


def _all(
    run: RunFields, acting: bool = False, left_out: Collection[str] = ()
) -> Iterator[tuple[str, Array, str]]:
    """Each column as its name, its values and its unit.

    Args:
        run: trajectory of the run.
        acting: whether to leave out forces of laws in joints on which they do not act.
        left_out: contacts without columns.
    """
    yield "t", run.t, "s"
    yield from _joints(run)
    places = [(p.name, p.v_first, p.nv, [FORCE_OF.get(u, "") for u in _motion(p)[1]]) for p in run.joints]
    for field, values, dofs in _by_dof(run, left_out):
        for joint, first, nv, forces in _among(places, dofs) if acting else places:
            part = _of_dofs(values, dofs, first, nv)
            yield from _number_columns(f"{joint}.{field}", part[:, 0] if nv == 1 else part, forces)
    yield from _remaining_columns(run, left_out)


def _of_dofs(values: Array, dofs: Sequence[int], first: int, nv: int) -> Array:
    """Return the columns of the degrees of freedom of a joint, (nt, nv), zero if no value belongs to them.

    Args:
        values: values by degree of freedom, (nt, n).
        dofs: degree of freedom of each column, (n,), ascending.
        first: first degree of freedom of the joint.
        nv: number of its degrees of freedom.
    """
    start, stop = bisect_left(dofs, first), bisect_left(dofs, first + nv)
    if stop - start == nv:
        return values[:, start:stop]
    part = np.zeros((len(values), nv))
    part[:, [dof - first for dof in dofs[start:stop]]] = values[:, start:stop]
    return part


def _among(places: Sequence[JointEntry], dofs: Collection[int]) -> Iterator[JointEntry]:
    """Yield the joints with one of some degrees of freedom."""
    ends = [first + nv for _, first, nv, _ in places]
    for k in sorted({bisect_right(ends, dof) for dof in dofs}):
        yield places[k]


def _joints(run: RunFields) -> Iterator[tuple[str, Array, str]]:
    """Yield the motion and the actuation of each joint."""
    for place in run.joints:
        record = joint_record(run, place.name)
        position, rate = _motion(place)
        forces = [FORCE_OF.get(unit, "") for unit in rate]
        per = {"q": position, "tau": forces}
        per |= {key: [unit and unit + end for unit in rate] for key, end in RATES.items()}
        for field in filter(run.recorded, ("q", "v", "a", "tau")):
            yield from _number_columns(f"{place.name}.{field}", getattr(record, field), per[field])


def _remaining_columns(run: RunFields, left_out: Collection[str]) -> Iterator[tuple[str, Array, str]]:
    """Yield values of rows, elements, reactions and laws, energies, powers and violations."""
    for name, (first, end, _) in run.rows.items():
        if name in left_out:
            continue
        for field in ("lam", "lam_ideal"):
            if run.recorded(field):
                own = getattr(run, field)[:, first:end]
                yield from _number_columns(f"{name}.{field}", own, [EITHER_FORCE] * (end - first))
    for k, name in enumerate(run.element_names):
        if left_out and run.law_names[run.element_laws[k]] in left_out:
            continue
        for column, field, unit in (("mode", "modes", "1"), ("limit", "limits", EITHER_FORCE)):
            if run.recorded(field):
                yield f"{name}.{column}", cast("Array", getattr(run, field)[:, k]), unit
    for name, values in (run.reactions or {}).items():
        if name not in left_out:
            yield from _number_columns(f"{name}.reaction", values[:, :6], ["N"] * 3 + ["N m"] * 3)
    for field, unit in (("energy", "J"), ("power", "W")):
        for name, values in (getattr(run, field) or {}).items():
            if name not in left_out:
                yield f"{field}.{name}", values, unit
    if run.z is not None:
        yield from _number_columns("z", run.z, [])
    yield "violation", run.violation, "m or rad"
    yield "violation_rate", run.violation_rate, "m/s or rad/s"


def _motion(place: JointPlace) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Units of the positions and of the displacements of a joint."""
    for kind, position, rate in KINDS:
        if place.kind.startswith(kind):
            return position, rate
    return (), ("",) * place.nv


def _by_dof(run: RunFields, left_out: Collection[str]) -> Iterator[tuple[str, Array, Sequence[int]]]:
    """Yield the fields that have a column for each degree of freedom, with the dofs on which they act."""
    for field in ("F_ideal", "F_nonideal"):
        if run.recorded(field):
            yield field, getattr(run, field), range(run.v.shape[1])
    dofs = dict(zip(run.law_names, run.law_dofs, strict=True)) if run.law_forces else {}
    for name, part in (run.law_forces or {}).items():
        if name in left_out:
            continue
        order = np.argsort(dofs[name], kind="stable")
        yield f"C.{name}", part[:, order], np.asarray(dofs[name])[order].tolist()


def _number_columns(name: str, values: Array, units: Sequence[str]) -> Iterator[tuple[str, Array, str]]:
    """Yield one column under the given name, or several columns under numbered names."""
    if values.ndim == 1:
        yield name, values, units[0] if len(units) == 1 else ""
        return
    known = len(units) == values.shape[1]
    for k in range(values.shape[1]):
        yield f"{name}.{k}", values[:, k], units[k] if known else ""
