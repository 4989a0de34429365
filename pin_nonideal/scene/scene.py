"""Scene: a model with what holds it, rubs it and drives it, analysed once into the core's program."""

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

# What to do where laws and dynamics allow several motions.
SEVERAL = ("error", "continue")
TERMS = tuple(provider.name for provider in core.Provider)
IMPACTS = tuple(law.name for law in core.ImpactLaw)
# What the core has taken when a scene was made.
TAKEN = ("model", "constraints", "laws", "contacts", "forces", "actuation", "terms", "impact", "q0", "v0")


class Scene(States, Geometry, Tables, Steps):
    """A Pinocchio model with constraints, laws, contacts, forces and actuation.

    Everything is checked when the scene is made; rows that can never act are found then and left out.

    Args:
        model: pinocchio.Model.
        constraints: descriptions of `description.constraints`, or Pinocchio's RigidConstraintModel,
            PointAnchorConstraintModel and FrameAnchorConstraintModel.
        laws: descriptions of `description.laws`.
        contacts: descriptions of `description.contacts`.
        forces: descriptions of `description.forces`.
        actuation: None, a constant torque (nv,), a function (t, q, v) -> tau, or a description of
            `pin_nonideal.description.actuation`.
        q0: initial configuration; the neutral one when None.  Frames held to the world are held where they
            are here.  Here and wherever a configuration is taken it is an array (nq,), a table by joint name,
            {"crank": 1.0, "base": {"xyz": [0, 0, 1], "rpy": [0, 0, 1.57]}}, which leaves the others as they
            are (in `solve`, `project` and `simulate` as in the scene's initial state), or the name of a
            reference configuration.  Where a state is put on the constraints the entries of a table are held
            and the others follow by the least move.
        v0: initial velocity, an array (nv,), or a table by joint name whose entries are held while the others
            follow the constraints; zero when None.
        visual_model: pinocchio.GeometryModel for the replay, or a function that makes it when asked for.
        collision_model: pinocchio.GeometryModel, or such a function.
        name: shown in messages and pages; the model's own when None.
        notes: remarks of the loader, shown by `report`.
        source: where the robot comes from.
        licence: its licence.
        terms: who computes M(q), the bias forces and the kinematics: "core", its own pass over the tree, or
            "pinocchio", Pinocchio's crba, nonLinearEffects and computeJointJacobians.
        impact: what restitution e means: "newton", that a gap opens with e times the rate at which it closed,
            or "poisson", that after the impulse which stops the approach a contact gives e times that impulse
            again.  Without friction both say the same where all gaps that touch close with one e.
        assembly_tolerance: to which the frames of loops are given [m or rad]: a gap up to it, in a direction
            in which no joint moves, is no error.

    Raises:
        InputError, UnknownNameError: something does not fit the model.
        InconsistentConstraintsError: rows that vanish ask for an acceleration.

    Attributes:
        constraint_slices: rows of `lam` of each constraint and contact, by name.
        anchor_frames: (name, frame id, frame id or None) of what joins two frames.
        contact_names: names of the contacts, in the order of `closed`; the stops of a JointLimit one by one.
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
        self._origin: Table | None = None  # what `load` made the scene from
        self._shape_sources: tuple[Any, Any] | None = None  # what reads its shapes again
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
        """Eq. (40) at one state: acceleration, both parts of the force of constraint, multipliers, modes.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            t: time [s].
            tau: joint torques instead of the scene's actuation, (nv,).
            modes: mode of each frictional element, +1, -1 or 0, and 2 without friction, as of a contact that
                is open; by velocity and complementarity when None.
            several: what to do where the laws allow several motions: "error", or "continue" with the one of
                least friction.  What may stick or slip at rest sticks either way.

        Returns:
            The Solution; `lam` holds all rows in the order of `constraint_slices`, zero for those that
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
        """Just the acceleration, for loops of one's own.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            tau: joint torques instead of the scene's actuation, (nv,).
            t: time [s].
            several: "error" or "continue" where the laws allow several motions, as in `solve`.

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
        try:  # arrays of the right shape go straight to the core, which checks sizes, lengths and finiteness
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
        """What the scene is made of: joints, constraints, rows, rank, mobility, and what was left out."""
        q, v = self.initial_state()
        self._runner.solve(q, v, 0.0, modes=[core.Mode.slip_plus] * len(self.element_names))
        notes = [f"note: {n}" for n in (*self.notes, *self._start_notes())]
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
