"""Output files: names checked, contents whole or absent."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from .errors import InputError, OutputError


def file_path(what: str, value: object) -> Path:
    """The name of a file as a Path.

    Args:
        what: words that name the argument in the message.
        value: what was passed.

    Raises:
        InputError: it is no path, or an empty one.
    """
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise InputError(f"{what} must be the name of a file; got {value!r}")
    if not Path(value).name or "\0" in os.fspath(value):
        raise InputError(f"{what} must be the name of a file; got {os.fspath(value)!r}")
    return Path(value)


@contextmanager
def whole_file(path: Path, what: str) -> Iterator[IO[bytes]]:
    """A stream into a temporary file beside `path`, renamed at the end, so that no half of it is ever seen.

    Args:
        path: the file; an older one stays until the new one is complete.
        what: words for the message.

    Raises:
        OutputError: the folder does not exist or cannot be written, or `path` is a folder.
    """
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.", suffix=".part")
    except OSError as error:
        raise OutputError(_cannot_write(path, what, error)) from error
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())  # on the disk before it bears its name
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except BaseException as error:
        Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(_cannot_write(path, what, error)) from error
        raise


def _cannot_write(path: Path, what: str, error: OSError) -> str:
    reason = error.strerror or type(error).__name__
    return f'cannot write {what} to "{path}": {reason}; name a file in a folder that can be written'


def _umask() -> int:
    """Permissions that new files of this process do not get."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
