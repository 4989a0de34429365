"""The core's builder finishes a program more than once, and changes no finished program."""

from __future__ import annotations

import numpy as np

import pin_nonideal as pn
from pin_nonideal.compilation.lowering import lower
from pin_nonideal.compilation.resolver import Resolver
from pin_nonideal.core_loader import core
from pin_nonideal.scene.scene import compiled_scene

V = 0.3


def acceleration(program: core.Program, scene: pn.Scene) -> np.ndarray:
    """Return the acceleration of a scene at its start with all joints at speed V."""
    a = np.empty(scene.model.nv)
    program.runner().acceleration(scene.q0, np.full(scene.model.nv, V), 0.0, None, a)
    return a


def test_changes_do_not_reach_a_finished_program() -> None:
    scene = pn.load("four_bar")
    compiled = compiled_scene(scene)
    builder = core.Builder(scene.model, core.Provider[compiled.spec.terms])
    lower(compiled.spec, builder, Resolver(scene.model, scene.q0))
    first = builder.finish()
    laws, before = first.law_names, acceleration(first, scene)
    assert builder.finish() is first
    builder.select_rows(0, [])
    builder.add_law("later")
    free = builder.finish()
    assert first.law_names == laws
    assert free.law_names == [*laws, "later"]
    assert np.array_equal(acceleration(first, scene), before)
    assert np.abs(acceleration(free, scene) - before).max() > 1.0
    builder.select_rows(0, [0, 1])
    assert np.array_equal(acceleration(builder.finish(), scene), before)
    assert np.abs(acceleration(free, scene) - before).max() > 1.0
