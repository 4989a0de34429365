"""Elements and attributes of URDF, and notes on unknown ones, for example misspelled words."""

from __future__ import annotations

from collections import Counter
from xml.etree import ElementTree

# Permitted elements of each element; only shapes can occur several times.
CHILDREN: dict[str, tuple[str, ...]] = {
    "link": ("inertial", "visual", "collision"),
    "inertial": ("origin", "mass", "inertia"),
    "visual": ("origin", "geometry", "material"),
    "collision": ("origin", "geometry"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "joint": ("name", "type"),
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "parent": ("link",),
    "child": ("link",),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"),
    "dynamics": ("damping", "friction"),
    "mimic": ("joint", "multiplier", "offset"),
}
REPEATABLE_TAGS = ("visual", "collision", "material")
# Entries of the other triangle, which some tools write; each is equal to the symmetric entry.
TRANSPOSED_ENTRIES = {"iyx": "ixy", "izx": "ixz", "izy": "iyz"}


def unread_notes(root: ElementTree.Element) -> list[str]:
    """Return notes on elements and attributes of links and joints that have no effect.

    Args:
        root: `<robot>` element.
    """
    unknown: dict[str, None] = {}
    misspelt: dict[str, None] = {}
    repeated: dict[str, None] = {}
    for top in (*root.findall("link"), *root.findall("joint")):
        where = f'{top.tag} "{top.get("name")}"'
        for element in _urdf_elements(top):
            counts = Counter(str(child.tag) for child in element)
            inside = f"<{element.tag}>"
            unknown |= {f"<{tag}> in {inside}": None for tag in counts if tag not in _may_hold(element)}
            twice = [tag for tag, n in counts.items() if n > 1 and tag not in REPEATABLE_TAGS]
            repeated |= {f"<{tag}> in {where}": None for tag in twice if tag in _may_hold(element)}
            misspelt |= {f"{key} in {inside}": None for key in element.attrib if not _is_known(element, key)}
    notes = []
    if unknown:
        notes.append(f"elements that play no part here are not read: {', '.join(unknown)}")
    if misspelt:
        notes.append(f"attributes that URDF does not have are not read: {', '.join(misspelt)}")
    if repeated:
        notes.append(f"elements are ignored after the first of their kind: {', '.join(repeated)}")
    return notes


def _urdf_elements(top: ElementTree.Element) -> list[ElementTree.Element]:
    """Return an element and its URDF elements, without shapes."""
    below = [
        child for child in top if child.tag in CHILDREN.get(str(top.tag), ()) and child.tag != "material"
    ]
    return [top, *(element for child in below for element in _urdf_elements(child))]


def _may_hold(element: ElementTree.Element) -> tuple[str, ...]:
    return CHILDREN.get(str(element.tag), tuple(str(child.tag) for child in element))


def _is_known(element: ElementTree.Element, key: str) -> bool:
    if element.tag == "inertia" and key in TRANSPOSED_ENTRIES:
        return element.get(key) == element.get(TRANSPOSED_ENTRIES[key])
    return key in ATTRIBUTES.get(str(element.tag), (key,))
