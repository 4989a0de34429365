"""Shapes that are read on first use, because meshes dominate the loading time."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from threading import Lock
from typing import Any

from pin_nonideal.types import GeometryModel

# Maximum number of models and shapes that stay cached for the next robot from the same files.
MAX_CACHED = 8


class Shapes:
    """Geometry model that is read on first use.

    Args:
        read: function that reads the geometry model.
        notes: notes on the reading, added by `read`.
    """

    def __init__(self, read: Callable[[], GeometryModel], notes: list[str] | None = None) -> None:
        self._read, self.notes = read, [] if notes is None else notes

    def __call__(self) -> GeometryModel:
        """Return the geometry model."""
        return self._read()

    def edited(self, edit: Callable[[GeometryModel], GeometryModel]) -> Shapes:
        """Return the same shapes with an edit that is applied after reading.

        Args:
            edit: function from the geometry model to the edited one.
        """
        return Shapes(lambda: edit(self._read()), self.notes)


class FileCache:
    """Cache of data from files by their content, without the least recently used entries."""

    def __init__(self) -> None:
        self._results: OrderedDict[Hashable, object] = OrderedDict()
        self._lock = Lock()

    def __call__(self, content: Hashable, read: Callable[[], object]) -> Any:
        """Return the cached data of a content; copy it before changing it.

        Args:
            content: key of the content of the files and of all options.
            read: function that reads the files if the key is not cached.
        """
        with self._lock:
            if content in self._results:
                self._results.move_to_end(content)
                return self._results[content]
        result = read()
        with self._lock:
            self._results[content] = result
            while len(self._results) > MAX_CACHED:
                self._results.popitem(last=False)
        return result


cached_models, cached_shapes = FileCache(), FileCache()


def file_stamps(files: Iterable[str | os.PathLike[str]]) -> tuple[tuple[str, int, int], ...]:
    """Return name, modification time and size of files, as a key of their content.

    Args:
        files: paths; missing files have the time 0 and the size -1.
    """
    stamps = []
    for file in files:
        try:
            state = os.stat(file)
            stamps.append((os.fspath(file), state.st_mtime_ns, state.st_size))
        except OSError:
            stamps.append((os.fspath(file), 0, -1))
    return tuple(stamps)
