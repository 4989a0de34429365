"""Unilateral contacts, compared with MuJoCo, Drake and Pinocchio's ADMM solver.

The module measures time against error of three cases with closed forms: a bouncing ball, a box that slides to
rest, and a box at rest on a slope. The benchmark also measures the cost of a step of a standing quadruped, of
an impact, and of open contacts. Settings of rivals follow their documentation (`contact_rivals`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from . import timing
from .contact_cases import CASES, EDGES, GRAVITY, STANDING, Array, Case, at, one_body
from .contact_rivals import Run, Stepping, drakes, mujoco_steps, mujocos

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
STEPS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)  # [s]
LEVELS = (1e-2, 1e-4, 1e-6, 1e-8)
STEP = 1e-3  # step of time stepping for the timing of one step [s]
OPEN = (4, 40, 400)  # numbers of open contacts
MIN_STEPS = 1000  # minimum number of time steps in a batch
FALLS = (1, 2, 4, 8)  # numbers of simultaneous impacts
RIVALS = {"mujoco": mujocos, "drake": drakes}


def ours(case: Case, steps: Sequence[float]) -> list[Run]:
    def run(**more: Any) -> Callable[[], Array]:
        def once() -> Array:
            q = pn.simulate(case.scene, case.duration, output_dt=case.duration, **more).q
            return np.asarray(q[-1, :3])

        return once

    found = [Run("pin_nonideal", f"dop853 rtol {rtol:.0e}", run(rtol=rtol, atol=rtol)) for rtol in TOLERANCES]
    stepped = [Run("pin_nonideal", f"moreau h {h:.0e}", run(method="moreau", dt=h)) for h in steps]
    return found + stepped


def curve(case: Case, rivals: Collection[str], quick: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Return time and error of all settings, and the fastest setting of each tool below each error."""
    steps = STEPS[:3] if quick else STEPS
    runs = ours(case, steps)
    for name, make in RIVALS.items():
        runs += make(case, steps) if name in rivals else []
    times = timing.paired({k: timing.per_call(r.run) for k, r in enumerate(runs)}, 2 if quick else 8)
    rows = []
    for k, r in enumerate(runs):
        error = float(np.abs(r.run() - case.end).max())
        rows.append({"tool": r.tool, "setting": r.setting, "error": error, "seconds": times[k].best})
        say(f"  {case.name}: {r.tool} {r.setting}: {error:.1e} m in {times[k].best * 1e3:.3g} ms")
    tools = list(dict.fromkeys(row["tool"] for row in rows))
    levels = []
    for level in LEVELS:
        best = {}
        for tool in tools:
            there = [row for row in rows if row["tool"] == tool and row["error"] <= level]
            if there:
                best[tool] = min(there, key=lambda row: float(str(row["seconds"])))
        levels.append({"level": level, "tools": best})
    return {"case": case.name, "title": case.title, "runs": rows, "levels": levels}


def steps_of(scene: pn.Scene, h: float, **start: Any) -> timing.Batch:
    """Return a batch of time steps; at least MIN_STEPS, so that the start of a run is negligible."""

    def batch(count: int) -> float:
        steps = max(count, MIN_STEPS)
        begin = timing.clock()
        pn.simulate(scene, steps * h, method="moreau", dt=h, output_dt=steps * h, **start)
        return (timing.clock() - begin) / steps

    return batch


