"""Interface of a tool of the accuracy benchmark."""

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
    """Result of one run.

    Attributes:
        q: configurations at the sample times in Pinocchio's order, (k, nq); None if the run failed.
        steps: number of completed steps.
        asked: number of steps of a fixed-step method; None for adaptive methods.
        failure: failure message, empty if there is none.
        v: velocity at the end in Pinocchio's order, (nv,).
    """

    q: Array | None
    steps: int
    asked: int | None = None
    failure: str = ""
    v: Array | None = None

    @property
    def complete(self) -> bool:
        """Check if the run reached its end with all its steps."""
        return not self.failure and self.q is not None and (self.asked is None or self.steps == self.asked)


@dataclass(frozen=True)
class Setting:
    """Setting of a tool.

    Attributes:
        family: method; the settings of a family are ordered from coarse to fine.
        label: name of the setting within its family.
        steps: number of fixed steps; None for adaptive methods.
        values: parameters of the tool.
    """

    family: str
    label: str
    steps: int | None = None
    values: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.family} {self.label}"


class Tool(Protocol):
    """Simulator.  `prepare` does the setup of a problem and returns the function that is timed."""

    name: str
    title: str

    def missing(self) -> str | None:
        """Return the reason why the tool cannot run, or None."""

    def settings(self, problem: Any) -> list[Setting]:
        """Return the settings to try; empty if the tool cannot represent the problem."""

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """Return a function that runs the problem once from its start.

        Args:
            problem: problem to compute.
            setting: setting of the tool.
            samples: number of configurations at equidistant times; 1 for timing, more for the error.
        """


def needs(package: str) -> str | None:
    """Return the reason why a tool cannot run without an optional package, or None."""
    return None if importlib.util.find_spec(package) else f"{package} is not installed"


def tolerances(first: int, last: int) -> list[float]:
    """Return tolerances from 10^-first to 10^-last by factors of about three."""
    return [float(f"{10.0 ** (-0.5 * k):.0e}") for k in range(2 * first, 2 * last + 1)]
