"""Import of the scripts oracles/paper_*.py, which contain the formulas of the paper."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path


def example(name):
    """Import the script oracles/`name`.py once."""
    key = f"oracles_{name}"
    if key not in sys.modules:
        path = Path(__file__).parents[2] / "oracles" / f"{name}.py"
        spec = importlib.util.spec_from_file_location(key, path)
        sys.modules[key] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[key]
