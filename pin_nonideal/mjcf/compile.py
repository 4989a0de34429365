"""MJCF files compiled by MuJoCo itself, with meshes that carry no mass left for the replay to read."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pin_nonideal.errors import LoadingError
from pin_nonideal.formats.xml import read_text

OLDEST = 4  # version of MuJoCo whose compiled models are known field by field
PLACEHOLDER = 1e-3  # radius of the sphere that stands for a shape that is not read [m]


class Compiled(NamedTuple):
    """What MuJoCo makes of a file.

    Attributes:
        model: mujoco.MjModel.
        absent: indices of geoms whose mesh or height field was not found; spheres stand for them.
        unread: indices of geoms whose mesh or height field was left unread; spheres stand for them.
        notes: what the user should know about the reading.
    """

    model: Any
    absent: frozenset[int]
    unread: frozenset[int]
    notes: list[str]


def mujoco_module(path: Path) -> Any:
    """MuJoCo's Python package.

    Raises:
        LoadingError: it is not installed, or too old.
    """
    try:
        import mujoco
    except ImportError as error:
        raise LoadingError(
            f'"{path}" is an MJCF file, which MuJoCo compiles, and mujoco cannot be imported ({error}); '
            "pip install 'pin-nonideal[mjcf]'"
        ) from None
    if int(mujoco.__version__.split(".")[0]) < OLDEST:
        raise LoadingError(
            f'"{path}" needs mujoco {OLDEST} or newer; got {mujoco.__version__}; '
            "pip install --upgrade 'pin-nonideal[mjcf]'"
        )
    return mujoco


def compile_mjcf(path: Path, *, meshes: bool = False) -> Compiled:
    """Compiles an MJCF file.

    Args:
        path: the file.
        meshes: whether to read the meshes that carry no mass too, which takes most of the time.

    Raises:
        LoadingError: the file is malformed, MuJoCo refuses it, or a mesh that carries mass is missing.
    """
    mujoco = mujoco_module(path)
    _require_root(path)
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            spec = mujoco.MjSpec.from_file(str(path))
        except ValueError as error:
            raise LoadingError(_parse_message(path, _one_line(error))) from None
        absent, unread = _assets(mujoco, spec, path, meshes, notes)
        try:
            model = spec.compile()
        except ValueError as error:
            raise LoadingError(f'"{path}" cannot be compiled by MuJoCo: {_one_line(error)}') from None
    notes += [f"MuJoCo: {' '.join(str(one.message).split())}" for one in caught]
    identities = [frozenset(int(g.id) for g in geoms) for geoms in (absent, unread)]
    return Compiled(model, identities[0], identities[1], notes)


def _require_root(path: Path) -> None:
    """Another XML file is said to be one; MuJoCo would read a URDF in its own way."""
    text = re.sub(r"<!--.*?(-->|\Z)|<\?.*?\?>", "", read_text(path), flags=re.DOTALL)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise LoadingError(f'"{path}" must not declare a DOCTYPE or entities; remove them')
    root = re.match(r"[\ufeff\s]*<([\w:.-]+)[\s/>]", text)
    if root is None:
        raise LoadingError(f'"{path}" is truncated or not XML: there is no root element; export it again')
    if root[1] not in ("mujoco", "mujocoinclude"):
        raise LoadingError(f'"{path}" must have the root element <mujoco>; got <{root[1]}>')


def _parse_message(path: Path, words: str) -> str:
    if "XML parse error" in words:
        return f'"{path}" is truncated or not XML: {words}; export it again'
    return f'"{path}" cannot be read by MuJoCo: {words}'


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()).removeprefix("Error: ")


def _assets(
    mujoco: Any, spec: Any, path: Path, meshes: bool, notes: list[str]
) -> tuple[list[Any], list[Any]]:
    """Takes away textures, skins, and shapes that are missing or that only a replay needs.

    Returns:
        Geoms whose shape is absent, and geoms whose shape was left unread.

    Raises:
        LoadingError: a shape that carries mass is missing.
    """
    _strip(spec, notes)
    assets = [*spec.meshes, *spec.hfields]
    homes = [Path(spec.modelfiledir or "."), *_homes(path)]
    found = {_shape(asset): _is_there(spec, asset, homes) for asset in assets}
    files = {_shape(asset): asset.file for asset in assets}
    absent, unread = [], []
    wrapping = _wrapping(mujoco, spec)
    for geom in spec.geoms:
        shape = geom.meshname or geom.hfieldname
        if not shape:
            continue
        there = found.get(shape, True)  # a shape that is no asset is for MuJoCo to refuse
        if _carries_mass(mujoco, geom) or geom.name in wrapping:
            if not there:
                raise LoadingError(
                    f'"{path}": body "{geom.parent.name}" has its mass from mesh "{files[shape]}", which was '
                    "not found; put the mesh there or give the body an <inertial>"
                )
        elif not there:
            absent.append(geom)
        elif not meshes:
            unread.append(geom)
    for geom in (*absent, *unread):
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [PLACEHOLDER, 0.0, 0.0]
        geom.meshname = geom.hfieldname = ""
        geom.plugin.active, geom.mass = False, 0.0
    _drop_unused(spec)
    lost = [files[shape] for shape, there in found.items() if not there]
    notes += [f'mesh "{file}" was not found; its shape is left out' for file in lost]
    return absent, unread


def _strip(spec: Any, notes: list[str]) -> None:
    """Takes away what is only drawn or measured, and may name files that did not travel along."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for asset in (*spec.textures, *spec.skins):
        spec.delete(asset)
    for sensor in list(spec.sensors):
        if sensor.plugin.active:
            notes.append(f'sensor "{sensor.name}" of a plugin is not read')
            spec.delete(sensor)


