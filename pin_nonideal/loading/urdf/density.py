"""Inertias of links without `<inertial>`, from their shapes and a density."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, CollisionGeometry

from .validation import pose
from .xml import numbers, quote_names

# Minimum volume of a closed mesh, relative to its bounding box. Meshes with less volume are replaced by the
# box.
MIN_CLOSED_VOLUME = 1e-3


def links_without_inertia(root: ElementTree.Element) -> list[str]:
    """Return the names of moving links with a shape and without an inertia.

    Args:
        root: `<robot>` element.
    """
    moved = {e.get("link") for joint in root.findall("joint") for e in joint.findall("child")}
    return [
        str(link.get("name"))
        for link in root.findall("link")
        if link.find("inertial") is None
        and link.get("name") in moved
        and (link.find("collision") is not None or link.find("visual") is not None)
    ]


def add_inertias(root: ElementTree.Element, density: float, notes: list[str]) -> None:
    """Add the inertias of their shapes to links without one, from collision shapes if there are any.

    Args:
        root: `<robot>` element, with absolute paths of meshes; modified.
        density: density of these links [kg/m^3].
        notes: receives notes on the links.
    """
    names = links_without_inertia(root)
    boxes: list[str] = []
    for link in root.findall("link"):
        name = str(link.get("name"))
        if name not in names:
            continue
        shapes = link.findall("collision") or link.findall("visual")
        total = sum((_inertia(shape, density, name, boxes) for shape in shapes), pin.Inertia.Zero())
        if total.mass > 0.0:
            link.append(_element(total))
    if names:
        notes.append(
            f"inertias of links {quote_names(names)} are those of their shapes at {density:g} kg/m^3"
        )
    if boxes:
        notes.append(
            f"meshes that are not closed count as their bounding boxes, in links {quote_names(boxes)}"
        )


def _inertia(shape: ElementTree.Element, density: float, link: str, boxes: list[str]) -> pin.Inertia:
    """Return the inertia of one shape in the link's frame, a pinocchio.Inertia."""
    where = f'link "{link}"'
    place = pose(shape.find("origin"), where)
    volume, center, moments = _solid(shape.find("geometry")[0], where, boxes, link)  # type: ignore[index]
    if not volume > 0.0:
        return pin.Inertia.Zero()
    return pin.Inertia(density * volume, center, density * moments).se3Action(place)


def _solid(
    element: ElementTree.Element, where: str, boxes: list[str], link: str
) -> tuple[float, Array, Array]:
    """Return volume, center and moments of inertia about the center at unit density, in the shape's axes."""
    import coal

    if element.tag == "mesh":
        return _mesh(element, where, boxes, link)
    if element.tag == "box":
        solid: CollisionGeometry = coal.Box(numbers(element, "size", 3, None, where))
    elif element.tag == "sphere":
        solid = coal.Sphere(float(numbers(element, "radius", 1, None, where)[0]))
    else:
        kind = coal.Cylinder if element.tag == "cylinder" else coal.Capsule
        radius, length = (float(numbers(element, key, 1, None, where)[0]) for key in ("radius", "length"))
        solid = kind(radius, length)
    return solid.computeVolume(), solid.computeCOM(), solid.computeMomentofInertiaRelatedToCOM()


def _mesh(
    element: ElementTree.Element, where: str, boxes: list[str], link: str
) -> tuple[float, Array, Array]:
    import coal

    scale = numbers(element, "scale", 3, (1, 1, 1), where)
    try:
        solid = coal.MeshLoader().load(str(element.get("filename")), scale)
    except (ValueError, RuntimeError):
        return 0.0, np.zeros(3), np.zeros((3, 3))
    solid.computeLocalAABB()
    low, high = solid.aabb_local.min_, solid.aabb_local.max_
    box = coal.Box(high - low)
    volume, center = solid.computeVolume(), solid.computeCOM()
    moments = solid.computeMomentofInertiaRelatedToCOM()
    if volume < 0.0:  # mesh with inverted orientation
        volume, moments = -volume, -moments
    if volume > MIN_CLOSED_VOLUME * box.computeVolume() and np.linalg.eigvalsh(moments)[0] > 0.0:
        return volume, center, moments
    boxes.append(link)
    return box.computeVolume(), (low + high) / 2.0, box.computeMomentofInertiaRelatedToCOM()


def _element(inertia: pin.Inertia) -> ElementTree.Element:
    """Return the `<inertial>` element of a pinocchio.Inertia."""
    element = ElementTree.Element("inertial")
    ElementTree.SubElement(element, "origin", {"xyz": " ".join(repr(float(x)) for x in inertia.lever)})
    ElementTree.SubElement(element, "mass", {"value": repr(float(inertia.mass))})
    keys, moments = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), inertia.inertia[np.triu_indices(3)]
    values = {key: repr(float(value)) for key, value in zip(keys, moments, strict=True)}
    ElementTree.SubElement(element, "inertia", values)
    return element
