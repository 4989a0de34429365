"""Compilation of MJCF files by MuJoCo; meshes without mass are read later, for the replay."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pin_nonideal.errors import LoadingError
from pin_nonideal.loading.urdf.xml import read_text

from .fields import CONVERTED_FIELDS, CONVERTED_OPTIONS
from .mujoco_types import MjModel, MjsElement, MjSpec, Mujoco

MIN_VERSION = 4  # oldest supported major version of MuJoCo, because the fields of compiled models differ
PLACEHOLDER = 1e-3  # radius of the sphere that replaces a shape that is not read [m]


class CompiledFile(NamedTuple):
    """Compiled MJCF file.

    Attributes:
        model: mujoco.MjModel.
        absent: indices of geoms whose mesh or height field is missing; they are replaced by spheres.
        unread: indices of geoms whose mesh or height field was not read; they are replaced by spheres.
        notes: notes on the reading for the user.
    """

    model: MjModel
    absent: frozenset[int]
    unread: frozenset[int]
    notes: list[str]


def mujoco_module(path: Path) -> Mujoco:
    """Return MuJoCo's Python package.

    Raises:
        LoadingError: the package is not installed, or too old.
    """
    try:
        import mujoco
    except ImportError as error:
        raise LoadingError(
            f'"{path}" is an MJCF file, which MuJoCo compiles, and mujoco cannot be imported ({error}); '
            "pip install 'pin-nonideal[mjcf]'"
        ) from None
    if int(mujoco.__version__.split(".")[0]) < MIN_VERSION:
        raise LoadingError(
            f'"{path}" needs mujoco {MIN_VERSION} or newer; got {mujoco.__version__}; '
            "pip install --upgrade 'pin-nonideal[mjcf]'"
        )
    return mujoco


def compile_mjcf(path: Path, *, meshes: bool = False) -> CompiledFile:
    """Compile an MJCF file.

    Args:
        path: path of the file.
        meshes: whether meshes without mass are read too, which takes most of the time.

    Raises:
        LoadingError: the file is malformed, MuJoCo rejects it, or a mesh with mass is missing.
    """
    mujoco = mujoco_module(path)
    _check_root(path)
    try:
        compiled = _compile(mujoco, path, meshes, probe=False)
    except LoadingError:
        if not meshes:
            raise
        compiled = _compile(mujoco, path, meshes, probe=True)
    _check_finite(compiled.model, path)
    return compiled


def _compile(mujoco: Mujoco, path: Path, meshes: bool, *, probe: bool) -> CompiledFile:
    """Compile a file; with `probe`, also without the massless meshes that MuJoCo cannot read."""
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as caught, _collected_warnings(mujoco) as messages:
        warnings.simplefilter("always")
        try:
            spec = mujoco.MjSpec.from_file(str(path))
        except ValueError as error:
            raise LoadingError(_parse_message(path, _one_line(error))) from None
        absent, unread = _assets(mujoco, spec, path, meshes, probe, notes)
        try:
            model = spec.compile()
        except ValueError as error:
            raise LoadingError(f'"{path}" cannot be compiled by MuJoCo: {_one_line(error)}') from None
    words = [" ".join(text.split()) for text in (*(str(one.message) for one in caught), *messages)]
    notes += [f"MuJoCo: {text}" for text in dict.fromkeys(words)]
    identities = [frozenset(int(g.id) for g in geoms) for geoms in (absent, unread)]
    return CompiledFile(model, identities[0], identities[1], notes)


@contextmanager
def _collected_warnings(mujoco: Mujoco) -> Iterator[list[str]]:
    """Collect MuJoCo's warnings, which are otherwise printed and written to the working directory."""
    messages: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(messages.append)
    try:
        yield messages
    finally:
        mujoco.set_mju_user_warning(before)


def _check_finite(model: MjModel, path: Path) -> None:
    """Check that a model contains no NaN, which MuJoCo accepts with a warning and treats as no range."""
    fields = {f"option {name}": getattr(model.opt, name) for name in CONVERTED_OPTIONS.split()}
    fields |= {name: getattr(model, name) for name in CONVERTED_FIELDS.split() if name != "opt"}
    bad = [name for name, values in fields.items() if np.isnan(np.asarray(values, dtype=float)).any()]
    if bad:
        raise LoadingError(f'"{path}" must hold finite numbers; MuJoCo finds NaN in {", ".join(bad)}')


