"""Shapes of a scene, created or read on first access."""

from __future__ import annotations

from collections.abc import Callable

import pinocchio as pin

from pin_nonideal.errors import InputError
from pin_nonideal.types import GeometryModel

ShapeSource = GeometryModel | Callable[[], GeometryModel] | None


class SceneShapes:
    """Shapes for display and for collisions.

    Args:
        visual: shapes for display, or a function that makes them.
        collision: shapes for collisions, or such a function.
        notes: notes of the scene; remarks of a function are appended.

    Raises:
        InputError: a shape is neither a pinocchio.GeometryModel nor a function.
    """

    def __init__(self, visual: ShapeSource, collision: ShapeSource, notes: list[str]) -> None:
        for what, shapes in (("visual_model", visual), ("collision_model", collision)):
            if not (shapes is None or callable(shapes) or isinstance(shapes, pin.GeometryModel)):
                raise InputError(
                    f"Scene: {what} must be a pinocchio.GeometryModel; got {type(shapes).__name__}"
                )
        self._visual, self._collision, self._notes = visual, collision, notes

    @property
    def sources(self) -> tuple[ShapeSource, ShapeSource]:
        """Shapes for display and for collisions as they are now: read, or as functions."""
        return self._visual, self._collision

    @property
    def visual(self) -> GeometryModel | None:
        """Shapes for display, read at the first call."""
        self._visual = self._read(self._visual)
        return self._visual

    @property
    def collision(self) -> GeometryModel | None:
        """Shapes for collisions, read at the first call."""
        self._collision = self._read(self._collision)
        return self._collision

    def _read(self, shapes: ShapeSource) -> GeometryModel | None:
        if not callable(shapes):
            return shapes
        geometry = shapes()
        if not isinstance(geometry, pin.GeometryModel):
            raise InputError(
                "Scene: a function for a geometry must return a pinocchio.GeometryModel; "
                f"got {type(geometry).__name__}"
            )
        self._notes += [note for note in getattr(shapes, "notes", ()) if note not in self._notes]
        return geometry
