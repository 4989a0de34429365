"""Delayed torques of a sampled control: the samples of one run that have not acted yet."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

import numpy as np

from pin_nonideal.types import Array

# A sample: its time [s] and its torque, (nv,).
Sample = tuple[float, Array]


class DelayedTorque:
    """Function (t, q, v) -> tau that returns the torque of an earlier sample.

    One object serves one run, or the runs of a rollout, which start at the same time. A call at the start
    time begins a run without earlier samples.

    Args:
        function: checked function (t, q, v) -> tau of the controller.
        samples: number of samples by which a torque acts late.
        initial: torque before the first delayed one arrives, (nv,).
        t0: start time of the runs [s].
        by_thread: whether several threads run at once, each with runs of its own.
    """

    def __init__(
        self,
        function: Callable[..., object],
        samples: int,
        initial: Array,
        t0: float,
        by_thread: bool = False,
    ) -> None:
        self._function, self._samples, self._initial = function, samples, initial
        self._t0, self._by_thread = t0, by_thread
        self._lines: dict[int, deque[Sample]] = {}

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Sample the controller and return the torque that acts from now on, (nv,).

        Args:
            t: time [s].
            q: configuration, (nq,).
            v: velocity, (nv,).
        """
        tau = np.array(self._function(t, q, v))  # a copy, since the user may reuse the array
        line = self._line()
        if t == self._t0:
            line.clear()
        elif line and line[-1][0] == t:
            line.pop()
        line.append((t, tau))
        return line[0][1] if len(line) > self._samples else self._initial

    def begin(self, t0: float) -> None:
        """Discard all samples and begin a run.

        Args:
            t0: start time [s].
        """
        self._t0 = t0
        self._lines.clear()

    @property
    def pending(self) -> list[tuple[float, list[float]]]:
        """Samples that have not acted yet, or act now: times [s] and torques."""
        return [(t, tau.tolist()) for t, tau in self._line()]

    @pending.setter
    def pending(self, samples: list[tuple[float, list[float]]]) -> None:
        self._line().extend((float(t), np.array(tau, dtype=float)) for t, tau in samples)

    def _line(self) -> deque[Sample]:
        key = threading.get_ident() if self._by_thread else 0
        return self._lines.setdefault(key, deque(maxlen=self._samples + 1))
