"""Oracles, one thread of BLAS, default handling of Ctrl-C, fewer parameters to collect, and written files."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import settings

DEFAULT_SELECTION = "not slow and not stress"  # as in pyproject.toml

# Set before the first import of numpy: the workers of the tests use all cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# No test depends on the load of the machine.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

# Shells make background processes and their children ignore Ctrl-C.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _import_oracles() -> None:
    """Import `oracles` from its folder: the checkout on sys.path would hide the installed package."""
    file = Path(__file__).resolve().parent.parent / "oracles" / "__init__.py"
    spec = importlib.util.spec_from_file_location("oracles", file)
    assert spec is not None
    assert spec.loader is not None
    sys.modules["oracles"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)


_import_oracles()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Drop parameters that the default selection leaves out: the collection of 36,000 items takes long."""
    if metafunc.config.option.markexpr != DEFAULT_SELECTION:
        return
    for mark in metafunc.definition.iter_markers("parametrize"):
        values = mark.args[1] if len(mark.args) > 1 else None
        if isinstance(values, list):
            values[:] = [value for value in values if not _is_left_out(value)] or values[:1]


def _is_left_out(value: object) -> bool:
    return any(mark.name in ("slow", "stress") for mark in getattr(value, "marks", ()))


@pytest.fixture
def kept(monkeypatch):
    """Return a list of every file that a run writes, in order."""
    from pin_nonideal.simulation import checkpoint

    written = []

    @contextlib.contextmanager
    def keep(path, what):
        content = io.BytesIO()
        yield content
        written.append(content.getvalue())
        path.write_bytes(written[-1])

    monkeypatch.setattr(checkpoint, "whole_file", keep)
    return written
