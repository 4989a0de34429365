"""Files that hold several runs of a sweep: a line of JSON and an .npz archive for each run.

A separate file for each run would cost more than a short run, and many file systems are slow with a hundred
thousand files. A completely written run stays readable if the process dies during a later run.
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
    """File to which runs are appended; it is created with the first run.

    Args:
        folder: folder of the sweep.
        first: number of the first run of the file; the file name also has a random part, so that it is
            unique.
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
        """Append a run, and return after the data is passed to the operating system.

        Args:
            record: entry of the index for the run.
            content: archive of the run, or empty.

        Returns:
            The record with the position of the archive.

        Raises:
            OutputError: the file cannot be written.
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


def read_records(path: Path, start: int) -> Iterator[Table]:
    """Yield the records of the completely written runs of a file, with their positions.

    Args:
        path: path of the file.
        start: byte offset at which to begin, at the end of a run.
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
            if at + size > end:  # truncated when the process was killed
                return
            yield record | {"at": [path.name, at, size]}
            stream.seek(at + size)


def read_archive(folder: Path, place: tuple[str, int, int]) -> bytes:
    """Return the archive of a run.

    Args:
        folder: folder of the sweep.
        place: name of the file, offset and size of the archive [bytes].
    """
    name, at, size = place
    with (folder / name).open("rb") as stream:
        stream.seek(at)
        return stream.read(size)
