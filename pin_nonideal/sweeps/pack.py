"""Files that hold runs of a sweep, several in one: a line of JSON and an .npz archive a run, as they come.

A file for each run would cost more than a short run does, and a hundred thousand of them are a burden to any
disk.  A run that is written whole is there, whatever becomes of the process that goes on with the next.
"""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pin_nonideal.errors import OutputError
from pin_nonideal.types import Table

SUFFIX = ".runs"


class Pack:
    """A file that grows by a run at a time; made when the first one comes.

    Args:
        folder: of the sweep.
        first: number of the first run that it may hold; it bears a name that no other one bears.
    """

    def __init__(self, folder: Path, first: int) -> None:
        self.path = folder / f"{first:07d}-{uuid.uuid4().hex[:12]}{SUFFIX}"
        self._stream: Any = None
        self._end = 0

    def __enter__(self) -> Pack:
        return self

    def __exit__(self, *error: object) -> None:
        if self._stream is not None:
            self._stream.close()

    def add(self, record: Table, content: bytes) -> Table:
        """Writes a run, handed to the operating system before it returns.

        Args:
            record: what the index tells of it.
            content: its archive, or nothing.

        Returns:
            The record with the place of the archive.

        Raises:
            OutputError: it cannot be written.
        """
        head = json.dumps(record | {"size": len(content)}).encode() + b"\n"
        try:
            if self._stream is None:
                self._stream = self.path.open("xb", buffering=0)
            left = memoryview(head + content)
            while left:
                left = left[self._stream.write(left) :]
        except OSError as error:
            raise OutputError(f'cannot write the run to "{self.path}": {error.strerror or error}') from error
        at = self._end + len(head)
        self._end = at + len(content)
        return record | {"at": [self.path.name, at, len(content)]}


def runs_in(path: Path, start: int) -> Iterator[Table]:
    """Records of the runs that stand whole in a file, with their places.

    Args:
        path: the file.
        start: where to begin, behind a run.
    """
    with path.open("rb") as stream:
        end = os.fstat(stream.fileno()).st_size
        stream.seek(start)
        while (head := stream.readline()).endswith(b"\n"):
            try:
                record = json.loads(head)
                at, size = stream.tell(), int(record.pop("size"))
            except (ValueError, LookupError, TypeError, AttributeError):
                return
            if at + size > end:  # a kill cut it off
                return
            yield record | {"at": [path.name, at, size]}
            stream.seek(at + size)


def archive_of(folder: Path, place: tuple[str, int, int]) -> bytes:
    """The archive of a run.

    Args:
        folder: of the sweep.
        place: file, beginning and size.
    """
    name, at, size = place
    with (folder / name).open("rb") as stream:
        stream.seek(at)
        return stream.read(size)
