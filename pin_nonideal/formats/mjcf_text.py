"""What MJCF leaves unsaid: default classes and units."""

from __future__ import annotations

import math
from xml.etree import ElementTree


class Defaults:
    """Attributes that an element takes from its default class.

    Args:
        root: the `<mujoco>` element, before anything is moved in it.
    """

    def __init__(self, root: ElementTree.Element) -> None:
        self._classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        self._class_of: dict[ElementTree.Element, str] = {}
        for default in root.findall("default"):
            self._read(default, default.get("class") or "main", {})
            if default.get("class"):
                self._classes["main"] = self._classes[default.get("class", "main")]
        for section in root:
            if section.tag != "default":
                self._assign(section, "main")

    def _read(self, default: ElementTree.Element, name: str, inherited: dict[str, dict[str, str]]) -> None:
        own = {tag: dict(values) for tag, values in inherited.items()}
        for element in default:
            if element.tag != "default":
                own.setdefault(element.tag, {}).update(element.attrib)
        self._classes[name] = own
        for child in default.findall("default"):
            self._read(child, child.get("class", ""), own)

    def _assign(self, element: ElementTree.Element, inherited: str) -> None:
        for child in element:
            self._class_of[child] = child.get("class") or inherited
            self._assign(child, child.get("childclass") or inherited)

    def write_out(self, root: ElementTree.Element) -> None:
        """Gives every element of the file its attributes in full, and removes the default classes.

        Args:
            root: the `<mujoco>` element.
        """
        for element in self._class_of:
            if element.tag != "body":
                element.attrib.update(self.filled(element).attrib)
            for key in ("class", "childclass"):
                element.attrib.pop(key, None)
        for default in root.findall("default"):
            root.remove(default)

    def filled(self, element: ElementTree.Element, kind: str | None = None) -> ElementTree.Element:
        """A copy of the element with the attributes of its default class filled in.

        Args:
            element: an element of the file.
            kind: tag of its defaults; None for its own tag.
        """
        values = self._classes.get(self._class_of.get(element, "main"), {})
        return ElementTree.Element(element.tag, {**values.get(kind or element.tag, {}), **element.attrib})


def degrees_to_radians(root: ElementTree.Element) -> float:
    """Factor from the file's unit of angle to radians; MJCF's default is degrees."""
    compiler = root.find("compiler")
    return 1.0 if compiler is not None and compiler.get("angle") == "radian" else math.pi / 180.0
