"""Seeds of a property: ten by default, all with -m slow."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

BY_DEFAULT = 10


def seeds(every: Iterable[int], always: Iterable[int] = (), count: int = BY_DEFAULT) -> list[Any]:
    """Parameters of a test: the first few seeds, and those that must always run; the others are slow.

    Args:
        every: all seeds.
        always: more of them that a default run takes in, each for a reason told where it stands.
        count: how many a default run takes; fewer than ten where each takes long.
    """
    listed, kept = list(every), set(always)
    kept |= set([seed for seed in listed if seed not in kept][: count - len(kept)])
    return [seed if seed in kept else pytest.param(seed, marks=pytest.mark.slow) for seed in listed]


def ranges(few: int, many: int, most: int | None = None) -> list[Any]:
    """Parameters of a test of many seeds at once: few by default, many when slow, most under stress."""
    every = [
        pytest.param(range(few), id=str(few)),
        pytest.param(range(many), id=str(many), marks=pytest.mark.slow),
    ]
    if most is not None:
        every.append(pytest.param(range(most), id=str(most), marks=pytest.mark.stress))
    return every
