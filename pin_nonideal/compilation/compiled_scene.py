"""A scene compiled into the core's program, with the names of rows, contacts and joints."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cached_property

from pin_nonideal.core_loader import core
from pin_nonideal.description.actuation import SampledControl
from pin_nonideal.description.constraints import PrescribedMotion, UserConstraint
from pin_nonideal.description.contacts.pair_of_shapes import ContactGroup, PairOfShapes, contact_parts
from pin_nonideal.description.contacts.point_names import ContactOfPoint, UsedNames
from pin_nonideal.description.drive_kinds import delayed_control, switching_drives
from pin_nonideal.description.scene_spec import SceneSpec
from pin_nonideal.errors import InputError, RunError
from pin_nonideal.states.held_entries import NOTHING_HELD, Held
from pin_nonideal.states.joint_layout import joint_places
from pin_nonideal.states.projection import Projection
from pin_nonideal.states.report import ProjectionReport
from pin_nonideal.states.rows import row_slices
from pin_nonideal.types import Array, Model

from .actuation import delayed_torque
from .analysis import check_user_functions, has_rates, without_functions, zero_rows
from .constraints import anchor_frames
from .contact_groups import Descriptions, Groups, grouped_rows, points_by_pair
from .delay import DelayedTorque
from .error_context import Circumstances, named_failure
from .lowering import lower
from .resolver import Resolver, unique_names
from .sampled_control import require_samples

MAX_QUOTED = 4  # names in a message


class CompiledScene:
    """SceneSpec compiled into the core's program.

    Args:
        model: pinocchio.Model.
        q0: configuration at which `frame2=None` and lengths left out are read, (nq,).
        spec: descriptions of the scene.
        is_start: whether q0 was given as a start, so that user functions may be called there.

    Raises:
        InputError, UnknownNameError: a description does not fit the model.
        InconsistentConstraintsError: a vanishing row has a nonzero right-hand side.

    Attributes:
        model: pinocchio.Model.
        q0: see above.
        spec: see above.
        program: the core's program, without the rows that can never act.
        joints: layout of the values of each joint in q and v.
        shapes: names of the two shapes of each pair of shapes, by name of the pair.
        points: names of the contact points of each pair of shapes with several points.
        contact_of: contact of each of these points.
        contacts: contacts of the user, as groups of `point_names`; each stop of a joint is one contact.
        multipliers: rows of `lam`, as groups of the rows of the core.
        elements: friction elements of the user, as groups of elements of the core.
        laws: laws of the user and of contacts with friction, as groups of laws of the core.
        works: columns of powers and works, as groups of columns of the core.
        rows: (first row in `lam`, end, whether it is a contact) of each constraint and contact, by name.
        has_openings: whether some contact is unilateral.
        anchors: (name, frame id, frame id or None for the world) of constraints between two frames.
        dropped: (name, row, reason) of rows that can never act; the rows of a pair of shapes are its points.
        projection: projection onto the constraints.
        unprojected: names of user constraints without residual and rate.
        unchecked: whether derivatives of user functions are still unchecked.
    """

    def __init__(self, model: Model, q0: Array, spec: SceneSpec, is_start: bool = True) -> None:
        self.model, self.q0, self.spec = model, q0, spec
        try:
            builder = core.Builder(model, core.Provider[spec.terms])
        except ValueError as error:
            raise InputError(str(error)) from None
        resolver = Resolver(model, q0)
        described, self._prepare = lower(spec, builder, resolver)
        self.program = builder.finish()
        constraints = len(spec.constraints)  # contacts follow
        self.shapes = {pair.name: pair.shapes for pair in self._pairs}
        self.points = points_by_pair(spec.contacts)
        self.contact_of = ContactOfPoint(self.points)
        self.multipliers = grouped_rows(self.program, self.contact_of)
        self.rows = {
            name: (s.start, s.stop, k >= constraints)
            for k, (name, s) in enumerate(self.multipliers.slices.items())
        }
        self._described = described
        self.joints = joint_places(model)
        self.contacts = Groups(self.point_names, self.contact_of)
        self.elements = Groups(self.program.element_names, self.contact_of)
        self.laws = Groups(self.program.law_names, self.contact_of)
        self.works = Groups(self.program.power_names, self.contact_of)
        self.has_openings = self.program.first_gap < len(self.program.first_rows)
        named = list(zip(self.multipliers.slices, spec.constraints, strict=False))  # contacts follow
        self.anchors = anchor_frames(named, resolver)
        self.unprojected = [
            name
            for name, c in named
            if isinstance(c, UserConstraint) and c.residual is None and c.rate is None
        ]
        self.unchecked = any(has_rates(c) for c in described.values())
        plain, sampled = without_functions(spec, model.nv), self.program
        if plain is not None:
            stand_in = core.Builder(model, core.Provider[spec.terms])
            lower(plain, stand_in, resolver)
            sampled = stand_in.finish()
        try:
            self.dropped, copies = zero_rows(model, q0, self.program, sampled, spec.assembly_tolerance)
        except core.CoreFailure as failure:
            raise self.named(failure) from None
        if self.dropped:
            idle = {(name, row) for name, row, _ in self.dropped}
            for block, c in enumerate(self.program.constraints):
                acting_rows = [row for row in range(c.count) if (c.name, row) not in idle]
                builder.select_rows(block, acting_rows)
            for row, first, factor in copies:
                builder.add_copy(row, first, factor)
            self.program = builder.finish()
        idle_names = {name for name, _, _ in self.dropped}
        self.dropped = [(self.contact(n), row + self._number(n), reason) for n, row, reason in self.dropped]
        self.projection = Projection(
            model, self.program, q0, idle_names, is_start or plain is None, self.contact_of
        )
        control = delayed_control(spec.actuation)
        self._delayed: tuple[SampledControl, Resolver, core.Builder] | None = None
        if control is not None:
            self._delayed, self._building = (control, resolver, builder), threading.Lock()

    @property
    def _pairs(self) -> list[PairOfShapes]:
        """Pairs of shapes."""
        return [c for c in self.spec.contacts if isinstance(c, PairOfShapes)]

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Rows of the core of each constraint and contact point, by name."""
        return row_slices(self.program)

    @cached_property
    def described(self) -> Descriptions:
        """Description of each constraint and contact point, by name; both stops of a joint share one."""
        return Descriptions(self._described, self._pairs, self.contact_of, self.slices)

    @cached_property
    def block_names(self) -> list[str]:
        """Names of all constraints and contacts, by block of the core."""
        return self.program.block_names

    @cached_property
    def element_names(self) -> list[str]:
        """Names of the friction elements of the core."""
        return self.program.element_names

    @property
    def point_names(self) -> list[str]:
        """Names of all contacts of the core, in the order of their descriptions."""
        return [self.block_names[block] for block in self.program.contacts]

    @property
    def opening_names(self) -> list[str]:
        """Names of the unilateral contacts of the core."""
        return self.block_names[self.program.first_gap :]

    def program_of_runs(
        self, t0: float, by_thread: bool = False
    ) -> tuple[core.Program, DelayedTorque | None]:
        """Return the program of a new run, and its delayed torques or None without a delay.

        Drives are prepared for the run. Delayed torques belong to one run, so a scene with a delay needs a
        program per run.

        Args:
            t0: start time of the run [s].
            by_thread: whether the program serves runs in several threads, each run in one thread.

        Raises:
            InputError: a held table beside a sampled control changes between samples, or a drive does not fit
                the constraints.
        """
        require_samples(self.spec.actuation, t0)
        for prepare in self._prepare:
            prepare()
        if self._delayed is None:
            return self.program, None
        control, resolver, builder = self._delayed
        delayed, total = delayed_torque(control, resolver, self.spec, t0, by_thread)
        with self._building:
            builder.set_sampled_torque(total.function, control.period)
            return builder.finish(), delayed

    def check_functions(self, q: Array, v: Array, t: float) -> None:
        """Check the derivatives of user functions once, at the first known start.

        Args:
            q: configuration, (nq,).
            v: velocity, (nv,).
            t: time [s].

        Raises:
            InputError: a derivative differs from the difference quotient.
        """
        if not self.unchecked:
            return
        check_user_functions(self.model, q, v, t, dict(self.described.single()), self.program)
        self.unchecked = False

    def project(
        self, q: Array, v: Array, t: float, held: Held = NOTHING_HELD
    ) -> tuple[Array, Array, ProjectionReport]:
        """Return the nearest state on the constraints, see `Projection.nearest`."""
        try:
            return self.projection.nearest(q, v, t, held)
        except core.CoreFailure as failure:
            raise self.named(failure) from None

    def named(self, failure: core.CoreFailure, method: str = "") -> RunError:
        """Convert a failure of the core to an exception that names the elements involved.

        Args:
            failure: the core's CoreFailure.
            method: method of the run, empty outside of runs.
        """
        return named_failure(failure, self.model, self.program, self._circumstances(method))

    @property
    def explicit_only(self) -> str:
        """Message on a part of the scene that no implicit method supports, or empty."""
        if self.has_openings:
            name = self.contact(self.opening_names[0])
            return f'no implicit method supports contacts that open, such as "{name}"'
        if switching := switching_drives(self.spec.actuation):
            return f"no implicit method supports the held torques of a {type(switching[0]).__name__}"
        return ""

    def contact(self, name: str) -> str:
        """Return the name of the contact of a contact point; other names stay.

        Args:
            name: name of a point, contact, constraint or law.
        """
        return self.contact_of.get(name, name)

    def _number(self, name: str) -> int:
        """Return the number of a point among the points of its contact."""
        return self.points[self.contact_of[name]].index(name) if name in self.contact_of else 0

    def _circumstances(self, method: str) -> Circumstances:
        """Return the names of the parts of the scene that error messages of its runs need."""
        spec = self.spec
        sources = ("the actuation", _quote("force", spec.forces), _quote("law", spec.laws))
        used_names = UsedNames()
        constraint_names = unique_names(spec.constraints, used_names)
        described = zip(constraint_names, spec.constraints, strict=True)
        moving = [name for name, c in described if isinstance(c, PrescribedMotion)]
        names = unique_names(spec.contacts, used_names)
        pairs = {
            name: _frames_of(c) for name, c in zip(names, spec.contacts, strict=True) if any(_frames_of(c))
        }
        return Circumstances(self.explicit_only, sources, pairs, self.contact_of, moving, method)


def _frames_of(contact: object) -> tuple[str, str]:
    """Return the frames of a contact, empty for the world or if it has none."""
    contact = contact_parts([contact])[0]
    contact = contact.like if isinstance(contact, ContactGroup) else contact
    first = getattr(contact, "frame", None) or getattr(contact, "frame1", None)
    second = getattr(contact, "plane", None) or getattr(contact, "frame2", None)
    return (str(first or ""), str(second or ""))


def _quote(kind: str, descriptions: Sequence[object]) -> str:
    """Return the names of descriptions of a kind, at most the first few."""
    names = unique_names(descriptions, UsedNames())
    shown = ", ".join(f'"{name}"' for name in names[:MAX_QUOTED])
    shown += ", ..." if len(names) > MAX_QUOTED else ""
    return f"{kind} {shown}" if len(names) == 1 else f"one of the {kind}s {shown}"
