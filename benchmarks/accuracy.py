"""Work-precision: processor time of one run against its error, for each tool.

First every setting runs once or a few times for its error and an approximate time.  Then, for each error
level, the fastest settings of every tool that reached the level run again in alternating rounds.  The ratios
are medians over the rounds between the fastest settings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from . import timing
from .problems import SAMPLES, Problem
from .timing import clock
from .tools import Outcome, Setting, Tool
from .tools.package import Package

OURS = Package.name
# A family has reached its error floor if its last WINDOW settings do not halve the errors of the WINDOW
# settings before.  Errors above TELLING are not counted.  The window makes the test robust to a single small
# error.
WINDOW, TELLING = 3, 0.1
# Bounds of the length of one turn of a race [s].  All turns are as long as one run of the slowest setting.
# Then disturbances of the machine affect all tools equally, and short runs are repeated with warm caches.
SHORTEST_TURN, LONGEST_TURN = 0.02, 0.4
# Maximum number of settings of a tool in a race, and their maximum time relative to the fastest setting.
ENTRANTS, ROUGH = 3, 1.5


def sweep(problem: Problem, tool: Tool, limit: float, stride: int = 1) -> list[dict[str, Any]]:
    """Run the settings of a tool; settings with an expected time above the limit are skipped and reported.

    Args:
        problem: problem to compute.
        tool: tool to run.
        limit: maximum time of one run [s].
        stride: step between the settings of a family that run.
    """
    rows: list[dict[str, Any]] = []
    last: tuple[str, int | None, float] = ("", None, 0.0)
    for setting in every(tool.settings(problem), stride):
        row: dict[str, Any] = {"tool": tool.name, "family": setting.family, "setting": setting.label}
        rows.append(row)
        family, steps, seconds = last
        if family == setting.family:
            growth = setting.steps / steps if setting.steps and steps else 1.5
            if seconds * growth > limit:
                row["status"] = f"not run: over {limit:g} s"
                continue
        if has_met_its_floor([r["error"] for r in rows if r["family"] == setting.family and r.get("error")]):
            row["status"] = "not run: finer settings gain nothing"
            continue
        begin = clock()
        row |= judged(problem, tool.prepare(problem, setting, SAMPLES)())  # warms up as well
        seconds = clock() - begin
        if row["status"] == "ok":
            run = tool.prepare(problem, setting)
            seconds = min(timed(run) for _ in range(4 if seconds < 0.1 * limit else 1))
            row["seconds"] = seconds
        last = (setting.family, setting.steps, seconds)
    return rows


def has_met_its_floor(errors: Sequence[float]) -> bool:
    """Check if the last and finest settings of a family did not reduce the error."""
    before, last = errors[-2 * WINDOW : -WINDOW], errors[-WINDOW:]
    return len(before) == WINDOW and max(before) < TELLING and min(last) > 0.5 * max(before)


def every(settings: Sequence[Setting], stride: int) -> list[Setting]:
    """Return every `stride`-th setting of each family."""
    kept: list[Setting] = []
    place: dict[str, int] = {}
    for setting in settings:
        k = place.setdefault(setting.family, 0)
        place[setting.family] += 1
        if k % stride == 0:
            kept.append(setting)
    return kept


def timed(run: Callable[[], object]) -> float:
    """Return the time of one run [s]."""
    begin = clock()
    run()
    return clock() - begin


def judged(problem: Problem, outcome: Outcome) -> dict[str, Any]:
    """Return error, steps and status of a run."""
    found: dict[str, Any] = {"steps": outcome.steps, "error": None}
    if outcome.failure:
        found["status"] = f"failed: {outcome.failure}"
    elif not outcome.complete or outcome.q is None:
        found["status"] = f"incomplete: {outcome.steps} of {outcome.asked} steps"
    else:
        error = problem.error(outcome.q)
        found |= {"error": error, "status": "ok"} if error < 1e3 else {"status": "diverged"}
    return found


def entrants(rows: Sequence[dict[str, Any]], tool: str, level: float) -> list[dict[str, Any]]:
    """Return the settings of a tool that reached a level and may be the fastest, by approximate times."""
    reached = [r for r in rows if r["tool"] == tool and r.get("error") is not None and r["error"] <= level]
    reached.sort(key=lambda r: r["seconds"])
    return [r for r in reached[:ENTRANTS] if r["seconds"] < ROUGH * reached[0]["seconds"]]


def race(
    problem: Problem, tools: Sequence[Tool], rows: list[dict[str, Any]], rounds: int, seconds: float
) -> list[dict[str, Any]]:
    """Time all entrants of each level in alternating rounds, at most `rounds`, and return the winners."""
    results = []
    for level in problem.levels:
        racing = {tool.name: entrants(rows, tool.name, level) for tool in tools}
        batches = {}
        for tool in tools:
            for k, row in enumerate(racing[tool.name]):
                setting = found(tool.settings(problem), row)
                batches[tool.name, k] = timing.per_call(tool.prepare(problem, setting))
        slowest = max((row["seconds"] for group in racing.values() for row in group), default=0.0)
        turn = min(max(slowest, SHORTEST_TURN), LONGEST_TURN)
        most = int(seconds / max(slowest, turn))
        times = timing.paired(batches, max(3, min(rounds, most)), turn)
        winners = {name: winner(times, name, len(group)) for name, group in racing.items() if group}
        entry: dict[str, Any] = {"level": level, "tools": {}}
        for name, group in racing.items():
            if not group:
                reached = [r["error"] for r in rows if r["tool"] == name and r.get("error") is not None]
                entry["tools"][name] = {"best_error": min(reached, default=None)}
                continue
            row, won = group[winners[name]], times[name, winners[name]]
            entry["tools"][name] = {
                "setting": f"{row['family']} {row['setting']}",
                "error": row["error"],
                "seconds": won.best,
            }
            if name != OURS and OURS in winners:
                entry["tools"][name]["ratio"] = timing.ratio(won, times[OURS, winners[OURS]])
        results.append(entry)
    return results


def winner(times: dict[tuple[str, int], timing.Times], tool: str, count: int) -> int:
    """Return the index of a tool's fastest entrant by the median ratio over the rounds."""
    return min(range(count), key=lambda k: timing.ratio(times[tool, k], times[tool, 0]))


def found(settings: list[Setting], row: dict[str, Any]) -> Setting:
    return next(s for s in settings if (s.family, s.label) == (row["family"], row["setting"]))


def measure(
    problem: Problem, tools: Sequence[Tool], quick: bool, say: Callable[[str], None] = print
) -> dict[str, Any]:
    """Run all tools on one problem.

    Args:
        problem: problem to compute.
        tools: this package and its peers.
        quick: whether to use shorter limits.
        say: function that prints progress.
    """
    reference = problem.solution
    rows: list[dict[str, Any]] = []
    for tool in tools:
        found = sweep(problem, tool, *((0.05, 4) if quick else (2.0, 1)))
        rows += found
        done = [r for r in found if r.get("error") is not None]
        if done:
            best = min(r["error"] for r in done)
            say(f"  {tool.name}: {len(done)} of {len(found)} runs, best error {best:.1e}")
        elif found:
            say(f"  {tool.name}: {found[0]['status']}")
    taking_part = [tool for tool in tools if any(r["tool"] == tool.name for r in rows)]
    return {
        "problem": problem.name,
        "title": problem.title,
        "notes": problem.notes,
        "reference": {"how": reference.how, "uncertainty": reference.uncertainty},
        "runs": rows,
        "levels": race(problem, taking_part, rows, *((5, 0.1) if quick else (15, 3.0))),
    }
