"""pin_nonideal through its public interface."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import pin_nonideal as pn

from .base import Outcome, Setting, tolerances


class Package:
    """Adaptive methods of pn.simulate."""

    name = "pin_nonideal"
    title = "pin_nonideal"

    def missing(self) -> str | None:
        """Return the reason why the tool cannot run, or None."""
        return None

    def settings(self, problem: Any) -> list[Setting]:
        """Return the settings to try."""
        del problem
        return [
            Setting(method, f"rtol {rtol:.0e}", values={"rtol": rtol, "atol": rtol})
            for method, last in (("dop853", 13), ("dopri5", 8))
            for rtol in tolerances(2, last)
        ]

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """Return a function that runs the problem once from its start."""
        scene = problem.scene()
        scene.initial_state()
        settings = {"method": setting.family, "output_dt": problem.duration / samples, **setting.values}

        def run() -> Outcome:
            try:
                run = pn.simulate(scene, problem.duration, progress=False, **settings)
            except pn.PinNonidealError as error:
                return Outcome(None, 0, failure=f"{type(error).__name__}: {error}")
            if samples == 1:
                return Outcome(run.q[-1:], run.stats.steps, setting.steps, v=run.v[-1])
            places = [int(np.argmin(np.abs(run.t - t))) for t in problem.times]  # events are samples too
            return Outcome(run.q[places], run.stats.steps, setting.steps, v=run.v[-1])

        return run
