"""Shapes that are read when something asks for them: meshes take most of the time of loading."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from threading import Lock
from typing import Any

from pin_nonideal.types import GeometryModel

# Models and shapes that stay in memory for the next robot of the same files.
MOST_KEPT = 8


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


class Kept:
    """What was read from files, by their content; the least recently asked for goes first."""

    def __init__(self) -> None:
        self._found: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = Lock()

    def __call__(self, content: Hashable, read: Callable[[], Any]) -> Any:
        """What this content gives, read once; to be copied before it is changed.

        Args:
            content: of the files, with whatever else decides on what is read.
            read: reads them.
        """
        with self._lock:
            if content in self._found:
                self._found.move_to_end(content)
                return self._found[content]
        found = read()
        with self._lock:
            self._found[content] = found
            while len(self._found) > MOST_KEPT:
                self._found.popitem(last=False)
        return found


kept_models, kept_shapes = Kept(), Kept()


def stamps(files: Iterable[str | os.PathLike[str]]) -> tuple[tuple[str, int, int], ...]:
    """Name, time of the last change and size of files, which a change of their content changes.

    Args:
        files: their paths; those that are not there have neither.
    """
    found = []
    for file in files:
        try:
            state = os.stat(file)
            found.append((os.fspath(file), state.st_mtime_ns, state.st_size))
        except OSError:
            found.append((os.fspath(file), 0, -1))
    return tuple(found)
