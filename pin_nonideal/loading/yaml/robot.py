"""robot.yaml: data that URDF cannot express, as a table of plain values that is converted to descriptions.

The keys are a superset of the keys in community repositories of closed-loop robots. The file contains data
only; no content is executed.

This module checks the keys and reads closed_loop and type. Other modules read the values of other keys:

| keys | module |
| --- | --- |
| model | `loading/robot_files.py`, and `loading/edit/tree.py` for base and locked |
| constraints, laws, contacts, forces, impact, gravity | `assembly.py` |
| actuation | `actuation.py` |
| initial | `initial_state.py` |
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

from pin_nonideal.description import actuation, constraints, contacts, forces, laws
from pin_nonideal.description import time_functions as timefunctions
from pin_nonideal.description.constraints import Constraint
from pin_nonideal.description.time_functions import TimeFunction
from pin_nonideal.errors import InputError, LoadingError, nearest, short_repr
from pin_nonideal.geometry.from_model import GeometryContact
from pin_nonideal.geometry.ground import ground
from pin_nonideal.types import GeometryObject, Table
from pin_nonideal.validation import number

from .plain_values import plain_yaml

COMMUNITY_KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")
OWN_KEYS = (
    "description",
    "source",
    "licence",
    "model",
    "constraints",
    "laws",
    "contacts",
    "impact",
    "forces",
    "actuation",
    "initial",
    "gravity",
    "notes",
)
MODEL_KEYS = (
    "urdf",
    "example_robot_data",
    "generator",
    "free_flyer",
    "locked",
    "helical",
    "base",
    "parameters",
)

CONSTRAINTS = {c.__name__: c for c in get_args(constraints.Constraint) if not c.__name__.startswith("User")}
LAWS = {c.__name__: c for c in get_args(laws.Law) if not c.__name__.startswith("User")}
CONTACTS = {
    c.__name__: c for c in (*get_args(contacts.Contact), GeometryContact) if not c.__name__.startswith("User")
}
FORCES = {c.__name__: c for c in (forces.SpringDamper, forces.JointSpring, forces.Wrench)}
ACTUATION = {c.__name__: c for c in (actuation.HoldPosition, actuation.Table)}
FUNCTIONS: dict[str, Callable[..., object]] = {
    "constant": timefunctions.Constant,
    "sinusoid": timefunctions.Sinusoid,
    "polynomial": timefunctions.Polynomial,
    "spline": timefunctions.Spline,
}


def read_yaml(path: Path) -> Table:
    """Return the table of a robot.yaml, with checked keys.

    Raises:
        LoadingError: the file is truncated or malformed, or has a tag, an anchor, a repeated key, or an
            unknown key.
    """
    table = plain_yaml(path)
    if table is None:  # an empty file is a robot without further data
        table = {}
    if not isinstance(table, dict):
        raise LoadingError(f'"{path}" must be a table of keys; got {_kind(table)}')
    check_keys(table, (*COMMUNITY_KEYS, *OWN_KEYS), f'"{path}"')
    _check_numbers(table, f'"{path}"')
    return table


def _check_numbers(value: object, where: str) -> None:
    """Check that no list of numbers contains true or false, which YAML also writes as yes and no."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in parts:
        _check_numbers(part, f"{where}: {key}")
    kinds = {type(x) for x in value} if isinstance(value, list) else set()
    if bool in kinds and kinds & {int, float}:
        raise LoadingError(f"{where} must hold numbers; got {short_repr(value)}")


def _kind(value: object) -> str:
    kind = type(value).__name__
    return "nothing" if value is None else f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def check_keys(table: Mapping[object, object], known: Iterable[str], where: str) -> None:
    """Check that all keys are known.

    Raises:
        LoadingError: a key is unknown; the message has the nearest known key.
    """
    known = list(known)
    for key in table:
        if key not in known:
            raise LoadingError(f'{where}: unknown key "{key}"{nearest(str(key), known)}')


