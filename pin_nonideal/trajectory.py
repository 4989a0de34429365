"""Trajectory: what a run leaves behind, as arrays on one time line."""

from __future__ import annotations

import json
import os
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .checks import choice
from .errors import InputError, LoadingError, UnknownNameError, nearest
from .files import file_path, whole_file
from .records import LawRecord
from .types import Array, Table

FORMAT = 1
# What NumPy, zip archives and JSON raise on files that are damaged or something else.
UNREADABLE: tuple[type[Exception], ...] = (OSError, ValueError, LookupError, TypeError, AttributeError)
UNREADABLE += (EOFError, RuntimeError, tokenize.TokenError, zipfile.BadZipFile, zlib.error)
REQUIRED = ("t", "q", "v", "violation", "violation_rate")
LEDGER = ("kinetic", "potential", "total", "balance")  # columns of every ledger of energy
OPTIONAL = ("a", "F_ideal", "F_nonideal", "lam", "lam_ideal", "z", "modes", "limits")
# By name, with one row or number a sample: of these a file holds a table, or nothing.
GROUPS = ("energy", "power", "law_forces", "reactions")
LISTS = ("element_names", "element_laws", "law_names", "law_dofs")


@dataclass(frozen=True)
class Event:
    """Something that happened between two smooth stretches of motion.

    Attributes:
        time: when [s].
        kind: "stick", "slip" or "reverse" of a frictional element, "pull" of a contact whose normal force
            turned negative, "chatter" where a cluster of events was bridged by time stepping, "several" from
            where on the laws allow other motions too.
        element: name of the law or contact.
    """

    time: float
    kind: str
    element: str


