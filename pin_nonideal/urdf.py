"""URDF files, read with care.

What Pinocchio's reader passes over in silence is an error, a note, a law or a constraint here.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from .constraints import Constraint, JointCoupling, PrescribedMotion
from .errors import LoadingError, nearest
from .timefunctions import Constant

MOVING = ("revolute", "continuous", "prismatic", "floating", "planar")


@dataclass
class RobotFile:
    """What a robot's file holds, before a scene is made of it.

    Attributes:
        model: pinocchio.Model.
        visual: pinocchio.GeometryModel for display, or None.
        collision: pinocchio.GeometryModel for collision, or None.
        constraints: constraints that the file itself states (mimic joints, equalities).
        forces: given forces that the file itself states (joint springs).
        motors: joints with a transmission.
        notes: what the user should know about the reading.
        q0: initial configuration that the file states, shape (nq,), or None.
        v0: initial velocity that the file states, shape (nv,), or None.
    """

    model: Any
    visual: Any = None
    collision: Any = None
    constraints: list[Constraint] = field(default_factory=list)
    forces: list[Any] = field(default_factory=list)
    motors: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    q0: Any = None
    v0: Any = None


def read_text(path: Path) -> str:
    """The text of a file.

    Raises:
        LoadingError: it cannot be read, or is no text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise LoadingError(
            f'"{path}" must be a text file in UTF-8; {error.reason} at byte {error.start}'
        ) from None
    except OSError as error:
        raise LoadingError(f'"{path}" cannot be read: {error.strerror}') from None


