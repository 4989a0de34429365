"""Public functions take a `Scene`; functions below them take the `CompiledScene` that belongs to it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pin_nonideal as pn

PACKAGE = Path(__file__).parents[2] / "pin_nonideal"
# Rooms that define the class, or that call public functions only.
OTHER_ROOMS = {"scene", "cli"}
# Functions that need the scene itself, each with its reason. The table may only shrink.
WITH_SCENE = {
    "loading/load.py: _with_origin": "the user's scene gets its origin",
    "simulation/checkpoint.py: Saver.__init__": "the file holds the name and the origin of the scene",
    "simulation/results.py: finish": "the Trajectory holds the scene",
    "simulation/rollout.py: _arrays": "the RunArrays hold the scene, also those of an error",
    "simulation/rollout.py: _run": "each Trajectory holds the scene",
    "trajectory/frame_reaction.py: _load_beyond": "shapes are read on first access",
    "trajectory/trajectory.py: restore_trajectory": "the Trajectory holds the scene",
    "visualization/page/payload.py: _drawn": "shapes are read on first access",
}


def functions_with_scene(text: str) -> list[str]:
    """Functions of a module that have a parameter of the type `Scene`, without public functions."""
    found = []

    def search(node: ast.AST, owner: str) -> None:
        for child in ast.iter_child_nodes(node):
            name = owner + child.name if isinstance(child, (ast.FunctionDef, ast.ClassDef)) else owner
            if isinstance(child, ast.FunctionDef) and name.split(".")[0] not in pn.__all__:
                arguments = [
                    arg for arg in ast.walk(child.args) if isinstance(arg, ast.arg) and arg.annotation
                ]
                if any(re.search(r"\bScene\b", ast.unparse(arg.annotation)) for arg in arguments):
                    found.append(name)
            search(child, name if name == owner else f"{name}.")

    search(ast.parse(text), "")
    return found


def test_functions_below_the_public_ones_take_a_compiled_scene():
    found = {
        f"{path.relative_to(PACKAGE).as_posix()}: {name}"
        for path in PACKAGE.rglob("*.py")
        if path.relative_to(PACKAGE).parts[0] not in OTHER_ROOMS
        for name in functions_with_scene(path.read_text())
    }
    assert found == set(WITH_SCENE)


def test_parameters_are_found():
    assert functions_with_scene("def f(scene: Scene | None, x: int): ...") == ["f"]
    assert functions_with_scene("class A:\n    def f(self, *, scene: 'Scene'): ...") == ["A.f"]
    assert functions_with_scene("def simulate(scene: Scene): ...\ndef g(x: int) -> Scene: ...") == []
