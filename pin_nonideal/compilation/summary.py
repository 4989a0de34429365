"""Tables of a scene's parts: `Scene.describe`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pin_nonideal.description.contacts.pair_of_shapes import PairOfShapes
from pin_nonideal.description.contacts.point_names import UsedNames
from pin_nonideal.description.drive_lists import drives_of
from pin_nonideal.states.joint_order import file_order
from pin_nonideal.types import Model, Table

from .compiled_scene import CompiledScene
from .resolver import unique_names

DRIVES = "list of drives"  # kind of an actuation of several drives
NO_LIMIT = 1e30  # models store infinity or the largest float for no limit


@dataclass(frozen=True)
class Description:
    """Parts of a scene as tables of plain values; `str` formats them as text.

    Attributes:
        name: name of the scene.
        joints: joints in the order of the model: name, kind, parent, indices in q and v (`q_first`, `nq`,
            `v_first`, `nv`), `file_index` (index in the robot's file if its order differs, else None),
            `lower` and `upper` position limits, `velocity` and `effort` limits (of the file, which the motion
            may pass; None for no limit), `friction` and `damping` of the file, `armature`.
        constraints: name, kind, `first` row and `rows` in `lam`, `dropped` rows, and arguments (`made_with`).
        contacts: the same columns as `constraints`.
        laws: name, kind and arguments.
        forces: kind and arguments.
        actuation: kind and arguments, or None. A list of drives has the kind "list of drives" and the drives
            as arguments.
    """

    name: str
    joints: list[Table]
    constraints: list[Table]
    contacts: list[Table]
    laws: list[Table]
    forces: list[Table]
    actuation: Table | None

    def to_dict(self) -> Table:
        """Return all tables as plain values for JSON."""
        return dataclasses.asdict(self)

    def __str__(self) -> str:
        lines = [self.name]
        keys = (
            "name",
            "kind",
            "parent",
            "q_first",
            "v_first",
            "lower",
            "upper",
            "effort",
            "friction",
            "damping",
        )
        lines += _table("joints", self.joints, keys)
        for title in ("constraints", "contacts"):
            lines += _table(title, getattr(self, title), ("name", "kind", "first", "rows", "made with"))
        lines += _table("laws", self.laws, ("name", "kind", "made with"))
        lines += _table("forces", self.forces, ("kind", "made with"))
        lines += _table("actuation", _drives(self.actuation), ("kind", "made with"))
        if any(joint["file_index"] is not None for joint in self.joints):
            filed = sorted(
                (j for j in self.joints if j["file_index"] is not None), key=lambda j: j["file_index"]
            )
            lines.append("order in the file: " + ", ".join(joint["name"] for joint in filed))
        return "\n".join(lines)


def _table(title: str, rows: Sequence[Table], keys: Sequence[str]) -> list[str]:
    """Return the lines of a table, with columns as wide as their longest cells."""
    if not rows:
        return []
    cells = [[_cell(row, key) for key in keys] for row in rows]
    widths = [max(len(key), *(len(row[k]) for row in cells)) for k, key in enumerate(keys)]
    lines = [
        "  " + "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (list(keys), *cells)
    ]
    return [title, *lines]


def _drives(actuation: Table | None) -> list[Table]:
    """Return the rows of the drives of an actuation."""
    if actuation is None:
        return []
    drives: list[Table] = actuation["made_with"]["drives"] if actuation["kind"] == DRIVES else [actuation]
    return drives


def _cell(row: Table, key: str) -> str:
    if key == "made with":
        own = {name: x for name, x in row["made_with"].items() if name != "name" and x not in (None, 0.0)}
        return ", ".join(f"{name}={_words(x)}" for name, x in own.items())
    return _words(row[key])


def _words(value: object) -> str:
    if isinstance(value, list):
        return " ".join(_words(x) for x in value)
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def describe(scene: CompiledScene, name: str) -> Description:
    """Return the tables of a scene.

    Args:
        scene: the compiled scene.
        name: name of the scene.
    """
    spec = scene.spec
    given = {c.name: c.given for c in spec.contacts if isinstance(c, PairOfShapes)}
    tables = [
        {
            "name": key,
            "first": first,
            "rows": end - first,
            "dropped": [r for n, r, _ in scene.dropped if n == key],
            **_kind_and_arguments(given.get(key) or scene.described[key]),
        }
        for key, (first, end, _) in scene.rows.items()
    ]
    held = len(spec.constraints)
    names = unique_names(spec.laws, UsedNames())
    return Description(
        name=name,
        joints=_joints(scene.model, scene),
        constraints=tables[:held],
        contacts=tables[held:],
        laws=[{"name": n, **_kind_and_arguments(law)} for n, law in zip(names, spec.laws, strict=True)],
        forces=[_kind_and_arguments(force) for force in spec.forces],
        actuation=None if spec.actuation is None else _kind_and_arguments(spec.actuation),
    )


def _joints(model: Model, scene: CompiledScene) -> list[Table]:
    """Return a row for each joint; missing limits are None."""
    order, rows = file_order(model), []
    for j, place in enumerate(scene.joints, start=1):
        dofs = slice(place.v_first, place.v_first + place.nv)
        own = slice(place.q_first, place.q_first + place.nq)
        limits = {"lower": model.lowerPositionLimit, "upper": model.upperPositionLimit}
        ranges = {"velocity": model.velocityLimit, "effort": model.upperEffortLimit}
        numbers = {
            "friction": model.upperDryFrictionLimit,
            "damping": model.damping,
            "armature": model.armature,
        }
        row: Table = {
            "name": place.name,
            "kind": place.kind.removeprefix("JointModel"),
            "parent": str(model.names[model.parents[j]]),
            "q_first": place.q_first,
            "nq": place.nq,
            "v_first": place.v_first,
            "nv": place.nv,
            "file_index": order.index(place.name) if order and place.name in order else None,
        }
        row |= {
            key: [_limit(x) for x in values[own]] if place.nq == place.nv else None
            for key, values in limits.items()
        }
        row |= {key: [_limit(x) for x in values[dofs]] for key, values in ranges.items()}
        row |= {key: [float(x) for x in values[dofs]] for key, values in numbers.items()}
        rows.append(row)
    return rows


def _limit(x: float) -> float | None:
    """Return a finite limit, or None."""
    return float(x) if np.isfinite(x) and abs(x) < NO_LIMIT else None


def _kind_and_arguments(spec: object) -> Table:
    """Return the kind of a description and its arguments as plain values; functions appear by name."""
    fields = (
        {f.name: getattr(spec, f.name) for f in dataclasses.fields(spec)}
        if dataclasses.is_dataclass(spec)
        else {}
    )
    kind, drives = type(spec).__name__, drives_of(spec)
    if drives and drives[0] is not spec:
        kind, fields = DRIVES, {"drives": [_kind_and_arguments(drive) for drive in drives]}
    elif kind in ("ndarray", "list", "tuple"):
        kind, fields = "constant torques", {"torque": spec}
    elif isinstance(spec, Mapping):
        kind, fields = "constant torques", dict(spec)
    elif kind == "function":
        kind, fields = "function (t, q, v)", {"function": spec}
    return {"kind": kind, "made_with": {key: _plain_value(x) for key, x in fields.items()}}


def _plain_value(x: object) -> object:
    if isinstance(x, np.ndarray):
        return x.tolist()
    if isinstance(x, (list, tuple)):
        return [_plain_value(each) for each in x]
    if isinstance(x, Mapping):
        return {str(name): _plain_value(each) for name, each in x.items()}
    if isinstance(x, np.generic):
        return x.item()
    if x is None or isinstance(x, (bool, int, float, str)):
        return x
    return str(getattr(x, "__name__", None) or getattr(x, "name", None) or type(x).__name__)
