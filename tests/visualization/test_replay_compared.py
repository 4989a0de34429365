"""Several runs on one page: ghosts over the first run or beside it, and plots of all."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError

from ..support.replay_browser import Watched, changed, headless_browser
from ..support.replay_runs import four_bar, jointed, run_of


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with headless_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def page(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Page of two pendulums; the second one is ahead and runs longer."""
    model = jointed(pin.JointModelRY())
    runs = [
        run_of(model, np.linspace(0.0, 1.0, 50), lambda t: np.array([np.sin(t)])),
        run_of(model, np.linspace(0.0, 1.5, 50), lambda t: np.array([np.sin(t) + 0.5])),
    ]
    path = pn.replay(runs, tmp_path_factory.mktemp("both") / "both.html", names=["slow", "fast"])
    watched = Watched(browser, path)
    yield watched
    assert watched.complaints == []
    watched.close()


def ghosts(page: Watched) -> Any:
    return page.run("() => replay.ghosts()")


def test_each_run_stands_where_it_is(page: Watched) -> None:
    for time in (0.0, 0.7, 1.4):
        own = np.array(page.poses(time)["joints"]["j0"])
        (other,) = ghosts(page)
        assert other["name"] == "fast"
        for pose, angle in (
            (own, np.sin(min(time, 1.0))),
            (np.array(other["joints"]["j0"]), np.sin(time) + 0.5),
        ):
            np.testing.assert_allclose(pose[:3, :3], pin.utils.rotate("y", angle), atol=1e-3)


def test_one_time_line_spans_all_runs(page: Watched) -> None:
    assert page.run("() => [replay.start, replay.duration, replay.runs]") == [0.0, 1.5, 2]


def test_runs_are_put_side_by_side_and_back(page: Watched) -> None:
    page.run("() => replay.seek(0.3)")
    over = np.array(ghosts(page)[0]["joints"]["j0"])[:3, 3]
    page.page.locator("#apart").click()
    beside = np.array(ghosts(page)[0]["joints"]["j0"])[:3, 3]
    assert np.linalg.norm(beside - over) > 0.2
    left, _, right, _ = page.run("() => replay.box()")
    assert 0.0 <= left < right <= page.page.locator("#scene").bounding_box()["width"]
    page.page.locator("#apart").click()
    np.testing.assert_allclose(np.array(ghosts(page)[0]["joints"]["j0"])[:3, 3], over, atol=1e-9)


def test_a_run_can_be_hidden(page: Watched) -> None:
    before = page.picture(0.5)
    page.page.locator("#run-list button", has_text="fast").click()
    assert changed(before, page.picture(0.5)) > 100
    page.page.locator("#run-list button", has_text="fast").click()
    page.page.mouse.move(2, 2)


def test_plots_hold_the_curves_of_all_runs_and_their_differences(page: Watched) -> None:
    page.run("() => replay.seek(0.5)")
    own, other = (page.page.locator("#plots li", has_text=text).locator("b") for text in ("j0 ", "j0, fast"))
    assert float(own.first.inner_text()) == pytest.approx(np.sin(0.5), abs=1e-3)
    assert float(other.inner_text()) == pytest.approx(np.sin(0.5) + 0.5, abs=1e-3)
    page.page.locator("#differences").click()
    page.run("() => replay.seek(0.5)")
    assert float(other.inner_text()) == pytest.approx(0.5, abs=1e-3)
    page.page.locator("#differences").click()


@pytest.mark.slow
def test_a_hundred_rollouts_are_one_page_of_ghosts(browser: Any, tmp_path: Path) -> None:
    model = jointed(pin.JointModelRY(), pin.JointModelRY())
    runs = [
        run_of(model, np.linspace(0.0, 1.0, 101), lambda t, k=k: np.array([np.sin(3.0 * t + 0.01 * k), t]))
        for k in range(100)
    ]
    path = pn.replay(runs, tmp_path / "many.html")
    assert path.stat().st_size < 3_000_000
    watched = Watched(browser, path)
    assert watched.complaints == []
    assert watched.run("() => replay.runs") == 100
    assert watched.run("() => replay.draws")["calls"] <= 60
    assert "8 of 100 runs" in watched.page.locator(".plot h2").first.inner_text()
    watched.close()


def test_names_must_fit_the_runs() -> None:
    with pytest.raises(InputError, match=r"^a replay of 2 runs needs as many names; got 1$"):
        pn.replay([four_bar(), four_bar()], names=["one"])
    with pytest.raises(InputError, match=r"^a replay shows at least one run; got none$"):
        pn.replay([])


def test_runs_that_recorded_different_things_are_compared(tmp_path: Path) -> None:
    scene = pn.load("solo12_standing")
    driven = pn.simulate(scene, 0.02, record=("forces", "energy"))
    assert pn.replay([driven, pn.simulate(scene, 0.02)], tmp_path / "both.html").stat().st_size > 0
