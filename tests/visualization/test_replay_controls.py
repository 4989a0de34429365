"""Controls of a replay page in a browser: time line, keys, pointer and camera."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ..support.replay_browser import MOVED, Watched, changed, headless_browser, opened_replay
from ..support.replay_runs import four_bar, panda


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
    times = watched.run("() => replay.times")
    watched.run("t => replay.seek(t)", times[300])
    for key, expected in (
        ("ArrowRight", times[301]),
        ("ArrowLeft", times[300]),
        ("Shift+ArrowRight", times[310]),
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


@pytest.mark.slow
def test_an_event_is_named_under_the_pointer(arm: Any) -> None:
    box = arm.page.locator("#timeline").bounding_box()
    found = ""
    for pixel in range(0, int(box["width"]), 4):
        arm.page.mouse.move(box["x"] + pixel, box["y"] + 6)
        found = arm.page.locator("#tip").inner_text() if arm.page.locator("#tip").is_visible() else ""
        if found:
            break
    arm.page.mouse.move(5, 5)
    assert found.split() == ["0.2000", "s", "slip", "panda_joint2"]
    # The mark stands at 0.2 of 0.5 s.
    assert pixel / box["width"] == pytest.approx(0.4, abs=0.1)


def test_the_camera_turns_and_returns(loop: Any) -> None:
    before = loop.watched.picture(0.0)
    box = loop.page.locator("#scene").bounding_box()
    loop.page.mouse.move(box["x"] + 300, box["y"] + 150)
    loop.page.mouse.down()
    loop.page.mouse.move(box["x"] + 450, box["y"] + 170, steps=4)
    loop.page.mouse.up()
    turned = loop.watched.picture(0.0)
    assert changed(before, turned) > MOVED
    loop.page.keyboard.press("r")
    inside = (slice(4, -4), slice(4, -4))  # without the focus ring
    assert changed(before[inside], loop.watched.picture(0.0)[inside]) == 0


@pytest.mark.slow
def test_it_plays_by_itself_unless_told_not_to(browser: Any, loop: Any) -> None:
    watched = Watched(browser, loop.path, fragment="")
    watched.page.wait_for_function("() => replay.playing && replay.time > 0")
    watched.close()


def test_keys_go_from_event_to_event(arm: Any) -> None:
    watched, keyboard = arm.watched, arm.page.keyboard
    watched.run("() => replay.seek(0)")
    keyboard.press("n")
    assert watched.run("() => replay.time") == pytest.approx(0.2)
    keyboard.press("n")  # there is no other
    assert watched.run("() => replay.time") == pytest.approx(0.2)
    keyboard.press("End")
    keyboard.press("b")
    assert watched.run("() => replay.time") == pytest.approx(0.2)


def test_time_axes_zoom_together_and_come_back(loop: Any) -> None:
    watched, page = loop.watched, loop.page
    box = page.locator("#plots canvas >> nth=0").bounding_box()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 40)
    page.mouse.wheel(0, -400)
    start, end = watched.run("() => replay.span")
    assert end - start == pytest.approx(np.exp(-0.7), rel=0.02)
    around = (0.7 * box["width"] - 52) / (
        box["width"] - 60
    )  # the axis begins at 52 pixels, ends 8 before the edge
    assert start < around < end
    line = page.locator("#timeline").bounding_box()
    page.mouse.click(line["x"] + line["width"] - 8, line["y"] + 10)
    assert watched.run("() => replay.time") == pytest.approx(end, abs=0.01)
    page.keyboard.press("0")
    assert watched.run("() => replay.span") == [0.0, 1.0]
    page.keyboard.press("Home")


def test_a_part_of_the_run_is_repeated(loop: Any) -> None:
    watched, keyboard = loop.watched, loop.page.keyboard
    for time, key in ((0.4, "["), (0.45, "]")):
        watched.run("t => replay.seek(t)", time)
        keyboard.press(key)
    watched.run("() => { replay.seek(0.44); replay.play(); }")
    watched.page.wait_for_function("() => replay.time < 0.44")
    assert watched.run("() => replay.time") >= 0.4
    watched.run("() => replay.pause()")
    keyboard.press("\\")


def test_space_presses_the_button_that_has_the_focus(loop: Any) -> None:
    watched, page = loop.watched, loop.page
    watched.run("() => { replay.seek(0.5); document.getElementById('plots-toggle').focus(); }")
    page.keyboard.press("Space")
    assert watched.run("() => replay.playing") is False
    assert not page.locator("#plots").is_visible()
    page.keyboard.press("Space")
    assert page.locator("#plots").is_visible()
    watched.run("() => document.activeElement.blur()")


def test_the_time_line_is_a_slider_for_the_keyboard_and_for_readers(loop: Any) -> None:
    page = loop.page
    page.locator("#timeline").focus()
    page.keyboard.press("End")
    slider = page.locator("#timeline")
    assert slider.get_attribute("role") == "slider"
    assert [float(slider.get_attribute(f"aria-value{x}")) for x in ("min", "now", "max")] == [0.0, 1.0, 1.0]
    page.keyboard.press("PageUp")
    assert float(slider.get_attribute("aria-valuenow")) == pytest.approx(0.9)
    assert slider.get_attribute("aria-valuetext").endswith(" s")
