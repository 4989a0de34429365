"""URDF files, read with care.

What Pinocchio's reader passes over in silence is an error, a note, a law or a constraint here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from pin_nonideal.constraints import Constraint, JointCoupling, PrescribedMotion
from pin_nonideal.errors import LoadingError, nearest
from pin_nonideal.timefunctions import Constant
from pin_nonideal.types import Array, GeometryModel, Model

from .density import add_inertias, without_inertia
from .shapes import Shapes
from .tidy import tidy
from .urdf_checks import check_urdf
from .xml import numbers, parse_xml, read_text


class Keyframe(NamedTuple):
    """A state that a file names.

    Attributes:
        q: configuration, (nq,).
        v: velocity, (nv,).
        apply: sets the controls that belong to it.
    """

    q: Array
    v: Array
    apply: Callable[[], None]


@dataclass
class RobotFile:
    """What a robot's file holds, before a scene is made of it.

    Attributes:
        model: pinocchio.Model.
        visual: pinocchio.GeometryModel for display, `Shapes` that make one, or None.
        collision: the same for collision.
        constraints: constraints that the file itself states (mimic joints, equalities).
        forces: given forces that the file itself states (joint springs).
        motors: joints with a transmission.
        notes: what the user should know about the reading.
        q0: initial configuration that the file states, shape (nq,), or None.
        v0: initial velocity that the file states, shape (nv,), or None.
        laws: nonideal laws that the file itself states, beside those that the model holds.
        actuation: what drives the joints, or None.
        keyframes: states that the file names.
        advice: what may help where the mass matrix is singular, "" for nothing.
        contact_friction: coefficients of sliding, spinning and rolling by the geometry's name.
    """

    model: Model
    visual: GeometryModel | None = None
    collision: GeometryModel | None = None
    constraints: list[Constraint] = field(default_factory=list)
    forces: list[Any] = field(default_factory=list)
    motors: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    q0: Array | None = None
    v0: Array | None = None
    laws: list[Any] = field(default_factory=list)
    actuation: Any = None
    keyframes: dict[str, Keyframe] = field(default_factory=dict)
    advice: str = ""
    contact_friction: dict[str, tuple[float, float, float]] = field(default_factory=dict)


def read_urdf(
    path: Path,
    *,
    free_flyer: bool = False,
    package_dirs: Sequence[str | Path] = (),
    density: float | None = None,
) -> RobotFile:
    """Reads a URDF file.

    Args:
        path: the file.
        free_flyer: give the root link a floating base, joint "root_joint".
        package_dirs: folders that hold the packages of `package://` paths; the file's own folder and those
            above it, and the paths of ROS, are searched as well.
        density: of links that state no inertia [kg/m^3], which is then that of their shapes.

    Raises:
        LoadingError: the file is malformed, holds a loop, or a link or joint that cannot be.
    """
    root = parse_xml(urdf_text(path), path, "robot")
    name = root.get("name") or path.parent.name
    root.set("name", name)
    notes = tidy(root)
    check_urdf(root, path)
    notes += _resolve_meshes(root, path, package_dirs)
    bare = without_inertia(root)
    if density is not None:
        add_inertias(root, density, notes)
    xml = ElementTree.tostring(root, encoding="unicode")
    try:
        model = (
            pin.buildModelFromXML(xml, pin.JointModelFreeFlyer())
            if free_flyer
            else pin.buildModelFromXML(xml)
        )
    except (ValueError, RuntimeError) as error:
        raise LoadingError(f'"{path}" cannot be read by Pinocchio: {error}') from None
    _keep_dynamics(model, root, path)
    visual, collision = (_shapes(model.copy(), root, path, kind) for kind in ("visual", "collision"))
    motors = [j.get("name", "") for j in root.findall("transmission/joint")]
    robot = RobotFile(model, visual, collision, constraints=_mimics(root, path), motors=motors, notes=notes)
    if bare and density is None:
        robot.advice = "load(..., density=1000.0) computes the inertia of such links from their shapes"
    return robot


def _shapes(model: Model, root: ElementTree.Element, path: Path, kind: str) -> Shapes:
    """Geometry of one kind, read when something asks for it."""
    notes: list[str] = []
    return Shapes(cache(lambda: _geometry(model, root, path, kind, notes)), notes)


def urdf_text(path: Path) -> str:
    """The text of a URDF file; a `.xacro` file is expanded by the xacro package.

    Raises:
        LoadingError: it cannot be read, or cannot be expanded.
    """
    if path.suffix != ".xacro":
        return read_text(path)
    try:
        import xacro
    except ImportError:
        raise LoadingError(
            f'"{path}" must be expanded by xacro, which cannot be imported; pip install xacro, or expand the '
            "file: xacro FILE > robot.urdf"
        ) from None
    try:
        return str(xacro.process_file(str(path)).toxml())
    except Exception as error:  # xacro raises whatever its macros raise
        raise LoadingError(f'"{path}" cannot be expanded by xacro: {" ".join(str(error).split())}') from None


def _keep_dynamics(model: Model, root: ElementTree.Element, path: Path) -> None:
    """`<dynamics>` of planar and floating joints, for each dof; Pinocchio's reader keeps those of others."""
    for joint in root.findall("joint"):
        dynamics, name = joint.find("dynamics"), joint.get("name", "")
        if dynamics is None or joint.get("type") not in ("planar", "floating"):
            continue
        where, j = f'"{path}": joint "{name}"', model.getJointId(name)
        dofs = slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
        model.damping[dofs] = numbers(dynamics, "damping", 1, (0,), where)[0]
        friction = numbers(dynamics, "friction", 1, (0,), where)[0]
        model.upperDryFrictionLimit[dofs], model.lowerDryFrictionLimit[dofs] = friction, -friction


