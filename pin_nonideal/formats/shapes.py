"""Shapes that are read when something asks for them: meshes take most of the time of loading."""

from __future__ import annotations

from collections.abc import Callable

from pin_nonideal.types import GeometryModel


class Shapes:
    """A geometry model to be.

    Args:
        read: makes it.
        notes: what the reading had to say; filled by `read`.
    """

    def __init__(self, read: Callable[[], GeometryModel], notes: list[str] | None = None) -> None:
        self._read, self.notes = read, [] if notes is None else notes

    def __call__(self) -> GeometryModel:
        """The geometry model."""
        return self._read()

    def edited(self, edit: Callable[[GeometryModel], GeometryModel]) -> Shapes:
        """The same shapes after an edit.

        Args:
            edit: what is done with the geometry model once it is read.
        """
        return Shapes(lambda: edit(self._read()), self.notes)
