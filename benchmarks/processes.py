"""Python processes apart from this one, with the same packages."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pin_nonideal


def run_python(code: str, seconds: float | None = None) -> subprocess.CompletedProcess[str]:
    """Runs code in an interpreter of its own.

    Args:
        code: what to run.
        seconds: time limit.

    Returns:
        Its exit code and what it printed.

    Raises:
        subprocess.TimeoutExpired: it took longer.
    """
    # First the package that runs here: a checkout may have no compiled core in it.
    paths = [str(Path(pin_nonideal.__file__).resolve().parents[1]), *(path for path in sys.path if path)]
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPATH"] = os.pathsep.join(paths)
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=seconds,
        env=environment,
    )  # fmt: skip
