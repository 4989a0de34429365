"""Curves, events and modes of a run for the replay and for figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.errors import InputError, UnknownNameError, nearest, short_repr
from pin_nonideal.trajectory.columns import open_contacts
from pin_nonideal.types import Array
from pin_nonideal.validation import sequence

from .coordinates import Coordinate, positions, velocities
from .mode_timeline import gaps_of, has_open_contact
from .visuals import joint_axis

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


# Plots by name, or by a title "name [unit]" and curves by label, (nt,) each.
Chosen = str | Sequence[str | tuple[str, Mapping[str, Array]]]

# Maximum number of curves of one plot without a selection of joints, so that they can be distinguished.
MAX_CURVES = 8
# Number of time intervals in which a plot of the replay keeps the extremes of every curve.
INTERVALS = 600
RATES_AND_FORCES = ("tau", "F_nonideal", "q", "v", "a")
STORED_ENERGY = ("kinetic", "potential", "total")


@dataclass(frozen=True)
class Plot:
    """Curves on one axis.

    Attributes:
        title: title of the plot.
        unit: unit of all curves.
        t: times [s], (k,).
        curves: values by label, (k,) each.
        log: whether the axis is logarithmic.
        note: note on the selection of the curves.
    """

    title: str
    unit: str
    t: Array
    curves: dict[str, Array]
    log: bool = False
    note: str = ""

    def thinned(self, intervals: int = INTERVALS) -> Plot:
        """Return the plot with the extremes of each curve in intervals of time, and with both ends."""
        count = len(self.t)
        if count <= 2 * intervals:
            return self
        length = -(-count // intervals)
        starts = np.arange(0, count, length)
        shown = np.zeros(count, dtype=bool)
        shown[[0, -1]] = True
        for values in self.curves.values():
            whole = np.append(values, np.full(len(starts) * length - count, values[-1]))
            rows = whole.reshape(-1, length)  # an interval each; the first extreme or NaN of a row counts
            shown[starts + rows.argmin(axis=1)] = True
            shown[starts + rows.argmax(axis=1)] = True
        index = np.flatnonzero(shown)
        return replace(self, t=self.t[index], curves={k: v[index] for k, v in self.curves.items()})


def parse_plots(what: str, chosen: Any) -> list[Any]:
    """Return the requested plots, as a list of names and of pairs of a title and curves by label.

    Args:
        what: prefix of error messages.
        chosen: one name, or a list.

    Raises:
        InputError: the value has another form.
    """
    items = [chosen] if isinstance(chosen, str) else list(sequence(what, chosen))
    for item in items:
        pair = isinstance(item, (list, tuple)) and len(item) == 2
        if not (
            isinstance(item, str) or (pair and isinstance(item[0], str) and isinstance(item[1], Mapping))
        ):
            raise InputError(
                f"{what} must hold names, and pairs of a title and curves by label; got {short_repr(item)}"
            )
    return items


def plots_of(run: Trajectory, chosen: Chosen | None) -> list[Plot]:
    """Return plots by name.

    Args:
        run: run of the replay.
        chosen: names of plots: "energy", "work", "power", "violation", "reactions", "contacts" (normal
            forces), "gaps" (of unilateral contacts), "tau", "F_nonideal" (of joints), "q", "v", "a", the name
            of a joint (position and velocity), or a pair of a title "name [unit]" and curves by label, (nt,)
            each. None selects tau and F_nonideal of a driven run, then energy, gaps, violation, reactions and
            q, if the run recorded them.

    Raises:
        UnknownNameError: no plot and no joint has that name.
        InputError: the run did not record the values of a plot, a curve has a wrong length, or `chosen` is
            invalid.
    """
    plots: list[Plot] = []
    for item in parse_plots("plots", default_plot_names(run) if chosen is None else chosen):
        plots += _plot(run, item) if isinstance(item, str) else [_user_plot(run, *item)]
    return plots


def default_plot_names(run: Trajectory) -> list[str]:
    """Return the names of the default plots of a replay.

    Args:
        run: run of the replay.
    """
    driven = run.recorded("tau") and bool(np.any(run.tau))
    first = ("tau", "F_nonideal") if driven else ()
    return [
        name for name in (*first, "energy", "gaps", "violation", "reactions", "q") if _record_of(run, name)
    ]


def _record_of(run: Trajectory, name: str) -> bool:
    if name in ("energy", "work", "power"):
        return bool(getattr(run, name.replace("work", "energy"), None))
    if name == "violation":
        return bool(run.scene.constraint_slices)
    if name == "reactions":
        return run.recorded("lam") and bool(run.scene.constraint_slices)
    if name == "contacts":
        return run.recorded("lam") and bool(run.scene.contacts)
    if name == "gaps":
        return has_open_contact(run)
    if name == "F_nonideal":
        return run.recorded("F_nonideal") and bool(np.any(run.F_nonideal))
    if name in ("a", "tau"):
        return run.recorded(name)
    return True


def _plot(run: Trajectory, name: str) -> list[Plot]:
    """Return the plots of one name."""
    model, t = run.scene.model, np.asarray(run.t)
    names = ("energy", "work", "power", "violation", "reactions", "contacts", "gaps", *RATES_AND_FORCES)
    joints = [str(joint) for joint in model.names[1:]]
    if name not in names and name not in joints:
        raise UnknownNameError(f'no plot and no joint "{name}"{nearest(name, [*names, *joints])}')
    if not _record_of(run, name):
        if name in ("violation", "reactions") and not run.scene.constraint_slices:
            raise InputError(f'plot "{name}" needs a constraint, and this scene has none')
        if name == "contacts" and not run.scene.contacts:
            raise InputError('plot "contacts" needs a contact, and this scene has none')
        if name == "gaps":
            raise InputError('plot "gaps" needs a contact that opens, and this run has none')
        if name == "F_nonideal" and run.recorded("F_nonideal"):
            raise InputError('plot "F_nonideal" needs a nonideal force, and this run has none')
        record = {"a": "a", "tau": "tau", "power": "power"}.get(name, "energy")
        record = "forces" if name in ("reactions", "contacts", "F_nonideal") else record
        raise InputError(f'plot "{name}" must be recorded: pass record=("{record}",) to simulate')
    energy = run.energy or {}
    if name == "energy":
        return [Plot("Energy", "J", t, {k: energy[k] for k in STORED_ENERGY})]
    if name == "work":
        return [Plot("Work", "J", t, {k: v for k, v in energy.items() if k not in STORED_ENERGY})]
    if name == "violation":
        return [Plot("Constraint violation", "m, rad", t, {"largest residual": run.violation}, log=True)]
    if name == "reactions":
        slices, left_out = run.scene.constraint_slices, open_contacts(run)
        size = {k: np.linalg.norm(run.lam[:, s], axis=1) for k, s in slices.items() if k not in left_out}
        return [Plot("Reactions, |lam|", "N, N m", t, _widest_curves(size), note=omission_note(len(size)))]
    if name == "power":
        return [
            Plot("Power", "W", t, _widest_curves(run.power or {}), note=omission_note(len(run.power or {})))
        ]
    if name == "contacts":
        slices = list(run.scene.constraint_slices.items())[len(run.scene.constraints) :]
        normal = {key: run.lam[:, rows.stop - 1] for key, rows in slices}
        return [Plot("Normal force", "N", t, _widest_curves(normal), note=omission_note(len(normal)))]
    if name == "gaps":
        times, gaps = gaps_of(run)
        count, curves = len(gaps), _widest_curves(gaps)
        if len(curves) < count and len(times) < len(t):
            times, curves = gaps_of(run, list(curves))
        return [Plot("Gaps", "m, rad", times, curves, note=omission_note(count))]
    if name == "tau":
        return _in_joints("Actuation", model, t, np.asarray(run.tau))
    if name == "F_nonideal":
        return _in_joints("Friction, F_nonideal", model, t, np.asarray(run.F_nonideal))
    if name == "q":
        return _by_unit("Position", t, positions(model, run.q))
    if name == "v":
        return _by_unit("Velocity", t, velocities(model, run.v))
    if name == "a":
        return _by_unit("Acceleration", t, velocities(model, run.a, "/s²"))
    place = [c for c in positions(model, run.q) if c.joint == name]
    rate = [c for c in velocities(model, run.v) if c.joint == name]
    return _by_unit(name, t, place) + _by_unit(f"{name}, velocity", t, rate)


def _in_joints(title: str, model: pin.Model, t: Array, tau: Array) -> list[Plot]:
    """Return plots of torques and forces in joints of one degree of freedom.

    Joints without any torque or force are left out, unless all joints are.
    """
    torques = []
    for joint in range(1, model.njoints):
        if model.joints[joint].nv == 1:
            name, unit = str(model.names[joint]), "N m" if joint_axis(model, joint)[1] else "N"
            torques.append(Coordinate(name, name, unit, tau[:, model.joints[joint].idx_v]))
    acting = [c for c in torques if np.any(c.values)] or torques
    zero_count = len(torques) - len(acting)
    note = f"zero in {zero_count} other joint{'s' if zero_count > 1 else ''}" if zero_count else ""
    plots = _by_unit(title, t, acting)
    return [replace(plot, note=", ".join(filter(None, [plot.note, note]))) for plot in plots]


def _user_plot(run: Trajectory, title: str, curves: Mapping[str, Array]) -> Plot:
    """Return a plot of curves of the user."""
    what, _, unit = title.partition("[")
    values = {}
    for label, curve in curves.items():
        where = f'curve "{label}" of plot "{title}"'
        try:
            samples = np.asarray(curve)
        except ValueError:  # lists of unequal length
            samples = np.asarray(None)
        if samples.dtype.kind not in "fiub":
            raise InputError(f"{where} must hold numbers; got {short_repr(curve)}")
        values[str(label)] = samples.astype(np.float64)
        if samples.shape != (len(run.t),):
            raise InputError(
                f"{where} must have shape ({len(run.t)},), one value per sample; got {samples.shape}"
            )
    return Plot(what.strip(), unit.strip(" ]"), np.asarray(run.t), values)


def _by_unit(title: str, t: Array, coordinates: list[Coordinate]) -> list[Plot]:
    """Return one plot for each unit, with the curves of the largest range."""
    plots = []
    for unit in dict.fromkeys(c.unit for c in coordinates):
        every = {c.label: c.values for c in coordinates if c.unit == unit}
        plots.append(Plot(title, unit, t, _widest_curves(every), note=omission_note(len(every))))
    return plots


def omission_note(count: int) -> str:
    """Return the note of a plot on the curves that it omits.

    Args:
        count: number of curves.
    """
    return f"{MAX_CURVES} of {count}, those that move most" if count > MAX_CURVES else ""


def _widest_curves(curves: dict[str, Array]) -> dict[str, Array]:
    """Return the curves with the largest range, in the given order."""
    if len(curves) <= MAX_CURVES:
        return curves
    ranges = np.ptp(np.array(list(curves.values())), axis=1)
    chosen = set(np.argsort(-ranges, kind="stable")[:MAX_CURVES].tolist())
    return {label: values for k, (label, values) in enumerate(curves.items()) if k in chosen}


def runs_and_names(run: Any, names: Sequence[str] | None, what: str) -> tuple[list[Trajectory], list[str]]:
    """Return runs and their names.

    Args:
        run: one run, or a list of runs.
        names: names of several runs; None for numbers.
        what: name of the caller, for messages.

    Raises:
        InputError: there is no run, an entry is not a run or has no scene, or the number of names is wrong.
    """
    runs = list(run) if isinstance(run, (list, tuple)) else [run]
    if not runs:
        raise InputError(f"{what} shows at least one run; got none")
    for one in runs:
        check_scene(one, what)
    if names is None:
        return runs, [f"run {number + 1}" for number in range(len(runs))]
    labels = [str(name) for name in sequence(f"{what}: names", names)]
    if len(labels) != len(runs):
        raise InputError(f"{what} of {len(runs)} runs needs as many names; got {len(labels)}")
    return runs, labels


def check_scene(run: Trajectory, what: str) -> None:
    """Check that a value is a run with its scene.

    Args:
        run: candidate.
        what: name of the caller, for messages.

    Raises:
        InputError: the value is not a run, or its scene is missing or does not fit.
    """
    if not all(hasattr(run, name) for name in ("t", "q", "v", "scene")):
        raise InputError(f"{what} shows a Trajectory, the result of `simulate`; got {type(run).__name__}")
    if run.scene is None:
        raise InputError(
            f"{what} needs the scene of the run, which a trajectory read from a file has not: "
            "pass dataclasses.replace(run, scene=scene)"
        )
    sizes, model = (run.q.shape[1], run.v.shape[1]), run.scene.model
    if sizes != (model.nq, model.nv):
        raise InputError(
            f'{what} needs the scene of the run: scene "{run.scene.name}" has nq {model.nq} and nv '
            f"{model.nv}, the run has {sizes[0]} and {sizes[1]}"
        )
