"""Checks of a URDF file: a tree of named links, with valid inertias, joints and shapes."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from pin_nonideal.errors import LoadingError, nearest
from pin_nonideal.types import Placement

from .xml import numbers

# Attributes of the sizes of URDF shapes, with their number of values.
SHAPES: dict[str, dict[str, int]] = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
}
MOVING_JOINT_TYPES = ("revolute", "continuous", "prismatic", "floating", "planar")


def check_urdf(root: ElementTree.Element, path: Path, barred: Collection[str] = ()) -> None:
    """Check a URDF file for content that Pinocchio's reader would misread.

    Args:
        root: `<robot>` element.
        path: path of the file, for messages.
        barred: names that no joint may have, because Pinocchio uses them.

    Raises:
        LoadingError: the file is invalid; the message names the link or joint and the requirement.
    """
    _check_tree(root, path)
    for link in root.findall("link"):
        _check_link(link, path)
    for joint in root.findall("joint"):
        if joint.get("name") in barred:
            raise LoadingError(
                f'"{path}": no joint may have the name "{joint.get("name")}", which Pinocchio uses for the '
                "world or for the floating base; rename it"
            )
        _check_joint(joint, path)


def _check_tree(root: ElementTree.Element, path: Path) -> None:
    """Check that each link has at most one parent, names are unique, and there is one root."""
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
                f'"{joint_name}", but URDF holds trees only.  Keep one of the two joints. In place '
                "of the other, add a link on a fixed joint to each side as a frame, and close the loop in a "
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
        visited = {link}
        while link in parent_link:
            link = parent_link[link]
            if link in visited:
                raise LoadingError(f'"{path}": the joints around link "{link}" form a ring without a root')
            visited.add(link)


def _attribute(element: ElementTree.Element, key: str, kind: str, path: Path) -> str:
    value = element.get(key)
    if not value:
        raise LoadingError(f'"{path}": every <{kind}> must have a {key}; one has none')
    return value


def _check_link(link: ElementTree.Element, path: Path) -> None:
    """Check shapes and inertia, because urdfdom drops malformed ones silently."""
    where = f'"{path}": link "{link.get("name")}"'
    for origin in link.iter("origin"):
        pose(origin, where)
    for shape in (*link.findall("visual"), *link.findall("collision")):
        _check_shape(shape, where)
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass_element, element = inertial.find("mass"), inertial.find("inertia")
    if mass_element is None or element is None:
        raise LoadingError(f"{where}: <inertial> must hold <mass> and <inertia>")
    mass = float(numbers(mass_element, "value", 1, None, where)[0])
    if mass < 0.0:
        raise LoadingError(f"{where}: mass must not be negative; got {mass:g} kg")
    xx, xy, xz, yy, yz, zz = (
        float(numbers(element, k, 1, None, where)[0]) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    principal = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if principal[0] < -1e-9 * max(abs(principal[2]), abs(principal[0])):
        raise LoadingError(
            f"{where}: principal moments of inertia must not be negative; got {principal[0]:g} kg m^2"
        )


def pose(origin: ElementTree.Element | None, where: str) -> Placement:
    """Return the placement of an `<origin>`, a pinocchio.SE3.

    Args:
        origin: element, or None.
        where: prefix of error messages.

    Raises:
        LoadingError: values are not numbers, a quaternion is zero, or there are two rotations.
    """
    xyz, rpy = (numbers(origin, key, 3, (0, 0, 0), where) for key in ("xyz", "rpy"))
    x, y, z, w = numbers(origin, "quat_xyzw", 4, (0, 0, 0, 1), where)
    if origin is not None and origin.get("quat_xyzw") is not None:
        if origin.get("rpy") is not None:
            raise LoadingError(f"{where}: <origin> must have one of rpy and quat_xyzw; got both")
        if not (x or y or z or w):
            raise LoadingError(f"{where}: quat_xyzw must have a length; got 0 0 0 0")
        return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), xyz)
    return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)


def _check_shape(shape: ElementTree.Element, where: str) -> None:
    """Check that a shape has one geometry, with positive sizes."""
    geometry = shape.find("geometry")
    inner = [] if geometry is None else list(geometry)
    if len(inner) != 1 or inner[0].tag not in SHAPES:
        tags = ", ".join(f"<{e.tag}>" for e in inner) or "nothing"
        raise LoadingError(f"{where}: <geometry> must hold one of {', '.join(SHAPES)}; got {tags}")
    for key, size in SHAPES[inner[0].tag].items():
        values = numbers(inner[0], key, size, (1, 1, 1) if key == "scale" else None, where)
        if key != "scale" and (values <= 0.0).any():
            raise LoadingError(
                f'{where}: {key} of <{inner[0].tag}> must be positive; got "{inner[0].get(key)}"'
            )
    if inner[0].tag == "mesh" and not inner[0].get("filename"):
        raise LoadingError(f"{where}: filename is missing in <mesh>")


def _check_joint(joint: ElementTree.Element, path: Path) -> None:
    """Check that a joint has a known type, a nonzero axis, and nonnegative damping and friction."""
    where = f'"{path}": joint "{joint.get("name")}"'
    kind = joint.get("type")
    if kind not in (*MOVING_JOINT_TYPES, "fixed"):
        stated = "none" if kind is None else f'"{kind}"'
        raise LoadingError(
            f"{where}: type must be one of {', '.join(MOVING_JOINT_TYPES)}, fixed; got {stated}"
        )
    pose(joint.find("origin"), where)
    axis = numbers(joint.find("axis"), "xyz", 3, (1, 0, 0), where)
    if kind in ("revolute", "continuous", "prismatic", "planar") and not axis.any():
        raise LoadingError(f"{where}: axis must have a direction; got 0 0 0")
    limit = joint.find("limit")
    if limit is not None:
        for key in ("effort", "velocity"):
            numbers(limit, key, 1, None, where)
        for key in ("lower", "upper"):
            numbers(limit, key, 1, (0,), where)
    for key in ("damping", "friction"):
        value = float(numbers(joint.find("dynamics"), key, 1, (0,), where)[0])
        if value < 0.0:
            raise LoadingError(f"{where}: {key} must not be negative; got {value:g}")
