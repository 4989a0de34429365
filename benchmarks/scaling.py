"""Cost of one evaluation against the number of loops: N four-bars, each crank a separate branch.

All sizes of all tools are timed in the same rounds, so that the exponent comes from paired times.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from typing import Any

import pin_nonideal as pn

from . import cases, timing
from .evaluation import compiled_batches, mujoco_batch, our_batch

SIZES = (1, 2, 5, 10, 20, 40, 80, 160, 320, 640)
QUICK = (1, 5, 20, 40, 160)
# Pinocchio's constraintDynamics has a dense factorization, and its Data contains tensors of nv^3 numbers.
LARGEST_DENSE = 80
FIT_FROM = 40
BATCH_SECONDS = 0.02  # long enough for many evaluations of the largest size, as in a run
OURS, RIVAL = "pin_nonideal", "mujoco mj_forward"


def batches_of(size: int) -> dict[str, timing.Batch]:
    """Return the evaluations of all tools for one size."""
    case = cases.n_four_bar(size)
    batches = {OURS: our_batch(case.scene(), case.q0, case.v0)}
    rival = mujoco_batch(case)
    if rival is not None:
        batches[RIVAL] = rival
    return batches | (compiled_batches(case) if size <= LARGEST_DENSE else {})


def exponent(small: timing.Times, large: timing.Times, growth: float) -> float:
    """Return the exponent of the cost: log(cost) over log(N), median over the rounds."""
    pairs = zip(small.seconds, large.seconds, strict=True)
    return statistics.median(math.log(b / a) for a, b in pairs) / math.log(growth)


def measure(quick: bool, say: Callable[[str], None] = print) -> dict[str, Any]:
    """Measure all sizes."""
    batches: dict[tuple[str, int], timing.Batch] = {}
    failures: dict[int, str] = {}
    for size in QUICK if quick else SIZES:
        try:
            batches |= {(name, size): batch for name, batch in batches_of(size).items()}
        except (pn.PinNonidealError, MemoryError) as error:
            failures[size] = f"failed: {type(error).__name__}: {error}"
    times = timing.paired(batches, 5 if quick else 25, BATCH_SECONDS)
    rows = []
    for size in QUICK if quick else SIZES:
        found = {name: t for (name, n), t in times.items() if n == size}
        row: dict[str, Any] = {"N": size, "status": failures.get(size, "ok")}
        rows.append(row)
        if size in failures:
            say(f"  N = {size}: {failures[size]}")
            continue
        row["seconds"] = {name: t.best for name, t in found.items()}
        row["ratio"] = {name: timing.ratio(found[OURS], t) for name, t in found.items() if name != OURS}
        shown = ", ".join(f"{name} {t.best * 1e6:.2f}" for name, t in found.items())
        say(f"  N = {size}: {shown} us")
    largest = max((row["N"] for row in rows if row["status"] == "ok"), default=0)
    slopes = {
        name: exponent(times[name, FIT_FROM], times[name, largest], largest / FIT_FROM)
        for name in (OURS, RIVAL)
        if (name, FIT_FROM) in times and largest > FIT_FROM
    }
    say(f"  exponents from N = {FIT_FROM}: " + ", ".join(f"{k} {v:.2f}" for k, v in slopes.items()))
    return {"sizes": rows, "exponents": slopes, "fit_from": FIT_FROM}
