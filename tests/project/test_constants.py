"""Constants of the compiled core: members of the parameters of a solver, or defined once in their file."""

from __future__ import annotations

import itertools
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


PARAMETERS = re.compile(r"^struct (\w+Parameters) \{\n(.*?)^\};", re.M | re.S)


def undocumented(members: str) -> list[str]:
    """Return the lines of members without a comment beside or above them."""
    lines = ["", *members.splitlines()]
    return [
        line.strip()
        for before, line in itertools.pairwise(lines)
        if line and "//" not in line and not before.lstrip().startswith("//")
    ]


def code(path: Path) -> str:
    """Text of a source without its comments."""
    return re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))


def room(path: Path) -> str:
    """Folder of the core to which a source belongs."""
    return path.relative_to(CORE).parts[0]


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
    assert 50 < len(files) <= 100  # others are members of the parameters of a solver
    assert {name: paths for name, paths in files.items() if len(paths) > 1} == {}


def test_undocumented_members_are_found() -> None:
    text = """struct SomeParameters {
    double first = 1e-3;  // unit
    int second = 2;
    // Unit.
    double third = 3.0;
    double fourth = 4.0;
};
"""
    ((name, members),) = PARAMETERS.findall(text)
    assert name == "SomeParameters"
    assert undocumented(members) == ["int second = 2;", "double fourth = 4.0;"]


def test_parameters_of_solvers_are_documented_and_constant() -> None:
    """Each has a constexpr object, so that reading a member costs nothing."""
    owners: dict[str, str] = {}
    for path in sorted(CORE.rglob("*.[ch]pp")):
        text = path.read_text(encoding="utf-8")
        for name, members in PARAMETERS.findall(text):
            assert name not in owners, f"{name} is defined twice"
            owners[name] = path.relative_to(CORE).as_posix()
            assert undocumented(members) == [], name
            own = rf"(using Parameters = {name};\n +static constexpr Parameters|constexpr {name}) \w+\{{\}};"
            used = "\n".join(p.read_text(encoding="utf-8") for p in path.parent.glob(f"{path.stem}.*"))
            assert re.search(own, used), f"{name} has no constexpr object"
    assert len(owners) > 70


def test_shared_tolerances_are_in_one_header() -> None:
    """A real constant that another room reads stands in `math`, not in a header of its first room."""
    sources = {path: code(path) for path in sorted(CORE.rglob("*.[ch]pp"))}
    shared = [
        f"{path.relative_to(CORE)}: {name}"
        for path, text in sources.items()
        if path.suffix == ".hpp" and room(path) != "math"
        for declaration in DECLARATION.findall(text)
        if "double" in declaration.partition("=")[0]
        for name in constants(declaration)
        for other, users in sources.items()
        if room(other) != room(path) and re.search(rf"(?<![.>\w]){name}\b", users)
    ]
    assert shared == []


def test_no_room_reads_real_parameters_of_another_room() -> None:
    sources = {path: code(path) for path in sorted(CORE.rglob("*.[ch]pp"))}
    holders: dict[str, tuple[str, list[str]]] = {}
    for path, text in sources.items():
        for name, members in PARAMETERS.findall(text):
            reals = re.findall(r"(\w+) =", "".join(re.findall(r"^ +double .*$", members, re.M)))
            owner = re.findall(rf"class (\w+)[^;{{]*\{{\n(?:public:\n)? +using Parameters = {name};", text)
            for holder in [*re.findall(rf"constexpr {name} (\w+)\{{", text), *owner]:
                holders[holder] = room(path), reals
    assert len(holders) > 70
    reads = [
        f"{path.relative_to(CORE)}: {holder}.{member}"
        for path, text in sources.items()
        for holder, member in re.findall(r"(\w+)(?:::parameters)?\.(\w+)", text)
        if holder in holders
        and holders[holder][0] not in ("math", room(path))
        and member in holders[holder][1]
    ]
    assert reads == []


def test_shared_tolerances_are_few_and_explained() -> None:
    text = (CORE / "math" / "tolerances.hpp").read_text(encoding="utf-8")
    names = constants(text)
    assert 10 < len(names) <= 25
    explained = re.findall(r"^// [^-].*\nconstexpr double (\w+) = .*;$", text, re.M)
    assert explained == names
    sources = {path: code(path) for path in CORE.rglob("*.[ch]pp")}
    users = {
        name: {room(path) for path, text in sources.items() if re.search(rf"\b{name}\b", text)} - {"math"}
        for name in names
    }
    assert [name for name, rooms in users.items() if len(rooms) < 2] == []
