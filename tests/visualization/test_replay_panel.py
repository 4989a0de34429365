"""Panel of a replay page: tree of the scene, plotted signals, overlays, views, the URL."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.trajectory.columns import column_name
from pin_nonideal.visualization.page import payload
from pin_nonideal.visualization.page.body_overlays import inertia_box
from pin_nonideal.visualization.page.signal_list import OTHERS, rounding_of, signals_of, without_rounding
from pin_nonideal.visualization.page.signals import default_plot_names

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
    reading = page.locator('.plot li button[title^="crank, velocity"]').locator("b").inner_text()
    assert float(reading) == pytest.approx(four_bar().v[0, 0], rel=1e-3)
    row(loop, "signals", "crank, position").locator("input").check()
    assert page.locator(".plot").count() == before + 1  # it joins the plot of positions
    position = page.locator(".plot", has_text="Position [rad]")
    assert position.locator("li").count() == 4
    for name in ("crank, velocity", "rocker, velocity", "crank, position"):
        row(loop, "signals", name).locator("input").uncheck()
    assert page.locator(".plot").count() == before
    assert position.locator("li").count() == 3


def test_a_search_opens_the_sections_that_have_hits(loop: Watched) -> None:
    """All words of a search must be in a row; without a search sections are as they were."""
    page = loop.page
    sections = page.locator("#panel details")
    page.locator("#tree-signals details").first.evaluate("one => { one.open = false; }")
    page.locator("#search").fill("friction crank")
    shown = [item.inner_text() for item in page.locator("#tree-signals li:visible").all()]
    assert shown == ["crank, friction, F_nonideal [N m]"]
    page.locator("#search").fill("nothing at all")
    assert page.locator("#panel li:visible").count() == 0
    page.locator("#search").fill("")
    assert not page.locator("#tree-signals details").first.evaluate("one => one.open")
    for section in sections.all():
        section.evaluate("one => { one.open = true; }")


@pytest.mark.slow
def test_curves_of_a_plot_are_eight_colors_and_then_dashed(loop: Watched) -> None:
    page = loop.page
    page.locator("#search").fill("N, N m")
    boxes = page.locator("#tree-signals li").filter(has_text="[N, N m]").locator("input").all()
    page.locator("#search").fill("")
    for box in boxes:
        box.check()
    looks = max(loop.run("() => replay.looks"), key=len)
    assert len(looks) == len(set(looks)) > 7
    for box in boxes:
        box.uncheck()


def test_one_quantity_over_another_is_plotted_and_seeks(loop: Watched) -> None:
    page = loop.page
    before = page.locator(".plot").count()
    row(loop, "relations", "phase rocker").locator("input").check()
    assert page.locator(".plot").count() == before + 1
    plot = page.locator(".plot").last
    assert plot.locator("h2").inner_text() == "phase rocker velocity [rad/s] over position [rad]"
    plot.locator("canvas").click(position={"x": 120, "y": 50})
    assert loop.run("() => replay.time") > 0.0
    row(loop, "relations", "phase rocker").locator("input").uncheck()
    assert page.locator(".plot").count() == before


@pytest.mark.parametrize("law", ["bearing", pytest.param("crank friction", marks=pytest.mark.slow)])
def test_headings_of_friction_name_it_once(law: str, browser: Any, tmp_path: Path) -> None:
    hinge = pn.JointFriction("crank_joint", mu=0.2, radius=0.01, viscous=0.3, name=law)
    scene = pn.load("four_bar").replace(laws=[hinge])
    run = pn.simulate(scene, 0.2, output_dt=0.01, record=("forces", "reactions"))
    kinds = ["friction", f"friction {law}", f"load {law}"]
    page = Watched(browser, pn.replay(run, tmp_path / "crank.html", plots=kinds))
    headings = [heading.inner_text() for heading in page.page.locator(".plot h2").all()]
    page.close()
    of_law = f"{law.removesuffix(' friction')} friction [N m]"
    assert headings == [
        "Friction [N m] over velocity [rad/s], dots: the limit",
        f"{of_law} over velocity [rad/s], dots: the limit",
        f"{of_law} over load across the axis [N], dots: the limit",
    ]


WIDER = ((900, 500), (1400, 900))
SIZES = [(420, 800), *(pytest.param(size, marks=pytest.mark.slow) for size in WIDER)]


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_panels_cover_no_control_and_curves_are_tall(loop: Watched, size: tuple[int, int]) -> None:
    loop.page.set_viewport_size({"width": size[0], "height": size[1]})
    loop.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    covered = loop.run("""() => [...document.querySelectorAll("#tools button, #transport button")]
      .concat(document.getElementById("forces-toggle"))
      .filter((item) => item.offsetParent).filter((item) => {
        const { left, top, width, height } = item.getBoundingClientRect();
        const hit = document.elementFromPoint(left + width / 2, top + height / 2);
        return hit !== item && !item.contains(hit);
      }).map((item) => item.id)""")
    heights = loop.run("() => replay.curveHeights")
    list_height = loop.run("() => document.querySelector('#panel .scroll').clientHeight")
    loop.page.set_viewport_size({"width": 1000, "height": 720})
    assert covered == []
    assert min(heights) >= 100
    assert list_height > 60


@pytest.fixture(scope="module")
def feet(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A quadruped on its feet: torques, friction and contacts with long names, eight curves in a plot."""
    scene = pn.load("solo12_dropped")
    contacts = [replace(c, name=f"{c.name} on the rough ground {k}") for k, c in enumerate(scene.contacts)]
    friction = pn.JointFriction.for_joints(scene, coulomb=0.01)
    run = pn.simulate(
        scene.replace(contacts=contacts, laws=friction),
        0.3,
        method="moreau",
        dt=1e-3,
        record=("forces", "energy"),
    )
    watched = Watched(browser, pn.replay(run, tmp_path_factory.mktemp("feet") / "feet.html"))
    watched.run("() => replay.seek(0.25)")
    yield watched
    watched.close()


