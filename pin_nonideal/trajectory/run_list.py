"""Lists of runs that notebooks show as tables."""

from __future__ import annotations

from typing import Any

from pin_nonideal import html_tables

MAX_ROWS = 20  # runs of a table


class RunList(list[Any]):
    """Runs of a rollout or sweep, or their errors, in order. A notebook shows the first ones as a table."""

    def _repr_html_(self) -> str:
        header = ("run", "end [s]", "samples", "steps", "largest violation [m, rad]", "stopped by")
        rows = [(k, *_cells(run)) for k, run in enumerate(self[:MAX_ROWS])]
        more = f", the first {MAX_ROWS}" if len(self) > MAX_ROWS else ""
        return html_tables.table(f"{len(self)} runs{more}", rows, header)


def _cells(run: Any) -> tuple[object, ...]:
    """Return the cells of a run, or of the trajectory and the message of an error."""
    error = run if isinstance(run, Exception) else None
    trajectory = getattr(run, "trajectory", None) if error else run
    reason = getattr(trajectory, "failure", None) or (
        "" if error is None else f"{type(error).__name__}: {error}"
    )
    if trajectory is None or not len(trajectory.t):
        return "", 0, 0, "", reason
    violation = f"{float(trajectory.violation.max()):.1e}"
    return f"{trajectory.t[-1]:g}", len(trajectory.t), trajectory.stats.steps, violation, reason
