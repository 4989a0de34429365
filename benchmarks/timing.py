"""Timing on a shared machine: batches, contestants in alternating rounds, minima, medians of ratios.

`clock` measures the processor time of the calling thread. Processor time equals wall time on an idle machine,
since tools run on one thread. On a busy machine, wall time would penalize long runs, which are preempted more
often.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import TypeVar

# Runs a number of evaluations and returns the time of one evaluation [s].
Batch = Callable[[int], float]
Name = TypeVar("Name", bound=Hashable)

clock = time.thread_time

# Length of one batch [s]: long compared with the clock's resolution, short compared with time slices.
BATCH_SECONDS = 1e-3


@dataclass(frozen=True)
class Times:
    """Times of one contestant [s], one for each round."""

    seconds: list[float]

    @property
    def best(self) -> float:
        """Return the minimum, the time without interference."""
        return min(self.seconds)


def per_call(function: Callable[[], object]) -> Batch:
    """Return a batch that calls a Python function in a loop."""

    def batch(count: int) -> float:
        begin = clock()
        for _ in range(count):
            function()
        return (clock() - begin) / count

    return batch


def counted(function: Callable[[int], object]) -> Batch:
    """Return a batch of compiled code with its own loop.

    Args:
        function: function that runs the given number of evaluations.
    """

    def batch(count: int) -> float:
        begin = clock()
        function(count)
        return (clock() - begin) / count

    return batch


def paired(
    contestants: dict[Name, Batch], rounds: int, batch_seconds: float = BATCH_SECONDS
) -> dict[Name, Times]:
    """Time all contestants in alternating rounds, so that interference affects them equally.

    Args:
        contestants: batches by name.
        rounds: number of turns of each contestant.
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
    """Return the median over the rounds of the time of `one` over the time of `other`."""
    return statistics.median(a / b for a, b in zip(one.seconds, other.seconds, strict=True))