LAYOUT = """() => {
  const box = (e) => e.getBoundingClientRect(), scroll = document.querySelector("#forces .scroll");
  const names = [...scroll.querySelectorAll("tbody td:first-child")];
  return {
    cut: scroll.scrollWidth - scroll.clientWidth,
    ends: [...scroll.querySelectorAll("tr")].map((row) => box(row).bottom - box(scroll).bottom),
    names: new Set(names.map((e) => e.textContent)).size, titles: new Set(names.map((e) => e.title)).size,
    titles_cut: [...document.querySelectorAll(".plot h2")].map((e) => e.scrollWidth - e.clientWidth),
    legends: [...document.querySelectorAll(".plot ul")].map((e) => e.scrollHeight - e.clientHeight),
    rows: [...document.querySelectorAll("#legend span")].map((e) => box(e).top),
    heading: ["subtitle", "gap"].map((name) => box(document.getElementById(name)).left),
    subtitle: document.querySelector("#subtitle").textContent,
  };
}"""


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_tables_and_legends_are_whole(feet: Watched, size: tuple[int, int]) -> None:
    feet.page.set_viewport_size({"width": size[0], "height": size[1]})
    feet.run("() => { replay.showForces(true); dispatchEvent(new Event('resize')); }")
    feet.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    found = feet.run(LAYOUT)
    assert found["cut"] <= (1 if size[0] > 640 else 60)
    assert min(abs(end) for end in found["ends"]) < 1.0  # a row ends where the table ends
    assert found["names"] == found["titles"] > 10
    assert max(found["legends"]) <= 1
    assert max(found["titles_cut"]) <= 0
    assert found["subtitle"].startswith("13 joints · 4 contacts · ")
    assert len(set(found["rows"])) <= 2


RANGES = """() => ["#forces .scroll", "#lanes"].map((name) => {
  const box = document.querySelector(name);
  const note = box.parentElement.querySelector(":scope > .range, h2 .range");
  const all = name === "#lanes" ? box.scrollHeight / 13 : box.querySelectorAll("tbody tr").length;
  return [box.scrollHeight > box.clientHeight + 1, note.offsetHeight > 0 ? note.textContent : "", all];
})"""


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_lists_with_hidden_rows_tell_which_rows_are_visible(feet: Watched, size: tuple[int, int]) -> None:
    feet.page.set_viewport_size({"width": size[0], "height": size[1]})
    feet.run("() => { replay.showForces(true); dispatchEvent(new Event('resize')); }")
    drawn = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
    feet.run(drawn)
    found = feet.run(RANGES)
    if size == (900, 500):
        assert [cut for cut, _, _ in found] == [True, True]
    for cut, text, count in found:
        assert bool(text) == cut
        assert not cut or re.fullmatch(rf"1 to \d+ of {count} ↕", text)
    feet.run(
        "() => document.querySelectorAll('#forces .scroll, #lanes').forEach((box) => box.scrollTo(0, 9999))"
    )
    feet.run(drawn)
    for cut, text, count in feet.run(RANGES):
        assert not cut or re.fullmatch(rf"\d+ to {count} of {count} ↕", text)
    feet.run(
        "() => document.querySelectorAll('#forces .scroll, #lanes').forEach((box) => box.scrollTo(0, 0))"
    )


