"""Parameter overrides: numbers of a scene that may differ between runs of a batch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts.base import similar
from pin_nonideal.description.contacts.pair_of_shapes import PairOfShapes, split
from pin_nonideal.errors import InputError, UnknownNameError, nearest, short_repr
from pin_nonideal.geometry.from_model import GeometryContact
from pin_nonideal.types import Array, Table
from pin_nonideal.validation import array, label

from .compiled_scene import CompiledScene
from .lowering import LoweredItem, lower_stepwise
from .resolver import Resolver

NUMBERS = (float, list, np.ndarray)  # types of keyword arguments that may differ between runs
OF_PAIRS = ("mu", "static_ratio", "restitution")  # numbers of a pair of shapes that may differ between runs
WRITER_PREFIXES = ("add_", "set_", "let_")  # prefixes of builder methods that modify the program
# Negative principal moments down to this value times the largest are accepted: rounding of a thin rod.
ROUNDING = 1e-9


class Call(NamedTuple):
    """A call of the core's builder.

    Attributes:
        name: name of the method.
        number: number of earlier calls of the same method.
        positional: positional arguments, such as names, joints and frames.
        named: keyword arguments, including numbers.
        result: returned value.
    """

    name: str
    number: int
    positional: tuple[object, ...]
    named: Table
    result: object


class ParameterOverrides(NamedTuple):
    """Parameter values of a batch in the form of the core.

    Attributes:
        names: (call, index, argument) of each number or group of numbers.
        values: values of all runs, (n, total number of values).
    """

    names: list[tuple[str, int, str]]
    values: Array


def parse_overrides(compiled: CompiledScene, parameters: Mapping[str, object], n: int) -> ParameterOverrides:
    """Convert parameters of the runs to numbers of the core's program.

    Args:
        compiled: the scene.
        parameters: values by name, one per run. A law, contact, force or "actuation" maps to its fields, a
            joint to "mass" or "inertia" of its body. "gravity" is an array (n, 3).
        n: number of runs.

    Raises:
        InputError: a value does not fit, replaces a function, or changes the structure of the scene.
        UnknownNameError: no part of the scene has that name.
    """
    columns: dict[tuple[str, int, str], Array] = {}
    owners: dict[str, str] = {}  # by call of the builder and argument, as errors of the core name them
    parts = _parts(compiled) if parameters else {}
    for name, entries in parameters.items():
        if name == "gravity":
            columns["gravity", 0, ""] = array("rollout: gravity", entries, (n, 3))
        elif (
            isinstance(entries, Mapping) and set(entries) <= {"mass", "inertia"} and _is_body(compiled, name)
        ):
            columns |= _body(compiled, name, entries, n)
        elif name in parts:
            own = _columns(name, entries, n, parts[name])
            owners = {f"{call}: {key}": f'"{name}": {key}' for call, _, key in own} | owners
            columns |= own
        else:
            known = [*parts, *list(compiled.model.names)[1:], "gravity"]
            raise UnknownNameError(
                f'rollout: parameters: no law, contact, force or joint "{name}"{nearest(str(name), known)}'
            )
    flat = [values.reshape(n, -1) for values in columns.values()]
    names, values = list(columns), np.ascontiguousarray(np.hstack(flat)) if flat else np.zeros((n, 0))
    if n:
        _check_known(compiled.program, ParameterOverrides(names, values[:1]), owners)
    return ParameterOverrides(names, values)


def _check_known(program: core.Program, first: ParameterOverrides, owners: Mapping[str, str]) -> None:
    """Check that the core accepts all overrides as numbers.

    Raises:
        InputError: an override changes the structure of the scene.
    """
    try:
        core.with_numbers(program, *first)
    except ValueError as error:
        raise InputError(
            f"rollout: parameters: {owners.get(str(error), error)} changes the structure of the scene "
            "and cannot differ between runs; sweep makes a scene for each"
        ) from None


def _is_body(compiled: CompiledScene, name: str) -> bool:
    return bool(compiled.model.existJointName(name))


def _parts(compiled: CompiledScene) -> dict[str, list[tuple[LoweredItem, _Relower]]]:
    """Return the parts of the program by name, with their builder calls; a contact has two parts."""
    spec = compiled.spec
    builder: Any = _Recorder(core.Builder(compiled.model, core.Provider[spec.terms]))
    parts: dict[str, list[tuple[LoweredItem, _Relower]]] = {}
    kinds: dict[str, str] = {}
    begin = 0
    pairs = {c.name: c.given for c in spec.contacts if isinstance(c, PairOfShapes)}
    spec = spec._replace(contacts=tuple(split(c) for c in spec.contacts))
    for item in lower_stepwise(spec, builder, Resolver(compiled.model, compiled.q0)):
        if item.kind == "contact" and (contact := compiled.contact(item.name)) in pairs:
            item = _of_pair(item, contact, pairs[contact])
        kind = kinds.setdefault(item.name, item.kind)
        name = item.name if kind == item.kind else f"{item.kind} {item.name}"
        parts.setdefault(name, []).append((item, _Relower(builder, builder.calls[begin:])))
        begin = len(builder.calls)
    return parts


def _of_pair(item: LoweredItem, name: str, given: object) -> LoweredItem:
    """Return a point of a pair of shapes that takes its coefficients from the description of the pair."""

    def relower(pair: object, out: object) -> object:
        return item.relower(similar(item.description, **{key: getattr(pair, key) for key in OF_PAIRS}), out)

    return item._replace(name=name, description=given, relower=relower)


def _body(compiled: CompiledScene, name: str, entries: Mapping[str, object], n: int) -> dict[Any, Array]:
    """Return mass, center of mass and inertia of a joint's body for all runs."""
    who = f'rollout: parameters: "{name}"'
    if compiled.spec.terms != "core":
        raise InputError(f'{who}: masses can differ between runs with terms="core" only')
    if len(entries) != 1:
        raise InputError(f'{who}: give "mass" or "inertia", not both')
    joint = int(compiled.model.getJointId(name))
    own = compiled.model.inertias[joint]
    if "mass" in entries:
        mass = array(f"{who}: mass", entries["mass"], (n,))
    else:
        dynamic = array(f"{who}: inertia", entries["inertia"], (n, 10))
        mass = dynamic[:, 0]
    if own.mass == 0.0 and "mass" in entries:
        raise InputError(f'{who}: a body without mass has no inertia to scale; give "inertia"')
    heavy = mass > 0.0  # Pinocchio creates no inertia without a positive mass
    if not heavy.all():
        bodies = []
    elif "mass" in entries:
        bodies = [pin.Inertia(m, own.lever, own.inertia * (m / own.mass)) for m in mass]
    else:
        bodies = [pin.Inertia.FromDynamicParameters(p) for p in dynamic]
    turns = np.array([body.inertia for body in bodies]).reshape(-1, 3, 3)
    moments = np.linalg.eigvalsh(turns)
    good = heavy if not bodies else moments[:, 0] >= -ROUNDING * moments[:, 2]
    if not good.all():
        k = int(np.argmin(good))
        moment = f" and a least moment of {moments[k, 0]:g} kg m^2" if bodies else ""
        raise InputError(
            f"{who}: masses and moments of inertia about the center of mass must be positive; "
            f"run {k} has a mass of {mass[k]:g} kg{moment}"
        )
    return {
        ("body", joint, "mass"): mass,
        ("body", joint, "com"): np.array([body.lever for body in bodies]),
    } | {("body", joint, f"inertia {axis}"): turns[:, :, k] for k, axis in enumerate("xyz")}


