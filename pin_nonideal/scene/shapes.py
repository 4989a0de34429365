"""Geometry models of a scene, created or read on first access."""

from __future__ import annotations

from collections.abc import Callable

import pinocchio as pin

from pin_nonideal.errors import InputError
from pin_nonideal.types import GeometryModel


class Geometry:
    """Geometry models for display and for collisions.

    Attributes:
        notes: remarks of the loader; reading of shapes may append more.
    """

    notes: list[str]
    _visual: GeometryModel | Callable[[], GeometryModel] | None
    _collision: GeometryModel | Callable[[], GeometryModel] | None

    @property
    def visual_model(self) -> GeometryModel | None:
        """pinocchio.GeometryModel for the replay, or None; meshes of a file are read on first access."""
        self._visual = self._read(self._visual)
        return self._visual

    @property
    def collision_model(self) -> GeometryModel | None:
        """pinocchio.GeometryModel for collisions, or None; meshes are read on first access."""
        self._collision = self._read(self._collision)
        return self._collision

    def _read(self, shapes: GeometryModel | Callable[[], GeometryModel] | None) -> GeometryModel | None:
        """Return the geometry model; a function is called to create it."""
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
