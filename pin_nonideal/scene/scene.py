"""Scene: a model with constraints, contacts, laws, forces and actuation, compiled once for the core."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pin_nonideal.compilation.analysis import check_model
from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.lowering import Descriptions
from pin_nonideal.compilation.report import report
from pin_nonideal.core_loader import core
from pin_nonideal.description.actuation import Actuation
from pin_nonideal.description.contacts import Contact
from pin_nonideal.description.forces import Force
from pin_nonideal.description.laws import Law
from pin_nonideal.equation import Solution
from pin_nonideal.errors import InputError
from pin_nonideal.geometry.from_model import GeometryContact, with_geometry
from pin_nonideal.states.held import Held
from pin_nonideal.states.joint_layout import unit_parts
from pin_nonideal.states.loop_closure import CLOSURE_TOLERANCE
from pin_nonideal.states.parsing import named_configuration, named_coordinates, named_entries
from pin_nonideal.states.report import ProjectionReport
from pin_nonideal.types import Array, GeometryModel, Model, State, Table
from pin_nonideal.validation import array, choice, nonnegative, number, optional_text, sequence

from .copying import copied, packed, parts_of, rebuilt
from .queries import Tables
from .shapes import Geometry
from .state import States
from .stepping import Steps

Rest = ParamSpec("Rest")
Result = TypeVar("Result")

# Behavior if laws and dynamics admit several motions.
SEVERAL = ("error", "continue")
TERMS = tuple(provider.name for provider in core.Provider)
IMPACTS = tuple(law.name for law in core.ImpactLaw)
# Fields that cannot change after compilation.
TAKEN = ("model", "constraints", "laws", "contacts", "forces", "actuation", "terms", "impact", "q0", "v0")


class Scene(States, Geometry, Tables, Steps):
    """A Pinocchio model with constraints, laws, contacts, forces and actuation.

    The constructor checks all descriptions and removes rows that can never act.

    Args:
        model: pinocchio.Model.
        constraints: descriptions of `description.constraints`, or Pinocchio's RigidConstraintModel,
            PointAnchorConstraintModel and FrameAnchorConstraintModel.
        laws: descriptions of `description.laws`.
        contacts: descriptions of `description.contacts`.
        forces: descriptions of `description.forces`.
        actuation: None, a constant torque (nv,), a function (t, q, v) -> tau, or a description of
            `pin_nonideal.description.actuation`.
        q0: initial configuration; the neutral one when None. Anchors without a second frame hold their frame
            at its placement in q0. Every configuration argument is an array (nq,), a table by joint name such
            as {"crank": 1.0, "base": {"xyz": [0, 0, 1], "rpy": [0, 0, 1.57]}}, or the name of a reference
            configuration. Joints missing in a table keep their neutral value, and in `solve`, `project` and
            `simulate` their value in the scene's initial state. Projection onto the constraints holds the
            entries of a table, and the other joints follow with the least displacement.
        v0: initial velocity, an array (nv,), or a table by joint name; zero when None. Entries of a table are
            held while the others follow the constraints.
        visual_model: pinocchio.GeometryModel for the replay, or a function that creates it on first access.
        collision_model: pinocchio.GeometryModel, or a function that creates it on first access.
        name: name in messages and pages; the model's name when None.
        notes: remarks of the loader, shown by `report`.
        source: origin of the robot.
        licence: licence of the robot.
        terms: provider of M(q), the bias forces and the kinematics: "core", the core's pass over the tree, or
            "pinocchio", Pinocchio's crba, nonLinearEffects and computeJointJacobians.
        impact: restitution law. "newton": a gap opens with e times the rate at which it closed. "poisson":
            after the impulse that stops the approach, a contact applies e times that impulse again. Without
            friction, both laws agree if all closing gaps have the same e.
        assembly_tolerance: accuracy of the frames of loops [m or rad]. A residual up to it is no error in a
            direction in which no joint moves.

    Raises:
        InputError, UnknownNameError: a description does not fit the model.
        InconsistentConstraintsError: a vanishing row has a nonzero right-hand side.

    Attributes:
        constraint_slices: rows of `lam` of each constraint and contact, by name.
        anchor_frames: (name, frame id, frame id or None) of constraints between two frames.
        contact_names: names of the contacts, in the order of `closed`; each stop of a JointLimit is one.
        element_names: names of the friction elements, in the order of `modes`.
        law_names: names of the laws, in the order of the ledger's columns.
        dropped: (name, row, reason) of rows that can never act.
        contact_friction: sliding, spinning and rolling coefficients of the collision geometry in the robot's
            file, by name.
    """

    def __init__(
        self,
        model: Model,
        *,
        constraints: Sequence[Any] = (),
        laws: Sequence[Law] = (),
        contacts: Sequence[Contact | GeometryContact] = (),
        forces: Sequence[Force] = (),
        actuation: Actuation | None = None,
        q0: State | None = None,
        v0: State | None = None,
        visual_model: GeometryModel | Callable[[], GeometryModel] | None = None,
        collision_model: GeometryModel | Callable[[], GeometryModel] | None = None,
        name: str | None = None,
        notes: Sequence[str] = (),
        source: str | None = None,
        licence: str | None = None,
        terms: str = "core",
        impact: str = "newton",
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
        self.contacts = with_geometry(sequence("contacts", contacts), model, collision_model)
        self.forces = sequence("forces", forces)
        self.actuation, self.terms = actuation, choice("Scene: terms", terms, TERMS)
        self.impact = choice("Scene: impact", impact, IMPACTS)
        self._visual, self._collision = visual_model, collision_model
        self.contact_friction: dict[str, tuple[float, float, float]] = {}
        self.notes = list(sequence("notes", notes))
        self.source, self.licence = (
            optional_text(f"Scene: {what}", value)
            for what, value in (("source", source), ("licence", licence))
        )
        check_model(model)
        self._unit_parts = tuple(unit_parts(model))
        self._q0: Array = pin.neutral(model)
        self._v0: Array = np.zeros(model.nv)
        if q0 is not None:
            self._q0 = named_configuration(model, q0, self._q0, "q0", self._unit_parts)
        if v0 is not None:
            self._v0 = self._velocity(v0, "v0")
        self._held = Held(named_coordinates(model, q0), named_entries(model, v0))
        for state in (self._q0, self._v0):
            state.setflags(write=False)
        said = Descriptions(
            self.constraints, self.contacts, self.laws, self.forces, actuation, terms, self.impact
        )
        tolerance = nonnegative("Scene: assembly_tolerance", assembly_tolerance)
        self._compiled = CompiledScene(model, self.q0, said, tolerance, q0 is not None)
        if q0 is not None:
            self._compiled.check_functions(self.q0, self.v0, 0.0)
        self.constraint_slices, self.anchor_frames = self._compiled.slices, self._compiled.anchors
        self.contact_names = self._compiled.contact_names
        self.element_names = self._compiled.program.element_names
        self.law_names = self._compiled.program.law_names
        self.dropped = self._compiled.dropped
        if self._compiled.unprojected:
            names = ", ".join(f'"{n}"' for n in self._compiled.unprojected)
            self.notes.append(
                f"{names}: no residual and no rate, so drift of these rows cannot be projected away"
            )
        self._runner = self._compiled.program.runner()
        self._steps: dict[tuple[str, float], core.SteppedRun] = {}  # by method and length
        self._nv = int(model.nv)
        self._closed: tuple[Array, Array, ProjectionReport] | None = None
        self._told: list[str] | None = None
        self._origin: Table | None = None  # arguments of `load`
        self._shape_sources: tuple[Any, Any] | None = None  # functions that read the shapes again
        self._assembly_tolerance = tolerance

    def __setattr__(self, key: str, value: Any) -> None:
        if key in TAKEN and "_compiled" in self.__dict__:
            raise InputError(
                f'{key} of scene "{self.name}" is what the scene was made of and cannot be exchanged; make a '
                f"new Scene with another {key}"
            )
        super().__setattr__(key, value)

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt, (type(self), packed(parts_of(self), self.name))

    def __deepcopy__(self, memo: dict[int, Any]) -> Scene:
        return copied(self, memo)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        return (
            f'<Scene "{self.name}": nv {self.model.nv}, {len(self.constraints)} constraints, '
            f"{len(self.laws)} laws, {len(self.contacts)} contacts>"
        )

    # --- one instant ----------------------------------------------------------------------------------------

    def solve(
        self,
        q: State,
        v: State,
        t: float = 0.0,
        *,
        tau: ArrayLike | None = None,
        modes: Sequence[int] | None = None,
        several: str = "error",
    ) -> Solution:
        """Solve Eq. (40) at one state: acceleration, both parts of the constraint force, multipliers, modes.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            t: time [s].
            tau: joint torques instead of the scene's actuation, (nv,).
            modes: mode of each friction element: +1 or -1 slips, 0 sticks, 2 is without friction, as in an
                open contact. None determines the modes by velocity and complementarity.
            several: behavior if the laws admit several motions: "error", or "continue" with the motion of
                least friction. An element at rest that may stick or slip sticks in either case.

        Returns:
            The Solution; `lam` holds all rows in the order of `constraint_slices`, and zero for rows that
            never act.

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        self._runner.continues = choice("solve: several", several, SEVERAL) == "continue"
        given = None
        if modes is not None:
            asked = np.asarray(modes, dtype=object)
            opens = any(getattr(contact, "unilateral", True) for contact in self.contacts)
            known = [int(mode) for mode in core.Mode if opens or mode is not core.Mode.unloaded]
            if asked.shape != (len(self.element_names),) or not np.isin(asked, known).all():
                raise InputError(
                    f"modes must hold {len(self.element_names)} numbers out of "
                    f"{', '.join(map(str, known))}; got {modes}"
                )
            given = [core.Mode(int(m)) for m in asked]
        now = self._call(self._runner.solve, q, v, t, tau, given)
        used = np.array(now.modes, dtype=np.int8)
        closed = np.array(now.closed, dtype=bool)
        return Solution(now.a, now.F_ideal, now.F_nonideal, now.lam, now.rank, used, now.unique, closed)

    def acceleration(
        self,
        q: State,
        v: State,
        tau: ArrayLike | None = None,
        t: float = 0.0,
        *,
        several: str = "error",
    ) -> Array:
        """Return the acceleration alone, for user-written integration loops.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            tau: joint torques instead of the scene's actuation, (nv,).
            t: time [s].
            several: "error" or "continue" if the laws admit several motions, as in `solve`.

        Returns:
            a, (nv,).

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        self._require_unchanged()
        if self._compiled.unchecked:
            self._checked_at(q, v, t)
        a = np.empty(self._nv)
        self._runner.continues = choice("acceleration: several", several, SEVERAL) == "continue"
        try:  # the core checks sizes, unit lengths and finiteness of arrays
            self._runner.acceleration(q, v, t, tau, a)
        except (TypeError, ValueError, core.CoreFailure):
            self._call(self._runner.acceleration, q, v, t, tau, a)
        return a

    def _call(
        self,
        function: Callable[Concatenate[Array, Array, float, Array | None, Rest], Result],
        q: State,
        v: State,
        t: float,
        tau: ArrayLike | None,
        *rest: Rest.args,
        **named: Rest.kwargs,
    ) -> Result:
        q_in, v_in = self._configuration(q, "q"), self._velocity(v, "v")
        self._checked_at(q_in, v_in, t)
        torque = None if tau is None else np.array(array("tau", tau, (self.model.nv,)))
        try:
            return function(q_in, v_in, number("t", t), torque, *rest, **named)
        except core.CoreFailure as failure:
            raise self._compiled.named(failure) from None

    def report(self) -> str:
        """Return a text with joints, constraints, rows, rank, mobility and removed rows of the scene."""
        q, v = self.initial_state()
        self._runner.solve(q, v, 0.0, modes=[core.Mode.slip_plus] * len(self.element_names))
        notes = [f"note: {n}" for n in (*self.notes, *self._start_notes())]
        credits = {"source": self.source, "licence": self.licence}
        notes += [f"{key}: {value}" for key, value in credits.items() if value]
        return report(self._compiled, self.name, self._runner.rank, notes)


def program_of(scene: Scene) -> core.Program:
    """Return the core's program of a scene.

    Args:
        scene: the scene.
    """
    return scene._compiled.program


def loaded(
    scene: Scene, origin: Table | None, friction: dict[str, tuple[float, float, float]] | None = None
) -> Scene:
    """Store the arguments of `load` in a scene, so that `resume` can load it again, and return the scene.

    Args:
        scene: the loaded scene.
        origin: name and parameters of `load`, or None if a file cannot hold them.
        friction: friction coefficients of the file's collision geometry, by name.
    """
    scene._origin, scene.contact_friction = origin, friction or {}
    return scene
