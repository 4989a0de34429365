"""Signals of a replay: each recorded quantity of a run, for search and plots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from pin_nonideal.trajectory.columns import acting_columns, column_name, motion_columns, open_contacts
from pin_nonideal.types import Array

from .coordinates import positions, velocities
from .mode_timeline import has_open_contact
from .signals import Plot
from .visuals import joint_axis

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Number of points of all signals, and minimum and maximum number of points of one signal.
MAX_POINTS, MIN_SIGNAL_POINTS, MAX_SIGNAL_POINTS = 120_000, 100, 800
# Sections of the list, in order.
TORQUES, FRICTION, REACTIONS = "Torques of the actuation", "Friction", "Reactions and loads"
ENERGY, MOTION, OTHERS = "Energy and power", "Positions, velocities, accelerations", "Violation and states"
SECTIONS = (TORQUES, FRICTION, REACTIONS, ENERGY, MOTION, OTHERS)
# Fields with smooth curves between samples; other fields are linear.
SMOOTH_FIELDS = ("q", "v", "energy")
FORCES = ("N", "N m", "N, N m")
WRENCH = ("force x", "force y", "force z", "moment x", "moment y", "moment z")


@dataclass(frozen=True)
class Signal:
    """Curve that can be plotted.

    Attributes:
        label: name of the curve.
        unit: unit of the curve.
        section: section of the list.
        words: further words for the search, such as the name in `Trajectory.columns`.
        t: times [s], (k,).
        values: values of the curve, (k,).
    """

    label: str
    unit: str
    section: str
    words: str
    t: Array
    values: Array


@dataclass(frozen=True)
class _RecordedSignal:
    """A signal before it is thinned, and whether it is smooth between samples."""

    label: str
    unit: str
    section: str
    words: str
    values: Array
    smooth: bool = False


def signals_of(run: Trajectory, finer: Trajectory) -> list[Signal]:
    """Return all scalars of a run that can be plotted, thinned with their extremes.

    Every column of `Trajectory.columns` is one of them, or the angle or rate that it holds is. Forces of laws
    in joints on which they do not act and columns of contacts that never close are not signals.

    Args:
        run: run of the replay.
        finer: the same run with more samples, for curves that are not linear between samples.
    """
    if getattr(run, "dense", None) is not None:
        run = finer
    signals = [*_component_signals(run, finer), *_loads(run)]
    known = {word for item in signals for word in item.words.split("\n")}
    fine, reader = motion_columns(finer, SMOOTH_FIELDS), _Columns(run)
    for name, values in acting_columns(run).items():
        if name == "t" or name in known:
            continue
        item = reader.signal(name, values)
        smooth = item.words.split("\n")[-1] in SMOOTH_FIELDS and name in fine
        signals.append(replace(item, values=fine[name], smooth=True) if smooth else item)
    order = {section: place for place, section in enumerate(SECTIONS)}
    signals.sort(key=lambda item: order[item.section])
    each = int(np.clip(MAX_POINTS // max(len(signals), 1), MIN_SIGNAL_POINTS, MAX_SIGNAL_POINTS))
    return [
        _thin_signal(item, np.asarray((finer if item.smooth else run).t, dtype=float), each)
        for item in signals
    ]


def _component_signals(run: Trajectory, finer: Trajectory) -> Iterator[_RecordedSignal]:
    """Return positions, velocities and accelerations by the names of their components."""
    model = run.scene.model
    for kind, field, own, items in (
        ("position", "q", True, positions(model, finer.q)),
        ("velocity", "v", True, velocities(model, finer.v)),
        ("acceleration", "a", False, velocities(model, run.a, "/s²") if run.recorded("a") else []),
    ):
        counts: dict[str, int] = {}
        for item in items:
            joint = model.joints[model.getJointId(item.joint)]
            place = counts[item.joint] = counts.get(item.joint, -1) + 1
            column = f"{column_name(item.joint)}.{field}" + (f".{place}" if joint.nv > 1 else "")
            if field == "q" and joint.nv > 1 and place > 2:  # the angle of a planar joint has another column
                column = f"{item.joint} angle"
            yield _RecordedSignal(
                f"{item.label}, {kind}", item.unit, MOTION, f"{column}\n{field}", item.values, own
            )


def _loads(run: Trajectory) -> Iterator[_RecordedSignal]:
    """Return sizes of forces: multipliers of constraints, forces of contacts, loads of bearings."""
    left_out = open_contacts(run)
    if run.recorded("lam"):
        for name, rows in run.scene.constraint_slices.items():
            if name in left_out:
                continue
            size = np.linalg.norm(run.lam[:, rows], axis=1)
            yield _RecordedSignal(f"{name}, |lam|", "N, N m", REACTIONS, "reaction load multipliers", size)
    forces = run.contact_forces or {}
    for name in forces if has_open_contact(run) else ():
        if name in left_out:
            continue
        size = np.linalg.norm(forces[name], axis=1)
        yield _RecordedSignal(f"{name}, force", "N", REACTIONS, "contact reaction load", size)
    reactions = getattr(run, "reactions", None) or {}
    for name in reactions:
        if name in left_out:
            continue
        wrench = reactions[name]
        for what, unit, part in (("force", "N", wrench[:, :3]), ("moment", "N m", wrench[:, 3:6])):
            size = np.linalg.norm(part, axis=1)
            yield _RecordedSignal(f"{name}, load, |{what}|", unit, REACTIONS, "reaction bearing wrench", size)


class _Columns:
    """Content of the columns of a run.

    Args:
        run: run of the replay.
    """

    def __init__(self, run: Trajectory) -> None:
        self.run = run
        left_out = open_contacts(run)  # they have no columns
        laws = zip(run.element_names, run.element_laws, strict=False)
        open_elements = {name for name, law in laws if run.law_names[law] in left_out}
        elements = [name for name in run.element_names if name not in open_elements]
        rows = [name for name in run.rows if name not in left_out]
        self._names = {column_name(name): name for name in (*run.scene.model.names, *rows, *elements)}
        # Names of columns of the ledger, with the field and the name of the entry.
        self._ledger = {
            column_name(f"{field}.{own}"): (field, str(own))
            for field in ("energy", "power")
            for own in getattr(run, field, None) or {}
            if own not in left_out
        }
        self._units: dict[tuple[str, str], str] = {}  # by joint and number of the component
        acting = (law for law in getattr(run, "law_forces", None) or {} if law not in left_out)
        self._laws = {column_name(law): str(law) for law in acting}

    def signal(self, name: str, values: Array) -> _RecordedSignal:
        """Return the signal of a column; its words end with the field."""
        if name in self._ledger:
            field, own = self._ledger[name]
            unit, words = ("J", "work") if field == "energy" else ("W", "")
            return _signal_of(name, f"{field}: {own}", unit, ENERGY, words, field, values)
        owner, law, number = self._law_force(name)
        if law is not None:
            owner = self._names.get(owner, owner)
            label, unit = f"{law}, on {owner}{number.replace('.', ' ')}", self._unit(owner, number)
            return _signal_of(name, label, unit, FRICTION, "friction force law torque", "C", values)
        number = (re.search(r"\.\d+$", name) or [""])[0]
        owner, _, field = name.removesuffix(number).rpartition(".")
        return self._of_field(name, self._names.get(owner, owner), field, number, values)

    def _law_force(self, name: str) -> tuple[str, str | None, str]:
        """Return joint, law and number of the component of a law's force; no law for other columns."""
        place = name.find(".C.")
        while place >= 0:
            rest = name[place + 3 :]
            if rest in self._laws:
                return name[:place], self._laws[rest], ""
            law, dot, number = rest.rpartition(".")
            if law in self._laws:
                return name[:place], self._laws[law], dot + number
            place = name.find(".C.", place + 1)
        return "", None, ""

    def _of_field(self, name: str, owner: str, field: str, number: str, values: Array) -> _RecordedSignal:
        part, unit = number.replace(".", " "), self._unit(owner, number)
        if field == "reaction":
            place = int(number[1:])
            unit = "N" if place < 3 else "N m"
            label = f"{owner}, reaction, {WRENCH[place]}"
            return _signal_of(name, label, unit, REACTIONS, "load bearing wrench component", field, values)
        known = {
            "q": (f"{owner}, q{part}", "", MOTION, "position configuration"),
            "v": (f"{owner}, v{part}", "", MOTION, "velocity"),
            "a": (f"{owner}, a{part}", "", MOTION, "acceleration"),
            "tau": (f"{owner}, torque, tau{part}", unit, TORQUES, "motor drive actuation force"),
            "F_ideal": (f"{owner}, ideal force, F_ideal{part}", unit, REACTIONS, "constraint torque"),
            "F_nonideal": (f"{owner}, friction, F_nonideal{part}", unit, FRICTION, "nonideal force torque"),
            "lam": (f"{owner}, lam{part}", "N, N m", REACTIONS, "reaction load multiplier component"),
            "lam_ideal": (f"{owner}, lam_ideal{part}", "N, N m", REACTIONS, "reaction multiplier component"),
            "mode": (f"{owner}, mode", "1 and -1 slip, 0 sticks", FRICTION, "friction stick slip"),
            "limit": (f"{owner}, limit", "N, N m", FRICTION, "friction"),
        }
        if field in known and owner:
            label, unit, section, words = known[field]
            return _signal_of(name, label, unit, section, words, field, values)
        rates = {"violation": "m, rad", "violation_rate": "m/s, rad/s"}
        return _signal_of(name, name.replace("_", " "), rates.get(name, ""), OTHERS, "", field, values)

    def _unit(self, joint: str, number: str) -> str:
        """Return the unit of a generalized force in a joint, or of one component."""
        if (joint, number) not in self._units:
            self._units[joint, number] = self._unit_in_model(joint, number)
        return self._units[joint, number]

    def _unit_in_model(self, joint: str, number: str) -> str:
        model = self.run.scene.model
        if not model.existJointName(joint):
            return "N, N m"
        index = model.getJointId(joint)
        if model.joints[index].nv == 1:
            return "N m" if joint_axis(model, index)[1] else "N"
        kind = model.joints[index].shortname()
        if kind == "JointModelFreeFlyer" and number:
            return "N" if int(number[1:]) < 3 else "N m"
        return {"JointModelTranslation": "N"}.get(kind, "N m" if "Spherical" in kind else "N, N m")


