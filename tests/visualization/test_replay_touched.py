"""Replay of unilateral contacts, springs and drag, and of a run between its samples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.visualization.page.applied_forces import applied_force_arrows
from pin_nonideal.visualization.page.camera import up_direction, view
from pin_nonideal.visualization.page.contact_points import contact_points
from pin_nonideal.visualization.page.contact_surfaces import contact_surfaces, planes_of
from pin_nonideal.visualization.page.force_arrows import arrows_of
from pin_nonideal.visualization.page.frames import sample
from pin_nonideal.visualization.page.markers import marks_of
from pin_nonideal.visualization.page.mode_timeline import bands_of, gaps_of, has_open_contact
from pin_nonideal.visualization.page.resampling import resample
from pin_nonideal.visualization.page.signals import plots_of
from pin_nonideal.visualization.page.stick_figure import link_bars
from pin_nonideal.visualization.page.style import CLOSED, OPEN

from ..support.replay_browser import Watched, headless_browser
from ..support.replay_runs import add_frame, jointed

G = 9.81
ROUNDING = 1e-9
BLENDED = 1e-6  # error of cubics between the samples of a smooth run


def ball(**contact: Any) -> Any:
    """A ball of 1 kg that falls 1 m, restitution 0.8, with few samples: free flight has no error."""
    model = jointed(pin.JointModelPZ(), lever=0.0)
    add_frame(model, "ball", 1, [0.0, 0.0, 0.0])
    scene = pn.Scene(model, contacts=[pn.PointContact("ball", restitution=0.8, **contact)], q0=[1.0])
    return pn.simulate(scene, 1.5, record=("energy", "forces"))


def test_curves_of_few_samples_follow_the_motion_between_them() -> None:
    run = ball()
    assert len(run.t) < 60
    finer, motion = resample(run, sample(run))
    fall = np.sqrt(2.0 / G)
    (place,) = plots_of(finer, ["q"])
    early = place.t < 0.999 * fall
    assert np.count_nonzero(early) > 50
    np.testing.assert_allclose(place.curves["j0"][early], 1.0 - G * place.t[early] ** 2 / 2.0, atol=ROUNDING)
    (energy,) = plots_of(finer, ["energy"])
    np.testing.assert_allclose(energy.curves["kinetic"][early], (G * energy.t[early]) ** 2 / 2.0, atol=1e-8)
    np.testing.assert_array_equal(motion.of(finer.q), finer.q)


def test_dense_output_gives_the_frames_and_all_that_was_recorded() -> None:
    scene = pn.load("four_bar")
    run = pn.simulate(scene, 0.5, record=("dense", "forces", "energy"))
    finer, motion = resample(run, sample(run))
    assert len(finer.t) > len(run.t)
    inner = np.flatnonzero((sample(run).part > 0.0) & (sample(run).part < 1.0))
    exact = run.at(motion.times[inner])
    np.testing.assert_array_equal(motion.q[inner], exact.q)
    np.testing.assert_array_equal(finer.lam[inner], exact.lam)
    np.testing.assert_array_equal(finer.energy["total"][inner], exact.energy["total"])


def test_scenes_that_do_not_travel_are_shown_between_their_samples() -> None:
    model = jointed(pin.JointModelRY())
    scene = pn.Scene(model, actuation=lambda t, q, v: np.array([np.sin(t)]))
    run = pn.simulate(scene, 1.0)
    finer, _ = resample(run, sample(run))
    assert len(finer.t) > len(run.t)
    assert finer.scene is scene


def test_gaps_and_modes_of_contacts_without_friction_are_shown() -> None:
    run = ball(height=-0.5)
    assert has_open_contact(run)
    _, gaps = gaps_of(run)
    np.testing.assert_allclose(gaps["PointContact(ball)"], run.q[:, 0] + 0.5, atol=ROUNDING)
    ((name, pieces),) = bands_of(pn.simulate(run.scene, 6.0))
    assert name == "PointContact(ball)"
    assert [mode for _, _, mode in pieces][-1] == CLOSED
    assert pieces[0][2] == OPEN
    assert [plot.title for plot in plots_of(run, None)][1] == "Gaps"
    with pytest.raises(pn.InputError, match='plot "gaps" needs a contact that opens, and this run has none'):
        plots_of(pn.simulate(pn.load("four_bar"), 0.01), ["gaps"])


def test_the_ground_lies_at_the_height_of_its_contact() -> None:
    run = ball(height=-0.5)
    motion = sample(run)
    planes = planes_of(run.scene._compiled)
    assert view(run.scene.model, motion, [], [], np.zeros((0, 3)), planes).ground == -0.5


def test_an_incline_is_a_patch_below_the_path_of_what_touches_it() -> None:
    model = jointed(pin.JointModelPX(), pin.JointModelPZ(), lever=0.0)
    model.gravity = pin.Motion(np.array([4.0, 0.0, -9.0]), np.zeros(3))
    add_frame(model, "foot", 2, [0.0, 0.0, -0.1])
    scene = pn.Scene(model, contacts=[pn.PointContact("foot", mu=0.2)], q0=[0.0, 0.1])
    run = pn.simulate(scene, 0.5)
    motion = sample(run)
    (plane,) = planes_of(scene._compiled)
    (patch,) = contact_surfaces(run, motion, [], up_direction(model))
    np.testing.assert_allclose(patch.placement.rotation[:, 2], plane.normal, atol=ROUNDING)
    top = patch.placement.act(np.array([0.0, 0.0, patch.shape.size[2] / 2.0]))
    assert abs(top[2]) < ROUNDING
    local = (motion.point(2, np.array([0.0, 0.0, -0.1])) - top) @ patch.placement.rotation[:, :2]
    assert (np.abs(local) <= np.array(patch.shape.size[:2]) / 2.0).all()
    level = pn.Scene(jointed(pin.JointModelPZ(), lever=0.0), q0=[0.1])
    assert (
        contact_surfaces(pn.simulate(level, 0.1), sample(pn.simulate(level, 0.1)), [], up_direction(model))
        == []
    )


def test_a_stop_that_was_struck_stands_where_the_body_points_at_it() -> None:
    model = jointed(pin.JointModelRY())
    limit = pn.JointLimit("j0", lower=-2.0, upper=0.7, restitution=0.5)
    run = pn.simulate(pn.Scene(model, contacts=[limit], q0=[0.0]), 1.0, record="forces")
    (stop,) = contact_surfaces(run, sample(run), [], up_direction(model))
    assert stop.name == "JointLimit(j0) upper"
    way = stop.placement.translation / np.linalg.norm(stop.placement.translation)
    np.testing.assert_allclose(way, [np.cos(0.7), 0.0, -np.sin(0.7)], atol=ROUNDING)


def test_springs_wrenches_and_drag_are_arrows_of_what_they_do() -> None:
    model = jointed(pin.JointModelPX(), lever=0.0)
    add_frame(model, "tip", 1, [0.0, 0.0, 0.0])
    add_frame(model, "wall", 0, [2.0, 0.0, 0.0])
    forces = [
        pn.SpringDamper("tip", "wall", stiffness=30.0, damping=0.7, rest_length=1.5, name="coil"),
        pn.JointSpring("j0", 5.0, rest=0.1),
        pn.Wrench("tip", lambda t: [0.0, 0.0, t, 0.0, 1.0, 0.0], name="wind"),
    ]
    scene = pn.Scene(model, forces=forces, laws=[pn.Drag("tip", 0.4, exponent=2.0, name="air")], v0=[1.0])
    run = pn.simulate(scene, 1.0, output_dt=0.01)
    motion, marks = sample(run), marks_of(scene._compiled)
    arrows = {(arrow.name, arrow.unit): arrow for arrow in applied_force_arrows(run, motion, marks)}
    q, v = motion.q[:, 0], motion.of(run.v)[:, 0]
    pull = 30.0 * (2.0 - q - 1.5) - 0.7 * v
    for key, kind, expected in (
        (("coil", "N"), "spring", pull),
        (("spring j0", "N"), "spring", -5.0 * (q - 0.1)),
        (("air", "N"), "drag", -0.4 * np.abs(v) * v),
    ):
        assert arrows[key].kind == kind
        np.testing.assert_allclose(arrows[key].values[:, 0], expected, atol=ROUNDING)
    np.testing.assert_allclose(arrows["wind", "N"].values[:, 2], motion.times, atol=ROUNDING)
    np.testing.assert_allclose(arrows["wind", "N m"].values[:, 1], 1.0, atol=ROUNDING)


def test_torques_that_are_rounding_of_the_weight_have_no_arrow() -> None:
    model = jointed(pin.JointModelRY())
    run = pn.simulate(pn.Scene(model, actuation=lambda t, q, v: np.array([1e-12])), 0.1, record="forces")
    assert arrows_of(run, sample(run), []) == []


def test_points_of_contact_that_span_a_solid_are_its_corners() -> None:
    model = jointed(pin.JointModelFreeFlyer(), lever=0.0)
    corners = [np.array([x, y, z]) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)]
    (solid,) = link_bars(model, [(1, corner) for corner in corners], 0.5)
    found = solid.shape.vertices[solid.shape.triangles]
    volume = np.sum(np.linalg.det(found)) / 6.0  # volume of a closed surface with outward triangles
    assert volume == pytest.approx(0.2 * 0.4 * 0.6, rel=1e-12)
    flat = link_bars(model, [(1, corner) for corner in corners if corner[2] < 0.0], 0.5)
    assert len(flat) > 3


@pytest.mark.slow
def test_views_are_framed_between_what_lies_over_them(tmp_path: Path) -> None:
    """The robot is not covered by heading or buttons, and a belt with 100 m travel stays large."""
    runs = {
        "four_bar": pn.simulate(pn.load("four_bar"), 1.0, record="forces"),
        "delta": pn.simulate(pn.load("delta"), 0.5, record="forces"),
        "belt": pn.simulate(pn.load("belt_oscillator"), 1000.0, record="forces", output_dt=1.0),
    }
    with headless_browser() as browser:
        for name, run in runs.items():
            page = Watched(browser, pn.replay(run, tmp_path / f"{name}.html"))
            for size in ((1400, 900), (420, 800)):
                page.page.set_viewport_size({"width": size[0], "height": size[1]})
                page.run(
                    "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
                )
                top = page.page.locator("#heading").bounding_box()
                foot = page.page.locator("#tools").bounding_box()
                canvas = page.page.locator("#scene").bounding_box()
                for part in (0.0, 0.3, 0.7, 1.0):
                    box = page.run("p => { replay.seek(p * replay.duration); return replay.box(); }", part)
                    assert box[1] >= top["y"] + top["height"] - 2.0, (name, size, box)
                    assert box[3] <= foot["y"] + 2.0, (name, size, box)
                    across = (box[2] - box[0]) / canvas["width"], (box[3] - box[1]) / canvas["height"]
                    assert max(across) > 0.12, (name, size, box)
            assert page.complaints == []
            page.close()


def test_forces_between_round_bodies_act_where_they_touch() -> None:
    """A ball rests on a fixed capsule: its weight, at the top of the capsule."""
    model = jointed(pin.JointModelPZ(), lever=0.0)
    add_frame(model, "ball", 1, [0.0, 0.0, 0.0])
    add_frame(model, "beam", 0, [0.0, 0.0, 0.0])
    segments = ((0.0, 0.0, 0.0),) * 2, ((-1.0, 0.2, 0.0), (2.0, 0.2, 0.0))
    beam = pn.CapsuleContact("ball", "beam", *segments, radius1=0.3, radius2=0.2, name="on the beam")
    height = float(np.sqrt(0.5**2 - 0.2**2))
    run = pn.simulate(pn.Scene(model, contacts=[beam], q0=[height]), 0.1, record="forces")
    motion = sample(run)
    (arrow,) = arrows_of(run, motion, contact_points(run, motion), applied_force_arrows(run, motion, []))
    np.testing.assert_allclose(arrow.values[:, 2], G, atol=ROUNDING)
    touching = np.array([0.0, 0.2 * 0.3 / 0.5, height - 0.3 * height / 0.5])
    np.testing.assert_allclose(arrow.origin, np.tile(touching, (len(motion.times), 1)), atol=ROUNDING)
    names = {visual.name for visual in contact_surfaces(run, motion, [], up_direction(model))}
    assert names == {"ball round", "beam round"}


@pytest.mark.slow
def test_paths_coils_and_lists_of_runs_are_drawn_as_they_are(tmp_path: Path) -> None:
    """A path whose frames are too far apart is left out; a hundred runs fold their names away."""
    model = jointed(pin.JointModelRY())
    fast = pn.simulate(pn.Scene(model, v0=[40.0]), 1e5, output_dt=10.0)
    many = [pn.simulate(pn.load("four_bar"), 0.05, output_dt=0.01)] * 20
    with headless_browser() as browser:
        page = Watched(browser, pn.replay(fast, tmp_path / "fast.html"))
        before = page.picture(1e4)
        page.run("() => replay.show('trails', false)")
        assert np.array_equal(before, page.picture(1e4))
        page.close()
        page = Watched(browser, pn.replay(many, tmp_path / "many.html"))
        assert page.page.locator("#run-list summary").inner_text() == "20 runs"
        assert not page.page.locator("#run-list button").first.is_visible()
        page.page.locator("#run-list summary").click()
        page.page.locator("#run-list button").nth(3).click()
        assert page.page.locator("#run-list button").nth(3).get_attribute("aria-pressed") == "false"
        assert page.complaints == []
        page.close()