def _columns(
    name: str, entries: object, n: int, parts: list[tuple[LoweredItem, _Relower]]
) -> dict[Any, Array]:
    """Return the numbers of the program that depend on the given fields of a description, for all runs."""
    described = parts[0][0].description
    others = list(_descriptions(name, described, entries, n))
    columns: dict[object, Array] = {}
    for item, relower in parts:
        arguments = [relower.arguments(item, other, name) for other in others]
        for k, call in enumerate(relower.calls):
            for key, base in call.named.items():
                if isinstance(base, NUMBERS) and any(
                    not np.array_equal(one[k][key], base) for one in arguments
                ):
                    columns[call.name, call.number, key] = np.array([one[k][key] for one in arguments])
    return columns


def _descriptions(name: str, described: object, entries: object, n: int) -> Iterator[object]:
    """Yield the description of each run, with the checks of its constructor."""
    who = f'rollout: parameters: "{name}"'
    if isinstance(described, np.ndarray):
        yield from array(who, entries, (n, len(described)))
        return
    if not is_dataclass(described) or not isinstance(entries, Mapping):
        raise InputError(
            f"{who} must be values by field of a description; got {short_repr(entries)} "
            f"for {label(described)}"
        )
    known = [field.name for field in fields(described)]
    for key, values in entries.items():
        if key not in known or key == "name":
            raise UnknownNameError(f'{who}: no field "{key}"{nearest(str(key), known)}')
        if not isinstance(values, (list, tuple, np.ndarray)) or np.shape(values)[:1] != (n,):
            raise InputError(f"{who}: {key} must be {n} values, one per run; got {short_repr(values)}")
        if isinstance(described, GeometryContact) and key not in OF_PAIRS:
            raise InputError(
                f"{who}: {key} changes the structure of the scene and cannot differ between runs; sweep "
                "makes a scene for each"
            )
        own = _functions_of(getattr(described, key))
        if any(functions and functions != own for functions in map(_functions_of, values)):
            raise InputError(
                f"{who}: {key} holds a function, which cannot differ between runs; sweep makes a scene for "
                "each"
            )
    plain = {key: v.tolist() if isinstance(v, np.ndarray) else v for key, v in entries.items()}
    for k in range(n):
        one: Any = described
        try:
            yield replace(one, **{key: values[k] for key, values in plain.items()})
        except InputError as error:
            raise InputError(f"rollout: parameters: run {k}: {error}") from None


