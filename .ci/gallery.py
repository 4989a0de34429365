"""Gallery page of the package's robots, the paper's examples and contact scenes, each with image and replay.

Run: python .ci/gallery.py [FOLDER]   (default docs/gallery; index.html is the page)
"""

from __future__ import annotations

import html
import os
import runpy
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pin_nonideal as pn
from pin_nonideal.cli.examples import examples

ROOT = Path(__file__).resolve().parent.parent
PAPER = {
    "paper_a_particle": "a nonlinear nonholonomic constraint",
    "paper_b_ring": "a bead on a rough ring",
    "paper_c_incline": "a block on a vibrating incline",
}
# Examples with contacts, and the time of their image [s].
CONTACTS = {
    "contact_stack": 0.25,
    "contact_dominoes": 0.4,
    "contact_gripper": 1.4,
    "contact_car": 1.1,
    "contact_pile": 0.35,
    "contact_humanoid": 0.6,
}
RECORD = ("forces", "energy", "reactions")
DURATIONS = {"andrews_squeezer": 0.03, "n_four_bar": 3.0, "solo12_standing": 2.0, "panda_settling": 2.0}
LONGEST = 5.0  # [s]
SAMPLES = 1000
STILL = (480, 300)  # [pixels]

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Gallery of pin_nonideal</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<style>
body {{ font: 15px/1.45 system-ui, sans-serif; margin: 24px; max-width: 1500px; }}
main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(280px, 1fr)); gap: 20px; padding: 0; }}
a {{ color: inherit; text-decoration: none; }}
img {{ width: 100%; height: auto; border-radius: 8px; display: block; }}
h2 {{ font-size: 16px; margin: 6px 0 0; }} p {{ margin: 0; opacity: 0.8; }}
</style></head><body><h1>Gallery</h1><p>Each picture opens its replay.</p>
<main>
{cards}
</main></body></html>
"""
CARD = """<a href="{name}.html"><img src="{name}.png" alt="{title}" width="{width}" height="{height}">
<h2>{title}</h2><p>{words}</p></a>"""


def example_run(name: str) -> Any:
    """Run an example in a temporary folder and return its trajectory."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            return runpy.run_path(str(ROOT / "examples" / f"{name}.py"))["run"]
        finally:
            os.chdir(here)


def robot_run(name: str) -> Any:
    """Simulate a robot of the package; of a failed run, return the trajectory before the failure."""
    duration = DURATIONS.get(name, LONGEST)
    try:
        return pn.simulate(pn.load(name), duration, record=RECORD, output_dt=duration / SAMPLES)
    except pn.RunError as error:
        if error.trajectory is None or len(error.trajectory) < 2:
            raise
        return error.trajectory


def main(folder: str | Path = ROOT / "docs" / "gallery") -> None:
    """Write the page, and a replay and an image for each entry."""
    target, begun = Path(folder), time.perf_counter()
    target.mkdir(parents=True, exist_ok=True)
    told = PAPER | {name: words for name, words in examples() if name in CONTACTS}
    entries = [(name, words, lambda name=name: example_run(name)) for name, words in told.items()]
    entries += [(name, words, lambda name=name: robot_run(name)) for name, words in pn.robots()]
    cards = []
    for name, words, make in entries:
        run = make()
        pn.replay(run, target / f"{name}.html", title=name)
        at = CONTACTS.get(name)
        pn.render(run, target / f"{name}.png", width=STILL[0], height=STILL[1], time=at)
        texts = {"title": html.escape(name.replace("_", " ")), "words": html.escape(words)}
        cards.append(CARD.format(name=name, width=STILL[0], height=STILL[1], **texts))
        print(f"{name}: {time.perf_counter() - begun:.0f} s")
    (target / "index.html").write_text(PAGE.format(cards="\n".join(cards)), encoding="utf-8")
    print(f"wrote {target / 'index.html'}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
