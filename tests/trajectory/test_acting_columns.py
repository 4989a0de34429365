"""Columns in `columns` and in a replay: joints on which a law acts, and contacts that close."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.rows import rows_at
from pin_nonideal.trajectory.columns import acting_columns, column_name
from pin_nonideal.visualization.page import mode_timeline
from pin_nonideal.visualization.page.frames import sample
from pin_nonideal.visualization.page.signal_list import signals_of


@pytest.fixture(scope="module")
def pile():
    """Two boxes side by side on the ground, a third one on both."""
    model, shapes = pin.Model(), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    places = {"left": (-0.06, 0, 0.05), "right": (0.06, 0, 0.05), "top": (0, 0, 0.155)}
    for name, place in places.items():
        pn.free_body(
            model, name, coal.Box(0.1, 0.1, 0.1), 500.0, collision_model=shapes, place=np.array(place)
        )
    scene = pn.Scene(model, contacts=pn.geometry_contacts(model, shapes, mu=0.5), collision_model=shapes)
    return pn.simulate(scene, 0.06, method="moreau", dt=2e-3, record="forces", output_dt=6e-3, progress=False)


def test_columns_that_are_left_out_are_constant(pile):
    every, acting = pile.columns(), acting_columns(pile)
    assert list(acting) == [name for name in every if name in acting]
    for name, values in acting.items():
        np.testing.assert_array_equal(values, every[name])
    rest = [name for name in every if name not in acting]
    assert len(rest) > 50
    assert all((every[name] == every[name][0]).all() for name in rest)
    assert sum(".C." in name and values.any() for name, values in every.items()) > 10


def test_a_replay_has_a_signal_for_each_of_them(pile):
    words = {word for signal in signals_of(pile, pile) for word in signal.words.split()}
    forces = {name for name in acting_columns(pile) if ".C." in name}
    assert forces <= words


def test_bodies_that_touch_are_drawn_on_the_cubics_of_the_run(pile):
    """Frames at samples are the samples; no loop moves the frames between them."""
    motion = sample(pile)
    at = np.flatnonzero(motion.part == 0.0)
    assert len(at) >= len(pile.t) - 1
    np.testing.assert_array_equal(motion.q[at], pile.q[motion.before[at]])
    assert not motion.held.any()


def test_contacts_that_close_keep_their_columns(pile):
    acting, closed = acting_columns(pile), pile.closed.any(axis=0)
    names = [column_name(name) for name in pile.scene.contact_names]
    kept = {name for name in names if f"{name}.lam.0" in acting or f"{name}.lam" in acting}
    assert kept == {name for name, meets in zip(names, closed, strict=True) if meets}
    assert kept == {"left_on_ground", "right_on_ground", "left_on_top", "right_on_top"}
    assert len(names) == 6


def test_gaps_are_the_residuals_of_rows(pile):
    runner = compiled_scene(pile.scene).program.runner()
    t, gaps = mode_timeline.gaps_of(pile)
    assert list(gaps) == list(pile.scene.contact_names)
    for k in (0, len(t) // 2, len(t) - 1):
        at = int(np.searchsorted(pile.t, t[k]))
        residuals = rows_at(runner, pile.q[at], pile.v[at], float(t[k]))[2]
        for name, values in gaps.items():
            points = compiled_scene(pile.scene).points[name]
            assert len(points) in (8, 160)
            assert values[k] == min(residuals[compiled_scene(pile.scene).slices[one].start] for one in points)


def test_gaps_of_many_contacts_have_fewer_samples(pile, monkeypatch):
    long = pn.simulate(pile.scene, 0.5, method="moreau", dt=2e-3, output_dt=2e-3, progress=False)
    t, gaps = mode_timeline.gaps_of(long)
    assert len(t) == len(long.t)
    monkeypatch.setattr(mode_timeline, "MAX_GAP_VALUES", 1.0)
    fewer, some = mode_timeline.gaps_of(long)
    assert len(fewer) == mode_timeline.MIN_GAP_SAMPLES
    assert (fewer[0], fewer[-1]) == (t[0], t[-1])
    at = np.searchsorted(t, fewer)
    for name, values in some.items():
        np.testing.assert_array_equal(values, gaps[name][at])
