"""The replay page: opened from file:// by a headless browser without network, and compared with Pinocchio."""

from __future__ import annotations

import html
import importlib.util
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, OutputError
from pin_nonideal.replay import ReplayPage, replay
from pin_nonideal.replay_payload import packed_run

from .replay_runs import add_frame, four_bar, jointed, panda, run_of

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = [
    "--no-sandbox",
    "--no-first-run",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
SIZE = (1000, 720)
TIMEOUT = 60_000  # milliseconds; a software renderer on a busy machine takes seconds
# Poses travel as 32-bit floats: 6e-8 relative, on lengths near 1 m and through a product of rotations.
POSE = 1e-5
MOVED = 2000  # pixels: a robot that fills the view moves several times as many

# Sizes in bytes, with a fifth to spare over what was measured; the viewer library takes 0.29 MB of each.
BUDGET = {"panda": 2_500_000, "four_bar": 500_000}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    if BROWSER is None:
        pytest.skip("needs chromium, chromium-browser or google-chrome on the path")
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        yield opened
        opened.close()


class Watched:
    """A page opened without network, with all that it complained about and asked for."""

    def __init__(self, browser: Any, path: Path, fragment: str = "paused") -> None:
        self.context = browser.new_context(viewport={"width": SIZE[0], "height": SIZE[1]}, offline=True)
        self.page = self.context.new_page()
        self.page.set_default_timeout(TIMEOUT)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.hear(message.type, message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(f"{path.resolve().as_uri()}#{fragment}")
        self.page.wait_for_function("() => window.replayDone || window.replayError")

    def hear(self, kind: str, text: str) -> None:
        if kind in ("error", "warning") and "GPU stall" not in text and "GL Driver" not in text:
            self.complaints.append(text)

    def run(self, script: str, argument: object = None) -> Any:
        return self.page.evaluate(script, argument)

    def poses(self, time: float) -> Any:
        return self.run("time => { replay.seek(time); return replay.poses(); }", time)

    def picture(self, time: float) -> np.ndarray:
        """The three-dimensional view at a time, as red, green and blue, (height, width, 3)."""
        from PIL import Image

        self.run("time => replay.seek(time)", time)
        self.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        shot = self.page.locator("#scene").screenshot()
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("replays")


@pytest.fixture(scope="module")
def arm(browser: Any, folder: Path) -> Iterator[SimpleNamespace]:
    """The Panda with meshes, and its page."""
    run = panda()
    path = replay(run, folder / "panda.html")
    watched = Watched(browser, path)
    yield SimpleNamespace(run=run, path=path, watched=watched, page=watched.page)
    watched.context.close()


@pytest.fixture(scope="module")
def loop(browser: Any, folder: Path) -> Iterator[SimpleNamespace]:
    """The four-bar without geometry, and its page."""
    run = four_bar()
    path = replay(run, folder / "four_bar.html")
    watched = Watched(browser, path)
    yield SimpleNamespace(run=run, path=path, watched=watched, page=watched.page)
    watched.context.close()


def test_the_page_opens_without_a_request_an_error_or_a_warning(arm: Any, loop: Any) -> None:
    for opened in (arm, loop):
        assert opened.watched.run("() => window.replayError || null") is None
        assert opened.watched.run("() => replay.ready") is True
        assert opened.watched.requests == [opened.path.resolve().as_uri()]
        assert opened.watched.complaints == []


def test_the_watch_hears_what_reaches_for_the_network(browser: Any, loop: Any, folder: Path) -> None:
    """Negative control of the test above."""
    text = loop.path.read_text(encoding="utf-8")
    spoiled = folder / "spoiled.html"
    spoiled.write_text(
        text.replace("<body>", '<body><img src="http://127.0.0.1:9/dot.png">'), encoding="utf-8"
    )
    watched = Watched(browser, spoiled)
    assert any("Content Security Policy" in complaint for complaint in watched.complaints)
    watched.context.close()


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


def test_between_frames_joints_move_evenly(loop: Any) -> None:
    before, between, after = (
        {name: np.array(pose) for name, pose in loop.watched.poses((6 + part) / 60.0)["joints"].items()}
        for part in (0.0, 0.5, 1.0)
    )
    for name, pose in between.items():
        # Halfway along the straight line, and halfway along the turn: its square is the whole turn.
        np.testing.assert_allclose(pose[:3, 3], (before[name] + after[name])[:3, 3] / 2.0, atol=POSE)
        half, whole = before[name][:3, :3].T @ pose[:3, :3], before[name][:3, :3].T @ after[name][:3, :3]
        np.testing.assert_allclose(half @ half, whole, atol=POSE)
    assert np.abs(between["coupler"] - before["coupler"]).max() > 100.0 * POSE


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
        assert np.count_nonzero(np.abs(later - first).max(axis=2) > 20) > MOVED
        assert np.count_nonzero(np.abs(again - first).max(axis=2) > 20) == 0


def test_playing_advances_and_pausing_stops(loop: Any) -> None:
    watched = loop.watched
    watched.run("() => { replay.seek(0); replay.play(); }")
    watched.page.wait_for_function("() => replay.time > 0.02")
    watched.run("() => replay.pause()")
    stopped = watched.run("() => replay.time")
    assert watched.run("() => new Promise(done => setTimeout(() => done(replay.time), 200))") == stopped
    assert watched.run("() => replay.playing") is False


def test_playing_goes_round_when_it_loops_and_stops_at_the_end_when_not(loop: Any) -> None:
    watched = loop.watched
    watched.run(
        "() => { document.getElementById('loop').checked = false; replay.seek(0.97); replay.play(); }"
    )
    watched.page.wait_for_function("() => !replay.playing")
    assert watched.run("() => replay.time") == pytest.approx(1.0)
    watched.run("() => { document.getElementById('loop').checked = true; replay.seek(0.97); replay.play(); }")
    watched.page.wait_for_function("() => replay.time < 0.9")
    watched.run("() => replay.pause()")


def test_seeking_is_held_between_the_ends(loop: Any) -> None:
    assert loop.watched.run("() => { replay.seek(-3); return replay.time; }") == 0.0
    assert loop.watched.run("() => { replay.seek(99); return replay.time; }") == pytest.approx(1.0)
    assert loop.watched.run("() => replay.duration") == pytest.approx(1.0)


@pytest.mark.parametrize("where", ["#timeline", "#plots canvas >> nth=0", "#plots canvas >> nth=1"])
def test_a_click_on_the_time_line_or_a_plot_seeks(loop: Any, where: str) -> None:
    box = loop.page.locator(where).bounding_box()
    times = []
    for part in (0.4, 0.8):
        loop.page.mouse.click(box["x"] + part * box["width"], box["y"] + 0.4 * box["height"])
        times.append(loop.watched.run("() => replay.time"))
    # The axis begins within 60 pixels of the left edge and ends within 10 of the right one.
    assert times[1] - times[0] == pytest.approx(0.4, rel=0.3)
    assert times[1] == pytest.approx(0.8, abs=0.06)


def test_keys_play_step_and_jump(loop: Any) -> None:
    watched, keyboard = loop.watched, loop.page.keyboard
    watched.run("() => replay.seek(0.5)")
    frame = 1.0 / 60.0
    for key, expected in (
        ("ArrowRight", 0.5 + frame),
        ("ArrowLeft", 0.5),
        ("Shift+ArrowRight", 0.5 + 10 * frame),
        ("Home", 0.0),
        ("End", 1.0),
    ):
        keyboard.press(key)
        assert watched.run("() => replay.time") == pytest.approx(expected, abs=1e-9), key
    keyboard.press("Home")
    keyboard.press("Space")
    watched.page.wait_for_function("() => replay.playing && replay.time > 0")
    keyboard.press("Space")
    assert watched.run("() => replay.playing") is False


def test_forces_are_drawn_read_out_and_can_be_hidden(loop: Any) -> None:
    watched = loop.watched
    shown = watched.picture(0.5)
    rows = watched.page.locator("#forces tr").all_inner_texts()
    cells = [re.split(r"\s*\t\s*", row.strip()) for row in rows]
    assert cells[0][-2:] == ["ideal", "nonideal"]
    size = float(np.linalg.norm(loop.run.lam[30]))
    assert cells[1] == ["loop", f"{0.75 * size:#.4g} N", f"{0.25 * size:#.4g} N"]
    assert cells[2] == ["crank", "0.6000 N m"]
    watched.page.keyboard.press("f")
    hidden = watched.picture(0.5)
    watched.page.keyboard.press("f")
    assert np.count_nonzero(np.abs(shown - hidden).max(axis=2) > 40) > 200

    def colored(picture: np.ndarray, color: tuple[int, int, int]) -> int:
        return int(np.count_nonzero(np.abs(picture - np.array(color)).max(axis=2) < 60))

    for color in ((37, 99, 235), (234, 88, 12)):  # ideal blue, nonideal orange
        assert colored(shown, color) > colored(hidden, color) + 50


def test_the_reading_of_a_plot_follows_the_pointer(arm: Any) -> None:
    arm.watched.run("() => replay.seek(0)")
    reading = arm.page.locator("#plots li", has_text="kinetic").locator("b")
    assert reading.inner_text() == "0"
    box = arm.page.locator("#plots canvas").nth(0).bounding_box()
    arm.page.mouse.move(box["x"] + box["width"] - 8, box["y"] + 50)
    expected = float(arm.run.energy["kinetic"][-1])
    assert float(reading.inner_text()) == pytest.approx(expected, rel=1e-2)
    arm.page.mouse.move(5, 5)
    assert reading.inner_text() == "0"


def test_an_event_is_named_under_the_pointer(arm: Any) -> None:
    box = arm.page.locator("#timeline").bounding_box()
    left = arm.watched.run("() => 0") + box["x"]
    found = ""
    for pixel in range(0, int(box["width"]), 4):
        arm.page.mouse.move(left + pixel, box["y"] + 6)
        found = arm.page.locator("#tip").inner_text() if arm.page.locator("#tip").is_visible() else ""
        if found:
            break
    arm.page.mouse.move(5, 5)
    assert found.split() == ["0.2000", "s", "slip", "panda_joint2"]
    # The mark stands at 0.2 of 0.5 s.
    assert pixel / box["width"] == pytest.approx(0.4, abs=0.1)


def test_the_camera_turns_and_returns(arm: Any) -> None:
    before = arm.watched.picture(0.0)
    box = arm.page.locator("#scene").bounding_box()
    arm.page.mouse.move(box["x"] + 300, box["y"] + 150)
    arm.page.mouse.down()
    arm.page.mouse.move(box["x"] + 450, box["y"] + 170, steps=4)
    arm.page.mouse.up()
    turned = arm.watched.picture(0.0)
    assert np.count_nonzero(np.abs(turned - before).max(axis=2) > 20) > MOVED
    arm.page.keyboard.press("r")
    assert np.count_nonzero(np.abs(arm.watched.picture(0.0) - before).max(axis=2) > 20) == 0


def test_sizes_stay_within_their_budgets(arm: Any, loop: Any) -> None:
    assert arm.path.stat().st_size < BUDGET["panda"]
    assert loop.path.stat().st_size < BUDGET["four_bar"]


def test_a_page_that_is_not_compressed_shows_the_same(browser: Any, loop: Any, folder: Path) -> None:
    path = replay(loop.run, folder / "plain.html", compress=False)
    assert path.stat().st_size > 2 * loop.path.stat().st_size
    watched = Watched(browser, path)
    assert watched.complaints == []
    assert watched.poses(0.5) == loop.watched.poses(0.5)
    watched.context.close()


def test_it_plays_by_itself_unless_told_not_to(browser: Any, loop: Any) -> None:
    watched = Watched(browser, loop.path, fragment="")
    watched.page.wait_for_function("() => replay.playing && replay.time > 0")
    watched.context.close()


def test_names_cannot_break_out_of_the_page(browser: Any, folder: Path) -> None:
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
    path = replay(run, folder / "evil.html", plots=["q", (evil, {evil: np.ones(2)})])
    watched = Watched(browser, path)
    assert watched.run("() => window.broken || null") is None
    assert watched.complaints == []
    assert watched.page.title() == evil
    assert watched.page.locator("h1").inner_text() == evil
    assert len(watched.poses(0.0)["joints"]) == 2
    watched.context.close()


def test_a_damaged_page_says_so(browser: Any, loop: Any, folder: Path) -> None:
    text = loop.path.read_text(encoding="utf-8")
    path = folder / "damaged.html"
    path.write_text(re.sub(r'(id="payload">).{4000}', r"\1", text), encoding="utf-8")
    watched = Watched(browser, path)
    assert watched.run("() => window.replayError")
    assert "This replay cannot be shown." in watched.page.locator("#message").inner_text()
    watched.context.close()


def test_one_sample_is_a_still_picture(browser: Any, folder: Path) -> None:
    run = run_of(jointed(pin.JointModelRZ()), [2.0], lambda t: np.array([t]))
    watched = Watched(browser, replay(run, folder / "still.html"))
    assert watched.complaints == []
    assert watched.run("() => [replay.time, replay.duration]") == [2.0, 0.0]
    watched.context.close()


def test_a_simulated_robot_stands_where_its_run_says(browser: Any, folder: Path) -> None:
    scene = pn.load("four_bar")
    run = pn.simulate(scene, 0.2, output_dt=1.0 / 60.0, record=("forces", "energy"))
    watched = Watched(browser, pn.replay(run, folder / "simulated.html"))
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
    watched.context.close()


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


# --- without a browser --------------------------------------------------------------------------------------


def test_the_file_is_the_page_and_overwrites_an_older_one(tmp_path: Path) -> None:
    path = tmp_path / "a.html"
    path.write_text("older")
    run = four_bar()
    assert replay(run, str(path)) == path
    assert path.read_text(encoding="utf-8") == replay(run).text
    assert os.listdir(tmp_path) == ["a.html"]
    new = tmp_path / "b.txt"
    new.touch()
    assert path.stat().st_mode == new.stat().st_mode  # a temporary file's own permissions would be narrower


@pytest.mark.parametrize("name", [name for name, _ in pn.robots()])
def test_every_robot_of_the_package_can_be_replayed(name: str) -> None:
    scene = pn.load(name)
    run = pn.simulate(scene, 1e-3, record=("forces", "energy"))
    content = packed_run(run, 1000.0, "title", None, True)
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    assert header["visuals"]
    assert len(header["joints"]) == scene.model.njoints
    assert {mark["name"] for mark in header["marks"]} >= {name for name, *_ in scene.anchor_frames}
    assert 0.05 < header["view"]["size"] < 10.0


def test_the_licenses_of_what_is_inside_are_in_plain_text() -> None:
    text = replay(four_bar()).text
    for words in (
        "meshcat, the viewer of this page",
        "three 0.132.2 (MIT)",
        "Copyright (c) 2018 Robin Deits",
        "Apache",
    ):
        assert words in text


@pytest.mark.parametrize("place", ["absent/a.html", "folder"])
def test_a_file_that_cannot_be_written_is_an_error_and_leaves_nothing(tmp_path: Path, place: str) -> None:
    (tmp_path / "folder").mkdir()
    reason = "No such file or directory" if place.startswith("absent") else "Is a directory"
    message = f'cannot write the replay to "{tmp_path / place}": {reason}; name a file in a folder '
    message += "that can be written"
    with pytest.raises(OutputError, match=f"^{re.escape(message)}$"):
        replay(four_bar(), tmp_path / place)
    assert os.listdir(tmp_path) == ["folder"]
    assert os.listdir(tmp_path / "folder") == []


def test_a_write_that_breaks_off_keeps_the_older_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.html"
    path.write_text("older")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OutputError, match="No space left on device"):
        replay(four_bar(), path)
    assert path.read_text() == "older"
    assert os.listdir(tmp_path) == ["a.html"]


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf"), "60"])
def test_frames_a_second_must_be_a_positive_number(fps: Any) -> None:
    with pytest.raises(InputError, match="replay: fps must be"):
        replay(four_bar(), fps=fps)


def test_a_run_without_its_scene_is_refused() -> None:
    run = four_bar()
    run.scene = None
    message = "a replay needs the scene of the run, which a trajectory read from a file has not: "
    message += "pass dataclasses.replace(run, scene=scene)"
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        replay(run)


def test_a_title_must_be_text() -> None:
    with pytest.raises(InputError, match="replay: title must be a string or None; got 3"):
        replay(four_bar(), title=3)  # type: ignore[arg-type]


def test_equal_shapes_are_stored_once() -> None:
    model = jointed(*[pin.JointModelRZ()] * 4)  # four equal bars, drawn in place of geometry
    content = packed_run(run_of(model, [0.0, 1.0], lambda t: np.full(4, t)), 60.0, "title", None, True)
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    assert len(header["visuals"]) == 8
    assert len(header["shapes"]) == 2


def test_a_missing_viewer_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    message = "a replay needs the package meshcat, which is missing: pip install meshcat"
    with pytest.raises(OutputError, match=f"^{message}$"):
        replay(four_bar())
    empty = SimpleNamespace(submodule_search_locations=[str(tmp_path)])
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: empty)
    with pytest.raises(OutputError, match=r"which cannot be read: pip install meshcat==0\.3\.2"):
        replay(four_bar())


def test_writing_a_replay_imports_neither_meshcat_nor_its_server() -> None:
    script = (
        "import sys\n"
        "from tests.replay_runs import four_bar\n"
        "from pin_nonideal.replay import replay\n"
        "replay(four_bar())\n"
        "print(sorted({'meshcat', 'zmq', 'tornado', 'umsgpack', 'matplotlib', 'scipy'} & set(sys.modules)))\n"
    )
    root = Path(__file__).resolve().parent.parent
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "[]", done.stderr
