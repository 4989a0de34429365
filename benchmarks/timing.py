"""Timing on a machine that others use too: batches, contestants in turn, minima, medians of ratios.

`clock` counts the processor time of the calling thread.  On an idle machine that is wall time, since tools
run on one thread; on a busy one wall time would punish long runs, which lose the processor more often.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import TypeVar

# Runs a number of evaluations and returns the seconds of one.
Batch = Callable[[int], float]
Name = TypeVar("Name", bound=Hashable)

clock = time.thread_time

# Seconds of one batch: long against the clock's resolution, short against the machine's slices of time.
BATCH_SECONDS = 1e-3


@dataclass(frozen=True)
class Times:
    """Seconds of one contestant, one number a round."""

    seconds: list[float]

    @property
    def best(self) -> float:
        """The minimum: what it takes when nobody else interferes."""
        return min(self.seconds)


def per_call(function: Callable[[], object]) -> Batch:
    """A batch that calls a Python function in a loop."""

    def batch(count: int) -> float:
        begin = clock()
        for _ in range(count):
            function()
        return (clock() - begin) / count

    return batch


def counted(function: Callable[[int], object]) -> Batch:
    """A batch of compiled code that repeats by itself.

    Args:
        function: runs the given number of evaluations.
    """

    def batch(count: int) -> float:
        begin = clock()
        function(count)
        return (clock() - begin) / count

    return batch


def paired(
    contestants: dict[Name, Batch], rounds: int, batch_seconds: float = BATCH_SECONDS
) -> dict[Name, Times]:
    """Times all contestants in turn, `rounds` times, so that a slow moment hits them alike.

    Args:
        contestants: by name.
        rounds: how often everybody has a turn.
        batch_seconds: length of one turn [s].
    """
    counts = {}
    for name, batch in contestants.items():
        seconds_once = batch(1)  # warm-up
        if seconds_once < 10.0 * batch_seconds:
            seconds_once = min(batch(1) for _ in range(3))
        counts[name] = max(1, round(batch_seconds / max(seconds_once, 1e-7)))
    seconds: dict[Name, list[float]] = {name: [] for name in contestants}
    order = list(contestants)
    for _ in range(rounds):
        for name in order:
            seconds[name].append(contestants[name](counts[name]))
        order = order[1:] + order[:1]
    return {name: Times(values) for name, values in seconds.items()}


def ratio(one: Times, other: Times) -> float:
    """Median over the rounds of one's time over the other's."""
    return statistics.median(a / b for a, b in zip(one.seconds, other.seconds, strict=True))
