"""Work and precision: processor time of one run from its start against the error of its end, tool by tool.

First every setting runs once or a few times, which gives its error and a rough time.  Then, for each error
level, the settings of every tool that reached it and may be its fastest run again, all in turn; the ratios
are medians over the rounds, between the fastest ones.
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
# A family has met its floor when its last settings, ever finer, do not halve the errors of as many before
# them.  Errors of order one tell nothing yet, and one lucky setting among the others must not end the search.
WINDOW, TELLING = 3, 0.1
# Length of one turn of a race [s]: everybody's is as long as one run of the slowest, within these bounds, so
# that all meet as many of the machine's slow moments, and a run of a millisecond is timed among its like, not
# in the caches that a long run of another tool has left.
SHORTEST_TURN, LONGEST_TURN = 0.02, 0.4
# Settings of one tool that race for a level, and how much longer than its fastest they may have taken before.
ENTRANTS, ROUGH = 3, 1.5


def sweep(problem: Problem, tool: Tool, limit: float, stride: int = 1) -> list[dict[str, Any]]:
    """Runs the settings of a tool; those that would take longer than the limit are named and left out.

    Args:
        problem: what to compute.
        tool: by what.
        limit: of one run [s].
        stride: every how many of a family's settings are tried.
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
    """Whether the last settings of a family, ever finer, brought nothing."""
    before, last = errors[-2 * WINDOW : -WINDOW], errors[-WINDOW:]
    return len(before) == WINDOW and max(before) < TELLING and min(last) > 0.5 * max(before)


def every(settings: Sequence[Setting], stride: int) -> list[Setting]:
    """Every `stride`-th setting of each family."""
    kept: list[Setting] = []
    place: dict[str, int] = {}
    for setting in settings:
        k = place.setdefault(setting.family, 0)
        place[setting.family] += 1
        if k % stride == 0:
            kept.append(setting)
    return kept


def timed(run: Callable[[], object]) -> float:
    """Seconds of one run."""
    begin = clock()
    run()
    return clock() - begin


def judged(problem: Problem, outcome: Outcome) -> dict[str, Any]:
    """Error, steps and status of a run."""
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
    """The settings of a tool that reached a level and may be its fastest, by times that are rough."""
    reached = [r for r in rows if r["tool"] == tool and r.get("error") is not None and r["error"] <= level]
    reached.sort(key=lambda r: r["seconds"])
    return [r for r in reached[:ENTRANTS] if r["seconds"] < ROUGH * reached[0]["seconds"]]


def race(
    problem: Problem, tools: Sequence[Tool], rows: list[dict[str, Any]], rounds: int, seconds: float
) -> list[dict[str, Any]]:
    """For each level, the times of all entrants in turn, at most `rounds` of each, and the winners."""
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
    """Which of a tool's entrants is the fastest, round by round."""
    return min(range(count), key=lambda k: timing.ratio(times[tool, k], times[tool, 0]))


def found(settings: list[Setting], row: dict[str, Any]) -> Setting:
    return next(s for s in settings if (s.family, s.label) == (row["family"], row["setting"]))


def measure(
    problem: Problem, tools: Sequence[Tool], quick: bool, say: Callable[[str], None] = print
) -> dict[str, Any]:
    """All runs of one problem.

    Args:
        problem: what to compute.
        tools: ours and its peers.
        quick: shorter limits.
        say: told what happens.
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
