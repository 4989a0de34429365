"""A scene as the core knows it: the finished program, and what its numbers are called."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pin_nonideal.core_loader import core
from pin_nonideal.description.actuation import SampledControl, asked_by
from pin_nonideal.description.constraints import UserConstraint
from pin_nonideal.errors import InputError, RunError
from pin_nonideal.states.held import NOTHING_HELD, Held
from pin_nonideal.states.joint_layout import joint_places
from pin_nonideal.states.projection import Projection
from pin_nonideal.states.report import ProjectionReport
from pin_nonideal.states.rows import row_slices
from pin_nonideal.types import Array, Model

from .analysis import check_user_functions, has_rates, idle_rows, without_functions
from .constraints import anchor_frames
from .error_context import Circumstances, named_failure
from .lowering import Descriptions, lower
from .resolver import Resolution, unique_names

MOST_QUOTED = 4  # names in a message


class CompiledScene:
    """Descriptions compiled into the core's program.

    Args:
        model: pinocchio.Model.
        q0: configuration at which `frame2=None` and lengths left out are read, (nq,).
        said: what the scene is made of.
        tolerance: gap that a row along which nothing moves may have [m or rad].
        is_start: whether q0 was given as a start, so that functions of the user may be called there.

    Raises:
        InputError, UnknownNameError: something does not fit the model.
        InconsistentConstraintsError: rows that vanish ask for an acceleration.

    Attributes:
        model: pinocchio.Model.
        q0: see above.
        said: see above.
        program: the core's, without the rows that can never act.
        slices: rows of `lam` of each constraint and contact, by name.
        rows: the same as (first, end, whether it is a contact).
        described: what each of them is made of, by the same name; both stops of a joint are one description.
        joints: where the values of each joint stand.
        contact_names: names of the contacts in the order of their descriptions, stops of joints one by one.
        opening_names: names of those that may open.
        anchors: (name, frame id, frame id or None for the world) of what joins two frames.
        dropped: (name, row, reason) of rows that can never act.
        projection: onto the constraints.
        unprojected: names of user constraints without residual and rate.
        unchecked: whether derivatives of functions of the user are still to be compared.
    """

    def __init__(
        self, model: Model, q0: Array, said: Descriptions, tolerance: float, is_start: bool = True
    ) -> None:
        self.model, self.q0, self.said = model, q0, said
        try:
            builder = core.Builder(model, core.Provider[said.terms])
        except ValueError as error:
            raise InputError(str(error)) from None
        where = Resolution(model, q0)
        described = lower(said, builder, where)
        self.program = builder.finish()
        self.slices = row_slices(self.program)
        constraints = len(said.constraints)  # contacts follow
        self.rows = {
            name: (s.start, s.stop, k >= constraints) for k, (name, s) in enumerate(self.slices.items())
        }
        self.described = {
            name: described[name if name in described else name.rpartition(" ")[0]] for name in self.slices
        }
        self.joints = joint_places(model)
        self.contact_names = [self.program.constraints[block].name for block in self.program.contacts]
        self.opening_names = [c.name for c in self.program.constraints[self.program.first_gap :]]
        named = list(zip(self.slices, said.constraints, strict=False))  # contacts follow
        self.anchors = anchor_frames(named, where)
        self.unprojected = [
            name
            for name, c in named
            if isinstance(c, UserConstraint) and c.residual is None and c.rate is None
        ]
        self.unchecked = any(has_rates(c) for c in described.values())
        plain, sampled = without_functions(said, model.nv), self.program
        if plain is not None:
            stand_in = core.Builder(model, core.Provider[said.terms])
            lower(plain, stand_in, where)
            sampled = stand_in.finish()
        self.dropped, copies = idle_rows(model, q0, self.program, sampled, tolerance)
        if self.dropped:
            idle = {(name, row) for name, row, _ in self.dropped}
            for block, c in enumerate(self.program.constraints):
                kept = [row for row in range(c.count) if (c.name, row) not in idle]
                builder.keep_rows(block, kept)
            for row, first, factor in copies:
                builder.add_copy(row, first, factor)
            self.program = builder.finish()
        idle_names = {name for name, _, _ in self.dropped}
        self.projection = Projection(model, self.program, q0, idle_names, is_start or plain is None)

    def check_functions(self, q: Array, v: Array, t: float) -> None:
        """Compares derivatives of the user's functions, at the first start that is known.

        Args:
            q: configuration, (nq,).
            v: velocity, (nv,).
            t: time [s].

        Raises:
            InputError: they differ.
        """
        if not self.unchecked:
            return
        check_user_functions(self.model, q, v, t, self.described, self.program)
        self.unchecked = False

    def project(
        self, q: Array, v: Array, t: float, held: Held = NOTHING_HELD
    ) -> tuple[Array, Array, ProjectionReport]:
        """Nearest state on the constraints, see `Projection.nearest`."""
        try:
            return self.projection.nearest(q, v, t, held)
        except core.CoreFailure as failure:
            raise self.named(failure) from None

    def named(self, failure: core.CoreFailure) -> RunError:
        """The core's failure as the exception that names what is to blame."""
        return named_failure(failure, self.model, self.program, self._circumstances())

    @property
    def explicit_only(self) -> str:
        """Words on a part of the scene that no implicit method here takes, or empty."""
        if self.opening_names:
            return f'no implicit method here opens and closes contacts such as "{self.opening_names[0]}" yet'
        if isinstance(asked_by(self.said.actuation), SampledControl):
            return "no implicit method here holds the torques of a SampledControl yet"
        return ""

    def _circumstances(self) -> Circumstances:
        """Parts of the scene to be named in errors of its runs."""
        said = self.said
        sources = ("the actuation", _quoted("force", said.forces), _quoted("law", said.laws))
        return Circumstances(self.explicit_only, sources)


def _quoted(kind: str, descriptions: Sequence[Any]) -> str:
    """The names of all descriptions of a kind, of many the first few."""
    names = unique_names(descriptions, set())
    shown = ", ".join(f'"{name}"' for name in names[:MOST_QUOTED])
    shown += ", ..." if len(names) > MOST_QUOTED else ""
    return f"{kind} {shown}" if len(names) == 1 else f"one of the {kind}s {shown}"
