"""Public docstrings exist, and their Args and Attributes name exactly the parameters and fields."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable
from typing import Any

import pytest

import pin_nonideal as pn

SECTION = re.compile(r"^(Args|Attributes|Returns|Raises|Yields|Example|Examples|Note|Notes|Source):$")
# `name: text`, `name (type): text`, `a, b: text`, `**parameters: text`
ENTRY = re.compile(r"^    (?P<names>\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: \([^)]*\))?:(?: |$)")


def section_names(doc: str, *sections: str) -> list[str]:
    """Names explained in the given sections of a Google-style docstring, in order."""
    names: list[str] = []
    inside = False
    for line in doc.splitlines():
        heading = SECTION.match(line)
        if heading:
            inside = heading.group(1) in sections
        elif line and not line.startswith(" "):
            inside = False
        elif inside:
            entry = ENTRY.match(line)
            if entry:
                names += [name.strip().lstrip("*") for name in entry.group("names").split(",")]
    return names


def parameter_names(function: Callable[..., Any]) -> list[str]:
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


PUBLIC = {name: getattr(pn, name) for name in pn.__all__ if not name.startswith("__")}
FUNCTIONS = {name: thing for name, thing in PUBLIC.items() if inspect.isfunction(thing)}
CLASSES = {name: thing for name, thing in PUBLIC.items() if inspect.isclass(thing)}
DATACLASSES = {name: thing for name, thing in CLASSES.items() if dataclasses.is_dataclass(thing)}
# Classes built by a constructor of their own.  Exceptions are raised by the package, not built by its users.
BUILT = {
    name: thing
    for name, thing in CLASSES.items()
    if name not in DATACLASSES and "__init__" in vars(thing) and not issubclass(thing, BaseException)
}


def members(thing: type) -> dict[str, Any]:
    """Members of a class and of its bases in this package."""
    own = [base for base in reversed(thing.__mro__) if base.__module__.startswith("pin_nonideal.")]
    return {name: member for base in own for name, member in vars(base).items()}


METHODS = {
    f"{class_name}.{name}": getattr(member, "__func__", member)
    for class_name, thing in CLASSES.items()
    for name, member in members(thing).items()
    if not name.startswith("_") and inspect.isfunction(getattr(member, "__func__", member))
}
PROPERTIES = {
    f"{class_name}.{name}": member
    for class_name, thing in CLASSES.items()
    for name, member in members(thing).items()
    if not name.startswith("_") and isinstance(member, property)
}


def test_the_public_names_are_there() -> None:
    assert FUNCTIONS
    assert DATACLASSES
    assert METHODS


@pytest.mark.parametrize("name", [*FUNCTIONS, *CLASSES, *METHODS, *PROPERTIES])
def test_has_a_docstring(name: str) -> None:
    thing = {**FUNCTIONS, **CLASSES, **METHODS, **PROPERTIES}[name]
    # __doc__ and not getdoc(): a docstring inherited from another class does not count.  A dataclass
    # without one gets its signature from the decorator.
    doc = thing.__doc__
    assert doc
    assert not doc.startswith(f"{name}(")


@pytest.mark.parametrize("name", [*FUNCTIONS, *METHODS])
def test_args_name_exactly_the_parameters(name: str) -> None:
    function = {**FUNCTIONS, **METHODS}[name]
    assert section_names(inspect.cleandoc(function.__doc__ or ""), "Args") == parameter_names(function)


@pytest.mark.parametrize("name", list(BUILT))
def test_args_name_exactly_the_parameters_of_the_constructor(name: str) -> None:
    documented = section_names(inspect.cleandoc(BUILT[name].__doc__ or ""), "Args")
    assert documented == parameter_names(BUILT[name].__init__)


@pytest.mark.parametrize("name", list(DATACLASSES))
def test_args_or_attributes_name_exactly_the_fields(name: str) -> None:
    documented = section_names(inspect.cleandoc(DATACLASSES[name].__doc__ or ""), "Args", "Attributes")
    fields = [field.name for field in dataclasses.fields(DATACLASSES[name]) if not field.name.startswith("_")]
    assert sorted(documented) == sorted(fields)


class TestTheReaderOfDocstrings:
    DOC = """One line.

    Args:
        q, v: the state,
            on two lines: with a colon.
        mode (str): a mode.
        **parameters: the rest.

    Returns:
        Something: not an argument.
    """

    def test_reads_groups_types_and_stars(self) -> None:
        assert section_names(inspect.cleandoc(self.DOC), "Args") == ["q", "v", "mode", "parameters"]

    def test_stops_at_the_next_section(self) -> None:
        assert section_names(inspect.cleandoc(self.DOC), "Attributes") == []
