"""Gallery page of the package's robots and the paper's examples, with an image and a replay of each.

Run: python examples/gallery.py [FOLDER]   (default docs/gallery; index.html is the page)
"""

from __future__ import annotations

import html
import importlib.util
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import pin_nonideal as pn

HERE = Path(__file__).resolve().parent
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


def example(name: str) -> Any:
    """Import a script of this folder as a module."""
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def paper_runs() -> Iterator[tuple[str, str, Callable[[], Any]]]:
    """Yield name, description and run function of the paper's three examples."""
    a, b, c = (example(f"paper_{name}") for name in ("a_particle", "b_ring", "c_incline"))

    def run(scene: Any, duration: float, q: Any, v: Any) -> Any:
        return pn.simulate(scene, duration, q=q, v=v, record=RECORD[:2], output_dt=duration / SAMPLES)

    particle, ring, block = a.Particle(), b.Ring(), c.Incline()
    q = np.array([0.3, -0.2, 0.9])
    start = particle.start(q, (1.1, -0.6))
    yield (
        "paper_a_particle",
        "a nonlinear nonholonomic constraint",
        lambda: run(particle.scene(), 3.0, q, start),
    )
    yield "paper_b_ring", "a bead on a rough ring", lambda: run(ring.scene(), 1.0, *ring.at(0.0, 6.0))
    yield (
        "paper_c_incline",
        "a block on a vibrating incline",
        lambda: run(block.scene(), 1.0, *block.at(0.0, 0.1)),
    )


def robot_run(name: str) -> Any:
    """Simulate a robot of the package; of a failed run, return the trajectory before the failure."""
    duration = DURATIONS.get(name, LONGEST)
    try:
        return pn.simulate(pn.load(name), duration, record=RECORD, output_dt=duration / SAMPLES)
    except pn.RunError as error:
        if error.trajectory is None or len(error.trajectory) < 2:
            raise
        return error.trajectory


def main(folder: str | Path = HERE.parent / "docs" / "gallery") -> None:
    """Write the page, and a replay and an image for each entry."""
    target, begun = Path(folder), time.perf_counter()
    target.mkdir(parents=True, exist_ok=True)
    entries = [*paper_runs()]
    entries += [(name, words, lambda name=name: robot_run(name)) for name, words in pn.robots()]
    cards = []
    for name, words, make in entries:
        run = make()
        pn.replay(run, target / f"{name}.html", title=name)
        pn.render(run, target / f"{name}.png", width=STILL[0], height=STILL[1])
        texts = {"title": html.escape(name.replace("_", " ")), "words": html.escape(words)}
        cards.append(CARD.format(name=name, width=STILL[0], height=STILL[1], **texts))
        print(f"{name}: {time.perf_counter() - begun:.0f} s")
    (target / "index.html").write_text(PAGE.format(cards="\n".join(cards)), encoding="utf-8")
    print(f"wrote {target / 'index.html'}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
