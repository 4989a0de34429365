"""Repair of URDF files: parts that do not affect the motion are corrected or removed, with a note."""

from __future__ import annotations

import math
import sys
from xml.etree import ElementTree

import numpy as np

from .unread_tags import unread_notes
from .validation import SHAPES
from .xml import quote_names

# URDF tags of elements in <robot>; other elements belong to other tools and are removed.
ROBOT = ("link", "joint", "material", "transmission")
VERSION = "1.1"  # version of URDF; without it, Pinocchio's parser ignores capsules and quaternions
WORLD = "world"  # link that many files use without declaring it
INFINITE_WORDS = ("inf", "-inf", "+inf", "infinity", "-infinity", "+infinity")  # limits without a bound
NAMESPACE_MARK = "{"  # beginning of tags with a namespace
# Maximum rounding error of principal moments, relative to the mass times (1 m)^2.
INERTIA_ROUNDING = 1e-12
# tolerance by which a principal moment may exceed the sum of the others, since files round them
INERTIA_TOLERANCE = 1e-2


def repair_urdf(root: ElementTree.Element) -> list[str]:
    """Correct defects of a URDF file that do not affect the motion.

    Args:
        root: `<robot>` element; modified.

    Returns:
        Notes on the corrections.
    """
    notes = [*_remove_foreign(root), *_remove_stray_shapes(root), *unread_notes(root), *_world(root)]
    root.set("version", VERSION)
    for number, material in enumerate(root.iter("material")):
        if not material.get("name"):
            material.set("name", f"material {number}")
    notes += _colors(root)
    notes += _undefined_materials(root)
    sizeless = []
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                if _sizeless(shape):
                    link.remove(shape)
                    sizeless.append(str(link.get("name")))
                _uniform_scale(shape)
    if sizeless:
        notes.append(f"shapes of size zero are left out, in links {quote_names(sizeless)}")
    return notes + _inertias(root) + _limits(root)


def _remove_foreign(root: ElementTree.Element) -> list[str]:
    """Remove elements of other tools and of other namespaces."""
    foreign_tags: dict[str, None] = {}
    for element in list(root):
        if element.tag not in ROBOT:
            foreign_tags[str(element.tag).rpartition("}")[2]] = None
            root.remove(element)
    for parent in list(root.iter()):
        for child in [c for c in parent if str(c.tag).startswith(NAMESPACE_MARK)]:
            foreign_tags[str(child.tag).rpartition("}")[2]] = None
            parent.remove(child)
        for key in [k for k in parent.attrib if k.startswith(NAMESPACE_MARK)]:
            del parent.attrib[key]
    return (
        [f"elements of other tools are not read: {', '.join(f'<{tag}>' for tag in foreign_tags)}"]
        if foreign_tags
        else []
    )


def _remove_stray_shapes(root: ElementTree.Element) -> list[str]:
    """Remove elements of a `<geometry>` other than its shape."""
    ignored_elements: dict[str, None] = {}
    for link in root.findall("link"):
        for geometry in (g for kind in ("visual", "collision") for g in link.findall(f"{kind}/geometry")):
            stray = [e for e in geometry if e.tag not in SHAPES]
            if len(geometry) - len(stray) == 1:
                for element in stray:
                    geometry.remove(element)
                    ignored_elements[f'<{element.tag}> in link "{link.get("name")}"'] = None
    return (
        [f"elements beside the shape of a <geometry> are not read: {', '.join(ignored_elements)}"]
        if ignored_elements
        else []
    )


def _world(root: ElementTree.Element) -> list[str]:
    """Declare the link "world" if joints use it and the file does not declare it."""
    declared = {link.get("name") for link in root.findall("link")}
    named = {e.get("link") for joint in root.findall("joint") for e in joint.findall("parent")}
    if WORLD in declared or WORLD not in named or not declared:
        return []
    root.append(ElementTree.Element("link", {"name": WORLD}))
    return [f'link "{WORLD}", a parent of joints, is not declared; it is added without inertia']


def _colors(root: ElementTree.Element) -> list[str]:
    bad = []
    for material in root.iter("material"):
        for color in material.findall("color"):
            try:
                values = [float(x) for x in (color.get("rgba") or "").split()]
            except ValueError:
                values = []
            if len(values) == 3:
                values.append(1.0)
                color.set("rgba", " ".join(map(repr, values)))
            if len(values) != 4 or not all(0.0 <= value <= 1.0 for value in values):
                material.remove(color)
                bad.append(str(material.get("name")))
    return (
        [f"colors that are not four numbers from 0 to 1 are left out, of materials {quote_names(bad)}"]
        if bad
        else []
    )


