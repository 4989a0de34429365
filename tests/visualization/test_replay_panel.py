"""Panel of a replay page: tree of the scene, plotted signals, overlays, views, the URL."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.visualization.page.signal_list import inertia_box, signals_of

from ..support.replay_browser import Watched, changed, headless_browser
from ..support.replay_runs import four_bar


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with headless_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def loop(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The four-bar, its page with the panel open."""
    path = pn.replay(four_bar(), tmp_path_factory.mktemp("loop") / "four_bar.html")
    watched = Watched(browser, path)
    watched.page.keyboard.press("t")
    for group in watched.page.locator("#panel details").all():
        group.evaluate("one => { one.open = true; }")
    yield watched
    assert watched.complaints == []
    watched.close()


def moved(page: Watched, action: Any) -> int:
    """Pixels that an action changes in the view, its focus ring and tip apart."""
    page.page.mouse.move(2, 2)
    before = page.picture(0.5)
    action()
    page.page.mouse.move(2, 2)
    return changed(before, page.picture(0.5))


def row(page: Watched, tree: str, text: str) -> Any:
    return page.page.locator(f"#tree-{tree} li", has_text=text).first


def test_bodies_can_be_hidden_and_shown_again(loop: Watched) -> None:
    box = row(loop, "bodies", "coupler").locator("input")
    assert moved(loop, box.uncheck) > 300
    assert moved(loop, box.check) > 300


def test_a_body_can_be_shown_alone(loop: Watched) -> None:
    assert moved(loop, row(loop, "bodies", "crank").get_by_text("only").click) > 300
    boxes = loop.page.locator("#tree-bodies input").all()
    assert sum(box.is_checked() for box in boxes) == 1
    for box in boxes:
        box.check()


def test_forces_and_constraints_have_boxes_of_their_own(loop: Watched) -> None:
    for tree, text in (("arrows", "loop, ideal"), ("constraints", "loop")):
        box = row(loop, tree, text).locator("input")
        assert moved(loop, box.uncheck) > 20, tree
        box.check()


MORE = ("#show-masses", "#show-inertias", "#fade")
OVERLAYS = ["#show-frames", *(pytest.param(name, marks=pytest.mark.slow) for name in MORE)]


@pytest.mark.parametrize("name", OVERLAYS)
def test_overlays_are_drawn_and_taken_away(loop: Watched, name: str) -> None:
    box = loop.page.locator(name)
    assert moved(loop, box.check) > 50
    assert moved(loop, box.uncheck) > 50


def test_the_path_of_a_body_can_be_drawn(loop: Watched) -> None:
    button = row(loop, "bodies", "rocker").get_by_text("path")  # drawn from the start: it has no shapes
    assert moved(loop, button.click) > 30
    assert moved(loop, button.click) > 30


def test_searching_leaves_what_fits(loop: Watched) -> None:
    loop.page.locator("#search").fill("COUPL")
    shown = [item.inner_text() for item in loop.page.locator("#tree-bodies li:visible").all()]
    assert len(shown) == 1
    assert "coupler" in shown[0]
    loop.page.locator("#search").fill("")


def test_plots_are_composed_of_signals(loop: Watched) -> None:
    page = loop.page
    before = page.locator(".plot").count()
    row(loop, "signals", "crank, velocity").locator("input").check()
    row(loop, "signals", "rocker, velocity").locator("input").check()
    assert page.locator(".plot").count() == before + 1  # one unit, one plot
    loop.run("() => replay.seek(0)")
    reading = page.locator(".plot li", has_text="crank, velocity").locator("b").inner_text()
    assert float(reading) == pytest.approx(four_bar().v[0, 0], rel=1e-3)
    row(loop, "signals", "crank, position").locator("input").check()
    assert page.locator(".plot").count() == before + 2
    for name in ("crank, velocity", "rocker, velocity", "crank, position"):
        row(loop, "signals", name).locator("input").uncheck()
    assert page.locator(".plot").count() == before


def test_the_camera_follows_a_chosen_body(loop: Watched) -> None:
    row(loop, "bodies", "coupler").get_by_text("follow").click()
    places = []
    for time in (0.1, 0.6):
        loop.run("t => replay.seek(t)", time)
        place = np.array(loop.poses(time)["joints"]["coupler"])[:3, 3]
        places.append(loop.run("p => replay.onScreen(p)", place.tolist()))
    np.testing.assert_allclose(places[0], places[1], atol=1.0)  # pixels
    loop.page.locator("#follow").click()
    loop.page.keyboard.press("r")