def build(kind: type, values: object, where: str) -> Any:
    """Return one description from a table of its arguments.

    Args:
        kind: class of the description.
        values: table of arguments.
        where: prefix of error messages.

    Raises:
        LoadingError: arguments are unknown or missing, or the description rejects a value.
    """
    if not isinstance(values, dict):
        raise LoadingError(f"{where}: {kind.__name__} must be a table of arguments; got {_kind(values)}")
    fields = [f for f in dataclasses.fields(kind) if f.init]
    check_keys(values, [f.name for f in fields], f"{where}: {kind.__name__}")
    arguments = dict(values)
    for f in fields:
        if f.default is dataclasses.MISSING and f.name not in values:
            raise LoadingError(f'{where}: {kind.__name__} needs the key "{f.name}"')
    for key in ("function", "length"):
        if isinstance(arguments.get(key), dict):
            arguments[key] = time_function(arguments[key], where)
    if kind is GeometryContact and isinstance(arguments["geometry2"], dict):
        arguments["geometry2"] = _ground(arguments["geometry2"], where)
    if kind.__name__ == "PrescribedMotion" and isinstance(arguments["function"], (int, float)):
        arguments["function"] = timefunctions.Constant(arguments["function"])
    try:
        return kind(**arguments)
    except InputError as error:
        raise LoadingError(f"{where}: {error}") from None


def _ground(table: Table, where: str) -> GeometryObject:
    """Return a half-space on the world from a table such as `{ground: {height: 0.1}}`.

    Raises:
        LoadingError: the table does not describe a ground, or an argument is invalid.
    """
    kind, values = one_entry(table, f"{where}: GeometryContact: geometry2")
    where = f"{where}: GeometryContact: geometry2"
    if kind != "ground":
        raise LoadingError(
            f'{where} must be the name of a shape, or a table "{{ground: {{height: ..., normal: ...}}}}"; '
            f'got "{kind}"'
        )
    if not isinstance(values, dict):
        raise LoadingError(f"{where}: ground must be a table of arguments; got {_kind(values)}")
    check_keys(values, inspect.signature(ground).parameters, f"{where}: ground")
    try:
        return ground(**values)
    except InputError as error:
        raise LoadingError(f"{where}: {error}") from None


def time_function(table: Table, where: str) -> TimeFunction:
    """Return a function of time from a table such as `{sinusoid: {amplitude: 1, omega: 2}}`.

    Raises:
        LoadingError: the table is not one known function with its arguments.
    """
    name, values = one_entry(table, where)
    if name not in FUNCTIONS:
        raise LoadingError(f'{where}: no function of time "{name}"{nearest(name, FUNCTIONS)}')
    return build(FUNCTIONS[name], values, where)  # type: ignore[arg-type,no-any-return]


def one_entry(table: object, where: str) -> tuple[str, object]:
    """Return the only key of a table, and its value.

    Raises:
        LoadingError: the value is not a table with one key.
    """
    if not isinstance(table, dict) or len(table) != 1:
        raise LoadingError(
            f"{where} must be a table with one key, the kind, such as {{PointAnchor: {{...}}}}; "
            f"got {short_repr(table)}"
        )
    key, value = next(iter(table.items()))
    return str(key), value


def descriptions(entries: object, kinds: Mapping[str, type], where: str) -> list[object]:
    """Return a list of descriptions from a list of one-key tables `{Kind: {argument: value}}`.

    Raises:
        LoadingError: the value is not a list, a kind is unknown, or arguments are invalid.
    """
    if entries is None:
        return []
    if not isinstance(entries, list):
        raise LoadingError(f"{where} must be a list; got {_kind(entries)}")
    result = []
    for i, entry in enumerate(entries):
        place = f"{where}[{i}]"
        kind, values = one_entry(entry, place)
        if kind.startswith("User"):
            raise LoadingError(
                f"{place}: {kind} holds Python functions, which a file cannot hold; add it to a "
                "Scene in Python"
            )
        if kind not in kinds:
            raise LoadingError(f'{place}: unknown kind "{kind}"{nearest(kind, kinds)}')
        result.append(build(kinds[kind], values, place))
    return result


