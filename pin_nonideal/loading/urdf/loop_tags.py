"""Loops that URDF files declare by elements of other tools, which are not read."""

from __future__ import annotations

from xml.etree import ElementTree

from .repair import ROBOT

# Parts of the tags of loops: <loop_joint> and <drake:ball_constraint> of Drake, <loop> of several exporters.
WORDS = ("loop", "constraint")


def open_loops(root: ElementTree.Element) -> list[str]:
    """Return the loops that elements of other tools declare, such as `<loop_joint> "knee"`.

    These are elements whose tag contains a word of `WORDS`, and joints with two links inside <gazebo>.

    Args:
        root: `<robot>` element.
    """
    loops = []
    for element in root:
        if element.tag in ROBOT:
            continue
        if any(word in _local(element) for word in WORDS):
            loops.append(_words(element, _local(element)))
        elif _local(element) == "gazebo":
            joints = [j for j in element.iter("joint") if j.find("parent") is not None]
            loops += [_words(j, "joint> in <gazebo") for j in joints if j.find("child") is not None]
    return loops


def _local(element: ElementTree.Element) -> str:
    """Return the tag without its namespace or prefix."""
    return str(element.tag).rpartition("}")[2].rpartition(":")[2].lower()


def _words(element: ElementTree.Element, tag: str) -> str:
    name = element.get("name")
    return f"<{tag}>" if name is None else f'<{tag}> "{name}"'