def _functions_of(value: object) -> list[int]:
    """Return the identities of the functions in a field of a description."""
    if callable(value):
        return [id(value)]
    if is_dataclass(value):
        return [each for field in fields(value) for each in _functions_of(getattr(value, field.name))]
    if isinstance(value, (list, tuple)):
        return [each for entry in value for each in _functions_of(entry)]
    return []


class _Recorder:
    """A proxy of the core's builder that records its calls."""

    def __init__(self, builder: core.Builder) -> None:
        self._builder = builder
        self.calls: list[Call] = []
        self._counts: dict[str, int] = {}

    def __getattr__(self, name: str) -> object:
        method = getattr(self._builder, name)
        if not name.startswith(WRITER_PREFIXES):
            return method

        def call(*positional: object, **named: object) -> object:
            result = method(*positional, **named)
            index = self._counts.get(name, 0)
            self._counts[name] = index + 1
            self.calls.append(Call(name, index, positional, named, result))
            return result

        return call


class _Relower:
    """A stand-in builder that compares the calls of a replaced description with the recorded calls.

    It returns the recorded results.

    Args:
        builder: recorder of the first lowering.
        calls: recorded calls of the description.
    """

    def __init__(self, builder: object, calls: list[Call]) -> None:
        self._builder, self.calls = builder, calls
        self._arguments: list[Table] = []
        self._differs = False

    def arguments(self, item: LoweredItem, other: object, name: str) -> list[Table]:
        """Return the keyword arguments of the builder's calls that another description needs.

        Raises:
            InputError: the calls differ in more than numbers.
        """
        self._arguments, self._differs = [], False
        item.relower(other, self)
        if self._differs or len(self._arguments) != len(self.calls):
            raise InputError(
                f'rollout: parameters: "{name}" with {short_repr(other)} changes more than numbers: '
                "parts of the scene would begin or cease to act; keep zeros zero and other numbers positive, "
                "or use sweep, which makes a scene for each"
            )
        return self._arguments

    def __getattr__(self, name: str) -> object:
        if not name.startswith(WRITER_PREFIXES):
            return getattr(self._builder, name)

        def call(*positional: object, **named: object) -> object:
            k = len(self._arguments)
            expected = self.calls[k] if k < len(self.calls) else None
            if expected is None or expected.name != name or expected.named.keys() != named.keys():
                self._differs = True
                return -1
            fixed = {key: value for key, value in expected.named.items() if not isinstance(value, NUMBERS)}
            self._differs |= not _are_equal(expected.positional, positional)
            self._differs |= not all(_are_equal(value, named[key]) for key, value in fixed.items())
            self._arguments.append(named)
            return expected.result

        return call


def _are_equal(a: object, b: Any) -> bool:
    """Check if two arguments are equal; any two functions count as equal unless their sources differ."""
    if isinstance(a, (tuple, list)):
        return isinstance(b, (tuple, list)) and len(a) == len(b) and all(map(_are_equal, a, b))
    if isinstance(a, np.ndarray):
        return bool(np.array_equal(a, b))
    if callable(a) and callable(b):
        return getattr(a, "source", None) is getattr(b, "source", None)
    return not callable(a) and bool(a == b)