def test_the_gap_of_a_loop_begins_its_line_where_the_line_above_begins(loop: Watched) -> None:
    loop.page.set_viewport_size({"width": 420, "height": 800})
    lefts = loop.run(LAYOUT)["heading"]
    loop.page.set_viewport_size({"width": 1000, "height": 720})
    assert len(lefts) == 2
    assert lefts[0] == lefts[1]


def test_zero_among_powers_of_ten_has_a_short_label(loop: Watched) -> None:
    """A label of nine decimals would be cut at the edge of the plot."""
    steps = "() => [stepLabel(0, 5e-11), stepLabel(5e-11, 5e-11), stepLabel(0, 0.5), stepLabel(0, 2e6)]"
    assert loop.run(steps) == ["0", "5e-11", "0.0", "0"]


COVERED = """() => {
  const box = (e) => e.getBoundingClientRect();
  const shown = (e) => box(e).width > 0 && getComputedStyle(e).visibility !== "hidden";
  const cards = [...document.querySelectorAll("#heading, #forces, #tools")].filter(shown).map(box);
  const labels = [...document.querySelectorAll("#labels span")].filter((e) => shown(e) && e.textContent);
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const covered = labels.filter((e) => cards.some((card) => meet(box(e), card)));
  return [labels.length, covered.map((e) => e.textContent)];
}"""


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_values_of_forces_are_beside_the_cards(loop: Watched, size: tuple[int, int]) -> None:
    """A value under the heading or under the table of forces would be illegible."""
    loop.page.set_viewport_size({"width": size[0], "height": size[1]})
    loop.run("() => { replay.showForces(true); replay.resetView(); }")
    count = 0
    for k in range(12):
        loop.run("k => replay.seek(replay.start + k / 12 * replay.duration)", k)
        number, covered = loop.run(COVERED)
        assert covered == []
        count += number
    assert count > 5
    loop.page.set_viewport_size({"width": 1000, "height": 720})


def test_the_splitter_gives_room_to_the_plots(loop: Watched) -> None:
    height = "() => document.getElementById('dock').offsetHeight"
    before, stage = loop.run(height), loop.page.locator("#stage").bounding_box()["height"]
    handle = loop.page.locator("#splitter").bounding_box()
    loop.page.mouse.move(300, handle["y"] + 3)
    loop.page.mouse.down()
    loop.page.mouse.move(300, handle["y"] - 77)
    loop.page.mouse.up()
    assert loop.run(height) == pytest.approx(before + 80, abs=4)
    assert loop.page.locator("#stage").bounding_box()["height"] == pytest.approx(stage - 80, abs=4)
    loop.page.locator("#splitter").focus()
    loop.page.keyboard.press("ArrowDown")
    assert loop.run(height) == pytest.approx(before + 56, abs=4)
    loop.page.locator("#splitter").dblclick()
    assert loop.run(height) == before


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


@pytest.mark.slow
def test_views_look_along_the_axes(loop: Watched) -> None:
    pictures = []
    for name in ("front", "side", "top", "usual"):
        loop.page.locator("#views button", has_text=name).click()
        pictures.append(loop.picture(0.5))
    assert min(changed(pictures[i], pictures[j]) for i in range(4) for j in range(i)) > 300


@pytest.mark.slow
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
    assert numbers_in(again.run("() => replay.address"), "view") == numbers_in(address, "view")
    assert numbers_in(address, "view")[2] > 0.99
    again.page.wait_for_function("() => location.hash.includes('t=0.4321')")
    again.close()
    loop.page.locator("#views button", has_text="usual").click()


def numbers_in(address: str, key: str) -> list[float]:
    return [float(x) for x in address.split(f"{key}=")[1].split("&")[0].split(",")]


