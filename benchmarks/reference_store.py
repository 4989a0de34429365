"""References, which take seconds to compute, kept beside the code with a checksum of their problem.

`python -m benchmarks references` computes all of them anew and writes the file.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from .references import Reference

STORE = Path(__file__).resolve().parent / "references.json"
SAME = 1e-12  # relative change of the checksum that rounding in the initial state may make


def checksum(problem: Any) -> float:
    """A number that changes with everything that decides the motion."""
    model = problem.model
    parts = [problem.q0, problem.v0, [problem.duration], model.gravity.linear]
    for place, body in zip(model.jointPlacements, model.inertias, strict=True):
        parts += [place.rotation.ravel(), place.translation, [body.mass], body.lever, body.inertia.ravel()]
    for extra in (problem.torque, problem.coulomb, problem.viscous, *(problem.hold or ())):
        parts.append(np.zeros(0) if extra is None else extra)
    numbers = np.concatenate([np.asarray(part, dtype=float) for part in parts])
    return float(np.random.default_rng(1).uniform(1.0, 2.0, len(numbers)) @ np.abs(numbers))


def read(problem: Any) -> Reference | None:
    """The stored reference, when there is one for just this problem."""
    if not STORE.is_file():
        return None
    entry = json.loads(STORE.read_text()).get(problem.name)
    if entry is None or abs(entry["checksum"] - checksum(problem)) > SAME * abs(entry["checksum"]):
        return None
    return Reference(np.array(entry["q"]), entry["uncertainty"], entry["how"])


def write(problems: list[Any]) -> None:
    """Computes the references of problems and writes them."""
    entries = {}
    for problem in problems:
        reference = problem.reference(problem)
        entries[problem.name] = {
            "how": reference.how, "uncertainty": reference.uncertainty, "checksum": checksum(problem),
            "q": reference.q.tolist(),
        }  # fmt: skip
        print(f"{problem.name}: uncertainty {reference.uncertainty:.0e}, {reference.how}", flush=True)
    STORE.write_text(json.dumps(entries, indent=1) + "\n")
