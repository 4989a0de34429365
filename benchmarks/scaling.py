"""Cost of one evaluation against the number of loops: N four-bars side by side, each crank its own branch.

Every size runs in a process of its own with a limit of memory: what a size cannot do is recorded and
spoils no other.
"""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Callable
from typing import Any

import numpy as np

from .processes import run_python

SIZES = (1, 2, 5, 10, 20, 40, 80, 160, 320, 640)
QUICK = (1, 5, 20, 40, 80)
# Pinocchio's constraintDynamics factors all rows densely, and its Data holds tensors of nv^3 numbers.
LARGEST_DENSE = 80
FIT_FROM = 40
MEMORY_GIB = 12
SECONDS = 300


def one(size: int, rounds: int) -> dict[str, Any]:
    """Times of one size, in this process."""
    from . import cases, timing
    from .evaluation import compiled_batches, mujoco_batch, our_batch

    case = cases.n_four_bar(size)
    batches = {"pin_nonideal": our_batch(case.scene(), case.q0, case.v0)}
    rival = mujoco_batch(case)
    if rival is not None:
        batches["mujoco mj_forward"] = rival
    if size <= LARGEST_DENSE:
        batches |= compiled_batches(case)
    times = timing.paired(batches, rounds)
    result: dict[str, Any] = {
        "N": size,
        "nv": case.model.nv,
        "seconds": {k: t.best for k, t in times.items()},
    }
    for name in times:
        if name != "pin_nonideal":
            result.setdefault("ratio", {})[name] = timing.ratio(times["pin_nonideal"], times[name])
    return result


def apart(size: int, rounds: int) -> dict[str, Any]:
    """Times of one size, in a process of its own."""
    code = (
        "import json, resource, sys; "
        f"resource.setrlimit(resource.RLIMIT_AS, ({MEMORY_GIB} << 30, {MEMORY_GIB} << 30)); "
        f"from benchmarks.scaling import one; print(json.dumps(one({size}, {rounds})))"
    )
    try:
        done = run_python(code, SECONDS)
    except subprocess.TimeoutExpired:
        return {"N": size, "status": f"failed: more than {SECONDS} s"}
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        return {"N": size, "status": f"failed: {lines[-1] if lines else f'exit code {done.returncode}'}"}
    return {**json.loads(done.stdout.splitlines()[-1]), "status": "ok"}


def exponent(rows: list[dict[str, Any]], tool: str, first: int) -> float | None:
    """Slope of log(seconds) over log(N) from `first` on."""
    points = [(r["N"], r["seconds"][tool]) for r in rows if r["N"] >= first and tool in r.get("seconds", {})]
    if len(points) < 2:
        return None
    slope = np.polyfit(*np.log(np.array(points)).T, 1)[0]
    return float(slope) if math.isfinite(slope) else None


def measure(quick: bool, say: Callable[[str], None] = print) -> dict[str, Any]:
    """All sizes."""
    rows = []
    for size in QUICK if quick else SIZES:
        row = apart(size, 15 if quick else 60)
        rows.append(row)
        if row["status"] == "ok":
            shown = ", ".join(f"{name} {t * 1e6:.2f}" for name, t in row["seconds"].items())
            say(f"  N = {size}: {shown} us")
        else:
            say(f"  N = {size}: {row['status']}")
    tools = ("pin_nonideal", "mujoco mj_forward")
    slopes = {tool: exponent(rows, tool, FIT_FROM) for tool in tools}
    say("  exponents from N = 40: " + ", ".join(f"{k} {v:.2f}" for k, v in slopes.items() if v is not None))
    return {"sizes": rows, "exponents": slopes, "fit_from": FIT_FROM}
