"""Compile time of the core: processor time, wall time and memory of the sources of each target."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

SOURCE = Path(__file__).resolve().parent.parent / "pin_nonideal" / "_core"
LAUNCHER = Path(__file__).resolve().parent / "measured.py"


def build() -> int:
    """Compile the core in a temporary folder, on all processors, and print a table.

    Returns:
        The exit code of CMake.
    """
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}",  # its ninja
        "CCACHE_DISABLE": "1",
    }
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "units.jsonl"
        launcher = f"{sys.executable};-SE;{LAUNCHER};{log}"
        configure = ["cmake", "-S", str(SOURCE), "-B", folder, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"]
        configure += [f"-DPython_EXECUTABLE={sys.executable}"]
        configure += [f"-DCMAKE_CXX_{step}_LAUNCHER={launcher}" for step in ("COMPILER", "LINKER")]
        status = subprocess.run(configure, env=environment, check=False, stdout=subprocess.DEVNULL).returncode
        if status:
            return status
        log.unlink(missing_ok=True)  # entries of CMake's compiler checks
        begin = time.monotonic()
        status = subprocess.run(["cmake", "--build", folder], env=environment, check=False).returncode
        wall = time.monotonic() - begin
        if status:
            return status
        print(table([json.loads(line) for line in log.read_text().splitlines()], wall))
    return 0


def table(units: list[dict[str, float | str]], wall: float) -> str:
    """Return sums by target of the core, as text. Most targets are the sources of one folder.

    Args:
        units: output, processor and wall time [s] and peak memory [MB] of each compiler call.
        wall: time of the whole build [s].
    """
    rooms = defaultdict(list)
    for unit in units:
        rooms[room_of(str(unit["output"]))].append(unit)
    lines = [f"{'room':<22}{'units':>6}{'processor [s]':>15}{'wall [s]':>10}{'memory [MB]':>13}  slowest"]
    ordered = sorted(rooms.items(), key=lambda item: -total(item[1], "processor"))
    for name, those in [*ordered, ("all", units)]:
        slowest = max(those, key=lambda unit: float(unit["processor"]))
        lines.append(
            f"{name:<22}{len(those):>6}{total(those, 'processor'):>15.1f}{total(those, 'wall'):>10.1f}"
            f"{max(float(unit['memory']) for unit in those):>13.0f}"
            f"  {Path(str(slowest['output'])).name} {float(slowest['processor']):.1f} s"
        )
    lines.append(f"whole build: {wall:.0f} s on {os.cpu_count()} processors")
    return "\n".join(lines)


def total(units: list[dict[str, float | str]], key: str) -> float:
    return sum(float(unit[key]) for unit in units)


def room_of(output: str) -> str:
    """Return the target of the core that an object file belongs to, from its path."""
    if not output.endswith(".o"):
        return "precompiled headers" if output.endswith((".gch", ".pch")) else "link"
    if "nanobind" in output:
        return "nanobind"
    return output.partition("CMakeFiles/")[2].partition(".dir/")[0]
