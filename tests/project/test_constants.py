"""Each named constant of the compiled core is defined once, in the file of its subject."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

CORE = Path(__file__).resolve().parents[2] / "pin_nonideal" / "_core"
DECLARATION = re.compile(r"^(?:(?:static|inline) )*(?:constexpr|const)\b[^;]*?;", re.M)


def constants(text: str) -> list[str]:
    """Names that declarations at the start of a line define, of which one may define several."""
    names = []
    for declaration in DECLARATION.findall(text):
        if "=" not in declaration or "(" in declaration.partition("=")[0]:
            continue  # a function
        values = re.sub(r"\{[^{}]*\}|\([^()]*\)", "", declaration)
        names += re.findall(r"(\w+)\s*(?:\[[^\]]*\])*\s*=(?!=)", values)
    return names


def test_declarations_are_found() -> None:
    text = """
constexpr double first = 1e-3, second = 2.0;  // two
static constexpr int third = 3;
const double fourth = std::sqrt(6.0);
constexpr double fifth[] = {1.0, 2.0};
constexpr int twice(int x) { const int y = 2 * x; return y; }
    const double local = 1.0;
"""
    assert constants(text) == ["first", "second", "third", "fourth", "fifth"]


def test_no_constant_is_defined_twice() -> None:
    files = defaultdict(list)
    for path in sorted(CORE.rglob("*.[ch]pp")):
        for name in constants(path.read_text(encoding="utf-8")):
            files[name].append(path.relative_to(CORE).as_posix())
    assert len(files) > 400
    assert {name: paths for name, paths in files.items() if len(paths) > 1} == {}
