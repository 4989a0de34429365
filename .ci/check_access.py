"""Check a replay page by axe-core's accessibility rules, in light and dark mode, for desktop and phone.

Usage: python .ci/check_access.py FILE.html axe.min.js.  Exit code 0: no finding is serious or critical.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SCREENS = ((1400, 900, "light"), (1400, 900, "dark"), (900, 500, "light"), (420, 800, "light"))
GRAVE = ("serious", "critical")


def main(path: str, axe: str) -> int:
    """Check one page and return the exit code."""
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    findings = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=FLAGS)
        for width, height, scheme in SCREENS:
            size = {"width": width, "height": height}
            page = browser.new_context(viewport=size, color_scheme=scheme, offline=True).new_page()
            page.goto(Path(path).resolve().as_uri() + "#paused")
            page.wait_for_function("() => window.replayDone || window.replayError", timeout=60_000)
            page.evaluate(Path(axe).read_text(encoding="utf-8"))
            for panel in (False, True):
                if panel:
                    page.keyboard.press("t")
                result = page.evaluate("() => axe.run(document, { resultTypes: ['violations'] })")
                findings += [(width, scheme, panel, rule) for rule in result["violations"]]
        browser.close()
    for width, scheme, panel, rule in findings:
        where = ", ".join(" ".join(node["target"]) for node in rule["nodes"][:5])
        print(f"{width} {scheme} panel={panel} {rule['impact']}: {rule['id']}: {where}")
    return 1 if any(rule["impact"] in GRAVE for *_, rule in findings) else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
