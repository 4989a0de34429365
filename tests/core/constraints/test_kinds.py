"""Each kind of constraint is complete in the core and in Python, with formulas generic in the scalar."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import get_args

import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.compilation.constraints import lower_constraint
from pin_nonideal.compilation.laws import lower_law
from pin_nonideal.core_loader import core
from pin_nonideal.description import constraints, laws
from pin_nonideal.loading.yaml.robot import CONSTRAINTS, LAWS

ROOT = Path(__file__).parents[3]
CORE = ROOT / "pin_nonideal" / "_core"
DATA = Path(__file__).parents[2] / "data"
KINDS = get_args(constraints.Constraint)
HEADERS = [path for room in ("rows", "gaps") for path in sorted((CORE / "constraints" / room).glob("*.hpp"))]
# Required members of a kind's C++ struct.
MEMBERS = (
    "static constexpr const char* name",
    "static constexpr Role role",
    "static constexpr auto data()",
    "int size() const",
    "bool is_holonomic(int row) const",
    "bool moves_in_time() const",
    "Frame frame1, frame2",
    "static constexpr bool constant_A",
    "static constexpr bool affine_rate",
    "static constexpr bool comparable_rows",
    "static constexpr DisplayKind shown",
    "residual",
    "rows",
    "rate_and_bias",
)
# Required members of a gap between two shapes, beside its base.
MEMBERS_OF_GAPS = (
    "a base `PlaneGap` or `ShapeGap`",
    "extent1",
    "support1",
    "normal",
    "double max_depth",
    "double depth_to_next_face",
    "double radius",
)


def names(of: type) -> str:
    return of.__name__


@pytest.mark.parametrize("kind", KINDS, ids=names)
class TestDescription:
    def test_is_public(self, kind: type) -> None:
        assert kind.__name__ in pn.__all__

    def test_compiles(self, kind: type) -> None:
        assert kind in lower_constraint.registry

    def test_stands_in_robot_yaml_unless_it_holds_functions(self, kind: type) -> None:
        assert (kind.__name__ in CONSTRAINTS) is not kind.__name__.startswith("User")

    def test_says_its_rows_and_what_lam_is(self, kind: type) -> None:
        doc = kind.__doc__ or ""
        assert "Rows:" in doc
        assert "lam:" in doc
        assert re.search(r"Residual|Rate|residual and rate", doc)


def structs() -> dict[str, str]:
    """Return the name of each kind of row and its name in Python; templates are listed by instance."""
    found = {}
    for header in HEADERS:
        source = header.read_text()
        plain = r'(?<!>\n)^struct (\w+Rows?)(?: : \w+)? \{\n +static .* name = "(\w+)"'
        found |= dict(re.findall(plain, source, re.M))
        found |= {
            kind: kind[:-3].lower() for kind in re.findall(r"^using (\w+Row) = \w+<\w+>;", source, re.M)
        }
    return found


@pytest.mark.parametrize("struct", structs())
class TestStruct:
    def test_is_one_of_the_kinds(self, struct: str) -> None:
        (variant,) = re.findall(
            r"using Kind = std::variant<([^>]*)>", (CORE / "constraints/row_type.hpp").read_text()
        )
        assert struct in re.findall(r"\w+", variant)

    def test_is_bound_and_compiled(self, struct: str) -> None:
        stem = structs()[struct]
        assert callable(getattr(core.Builder, f"add_{stem}"))
        sources = "".join(p.read_text() for p in (ROOT / "pin_nonideal" / "compilation").glob("*.py"))
        assert f"out.add_{stem}(" in sources


def compiled(source: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Compile a source of tests/data with the headers of the core and Eigen."""
    compiler = shutil.which(os.environ.get("CXX", "c++"))
    prefix = next((p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix"), Path())
    eigen = prefix / "include" / "eigen3"
    if compiler is None or not (eigen / "Eigen" / "Core").exists():
        pytest.skip("needs a C++ compiler and Eigen's headers")
    command = [compiler, "-std=c++17", "-Wno-psabi", f"-I{CORE}", "-isystem", eigen, DATA / source, *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_kind_that_forgets_a_member_does_not_compile() -> None:
    result = compiled("no_kind.cpp", "-fsyntax-only")
    assert result.returncode != 0
    for member in MEMBERS:
        assert f"needs `{member}" in result.stderr
    for member in MEMBERS_OF_GAPS:
        assert f"needs {member}" in result.stderr.replace("needs `", "needs ")


def test_formulas_in_dual_numbers_are_derivatives_of_each_other(tmp_path: Path) -> None:
    """The exact form of `test_constraint_rows.py`, which compares each kind with differences."""
    program = tmp_path / "dual_kinds"
    built = compiled("dual_kinds.cpp", "-O0", "-o", str(program))
    assert built.returncode == 0, built.stderr
    ran = subprocess.run([program], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (0, "")


@pytest.mark.parametrize("law", get_args(laws.Law), ids=names)
class TestLaw:
    def test_is_public(self, law: type) -> None:
        assert law.__name__ in pn.__all__

    def test_compiles(self, law: type) -> None:
        assert law in lower_law.registry

    def test_stands_in_robot_yaml_unless_it_holds_functions(self, law: type) -> None:
        assert (law.__name__ in LAWS) is not law.__name__.startswith("User")


def test_every_law_of_the_core_is_bound() -> None:
    """All laws of the variant are bound; a law that reads reactions or omits its states does not compile."""
    header = (CORE / "forces" / "laws.hpp").read_text()
    (variant,) = re.findall(r"using Law = std::variant<([^>]*)>", header)
    for name in re.findall(r"\w+", variant):
        bound = {"LuGre": "lugre", "UserLaw": "user_law"}.get(name, name.lower())
        assert callable(getattr(core.Builder, f"add_{bound}"))
