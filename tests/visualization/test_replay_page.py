"""Contents of a replay page, opened from file:// without network, and compared with Pinocchio."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.visualization.replay import ReplayPage, replay

from ..support.replay_browser import MOVED, TIMEOUT, Watched, changed, headless_browser, opened_replay
from ..support.replay_runs import CRANK, add_frame, four_bar, jointed, panda, run_of

# Poses travel as 32-bit floats: 6e-8 relative, on lengths near 1 m and through a product of rotations.
POSE = 1e-5

# The straight line between samples 1/60 s apart errs by a'' h^2 / 8, the blend by less: 8 rad/s^2 on 0.9 m.
BLENDED = 1e-3

# Maximum sizes [bytes], a fifth above the measured sizes; the viewer library takes 0.29 MB of each.
BUDGET = {"panda": 2_500_000, "four_bar": 500_000}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with headless_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def arm(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """The Panda with meshes, and its page."""
    with opened_replay(browser, panda(), tmp_path_factory.mktemp("arm") / "panda.html") as page:
        yield page


@pytest.fixture(scope="module")
def loop(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """The four-bar without geometry, and its page."""
    with opened_replay(browser, four_bar(), tmp_path_factory.mktemp("loop") / "four_bar.html") as page:
        yield page


def test_the_page_opens_without_a_request_an_error_or_a_warning(arm: Any, loop: Any) -> None:
    for opened in (arm, loop):
        assert opened.watched.run("() => window.replayError || null") is None
        assert opened.watched.run("() => replay.ready") is True
        assert opened.watched.requests == [opened.path.resolve().as_uri()]
        assert opened.watched.complaints == []


@pytest.mark.slow
def test_the_watch_hears_what_reaches_for_the_network(browser: Any, loop: Any, tmp_path: Path) -> None:
    """Negative control of the test above."""
    text = loop.path.read_text(encoding="utf-8")
    spoiled = tmp_path / "spoiled.html"
    spoiled.write_text(
        text.replace("<body>", '<body><img src="http://127.0.0.1:9/dot.png">'), encoding="utf-8"
    )
    watched = Watched(browser, spoiled)
    assert any("Content Security Policy" in complaint for complaint in watched.complaints)
    watched.close()


@pytest.mark.parametrize("sample", [0, 19])
def test_joints_and_meshes_stand_where_pinocchio_places_them(arm: Any, sample: int) -> None:
    model, visual_model = arm.run.scene.model, arm.run.scene.visual_model
    data, visual_data = model.createData(), visual_model.createData()
    pin.updateGeometryPlacements(model, data, visual_model, visual_data, arm.run.q[sample])
    shown = arm.watched.poses(float(arm.run.t[sample]))
    assert shown["time"] == pytest.approx(arm.run.t[sample])
    for name, placement in zip(model.names, data.oMi, strict=True):
        np.testing.assert_allclose(shown["joints"][name], placement.homogeneous, atol=POSE)
    assert len(shown["visuals"]) == visual_model.ngeoms
    for item, placement in zip(visual_model.geometryObjects, visual_data.oMg, strict=True):
        np.testing.assert_allclose(shown["visuals"][item.name], placement.homogeneous, atol=POSE)


def test_poses_at_two_times_differ(arm: Any) -> None:
    """Negative control of the test above: a page that stood still would fail it."""
    hand = [
        np.array(arm.watched.poses(time)["visuals"]["panda_hand_0"])[:3, 3] for time in arm.run.t[[0, 19]]
    ]
    assert np.linalg.norm(hand[1] - hand[0]) > 0.1


def test_between_frames_joints_are_where_the_motion_is(loop: Any) -> None:
    """Against the closed form of the run, at times that are no frames."""
    model, data = loop.run.scene.model, loop.run.scene.model.createData()
    for time in np.random.default_rng(2).uniform(0.0, 1.0, 20):
        k = int(np.searchsorted(loop.run.t, time)) - 1
        exact = pin.interpolate(model, loop.run.q[k], loop.run.q[k + 1], (time - loop.run.t[k]) * 60.0)
        pin.forwardKinematics(model, data, exact)
        shown = loop.watched.poses(float(time))["joints"]
        for name, placement in zip(model.names, data.oMi, strict=True):
            np.testing.assert_allclose(shown[name], placement.homogeneous, atol=BLENDED)
        assert loop.watched.run("() => replay.gap") < 1e-2 * CRANK


def test_anchors_stand_on_their_frames(loop: Any) -> None:
    model, data = loop.run.scene.model, loop.run.scene.model.createData()
    for sample in (0, 40):
        pin.framesForwardKinematics(model, data, loop.run.q[sample])
        first, second = loop.watched.poses(float(loop.run.t[sample]))["marks"]["loop"]
        np.testing.assert_allclose(first, data.oMf[model.getFrameId("coupler_tip")].translation, atol=POSE)
        np.testing.assert_allclose(second, data.oMf[model.getFrameId("rocker_tip")].translation, atol=POSE)


def test_seeking_changes_the_picture_and_only_seeking_does(arm: Any, loop: Any) -> None:
    for opened in (arm, loop):
        first, again = opened.watched.picture(0.0), opened.watched.picture(0.0)
        later = opened.watched.picture(float(opened.run.t[-1]))
        assert changed(first, later) > MOVED
        assert changed(first, again) == 0


def test_forces_are_drawn_read_out_and_can_be_hidden(loop: Any) -> None:
    watched = loop.watched
    shown = watched.picture(0.5)
    rows = watched.page.locator("#forces tr").all()
    cells = [
        [re.split(r"\n|\(", cell.strip())[0] for cell in row.locator("th, td").all_inner_texts()]
        for row in rows
    ]
    parts = watched.page.locator("#forces small").all_inner_texts()
    assert cells[0][-2:] == ["ideal", "nonideal"]
    size = float(np.linalg.norm(loop.run.lam[30]))
    assert cells[1] == ["loop", f"{0.75 * size:#.4g} N", f"{0.25 * size:#.4g} N"]
    assert cells[2] == ["crank", "", "0.6000 N m"]
    shown_parts = np.array([float(x) for x in parts[0].strip("()").split(",")])
    np.testing.assert_allclose(np.linalg.norm(shown_parts), 0.75 * size, rtol=1e-3)
    watched.page.keyboard.press("f")
    hidden = watched.picture(0.5)
    watched.page.keyboard.press("f")
    assert np.count_nonzero(np.abs(shown - hidden).max(axis=2) > 40) > 200

    def colored(picture: np.ndarray, color: tuple[int, int, int]) -> int:
        return int(np.count_nonzero(np.abs(picture - np.array(color)).max(axis=2) < 60))

    for color in ((37, 99, 235), (234, 88, 12)):  # ideal blue, nonideal orange
        assert colored(shown, color) > colored(hidden, color) + 50


def test_sizes_stay_within_their_budgets(arm: Any, loop: Any) -> None:
    assert arm.path.stat().st_size < BUDGET["panda"]
    assert loop.path.stat().st_size < BUDGET["four_bar"]


def test_a_page_that_is_not_compressed_shows_the_same(browser: Any, loop: Any, tmp_path: Path) -> None:
    path = replay(loop.run, tmp_path / "plain.html", compress=False)
    assert path.stat().st_size > 2 * loop.path.stat().st_size
    watched = Watched(browser, path)
    assert watched.complaints == []
    assert watched.poses(0.5) == loop.watched.poses(0.5)
    watched.close()


def test_names_cannot_break_out_of_the_page(browser: Any, tmp_path: Path) -> None:
    evil = (
        "</script></title><script>window.broken = 1</script><img src=x onerror='window.broken = 1'>{{title}}"
    )
    model = jointed(pin.JointModelRZ(), name=evil)
    model.names[1] = evil
    add_frame(model, evil, 1, [0.4, 0.0, 0.0])
    run = run_of(
        model,
        [0.0, 1.0],
        lambda t: np.array([t]),
        modes=np.zeros((2, 1), dtype=np.int8),
        element_names=[evil],
        events=[SimpleNamespace(time=0.5, kind=evil, element=evil)],
        F_nonideal=np.ones((2, 1)),
    )
    path = replay(run, tmp_path / "evil.html", plots=["q", (evil, {evil: np.ones(2)})])
    watched = Watched(browser, path)
    assert watched.run("() => window.broken || null") is None
    assert watched.complaints == []
    assert watched.page.title() == evil
    assert watched.page.locator("h1").inner_text() == evil
    assert len(watched.poses(0.0)["joints"]) == 2
    watched.close()


def test_a_damaged_page_says_so(browser: Any, loop: Any, tmp_path: Path) -> None:
    text = loop.path.read_text(encoding="utf-8")
    path = tmp_path / "damaged.html"
    path.write_text(re.sub(r'(id="payload">).{4000}', r"\1", text), encoding="utf-8")
    watched = Watched(browser, path)
    assert watched.run("() => window.replayError")
    assert "This replay cannot be shown." in watched.page.locator("#message").inner_text()
    watched.close()


def test_one_sample_is_a_still_picture(browser: Any, tmp_path: Path) -> None:
    run = run_of(jointed(pin.JointModelRZ()), [2.0], lambda t: np.array([t]))
    watched = Watched(browser, replay(run, tmp_path / "still.html"))
    assert watched.complaints == []
    assert watched.run("() => [replay.time, replay.duration]") == [2.0, 0.0]
    watched.close()


def test_a_simulated_robot_stands_where_its_run_says(browser: Any, tmp_path: Path) -> None:
    scene = pn.load("four_bar")
    run = pn.simulate(scene, 0.2, output_dt=1.0 / 60.0, record=("forces", "energy"))
    watched = Watched(browser, pn.replay(run, tmp_path / "simulated.html"))
    assert watched.complaints == []
    data, visual_data = scene.model.createData(), scene.visual_model.createData()
    for sample in (0, len(run.t) - 1):
        pin.updateGeometryPlacements(scene.model, data, scene.visual_model, visual_data, run.q[sample])
        pin.updateFramePlacements(scene.model, data)
        shown = watched.poses(float(run.t[sample]))
        for item, placement in zip(scene.visual_model.geometryObjects, visual_data.oMg, strict=True):
            np.testing.assert_allclose(shown["visuals"][item.name], placement.homogeneous, atol=POSE)
        (ends,) = shown["marks"].values()
        anchor = scene.constraints[0]
        for end, name in zip(ends, (anchor.frame1, anchor.frame2), strict=True):
            place = data.oMf[scene.model.getFrameId(name)].translation
            np.testing.assert_allclose(end, place, atol=POSE)
    watched.close()


@pytest.mark.slow
def test_a_notebook_shows_the_page_in_place(browser: Any, loop: Any) -> None:
    page = replay(loop.run)
    assert isinstance(page, ReplayPage)
    assert len(repr(page)) < 100
    text = page._repr_html_()
    assert html.unescape(re.search(r'srcdoc="(.*?)"', text, re.DOTALL)[1]) == page.text
    context = browser.new_context(offline=True)
    notebook = context.new_page()
    notebook.set_content(f"<body>{text}</body>")
    frame = notebook.locator("iframe").element_handle().content_frame()
    frame.wait_for_function("() => window.replayDone", timeout=TIMEOUT)
    context.close()
