"""Base class of scenes: construction, copying and pickling, and access for other rooms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import pinocchio as pin

from pin_nonideal.compilation.analysis import check_model
from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.description.actuation import Actuation
from pin_nonideal.description.constraints import Constraint
from pin_nonideal.description.contacts import Contact
from pin_nonideal.description.contacts.pair_of_shapes import given_contacts
from pin_nonideal.description.drive_lists import given_actuation
from pin_nonideal.description.forces import Force
from pin_nonideal.description.laws import Law
from pin_nonideal.description.scene_spec import SceneSpec
from pin_nonideal.errors import InputError
from pin_nonideal.geometry.from_model import GeometryContact, with_manifolds
from pin_nonideal.states.held_entries import Held
from pin_nonideal.states.loop_closure import CLOSURE_TOLERANCE
from pin_nonideal.types import GeometryModel, Model, State, Table
from pin_nonideal.validation import choice, nonnegative, optional_text, sequence

from .copying import copy_scene, pack, parts_of, rebuilt
from .evaluation import Evaluator
from .queries import Queries
from .shapes import SceneShapes
from .state import InitialState, SceneStates
from .stepping import SceneStepper

S = TypeVar("S", bound="SceneBase")
TERMS = tuple(provider.name for provider in core.Provider)
IMPACTS = tuple(law.name for law in core.ImpactLaw)
# Fields that cannot change after compilation.
FROZEN_FIELDS = (
    "model",
    "constraints",
    "laws",
    "contacts",
    "forces",
    "actuation",
    "terms",
    "impact",
    "q0",
    "v0",
)


@dataclass(frozen=True)
class Origin:
    """Source of a scene, so that it can be made again.

    Attributes:
        table: name and parameters for `load`, or None.
        shapes: functions that read the shapes for display and for collisions again, or None.
        assembly_tolerance: assembly tolerance of the scene [m or rad].
    """

    table: Table | None
    shapes: tuple[object, object] | None
    assembly_tolerance: float


class SceneBase:
    """Descriptions of a scene, its compiled program and its initial state.

    `Scene` documents the arguments, the attributes and the errors, and adds the public methods.
    """

    def __init__(
        self,
        model: Model,
        *,
        constraints: Sequence[Constraint] = (),
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
        self.notes = list(sequence("notes", notes))
        self._shapes = SceneShapes(visual_model, collision_model, self.notes)
        self.model = model
        self.name = optional_text("Scene: name", name) or model.name or "scene"
        self.constraints, self.laws = sequence("constraints", constraints), sequence("laws", laws)
        compiled_contacts = with_manifolds(sequence("contacts", contacts), model, collision_model)
        self.contacts = given_contacts(compiled_contacts)
        self.forces = sequence("forces", forces)
        self.actuation, self.terms = given_actuation(actuation), choice("Scene: terms", terms, TERMS)
        self.impact = choice("Scene: impact", impact, IMPACTS)
        self.contact_friction: dict[str, tuple[float, float, float]] = {}
        self.source, self.licence = (
            optional_text(f"Scene: {what}", value)
            for what, value in (("source", source), ("licence", licence))
        )
        check_model(model)
        initial = InitialState(model, q0, v0)
        self.q0, self.v0 = initial.q, initial.v
        tolerance = nonnegative("Scene: assembly_tolerance", assembly_tolerance)
        lists = self.constraints, compiled_contacts, self.laws, self.forces
        spec = SceneSpec(*lists, self.actuation, terms, self.impact, tolerance)
        compiled = CompiledScene(model, initial.q, spec, initial.is_given)
        if initial.is_given:
            compiled.check_functions(initial.q, initial.v, 0.0)
        self.constraint_slices, self.anchor_frames = compiled.multipliers.slices, compiled.anchors
        self.contact_names = compiled.contacts.names
        self.element_names, self.law_names = compiled.elements.names, compiled.laws.names
        self.dropped = compiled.dropped
        if compiled.unprojected:
            names = ", ".join(f'"{n}"' for n in compiled.unprojected)
            self.notes.append(
                f"{names}: no residual and no rate, so drift of these rows cannot be projected away"
            )
        self._origin = Origin(None, None, tolerance)
        self._states = SceneStates(compiled, initial, self.name)
        self._evaluator = Evaluator(compiled, self._states)
        self._queries = Queries(compiled, self._states, self._evaluator, self.name)
        self._stepper = SceneStepper(compiled, self._states, self._evaluator)
        self._compiled = compiled

    def __setattr__(self, key: str, value: object) -> None:
        if key in FROZEN_FIELDS and "_compiled" in self.__dict__:
            raise InputError(
                f'{key} of scene "{self.name}" is fixed at construction and cannot be exchanged; '
                f"make a new Scene with another {key}"
            )
        super().__setattr__(key, value)

    def __reduce__(self) -> tuple[object, ...]:
        return rebuilt, (type(self), pack(self._parts(), self.name))

    def __deepcopy__(self: S, memo: dict[int, object]) -> S:
        return copy_scene(self, self._parts(), memo)  # type: ignore[no-any-return]

    def _parts(self) -> Table:
        shapes = self._origin.shapes or self._shapes.sources
        return parts_of(self, self._compiled.spec.contacts, self._origin, shapes, self._states.held)

    def __setstate__(self, later: Table) -> None:
        self._origin = Origin(later["table"], later["shapes"], self._origin.assembly_tolerance)
        self.contact_friction, self._states.held = later["friction"], later["held"]

    # --- shapes ---------------------------------------------------------------------------------------------

    @property
    def visual_model(self) -> GeometryModel | None:
        """pinocchio.GeometryModel for the replay, or None; meshes of a file are read on first access."""
        return self._shapes.visual

    @property
    def collision_model(self) -> GeometryModel | None:
        """pinocchio.GeometryModel for collisions, or None; meshes are read on first access."""
        return self._shapes.collision


def compiled_scene(scene: SceneBase) -> CompiledScene:
    """Return the compiled scene.

    Args:
        scene: the scene.
    """
    return scene._compiled


def scene_states(scene: SceneBase) -> SceneStates:
    """Return the states of a scene.

    Args:
        scene: the scene.
    """
    return scene._states


def scene_origin(scene: SceneBase) -> Origin:
    """Return the origin of a scene.

    Args:
        scene: the scene.
    """
    return scene._origin


def with_origin(
    scene: S,
    table: Table | None,
    *,
    shapes: tuple[object, object] | None = None,
    friction: dict[str, tuple[float, float, float]] | None = None,
    held: Held | None = None,
) -> S:
    """Return the scene with its origin, from which `resume` and other processes make it again.

    Args:
        scene: as made.
        table: name and parameters for `load`, or None if a file cannot hold them.
        shapes: functions that read its shapes again.
        friction: friction coefficients of the file's collision geometry, by name.
        held: entries of the initial state that were named.
    """
    scene._origin = Origin(table, shapes, scene._origin.assembly_tolerance)
    scene.contact_friction = friction or {}
    if held is not None:
        scene._states.held = held
    return scene
