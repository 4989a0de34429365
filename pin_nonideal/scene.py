"""Scene: a model with what holds it, rubs it and drives it, analysed once into the core's program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .actuation import Actuation
from .checks import array, choice, nonnegative, number, optional_text, sequence
from .compilation.analysis import check_model
from .compilation.lowering import Descriptions
from .compilation.report import report
from .compilation.scene import CompiledScene
from .contacts import Contact
from .core import core
from .equation import Solution
from .errors import InputError
from .forces import Force
from .laws import Law
from .states.closure import CLOSURE_TOLERANCE
from .states.configurations import configuration, require_resolved, unit_parts
from .types import Array, GeometryModel, Model, Table

Rest = ParamSpec("Rest")
Result = TypeVar("Result")

# What to do where laws and dynamics allow several motions.
SEVERAL = ("error", "continue")
TERMS = tuple(provider.name for provider in core.Provider)


class Scene:
    """A Pinocchio model with constraints, laws, contacts, forces and actuation.

    Everything is checked when the scene is made; rows that can never act are found then and left out.

    Args:
        model: pinocchio.Model.
        constraints: descriptions of `pin_nonideal.constraints`, or Pinocchio's RigidConstraintModel,
            PointAnchorConstraintModel and FrameAnchorConstraintModel.
        laws: descriptions of `pin_nonideal.laws`.
        contacts: descriptions of `pin_nonideal.contacts`.
        forces: descriptions of `pin_nonideal.forces`.
        actuation: None, a constant torque (nv,), a function (t, q, v) -> tau, or a description of
            `pin_nonideal.actuation`.
        q0: initial configuration, (nq,); the neutral one when None.  Frames held to the world are held where
            they are here.
        v0: initial velocity, (nv,); zero when None.
        visual_model: pinocchio.GeometryModel for the replay, or a function that makes it when asked for.
        collision_model: pinocchio.GeometryModel, or such a function.
        name: shown in messages and pages; the model's own when None.
        notes: remarks of the loader, shown by `report`.
        source: where the robot comes from.
        licence: its licence.
        terms: who computes M(q), the bias forces and the kinematics: "core", its own pass over the tree, or
            "pinocchio", Pinocchio's crba, nonLinearEffects and computeJointJacobians.
        assembly_tolerance: to which the frames of loops are given [m or rad]: a gap up to it, in a direction
            in which no joint moves, is no error.

    Raises:
        InputError, UnknownNameError: something does not fit the model.
        InconsistentConstraintsError: rows that vanish ask for an acceleration.

    Attributes:
        constraint_slices: rows of `lam` of each constraint and contact, by name.
        anchor_frames: (name, frame id, frame id or None) of what joins two frames.
        element_names: names of the frictional elements, in the order of `modes`.
        law_names: names of the laws, in the order of the ledger's columns.
        dropped: (name, row, reason) of rows that can never act.
        contact_friction: coefficients of sliding, spinning and rolling that the robot's file gives its
            collision geometry, by name.
    """

    def __init__(
        self,
        model: Model,
        *,
        constraints: Sequence[Any] = (),
        laws: Sequence[Law] = (),
        contacts: Sequence[Contact] = (),
        forces: Sequence[Force] = (),
        actuation: Actuation | None = None,
        q0: ArrayLike | None = None,
        v0: ArrayLike | None = None,
        visual_model: GeometryModel | Callable[[], GeometryModel] | None = None,
        collision_model: GeometryModel | Callable[[], GeometryModel] | None = None,
        name: str | None = None,
        notes: Sequence[str] = (),
        source: str | None = None,
        licence: str | None = None,
        terms: str = "core",
        assembly_tolerance: float = CLOSURE_TOLERANCE,
    ) -> None:
        if not isinstance(model, pin.Model):
            raise InputError(f"Scene: model must be a pinocchio.Model; got {type(model).__name__}")
        for what, geometry in (("visual_model", visual_model), ("collision_model", collision_model)):
            if not (geometry is None or callable(geometry) or isinstance(geometry, pin.GeometryModel)):
                raise InputError(
                    f"Scene: {what} must be a pinocchio.GeometryModel; got {type(geometry).__name__}"
                )
        self.model = model
        self.name = optional_text("Scene: name", name) or model.name or "scene"
        self.constraints, self.laws = sequence("constraints", constraints), sequence("laws", laws)
        self.contacts, self.forces = sequence("contacts", contacts), sequence("forces", forces)
        self.actuation, self.terms = actuation, choice("Scene: terms", terms, TERMS)
        self._visual, self._collision = visual_model, collision_model
        self.contact_friction: dict[str, tuple[float, float, float]] = {}
        self.notes = list(sequence("notes", notes))
        self.source, self.licence = (
            optional_text(f"Scene: {what}", value)
            for what, value in (("source", source), ("licence", licence))
        )
        check_model(model)
        self._as_made = model.copy()
        self._unit_parts = tuple(unit_parts(model))
        self._q0: Array = pin.neutral(model) if q0 is None else self._configuration(q0, "q0")
        self._v0 = np.zeros(model.nv) if v0 is None else self._velocity(v0, "v0")
        for state in (self._q0, self._v0):
            state.setflags(write=False)
        said = Descriptions(self.constraints, self.contacts, self.laws, self.forces, actuation, terms)
        tolerance = nonnegative("Scene: assembly_tolerance", assembly_tolerance)
        self._compiled = CompiledScene(model, self.q0, self.v0, said, tolerance)
        self.constraint_slices, self.anchor_frames = self._compiled.slices, self._compiled.anchors
        self.element_names = self._compiled.program.element_names
        self.law_names = self._compiled.program.law_names
        self.dropped = self._compiled.dropped
        if self._compiled.unprojected:
            names = ", ".join(f'"{n}"' for n in self._compiled.unprojected)
            self.notes.append(
                f"{names}: no residual and no rate, so drift of these rows cannot be projected away"
            )
        self._runner = self._compiled.program.runner()
        self._nv = int(model.nv)
        self._closed: tuple[Array, Array] | None = None
        self._origin: Table | None = None  # what `load` made the scene from

    def __repr__(self) -> str:
        return (
            f'<Scene "{self.name}": nv {self.model.nv}, {len(self.constraints)} constraints, '
            f"{len(self.laws)} laws, {len(self.contacts)} contacts>"
        )

    @property
    def q0(self) -> Array:
        """Initial configuration, (nq,), read-only: loops are closed and frames are held from it."""
        return self._q0

    @property
    def v0(self) -> Array:
        """Initial velocity, (nv,), read-only."""
        return self._v0

    @property
    def visual_model(self) -> GeometryModel | None:
        """pinocchio.GeometryModel for the replay, or None; meshes of a file are read when first asked for."""
        self._visual = self._read(self._visual)
        return self._visual

    @property
    def collision_model(self) -> GeometryModel | None:
        """pinocchio.GeometryModel for collisions, or None; meshes are read when first asked for."""
        self._collision = self._read(self._collision)
        return self._collision

    def _read(self, shapes: GeometryModel | Callable[[], GeometryModel] | None) -> GeometryModel | None:
        """The geometry itself, made now where only the means to make it were given."""
        if not callable(shapes):
            return shapes
        geometry = shapes()
        if not isinstance(geometry, pin.GeometryModel):
            raise InputError(
                "Scene: what makes a geometry must return a pinocchio.GeometryModel; "
                f"got {type(geometry).__name__}"
            )
        self.notes += [note for note in getattr(shapes, "notes", ()) if note not in self.notes]
        return geometry

    # --- states ---------------------------------------------------------------------------------------------

    def _configuration(self, q: ArrayLike, what: str) -> Array:
        self._require_unchanged()
        return configuration(self.model, q, what, self._unit_parts)

    def _require_unchanged(self) -> None:
        """The core has taken the model's numbers when the scene was made.

        Raises:
            InputError: the model is no longer what it was.
        """
        if self.model != self._as_made:
            raise InputError(
                f'the model of scene "{self.name}" was changed after the scene was made, which has its own '
                "numbers; make a new Scene of the changed model"
            )

    def _velocity(self, v: ArrayLike, what: str) -> Array:
        return np.array(array(what, v, (self.model.nv,)))

    def initial_state(self) -> tuple[Array, Array]:
        """The scene's initial state with its loops closed.

        Returns:
            q (nq,), v (nv,).

        Raises:
            LoopClosureError: the loops cannot be closed.
            InputError: a coordinate is too large to move.
        """
        self._require_unchanged()
        if self._closed is None:
            self._closed = self._project(self.q0, self.v0, 0.0)
        return self._closed[0].copy(), self._closed[1].copy()

    def project(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None, t: float = 0.0
    ) -> tuple[Array, Array]:
        """Nearest consistent state: phi(q, t) = 0 and A v + phi_t = 0.

        Near the constraints this is Newton's method in the metric of M; from far away damped steps lead
        there, from several starts when needed.

        Args:
            q: configuration, (nq,); the scene's initial one when None.
            v: velocity, (nv,); the scene's initial one when None.
            t: time [s].

        Returns:
            q (nq,), v (nv,).

        Raises:
            LoopClosureError: the constraints cannot be met from here; `gaps` names each gap.
            InputError: wrong shapes or numbers, or a coordinate where floating-point numbers are more than
                a millimeter or milliradian apart.
        """
        time = number("t", t)
        if q is None and v is None and time == 0.0:
            return self.initial_state()
        q_in = self.q0 if q is None else self._configuration(q, "q")
        v_in = self.v0 if v is None else self._velocity(v, "v")
        return self._project(q_in, v_in, time)

    def _project(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        require_resolved(self.model, q)
        return self._compiled.project(q, v, t)

    def _project_all(self, q: Array, v: Array, t: float, threads: int) -> tuple[Array, Array]:
        """What `project` gives for each of many states, (n, nq) and (n, nv), on several threads."""
        if self._unit_parts:
            q = np.array([self._configuration(one, "q") for one in q]).reshape(q.shape)
        require_resolved(self.model, q)
        return self._compiled.project_all(q, v, t, threads)

    # --- one instant ----------------------------------------------------------------------------------------

    def solve(
        self,
        q: ArrayLike,
        v: ArrayLike,
        t: float = 0.0,
        *,
        tau: ArrayLike | None = None,
        modes: Sequence[int] | None = None,
        several: str = "error",
    ) -> Solution:
        """Eq. (40) at one state: acceleration, both parts of the force of constraint, multipliers, modes.

        Args:
            q: configuration, (nq,).
            v: velocity, (nv,).
            t: time [s].
            tau: joint torques instead of the scene's actuation, (nv,).
            modes: mode of each frictional element, +1, -1 or 0; by velocity and complementarity when None.
            several: what to do where the laws allow several motions: "error", or "continue" with the one of
                least friction.  What may stick or slip at rest sticks either way.

        Returns:
            The Solution; `lam` holds all rows in the order of `constraint_slices`, zero for dropped ones.

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        self._runner.continues = choice("solve: several", several, SEVERAL) == "continue"
        given = None
        if modes is not None:
            asked = np.asarray(modes, dtype=object)
            known = [int(mode) for mode in core.Mode]
            if asked.shape != (len(self.element_names),) or not np.isin(asked, known).all():
                raise InputError(
                    f"modes must hold {len(self.element_names)} numbers out of -1, 0, 1; got {modes}"
                )
            given = [core.Mode(int(m)) for m in asked]
        now = self._call(self._runner.solve, q, v, t, tau, given)
        used = np.array(now.modes, dtype=np.int8)
        return Solution(now.a, now.F_ideal, now.F_nonideal, now.lam, now.rank, used, now.unique)

    def acceleration(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike | None = None,
        t: float = 0.0,
        *,
        several: str = "error",
    ) -> Array:
        """Just the acceleration, for loops of one's own.

        Args:
            q: configuration, (nq,).
            v: velocity, (nv,).
            tau: joint torques instead of the scene's actuation, (nv,).
            t: time [s].
            several: "error" or "continue" where the laws allow several motions, as in `solve`.

        Returns:
            a, (nv,).

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        a = np.empty(self._nv)
        self._runner.continues = choice("acceleration: several", several, SEVERAL) == "continue"
        try:  # arrays of the right shape go straight to the core, which checks sizes, lengths and finiteness
            self._runner.acceleration(q, v, t, tau, a)
        except (TypeError, ValueError, core.CoreFailure):
            self._call(self._runner.acceleration, q, v, t, tau, a)
        return a

    def _call(
        self,
        function: Callable[Concatenate[Array, Array, float, Array | None, Rest], Result],
        q: ArrayLike,
        v: ArrayLike,
        t: float,
        tau: ArrayLike | None,
        *rest: Rest.args,
        **named: Rest.kwargs,
    ) -> Result:
        q_in, v_in = self._configuration(q, "q"), self._velocity(v, "v")
        torque = None if tau is None else np.array(array("tau", tau, (self.model.nv,)))
        try:
            return function(q_in, v_in, number("t", t), torque, *rest, **named)
        except core.CoreFailure as failure:
            raise self._compiled.named(failure) from None

    def report(self) -> str:
        """What the scene is made of: joints, constraints, rows, rank, mobility, and what was left out."""
        q, v = self.initial_state()
        self._runner.solve(q, v, 0.0, modes=[core.Mode.slip_plus] * len(self.element_names))
        notes = [f"note: {n}" for n in self.notes]
        credits = {"source": self.source, "licence": self.licence}
        notes += [f"{key}: {value}" for key, value in credits.items() if value]
        return report(self._compiled, self.name, self._runner.rank, notes)


def program_of(scene: Scene) -> core.Program:
    """The scene as the core knows it.

    Args:
        scene: the scene.
    """
    return scene._compiled.program


def loaded(
    scene: Scene, origin: Table | None, friction: dict[str, tuple[float, float, float]] | None = None
) -> Scene:
    """The scene, which remembers what `load` made it from, so that `resume` can load it again.

    Args:
        scene: as loaded.
        origin: name and parameters, or None when a file cannot hold them.
        friction: coefficients of the file's collision geometry.
    """
    scene._origin, scene.contact_friction = origin, friction or {}
    return scene
