"""First builds: an old Python, a missing compiler, object files from another environment."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BACKEND = ROOT / "packaging" / "build_backend.py"
CORE = ROOT / "pin_nonideal" / "_core"


def python(*words: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *words], cwd=cwd, capture_output=True, text=True, check=False)


def test_an_old_python_is_refused_in_words() -> None:
    old = f"import runpy, sys; sys.version_info = (3, 9, 18); runpy.run_path({str(BACKEND)!r})"
    done = python("-c", old)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "pin_nonideal needs Python 3.10 or newer, and this is Python" in done.stderr
    assert "python3.10 -m venv env && . env/bin/activate" in done.stderr


def test_the_backend_is_reached_by_an_old_python() -> None:
    """An old Python gets no build requirement that does not support it."""
    tomllib = pytest.importorskip("tomllib")
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert all(word.endswith("; python_version >= '3.10'") for word in table["build-system"]["requires"])
    assert table["project"]["requires-python"] == ">=3.10"
    assert compile(BACKEND.read_text(encoding="utf-8"), "backend", "exec", dont_inherit=True)


def test_a_missing_compiler_is_told_with_what_brings_it(tmp_path: Path) -> None:
    cmake = subprocess.run(
        ["cmake", "-S", CORE, "-B", tmp_path, "-G", "Unix Makefiles"],
        env={"PATH": f"{empty_path(tmp_path)}", "CXX": "/nonexistent/c++"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert cmake.returncode != 0
    words = " ".join(cmake.stderr.split())
    assert "pin_nonideal needs a C++17 compiler, and none was found." in words
    assert "sudo apt install g++" in words


def empty_path(tmp_path: Path) -> Path:
    """A folder with cmake and make alone."""
    folder = tmp_path / "path"
    folder.mkdir()
    for name in ("cmake", "make"):
        found = shutil.which(name)
        if found is None:
            pytest.skip(f"no {name} here")
        (folder / name).symlink_to(found)
    return folder


def test_object_files_stay_for_another_environment(tmp_path: Path) -> None:
    """scikit-build-core keeps a build folder that names its own place as the one that configured it."""
    pytest.importorskip("scikit_build_core")
    info = tmp_path / ".skbuild-info.json"
    info.write_text(json.dumps({"source_dir": "/s", "skbuild_path": "/tmp/pip-build-env-1"}))
    program = (
        f"import sys; sys.path.insert(0, {str(BACKEND.parent)!r}); import build_backend as b; "
        f"from pathlib import Path; import scikit_build_core.cmake as c; "
        f"b._keep_objects(Path({str(info)!r})); print(c.DIR)"
    )
    done = python("-c", program, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(info.read_text()) == {"source_dir": "/s", "skbuild_path": done.stdout.strip()}


def test_cmake_names_sources_that_exist() -> None:
    text = (CORE / "CMakeLists.txt").read_text(encoding="utf-8")
    named = re.findall(r"^  (\w+/[\w/]+\.cpp)\)?$", text, re.M)
    assert named
    assert [name for name in named if not (CORE / name).is_file()] == []
