"""Work on a replay page: values are computed once and where they are drawn, and the page stays the same."""

from __future__ import annotations

import sys
from collections import Counter
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.core_loader import core
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.trajectory import contact_points
from pin_nonideal.visualization.page import (
    between_samples,
    camera,
    frames,
    mode_timeline,
    payload,
    resampling,
    signals,
)

COUNT = 4
QUIET = {"record": ("forces", "energy"), "progress": False}


def boxes(beside=False, count=COUNT):
    """Boxes that fall on a floor and come to rest; they have contacts with each other if `beside`."""
    model, shapes = pin.Model(), pin.GeometryModel()
    for k in range(count):
        place = np.array([0.6 * k, 0.0, 0.08 + 0.02 * k])
        pn.free_body(model, f"box {k}", coal.Box(0.1, 0.1, 0.1), 500.0, collision_model=shapes, place=place)
    contacts = pn.ground_contacts(model, shapes, mu=0.4)
    contacts += pn.geometry_contacts(model, shapes, mu=0.4) if beside else []
    scene = pn.Scene(model, contacts=contacts, collision_model=shapes)
    v = np.random.default_rng(1).uniform(-0.5, 0.5, model.nv)
    record = ("forces", "energy", "reactions")
    options = {"method": "moreau", "dt": 1e-3, "record": record, "output_dt": 0.01}
    return pn.simulate(scene, 0.4, v=v, progress=False, **options)


def four_bar():
    record = ("forces", "energy")
    return pn.simulate(pn.load("four_bar"), 0.5, output_dt=0.01, record=record, progress=False)


RUNS = {"boxes": boxes, "four_bar": four_bar}


def packed(run):
    return payload.packed_runs([run], ["run"], None, "title", None, True)


def interpolated(motion, values):
    """Samples of a run at the frames of a motion, by one formula for all frames."""
    part = motion.part.reshape(-1, *[1] * (values.ndim - 1))
    after = np.minimum(motion.before + 1, len(values) - 1)
    return (1.0 - part) * values[motion.before] + part * values[after]


def extreme_points(points):
    """Extreme points of a cloud in all directions at once."""
    cloud = points.reshape(-1, 3)
    grid = np.array(list(product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=3)))
    shell = grid[np.abs(grid).max(axis=1) == 1.0]
    reach = (shell / np.linalg.norm(shell, axis=1, keepdims=True)) @ cloud.T
    return cloud[np.unique(np.argmax(reach, axis=1))]


@pytest.mark.parametrize("kind", RUNS)
def test_a_page_equals_that_of_plain_formulas(kind, monkeypatch):
    run = RUNS[kind]()
    page = packed(run)
    monkeypatch.setattr(frames.Motion, "of", interpolated)
    monkeypatch.setattr(camera, "_extreme_points", extreme_points)
    assert packed(run) == page


def test_extreme_points_of_a_large_cloud_are_those_of_all_points_at_once():
    cloud = np.random.default_rng(0).normal(size=(3 * camera.CLOUD_PART + 17, 3))
    np.testing.assert_array_equal(camera._extreme_points(cloud), extreme_points(cloud))
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))  # many of them are equally far
    cloud = np.tile(corners, (camera.CLOUD_PART, 1))
    np.testing.assert_array_equal(camera._extreme_points(cloud), extreme_points(cloud))


def test_displacements_between_samples_are_computed_once(monkeypatch):
    run, calls, difference = boxes(), [], pin.difference

    def counted(*arguments):
        calls.append(arguments)
        return difference(*arguments)

    monkeypatch.setattr(between_samples.pin, "difference", counted)
    packed(run)
    assert 0 < len(calls) <= len(run.t) - 1


def test_forces_of_contacts_that_stay_open_are_not_resampled(monkeypatch):
    """The page shows the gaps of two boxes if they close."""
    run, asked, read = boxes(beside=True, count=2), set(), resampling._ResampledFields.__getitem__

    def recorded(self, name):
        if self.field == "contact_forces":
            asked.add(name)
        return read(self, name)

    monkeypatch.setattr(resampling._ResampledFields, "__getitem__", recorded)
    packed(run)
    between = {name for name in run.scene.contact_names if "ground" not in name}
    assert between == {"box 0 on box 1"}
    assert asked == set(run.scene.contact_names) - between


def calls(run):
    """Number of calls of each function of the package during the work on a page, comprehensions apart."""
    counts, package = Counter(), str(Path(pn.__file__).parent)

    def count(frame, event, _):
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(package) and not code.co_name.startswith("<"):
            counts[code.co_qualname] += 1

    sys.setprofile(count)
    try:
        packed(run)
    finally:
        sys.setprofile(None)
    return counts


def test_constraints_and_planes_of_contacts_are_collected_once():
    counts = calls(boxes(beside=True, count=2))
    assert (counts["constraints_of"], counts["planes_of"]) == (1, 1)


def test_no_function_is_called_for_each_contact_that_stays_open():
    """Two boxes side by side have 160 contact points with each other, which all stay open."""
    alone, beside = calls(boxes(count=2)), calls(boxes(beside=True, count=2))
    assert {name: number for name, number in (beside - alone).items() if number >= 80} == {}


def test_gaps_of_many_contacts_are_computed_at_few_samples_and_drawn_at_all(monkeypatch):
    """The few samples choose the curves of the plot."""
    run, sizes, values = boxes(beside=True, count=5), [], core.gap_values
    assert len(run.t) > mode_timeline.MIN_GAP_SAMPLES

    def counted(program, q, t, blocks):
        sizes.append((len(t), len(blocks)))
        return values(program, q, t, blocks)

    monkeypatch.setattr(mode_timeline, "MAX_GAP_VALUES", 33_800.0)
    monkeypatch.setattr(contact_points, "core", SimpleNamespace(gap_values=counted))
    (plot,) = signals.plots_of(run, ["gaps"])
    every, few = len(run.scene.contact_names), mode_timeline.MIN_GAP_SAMPLES
    points = compiled_scene(run.scene).points
    drawn = sum(len(points[name]) for name in plot.curves)
    assert every == 15
    assert len(plot.curves) == signals.MAX_CURVES
    assert sizes == [(few, 5 * 8 + 10 * 160), (len(run.t), drawn)]
    np.testing.assert_array_equal(plot.t, run.t)
    assert plot.note == f"{signals.MAX_CURVES} of {every}, those that move most"


def test_a_page_of_100000_samples_takes_as_many_calls_as_one_of_1000():
    short, long = (pn.simulate(pn.load("four_bar"), 0.1, output_dt=dt, **QUIET) for dt in (1e-4, 1e-6))
    assert (len(short.t), len(long.t)) == (1001, 100001)
    grown = calls(long) - calls(short)
    assert {name: number for name, number in grown.items() if number > 40} == {}


def test_resampled_values_are_a_mapping_with_values_at_the_frames():
    samples, exact = {"a": np.arange(3.0), "b": np.ones(3)}, {"a": np.zeros(1)}
    resampled = resampling._ResampledFields("energy", samples, exact, lambda part, known: (part, known))
    assert list(resampled) == ["a", "b"]
    assert len(resampled) == 2
    assert resampled["a"][1] is exact["a"]
    for copied in (dict(resampled), {**resampled}, resampled | {}, dict(resampled.items())):
        assert copied["b"] == (samples["b"], None)
    assert resampled["b"] is resampled["b"]
