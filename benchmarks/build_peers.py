"""Build of the C++ peer modules in a cache folder, and their import."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import sysconfig
from functools import cache
from pathlib import Path
from types import ModuleType

SOURCE = Path(__file__).resolve().parent / "peers_cpp"
CACHE = SOURCE.parent.parent / "build" / "benchmarks" / f"peers-{sysconfig.get_config_var('SOABI')}"
NAMES = ("pinocchio_wheel", "pinocchio_headers")


def build() -> int:
    """Configure and compile the peer modules; takes some minutes.

    Returns:
        The exit code of CMake.
    """
    CACHE.mkdir(parents=True, exist_ok=True)
    paths = (
        f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"  # ninja of the environment
    )
    environment = os.environ | {"PATH": paths}
    configure = ["cmake", "-S", str(SOURCE), "-B", str(CACHE), f"-DPython_EXECUTABLE={sys.executable}"]
    for words in (configure, ["cmake", "--build", str(CACHE)]):
        status = subprocess.run(words, env=environment, check=False).returncode
        if status:
            return status
    return 0


@cache
def load(name: str) -> ModuleType | None:
    """Return a peer module of the cache folder, or None if it is not built."""
    path = CACHE / f"{name}{sysconfig.get_config_var('EXT_SUFFIX')}"
    if not path.is_file():
        return None
    import pinocchio  # noqa: F401  registers its types first

    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        return None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
