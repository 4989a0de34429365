"""Replay pages in a headless browser without network."""

from __future__ import annotations

import atexit
import contextlib
import io
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pin_nonideal.visualization.replay import replay

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
    "--disable-gpu-compositing",  # software WebGL is slow at compositing the page
]
SIZE = (1000, 720)
TIMEOUT = 60_000  # milliseconds; a software renderer on a busy machine takes seconds
MOVED = 2000  # pixels: a robot that fills the view changes several times as many


@contextlib.contextmanager
def headless_browser() -> Iterator[Any]:
    """Yield the browser of this process, started once; skip tests if no browser is installed."""
    api = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    if BROWSER is None:
        pytest.skip("needs chromium, chromium-browser or google-chrome on the path")
    yield _launched(api)


@cache
def _launched(api: Any) -> Any:
    playwright = api.sync_playwright().start()
    browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
    atexit.register(playwright.stop)
    atexit.register(browser.close)
    return browser


@cache
def _unused_pages(browser: Any) -> list[Any]:
    """Return reusable pages without network: a new process for each test would be slow."""
    return []


class Watched:
    """Page opened without network, with its errors and requests."""

    def __init__(self, browser: Any, path: Path, fragment: str = "paused") -> None:
        self._unused = _unused_pages(browser)
        # A context with its own window for each page: browsers draw background tabs once a second.
        self.page = self._unused.pop() if self._unused else browser.new_context(offline=True).new_page()
        self.page.set_default_timeout(TIMEOUT)
        self.page.set_viewport_size({"width": SIZE[0], "height": SIZE[1]})
        self.page.emulate_media(color_scheme="light")
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self._listeners = {"console": self._log, "pageerror": self._fail, "request": self._ask}
        for event, listener in self._listeners.items():
            self.page.on(event, listener)
        self.page.goto(f"{path.resolve().as_uri()}#{fragment}")
        self.page.wait_for_function("() => window.replayDone || window.replayError")

    def _log(self, message: Any) -> None:
        text = message.text
        if message.type in ("error", "warning") and "GPU stall" not in text and "GL Driver" not in text:
            self.complaints.append(text)

    def _fail(self, error: Any) -> None:
        self.complaints.append(str(error))

    def _ask(self, request: Any) -> None:
        self.requests.append(request.url)

    def close(self) -> None:
        """Release the page for the next test."""
        for event, listener in self._listeners.items():
            self.page.remove_listener(event, listener)
        self.page.mouse.move(0.0, 0.0)
        self.page.goto("about:blank")
        self._unused.append(self.page)

    def run(self, script: str, argument: object = None) -> Any:
        return self.page.evaluate(script, argument)

    def poses(self, time: float) -> Any:
        return self.run("time => { replay.seek(time); return replay.poses(); }", time)

    def picture(self, time: float) -> np.ndarray:
        """Return the three-dimensional view at a time as RGB, (height, width, 3)."""
        from PIL import Image

        self.run("time => replay.seek(time)", time)
        self.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        shot = self.page.locator("#scene").screenshot()
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


@contextlib.contextmanager
def opened_replay(browser: Any, run: Any, path: Path) -> Iterator[SimpleNamespace]:
    """Write a run as a page and open the page."""
    watched = Watched(browser, replay(run, path))
    yield SimpleNamespace(run=run, path=path, watched=watched, page=watched.page)
    watched.close()


def changed(one: np.ndarray, other: np.ndarray) -> int:
    """Return the number of pixels that differ clearly between two pictures."""
    return int(np.count_nonzero(np.abs(other - one).max(axis=2) > 20))
