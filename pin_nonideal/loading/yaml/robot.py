"""robot.yaml: what a URDF cannot say, as a table of plain values that becomes descriptions.

A superset of what community closed-loop robots keep beside their URDF.  Only data: nothing in the file is
ever executed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

from pin_nonideal.description import actuation, constraints, contacts, forces, laws
from pin_nonideal.description import time_functions as timefunctions
from pin_nonideal.errors import InputError, LoadingError, nearest, short_repr
from pin_nonideal.geometry.from_model import GeometryContact
from pin_nonideal.types import Table
from pin_nonideal.validation import number

from .subset import plain_yaml

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
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "constant": timefunctions.Constant,
    "sinusoid": timefunctions.Sinusoid,
    "polynomial": timefunctions.Polynomial,
    "spline": timefunctions.Spline,
}


def read_yaml(path: Path) -> Table:
    """The table in a robot.yaml, keys checked.

    Raises:
        LoadingError: the file is truncated or malformed, holds tags that name code, anchors, a key twice, or
            a key that is not known.
    """
    table = plain_yaml(path)
    if table is None:  # an empty file: a robot without extras
        table = {}
    if not isinstance(table, dict):
        raise LoadingError(f'"{path}" must be a table of keys; got {_kind(table)}')
    check_keys(table, (*COMMUNITY_KEYS, *OWN_KEYS), f'"{path}"')
    _check_numbers(table, f'"{path}"')
    return table


def _check_numbers(value: Any, where: str) -> None:
    """Raises where true or false, which YAML also writes yes and no, stands among numbers."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in parts:
        _check_numbers(part, f"{where}: {key}")
    kinds = {type(x) for x in value} if isinstance(value, list) else set()
    if bool in kinds and kinds & {int, float}:
        raise LoadingError(f"{where} must hold numbers; got {short_repr(value)}")


def _kind(value: object) -> str:
    kind = type(value).__name__
    return "nothing" if value is None else f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def check_keys(table: Mapping[Any, Any], known: Iterable[str], where: str) -> None:
    """Raises on the first key that is not known, naming the nearest that is.

    Raises:
        LoadingError: see above.
    """
    known = list(known)
    for key in table:
        if key not in known:
            raise LoadingError(f'{where}: unknown key "{key}"{nearest(str(key), known)}')


def build(kind: type, values: Any, where: str) -> Any:
    """One description from a table of its arguments.

    Args:
        kind: a description's class.
        values: table of arguments.
        where: words for messages.

    Raises:
        LoadingError: unknown or missing arguments, or values the description refuses.
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
    if kind.__name__ == "PrescribedMotion" and isinstance(arguments["function"], (int, float)):
        arguments["function"] = timefunctions.Constant(arguments["function"])
    try:
        return kind(**arguments)
    except InputError as error:
        raise LoadingError(f"{where}: {error}") from None


def time_function(table: Table, where: str) -> Any:
    """`{sinusoid: {amplitude: 1, omega: 2}}` and its like.

    Raises:
        LoadingError: not one known function with its arguments.
    """
    name, values = one_entry(table, where)
    if name not in FUNCTIONS:
        raise LoadingError(f'{where}: no function of time "{name}"{nearest(name, FUNCTIONS)}')
    return build(FUNCTIONS[name], values, where)  # type: ignore[arg-type]


def one_entry(table: Any, where: str) -> tuple[str, Any]:
    """The only key of a table, and its value.

    Raises:
        LoadingError: no table, or not one key.
    """
    if not isinstance(table, dict) or len(table) != 1:
        raise LoadingError(
            f"{where} must be a table with one key, the kind, such as {{PointAnchor: {{...}}}}; "
            f"got {short_repr(table)}"
        )
    key, value = next(iter(table.items()))
    return str(key), value


def descriptions(entries: Any, kinds: Mapping[str, type], where: str) -> list[Any]:
    """A list of descriptions from a list of one-key tables `{Kind: {argument: value}}`.

    Raises:
        LoadingError: no list, an unknown kind, or arguments that are refused.
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
                f"{place}: {kind} holds Python functions, which a file cannot; add it to a Scene in Python"
            )
        if kind not in kinds:
            raise LoadingError(f'{place}: unknown kind "{kind}"{nearest(kind, kinds)}')
        result.append(build(kinds[kind], values, place))
    return result


def strings(table: Table, key: str, where: str) -> list[str]:
    """A list of names under a key, empty when the key is absent.

    Raises:
        LoadingError: something else is there.
    """
    value = table.get(key)
    if value is None:
        return []
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise LoadingError(f"{where}: {key} must be a list of names; got {short_repr(value)}")
    return value


def optional_string(table: Table, key: str, where: str) -> str | None:
    """A text under a key, or None.

    Raises:
        LoadingError: something else is there.
    """
    value = table.get(key)
    if value is not None and not isinstance(value, str):
        raise LoadingError(f"{where}: {key} must be a text; got {_kind(value)}")
    return value


def loops(table: Table, where: str) -> list[Any]:
    """Anchors from the community's `closed_loop` and `type` (6d where `type` is absent).

    Raises:
        LoadingError: pairs or types are malformed, or their counts differ.
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
        found = len(types) if isinstance(types, list) else _kind(types)
        raise LoadingError(
            f"{where}: type must have one entry for each of the {len(pairs)} loops; got {found}"
        )
    result: list[Any] = []
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
    """Joints whose type is exchanged, from the community's `joint_name` and `joint_type`.

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
    """Joints that are screws, and their rise per radian [m/rad], from `model: {helical: {joint: pitch}}`.

    Raises:
        LoadingError: no table of numbers other than zero.
    """
    given = (table.get("model") or {}).get("helical") or {}
    if not isinstance(given, dict):
        raise LoadingError(f"{where}: model: helical must be a table by joint name; got {short_repr(given)}")
    result = {}
    for joint, value in given.items():
        what = f'{where}: model: helical: pitch of "{joint}"'
        try:
            result[joint] = number(what, value)
        except InputError as error:
            raise LoadingError(str(error)) from None
        if result[joint] == 0.0:
            raise LoadingError(f"{what} must not be zero; a joint that does not rise is a revolute one")
    return result


def names_in(value: object) -> set[str]:
    """Every text anywhere in a table: what the file may refer to."""
    if isinstance(value, str):
        return {value}
    if isinstance(value, dict):
        return set().union(*(names_in(k) | names_in(v) for k, v in value.items())) if value else set()
    if isinstance(value, list):
        return set().union(*(names_in(v) for v in value)) if value else set()
    return set()
