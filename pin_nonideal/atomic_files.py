"""Output files: checked names, and atomic writing."""

from __future__ import annotations

import errno
import os
import platform
import re
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from .errors import InputError, OutputError, short_repr

NAME_BYTES_MAX = 255  # longest name of a file or folder on the file systems in use
PART = ".part"  # end of the name of a file that is still being written


def file_path(what: str, value: object) -> Path:
    """Return the name of a file as a Path.

    Args:
        what: name of the argument in messages.
        value: the argument.

    Raises:
        InputError: the argument is not a path, or is empty.
    """
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise InputError(f"{what} must be the name of a file; got {short_repr(value)}")
    path = Path(value)
    if not path.name or "\0" in os.fspath(value):
        raise InputError(f"{what} must be the name of a file; got {short_repr(os.fspath(value))}")
    if any(len(part.encode(errors="replace")) > NAME_BYTES_MAX for part in path.parts):
        raise InputError(
            f"{what} must be the name of a file of at most {NAME_BYTES_MAX} bytes; got "
            f"{short_repr(os.fspath(value))}"
        )
    return path


def check_writable(path: Path, what: str) -> None:
    """Check that a file can be written, before the work that makes its content.

    Args:
        path: the file.
        what: name of the argument in messages.

    Raises:
        OutputError: the folder does not exist or cannot be written, or `path` is a folder, device or pipe.
    """
    mode_of(path, what)
    target = Path(os.path.realpath(path))
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISDIR(target.parent.stat().st_mode):
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        if not os.access(target.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise OutputError(_cannot_write(path, what, error)) from error


@contextmanager
def whole_file(path: Path, what: str) -> Iterator[IO[bytes]]:
    """Open a stream to a temporary file beside `path` that is renamed at the end, so the write is atomic.

    A symbolic link is kept and its target is written. An existing file keeps its permissions. Partial files
    of the same name are removed if the process that wrote them was killed.

    Args:
        path: the file; an existing file stays until the new one is complete.
        what: name of the argument in messages.

    Raises:
        OutputError: the folder does not exist or cannot be written, or `path` is a folder, device or pipe.
    """
    import tempfile

    target = Path(os.path.realpath(path))
    try:
        mode = mode_of(path, what)
        _remove_left_over(target)
        handle, temporary = tempfile.mkstemp(
            dir=target.parent, prefix=_part(target, os.getpid()), suffix=PART
        )
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(_cannot_write(path, what, error)) from error
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())  # flush to disk before the rename
        _keep_owner(target, temporary)
        os.chmod(temporary, mode)
        os.replace(temporary, target)
    except BaseException as error:
        Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(_cannot_write(path, what, error)) from error
        raise


def mode_of(path: Path, what: str) -> int:
    """Return the permissions of an existing file, or of a new file.

    Args:
        path: the file, or a symbolic link to it.
        what: name of the argument in messages.

    Raises:
        OutputError: the path is a device, a pipe or a socket, or its links form a cycle.
    """
    target = Path(os.path.realpath(path))
    try:
        if target.is_symlink():
            raise OutputError(
                f'cannot write {what} to "{path}": its symbolic links lead in a circle; name a file'
            )
        if not target.exists():
            return 0o666 & ~_umask()
        mode = target.stat().st_mode
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(_cannot_write(path, what, error)) from error
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OutputError(f'cannot write {what} to "{path}": it is a device or a pipe; name a file')
    return stat.S_IMODE(mode)


def _keep_owner(target: Path, temporary: str) -> None:
    """Copy owner and group of the existing file, as far as this process is allowed to."""
    if hasattr(os, "chown"):
        with suppress(OSError):
            status = target.stat()
            os.chown(temporary, status.st_uid, status.st_gid)


def _part(target: Path, process: int) -> str:
    """Return the prefix of the name of a temporary file of a process of this machine."""
    whose = zlib.crc32(f"{platform.node()}/{target.name}".encode())
    return f".{target.name[:40]}.{whose:08x}.{process}."


def _remove_left_over(target: Path) -> None:
    """Remove partial files of processes of this machine that have ended."""
    beginning = _part(target, 0).removesuffix("0.")
    pattern = re.compile(re.escape(beginning) + r"(\d+)\..*" + re.escape(PART))
    for entry in list(os.scandir(target.parent)):
        match = pattern.fullmatch(entry.name)
        if match is not None and not _is_running(int(match[1])):
            Path(entry.path).unlink(missing_ok=True)


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True


def _cannot_write(path: Path, what: str, error: OSError) -> str:
    reason = error.strerror or type(error).__name__
    return f'cannot write {what} to "{path}": {reason}; name a file in a folder that can be written'


def _umask() -> int:
    """Return the file mode mask of this process."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
