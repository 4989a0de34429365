"""XML files as text, elements and numbers; error messages name the position."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from pin_nonideal.errors import LoadingError

# Numbers that all readers of such files accept; Python's float also accepts 1_000 and digits of other
# scripts.
NUMBER = re.compile(r"[-+]?((\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|inf|infinity|nan)", re.ASCII | re.IGNORECASE)
UNDECLARED_NAMESPACE = "unbound:"  # namespace of prefixes that a file does not declare


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        LoadingError: the file cannot be read, or is not text.
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
    """Return the root element of an XML file.

    Raises:
        LoadingError: the file is truncated or malformed, declares entities, or has another root.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise LoadingError(f'"{path}" must not declare a DOCTYPE or entities; remove them')
    try:
        element = ElementTree.fromstring(_declare_prefixes(text, root))
    except ElementTree.ParseError as error:
        raise LoadingError(f'"{path}" is truncated or not XML: {error}; export it again') from None
    if element.tag != root:
        raise LoadingError(f'"{path}" must have the root element <{root}>; got <{element.tag}>')
    return element


def _declare_prefixes(text: str, root: str) -> str:
    """Declare all undeclared prefixes of tags and attributes, which some tools write, in the root element."""
    used = set(re.findall(r"</?([\w.-]+):[\w.-]", text)) | set(re.findall(r"\s([\w.-]+):[\w.-]+\s*=", text))
    declared = set(re.findall(r"xmlns:([\w.-]+)\s*=", text))
    unbound = sorted(used - declared - {"xmlns", "xml"})
    names = "".join(f' xmlns:{prefix}="{UNDECLARED_NAMESPACE}{prefix}"' for prefix in unbound)
    return re.sub(rf"<{root}(?=[\s/>])", f"<{root}{names}", text, count=1) if unbound else text


def quote_names(names: Iterable[str]) -> str:
    """Return up to four quoted names, and the number of the remaining ones.

    Args:
        names: names; repeated names count once.
    """
    once = list(dict.fromkeys(names))
    return ", ".join(f'"{name}"' for name in once[:4]) + (f" and {len(once) - 4} more" if once[4:] else "")


def numbers(
    element: ElementTree.Element | None, key: str, size: int, default: Sequence[float] | None, where: str
) -> Any:
    """Return the finite numbers of an XML attribute.

    Args:
        element: element, or None.
        key: name of the attribute.
        size: required number of values.
        default: values if the element or attribute is missing; None if it is required.
        where: prefix of error messages.

    Raises:
        LoadingError: a required value is missing, or the values are not finite numbers of this count.
    """
    text = None if element is None else element.get(key)
    if text is None:
        if default is None:
            inside = "" if element is None else f" in <{element.tag}>"
            raise LoadingError(f"{where}: {key} is missing{inside}")
        return np.array(default, dtype=float)
    if not all(NUMBER.fullmatch(x) for x in text.split()):
        raise LoadingError(f'{where}: {key} must hold numbers; got "{text}"')
    values = np.array([float(x) for x in text.split()])
    if values.size != size:
        raise LoadingError(f'{where}: {key} must hold {size} number{"s" if size > 1 else ""}; got "{text}"')
    if not np.isfinite(values).all():
        raise LoadingError(f'{where}: {key} must be finite; got "{text}"')
    return values
