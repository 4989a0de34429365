"""`import pin_nonideal`: light, and refused with a reason when the compiled core does not fit."""

from __future__ import annotations

import json
import subprocess
import sys
import types
from importlib import metadata
from pathlib import Path
from typing import Any

import pinocchio
import pytest

import pin_nonideal as pn
from pin_nonideal import core_loader as compiled

AGAIN = "pip install 'pin==4.1.*' brings the Pinocchio that it needs"
HEAVY = ["IPython", "joblib", "matplotlib", "meshcat", "scipy", "tqdm", "yaml"]
# Optional modules of this package: readers of robots, files of runs.
LATER = ["pin_nonideal.loading", "pin_nonideal.trajectory.file"]


def test_import_is_light() -> None:
    code = "import json, sys, pin_nonideal; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert sorted(set(json.loads(done.stdout)) & set(LATER)) == []
    loaded = {name.split(".")[0] for name in json.loads(done.stdout)}
    assert "pinocchio" in loaded
    # Imports of Pinocchio itself are excluded.
    done = subprocess.run(
        [sys.executable, "-c", code.replace("pin_nonideal", "pinocchio")],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded -= {name.split(".")[0] for name in json.loads(done.stdout)}
    assert sorted(loaded & set(HEAVY)) == []


def test_one_version() -> None:
    root = Path(__file__).resolve().parents[2]
    assert metadata.version("pin-nonideal") == pn.__version__
    assert f"version: {pn.__version__}\n" in (root / "CITATION.cff").read_text(encoding="utf-8")


def test_what_completion_shows() -> None:
    assert set(dir(pn)) == {*pn.__all__, "__version__"}
    assert all(hasattr(pn, name) for name in dir(pn))


class TestCore:
    """Every way in which the compiled core can be missing or wrong."""

    FOLDER = Path(compiled.__file__).parent

    def refuse(self, monkeypatch: pytest.MonkeyPatch, result: Any) -> str:
        def import_module(name: str) -> Any:
            assert name == "pin_nonideal._core"
            if isinstance(result, Exception):
                raise result
            return result

        monkeypatch.setattr(compiled.importlib, "import_module", import_module)
        with pytest.raises(ImportError) as caught:
            compiled.load_core()
        return str(caught.value)

    def missing(self) -> str:
        return (
            f"the compiled core of pin_nonideal is missing in {self.FOLDER}: this is the source folder, "
            'imported because Python runs in its parent; run "pip install -e ." there, or start Python in '
            "another folder"
        )

    def test_loads(self) -> None:
        assert compiled.load_core().pinocchio_version == pinocchio.__version__

    def test_not_built(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.refuse(monkeypatch, ModuleNotFoundError("No module named _core")) == self.missing()

    def test_source_folder_without_core(self, monkeypatch: pytest.MonkeyPatch) -> None:
        # A folder without __init__.py imports as an empty namespace package: there is no file behind it.
        assert self.refuse(monkeypatch, types.ModuleType("pin_nonideal._core")) == self.missing()

    def test_does_not_load(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.refuse(monkeypatch, ImportError("undefined symbol: aba")) == (
            f"the compiled core of pin_nonideal does not load beside Pinocchio {pinocchio.__version__} "
            f"(undefined symbol: aba); {AGAIN}"
        )

    def test_built_for_another_pinocchio(self, monkeypatch: pytest.MonkeyPatch) -> None:
        core = types.ModuleType("pin_nonideal._core")
        core.__file__ = "_core.so"
        core.pinocchio_version = "4.0.9"  # type: ignore[attr-defined]
        assert self.refuse(monkeypatch, core) == (
            "the compiled core of pin_nonideal was built for Pinocchio 4.0.9, and Pinocchio "
            f"{pinocchio.__version__} is installed; {AGAIN}"
        )

    def test_patch_versions_of_pinocchio_fit(self, monkeypatch: pytest.MonkeyPatch) -> None:
        core = types.ModuleType("pin_nonideal._core")
        core.__file__ = "_core.so"
        major, minor = pinocchio.__version__.split(".")[:2]
        core.pinocchio_version = f"{major}.{minor}.99"  # type: ignore[attr-defined]
        monkeypatch.setattr(compiled.importlib, "import_module", lambda name: core)
        assert compiled.load_core() is core
