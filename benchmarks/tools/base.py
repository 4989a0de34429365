"""What a tool of the accuracy benchmark offers."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """End of one run.

    Attributes:
        q: configurations at the sample times as Pinocchio orders them, (k, nq); None when the run failed.
        steps: steps really made.
        asked: steps that a fixed step asks for; None for adaptive methods.
        failure: what went wrong, empty when nothing did.
        v: velocity at the end as Pinocchio orders it, (nv,).
    """

    q: Array | None
    steps: int
    asked: int | None = None
    failure: str = ""
    v: Array | None = None

    @property
    def complete(self) -> bool:
        """Whether the run reached its end with all its steps."""
        return not self.failure and self.q is not None and (self.asked is None or self.steps == self.asked)


@dataclass(frozen=True)
class Setting:
    """One way to run a tool.

    Attributes:
        family: method; settings of a family get finer from one to the next.
        label: the setting within its family.
        steps: fixed steps it takes; None for adaptive methods.
        values: what the tool needs to know.
    """

    family: str
    label: str
    steps: int | None = None
    values: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.family} {self.label}"


class Tool(Protocol):
    """A simulator.  `prepare` does what a user does once; what it returns is timed."""

    name: str
    title: str

    def missing(self) -> str | None:
        """Why it cannot run here, or None."""

    def settings(self, problem: Any) -> list[Setting]:
        """Settings worth trying; none when the tool cannot state the problem."""

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """A function that runs the problem once from its start.

        Args:
            problem: what to compute.
            setting: how.
            samples: configurations wanted, at equal times up to the end; 1 is timed, more tell the error.
        """


def needs(package: str) -> str | None:
    """Why a tool cannot run that needs an optional package."""
    return None if importlib.util.find_spec(package) else f"{package} is not installed"


def tolerances(first: int, last: int) -> list[float]:
    """From 10^-first to 10^-last by factors of about three, so that none wins by where its grid lies."""
    return [float(f"{10.0 ** (-0.5 * k):.0e}") for k in range(2 * first, 2 * last + 1)]
