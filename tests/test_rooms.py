"""Rooms: a module imports only from those above it, so that no circle exists; the compiled core is typed."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "pin_nonideal"

# All modules from the top down, a line a room. CONTRIBUTING shows the same order.
ORDER = """
version errors types checks files equation
timefunctions constraints laws contact_checks round_contacts hulls solid_contacts contacts collision_shapes \
revolved_shapes revolved_manifolds manifolds geometry_contacts forces actuation
_core core cones
states: placements configurations orders named rows extents least_moves closure ways_out unmet held \
report projection
compilation: failures callbacks names constraints contacts friction laws forces lowering analysis scene \
run_numbers description report
scene_states scene_geometry scene_tables scene_steps scene_copy scene
formats: xml shapes model_edit inertia urdf_checks urdf_words tidy density meshes expansion urdf generators \
example_robots plain_yaml robot_yaml starts tree_changes dissipation motors assembly rounding
mjcf: fields compile motion tree tendons forces transmissions actuators equality shapes told reader
loading
made_later records outcome dense npz trajectory_file trajectory_columns trajectory_by_name \
trajectory_summary trajectory
runs: options asked progress results checkpoint components joining apart scipy_methods resume
simulation run_arrays batches sweep_points sweep_packs sweep_store sweeping
statics: forces equilibrium rest inverse_dynamics
page: looks figure_styles geometry bare packing tracks motion between touched view guides marks places \
forces given bands coordinates signals relations elements choices payload window
replaying plotting browser rendering commands pin_nonideal cli_runs cli
"""

# Headers and sources of the core in the same way, a header together with its source.
CORE_ORDER = """
math: lanes unrolled spatial angles timefunction roots radau factorizations nonnegative
tree: mechanism liegroup body_terms articulated pinocchio_pass model_reading own_pass terms factor
constraints: geometry coordinates kinds kind block row_layout row_system orthogonal row_factor \
row_length rank redundancy pulls
forces: given_forces laws mode friction
dynamics: failure program numbers reaction_equation reaction_roots workspace \
given_forces law_forces solution \
reactions split slip unknowns uniqueness implicit power evaluation projection step_start
friction: friction_limits dense_solver box_program lorentz cone_program cone_problem cone_newton cone_path \
cone_shares cone_certificate cone_complementarity rest_equation rest_solver rest_branches problem \
rest_problem beginning each_choice modes continuation
contact: gaps reach ways separation contact_rows impact resting closing moving_out
run: archive method step outside_step step_control runge_kutta system semi_implicit_euler error_norm \
collocation stepper gap_watch gap_search moreau moreau_contacts dense_output recorder inside_samples \
checkpoint options output stiffness growth rounding event_search event_location events stepper_choice \
bouncing notices value_events breaks torques landing time_stepping clusters mode_changes simulation \
followed_run stepped_run
python: arrays buffers failures callbacks builder constraints cleared kept_run options runner \
run_programs share_out runs batch followed stepped program cones module
"""


def modules_in_order() -> list[str]:
    """Dotted names below the package, whose own name is empty."""
    found = []
    for line in ORDER.strip().splitlines():
        room, _, names = line.rpartition(":")
        found += [room] * bool(room) + [f"{room}.{name}".lstrip(".") for name in names.split()]
    return [name.removeprefix("pin_nonideal") for name in found]


def path_of(name: str) -> Path:
    path = PACKAGE / name.replace(".", "/")
    return path / "__init__.py" if path.is_dir() and name != "_core" else path.with_suffix(".py")


def imports_of(name: str, known: list[str]) -> set[str]:
    """Modules of the package that a module imports anywhere: in functions and for type checkers too."""
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


def test_every_module_has_its_place() -> None:
    names = {
        ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").removesuffix(".")
        for path in PACKAGE.rglob("*.py")
    }
    assert sorted(names | {"_core"}) == sorted(modules_in_order())


@pytest.mark.parametrize("name", [n for n in modules_in_order() if n != "_core"])
def test_imports_go_upward(name: str) -> None:
    order = modules_in_order()
    above = order[: order.index(name)]
    assert sorted(imports_of(name, order) - set(above)) == []


def test_contributing_shows_the_order() -> None:
    text = " ".join((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split())
    for order in (ORDER, CORE_ORDER):
        shown = [re.sub(r"^(\w+): (.*)$", r"\1/ (\2)", line) for line in order.strip().splitlines()]
        assert "; ".join(line.replace(" ", ", ").replace("/, (", "/ (") for line in shown) in text


def units_in_order() -> list[str]:
    rooms = [line.partition(":") for line in CORE_ORDER.strip().splitlines()]
    return [f"{room}/{name}" for room, _, names in rooms for name in names.split()]


def included_units() -> dict[str, set[str]]:
    """What the header and the source of each unit of the core include from others; kinds are one unit."""
    found: dict[str, set[str]] = {}
    for path in (PACKAGE / "_core").rglob("*.[ch]pp"):
        included = re.findall(r'#include "(.+)\.hpp"', path.read_text(encoding="utf-8"))
        unit, *names = ("/".join(name.split("/")[:2]) for name in (unit_name(path), *included))
        found.setdefault(unit, set()).update(set(names) - {unit})
    return found


def unit_name(path: Path) -> str:
    return path.relative_to(PACKAGE / "_core").with_suffix("").as_posix()


def test_the_core_includes_upward() -> None:
    order, included = units_in_order(), included_units()
    assert sorted(order) == sorted(included)
    climbs = [
        (unit, name)
        for unit, names in included.items()
        for name in names
        if name not in order[: order.index(unit)]
    ]
    assert climbs == []


def test_stub_is_the_core(tmp_path: Path) -> None:
    """`_core.pyi`, which type checkers read, is what nanobind generates of the compiled core."""
    generated = tmp_path / "_core.pyi"
    patterns = PACKAGE / "_core" / "python" / "stub.txt"
    command = ["-m", "nanobind.stubgen", "-q", "-m", "pin_nonideal._core", "-p", patterns, "-o", generated]
    subprocess.run([sys.executable, *command], check=True, cwd=tmp_path)
    assert generated.read_text(encoding="utf-8") == (PACKAGE / "_core.pyi").read_text(encoding="utf-8")


def test_lines_of_the_core_fit_a_screen() -> None:
    long = [
        f"{path.relative_to(PACKAGE)}:{number}"
        for path in sorted((PACKAGE / "_core").rglob("*.[ch]pp"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > 125
    ]
    assert long == []
