"""Seeds of a randomized test: five by default, all with -m slow."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

BY_DEFAULT = 5


def seeds(every: Iterable[int], always: Iterable[int] = (), count: int = BY_DEFAULT) -> list[Any]:
    """Return parameters of a test: the first seeds and the `always` seeds; the others are marked slow.

    Args:
        every: all seeds.
        always: additional seeds of a default run, each with a reason at the call.
        count: number of seeds of a default run; fewer than five for slow tests, more for fast ones.
    """
    listed, kept = list(every), set(always)
    kept |= set([seed for seed in listed if seed not in kept][: count - len(kept)])
    return [seed if seed in kept else pytest.param(seed, marks=pytest.mark.slow) for seed in listed]


def ranges(few: int, many: int, most: int | None = None) -> list[Any]:
    """Return parameters of a test of many seeds: few by default, many if slow, most under stress."""
    every = [
        pytest.param(range(few), id=str(few)),
        pytest.param(range(many), id=str(many), marks=pytest.mark.slow),
    ]
    if most is not None:
        every.append(pytest.param(range(most), id=str(most), marks=pytest.mark.stress))
    return every