def _undefined_materials(root: ElementTree.Element) -> list[str]:
    """Remove references to undefined materials; the shapes keep their own colors."""
    defined = {m.get("name") for m in root.iter("material") if len(m)}
    lost = []
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            for material in visual.findall("material"):
                if not len(material) and material.get("name") not in defined:
                    visual.remove(material)
                    lost.append(str(material.get("name")))
    for material in [m for m in root.findall("material") if not len(m)]:
        root.remove(material)
    notes = [f"materials that are not defined are left out: {quote_names(lost)}"] if lost else []
    named: set[str | None] = set()
    twice = []
    for material in root.findall("material"):
        if material.get("name") in named:
            root.remove(material)
            twice.append(str(material.get("name")))
        named.add(material.get("name"))
    return notes + (
        [f"materials defined twice keep their first definition: {quote_names(twice)}"] if twice else []
    )


def _sizeless(shape: ElementTree.Element) -> bool:
    """Check if a shape has a dimension of zero, or no geometry."""
    geometry = shape.find("geometry")
    if geometry is None or not len(geometry):
        return True
    inner = geometry[0]
    if inner.tag == "mesh" and inner.get("filename") == "":
        return True
    keys = [key for key in SHAPES.get(inner.tag, ()) if key != "scale"]
    try:
        sizes = [float(x) for key in keys for x in (inner.get(key) or "nan").split()]
    except ValueError:
        return False
    return 0.0 in sizes and not any(size < 0.0 for size in sizes)


def _uniform_scale(shape: ElementTree.Element) -> None:
    """Expand a scale of one number to three."""
    mesh = shape.find("geometry/mesh")
    if mesh is not None and len((mesh.get("scale") or "").split()) == 1:
        mesh.set("scale", " ".join([str(mesh.get("scale"))] * 3))


def _inertias(root: ElementTree.Element) -> list[str]:
    """Set principal moments to zero if they are negative by rounding, and note unphysical ones."""
    keys, rounded, unbalanced = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), [], []
    for link in root.findall("link"):
        element, mass = link.find("inertial/inertia"), link.find("inertial/mass")
        if element is None or mass is None:
            continue
        try:
            xx, xy, xz, yy, yz, zz = (float(element.get(key, "nan")) for key in keys)
            scale = abs(float(mass.get("value", "nan")))
        except ValueError:
            continue
        moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if not np.isfinite(moments).all():
            continue
        values, axes = np.linalg.eigh(moments)
        if -INERTIA_ROUNDING * max(scale, values[2]) <= values[0] < 0.0:
            moments = axes @ np.diag(np.maximum(values, 0.0)) @ axes.T
            for key, value in zip(keys, moments[np.triu_indices(3)], strict=True):
                element.set(key, repr(float(value)))
            rounded.append(str(link.get("name")))
        elif values[0] >= 0.0 and values[2] > (1.0 + INERTIA_TOLERANCE) * (values[0] + values[1]):
            unbalanced.append(str(link.get("name")))
    notes = []
    if rounded:
        notes.append(
            f"moments of inertia that rounding makes negative are zero, of links {quote_names(rounded)}"
        )
    if unbalanced:
        notes.append(
            f"physically impossible inertias are used unchanged, of links {quote_names(unbalanced)}: their "
            "largest principal moment exceeds the sum of the others"
        )
    return notes


def _limits(root: ElementTree.Element) -> list[str]:
    """Correct missing or reversed joint limits, which do not affect the motion."""
    mended = []
    for joint in root.findall("joint"):
        kind, limit = joint.get("type"), joint.find("limit")
        if kind in ("revolute", "prismatic") and limit is None:
            limit = ElementTree.SubElement(joint, "limit", {"effort": "0", "velocity": "0"})
            mended.append(str(joint.get("name")))
        if limit is None:
            continue
        for key in ("effort", "velocity", "lower", "upper"):
            if (limit.get(key) or "").strip().lower() in INFINITE_WORDS:
                limit.set(key, repr(math.copysign(sys.float_info.max, float(limit.get(key, "0")))))
                mended.append(str(joint.get("name")))
        for key in ("effort", "velocity"):
            if limit.get(key) is None:
                limit.set(key, "0")
                mended.append(str(joint.get("name")))
            elif (limit.get(key) or "").strip().startswith("-"):
                limit.set(key, (limit.get(key) or "").strip()[1:])
                mended.append(str(joint.get("name")))
        try:
            lower, upper = (float(limit.get(key, "0")) for key in ("lower", "upper"))
        except ValueError:
            continue
        if lower > upper:
            limit.set("lower", repr(upper))
            limit.set("upper", repr(lower))
            mended.append(str(joint.get("name")))
    if not mended:
        return []
    return [
        f"limits that are infinite, missing, negative or reversed are corrected, of joints "
        f"{quote_names(mended)}"
    ]
