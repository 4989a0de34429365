"""Defects that the symmetries show and that are mended elsewhere: an entry leaves with its defect."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Known:
    """A defect.

    Attributes:
        reason: in plain words.
        example: scene, transformation and function that show it.
        scenes, transformations, functions: where else it shows, as regular expressions of the whole name.
    """

    reason: str
    example: tuple[str, str, str]
    scenes: str = ".*"
    transformations: str = ".*"
    functions: str = ".*"
    marks: tuple[Any, ...] = ()

    def covers(self, scene: str, transformation: str, function: str) -> bool:
        parts = zip(
            (self.scenes, self.transformations, self.functions),
            (scene, transformation, function),
            strict=True,
        )
        return all(re.fullmatch(pattern, text) for pattern, text in parts)


KNOWN: list[Known] = []
