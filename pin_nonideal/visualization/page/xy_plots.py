"""Plots of one quantity against another: phase planes, and friction against slip velocity or load."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.types import Array

from .coordinates import positions, velocities
from .signals import MAX_CURVES, omission_note

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

KINDS = ("phase", "friction", "load")
# Maximum number of joints and of laws with relations on a page.
MAX_RELATIONS = 16


@dataclass(frozen=True)
class Relation:
    """Curves of one quantity against another.

    Attributes:
        title: title of the plot.
        x: label of the horizontal axis, with its unit.
        y: label of the vertical axis, with its unit.
        curves: pairs (x, y) by label, (nt,) each.
        bounds: points of the law at the samples, pairs (x, y) by label, (n,) each: both limits of a sticking
            joint, and the limit with the viscous part against the motion of a slipping joint.
        note: note on the selection of the curves.
    """

    title: str
    x: str
    y: str
    curves: dict[str, tuple[Array, Array]]
    bounds: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    note: str = ""


def available(run: Trajectory) -> list[str]:
    """Return the names of a run's relations, one joint or law each: the ones of each kind that move most.

    Args:
        run: the run.
    """
    model = run.scene.model
    joints = [joint for joint in range(1, model.njoints) if model.joints[joint].nv == 1]
    joints = sorted(joints, key=lambda joint: -_spread(run, joint))[:MAX_RELATIONS]
    names = []
    if run.law_forces:
        known = friction_joints(run)
        laws = sorted(known, key=lambda law: -_spread(run, known[law]))[:MAX_RELATIONS]
        kinds = ("friction", "load") if run.reactions else ("friction",)
        names = [f"{kind} {law}" for kind in kinds for law in laws if law in run.law_forces]
    return names + [f"phase {model.names[joint]}" for joint in sorted(joints)]


def is_relation(item: object) -> bool:
    """Check if a name is that of a relation: "phase", "friction" or "load", alone or before a name."""
    return isinstance(item, str) and item.split(" ", 1)[0] in KINDS


def relations_of(run: Trajectory, item: str) -> list[Relation]:
    """Return the relations of one name.

    Args:
        run: run of the plot.
        item: "phase" for all joints, or "phase JOINT"; "friction" (against slip velocity) and "load"
            (friction against the load of the bearing) for all laws in joints of one degree of freedom, or for
            one law by name.

    Raises:
        UnknownNameError: no joint or law has that name.
        InputError: the run did not record the values.
    """
    kind, _, name = item.partition(" ")
    if kind == "phase":
        return _phases(run, name)
    return _frictions(run, name, over_load=kind == "load")


def _phases(run: Trajectory, name: str) -> list[Relation]:
    """Return plots of velocity against position, one for each unit."""
    model = run.scene.model
    names = [str(joint) for joint in model.names[1:]]
    if name and name not in names:
        raise UnknownNameError(f'plot "phase {name}": no joint "{name}"{nearest(name, names)}')
    single = {str(joint) for joint in names if model.joints[model.getJointId(joint)].nv == 1}
    rates = {item.joint: item.values for item in velocities(model, run.v) if item.joint in single}
    by_unit: dict[str, dict[str, tuple[Array, Array]]] = {}
    for place in positions(model, run.q):
        if place.joint in rates and name in ("", place.joint):
            by_unit.setdefault(place.unit, {})[place.joint] = (place.values, rates[place.joint])
    if not by_unit:
        raise InputError('plot "phase" needs a joint of one degree of freedom, and here is none')
    relations = []
    for unit, curves in by_unit.items():
        rank = sorted(curves, key=lambda label: -float(np.ptp(curves[label][0])))[:MAX_CURVES]
        drawn = {label: pair for label, pair in curves.items() if label in rank}
        title = "Phase plane" if len(drawn) > 1 else f"phase {next(iter(drawn))}"
        relations.append(
            Relation(
                title, f"position [{unit}]", f"velocity [{unit}/s]", drawn, note=omission_note(len(curves))
            )
        )
    return relations


def friction_joints(run: Trajectory) -> dict[str, int]:
    """Return the friction laws in joints of one degree of freedom, with the index of the joint."""
    model, indices = run.scene.model, {}
    names = {str(joint): index for index, joint in enumerate(model.names) if index}
    for law in run.scene.laws:
        index = names.get(str(getattr(law, "joint", "")))
        if index is None or model.joints[index].nv != 1:
            continue
        label = getattr(law, "name", None) or f"{type(law).__name__}({law.joint})"
        if label in run.law_names:
            indices[label] = index
    return indices


def _frictions(run: Trajectory, name: str, over_load: bool) -> list[Relation]:
    """Return the curves of joint friction against slip velocity, or against bearing load."""
    kind, known = "load" if over_load else "friction", friction_joints(run)
    if name and name not in known:
        raise UnknownNameError(
            f'plot "{kind} {name}": no law "{name}" in a joint of one degree of freedom'
            f"{nearest(name, list(known))}"
        )
    if not known:
        raise InputError(f'plot "{kind}" needs a law in a joint of one degree of freedom, and here is none')
    if not run.law_forces:
        raise InputError(f'plot "{kind}" must be recorded: pass record=("laws",) to simulate')
    if over_load and not run.reactions:
        raise InputError('plot "load" must be recorded: pass record=("laws", "reactions") to simulate')
    chosen = [name] if name else sorted(known, key=lambda law: -_spread(run, known[law]))[:MAX_CURVES]
    by_unit: dict[str, Relation] = {}
    for law in known if not name else chosen:
        if law not in chosen:
            continue
        unit, x, label = _abscissa(run, known[law], over_load)
        record = run.law(law)
        force = np.asarray(record.force)[:, run.scene.model.joints[known[law]].idx_v]
        place = by_unit.setdefault(unit, Relation(name or "Friction", label, f"friction [{unit}]", {}, {}))
        place.curves[law] = _broken(x, np.abs(force) if over_load else force, record.mode)
        if record.limit is not None and record.limit.ndim == 1:
            speed = np.abs(run.v[:, run.scene.model.joints[known[law]].idx_v])
            limit = record.limit + _viscous(run, law) * speed
            place.bounds[law] = (x, limit) if over_load else _opposed(x, limit, record.mode)
    return list(by_unit.values())


def _opposed(x: Array, limit: Array, mode: NDArray[np.int8] | None) -> tuple[Array, Array]:
    """Return the friction limits: opposite to the motion of slipping samples, in both directions at rest."""
    slips = np.zeros(len(x), dtype=int) if mode is None else np.sign(np.asarray(mode, dtype=int))
    forth, back = slips >= 0, slips <= 0
    return np.concatenate([x[forth], x[back]]), np.concatenate([-limit[forth], limit[back]])


def _viscous(run: Trajectory, name: str) -> float:
    """Return the viscous coefficient of a law in a joint, 0 for laws without one."""
    index = run.law_names.index(name)
    return float(getattr(run.scene.laws[index], "viscous", 0.0))


def _broken(x: Array, y: Array, mode: NDArray[np.int8] | None) -> tuple[Array, Array]:
    """Return a curve with a gap at each change of mode, because friction is discontinuous there."""
    if mode is None:
        return x, y
    at = np.flatnonzero(np.diff(np.asarray(mode).reshape(len(x), -1)[:, 0])) + 1
    return np.insert(x, at, np.nan), np.insert(y, at, np.nan)


def _spread(run: Trajectory, joint: int) -> float:
    return float(np.ptp(run.v[:, run.scene.model.joints[joint].idx_v]))


def _abscissa(run: Trajectory, joint: int, over_load: bool) -> tuple[str, Array, str]:
    """Return the unit of the friction, the values of the horizontal axis, and its label."""
    from .visuals import joint_axis

    axis, turning = joint_axis(run.scene.model, joint)
    unit = "N m" if turning else "N"
    if not over_load:
        return (
            unit,
            run.v[:, run.scene.model.joints[joint].idx_v],
            f"velocity [{'rad' if turning else 'm'}/s]",
        )
    force, along = run.reaction(str(run.scene.model.names[joint]))[:, :3], np.asarray(axis)
    across = force - np.outer(force @ along, along)
    return unit, np.linalg.norm(across, axis=1), "load across the axis [N]"