def _shape(asset: Any) -> str:
    return str(asset.name or Path(asset.file).stem)


def _is_there(spec: Any, asset: Any, homes: Sequence[Path]) -> bool:
    """Whether the file of a mesh or a height field exists, where it has one."""
    if not asset.file:
        return True
    name = Path(asset.file).name if spec.strippath else asset.file
    folders = [asset.compiler.meshdir or "", spec.meshdir or "", ""]
    return any((home / folder / name).is_file() for home in homes for folder in folders)


def _homes(path: Path) -> list[Path]:
    """Folders from which paths lead: of the file, and of the models that it or its includes attach."""
    homes: dict[Path, None] = {}
    left, seen = [(path.resolve(), path.resolve().parent)], set()
    while left:
        file, home = left.pop()
        if file in seen:
            continue
        seen.add(file)
        homes[home] = None
        try:
            text = file.read_text(encoding="utf-8", errors="ignore")
        except OSError:  # which MuJoCo has refused, or does not need
            continue
        for tag, name in re.findall(r"<(include|model)\b[^>]*?\bfile\s*=\s*[\"']([^\"']+)[\"']", text):
            named = (home / name).resolve()
            left.append((named, home if tag == "include" else named.parent))
    return list(homes)


def _wrapping(mujoco: Any, spec: Any) -> set[str]:
    """Names of the geoms that tendons go around; a geom that is not there is for MuJoCo to refuse."""
    around = (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER)
    wraps = [w for tendon in spec.tendons for w in tendon.path if w.type in around]
    return {w.target.name for w in wraps if w.target is not None}


def _carries_mass(mujoco: Any, geom: Any) -> bool:
    """Whether MuJoCo takes a body's mass from this geom."""
    compiler, body = geom.compiler, geom.parent
    rule = mujoco.mjtInertiaFromGeom
    if compiler.inertiafromgeom == rule.mjINERTIAFROMGEOM_FALSE or body.name == "world":
        return False
    if body.explicitinertial and compiler.inertiafromgeom == rule.mjINERTIAFROMGEOM_AUTO:
        return False
    low, high = compiler.inertiagrouprange
    massless = geom.mass == 0.0 or (math.isnan(geom.mass) and geom.density == 0.0)
    return bool(low <= geom.group <= high and not massless and not geom.hfieldname)


def _drop_unused(spec: Any) -> None:
    """Takes away the assets that no shape needs any more."""
    used = {name for geom in spec.geoms for name in (geom.meshname, geom.hfieldname)}
    used |= {getattr(site, "meshname", "") for site in spec.sites}
    for asset in (*spec.meshes, *spec.hfields):
        if _shape(asset) not in used:
            spec.delete(asset)