def _check_root(path: Path) -> None:
    """Check that an XML file is MJCF, because MuJoCo also reads URDF by other rules."""
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
    mujoco: Mujoco, spec: MjSpec, path: Path, meshes: bool, probe: bool, notes: list[str]
) -> tuple[list[MjsElement], list[MjsElement]]:
    """Remove textures, skins, and shapes that are missing or needed for a replay only.

    Returns:
        Geoms whose shape is missing, and geoms whose shape was not read.

    Raises:
        LoadingError: a shape with mass is missing.
    """
    _strip(spec, notes)
    assets = [*spec.meshes, *spec.hfields]
    homes = [Path(spec.modelfiledir or "."), *_homes(path)]
    places = {_shape(asset): _place(spec, asset, homes) for asset in assets if asset.file}
    missing_shapes = {shape for shape, place in places.items() if place is None}
    broken = {_shape(a) for a in assets if probe and not _is_readable(mujoco, a, places.get(_shape(a)))}
    files = {_shape(asset): asset.file for asset in assets}
    absent, unread = [], []
    wrapping = _wrapped_geoms(mujoco, spec)
    for geom in spec.geoms:
        shape = geom.meshname or geom.hfieldname
        if not shape:
            continue
        if _carries_mass(mujoco, spec, geom) or geom.name in wrapping:
            if shape in missing_shapes:  # MuJoCo rejects undeclared assets and broken files itself
                raise LoadingError(
                    f'"{path}": body "{geom.parent.name}" has its mass from mesh "{files[shape]}", which was '
                    "not found; put the mesh there or give the body an <inertial>"
                )
        elif shape in missing_shapes | broken:
            absent.append(geom)
        elif not meshes:
            unread.append(geom)
    for geom in (*absent, *unread):
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [PLACEHOLDER, 0.0, 0.0]
        geom.meshname = geom.hfieldname = ""
        geom.plugin.active, geom.mass = False, 0.0
    _drop_unused(spec)
    for shape in (s for s in files if s in missing_shapes | broken):
        what = "was not found" if shape in missing_shapes else "cannot be read"
        notes.append(f'mesh "{files[shape]}" {what}; its shape is left out')
    return absent, unread


def _strip(spec: MjSpec, notes: list[str]) -> None:
    """Remove textures, skins and plugin sensors: they do not affect the motion, and files may be missing."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for asset in (*spec.textures, *spec.skins):
        spec.delete(asset)
    for sensor in list(spec.sensors):
        if sensor.plugin.active:
            notes.append(f'sensor "{sensor.name}" of a plugin is not read')
            spec.delete(sensor)


def _shape(asset: MjsElement) -> str:
    return str(asset.name or Path(asset.file).stem)


def _is_readable(mujoco: Mujoco, asset: MjsElement, place: Path | None) -> bool:
    """Check if MuJoCo can compile a mesh or a height field alone; True for an asset without a file."""
    if place is None:
        return True
    probe = mujoco.MjSpec()
    geom = probe.worldbody.add_geom()
    if hasattr(asset, "nrow"):  # height field
        probe.add_hfield(name="probe", file=str(place), size=asset.size)
        geom.type, geom.hfieldname = mujoco.mjtGeom.mjGEOM_HFIELD, "probe"
    else:
        probe.add_mesh(name="probe", file=str(place), scale=asset.scale, inertia=asset.inertia)
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, "probe"
    try:
        probe.compile()
    except ValueError:
        return False
    return True


def _place(spec: MjSpec, asset: MjsElement, homes: Sequence[Path]) -> Path | None:
    """Return the path of the file of a mesh or a height field, or None if it is missing."""
    name = Path(asset.file).name if spec.strippath else asset.file
    folders = [asset.compiler.meshdir or "", spec.meshdir or "", ""]
    places = (home / folder / name for home in homes for folder in folders)
    return next((place.resolve() for place in places if place.is_file()), None)


def _homes(path: Path) -> list[Path]:
    """Return the base folders of relative paths: folders of the file, its includes and attached models."""
    homes: dict[Path, None] = {}
    left, visited = [(path.resolve(), path.resolve().parent)], set()
    while left:
        file, home = left.pop()
        if file in visited:
            continue
        visited.add(file)
        homes[home] = None
        try:
            text = file.read_text(encoding="utf-8", errors="ignore")
        except OSError:  # MuJoCo has rejected the file already, or does not need it
            continue
        for tag, name in re.findall(r"<(include|model)\b[^>]*?\bfile\s*=\s*[\"']([^\"']+)[\"']", text):
            named = (home / name).resolve()
            left.append((named, home if tag == "include" else named.parent))
    return list(homes)


def _wrapped_geoms(mujoco: Mujoco, spec: MjSpec) -> set[str]:
    """Return the names of the geoms that tendons wrap around; missing geoms are ignored."""
    around = (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER)
    wraps = [w for tendon in spec.tendons for w in tendon.path if w.type in around]
    return {w.target.name for w in wraps if w.target is not None}


def _moves(body: MjsElement) -> bool:
    """Check if a joint moves a body."""
    while body is not None:
        if body.joints:
            return True
        body = body.parent
    return False


def _carries_mass(mujoco: Mujoco, spec: MjSpec, geom: MjsElement) -> bool:
    """Check if MuJoCo computes the mass of a moving body, or a share of the total mass, from this geom."""
    compiler, body = geom.compiler, geom.parent
    if not _moves(body) and spec.compiler.settotalmass <= 0.0:
        return False
    rule = mujoco.mjtInertiaFromGeom
    if compiler.inertiafromgeom == rule.mjINERTIAFROMGEOM_FALSE or body.name == "world":
        return False
    if body.explicitinertial and compiler.inertiafromgeom == rule.mjINERTIAFROMGEOM_AUTO:
        return False
    low, high = compiler.inertiagrouprange
    massless = geom.mass == 0.0 or (math.isnan(geom.mass) and geom.density == 0.0)
    return bool(low <= geom.group <= high and not massless and not geom.hfieldname)


def _drop_unused(spec: MjSpec) -> None:
    """Remove the assets that no shape uses."""
    used = {name for geom in spec.geoms for name in (geom.meshname, geom.hfieldname)}
    used |= {getattr(site, "meshname", "") for site in spec.sites}
    for asset in (*spec.meshes, *spec.hfields):
        if _shape(asset) not in used:
            spec.delete(asset)
