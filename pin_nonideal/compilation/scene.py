"""A scene as the core knows it: the finished program, and what its numbers are called."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.constraints import UserConstraint
from pin_nonideal.core import core
from pin_nonideal.errors import InputError, RunError
from pin_nonideal.states.configurations import joint_places
from pin_nonideal.states.projection import Projection, ProjectionReport
from pin_nonideal.states.rows import row_slices
from pin_nonideal.types import Array, Model

from .analysis import check_user_functions, idle_rows
from .constraints import anchor_frames
from .failures import named_failure
from .lowering import Descriptions, lower
from .names import Resolution


class CompiledScene:
    """Descriptions compiled into the core's program.

    Args:
        model: pinocchio.Model.
        q0: configuration at which `frame2=None` and lengths left out are read, (nq,).
        v0: velocity near which derivatives of the user's constraints are compared, (nv,).
        said: what the scene is made of.
        tolerance: gap that a row along which nothing moves may have [m or rad].

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
    """

    def __init__(self, model: Model, q0: Array, v0: Array, said: Descriptions, tolerance: float) -> None:
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
        check_user_functions(model, q0, v0, described, self.program)
        self.dropped, copies = idle_rows(model, q0, self.program, tolerance)
        if self.dropped:
            idle = {(name, row) for name, row, _ in self.dropped}
            for block, c in enumerate(self.program.constraints):
                kept = [row for row in range(c.count) if (c.name, row) not in idle]
                builder.keep_rows(block, kept)
            for row, first, factor in copies:
                builder.add_copy(row, first, factor)
            self.program = builder.finish()
        self.projection = Projection(model, self.program, q0, {name for name, _, _ in self.dropped})

    def project(
        self, q: Array, v: Array, t: float, held: NDArray[np.bool_] | None = None
    ) -> tuple[Array, Array, ProjectionReport]:
        """Nearest state on the constraints, see `Projection.nearest`."""
        try:
            return self.projection.nearest(q, v, t, held)
        except core.CoreFailure as failure:
            raise self.named(failure) from None

    def named(self, failure: core.CoreFailure) -> RunError:
        """The core's failure as the exception that names what is to blame."""
        return named_failure(failure, self.model, self.program)
