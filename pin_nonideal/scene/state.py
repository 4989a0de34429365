"""States of a scene: its initial one, those that users give, and the nearest that meet the constraints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, overload

import numpy as np

from pin_nonideal.errors import InputError
from pin_nonideal.states.held import Held, changed, changes, told
from pin_nonideal.states.joint_layout import require_resolved
from pin_nonideal.states.parsing import named_configuration, named_coordinates, named_entries, named_velocity
from pin_nonideal.states.report import ProjectionReport
from pin_nonideal.types import Array, Model, State
from pin_nonideal.validation import choice, number

if TYPE_CHECKING:
    from pin_nonideal.compilation.compiled_scene import CompiledScene


def _same_bytes(a: Array, b: Array) -> bool:
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


class States:
    """Configurations and velocities of a Scene."""

    if TYPE_CHECKING:
        name: str
        model: Model
        _unit_parts: tuple[tuple[str, slice], ...]
        _q0: Array
        _v0: Array
        _held: Held
        _compiled: CompiledScene
        _closed: tuple[Array, Array, ProjectionReport] | None
        _told: list[str] | None

    @property
    def q0(self) -> Array:
        """Initial configuration, (nq,), read-only: loops are closed and frames are held from it."""
        return self._q0

    @property
    def v0(self) -> Array:
        """Initial velocity, (nv,), read-only."""
        return self._v0

    def _configuration(self, q: State, what: str) -> Array:
        self._require_unchanged()
        return named_configuration(self.model, q, self._q0, what, self._unit_parts)

    def _require_unchanged(self) -> None:
        """The core has taken the model's numbers when the scene was made.

        Raises:
            InputError: the model is no longer what it was.
        """
        if not self._compiled.program.is_of(self.model):
            raise InputError(
                f'the model of scene "{self.name}" was changed after the scene was made, which has its own '
                "numbers; make a new Scene of the changed model"
            )

    def _checked_at(self, q: State, v: State, t: float) -> None:
        """Compares derivatives of the user's functions where none were known before."""
        if self._compiled.unchecked:
            start = self._configuration(q, "q"), self._velocity(v, "v")
            self._compiled.check_functions(*start, number("t", t))

    def _velocity(self, v: State, what: str) -> Array:
        return named_velocity(self.model, v, self._v0, what)

    def initial_state(self) -> tuple[Array, Array]:
        """The scene's initial state with its loops closed.

        Returns:
            q (nq,), v (nv,).

        Raises:
            LoopClosureError: the loops cannot be closed.
            InputError: a coordinate is too large to move.
        """
        self._require_unchanged()
        q, v, _ = self._initial()
        return q, v

    def _initial(self) -> tuple[Array, Array, ProjectionReport]:
        if self._closed is None:
            self._closed = self._project(self.q0, self.v0, 0.0, self._held)
        q, v, moved = self._closed
        return q.copy(), v.copy(), moved

    @overload
    def project(
        self,
        q: State | None = None,
        v: State | None = None,
        t: float = 0.0,
        *,
        report: Literal[False] = False,
    ) -> tuple[Array, Array]: ...
    @overload
    def project(
        self, q: State | None = None, v: State | None = None, t: float = 0.0, *, report: Literal[True]
    ) -> tuple[Array, Array, ProjectionReport]: ...
    def project(
        self, q: State | None = None, v: State | None = None, t: float = 0.0, *, report: bool = False
    ) -> tuple[Array, Array] | tuple[Array, Array, ProjectionReport]:
        """Nearest consistent state: phi(q, t) = 0, A v + phi_t = 0, and no contact inside its plane.

        Of all configurations that satisfy the constraints it is that with the least d^T M(q) d, where d is
        the move from q in tangent coordinates and M(q) the mass matrix there; of all velocities, that with
        the least d^T M d.  Units, scales of rows and copies of constraints change nothing.  Where the move is
        long the nearest of the closures found from several starts is taken; the report tells whether it is
        known to be the nearest.  Closures in gimbal lock (M nearly singular) are taken only where no other is
        found.

        Args:
            q: configuration, (nq,) or by joint name; the scene's initial one when None.
            v: velocity, (nv,) or by joint name; the scene's initial one when None.  Entries of q and v that
                are named are held, and the others follow; where the constraints leave no such configuration
                but one within a thousandth of a radian or of the mechanism's length, named entries are taken
                for rounded numbers, and move there.
            t: time [s].
            report: also returns how far q and v moved, a `ProjectionReport`.

        Returns:
            q (nq,), v (nv,), and with `report` the report.

        Raises:
            LoopClosureError: the constraints cannot be met from here; `gaps` names each gap.
            InputError: wrong shapes or numbers, named entries that the constraints do not allow together,
                a contact that starts deep inside its plane or has no short way out of it, or a coordinate
                where floating-point numbers are more than a millimeter or milliradian apart.
        """
        time, wanted = number("t", t), choice("report", report, (True, False))
        if q is None and v is None and time == 0.0:
            found = self._initial()
        else:
            q_in = self.q0 if q is None else self._configuration(q, "q")
            v_in = self.v0 if v is None else self._velocity(v, "v")
            found = self._project(q_in, v_in, time, self._named(q, v, time))
        return found if wanted else found[:2]

    def _named(self, q: State | None, v: State | None, t: float = 0.0) -> Held:
        """Entries that are named by a state, or by the scene's own, which are those of its own start."""
        return Held(
            self._held.q if q is None else named_coordinates(self.model, q),
            self._held.v if v is None else named_entries(self.model, v),
            firm_q=q is not None or t == 0.0,
            firm_v=v is not None or (q is None and t == 0.0),
        )

    def _project(self, q: Array, v: Array, t: float, held: Held) -> tuple[Array, Array, ProjectionReport]:
        require_resolved(self.model, q)
        self._compiled.check_functions(q, v, t)
        return self._compiled.project(q, v, t, held)

    def _followed(self, v: State | None, on: Array) -> list[str]:
        """A note on velocities that follow named ones, or that were changed to meet the constraints."""
        held = self._named(None, v).v
        asked = self.v0 if v is None else self._velocity(v, "v")
        if held is None or changes(asked, on, held):
            return changed(self.model, asked, on)
        return told(self.model, asked, on, held)

    def _moved(self, q: State | None, on: Array) -> list[str]:
        """What to tell of a configuration that was moved onto the constraints, see `Projection.notes`."""
        if isinstance(q, np.ndarray) and (_same_bytes(q, on) or np.array_equal(q, on)):
            return []
        asked = self.q0 if q is None else self._configuration(q, "q")
        return self._compiled.projection.notes(asked, on, self._named(q, None).q)

    def _start_notes(self) -> list[str]:
        """What to tell of the scene's own initial state, once it is closed."""
        if self._told is None:
            q, v = self.initial_state()
            self._told = self._moved(None, q) + self._followed(None, v)
        return self._told
