"""Paths of the meshes of a URDF file, resolved as in ROS, or by the end of the path if it is broken."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from .xml import numbers, quote_names

SCHEMES = ("package://", "model://")
MESHES = "meshes"  # folder of a package in which meshes of broken paths are searched
MAX_PARENTS = 3  # maximum number of folders above the robot's file that are searched as its package


class FoundMesh(NamedTuple):
    """Path of a mesh file.

    Attributes:
        path: absolute path.
        broken: whether the path in the robot's file is invalid, and a search for the last parts of this path
            found the mesh.
    """

    path: Path
    broken: bool


def resolve_meshes(root: ElementTree.Element, path: Path, package_dirs: Sequence[str | Path]) -> list[str]:
    """Write absolute mesh paths into the tree, and remove shapes whose mesh is missing.

    Args:
        root: `<robot>` element; modified.
        path: path of the robot's file.
        package_dirs: additional folders that hold packages.

    Returns:
        Notes on the meshes that were not found, or were found by the end of their path.
    """
    files = cache(_files)  # only during this call, since files can change
    missing: dict[str, None] = {}
    guessed: dict[str, Path] = {}
    drawn: dict[str, float] = {}
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                mesh = shape.find("geometry/mesh")
                if mesh is None:
                    continue
                filename = mesh.get("filename", "")
                file = find_mesh(filename, path.parent, package_dirs, files)
                if file is None:
                    missing[filename] = None
                    link.remove(shape)
                    continue
                mesh.set("filename", str(file.path))
                meter = mesh_unit(file.path)
                if meter != 1.0:
                    scale = numbers(mesh, "scale", 3, (1, 1, 1), f'link "{link.get("name")}"')
                    mesh.set("scale", " ".join(repr(float(x)) for x in meter * scale))
                    drawn[filename] = meter
                if file.broken:
                    guessed[filename] = file.path
    notes = [f'mesh "{m}" was not found; its shape is left out' for m in missing]
    if guessed:
        first = next(iter(guessed))
        notes.append(
            f"paths of meshes {quote_names(guessed)} do not exist; the only files with the same end "
            f'below a folder "{MESHES}" are used, such as "{guessed[first]}"'
        )
    if drawn:
        units = ", ".join(f"{meter:g} m" for meter in sorted(set(drawn.values())))
        notes.append(f"meshes {quote_names(drawn)} are drawn in units of {units}, which their files state")
    return notes


def mesh_unit(path: Path) -> float:
    """Return the unit of length of a mesh file [m]: from a COLLADA file as in RViz, else 1.

    The up axis of the file has no effect, as in RViz. The other formats state no unit.

    Args:
        path: path of the mesh.
    """
    if path.suffix.lower() != ".dae":
        return 1.0
    try:
        for _, element in ElementTree.iterparse(path):
            name = element.tag.rpartition("}")[2]
            if name == "unit":
                meter = float(element.get("meter", "1"))
                return meter if np.isfinite(meter) and meter > 0.0 else 1.0
            if name == "asset":
                break
    except (ElementTree.ParseError, OSError, ValueError):
        pass  # the reader of the shape reports the error
    return 1.0


def find_mesh(
    filename: str, folder: Path, package_dirs: Sequence[str | Path], files: Callable[[Path], Sequence[Path]]
) -> FoundMesh | None:
    """Return the path of a mesh, or None.

    Args:
        filename: path, `file://...`, or `package://name/...` (`package:///...` is relative to the folder).
        folder: folder of the robot's file.
        package_dirs: additional folders that hold packages.
        files: function that returns all files below a folder.
    """
    home = folder.resolve()
    inner = next((filename.removeprefix(s).lstrip("/") for s in SCHEMES if filename.startswith(s)), None)
    packages: list[Path] = []
    if inner is None:
        inner = filename.removeprefix("file://").replace("\\", "/")
        candidates = [folder / inner]
    else:
        package, _, rest = inner.partition("/")
        rest = rest or inner
        homes = _package_roots(home, package_dirs)
        named = _named_packages(home, package)
        candidates = [folder / inner, folder / rest]
        candidates += [base / inner for base in homes]
        candidates += [base / rest for base in (*map(Path, package_dirs), *home.parents[:2], *named)]
        packages = [*(base / package for base in homes), *named]
    whole = next((c.resolve() for c in candidates if c.is_file()), None)
    if whole is not None:
        return FoundMesh(whole, False)
    for bases in (packages, (home, *home.parents[:MAX_PARENTS])):
        meshes = next((base / MESHES for base in bases if (base / MESHES).is_dir()), None)
        ending = None if meshes is None else _by_ending(files(meshes), inner)
        if ending is not None:
            return FoundMesh(ending, True)
    return None


def package_folder(name: str, folder: Path, package_dirs: Sequence[str | Path]) -> Path | None:
    """Return the folder of a ROS package, or None.

    Args:
        name: name of the package.
        folder: folder of the robot's file.
        package_dirs: additional folders that hold packages.
    """
    home = folder.resolve()
    candidates = [*(base / name for base in _package_roots(home, package_dirs)), *_named_packages(home, name)]
    return next((c.resolve() for c in candidates if c.is_dir()), None)


def _package_roots(home: Path, package_dirs: Sequence[str | Path]) -> list[Path]:
    """Return the folders that can hold packages by their names."""
    return [*map(Path, package_dirs), *_ros_folders(), *home.parents]


def _named_packages(home: Path, package: str) -> list[Path]:
    """Return the folders above a robot's file that are a package, independent of their own names."""
    return [base for base in (home, *home.parents) if _is_package(base, package)]


def _by_ending(files: Sequence[Path], inner: str) -> Path | None:
    """Return the only file whose path shares the longest end with another path, or None."""
    path_parts = Path(inner).parts
    for first in range(len(path_parts)):
        ending = path_parts[first:]
        matches = [f for f in files if f.parts[-len(ending) :] == ending]
        if matches:
            return matches[0] if len(matches) == 1 else None
    return None


def _files(folder: Path) -> tuple[Path, ...]:
    return tuple(sorted(f for f in folder.resolve().rglob("*") if f.is_file()))


def _ros_folders() -> list[Path]:
    """Return the package folders of ROS: the path list of ROS 1, and the share folders of ROS 2."""
    first = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    second = [Path(p) / "share" for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    return [*first, *second]


def _is_package(folder: Path, name: str) -> bool:
    """Check if a folder is the ROS package of the given name, independent of its own name."""
    try:
        return f"<name>{name}</name>" in (folder / "package.xml").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
