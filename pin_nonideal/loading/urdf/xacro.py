"""Text of URDF files; the xacro package expands `.xacro` files."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pin_nonideal.errors import LoadingError

from .meshes import package_folder
from .xml import read_text

XACRO = threading.Lock()  # xacro finds packages by a function of its module


def urdf_text(path: Path, package_dirs: Sequence[str | Path] = ()) -> str:
    """Return the text of a URDF file; the xacro package expands a `.xacro` file.

    Args:
        path: path of the file.
        package_dirs: additional folders that `$(find package)` searches.

    Raises:
        LoadingError: the file cannot be read, or cannot be expanded.
    """
    if path.suffix.lower() != ".xacro":
        return read_text(path)
    try:
        import xacro
    except ImportError:
        raise LoadingError(
            f'"{path}" must be expanded by xacro, which cannot be imported; pip install xacro, or expand the '
            "file: xacro FILE > robot.urdf"
        ) from None
    try:
        with _finding_packages(path.parent, package_dirs):
            return str(xacro.process_file(str(path)).toxml())
    except Exception as error:  # any error of xacro's macros
        raise LoadingError(
            f'"{path}" cannot be expanded by xacro: {" ".join(str(error).split())}; to give it '
            "arguments, run xacro by hand: xacro FILE NAME:=VALUE > robot.urdf"
        ) from None


@contextmanager
def _finding_packages(folder: Path, package_dirs: Sequence[str | Path]) -> Iterator[None]:
    """Let `$(find package)` of xacro search the folders of meshes before those of ROS."""
    with XACRO:
        try:
            from xacro import substitution_args as names

            ask_ros = names._eval_find
        except (ImportError, AttributeError):  # another version of xacro, which searches ROS only
            yield
            return

        def find(package: str) -> str:
            location = package_folder(package, folder, package_dirs)
            return str(ask_ros(package)) if location is None else str(location)

        names._eval_find = find
        try:
            yield
        finally:
            names._eval_find = ask_ros