def quadruped(rivals: Collection[str], quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Measure one step of Solo12 at rest on its four feet with position control."""
    scene = pn.load("solo12_dropped")
    rest = pn.simulate(scene, 4.0, method="moreau", dt=STEP, output_dt=4.0)
    q, v, model = rest.q[-1], np.zeros(scene.model.nv), scene.model
    known: dict[str, timing.Batch] = {"pin_nonideal": steps_of(scene, STEP, q=q, v=v)}
    stepping, motors = Stepping(scene, STEP), np.r_[np.zeros(6), np.ones(12)]

    def admm(count: int) -> float:
        x, u = q, v
        begin = timing.clock()
        for _ in range(count):
            bend = pin.difference(model, x, scene.q0)
            x, u = stepping.step(x, u, motors * (12.0 * bend - 0.4 * u))
        return (timing.clock() - begin) / count

    known["Pinocchio's ADMM, from Python"] = admm
    if "mujoco" in rivals:
        known["mujoco"] = mujoco_steps(scene, q, STEP)
    times = timing.paired(known, 4 if quick else 30, batch_seconds=0.02)
    mine = times["pin_nonideal"]
    rows = []
    for name, its in times.items():
        ratio = timing.ratio(mine, its)
        rows.append({"tool": name, "seconds": its.best, "ratio": ratio})
        say(f"  standing Solo12: {name} {its.best * 1e6:.3g} us a step, ours over it {ratio:.2f}")
    return rows


def impacts(quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Measure the cost of an impact by number of contacts: a run past it minus a shorter run."""
    rows = []
    for count in FALLS:
        model = one_body(coal.Box(*EDGES))
        corners = pn.box_contacts("body", EDGES, mu=STANDING, restitution=0.5)
        lower = sorted(corners, key=lambda c: c.offset[2])[:4]
        contacts = [*lower, *beside(lower)][:count]
        scene = pn.Scene(model, contacts=contacts, q0=at(0.5 * EDGES[2] + 0.1), v0=[0.5, 0.1, 0, 0, 0, 0.3])
        lands = math.sqrt(2.0 * 0.1 / GRAVITY)

        def until(end: float, scene: pn.Scene = scene) -> timing.Batch:
            return timing.per_call(lambda: pn.simulate(scene, end, output_dt=end))

        times = timing.paired(
            {"without": until(0.999 * lands), "with": until(1.001 * lands)}, 4 if quick else 40
        )
        cost = times["with"].best - times["without"].best
        rows.append({"contacts": count, "seconds": cost})
        say(f"  an impact of {count} contacts: {cost * 1e6:.3g} us")
    return rows


def beside(corners: Sequence[Any]) -> list[pn.PointContact]:
    """Return a contact halfway between each corner and the center, at the same height."""
    return [
        pn.PointContact(
            c.frame,
            offset=(0.5 * c.offset[0], 0.5 * c.offset[1], c.offset[2]),
            mu=c.mu,
            restitution=c.restitution,
            name=f"{c.name} inner",
        )
        for c in corners
    ]


def idle(quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Measure run times of a robot arm with open contacts, relative to the time without contacts."""
    rows = []
    arm = pn.load("panda")
    for count in OPEN:
        frames = [frame.name for frame in arm.model.frames if frame.parentJoint > 0]
        contacts = [
            pn.PointContact(frames[-1 - k % len(frames)], height=-10.0 - k, mu=0.5, name=f"floor {k}")
            for k in range(count)
        ]
        scenes = {
            "without": pn.Scene(arm.model, q0=arm.q0),
            "with": pn.Scene(arm.model, contacts=contacts, q0=arm.q0),
        }
        for name, more in (("dop853", {}), ("moreau", {"method": "moreau", "dt": STEP})):
            known = {
                which: timing.per_call(
                    lambda scene=scene, more=more: pn.simulate(scene, 0.5, output_dt=0.5, **more)
                )
                for which, scene in scenes.items()
            }
            times = timing.paired(known, 4 if quick else 40)
            ratio = timing.ratio(times["with"], times["without"])
            rows.append({"contacts": len(contacts), "method": name, "ratio": ratio})
            say(f"  {len(contacts)} open contacts, {name}: {ratio:.3f} of the time without")
    return rows


def measure(
    rivals: Collection[str], quick: bool, only: str | None, say: Callable[[str], None]
) -> dict[str, Any]:
    """Measure all tables.

    Args:
        rivals: names of the tools in addition to this package and Pinocchio.
        quick: whether to use fewer settings and rounds.
        only: one case of the curves; None for all.
        say: function that prints progress.
    """
    cases = [make() for name, make in CASES.items() if only in (None, name)]
    return {
        "curves": [curve(case, rivals, quick, say) for case in cases],
        "steps": quadruped(rivals, quick, say),
        "impacts": impacts(quick, say),
        "open": idle(quick, say),
    }