def read_mimics(path: Path) -> list[Constraint]:
    """The mimic joints of a URDF file as couplings.

    Raises:
        LoadingError: the file is malformed, or a mimic joint follows nothing.
    """
    return _mimics(parse_xml(read_text(path), path, "robot"), path)


def _mimics(root: ElementTree.Element, path: Path) -> list[Constraint]:
    """Mimic joints as couplings: q = multiplier q_leader + offset (Pinocchio's reader leaves them free)."""
    kinds = {j.get("name", ""): j.get("type") for j in root.findall("joint")}
    result: list[Constraint] = []
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is None or joint.get("type") == "fixed":
            continue
        name = joint.get("name", "")
        where = f'"{path}": joint "{name}"'
        leader = mimic.get("joint", "")
        if leader not in kinds:
            raise LoadingError(
                f'{where} mimics joint "{leader}", which does not exist{nearest(leader, kinds)}'
            )
        if leader == name:
            raise LoadingError(f"{where} must mimic another joint; it mimics itself")
        multiplier = float(numbers(mimic, "multiplier", 1, (1,), where)[0])
        offset = float(numbers(mimic, "offset", 1, (0,), where)[0])
        if multiplier == 0.0 or kinds[leader] == "fixed":
            result.append(PrescribedMotion(name, Constant(offset), name=f"{name} mimic"))
        else:
            result.append(JointCoupling(name, leader, multiplier, offset, name=f"{name} mimic"))
    return result


def _resolve_meshes(root: ElementTree.Element, path: Path, package_dirs: Sequence[str | Path]) -> list[str]:
    """Writes absolute mesh paths into the tree; a mesh that is nowhere loses its shape and leaves a note."""
    missing: dict[str, None] = {}
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                mesh = shape.find("geometry/mesh")
                if mesh is None:
                    continue
                filename = mesh.get("filename", "")
                found = find_mesh(filename, path.parent, package_dirs)
                if found is None:
                    missing[filename] = None
                    link.remove(shape)
                else:
                    mesh.set("filename", str(found))
    return [f'mesh "{m}" was not found; its shape is left out' for m in missing]


def find_mesh(filename: str, folder: Path, package_dirs: Sequence[str | Path] = ()) -> Path | None:
    """Where a mesh lies, or None.

    Args:
        filename: a path, `file://...`, or `package://name/...` (`package:///...` is taken inside the folder).
        folder: folder of the robot's file.
        package_dirs: more folders that hold packages.
    """
    for scheme in ("package://", "model://"):
        if filename.startswith(scheme):
            inner = filename[len(scheme) :].lstrip("/")
            package, _, rest = inner.partition("/")
            rest = rest or inner
            parents = folder.resolve().parents
            candidates = [folder / inner, folder / rest]
            candidates += [base / inner for base in (*map(Path, package_dirs), *_ros_folders(), *parents)]
            candidates += [base / rest for base in (*map(Path, package_dirs), *parents[:2])]
            candidates += [base / rest for base in (folder.resolve(), *parents) if _is_package(base, package)]
            break
    else:
        candidates = [folder / filename.removeprefix("file://")]
    return next((c.resolve() for c in candidates if c.is_file()), None)


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


def _geometry(model: Model, root: ElementTree.Element, path: Path, kind: str, notes: list[str]) -> Any:
    """Geometry of one kind, without the meshes that the mesh reader refuses (each leaves a note)."""
    geometry_type = pin.GeometryType.VISUAL if kind == "visual" else pin.GeometryType.COLLISION
    try:
        return pin.buildGeomFromUrdfString(
            model, ElementTree.tostring(root, encoding="unicode"), geometry_type
        )
    except (ValueError, RuntimeError):
        _drop_unreadable(root, kind, notes)
    try:
        return pin.buildGeomFromUrdfString(
            model, ElementTree.tostring(root, encoding="unicode"), geometry_type
        )
    except (ValueError, RuntimeError) as error:
        raise LoadingError(f'"{path}": the {kind} geometry cannot be read by Pinocchio: {error}') from None


def _drop_unreadable(root: ElementTree.Element, kind: str, notes: list[str]) -> None:
    """Removes the shapes whose mesh cannot be read."""
    import coal

    for link in root.findall("link"):
        for shape in link.findall(kind):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            filename = mesh.get("filename", "")
            try:
                coal.MeshLoader().load(filename, np.ones(3))
            except (ValueError, RuntimeError):
                link.remove(shape)
                notes.append(f'mesh "{filename}" cannot be read; its shape is left out')
