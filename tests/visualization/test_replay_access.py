"""Replay pages by the rules of axe-core, if its script is installed: pip install axe-playwright-python."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from pin_nonideal.visualization.replay import replay

from ..support.replay_browser import Watched, headless_browser
from ..support.replay_runs import four_bar

SCREENS = ((1400, 900, "light"), (1400, 900, "dark"), (900, 500, "light"), (420, 800, "light"))


def axe_script() -> str:
    """Return the script of axe-core; skip the test if the package that holds it is not installed."""
    found = importlib.util.find_spec("axe_playwright_python")
    if found is None or not found.submodule_search_locations:
        pytest.skip("needs the script of axe-core: pip install axe-playwright-python")
    return (Path(found.submodule_search_locations[0]) / "axe.min.js").read_text(encoding="utf-8")


def test_a_page_breaks_no_rule_of_accessibility(tmp_path: Path) -> None:
    """Desktop and phone, light and dark, with and without the panel of the scene."""
    script = axe_script()
    with headless_browser() as browser:
        watched = Watched(browser, replay(four_bar(), tmp_path / "page.html"))
        watched.run(script)
        found = []
        for width, height, scheme in SCREENS:
            watched.page.set_viewport_size({"width": width, "height": height})
            watched.page.emulate_media(color_scheme=scheme)
            for _ in range(2):
                watched.page.keyboard.press("t")
                result = watched.run("() => axe.run(document, { resultTypes: ['violations'] })")
                found += [
                    (width, scheme, rule["id"], [" ".join(node["target"]) for node in rule["nodes"]])
                    for rule in result["violations"]
                ]
        watched.close()
    assert found == []
