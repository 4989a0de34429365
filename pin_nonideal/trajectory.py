"""Trajectory: what a run leaves behind, as arrays on one time line."""

from __future__ import annotations

import copy
import dataclasses
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import array, choice
from .dense import DenseOutput
from .errors import InputError, UnknownNameError, nearest
from .records import Event, FrameRecord, JointRecord, LawRecord, Sample, Stats, UserEventRecord, angles
from .scene import Scene
from .scene_copy import packed, parts_of
from .states.configurations import CIRCLES, JointPlace
from .states.placements import frame_motion
from .trajectory_columns import columns
from .types import Array, Table


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
                packed(parts_of(self.scene), self.scene.name)
        except InputError:
            return {**self.__dict__, "scene": None}
        return self.__dict__

    def __deepcopy__(self, memo: dict[int, Any]) -> Trajectory:
        fields = {key: copy.deepcopy(x, memo) for key, x in self.__dict__.items() if key != "scene"}
        return Trajectory(**fields, scene=self.scene)

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
        if s.limited_by_rounding:
            lines.append(
                f"  limited by rounding: {s.limited_by_rounding} of {s.steps} steps; accelerations are known "
                f"to {s.rounding:.0e} of the largest"
            )
        if self.energy is not None and len(self.t):
            shown = ", ".join(f"{k} {x[-1]:.6g}" for k, x in self.energy.items() if k != "balance")
            lines.append(f"  energy [J]: {shown}; balance {np.abs(self.energy['balance']).max():.1e}")
        if self.events:
            kinds = sorted({e.kind for e in self.events})
            counts = ", ".join(f"{sum(e.kind == k for e in self.events)} {k}" for k in kinds)
            lines.append(f"  events: {counts}")
        lines.append(f"  wall time {s.wall_s:.3g} s")
        lines += [f"  note: {note}" for note in self.notes]
        if self.failure:
            lines.append(f"  stopped early: {self.failure}")
        return "\n".join(lines)

    def joint(self, name: str) -> JointRecord:
        """What one joint did.

        Args:
            name: of a joint; "base" is the only floating one.

        Returns:
            Its record; what was not recorded is None.

        Raises:
            UnknownNameError: there is no such joint.
        """
        floating = [place for place in self.joints if place.kind == "JointModelFreeFlyer"]
        known = {"base": floating[0]} if len(floating) == 1 else {}
        known |= {place.name: place for place in self.joints}
        if name not in known:
            raise UnknownNameError(f'no joint "{name}" in this run{nearest(name, known)}')
        place = known[name]
        rates = slice(place.v_first, place.v_first + place.nv)
        v, a, tau = (None if x is None else x[:, rates] for x in (self.v, self.a, self.tau))
        assert v is not None
        q = self.q[:, place.q_first : place.q_first + place.nq]
        if place.kind.startswith(CIRCLES):
            q = np.column_stack([q[:, :-2], angles(q[:, -2:], v[:, -1], self.t)])
        alone = place.nv == 1 and q.shape[1] == 1
        parts = [x if x is None or not alone else x[:, 0] for x in (q, v, a, tau)]
        return JointRecord(place.name, *parts)  # type: ignore[arg-type]

    def frame(self, name: str) -> FrameRecord:
        """How one frame moved: its placement and velocity in the world, from the kinematics of the tree.

        Args:
            name: of a frame or joint of the model.

        Raises:
            InputError: the run does not know its scene, which has the model.
            UnknownNameError: there is no such frame.
        """
        if self.scene is None:
            raise InputError(f'frame("{name}") needs the scene of the run, which this one has lost')
        model = self.scene.model
        known = [str(f.name) for f in model.frames] + [str(n) for n in model.names]
        if name not in known:
            raise UnknownNameError(f'no frame "{name}" in model "{model.name}"{nearest(name, known)}')
        return FrameRecord(name, *frame_motion(model, name, self.q, self.v))

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
        if name not in self.rows:
            raise UnknownNameError(f'no constraint or contact "{name}" in this run{nearest(name, self.rows)}')
        first, end, contact = self.rows[name]
        if contact:
            return self.reaction(name, "world")[:, :3]
        if self.lam is None:
            raise InputError(f'force("{name}") needs a run with record="forces"')
        return self.lam[:, first:end]

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

    def columns(self) -> dict[str, Array]:
        """All that was recorded as named columns, (nt,) each: "t", "crank.q", "crank.v", "loop.lam.0", ...

        The names are those of joints, constraints, laws and ledgers, then of the field, then the number
        within it; what belongs to no joint goes by its field alone.
        """
        return columns(self)

    def to_dataframe(self) -> Any:
        """The `columns` as a pandas.DataFrame, one row a sample, with the time as its index.

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
        return pandas.DataFrame(self.columns()).set_index("t")

    def first(self, count: int) -> Trajectory:
        """The first samples of a run.

        Args:
            count: how many.
        """
        last = float(self.t[count - 1]) if count else -np.inf
        events = [e for e in self.events if e.time <= last]
        return dataclasses.replace(self.samples(slice(count)), events=events)

    def samples(self, chosen: Any) -> Trajectory:
        """Some of the samples, with all events.

        Args:
            chosen: mask (nt,), indices or slice of samples.
        """

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
        if len(run) and run.energy is not None and self.energy is not None:
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
        from .trajectory_file import write

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
        from .trajectory_file import read

        return cls._made(*read(path), path, scene)

    @classmethod
    def _made(cls, fields: Table, origin: Any, path: Any, scene: Scene | str | None) -> Trajectory:
        """The trajectory of what a file holds, with a scene as `load` is asked for one."""
        from .trajectory_file import fits, scene_again

        run = cls(**fields)
        if scene == "source":
            return dataclasses.replace(run, scene=scene_again(origin, run.joints, run.rows, run.notes))
        if scene is not None and not (isinstance(scene, Scene) and fits(scene, run.joints, run.rows)):
            name = scene.name if isinstance(scene, Scene) else scene
            raise InputError(f'Trajectory.load: the scene "{name}" is not the one of the run in "{path}"')
        return dataclasses.replace(run, scene=scene)