def test_views_look_along_the_axes(loop: Watched) -> None:
    pictures = []
    for name in ("front", "side", "top", "usual"):
        loop.page.locator("#views button", has_text=name).click()
        pictures.append(loop.picture(0.5))
    assert min(changed(pictures[i], pictures[j]) for i in range(4) for j in range(i)) > 300


def test_the_address_brings_back_what_was_seen(browser: Any, loop: Watched, tmp_path: Any) -> None:
    loop.run("() => { replay.seek(0.4321); document.getElementById('speed').value = '0.5'; }")
    loop.page.locator("#speed").select_option("0.5")
    loop.page.locator("#views button", has_text="top").click()
    address = loop.run("() => replay.address")
    path = pn.replay(four_bar(), tmp_path / "again.html")
    again = Watched(browser, path, fragment=address)
    assert again.run("() => replay.time") == pytest.approx(0.4321, abs=1e-6)
    assert again.run("() => replay.speed") == 0.5
    assert again.run("() => replay.playing") is False
    camera = [float(x) for x in address.split("cam=")[1].split("&")[0].split(",")]
    now = again.run("() => replay.address").split("cam=")[1].split("&")[0].split(",")
    np.testing.assert_allclose([float(x) for x in now], camera, rtol=1e-5, atol=1e-9)
    again.page.wait_for_function("() => location.hash.includes('t=0.4321')")
    again.close()
    loop.page.locator("#views button", has_text="usual").click()


def test_escape_closes_the_panel_and_every_control_has_a_name(loop: Watched) -> None:
    nameless = loop.run("""() => [...document.querySelectorAll("button, input, select")]
      .filter((item) => !(item.ariaLabel || item.textContent.trim() || item.closest("label")))
      .map((item) => item.id)""")
    assert nameless == []
    loop.page.locator("#search").focus()
    loop.page.keyboard.press("Escape")
    assert not loop.page.locator("#panel").is_visible()
    loop.page.keyboard.press("t")
    assert loop.page.locator("#panel").is_visible()


def test_tab_walks_through_all_controls(loop: Watched) -> None:
    loop.run("() => document.activeElement.blur()")
    seen = set()
    for _ in range(120):
        loop.page.keyboard.press("Tab")
        seen.add(loop.run("() => document.activeElement.id || document.activeElement.tagName"))
    wanted = {
        "scene",
        "search",
        "fade",
        "forces-toggle",
        "panel-toggle",
        "follow",
        "play",
        "speed",
        "loop",
        "timeline",
    }
    assert wanted <= seen


def test_the_page_is_dark_where_the_browser_is(browser: Any, tmp_path: Any) -> None:
    path = pn.replay(four_bar(), tmp_path / "dark.html")
    context = browser.new_context(color_scheme="dark", offline=True)
    page = context.new_page()
    page.goto(path.resolve().as_uri() + "#paused")
    page.wait_for_function("() => window.replayDone || window.replayError")
    shade = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    assert max(int(x) for x in shade.strip("rgb()").split(",")) < 80
    context.close()


def test_a_box_of_inertia_has_the_inertia_of_its_body() -> None:
    rng = np.random.default_rng(5)
    turn = pin.exp3(rng.normal(size=3))
    edges = np.array([0.3, 0.5, 0.9])
    moments = (
        2.0
        / 12.0
        * np.array(
            [edges[1] ** 2 + edges[2] ** 2, edges[0] ** 2 + edges[2] ** 2, edges[0] ** 2 + edges[1] ** 2]
        )
    )
    found = inertia_box(pin.Inertia(2.0, rng.normal(size=3), turn @ np.diag(moments) @ turn.T))
    np.testing.assert_allclose(sorted(found["edges"]), edges, atol=1e-12)
    axes = pin.Quaternion(np.array(found["turn"])).matrix()
    e = np.array(found["edges"])
    again = axes @ np.diag(2.0 / 12.0 * ((e**2).sum() - e**2)) @ axes.T
    np.testing.assert_allclose(again, turn @ np.diag(moments) @ turn.T, atol=1e-12)


def test_signals_are_all_that_was_recorded_and_keep_their_peaks() -> None:
    run = four_bar(count=5001)
    run.v[1234, 1] = 77.0
    found = {signal.label: signal for signal in signals_of(run, run)}
    assert {"crank, position", "coupler, velocity", "loop, |lam|"} <= set(found)
    assert found["coupler, velocity"].values.max() == 77.0
    assert len(found["coupler, velocity"].t) < 2000