@dataclass(frozen=True)
class Stats:
    """Counters of a run.

    Attributes:
        steps: accepted steps.
        rejected: rejected steps.
        evaluations: evaluations of Eq. (40).
        factorizations: factorizations of the constraint rows.
        projections: projections that moved the state.
        iterations: passes of the implicit reaction equation.
        wall_s: wall time [s].
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    factorizations: int = 0
    projections: int = 0
    iterations: int = 0
    wall_s: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """Samples of a run; what was not recorded is None.

    Attributes:
        t: times [s], (nt,).
        q: configurations, (nt, nq).
        v: velocities, (nt, nv).
        violation: largest |residual| over all rows [m or rad], (nt,).
        violation_rate: largest |rate| over all rows [m/s or rad/s], (nt,).
        a: accelerations, (nt, nv); record "a".
        F_ideal: ideal part of the force of constraint, (nt, nv), Eq. (39); record "forces".
        F_nonideal: nonideal part, (nt, nv), Eq. (39); record "forces".  What sticks is part of it.
        lam: multipliers of all rows in M a = F + C + A^T lam, (nt, m); record "forces".
        lam_ideal: multipliers of the ideal part alone, (nt, m); record "forces".
        energy: ledger by column [J]: "kinetic", "potential", "total", then the work done since the start by
            "actuation", "forces", "constraints", each law, and "projection"; "balance" is what is left and
            must be zero.  Record "energy".
        power: power by column [W]: "actuation", "forces", "constraints", each law.  Record "power".
        z: states of laws, (nt, nz), or None without any.
        modes: mode of each frictional element, +1 or -1 for slip, 0 for stick, (nt, ne).
        limits: of each frictional element in its mode [N or N m], (nt, ne); record "laws" or "forces".
        law_forces: part of C of each law by name, on the degrees of freedom `law_dofs`; record "laws" or
            "forces".  See `law`.
        reactions: by name of joint, anchor and contact [N; N m], (nt, 12): [force; moment] in its own axes,
            then in world axes; record "reactions".  See `reaction`.
        events: events in order of time.
        stats: counters.
        scene: the scene that ran; None after `load` and in another process.
        element_names: names of the columns of `modes`.
        element_laws: which law each of them belongs to.
        law_names: names of the laws.
        law_dofs: degrees of freedom that each law acts on.
        name: of the scene.
    """

    t: Array
    q: Array
    v: Array
    violation: Array
    violation_rate: Array
    a: Array | None = None
    F_ideal: Array | None = None
    F_nonideal: Array | None = None
    lam: Array | None = None
    lam_ideal: Array | None = None
    energy: dict[str, Array] | None = None
    power: dict[str, Array] | None = None
    z: Array | None = None
    modes: NDArray[np.int8] | None = None
    limits: Array | None = None
    law_forces: dict[str, Array] | None = None
    reactions: dict[str, Array] | None = None
    events: list[Event] = field(default_factory=list)
    stats: Stats = field(default_factory=Stats)
    scene: Any = None
    element_names: list[str] = field(default_factory=list)
    element_laws: list[int] = field(default_factory=list)
    law_names: list[str] = field(default_factory=list)
    law_dofs: list[list[int]] = field(default_factory=list)
    name: str = ""

    def __getstate__(self) -> Table:
        return {**self.__dict__, "scene": None}  # a scene holds compiled state and stays in its process

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        samples = f"{len(self.t)} samples" + (f" to {self.t[-1]:g} s" if len(self.t) else "")
        return f'<Trajectory "{self.name}": {samples}, {len(self.events)} events>'

    def __str__(self) -> str:
        s = self.stats
        span = f"{self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else "empty"
        lines = [
            f"{self.name or 'trajectory'}: {span}, {len(self.t)} samples",
            f"  steps {s.steps} ({s.rejected} rejected), evaluations {s.evaluations}, "
            f"projections {s.projections}, reaction passes {s.iterations}",
            f"  violation {self.violation.max(initial=0.0):.1e}, "
            f"rate {self.violation_rate.max(initial=0.0):.1e}",
        ]
        if self.energy is not None and len(self.t):
            shown = ", ".join(f"{k} {x[-1]:.6g}" for k, x in self.energy.items() if k != "balance")
            lines.append(f"  energy [J]: {shown}; balance {np.abs(self.energy['balance']).max():.1e}")
        if self.events:
            kinds = sorted({e.kind for e in self.events})
            counts = ", ".join(f"{sum(e.kind == k for e in self.events)} {k}" for k in kinds)
            lines.append(f"  events: {counts}")
        lines.append(f"  wall time {s.wall_s:.3g} s")
        return "\n".join(lines)

    def law(self, name: str) -> LawRecord:
        """What one law did.

        Args:
            name: of a law of the scene, or of a contact that rubs.

        Returns:
            Its record; what was not recorded is None.

        Raises:
            UnknownNameError: there is no such law.
        """
        if name not in self.law_names:
            raise UnknownNameError(f'no law "{name}" in this run{nearest(name, self.law_names)}')
        index, force, power = self.law_names.index(name), None, None
        if self.law_forces is not None:
            force = np.zeros(self.v.shape)
            force[:, self.law_dofs[index]] = self.law_forces[name]
            power = np.einsum("ij,ij->i", force, self.v)
        if self.power is not None:  # after three columns of the scene
            power = list(self.power.values())[len(self.power) - len(self.law_names) + index]
        own = [e for e, law in enumerate(self.element_laws) if law == index]
        columns = own[0] if len(own) == 1 else own
        limit = self.limits[:, columns] if own and self.limits is not None else None
        mode = self.modes[:, columns] if own and self.modes is not None else None
        return LawRecord(name, force, power, limit, mode)

    def reaction(self, name: str, axes: str = "own") -> Array:
        """What a joint, an anchor or a contact carries, all forces in it included: [force; moment], (nt, 6).

        A joint's is exerted on the body that it moves, about its origin; it contains the drive and the
        friction of the joint.  That of an anchor or contact is exerted on the body of frame1, about the
        origin of frame1; it contains the friction of its laws.

        Args:
            name: of a joint of the model, or of an anchor or contact, which goes before a joint of its name.
            axes: "own", the joint frame's or those of frame2, or "world".

        Raises:
            InputError: the run did not record "reactions", or `axes` is neither.
            UnknownNameError: nothing of that name carries a wrench.
        """
        if self.reactions is None:
            raise InputError(f'reaction("{name}") needs a run with record="reactions"')
        if name not in self.reactions:
            raise UnknownNameError(f'no joint, anchor or contact "{name}"{nearest(name, self.reactions)}')
        begin = 6 * ("own", "world").index(choice("reaction: axes", axes, ("own", "world")))
        return self.reactions[name][:, begin : begin + 6]

    def first(self, count: int) -> Trajectory:
        """The first samples of a run.

        Args:
            count: how many.
        """
        length = len(self)

        def cut(value: Any) -> Any:
            if isinstance(value, dict):
                return {key: x[:count] for key, x in value.items()}
            return value[:count] if isinstance(value, np.ndarray) and len(value) == length else value

        fields = {key: cut(value) for key, value in self.__dict__.items()}
        last = float(self.t[count - 1]) if count else -np.inf
        return Trajectory(**{**fields, "events": [e for e in self.events if e.time <= last]})

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes all arrays to one .npz file; an existing file is replaced whole or not at all.

        Args:
            path: file name; ".npz" is appended when it is missing.

        Returns:
            The path written.

        Raises:
            InputError: `path` is no name of a file.
            OutputError: the file cannot be written.
        """
        target = file_path("Trajectory.save: path", path)
        if target.suffix != ".npz":
            target = target.with_name(target.name + ".npz")
        arrays: Table = {key: getattr(self, key) for key in REQUIRED}
        arrays |= {key: getattr(self, key) for key in OPTIONAL if getattr(self, key) is not None}
        tables = {group: getattr(self, group) for group in GROUPS}
        for group, table in tables.items():
            arrays |= {f"{group}/{i}": x for i, x in enumerate((table or {}).values())}
        header = {
            "format": FORMAT,
            "name": self.name,
            "events": [[e.time, e.kind, e.element] for e in self.events],
            "stats": vars(self.stats),
        }
        header |= {key: getattr(self, key) for key in LISTS}
        header |= {group: None if table is None else list(table) for group, table in tables.items()}
        arrays["header"] = np.array(json.dumps(header))
        with whole_file(target, "the trajectory") as stream:
            np.savez_compressed(stream, **arrays)
        return target

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Reads a file written by `save`; nothing in it is executed.

        Args:
            path: file name.

        Returns:
            The trajectory, without its scene.

        Raises:
            InputError: `path` is no name of a file.
            LoadingError: the file is missing, truncated, or no trajectory.
        """
        source = file_path("Trajectory.load: path", path)
        try:
            with np.load(source, allow_pickle=False) as file:
                arrays = {key: file[key] for key in file.files}
            header = json.loads(str(arrays.pop("header")))
            if header.get("format") != FORMAT:
                raise LoadingError(f'"{source}" must have format {FORMAT}; it has {header.get("format")}')
            missing = [key for key in REQUIRED if key not in arrays]
            if missing:
                raise LoadingError(f'"{source}" is no complete trajectory: {", ".join(missing)} missing')
            _check_arrays(arrays, source)
            fields: Table = {key: arrays.get(key) for key in (*REQUIRED, *OPTIONAL)}
            for group in GROUPS:
                if header.get(group) is not None:  # files of earlier versions have fewer
                    if group == "energy":
                        _check_ledger(header[group], source)
                    fields[group] = {name: arrays[f"{group}/{i}"] for i, name in enumerate(header[group])}
            fields |= {key: list(header.get(key, ())) for key in LISTS}
            events = [Event(float(t), str(kind), str(element)) for t, kind, element in header["events"]]
            return cls(
                **fields,
                events=events,
                stats=Stats(**header["stats"]),
                name=str(header["name"]),
            )
        except LoadingError:
            raise
        except UNREADABLE as error:
            raise LoadingError(
                f'cannot read a trajectory from "{source}": {type(error).__name__}: {error}; '
                "it must be an .npz file written by Trajectory.save"
            ) from error


def _check_ledger(names: Sequence[str], source: Path) -> None:
    """Raises unless the ledger has the columns that every ledger has.

    Raises:
        LoadingError: one is missing.
    """
    missing = [name for name in LEDGER if name not in names]
    if missing:
        raise LoadingError(f'"{source}" is no trajectory: its energy has no {", ".join(missing)}')


def _check_arrays(arrays: Table, source: Path) -> None:
    """Raises unless every array holds numbers and has a row for each sample.

    Raises:
        LoadingError: one does not.
    """
    rows = arrays["t"].shape[:1]
    t = arrays["t"]
    if t.dtype.kind in "fi" and t.ndim == 1:
        if not np.isfinite(t).all():
            raise LoadingError(
                f'"{source}" is no trajectory: t must be finite; it holds {t[~np.isfinite(t)][0]}'
            )
        early = np.flatnonzero(np.diff(t) < 0.0)
        if early.size:
            i = int(early[0])
            raise LoadingError(
                f'"{source}" is no trajectory: t must not fall; t[{i + 1}] = {t[i + 1]:g} follows {t[i]:g}'
            )
    for key, x in arrays.items():
        if x.dtype.kind not in "fi":
            raise LoadingError(f'"{source}" is no trajectory: {key} must hold numbers; got {x.dtype.name}')
        columns = 2 if key in ("q", "v", *OPTIONAL) or key.startswith(("law_forces/", "reactions/")) else 1
        if x.ndim != columns:
            shape = "a table" if columns == 2 else "one column"
            raise LoadingError(f'"{source}" is no trajectory: {key} must be {shape}; got shape {x.shape}')
        if x.shape[:1] != rows:
            raise LoadingError(
                f'"{source}" is no trajectory: {key} must have {rows[0]} rows as t has; got shape {x.shape}'
            )
