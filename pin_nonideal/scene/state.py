"""States of a scene: the initial state, given states, and the nearest states on the constraints."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.errors import InputError
from pin_nonideal.states.held_entries import Held, change_note, changes, held_notes
from pin_nonideal.states.joint_layout import require_resolved, unit_parts
from pin_nonideal.states.parsing import named_configuration, named_coordinates, named_entries, named_velocity
from pin_nonideal.states.report import ProjectionReport
from pin_nonideal.types import Array, Model, State
from pin_nonideal.validation import number


def _same_bytes(a: Array, b: Array) -> bool:
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


class InitialState:
    """Initial state of a scene as its user gave it, before loops are closed.

    Args:
        model: of the scene.
        q0: configuration, (nq,) or by joint name; neutral when None.
        v0: velocity, (nv,) or by joint name; zero when None.

    Attributes:
        q: configuration, (nq,), read-only.
        v: velocity, (nv,), read-only.
        held: entries that were named.
        is_given: whether a configuration was given.
        unit_parts: joints whose coordinates have unit length, with their slices of q.

    Raises:
        InputError, UnknownNameError: a state does not fit the model.
    """

    def __init__(self, model: Model, q0: State | None, v0: State | None) -> None:
        self.unit_parts = tuple(unit_parts(model))
        self.q: Array = pin.neutral(model)
        self.v: Array = np.zeros(model.nv)
        if q0 is not None:
            self.q = named_configuration(model, q0, self.q, "q0", self.unit_parts)
        if v0 is not None:
            self.v = named_velocity(model, v0, self.v, "v0")
        self.held = Held(named_coordinates(model, q0), named_entries(model, v0))
        self.is_given = q0 is not None
        for state in (self.q, self.v):
            state.setflags(write=False)


class SceneStates:
    """Configurations and velocities of a scene.

    Args:
        compiled: the compiled scene.
        initial: its initial state.
        name: name of the scene in messages.

    Attributes:
        held: entries of the initial state that were named.
    """

    def __init__(self, compiled: CompiledScene, initial: InitialState, name: str) -> None:
        self.held = initial.held
        self._compiled, self._name = compiled, name
        self._model: Model = compiled.model
        self._initial = initial
        self._closed: tuple[Array, Array, ProjectionReport] | None = None
        self._start_notes: list[str] | None = None

    def require_unchanged(self) -> None:
        """Check that the model has the numbers with which the scene was compiled.

        Raises:
            InputError: the model has changed since.
        """
        if not self._compiled.program.is_of(self._model):
            raise InputError(
                f'the model of scene "{self._name}" was changed after the scene was made, which has its own '
                "numbers; make a new Scene of the changed model"
            )

    def configuration(self, q: State, what: str) -> Array:
        """Configuration as an array, (nq,); joints that a table does not name are as in the initial state.

        Args:
            q: (nq,) or by joint name.
            what: its name in messages.

        Raises:
            InputError, UnknownNameError: it does not fit the model.
        """
        self.require_unchanged()
        return named_configuration(self._model, q, self._initial.q, what, self._initial.unit_parts)

    def velocity(self, v: State, what: str) -> Array:
        """Velocity as an array, (nv,); joints that a table does not name are as in the initial state.

        Args:
            v: (nv,) or by joint name.
            what: its name in messages.

        Raises:
            InputError, UnknownNameError: it does not fit the model.
        """
        return named_velocity(self._model, v, self._initial.v, what)

    def with_unit_parts(self, q: Array) -> Array:
        """Configurations whose quaternions and cyclic coordinates have unit length, (n, nq).

        Args:
            q: configurations, (n, nq).

        Raises:
            InputError: a length is far from 1.
        """
        if not self._initial.unit_parts:
            return q
        return np.array([self.configuration(one, "q") for one in q]).reshape(q.shape)

    def check_functions_at(self, q: State, v: State, t: float) -> None:
        """Compare derivatives of user functions, if no earlier state is known.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            t: time [s].

        Raises:
            InputError: a derivative does not fit its function.
        """
        if self._compiled.unchecked:
            self._compiled.check_functions(self.configuration(q, "q"), self.velocity(v, "v"), number("t", t))

    def closed_initial(self) -> tuple[Array, Array, ProjectionReport]:
        """Initial state on the constraints, computed once, with the report of its projection.

        Raises:
            LoopClosureError: the loops cannot be closed.
            InputError: a coordinate is too large to move.
        """
        self.require_unchanged()
        if self._closed is None:
            self._closed = self._projected(self._initial.q, self._initial.v, 0.0, self.held)
        q, v, moved = self._closed
        return q.copy(), v.copy(), moved

    def project(self, q: State | None, v: State | None, t: float) -> tuple[Array, Array, ProjectionReport]:
        """Nearest state on the constraints, see `Scene.project`."""
        if q is None and v is None and t == 0.0:
            return self.closed_initial()
        q_in = self._initial.q if q is None else self.configuration(q, "q")
        v_in = self._initial.v if v is None else self.velocity(v, "v")
        return self._projected(q_in, v_in, t, self._named(q, v, t))

    def _named(self, q: State | None, v: State | None, t: float = 0.0) -> Held:
        """Return the entries that a given state names, else the named entries of the initial state."""
        return Held(
            self.held.q if q is None else named_coordinates(self._model, q),
            self.held.v if v is None else named_entries(self._model, v),
            firm_q=q is not None or t == 0.0,
            firm_v=v is not None or (q is None and t == 0.0),
        )

    def _projected(self, q: Array, v: Array, t: float, held: Held) -> tuple[Array, Array, ProjectionReport]:
        require_resolved(self._model, q)
        self._compiled.check_functions(q, v, t)
        return self._compiled.project(q, v, t, held)

    def velocity_notes(self, v: State | None, on: Array) -> list[str]:
        """Return notes on velocities that the named velocities determine, or that the projection has changed.

        Args:
            v: velocity before the projection, as given.
            on: velocity after it, (nv,).
        """
        held = self._named(None, v).v
        before = self._initial.v if v is None else self.velocity(v, "v")
        if held is None or changes(before, on, held):
            return change_note(self._model, before, on)
        return held_notes(self._model, before, on, held)

    def configuration_notes(self, q: State | None, on: Array) -> list[str]:
        """Note on a configuration that was moved onto the constraints, see `Projection.notes`.

        Args:
            q: configuration before the projection, as given.
            on: configuration after it, (nq,).
        """
        if isinstance(q, np.ndarray) and (_same_bytes(q, on) or np.array_equal(q, on)):
            return []
        before = self._initial.q if q is None else self.configuration(q, "q")
        return self._compiled.projection.notes(before, on, self._named(q, None).q)

    def start_notes(self) -> list[str]:
        """Notes on the initial state of the scene, once its loops are closed."""
        if self._start_notes is None:
            q, v, _ = self.closed_initial()
            self._start_notes = self.configuration_notes(None, q) + self.velocity_notes(None, v)
        return self._start_notes
