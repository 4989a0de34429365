"""Stored references with a checksum of their problem; the computation takes seconds.

`python -m benchmarks references` recomputes all references and writes the file.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from .references import Reference

STORE = Path(__file__).resolve().parent / "references.json"
SAME = 1e-12  # relative tolerance of the checksum for rounding of the initial state


def checksum(problem: Any) -> float:
    """Return a number that depends on model, initial state, duration, torques, gains and friction."""
    model = problem.model
    parts = [problem.q0, problem.v0, [problem.duration], model.gravity.linear]
    for place, body in zip(model.jointPlacements, model.inertias, strict=True):
        parts += [place.rotation.ravel(), place.translation, [body.mass], body.lever, body.inertia.ravel()]
    for extra in (problem.torque, problem.coulomb, problem.viscous, *(problem.hold or ())):
        parts.append(np.zeros(0) if extra is None else extra)
    numbers = np.concatenate([np.asarray(part, dtype=float) for part in parts])
    return float(np.random.default_rng(1).uniform(1.0, 2.0, len(numbers)) @ np.abs(numbers))


def read(problem: Any) -> Reference | None:
    """Return the stored reference of the problem, or None if its checksum differs."""
    if not STORE.is_file():
        return None
    entry = json.loads(STORE.read_text()).get(problem.name)
    if entry is None or abs(entry["checksum"] - checksum(problem)) > SAME * abs(entry["checksum"]):
        return None
    return Reference(np.array(entry["q"]), entry["uncertainty"], entry["how"])


def write(problems: list[Any]) -> None:
    """Compute the references of problems and write them."""
    entries = {}
    for problem in problems:
        reference = problem.reference(problem)
        entries[problem.name] = {
            "how": reference.how, "uncertainty": reference.uncertainty, "checksum": checksum(problem),
            "q": reference.q.tolist(),
        }  # fmt: skip
        print(f"{problem.name}: uncertainty {reference.uncertainty:.0e}, {reference.how}", flush=True)
    STORE.write_text(json.dumps(entries, indent=1) + "\n")
