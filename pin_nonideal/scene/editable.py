"""Base class of scenes with `replace` and `put_on_ground`, which return changed copies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from pin_nonideal.description.actuation import Actuation
from pin_nonideal.description.constraints import Constraint
from pin_nonideal.description.contacts import Contact
from pin_nonideal.description.forces import Force
from pin_nonideal.description.laws import Law
from pin_nonideal.geometry.from_model import GeometryContact
from pin_nonideal.types import State

from .base import SceneBase
from .copying import rebuilt
from .replacement import UNCHANGED, UnchangedType, on_ground, parts_of_replacement

S = TypeVar("S", bound="EditableScene")


class EditableScene(SceneBase):
    """A scene from which scenes with other parts are made; the scene itself does not change."""

    def replace(
        self: S,
        *,
        constraints: Sequence[Constraint] | None = None,
        laws: Sequence[Law] | None = None,
        contacts: Sequence[Contact | GeometryContact] | None = None,
        forces: Sequence[Force] | None = None,
        add_constraints: Sequence[Constraint] = (),
        add_laws: Sequence[Law] = (),
        add_contacts: Sequence[Contact | GeometryContact] = (),
        add_forces: Sequence[Force] = (),
        remove: Sequence[str] = (),
        actuation: Actuation | UnchangedType | None = UNCHANGED,
        q0: State | None = None,
        v0: State | None = None,
        name: str | None = None,
    ) -> S:
        """Return a new scene with some parts replaced, added or removed. The present scene does not change.

        The new scene has the same model, shapes, notes, source, licence and named entries of the initial
        state. `resume` and `Trajectory.load` cannot create it from the robot's file; pass the scene to them.

        Args:
            constraints: all constraints of the new scene; the present ones when None.
            laws: all laws; the present ones when None.
            contacts: all contacts; the present ones when None.
            forces: all forces; the present ones when None.
            add_constraints: constraints in addition.
            add_laws: laws in addition.
            add_contacts: contacts in addition.
            add_forces: forces in addition.
            remove: names of present constraints, laws, contacts and forces to leave out.
            actuation: actuation of the new scene, None for no actuation; unchanged if left out.
            q0: initial configuration, (nq,) or by joint name (other joints as now); the present one when
                None.
            v0: initial velocity, (nv,) or by joint name (other joints as now); the present one when None.
            name: name of the new scene; the present name when None.

        Returns:
            The new Scene.

        Raises:
            InputError, UnknownNameError: a description or state does not fit the model, or no description has
            a name in `remove`.
        """
        lists = {"constraints": constraints, "laws": laws, "contacts": contacts, "forces": forces}
        added = {
            "constraints": add_constraints,
            "laws": add_laws,
            "contacts": add_contacts,
            "forces": add_forces,
        }
        others = {"actuation": actuation, "q0": q0, "v0": v0, "name": name}
        parts = parts_of_replacement(
            self._parts(), self._compiled, self._states, lists, added, remove, others
        )
        return rebuilt(type(self), parts)  # type: ignore[no-any-return]

    def put_on_ground(self: S, plane: str | None = None) -> S:
        """Return a new scene with its floating robot moved along a normal until a collision shape touches.

        The initial configuration is taken with loops closed. All floating bodies move by the same distance.

        Args:
            plane: name of a frame on the world, whose z axis is the normal; None for the ground z = 0.

        Returns:
            The new Scene.

        Raises:
            InputError: there is no floating base, no collision shape, or the plane moves.
            UnknownNameError: there is no such frame.
        """
        q = self._states.closed_initial()[0]
        return self.replace(q0=on_ground(self.model, self.collision_model, q, plane))