def strings(table: Table, key: str, where: str) -> list[str]:
    """Return a list of names under a key, or an empty list if the key is missing.

    Raises:
        LoadingError: the value is not a list of names.
    """
    value = table.get(key)
    if value is None:
        return []
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise LoadingError(f"{where}: {key} must be a list of names; got {short_repr(value)}")
    return value


def optional_string(table: Table, key: str, where: str) -> str | None:
    """Return a string under a key, or None.

    Raises:
        LoadingError: the value is not a string.
    """
    value = table.get(key)
    if value is not None and not isinstance(value, str):
        raise LoadingError(f"{where}: {key} must be a text; got {_kind(value)}")
    return value


def loops(table: Table, where: str) -> list[Constraint]:
    """Return anchors from the community keys `closed_loop` and `type` (6d without `type`).

    Raises:
        LoadingError: pairs or types are malformed, or their numbers differ.
    """
    pairs = table.get("closed_loop")
    types = table.get("type")
    if pairs is None:
        if types is not None:
            raise LoadingError(
                f"{where}: type is given without closed_loop; name the pairs of frames it belongs to"
            )
        return []
    if not isinstance(pairs, list):
        raise LoadingError(f"{where}: closed_loop must be a list of pairs of frames; got {_kind(pairs)}")
    if types is None:
        types = ["6d"] * len(pairs)
    if not isinstance(types, list) or len(types) != len(pairs):
        entries = len(types) if isinstance(types, list) else _kind(types)
        raise LoadingError(
            f"{where}: type must have one entry for each of the {len(pairs)} loops; got {entries}"
        )
    result: list[Constraint] = []
    for i, (pair, kind) in enumerate(zip(pairs, types, strict=True)):
        place = f"{where}: closed_loop[{i}]"
        if not isinstance(pair, list) or len(pair) != 2:
            raise LoadingError(f"{place} must be a pair of frame names; got {short_repr(pair)}")
        arguments = {"frame1": pair[0], "frame2": pair[1], "name": f"{pair[0]}-{pair[1]}"}
        if not isinstance(kind, str) or kind.lower() not in ("3d", "6d"):
            raise LoadingError(f'{where}: type[{i}] must be "3d" or "6d"; got {short_repr(kind)}')
        anchor = constraints.PointAnchor if kind.lower() == "3d" else constraints.FrameAnchor
        result.append(build(anchor, arguments, place))
    return result


def joint_types(table: Table, where: str) -> dict[str, str]:
    """Return the new joint types by joint name, from the community keys `joint_name` and `joint_type`.

    Raises:
        LoadingError: the two lists differ in length.
    """
    names, kinds = strings(table, "joint_name", where), strings(table, "joint_type", where)
    if len(names) != len(kinds):
        raise LoadingError(
            f"{where}: joint_name and joint_type must have the same length; got {len(names)} and {len(kinds)}"
        )
    return dict(zip(names, (k.upper() for k in kinds), strict=True))


def pitches(table: Table, where: str) -> dict[str, float]:
    """Return the rise per radian [m/rad] of screw joints by name, from `model: {helical: {joint: pitch}}`.

    Raises:
        LoadingError: the value is not a table of nonzero numbers.
    """
    entries = (table.get("model") or {}).get("helical") or {}
    if not isinstance(entries, dict):
        raise LoadingError(
            f"{where}: model: helical must be a table by joint name; got {short_repr(entries)}"
        )
    result = {}
    for joint, value in entries.items():
        what = f'{where}: model: helical: pitch of "{joint}"'
        try:
            result[joint] = number(what, value)
        except InputError as error:
            raise LoadingError(str(error)) from None
        if result[joint] == 0.0:
            raise LoadingError(f"{what} must not be zero; a joint without a rise is revolute")
    return result


def names_in(value: object) -> set[str]:
    """Return every string in a table, as a superset of the names that it refers to."""
    if isinstance(value, str):
        return {value}
    if isinstance(value, dict):
        return set().union(*(names_in(k) | names_in(v) for k, v in value.items())) if value else set()
    if isinstance(value, list):
        return set().union(*(names_in(v) for v in value)) if value else set()
    return set()