def parse_xml(text: str, path: Path, root: str) -> ElementTree.Element:
    """The root element of an XML file.

    Raises:
        LoadingError: it is truncated or malformed, declares entities, or has another root.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise LoadingError(f'"{path}" must not declare a DOCTYPE or entities; remove them')
    try:
        element = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise LoadingError(f'"{path}" is truncated or not XML: {error}; export it again') from None
    if element.tag != root:
        raise LoadingError(f'"{path}" must have the root element <{root}>; got <{element.tag}>')
    return element


def read_urdf(path: Path, *, free_flyer: bool = False, package_dirs: Sequence[str | Path] = ()) -> RobotFile:
    """Reads a URDF file.

    Args:
        path: the file.
        free_flyer: give the root link a floating base, joint "root_joint".
        package_dirs: folders that hold the packages of `package://` paths; the file's own folder and those
            above it, and ROS_PACKAGE_PATH, are searched as well.

    Raises:
        LoadingError: the file is malformed, holds a loop, or a link or joint that cannot be.
    """
    text = read_text(path)
    root = parse_xml(text, path, "robot")
    name = root.get("name") or path.parent.name
    root.set("name", name)
    _check_tree(root, path)
    for link in root.findall("link"):
        _check_inertia(link, path)
    for joint in root.findall("joint"):
        _check_joint(joint, path)
    notes = _resolve_meshes(root, path, package_dirs)
    xml = ElementTree.tostring(root, encoding="unicode")
    try:
        model = (
            pin.buildModelFromXML(xml, pin.JointModelFreeFlyer())
            if free_flyer
            else pin.buildModelFromXML(xml)
        )
    except (ValueError, RuntimeError) as error:
        raise LoadingError(f'"{path}" cannot be read by Pinocchio: {error}') from None
    visual, collision = (_geometry(model, root, path, kind, notes) for kind in ("visual", "collision"))
    motors = [j.get("name", "") for j in root.findall("transmission/joint")]
    return RobotFile(model, visual, collision, _mimics(root, path), [], motors, notes)


def read_mimics(path: Path) -> list[Constraint]:
    """The mimic joints of a URDF file as couplings.

    Raises:
        LoadingError: the file is malformed, or a mimic joint follows nothing.
    """
    return _mimics(parse_xml(read_text(path), path, "robot"), path)


def _check_tree(root: ElementTree.Element, path: Path) -> None:
    """Each link has one parent at most, names are unique, and there is one root."""
    links = [_attribute(e, "name", "link", path) for e in root.findall("link")]
    joints = [_attribute(e, "name", "joint", path) for e in root.findall("joint")]
    for kind, names in (("link", links), ("joint", joints)):
        for n in sorted(set(names)):
            if names.count(n) > 1:
                raise LoadingError(
                    f'"{path}": {kind} names must be unique; "{n}" appears {names.count(n)} times'
                )
    if not links:
        raise LoadingError(f'"{path}" must hold at least one <link>; got none')
    parent_joint: dict[str, str] = {}
    parent_link: dict[str, str] = {}
    for joint in root.findall("joint"):
        joint_name = joint.get("name", "")
        ends = {}
        for side in ("parent", "child"):
            element = joint.find(side)
            link = None if element is None else element.get("link")
            if link is None:
                raise LoadingError(f'"{path}": joint "{joint_name}" must name its {side} link')
            if link not in links:
                raise LoadingError(
                    f'"{path}": no link "{link}", the {side} of joint "{joint_name}"{nearest(link, links)}'
                )
            ends[side] = link
        child = ends["child"]
        if child in parent_joint:
            raise LoadingError(
                f'"{path}": link "{child}" has two parents, joints "{parent_joint[child]}" and '
                f'"{joint_name}", but URDF holds trees only.  Keep one of the two joints; where the other '
                "was, give each side a link on a fixed joint to serve as a frame; and close the loop in a "
                "robot.yaml beside the URDF:\n"
                f"  closed_loop: [[frame_A, frame_B]]\n  type: [3d]"
            )
        parent_joint[child] = joint_name
        parent_link[child] = ends["parent"]
    roots = [link for link in links if link not in parent_link]
    if not roots:
        raise LoadingError(
            f'"{path}" must have a root link; every link is the child of a joint, so the joints form a ring'
        )
    if len(roots) > 1:
        shown = ", ".join(f'"{r}"' for r in roots[:6])
        raise LoadingError(
            f'"{path}" must have one root link; got {len(roots)}: {shown}; join them with fixed joints'
        )
    for link in links:
        seen = {link}
        while link in parent_link:
            link = parent_link[link]
            if link in seen:
                raise LoadingError(f'"{path}": the joints around link "{link}" form a ring without a root')
            seen.add(link)


def _attribute(element: ElementTree.Element, key: str, kind: str, path: Path) -> str:
    value = element.get(key)
    if not value:
        raise LoadingError(f'"{path}": every <{kind}> must have a {key}; one has none')
    return value


def numbers(
    element: ElementTree.Element | None, key: str, size: int, default: Sequence[float], where: str
) -> Any:
    """Finite numbers of an XML attribute.

    Args:
        element: the element, or None.
        key: name of the attribute.
        size: how many numbers it must hold.
        default: what an absent element or attribute means.
        where: words for messages.

    Raises:
        LoadingError: not numbers, not finite, or another count.
    """
    text = None if element is None else element.get(key)
    if text is None:
        return np.array(default, dtype=float)
    try:
        values = np.array([float(x) for x in text.split()])
    except ValueError:
        raise LoadingError(f'{where}: {key} must hold numbers; got "{text}"') from None
    if values.size != size:
        raise LoadingError(f'{where}: {key} must hold {size} number{"s" if size > 1 else ""}; got "{text}"')
    if not np.isfinite(values).all():
        raise LoadingError(f'{where}: {key} must be finite; got "{text}"')
    return values


def _check_inertia(link: ElementTree.Element, path: Path) -> None:
    """Mass not negative, and a moment of inertia that a body can have."""
    where = f'"{path}": link "{link.get("name")}"'
    for origin in link.iter("origin"):
        numbers(origin, "xyz", 3, (0, 0, 0), where)
        numbers(origin, "rpy", 3, (0, 0, 0), where)
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass = float(numbers(inertial.find("mass"), "value", 1, (0,), where)[0])
    if mass < 0.0:
        raise LoadingError(f"{where}: mass must not be negative; got {mass:g} kg")
    element = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (
        float(numbers(element, k, 1, (0,), where)[0]) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    principal = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if principal[0] < -1e-9 * max(abs(principal[2]), abs(principal[0])):
        raise LoadingError(
            f"{where}: principal moments of inertia must not be negative; got {principal[0]:g} kg m^2"
        )


def _check_joint(joint: ElementTree.Element, path: Path) -> None:
    """Known type, an axis with a direction, and dissipation that does not feed energy."""
    where = f'"{path}": joint "{joint.get("name")}"'
    kind = joint.get("type")
    if kind not in (*MOVING, "fixed"):
        raise LoadingError(f'{where}: type must be one of {", ".join(MOVING)}, fixed; got "{kind}"')
    origin = joint.find("origin")
    numbers(origin, "xyz", 3, (0, 0, 0), where)
    numbers(origin, "rpy", 3, (0, 0, 0), where)
    axis = numbers(joint.find("axis"), "xyz", 3, (1, 0, 0), where)
    if kind in ("revolute", "continuous", "prismatic", "planar") and not axis.any():
        raise LoadingError(f"{where}: axis must have a direction; got 0 0 0")
    for key in ("damping", "friction"):
        value = float(numbers(joint.find("dynamics"), key, 1, (0,), where)[0])
        if value < 0.0:
            raise LoadingError(f"{where}: {key} must not be negative; got {value:g}")


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
            without_package = inner.partition("/")[2] or inner
            ros = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
            parents = folder.resolve().parents
            candidates = [folder / inner, folder / without_package]
            candidates += [base / inner for base in (*map(Path, package_dirs), *ros, *parents)]
            candidates += [base / without_package for base in (*map(Path, package_dirs), *parents[:2])]
            break
    else:
        candidates = [folder / filename.removeprefix("file://")]
    return next((c.resolve() for c in candidates if c.is_file()), None)


def _geometry(model: Any, root: ElementTree.Element, path: Path, kind: str, notes: list[str]) -> Any:
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
