"""Trajectory: results of a run, as arrays on one time axis."""

from __future__ import annotations

import copy
import dataclasses
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.html_tables import table
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.types import Array, Table
from pin_nonideal.validation import array
from pin_nonideal.validation import count as whole_number

from .by_name import force_of, frame_record, joint_record, law_record, reaction_of
from .columns import columns, units
from .contact_record import contact_record
from .fields import RunFields
from .records import ContactRecord, FrameRecord, JointRecord, LawRecord, Sample
from .summary import summary

# A line of the summary: its heading, with a unit or not, and the rest from ": " or the first digit on.
SUMMARY_LINE = re.compile(r"([a-z]+(?: [a-z]+)*(?: \[J\])?)(?:: +| +(?=\d))(.*)")


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(RunFields):
    """Samples of a run.

    Arrays that were not recorded are false in a condition, and all other uses raise an InputError that names
    the value of `record`; see also `recorded`.

    Attributes:
        t: times [s], (nt,).
        q: configurations, (nt, nq).
        v: velocities, (nt, nv).
        violation: maximum |residual| over all rows [m or rad], (nt,).
        violation_rate: maximum |rate| over all rows [m/s or rad/s], (nt,).
        a: accelerations, (nt, nv); record "a".
        tau: torques of the actuation [N m or N], (nt, nv); record "tau" or "forces".
        F_ideal: ideal part of the constraint force, (nt, nv), Eq. (39); record "forces".
        F_nonideal: nonideal part of the constraint force, including the forces of sticking elements, (nt,
            nv), Eq. (39); record "forces".
        lam: multipliers of all rows in M a = F + C + A^T lam, (nt, m); record "forces". A pair of shapes has
            one column, the sum of the normal forces at its points.
        lam_ideal: multipliers of the ideal part, (nt, m); record "forces".
        energy: energy ledger by column [J]: "kinetic", "potential", "total", then the work since the start by
            "actuation", "forces", "constraints", each law, and "projection". "balance" is the difference of
            the total energy and the work, and must be zero. Record "energy".
        power: power by column [W]: "actuation", "forces", "constraints", each law.  Record "power".
        z: states of laws, (nt, nz), or None if no law has states.
        modes: mode of each friction element, +1 or -1 for slip, 0 for stick, 2 for an open contact, (nt,
            ne), or None without friction elements. A pair of shapes slips if one of its points slips.
        closed: whether each contact is closed, in the order of the scene's `contact_names`, (nt, n),
            or None without unilateral contacts.
        limits: limit of each friction element in its mode [N or N m], (nt, ne); record "laws" or "forces".
        law_forces: part of C of each law by name, on the degrees of freedom `law_dofs`; record "laws" or
            "forces". See `law`.
        reactions: wrench by name of joint, anchor and contact [N; N m], (nt, 12): [force; moment] in its own
            axes, then in world axes; record "reactions". See `reaction`.
        contact_forces: force of each contact by name, on the body of the contact's frame, normal and
            friction, in world axes [N], (nt, 3); record "forces". The force of a pair of shapes with several
            points is the resultant on the body of the later joint. `contact` returns both bodies.
        contact_torques: moment of these forces about the center of pressure by name of the contact, in world
            axes [N m], (nt, 3); record "forces". This moment does not include torsional and rolling
            resistance.
        contact_points: points of each contact by name, with gap and force, see `ContactPoints`; record
            "contact_points".
        points: points of pairs of shapes that touch, for replays and `contact`.
        grid: whether each sample lies on the grid of `output_dt`, which includes both ends, (nt,); all True
            if every step is a sample.
        dense: interpolants of the steps, see `at`; record "dense".
        user_events: zeros of each function in `simulate(events=[...])`, with times and states.
        events: events in order of time.
        stats: counters of the run.
        scene: scene of the run. The scene is None in another process if the scene cannot be pickled, and
            after `load` if the scene was not created by the function `load`.
        element_names: names of the columns of `modes`.
        element_laws: index of the law of each element.
        law_names: names of the laws.
        law_dofs: degrees of freedom on which each law acts.
        joints: indices of each joint in `q` and `v`.
        rows: first row in `lam`, end of the rows, and whether it is a contact, by name of each constraint and
            contact.
        name: name of the scene.
        notes: notes on the run, such as a projection of the initial state onto the constraints.
        failure: message of the error that stopped the run before its end, or None.
    """

    def __getstate__(self) -> Table:
        # The scene is included if it can be pickled.
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
        rows = [match.groups() if match else (line,) for match, line in zip(parts, lines, strict=True)]
        return table(f"Trajectory {first}", rows)

    def columns(self) -> dict[str, Array]:
        """Return all recorded values as named columns, (nt,) each: "t", "crank.q", "loop.lam.0", ...

        A name consists of the name of a joint, constraint, law or ledger, the field, and the number within
        the field. Columns that belong to no joint have the name of their field only. A
        space in a name becomes "_". The suffixes "_2", "_3", ... distinguish names that become equal.
        """
        return columns(self)

    def joint(self, name: str) -> JointRecord:
        """Return the record of one joint.

        Args:
            name: name of a joint; "base" is the only floating joint.

        Returns:
            Record of the joint.

        Raises:
            UnknownNameError: there is no such joint.
        """
        return joint_record(self, name)

    def frame(self, name: str) -> FrameRecord:
        """Return the placement and velocity of one frame in the world, from the kinematics of the tree.

        Args:
            name: name of a frame or joint of the model.

        Raises:
            InputError: the run has no scene, and therefore no model.
            UnknownNameError: there is no such frame.
        """
        return frame_record(self, name)

    def force(self, name: str) -> Array:
        """Return the force of one constraint or contact.

        Args:
            name: name of a constraint or contact of the scene.

        Returns:
            For a constraint, the multipliers of its rows in M a = F + C + A^T lam, (nt, rows); those of an
            anchor are the force on the body of frame1 in the axes of frame2 [N; N m]; record "forces". For a
            contact, the force on the body of its frame in world axes, with friction [N], (nt, 3), as in
            `contact_forces`; record "reactions".

        Raises:
            InputError: the force was not recorded.
            UnknownNameError: there is no such constraint or contact.
        """
        return force_of(self, name)

    def contact(self, name: str) -> ContactRecord:
        """Return the resultant force, the center of pressure and the gap of one contact.

        A pair of shapes is named as its `GeometryContact`, by default "SHAPE on OTHER". The run must have
        recorded "forces".

        Args:
            name: name of a contact of the scene.

        Returns:
            Record of the contact.

        Raises:
            InputError: the run did not record "forces" or has no scene, or the contact has no contact point.
            UnknownNameError: there is no such contact.
        """
        return contact_record(self, name)

    def law(self, name: str) -> LawRecord:
        """Return the record of one law.

        Args:
            name: name of a law of the scene, or of a contact with friction.

        Returns:
            Record of the law.

        Raises:
            UnknownNameError: there is no such law.
        """
        return law_record(self, name)

    def reaction(self, name: str, axes: str = "own") -> Array:
        """Return the total wrench of a joint, an anchor or a contact: [force; moment] [N; N m], (nt, 6).

        The wrench of a joint acts on the body that the joint moves, about the joint's origin, and includes
        the drive and the friction of the joint. The wrench of an anchor or contact acts on the body of
        frame1, about the origin of frame1, and includes the friction of its laws. The wrench of a pair of
        shapes with several points acts on the body of the later joint, about the origin of this joint; "own"
        selects the axes of the other joint.

        The wrench through a fixed joint, or through a link, is exerted on the part beyond it, about its
        origin: the rate of momentum of that part minus its weight and minus all other forces on it. The load
        is computed from the inertias that Pinocchio keeps in the frames of fixed joints. A fixed joint whose
        link has no inertia there is massless. The name of a link stands for the joint that carries it.

        Args:
            name: name of a joint of the model, also of a fixed joint or a link, or of an anchor or contact,
                which takes precedence over a joint of that name.
            axes: "own" for the axes of the joint frame or of frame2, or "world".

        Raises:
            InputError: the run did not record "reactions", or `axes` is invalid; for a fixed joint or link
                also: the model has no inertia beyond it, the scene does not show on which side of it a joint,
                constraint, contact or force acts, or the masses of the run differ from those of its scene.
            UnknownNameError: no joint, link, anchor or contact has that name.
        """
        return reaction_of(self, name, axes)

    def to_dataframe(self) -> Any:
        """Return the `columns` as a pandas.DataFrame, with a row for each sample and the time as index.

        Returns:
            The DataFrame; its `attrs["units"]` has the unit of each column and of the index, such as "rad/s".
            A unit is "1" for numbers without one, as in quaternions, and empty if it is unknown.

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
        """Return the first samples of a run, with the events up to the last sample.

        Args:
            count: number of samples, at most the number of samples of the run.

        Raises:
            InputError: `count` is not a number of samples.
        """
        count = whole_number("first: count", count, max_value=len(self.t))
        last = float(self.t[count - 1]) if count else -np.inf
        events = [e for e in self.events if e.time <= last]
        return dataclasses.replace(self.samples(slice(count)), events=events)

    def samples(self, chosen: Any) -> Trajectory:
        """Return some of the samples, with all events.

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
            if isinstance(value, dict) and key not in ("rows", "contact_points"):
                return {name: x[chosen] for name, x in value.items()}
            return value[chosen] if isinstance(value, np.ndarray) else value

        fields = {key: cut(value, key) for key, value in self.__dict__.items()}
        if self.points is not None:
            points = self.points.samples(chosen)
            fields |= {"points": points, "contact_points": points.by_contact()}
        return Trajectory(**fields)

    def at(self, t: ArrayLike) -> Any:
        """Return the run at any times, from the interpolants of its steps, with all recorded fields.

        Samples are projected onto the constraints, and forces are evaluated there under the modes of the
        step. At an event the step after the event is used. The interpolant of dop853 has degree 7, so that
        its local error has order 8 in the step size, as the global error of the steps has. The interpolants
        of dopri5 and rk4 have degrees 4 and 3.

        Args:
            t: time [s], or times, (k,).

        Returns:
            A Sample with the fields of this class for one time, or a Trajectory for several times.

        Raises:
            InputError: the run did not record "dense", has no scene, or a time is outside of the run.
        """
        if self.dense is None:
            raise InputError('at(t) needs a run with record="dense"')
        if self.scene is None:
            raise InputError("at(t) needs the scene of the run, which this one has lost")
        times = array("at: t", t, (None,) if np.ndim(t) else ())
        fields = self.dense.at(compiled_scene(self.scene), times.reshape(-1), self.scene.name)
        run = Trajectory(**fields, scene=self.scene, name=self.scene.name)
        if len(run) and run.energy and self.energy:
            # The balance is relative to the start of the run.
            run.energy["balance"] += run.energy["total"][0] - self.energy["total"][0]
        return run if np.ndim(t) else Sample(**run.samples(0).attributes())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write all arrays to one .npz file; an existing file is replaced completely or not at all.

        Args:
            path: file name; ".npz" is appended if it is missing.

        Returns:
            Path of the written file.

        Raises:
            InputError: `path` is not the name of a file.
            OutputError: the file cannot be written.
        """
        from .file import write

        return write(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str], scene: Scene | str | None = "source") -> Trajectory:
        """Read a file written by `save`; no content of the file is executed.

        Args:
            path: file name.
            scene: scene of the run; "source" reloads the robot by the name and parameters of the original
                `load`, if the file has them; None for no scene.

        Returns:
            Trajectory in the file.

        Raises:
            InputError: `path` is not the name of a file, or the scene is not the scene of the run.
            LoadingError: the file is missing, truncated, or not a trajectory.
        """
        from .file import read

        return restore_trajectory(*read(path), path, scene)


def restore_trajectory(fields: Table, origin: Any, path: Any, scene: Scene | str | None) -> Trajectory:
    """Return a Trajectory from the content of a file, with its scene.

    Args:
        fields: fields of the trajectory.
        origin: name and parameters for `load`, or None.
        path: path of the file, for messages.
        scene: scene of the run, as in `Trajectory.load`.

    Raises:
        InputError: the scene is not the scene of the run.
        LoadingError: the scene cannot be reloaded.
    """
    from .file import describe_content, matches_scene, reload_scene

    run = Trajectory(**fields)
    if scene == "source":
        return dataclasses.replace(run, scene=reload_scene(origin, run.joints, run.rows, run.notes))
    if not (scene is None or isinstance(scene, Scene)):
        raise InputError(f'Trajectory.load: scene must be a Scene, "source" or None; got {short_repr(scene)}')
    if scene is not None and not matches_scene(compiled_scene(scene), run.joints, run.rows):
        raise InputError(
            f'Trajectory.load: the scene "{scene.name}" is not the one of the run in "{path}", which has '
            f"{describe_content(run.joints, run.rows)}; pass the scene that was simulated, or scene=None"
        )
    return dataclasses.replace(run, scene=scene)
