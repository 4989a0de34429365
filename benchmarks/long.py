"""Ten simulated seconds for each tool: cost of a second, closure gap and energy change at the end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from . import problems, timing
from .problems import Problem
from .tools import Outcome, Setting, Tool

Array = NDArray[np.float64]

DURATION, QUICK = 10.0, 2.0  # [s]
CONSERVATIVE = ("double_pendulum", "panda", "four_bar", "n_four_bar")
PROBLEMS = (*CONSERVATIVE, "solo12")


def settings(problem: Problem) -> dict[str, list[Setting]]:
    """Return typical settings of each tool: its defaults and careful settings."""
    careful = "RK4 stiff" if problem.anchors else "RK4"

    def fixed(h: float) -> int:
        return round(problem.duration / h)

    return {
        "pin_nonideal": [
            Setting("dop853", "rtol 1e-06", values={"rtol": 1e-6, "atol": 1e-6}),
            Setting("dop853", "rtol 1e-09", values={"rtol": 1e-9, "atol": 1e-9}),
            Setting("rk4", "h 1e-03", fixed(1e-3), {"dt": 1e-3}),
            Setting("semi_implicit_euler", "h 2e-03", fixed(2e-3), {"dt": 2e-3}),
        ],
        "pin+scipy": [
            Setting("LSODA", "rtol 1e-06", values={"rtol": 1e-6}),
            Setting("DOP853", "rtol 1e-09", values={"rtol": 1e-9}),
        ],
        "mujoco": [
            Setting("Euler", "h 2e-03", fixed(2e-3), {"integrator": "Euler", "stiff": False}),
            Setting("implicitfast", "h 2e-03", fixed(2e-3), {"integrator": "implicitfast", "stiff": False}),
            Setting(careful, "h 1e-03", fixed(1e-3), {"integrator": "RK4", "stiff": True}),
        ],
        "exudyn": [Setting("DOPRI5", "tol 1e-08", values={"rtol": 1e-8})],
        "drake": [Setting("RungeKutta3", "accuracy 1e-04", values={"accuracy": 1e-4})],
    }


def energy(problem: Problem, q: Array, v: Array) -> float:
    """Return the sum of kinetic and potential energy [J]."""
    data = problem.model.createData()
    pin.computeMechanicalEnergy(problem.model, data, q, v)
    return float(data.mechanical_energy)


def gap(problem: Problem, q: Array) -> float:
    """Return the largest distance between two anchored points [m]."""
    model = problem.model
    start, end = model.createData(), model.createData()
    pin.framesForwardKinematics(model, start, problem.q0)
    pin.framesForwardKinematics(model, end, q)
    gaps = [0.0]
    for anchor in problem.anchors:
        one = model.getFrameId(anchor.frame1)
        other = start.oMf[one] if anchor.frame2 is None else end.oMf[model.getFrameId(anchor.frame2)]
        gaps.append(float(np.linalg.norm(end.oMf[one].translation - other.translation)))
    return max(gaps)


def judged(problem: Problem, outcome: Outcome) -> dict[str, Any]:
    """Return gap, energy change and status of a run."""
    if outcome.failure:
        return {"status": f"failed: {outcome.failure}"}
    if not outcome.complete or outcome.q is None or outcome.v is None:
        return {"status": f"incomplete: {outcome.steps} of {outcome.asked} steps"}
    q, v = outcome.q[-1], outcome.v
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        return {"status": "diverged"}
    found: dict[str, Any] = {"status": "ok", "steps": outcome.steps}
    if problem.anchors:
        found["gap"] = gap(problem, q)
    if problem.name in CONSERVATIVE:
        found["energy_change"] = energy(problem, q, v) - energy(problem, problem.q0, problem.v0)
    return found


def measure_one(problem: Problem, tools: Sequence[Tool], rounds: int) -> dict[str, Any]:
    """Time all settings of all tools on one problem in alternating rounds."""
    rows, runs = [], {}
    for tool in tools:
        if not tool.settings(problem):
            continue
        for setting in settings(problem)[tool.name]:
            run = tool.prepare(problem, setting)
            row = {"tool": tool.name, "setting": str(setting), **judged(problem, run())}
            rows.append(row)
            if row["status"] == "ok":
                runs[tool.name, str(setting)] = timing.per_call(run)
    times = timing.paired(runs, rounds)
    for row in rows:
        if (row["tool"], row["setting"]) in times:
            row["seconds_per_second"] = times[row["tool"], row["setting"]].best / problem.duration
    return {"problem": problem.name, "title": problem.title, "duration": problem.duration, "rows": rows}


def measure(
    tools: Sequence[Tool], quick: bool, only: str | None, say: Callable[[str], None] = print
) -> list[dict[str, Any]]:
    """Measure all problems, or one."""
    results = []
    for name in PROBLEMS:
        if only not in (None, name):
            continue
        original = problems.problem(name)
        duration = QUICK if quick else DURATION
        title = f"{original.title.partition(',')[0]}, {duration:g} s"
        result = measure_one(replace(original, duration=duration, title=title), tools, 1 if quick else 5)
        results.append(result)
        say(f"  {title}")
        for row in result["rows"]:
            shown = (
                [row["status"]] if row["status"] != "ok" else [f"{row['seconds_per_second'] * 1e3:.2f} ms/s"]
            )
            shown += [f"gap {row['gap']:.1e} m"] if "gap" in row else []
            shown += [f"energy change {row['energy_change']:+.1e} J"] if "energy_change" in row else []
            say(f"    {row['tool']} {row['setting']}: {', '.join(shown)}")
    return results
