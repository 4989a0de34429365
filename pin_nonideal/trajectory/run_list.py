"""Lists of runs that notebooks show as tables."""

from __future__ import annotations

from typing import Any

from pin_nonideal import html_tables
from pin_nonideal.errors import PinNonidealError

from .trajectory import Trajectory

MAX_ROWS = 20  # runs of a table


class RunList(list[Any]):
    """Runs of a rollout or sweep, or their errors, in order. A notebook shows the first ones as a table."""

    def _repr_html_(self) -> str:
        header = ("run", "end [s]", "samples", "steps", "largest violation [m, rad]", "stopped by")
        rows = [(k, *_cells(run)) for k, run in enumerate(self[:MAX_ROWS])]
        more = f", the first {MAX_ROWS}" if len(self) > MAX_ROWS else ""
        return html_tables.table(f"{len(self)} runs{more}", rows, header)


def _cells(run: Trajectory | PinNonidealError) -> tuple[object, ...]:
    """Return the cells of a run, or of the trajectory and the message of an error."""
    if isinstance(run, PinNonidealError):
        return *_numbers(getattr(run, "trajectory", None)), f"{type(run).__name__}: {run}"
    return *_numbers(run), run.failure or ""


def _numbers(run: Trajectory | None) -> tuple[object, ...]:
    """Return end time, samples, steps and largest violation; empty cells without samples."""
    if run is None or not len(run.t):
        return "", 0, 0, ""
    return f"{run.t[-1]:g}", len(run.t), run.stats.steps, f"{float(run.violation.max()):.1e}"
