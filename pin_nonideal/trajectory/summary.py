"""Summary of a run, as `print` shows it: duration, counters, energies and events."""

from __future__ import annotations

import numpy as np

from .fields import RunFields

# If there are more energy terms than this, only nonzero terms are shown.
MAX_TERMS = 20


def summary(run: RunFields) -> str:
    """Return the summary of a run, a line for each kind of data.

    Args:
        run: trajectory of the run.
    """
    s = run.stats
    span = f"{run.t[0]:g} to {run.t[-1]:g} s" if len(run.t) else "empty"
    lines = [
        f"{run.name or 'trajectory'}: {span}, {len(run.t)} samples",
        f"  steps {s.steps} ({s.rejected} rejected), evaluations {s.evaluations}, "
        f"projections {s.projections}, reaction passes {s.iterations}",
        f"  violation {run.violation.max(initial=0.0):.1e}, rate {run.violation_rate.max(initial=0.0):.1e}",
    ]
    if s.limited_by_rounding:
        lines.append(
            f"  limited by rounding: {s.limited_by_rounding} of {s.steps} steps; accelerations are known "
            f"to {s.rounding:.0e} of the largest"
        )
    if run.energy and len(run.t):
        at_end = {k: x[-1] for k, x in run.energy.items() if k != "balance"}
        shown = ", ".join(f"{k} {x:.6g}" for k, x in at_end.items() if x != 0.0 or len(at_end) <= MAX_TERMS)
        lines.append(f"  energy [J]: {shown}; balance {np.abs(run.energy['balance']).max():.1e}")
    if run.events:
        kinds = sorted({e.kind for e in run.events})
        counts = ", ".join(f"{sum(e.kind == k for e in run.events)} {k}" for k in kinds)
        lines.append(f"  events: {counts}")
    lines.append(f"  wall time {s.wall_s:.3g} s")
    lines += [f"  note: {note}" for note in run.notes]
    if run.failure:
        lines.append(f"  stopped early: {run.failure}")
    return "\n".join(lines)
