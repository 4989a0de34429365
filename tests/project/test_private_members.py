"""A private member is used in the module that defines it, and in no other."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "pin_nonideal"
# Of libraries that offer no other way: the interpreter's frames, argparse's options of a command, xacro's
# search for packages.
OF_LIBRARIES = {"_getframe", "_actions", "_SubParsersAction", "_eval_find"}
OF_NAMED_TUPLES = {"_replace", "_asdict", "_fields"}


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def is_self(node: ast.expr) -> bool:
    return isinstance(node, ast.Name) and node.id == "self"


def defined_in(tree: ast.Module) -> set[str]:
    """Names of private functions, classes and attributes that a module defines."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and is_self(node.value):
            names.add(node.attr)
    return {name for name in names if is_private(name)}


def reach_ins(text: str) -> list[str]:
    """Uses of private members of other modules, and imports of private names."""
    tree = ast.parse(text)
    own = defined_in(tree) | OF_LIBRARIES | OF_NAMED_TUPLES
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and is_private(node.attr) and node.attr not in own:
            owner = node.value
            inherited = isinstance(owner, ast.Name) and owner.id in ("self", "cls")
            inherited |= isinstance(owner, ast.Call) and getattr(owner.func, "id", "") == "super"
            if not inherited:
                found.append(f"line {node.lineno}: {ast.unparse(node)}")
        elif isinstance(node, ast.ImportFrom):
            found += [
                f"line {node.lineno}: {a.name}"
                for a in node.names
                if is_private(a.name) and a.name != "_core"
            ]
    return found


@pytest.mark.parametrize(
    "path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE))
)
def test_module_uses_no_private_member_of_another(path):
    assert reach_ins(path.read_text()) == []


def test_reach_ins_are_found():
    assert reach_ins("def f(scene):\n    return scene._compiled") == ["line 2: scene._compiled"]
    assert reach_ins("from a.b import _c") == ["line 1: _c"]
    assert (
        reach_ins("class A:\n    def __init__(self):\n        self._x = 1\ndef f(a):\n    return a._x") == []
    )


def test_no_block_declares_attributes_of_another_class():
    """A class is composed of others and does not declare the attributes of a host."""
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                blocks = [one for one in node.body if isinstance(one, ast.If)]
                assert not any(ast.unparse(one.test) == "TYPE_CHECKING" for one in blocks), path
