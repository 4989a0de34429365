"""Open a replay page in headless Chromium without network, and check that it shows a motion.

Usage: python .ci/open_replay.py FILE.html.  Exit code 0: the page loads without an error or a network
request, reports its duration, and its picture changes between the start and the middle of the motion.
"""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

FLAGS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-quic",
    "--disable-sync",
    "--no-first-run",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
TIMEOUT_MS = 60_000
# Channel difference of a changed pixel, above the noise of antialiasing.
CHANNEL_DIFFERENCE = 20
# Minimum number of changed pixels.  A moving link changes many more, a page that ignores seek() none.
MOVED_PIXELS = 200


def picture(page: Page, time: float) -> np.ndarray:
    """Return RGB pixels of the page at simulated `time` [s]."""
    page.evaluate("t => replay.seek(t)", time)
    page.evaluate("() => new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


def main(path: str) -> int:
    """Check one page and return the exit code."""
    browser_path = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=FLAGS)
        page = browser.new_context(offline=True).new_page()
        page.set_default_timeout(TIMEOUT_MS)
        page.on(
            "request",
            lambda r: (
                None
                if r.url.startswith(("file:", "data:", "blob:"))
                else complaints.append(f"request: {r.url}")
            ),
        )
        page.on("console", lambda m: complaints.append(f"console: {m.text}") if m.type == "error" else None)
        page.on("pageerror", lambda e: complaints.append(f"page error: {e}"))
        page.goto(Path(path).resolve().as_uri() + "#paused")
        page.wait_for_function("() => window.replayDone || window.replayError")
        failure = page.evaluate("() => window.replayError")
        if failure:
            complaints.append(f"replayError: {failure}")
        else:
            duration = page.evaluate("() => replay.duration")
            moved = (
                np.abs(picture(page, 0.0) - picture(page, 0.5 * duration)).max(axis=2) > CHANNEL_DIFFERENCE
            )
            print(f"{path}: {duration} s, {int(moved.sum())} pixels differ between start and middle")
            if moved.sum() < MOVED_PIXELS:
                complaints.append("nothing moves")
        browser.close()
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