def pivots(page: Watched) -> Any:
    """Positions of the pivots of the four-bar in the window, in pixels."""
    return page.run("() => [[0, 0, 0], [0.9, 0, 0]].map((place) => replay.onScreen(place))")


@pytest.mark.slow
def test_a_link_frames_the_motion_for_the_window_that_opens_it(browser: Any, tmp_path: Path) -> None:
    """A copied link of a large window moves the robot out of no small one; a view moved by hand is kept."""
    path = pn.replay(four_bar(), tmp_path / "linked.html")
    addresses = []
    wide = Watched(browser, path)
    wide.page.set_viewport_size({"width": 1400, "height": 900})
    wide.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    addresses.append(wide.run("() => replay.address"))
    wide.page.mouse.move(500, 200)
    wide.page.mouse.wheel(0, 120)
    wide.page.wait_for_function("() => replay.address.includes('cam=')")
    addresses.append(wide.run("() => replay.address"))
    wide.close()
    places = []
    for address in ("paused", *addresses):
        small = Watched(browser, path, fragment=address)
        small.page.set_viewport_size({"width": 420, "height": 800})
        small.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        places.append(pivots(small))
        kept = small.run("() => replay.address")
        small.close()
    np.testing.assert_allclose(places[1], places[0], atol=0.5)
    np.testing.assert_allclose(numbers_in(kept, "cam"), numbers_in(addresses[1], "cam"), rtol=1e-5, atol=1e-9)


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


@pytest.mark.slow
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
    assert {"loop, lam 2", "loop, lam_ideal 0", "rocker, friction, F_nonideal", "violation"} <= set(found)
    assert found["coupler, velocity"].values.max() == 77.0
    assert len(found["coupler, velocity"].t) < 2000


@pytest.mark.parametrize("name", ["four_bar", "rough_four_bar", "solo12_standing"])
def test_every_column_is_a_signal(name: str) -> None:
    record = ("forces", "energy", "reactions", "power", "a")
    run = pn.simulate(pn.load(name), 0.02, record=record)
    signals = signals_of(run, run)
    words = {word for signal in signals for word in (signal.label + " " + signal.words).split()}
    text = [f" {signal.words} " for signal in signals]
    idle = {
        column_name(f"{place.name}.C.{law}{end}")
        for law, dofs in zip(run.law_names, run.law_dofs, strict=True)
        for place in run.joints
        if not set(dofs) & set(range(place.v_first, place.v_first + place.nv))
        for end in ("", *(f".{k}" for k in range(6)))
    }
    for column in run.columns().keys() - idle:
        assert column == "t" or any(f"{column} " in words for words in text), column
    assert {"torque", "tau", "load", "reaction", "power"} <= words
    assert ("friction" in words) == (run.law_names != [])
    assert signals[0].section == "Torques of the actuation"
    others = {signal.label for signal in signals if signal.section == OTHERS}
    assert others == {"violation", "violation rate"}


def test_a_driven_robot_shows_torques_first() -> None:
    driven = pn.simulate(pn.load("solo12_standing"), 0.02, record=("forces", "energy"))
    assert default_plot_names(driven)[0] == "tau"
    passive = pn.simulate(pn.load("rough_four_bar"), 0.02, record=("forces", "energy"))
    assert default_plot_names(passive)[0] == "energy"


def test_values_below_rounding_are_zero() -> None:
    level = rounding_of([("N", np.array([3.0, -50.0, 1e-9])), ("rad", np.array([2.0, np.nan]))])
    assert level == {"N": pytest.approx(5e-8), "rad": pytest.approx(2e-12)}
    np.testing.assert_array_equal(without_rounding(np.array([3.0, -1e-9, np.nan]), 5e-8), [3.0, 0.0, np.nan])


def test_forces_that_are_rounding_of_the_weight_are_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """Multipliers of a loop in free fall are rounding, and their largest value is no measure of it."""
    run, drawn = four_bar(), []
    stored = payload.stored_plot
    monkeypatch.setattr(payload, "stored_plot", lambda *pair: (drawn.append(pair[1]), stored(*pair))[1])
    for factor, is_drawn in ((1e-12, False), (1e-6, True)):
        run.lam, run.lam_ideal = factor * four_bar().lam, None
        drawn.clear()
        payload.packed_runs([run], ["run"], None, "title", ["reactions"], True)
        assert any(values.any() for values in drawn[0].curves.values()) == is_drawn
