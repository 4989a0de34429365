"""Rooms: a module imports only from those above it, so that no circle exists; the compiled core is typed."""

from __future__ import annotations

import ast
import functools
import graphlib
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "pin_nonideal"

toml = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
ROOMS = toml.loads((ROOT / "layers.toml").read_text(encoding="utf-8"))
CORRIDOR = 12  # modules that lie in no room


@functools.cache
def modules() -> list[str]:
    """Dotted names below the package, whose own name is empty."""
    paths = [path.relative_to(PACKAGE).with_suffix("") for path in PACKAGE.rglob("*.py")]
    names = [".".join(path.parts).removesuffix("__init__").removesuffix(".") for path in paths]
    return sorted([*names, "_core"])


def room_of(name: str) -> str:
    return name.partition(".")[0] or "pin_nonideal"


def path_of(name: str) -> Path:
    path = PACKAGE / name.replace(".", "/")
    return path / "__init__.py" if path.is_dir() and name != "_core" else path.with_suffix(".py")


def imports_of(name: str, known: list[str]) -> set[str]:
    """Return the modules of the package that a module imports, also in functions and for type checkers."""
    home = ["pin_nonideal", *name.split(".")] if name else ["pin_nonideal"]
    home = home if path_of(name).name == "__init__.py" else home[:-1]
    found = set()
    for node in ast.walk(ast.parse(path_of(name).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = home[: len(home) + 1 - node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            targets = [f"{source}.{alias.name}" for alias in node.names]
        else:
            continue
        for target in targets:
            inside = target.removeprefix("pin_nonideal").removeprefix(".")
            if target.split(".")[0] == "pin_nonideal":
                found.add(inside if inside in known else inside.rpartition(".")[0])
    return found


def test_every_module_has_a_room() -> None:
    assert sorted({room_of(name) for name in modules()}) == sorted(ROOMS["package"])
    assert sum("." not in name for name in modules() if path_of(name).parent == PACKAGE) <= CORRIDOR


@pytest.mark.parametrize("name", [name for name in modules() if name != "_core"])
def test_imports_go_upward(name: str) -> None:
    above = ROOMS["package"][: ROOMS["package"].index(room_of(name)) + 1]
    assert {room_of(imported) for imported in imports_of(name, modules())} <= set(above)


def test_no_imports_go_in_circles() -> None:
    known = [name for name in modules() if name != "_core"]
    assert circle({name: imports_of(name, modules()) & set(known) - {name} for name in known}) is None


def circle(graph: dict[str, set[str]]) -> tuple[str, ...] | None:
    """Names that need each other, or None."""
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return tuple(error.args[1])
    return None


def test_contributing_shows_the_rooms() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert [room for rooms in ROOMS.values() for room in rooms if f"`{room}" not in text] == []


def included_units() -> dict[str, set[str]]:
    """Other units whose headers the header and the source of each unit of the core include."""
    found: dict[str, set[str]] = {}
    for path in (PACKAGE / "_core").rglob("*.[ch]pp"):
        unit = unit_name(path)
        included = re.findall(r'#include "(.+)\.hpp"', path.read_text(encoding="utf-8"))
        found.setdefault(unit, set()).update(set(included) - {unit})
    return found


def unit_name(path: Path) -> str:
    return path.relative_to(PACKAGE / "_core").with_suffix("").as_posix()


def test_the_core_includes_upward() -> None:
    order, graph = ROOMS["core"], included_units()
    climbs = [
        (unit, name)
        for unit, names in graph.items()
        for name in names
        if order.index(name.partition("/")[0]) > order.index(unit.partition("/")[0])
    ]
    assert climbs == []
    assert circle(graph) is None


def test_stub_is_the_core(tmp_path: Path) -> None:
    """`_core.pyi`, for type checkers, equals the stub that nanobind generates from the compiled core."""
    generated = tmp_path / "_core.pyi"
    patterns = PACKAGE / "_core" / "python" / "stub.txt"
    command = ["-m", "nanobind.stubgen", "-q", "-m", "pin_nonideal._core", "-p", patterns, "-o", generated]
    subprocess.run([sys.executable, *command], check=True, cwd=tmp_path)
    assert generated.read_text(encoding="utf-8") == (PACKAGE / "_core.pyi").read_text(encoding="utf-8")


def test_only_whole_runs_and_bindings_catch_failures() -> None:
    """Inner code tests the status that `attempt` of dynamics/failure.hpp returns."""
    core = PACKAGE / "_core"
    catching = [
        unit_name(path)
        for path in sorted(core.rglob("*.[ch]pp"))
        if "catch (const Failure" in path.read_text(encoding="utf-8")
    ]
    assert catching == ["dynamics/failure", "python/failures", "run/whole_run"]


def test_folders_of_tests_mirror_the_rooms() -> None:
    tests = ROOT / "tests"
    others = {"core", "project", "scenarios", "stress", "support"}
    folders = {path.parent for path in tests.rglob("test_*.py")} - {tests}
    of_core = {path.relative_to(tests / "core") for path in folders if tests / "core" in path.parents}
    assert [path for path in sorted(of_core) if not (PACKAGE / "_core" / path).is_dir()] == []
    of_package = {path.relative_to(tests).parts[0] for path in folders} - others
    assert of_package <= set(ROOMS["package"])


def test_lines_of_the_core_fit_a_screen() -> None:
    long = [
        f"{path.relative_to(PACKAGE)}:{number}"
        for path in sorted((PACKAGE / "_core").rglob("*.[ch]pp"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > 125
    ]
    assert long == []
