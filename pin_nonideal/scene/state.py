"""States of a scene: initial state, parsing of user states, and projection onto the constraints."""

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
        """Initial configuration, (nq,), read-only; closure of loops starts from it."""
        return self._q0

    @property
    def v0(self) -> Array:
        """Initial velocity, (nv,), read-only."""
        return self._v0

    def _configuration(self, q: State, what: str) -> Array:
        self._require_unchanged()
        return named_configuration(self.model, q, self._q0, what, self._unit_parts)

    def _require_unchanged(self) -> None:
        """Check that the model is the one that the core copied at compilation.

        Raises:
            InputError: the model has changed since.
        """
        if not self._compiled.program.is_of(self.model):
            raise InputError(
                f'the model of scene "{self.name}" was changed after the scene was made, which has its own '
                "numbers; make a new Scene of the changed model"
            )

    def _checked_at(self, q: State, v: State, t: float) -> None:
        """Check the derivatives of user functions at this state if they are still unchecked."""
        if self._compiled.unchecked:
            start = self._configuration(q, "q"), self._velocity(v, "v")
            self._compiled.check_functions(*start, number("t", t))

    def _velocity(self, v: State, what: str) -> Array:
        return named_velocity(self.model, v, self._v0, what)

    def initial_state(self) -> tuple[Array, Array]:
        """Return the scene's initial state with closed loops.

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
        """Project a state: phi(q, t) = 0, A v + phi_t = 0, and no penetration of contacts.

        The projected configuration minimizes d^T M(q) d for the displacement d from q in tangent coordinates.
        M(q) is the mass matrix at q. The projected velocity minimizes d^T M d for its change d. Units, row
        scales and duplicate constraints do not affect the result. If the displacement is long, the nearest
        closure from several starts is selected. `ProjectionReport.nearest` states if the search confirms it
        as nearest. Closures in gimbal lock (nearly singular M) are selected only if no other closure is
        found.

        Args:
            q: configuration, (nq,) or by joint name; the scene's initial configuration when None.
            v: velocity, (nv,) or by joint name; the scene's initial velocity when None. Named entries of q
                and v are held, and the others follow. If the constraints do not admit the named entries of q,
                these are treated as rounded: they may move by 1e-3 rad, or by 1e-3 of the mechanism's length.
            t: time [s].
            report: whether to return a `ProjectionReport` as well, with the displacements of q and v.

        Returns:
            q (nq,), v (nv,), and with `report` the report.

        Raises:
            LoopClosureError: no closure is found from this state; `gaps` names each gap.
            InputError: wrong shapes or numbers, or named entries that the constraints do not admit together.
                Further causes are a contact with deep initial penetration or without a short displacement out
                of it, and a coordinate at which floating-point numbers are more than 1 mm or 1 mrad apart.
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
        """Return the held entries, which the given state names, or else the scene's initial state."""
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
        """Return notes on velocities that follow named entries, or that the projection changed."""
        held = self._named(None, v).v
        asked = self.v0 if v is None else self._velocity(v, "v")
        if held is None or changes(asked, on, held):
            return changed(self.model, asked, on)
        return told(self.model, asked, on, held)

    def _moved(self, q: State | None, on: Array) -> list[str]:
        """Return notes on a configuration that the projection moved, see `Projection.notes`."""
        if isinstance(q, np.ndarray) and (_same_bytes(q, on) or np.array_equal(q, on)):
            return []
        asked = self.q0 if q is None else self._configuration(q, "q")
        return self._compiled.projection.notes(asked, on, self._named(q, None).q)

    def _start_notes(self) -> list[str]:
        """Return notes on the projection of the scene's initial state; cached."""
        if self._told is None:
            q, v = self.initial_state()
            self._told = self._moved(None, q) + self._followed(None, v)
        return self._told
