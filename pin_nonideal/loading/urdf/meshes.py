"""Where the meshes of a URDF file lie: resolved as ROS does, and by their endings where a path is broken."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from .xml import listed, numbers

SCHEMES = ("package://", "model://")
MESHES = "meshes"  # folder of a package in which a mesh of a broken path is looked for by its ending
HIGHEST = 3  # folders above the robot's file that may be its package


class Found(NamedTuple):
    """Where a mesh lies.

    Attributes:
        path: absolute.
        broken: whether the path in the file leads nowhere, and the mesh was found by its ending.
    """

    path: Path
    broken: bool


def resolve_meshes(root: ElementTree.Element, path: Path, package_dirs: Sequence[str | Path]) -> list[str]:
    """Writes absolute mesh paths into the tree; a mesh that is nowhere loses its shape.

    Args:
        root: the `<robot>` element; changed.
        path: of the robot's file.
        package_dirs: more folders that hold packages.

    Returns:
        Notes on the meshes that were not found, or were found by their endings.
    """
    files = cache(_files)  # for this reading only: files come and go
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
                found = find_mesh(filename, path.parent, package_dirs, files)
                if found is None:
                    missing[filename] = None
                    link.remove(shape)
                    continue
                mesh.set("filename", str(found.path))
                meter = unit_of(found.path)
                if meter != 1.0:
                    scale = numbers(mesh, "scale", 3, (1, 1, 1), f'link "{link.get("name")}"')
                    mesh.set("scale", " ".join(repr(float(x)) for x in meter * scale))
                    drawn[filename] = meter
                if found.broken:
                    guessed[filename] = found.path
    notes = [f'mesh "{m}" was not found; its shape is left out' for m in missing]
    if guessed:
        first = next(iter(guessed))
        notes.append(
            f"paths of meshes {listed(guessed)} lead nowhere; they are the only ones beneath a folder "
            f'"{MESHES}" that end so, such as "{guessed[first]}"'
        )
    if drawn:
        units = ", ".join(f"{meter:g} m" for meter in sorted(set(drawn.values())))
        notes.append(f"meshes {listed(drawn)} are drawn in units of {units}, as their files say")
    return notes


def unit_of(path: Path) -> float:
    """Length of a mesh file's unit [m]: what a COLLADA file states, as RViz reads it, and 1 for every other.

    Its up axis turns nothing, as in RViz; the other formats state no unit.

    Args:
        path: of the mesh.
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
        pass  # whoever reads the shape says what is wrong with it
    return 1.0


def find_mesh(
    filename: str, folder: Path, package_dirs: Sequence[str | Path], files: Callable[[Path], Sequence[Path]]
) -> Found | None:
    """Where a mesh lies, or None.

    Args:
        filename: a path, `file://...`, or `package://name/...` (`package:///...` is taken inside the folder).
        folder: folder of the robot's file.
        package_dirs: more folders that hold packages.
        files: all files beneath a folder.
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
        homes = _homes(home, package_dirs)
        named = _named(home, package)
        candidates = [folder / inner, folder / rest]
        candidates += [base / inner for base in homes]
        candidates += [base / rest for base in (*map(Path, package_dirs), *home.parents[:2], *named)]
        packages = [*(base / package for base in homes), *named]
    whole = next((c.resolve() for c in candidates if c.is_file()), None)
    if whole is not None:
        return Found(whole, False)
    for bases in (packages, (home, *home.parents[:HIGHEST])):
        meshes = next((base / MESHES for base in bases if (base / MESHES).is_dir()), None)
        ending = None if meshes is None else _by_ending(files(meshes), inner)
        if ending is not None:
            return Found(ending, True)
    return None


def package_folder(name: str, folder: Path, package_dirs: Sequence[str | Path]) -> Path | None:
    """The folder of a ROS package, or None.

    Args:
        name: of the package.
        folder: folder of the robot's file.
        package_dirs: more folders that hold packages.
    """
    home = folder.resolve()
    candidates = [*(base / name for base in _homes(home, package_dirs)), *_named(home, name)]
    return next((c.resolve() for c in candidates if c.is_dir()), None)


def _homes(home: Path, package_dirs: Sequence[str | Path]) -> list[Path]:
    """Folders that may hold packages by their names."""
    return [*map(Path, package_dirs), *_ros_folders(), *home.parents]


def _named(home: Path, package: str) -> list[Path]:
    """Folders around a robot's file that are a package, whatever they are called themselves."""
    return [base for base in (home, *home.parents) if _is_package(base, package)]


def _by_ending(files: Sequence[Path], inner: str) -> Path | None:
    """The only file whose path ends as another does, as far as any file's does."""
    wanted = Path(inner).parts
    for first in range(len(wanted)):
        ending = wanted[first:]
        found = [f for f in files if f.parts[-len(ending) :] == ending]
        if found:
            return found[0] if len(found) == 1 else None
    return None


def _files(folder: Path) -> tuple[Path, ...]:
    return tuple(sorted(f for f in folder.resolve().rglob("*") if f.is_file()))


def _ros_folders() -> list[Path]:
    """Folders in which ROS looks for packages: ROS 1's own list, and the shares of ROS 2's prefixes."""
    first = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    second = [Path(p) / "share" for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    return [*first, *second]


def _is_package(folder: Path, name: str) -> bool:
    """Whether a folder is the ROS package of that name, whatever it is called itself."""
    try:
        return f"<name>{name}</name>" in (folder / "package.xml").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
