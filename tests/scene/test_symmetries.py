"""Results do not depend on rotation, motion, units, order, duplication, splitting, delay or cuts of a scene.

The tests compare the results of all public functions for sample scenes and their images (`support/`). The
samples include all robots, all kinds of constraints and random mechanisms. By default each scene has one
image; `-m slow` tests all images, and `-m stress` more mechanisms.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any, get_args

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description import actuation, constraints, contacts, forces, laws
from pin_nonideal.description import time_functions as timefunctions

from ..support.answers import FUNCTIONS, RUNS, STATIC, Answer, ask, asks, differences
from ..support.cases import Case
from ..support.dimensions import factor
from ..support.known import KNOWN, Known
from ..support.scenes import kinds, random_cases
from ..support.symmetries import ALL, Image, mounted, unchanged

SAMPLES = kinds() | random_cases(3)
MANY = {name: make for name, make in random_cases(100).items() if name not in SAMPLES}
# Answers of the scene's own method suffice where only steps and samples change.
OWN_RUN = "simulate dop853"
# Methods with fixed steps. If a step is too long for a stiff law, the motion is not that of the scene, and
# rounding grows in it.
FIXED, RESOLVED = ("simulate rk4", "simulate semi_implicit_euler", "simulate moreau", "stepper"), 0.03


@cache
def case(name: str) -> Case:
    return (SAMPLES | MANY)[name]()


@cache
def image(name: str, transformation: str) -> Image | None:
    return ALL[transformation].make(case(name))


@cache
def answer(name: str, function: str) -> Answer:
    return ask(function, case(name))


def asked(name: str, transformation: str) -> list[str]:
    """Functions whose results the tests compare."""
    made = image(name, transformation)
    if made is None:
        return []
    functions = [OWN_RUN] if ALL[transformation].runs_only else list(FUNCTIONS)
    if made.moving or not case(name).still:
        functions = [f for f in functions if f not in STATIC]
    functions = [f for f in functions if asks(f, case(name)) and asks(f, made.case)]
    if resolves(name):
        return functions
    return [] if transformation == "rk4" else [f for f in functions if f not in FIXED]


@cache
def resolves(name: str) -> bool:
    """Check if fixed steps of a random mechanism end where adaptive steps end."""
    if not name.startswith("mechanism") or not asks(FIXED[0], case(name)):
        return True
    ends = [answer(name, f).values.get("q", ("", [None]))[1][-1] for f in (FIXED[0], OWN_RUN)]
    if any(q is None for q in ends):
        return False
    return float(np.abs(pin.difference(case(name).model, *ends)).max()) < RESOLVED


def found(name: str, transformation: str, function: str) -> list[str]:
    """Differences between the answers of an image and of its scene; failed searches are left out."""
    made, own = image(name, transformation), answer(name, function)
    assert made is not None
    if "EquilibriumError" in str(own.values.get("error")):
        return []
    return differences(own, ask(function, made.case), made)


def is_known(name: str, transformation: str, function: str) -> bool:
    return any(known.covers(name, transformation, function) for known in KNOWN)


def check(name: str, transformation: str, functions: list[str]) -> None:
    told = {f: found(name, transformation, f) for f in functions if not is_known(name, transformation, f)}
    assert not {f: d for f, d in told.items() if d}


def pairs() -> list[Any]:
    """Scenes and transformations: by default every fourth scene once, and the transformations in turn."""
    names, found = list(SAMPLES), []
    for i, name in enumerate(names):
        for j, transformation in enumerate(ALL):
            marks = () if j == (7 * i) % len(ALL) and i % 4 == 0 else pytest.mark.slow
            found.append(pytest.param(name, transformation, id=f"{name}-{transformation}", marks=marks))
    return found


@pytest.mark.parametrize(("name", "transformation"), pairs())
def test_images_answer_as_their_scenes(name: str, transformation: str, request: Any) -> None:
    functions = asked(name, transformation)
    if "slow" not in request.keywords:
        functions = [f for f in functions if f not in RUNS or f == OWN_RUN]
    check(name, transformation, functions)


@pytest.mark.stress
@pytest.mark.parametrize("name", MANY)
def test_images_of_random_mechanisms_answer_as_they_do(name: str) -> None:
    for transformation in ALL:
        check(name, transformation, asked(name, transformation))


@pytest.mark.parametrize(
    "known",
    [
        pytest.param(k, id=k.reason, marks=[pytest.mark.xfail(strict=True, reason=k.reason), *k.marks])
        for k in KNOWN
    ],
)
def test_known_defects(known: Known) -> None:
    """Each listed defect still occurs; an entry without a defect must be removed."""
    assert not found(*known.example)


# --- Completeness ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("module", [constraints, laws, contacts, forces, actuation, timefunctions])
def test_every_kind_has_a_sample(module: Any) -> None:
    union = {constraints: "Constraint", laws: "Law", contacts: "Contact", forces: "Force"}.get(module)
    every = (
        get_args(getattr(module, union))
        if union
        else [x for x in vars(module).values() if isinstance(x, type) and x.__module__ == module.__name__]
    )
    shown: set[type] = set()
    for name in kinds():
        of = case(name)
        for d in (*of.descriptions, of.actuation):
            shown |= (
                {type(d), *(type(getattr(d, f.name)) for f in fields(d))}
                if hasattr(d, "__dataclass_fields__")
                else set()
            )
    assert [kind.__name__ for kind in every if kind not in shown] == []


@pytest.mark.parametrize("name", list(kinds()))
def test_every_number_has_a_dimension(name: str) -> None:
    """A field that is new needs its line in `support/dimensions.py`."""
    of = case(name)
    for d in of.descriptions:
        for f in fields(d):
            value = getattr(d, f.name)
            if isinstance(value, (float, tuple)) and not (isinstance(d, pn.Wrench) and f.name == "value"):
                factor(d, f.name, of.model, of.constraints)


def test_every_robot_is_a_sample() -> None:
    assert {f"robot {name}" for name, _ in pn.robots()} <= set(SAMPLES)


# --- The harness itself ---------------------------------------------------------------------------------


@pytest.mark.parametrize("transformation", ALL)
def test_states_come_back(transformation: str) -> None:
    samples = ("law JointFriction", "rows of hinge between trees", "rows of point between trees")
    made = next(i for i in (image(name, transformation) for name in samples) if i is not None)
    for (q, v), (q_there, v_there) in zip(made.of.states, made.case.states, strict=True):
        np.testing.assert_allclose(made.back("q", q_there), q, atol=1e-14)
        np.testing.assert_allclose(made.back("v", v_there), v, atol=1e-14)


def test_what_is_no_symmetry_is_seen() -> None:
    """A mount that is turned without its gravity, and a mass that is another one."""
    of = case("robot four_bar")
    made = mounted(of, pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.0, 0.0), np.zeros(3)))
    model = made.case.model.copy()
    model.gravity = of.model.gravity
    wrong = replace(made, case=replace(made.case, model=model))
    assert differences(ask("solve", of), ask("solve", wrong.case), wrong)
    model = of.model.copy()
    model.inertias[1] = pin.Inertia(2.0, np.zeros(3), np.eye(3))
    heavier = unchanged(of, model=model)
    assert differences(ask("simulate dop853", of), ask("simulate dop853", heavier.case), heavier)