def _signal_of(
    name: str, label: str, unit: str, section: str, words: str, field: str, values: Array
) -> _RecordedSignal:
    """Return the signal of a column by its name."""
    return _RecordedSignal(label, unit, section, f"{name}\n{words}\n{field}", np.asarray(values, dtype=float))


def _thin_signal(item: _RecordedSignal, t: Array, points: int) -> Signal:
    """Return the signal with few points; two points if its value is constant."""
    values, label, words = item.values, item.label, item.words.replace("\n", " ")
    if len(t) > 2 and (values == values[0]).all():
        return Signal(label, item.unit, item.section, words, t[[0, -1]], values[[0, -1]])
    plot = Plot(label, item.unit, t, {label: values}).thinned(points // 2)
    return Signal(label, item.unit, item.section, words, plot.t, plot.curves[label])


def rounding_of(
    pairs: Iterable[tuple[str, Array]], scales: Mapping[str, float] = MappingProxyType({})
) -> dict[str, float]:
    """Return the size of rounding for each unit.

    Args:
        pairs: units, each with an array of values.
        scales: least sizes by unit, such as the weight of all bodies for forces.

    Returns:
        By unit 1e-9 of the largest value of forces and moments, and 1e-12 of other largest values.
    """
    largest = dict(scales)
    for unit, values in pairs:
        size = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        largest[unit] = max(largest.get(unit, 0.0), float(size))
    return {unit: (1e-9 if unit in FORCES else 1e-12) * size for unit, size in largest.items()}


def without_rounding(values: Array, level: float) -> Array:
    """Return values with zeros in place of values below a level.

    Args:
        values: values of a curve.
        level: size of rounding, see `rounding_of`.
    """
    return np.where(np.abs(values) < level, 0.0, values)
