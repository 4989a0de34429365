"""Trajectory: what a run leaves behind, as arrays on one time line."""

from __future__ import annotations

import copy
import dataclasses
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.html_tables import table
from pin_nonideal.scene.scene import Scene
from pin_nonideal.states.joint_layout import JointPlace
from pin_nonideal.types import Array, Table
from pin_nonideal.validation import array
from pin_nonideal.validation import count as whole_number

from .by_name import force_of, frame_record, joint_record, law_record, reaction_of
from .columns import columns, units
from .dense_output import DenseOutput
from .groups import RECORD_OF, GroupField
from .lazy_fields import MadeLater
from .records import Event, FrameRecord, JointRecord, LawRecord, Sample, Stats, UserEventRecord
from .summary import summary

# A line of the summary: its heading, with a unit or not, and the rest from ": " or the first digit on.
SUMMARY_LINE = re.compile(r"([a-z]+(?: [a-z]+)*(?: \[J\])?)(?:: +| +(?=\d))(.*)")


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(MadeLater):
    """Samples of a run; what was not recorded is None or an empty table.

    Attributes:
        t: times [s], (nt,).
        q: configurations, (nt, nq).
        v: velocities, (nt, nv).
        violation: largest |residual| over all rows [m or rad], (nt,).
        violation_rate: largest |rate| over all rows [m/s or rad/s], (nt,).
        a: accelerations, (nt, nv); record "a".
        tau: torques of the actuation [N m or N], (nt, nv); record "tau" or "forces".
        F_ideal: ideal part of the force of constraint, (nt, nv), Eq. (39); record "forces".
        F_nonideal: nonideal part, (nt, nv), Eq. (39); record "forces".  What sticks is part of it.
        lam: multipliers of all rows in M a = F + C + A^T lam, (nt, m); record "forces".
        lam_ideal: multipliers of the ideal part alone, (nt, m); record "forces".
        energy: ledger by column [J]: "kinetic", "potential", "total", then the work done since the start by
            "actuation", "forces", "constraints", each law, and "projection"; "balance" is what is left and
            must be zero.  Record "energy".
        power: power by column [W]: "actuation", "forces", "constraints", each law.  Record "power".
        z: states of laws, (nt, nz), or None without any.
        modes: mode of each frictional element, +1 or -1 for slip, 0 for stick, 2 where its contact is open,
            (nt, ne).
        closed: whether each contact is closed, in the order of the scene's `contact_names`, (nt, n).
        limits: of each frictional element in its mode [N or N m], (nt, ne); record "laws" or "forces".
        law_forces: part of C of each law by name, on the degrees of freedom `law_dofs`; record "laws" or
            "forces".  See `law`.
        reactions: by name of joint, anchor and contact [N; N m], (nt, 12): [force; moment] in its own axes,
            then in world axes; record "reactions".  See `reaction`.
        contact_forces: by name, force of each contact on the body of its frame, normal and friction, in world
            axes [N], (nt, 3); record "forces".
        grid: which samples lie on the grid that `output_dt` asks for, both ends among them, (nt,); all where
            every step is a sample.
        dense: interpolants of the steps, see `at`; record "dense".
        user_events: of each function in `simulate(events=[...])`, when it was zero and the states there.
        events: events in order of time.
        stats: counters.
        scene: the scene that ran; None in another process where it cannot be pickled, and after `load` where
            no `load` of a robot had made it.
        element_names: names of the columns of `modes`.
        element_laws: which law each of them belongs to.
        law_names: names of the laws.
        law_dofs: degrees of freedom that each law acts on.
        joints: where the values of each joint stand in `q` and `v`.
        rows: by name of each constraint and contact, its first row in `lam`, the end of its rows, and
            whether it is a contact.
        name: of the scene.
        notes: what to know of the run, such as an initial state that had to be moved onto the constraints.
        failure: what stopped the run before its end, the message of its error; None when nothing did.
    """

    t: Array
    q: Array
    v: Array
    violation: Array
    violation_rate: Array
    a: Array | None = None
    tau: Array | None = None
    F_ideal: Array | None = None
    F_nonideal: Array | None = None
    lam: Array | None = None
    lam_ideal: Array | None = None
    energy: dict[str, Array] | None = None
    power: dict[str, Array] | None = None
    z: Array | None = None
    modes: NDArray[np.int8] | None = None
    closed: NDArray[np.bool_] | None = None
    limits: Array | None = None
    law_forces: dict[str, Array] | None = None
    reactions: dict[str, Array] | None = None
    contact_forces: dict[str, Array] | None = None
    grid: NDArray[np.bool_] | None = None
    dense: DenseOutput | None = None
    user_events: list[UserEventRecord] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    stats: Stats = field(default_factory=Stats)
    scene: Any = None
    element_names: list[str] = field(default_factory=list)
    element_laws: list[int] = field(default_factory=list)
    law_names: list[str] = field(default_factory=list)
    law_dofs: list[list[int]] = field(default_factory=list)
    joints: list[JointPlace] = field(default_factory=list)
    rows: dict[str, tuple[int, int, bool]] = field(default_factory=dict)
    name: str = ""
    notes: list[str] = field(default_factory=list)
    failure: str | None = None

    def __getstate__(self) -> Table:
        # With its scene, where that can travel.
        try:
            if self.scene is not None:
                self.scene.__reduce__()
        except InputError:
            return {**self.__dict__, "scene": None}
        return vars(self)

    def __deepcopy__(self, memo: dict[int, Any]) -> Trajectory:
        fields = {key: copy.deepcopy(x, memo) for key, x in self.__dict__.items() if key != "scene"}
        return Trajectory(**fields, scene=self.scene)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        samples = f"{len(self.t)} samples" + (f" to {self.t[-1]:g} s" if len(self.t) else "")
        return f'<Trajectory "{self.name}": {samples}, {len(self.events)} events>'

    def __str__(self) -> str:
        return summary(self)

    def _repr_html_(self) -> str:
        first, *lines = summary(self).split("\n")
        parts = [SUMMARY_LINE.fullmatch(line.strip()) for line in lines]
        rows = [found.groups() if found else (line,) for found, line in zip(parts, lines, strict=True)]
        return table(f"Trajectory {first}", rows)

    def columns(self) -> dict[str, Array]:
        """All that was recorded as named columns, (nt,) each: "t", "crank.q", "crank.v", "loop.lam.0", ...

        The names are those of joints, constraints, laws and ledgers, then of the field, then the number
        within it; what belongs to no joint goes by its field alone.  A space in a name becomes "_"; two names
        that become equal are told apart by "_2", "_3", ...
        """
        return columns(self)

    def joint(self, name: str) -> JointRecord:
        """What one joint did.

        Args:
            name: of a joint; "base" is the only floating one.

        Returns:
            Its record; what was not recorded is None.

        Raises:
            UnknownNameError: there is no such joint.
        """
        return joint_record(self, name)

    def frame(self, name: str) -> FrameRecord:
        """How one frame moved: its placement and velocity in the world, from the kinematics of the tree.

        Args:
            name: of a frame or joint of the model.

        Raises:
            InputError: the run does not know its scene, which has the model.
            UnknownNameError: there is no such frame.
        """
        return frame_record(self, name)

    def force(self, name: str) -> Array:
        """What one constraint or contact exerts.

        Args:
            name: of a constraint or contact of the scene.

        Returns:
            Multipliers of a constraint's rows in M a = F + C + A^T lam, (nt, rows), those of an anchor the
            force on the body of frame1 in the axes of frame2 [N; N m]; record "forces".  Of a contact the
            force on the body of its frame in world axes [N], friction included, (nt, 3); record "reactions".

        Raises:
            InputError: it was not recorded.
            UnknownNameError: there is no such constraint or contact.
        """
        return force_of(self, name)

    def law(self, name: str) -> LawRecord:
        """What one law did.

        Args:
            name: of a law of the scene, or of a contact that rubs.

        Returns:
            Its record; what was not recorded is None.

        Raises:
            UnknownNameError: there is no such law.
        """
        return law_record(self, name)

    def reaction(self, name: str, axes: str = "own") -> Array:
        """What a joint, an anchor or a contact carries, all forces in it included: [force; moment], (nt, 6).

        A joint's is exerted on the body that it moves, about its origin; it contains the drive and the
        friction of the joint.  That of an anchor or contact is exerted on the body of frame1, about the
        origin of frame1; it contains the friction of its laws.

        The wrench through a fixed joint, or through a link, is exerted on the part beyond it, about its
        origin: the rate of momentum of that part minus its weight and minus all other forces on it.  It is
        computed from the inertias that Pinocchio keeps in the frames of fixed joints.  A fixed joint whose
        link has no inertia there is massless.  The name of a link stands for the joint that carries it.

        Args:
            name: of a joint of the model, fixed ones and links too, or of an anchor or contact, which goes
                before a joint of its name.
            axes: "own", the joint frame's or those of frame2, or "world".

        Raises:
            InputError: the run did not record "reactions", or `axes` is neither; for a fixed joint or link
                also: the model does not tell the inertia beyond it, the scene does not tell on which side of
                it a joint, constraint, contact or force acts, or the run has other masses than its scene.
            UnknownNameError: nothing of that name carries a wrench.
        """
        return reaction_of(self, name, axes)

    def to_dataframe(self) -> Any:
        """The `columns` as a pandas.DataFrame, one row a sample, with the time as its index.

        Returns:
            The frame; `frame.attrs["units"]` has the unit of each column and of the index, such as "rad/s".
            A unit is "1" for numbers without one, as in quaternions, and empty if the run does not know it.

        Raises:
            InputError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise InputError(
                f"to_dataframe needs pandas, which cannot be imported ({error}); pip install pandas, or take "
                "run.columns()"
            ) from None
        frame = pandas.DataFrame(self.columns()).set_index("t")
        frame.attrs["units"] = units(self)
        return frame

    def first(self, count: int) -> Trajectory:
        """The first samples of a run.

        Args:
            count: how many, at most all.

        Raises:
            InputError: `count` is no number of samples.
        """
        count = whole_number("first: count", count, most=len(self.t))
        last = float(self.t[count - 1]) if count else -np.inf
        events = [e for e in self.events if e.time <= last]
        return dataclasses.replace(self.samples(slice(count)), events=events)

    def samples(self, chosen: Any) -> Trajectory:
        """Some of the samples, with all events.

        Args:
            chosen: mask (nt,), indices or slice of samples.

        Raises:
            InputError: `chosen` is none of these, or an index lies outside.
        """
        try:
            np.arange(len(self.t))[chosen]
        except (IndexError, TypeError, ValueError):
            raise InputError(
                f"samples: chosen must be a mask, indices or a slice of {len(self.t)} samples"
                f"; got {short_repr(chosen)}"
            ) from None

        def cut(value: Any, key: str) -> Any:
            if isinstance(value, dict) and key != "rows":
                return {name: x[chosen] for name, x in value.items()}
            return value[chosen] if isinstance(value, np.ndarray) else value

        return Trajectory(**{key: cut(value, key) for key, value in self.__dict__.items()})

    def at(self, t: ArrayLike) -> Any:
        """The run at any times, from the interpolants of its steps, with all that it recorded.

        Samples are put on the constraints, and forces evaluated there under the modes of the step; at an
        event the step that follows it is taken.  The interpolant of dop853 is of degree 7: its local error is
        of order 8 in the step, as the global one of the steps is; those of dopri5 and rk4 are of degree 4 and
        3.

        Args:
            t: a time [s], or times, (k,).

        Returns:
            A Sample with the fields of this class at one time, or a Trajectory at several.

        Raises:
            InputError: the run did not record "dense", does not know its scene, or a time lies outside.
        """
        if self.dense is None:
            raise InputError('at(t) needs a run with record="dense"')
        if self.scene is None:
            raise InputError("at(t) needs the scene of the run, which this one has lost")
        times = array("at: t", t, (None,) if np.ndim(t) else ())
        run = Trajectory(**self.dense.at(self.scene, times.reshape(-1)))
        if len(run) and run.energy and self.energy:
            # The ledger balances from the start of the run on.
            run.energy["balance"] += run.energy["total"][0] - self.energy["total"][0]
        return run if np.ndim(t) else Sample(**run.samples(0).__dict__)

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
        from .file import write

        return write(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str], scene: Scene | str | None = "source") -> Trajectory:
        """Reads a file written by `save`; nothing in it is executed.

        Args:
            path: file name.
            scene: the scene of the run; "source" loads the robot again by the name and parameters that `load`
                was given then, where there are some; None for none.

        Returns:
            The trajectory.

        Raises:
            InputError: `path` is no name of a file, or the scene is not the one of the run.
            LoadingError: the file is missing, truncated, or no trajectory.
        """
        from .file import read

        return restored(*read(path), path, scene)


_DEFAULTS: Table = {}
_MAKERS: dict[str, Callable[[], Any]] = {}
for _field in dataclasses.fields(Trajectory):
    if _field.default is not dataclasses.MISSING:
        _DEFAULTS[_field.name] = _field.default
        delattr(Trajectory, _field.name)  # what `later` makes is not to be hidden by attributes of the class
    elif _field.default_factory is not dataclasses.MISSING and _field.name != "stats":
        _MAKERS[_field.name] = _field.default_factory

for _name in RECORD_OF:
    setattr(Trajectory, _name, GroupField(_name))


def with_defaults(fields: Table) -> Table:
    """All fields of a Trajectory but its counters: those given, and of all others the defaults."""
    made = {name: make() for name, make in _MAKERS.items() if name not in fields}
    return {**_DEFAULTS, **made, **fields}


def restored(fields: Table, origin: Any, path: Any, scene: Scene | str | None) -> Trajectory:
    """Trajectory of the content of a file, with its scene.

    Args:
        fields: of the trajectory.
        origin: name and parameters for `load`, or None.
        path: of the file, for messages.
        scene: as for `Trajectory.load`.

    Raises:
        InputError: the scene is not the one of the run.
        LoadingError: the scene cannot be loaded again.
    """
    from .file import described, fits, scene_again

    run = Trajectory(**fields)
    if scene == "source":
        return dataclasses.replace(run, scene=scene_again(origin, run.joints, run.rows, run.notes))
    if not (scene is None or isinstance(scene, Scene)):
        raise InputError(f'Trajectory.load: scene must be a Scene, "source" or None; got {short_repr(scene)}')
    if scene is not None and not fits(scene, run.joints, run.rows):
        raise InputError(
            f'Trajectory.load: the scene "{scene.name}" is not the one of the run in "{path}", which has '
            f"{described(run.joints, run.rows)}; pass the scene that was simulated, or scene=None"
        )
    return dataclasses.replace(run, scene=scene)
