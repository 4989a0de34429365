"""YAML files as plain values, without execution of code and without ambiguous numbers."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pin_nonideal.errors import LoadingError
from pin_nonideal.loading.urdf.xml import read_text


def plain_yaml(path: Path) -> object:
    """Return the content of a YAML file: tables, lists, strings and numbers.

    Args:
        path: path of the file.

    Raises:
        LoadingError: the file is truncated or malformed, or has a tag, an anchor, a repeated key, or an octal
            or sexagesimal number.
    """
    import yaml

    try:
        return yaml.load(read_text(path), Loader=_loader())  # a SafeLoader: plain values only
    except yaml.YAMLError as error:
        raise LoadingError(f'"{path}" cannot be read as plain YAML: {_one_line(error)}') from None
    except RecursionError:
        raise LoadingError(f'"{path}" is nested too deeply; it must be a flat table') from None


def _loader() -> Any:
    """Return a yaml.SafeLoader that rejects repeated keys and anchors, and reads 1e-3 as a number."""
    import yaml

    class Loader(yaml.SafeLoader):
        def compose_node(self, parent: Any, index: Any) -> Any:
            event = self.peek_event()  # type: ignore[no-untyped-call]
            if getattr(event, "anchor", None) is not None:
                raise yaml.YAMLError(f"anchors and aliases are not read (line {event.start_mark.line + 1})")
            return super().compose_node(parent, index)

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            keys = set()
            for key, _ in node.value:
                if not isinstance(key, yaml.ScalarNode):
                    raise yaml.YAMLError(f"a key must be a word (line {key.start_mark.line + 1})")
                if key.value in keys:
                    raise yaml.YAMLError(f'key "{key.value}" appears twice (line {key.start_mark.line + 1})')
                keys.add(key.value)
            return super().construct_mapping(node, deep)

        def construct_scalar(self, node: Any) -> Any:
            surprising = re.fullmatch(
                r"[-+]?(0[0-7_]+|[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?)", str(node.value)
            )
            if surprising and node.style is None and node.tag.endswith((":int", ":float")):
                line = node.start_mark.line + 1
                raise yaml.YAMLError(
                    f"{node.value} is octal or sexagesimal in YAML (line {line}); write decimals, or a text"
                )
            return super().construct_scalar(node)

    number = re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
    Loader.add_implicit_resolver("tag:yaml.org,2002:float", number, list("-+.0123456789"))
    return Loader


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
