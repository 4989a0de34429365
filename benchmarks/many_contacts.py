"""Time stepping of many bodies in contact, beside MuJoCo: time of whole runs, creep, errors of the laws."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

import pin_nonideal as pn
from pin_nonideal.scene.scene import compiled_scene

from . import timing
from .contact_scenes import (
    ContactScene,
    balls_in_box,
    dominoes,
    heavy_on_light,
    mujocos,
    ours,
    rope,
    sliding,
    stack,
    wall,
)

STEP = 1e-3  # [s]
SCENES = (
    *(stack(count) for count in (3, 5, 10, 20)),
    sliding(10),
    *(heavy_on_light(ratio) for ratio in (1e2, 1e6)),
    dominoes(10),
    wall(5, 4),
    balls_in_box(30),
    balls_in_box(100),
    rope(20),
    rope(50),
)
QUICK = 4  # number of scenes of a quick run


def measure(given: ContactScene, rounds: int, with_mujoco: bool) -> dict[str, Any]:
    """Return the times of one scene, and measures of its motion.

    The time of a run includes its start. This time is processor time, the minimum of some interleaved runs.
    """
    begin = timing.clock()
    scene = ours(given)
    row: dict[str, Any] = {
        "case": given.title,
        "made": timing.clock() - begin,
        "contacts": len(compiled_scene(scene).point_names),
    }
    steps = round(given.duration / STEP)
    run = None
    mine, theirs = [], []
    for _ in range(rounds):
        begin = timing.clock()
        run = pn.simulate(
            scene, given.duration, method="moreau", dt=STEP, output_dt=given.duration, progress=False
        )
        mine.append(timing.clock() - begin)
        if not with_mujoco:
            continue
        import mujoco

        begin = timing.clock()
        model, data = mujocos(given, STEP)
        row["mujoco_made"] = timing.clock() - begin
        begin = timing.clock()
        mujoco.mj_step(model, data, steps)
        theirs.append(timing.clock() - begin)
        row["mujoco_moved"] = moved(given, data.qpos)
    assert run is not None
    row |= {"seconds": min(mine), "steps": steps, "moved": moved(given, run.q[-1])}
    row["residual"] = max(run.stats.signorini, run.stats.coulomb, run.stats.dissipation)
    row["relaxed"] = sum(event.kind == "relaxed" for event in run.events)
    if theirs:
        row |= {"mujoco_seconds": min(theirs), "ratio": min(mine) / min(theirs)}
    return row


def moved(given: ContactScene, end: Any) -> float:
    """Return the largest displacement of a free body from its start to the configuration `end` [m]."""
    free = given.free()
    places = end[: 7 * len(free)].reshape(-1, 7)[:, :3]
    return float(np.abs(places - [body.at for body in free]).max())


def report_line(given: ContactScene, row: dict[str, Any]) -> str:
    """Return the results of one scene as a line."""
    line = (
        f"  {given.title}: {row['seconds'] / row['steps'] * 1e6:.3g} us a step, made in {row['made']:.3g} s"
    )
    if "ratio" in row:
        making = row["made"] / row["mujoco_made"]
        line += f"; ours over MuJoCo {row['ratio']:.2f}, making {making:.3g}"
    line += f"; errors of the laws {row['residual']:.1e}, {row['relaxed']} relaxed"
    if given.rests:
        line += f"; moved {row['moved']:.1e} m"
        line += f", MuJoCo {row['mujoco_moved']:.1e} m" if "mujoco_moved" in row else ""
    return line


def measure_all(
    rivals: Collection[str], quick: bool, only: str | None, say: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Measure the scenes.

    Args:
        rivals: names of the tools to compare with.
        quick: whether to run the small scenes only, once.
        only: part of the title of the scenes to run, or None for all.
        say: function that prints a line.
    """
    rows = []
    for given in SCENES[:QUICK] if quick else SCENES:
        if only is not None and only not in given.title:
            continue
        rows.append(measure(given, 1 if quick else 3, "mujoco" in rivals))
        say(report_line(given, rows[-1]))
    return rows
