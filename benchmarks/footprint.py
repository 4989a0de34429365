"""Time and memory of the import of each tool, in a new interpreter."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pin_nonideal as pn

MODULES = {
    "numpy": "numpy",
    "pinocchio": "pinocchio",
    "pin_nonideal": "pin_nonideal",
    "Pinocchio + SciPy": "pinocchio, scipy.integrate",
    "MuJoCo": "mujoco",
    "Exudyn": "exudyn",
    "Drake": "pydrake.all",
}

SCRIPT = """
import json, pathlib, resource, time

def resident():
    statm = pathlib.Path("/proc/self/statm")  # elsewhere the largest size must do
    if statm.is_file():
        return int(statm.read_text().split()[1]) * resource.getpagesize()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

begin, before = time.process_time(), resident()
import {modules}
print(json.dumps([time.process_time() - begin, resident() - before]))
"""


def one(modules: str) -> tuple[float, float]:
    """Return processor time [s] and bytes of an import in a new interpreter, with compiled Python files."""
    # The package of this process is first on the path: a checkout may have no compiled core.
    paths = [str(Path(pn.__file__).resolve().parents[1]), *(path for path in sys.path if path)]
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPATH"] = os.pathsep.join(paths)
    code = SCRIPT.format(modules=modules)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    seconds, size = json.loads(done.stdout.splitlines()[-1])
    return seconds, size


def measure(quick: bool, say: Callable[[str], None] = print) -> list[dict[str, Any]]:
    """Measure all installed modules in alternating rounds; minima are without reads from the disk."""
    here = {
        name: modules
        for name, modules in MODULES.items()
        if all(importlib.util.find_spec(m.strip().partition(".")[0]) for m in modules.split(","))
    }
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in here}
    for _ in range(2 if quick else 6):
        for name, modules in here.items():
            found[name].append(one(modules))
    rows = []
    for name, runs in found.items():
        seconds, size = (min(values) for values in zip(*runs, strict=True))
        rows.append({"tool": name, "import_seconds": seconds, "import_bytes": size})
        say(f"  {name}: {seconds * 1e3:.0f} ms, {size / 2**20:.0f} MiB")
    return rows
