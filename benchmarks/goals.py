"""Key figures of the recorded results, with their goals."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

Records = dict[str, dict[str, Any]]

OURS = "pin_nonideal"
HELD_BATCHES = ("panda", "four_bar", "n_four_bar", "talos")


@dataclass(frozen=True)
class KeyFigure:
    """Measured number and its goal.

    Attributes:
        title: title of the figure.
        value: measured value; None if it was not measured, or if no rival reached the error.
        goal: bound of the value.
        at_least: whether the goal is a lower bound, else an upper bound.
        remark: text in place of a value that is None.
    """

    title: str
    value: float | None
    goal: float
    at_least: bool = True
    remark: str = "not measured"

    @property
    def met(self) -> bool:
        """Check if the goal is met; it is met if no rival reached the error."""
        if self.value is None:
            return self.remark.startswith("no rival")
        return self.value >= self.goal if self.at_least else self.value <= self.goal

    @property
    def shown(self) -> str:
        """Return the value as text."""
        if self.value is None:
            return self.remark
        return f"{self.value:.1e}" if 0.0 < self.value < 1e-3 else f"{self.value:.3g}"

    @property
    def bound(self) -> str:
        """Return the goal as text."""
        return f"{'>=' if self.at_least else '<='} {self.goal:g}"


def power(error: float) -> str:
    """Return an error as a rounded power of ten, such as 1e-6."""
    return f"1e{round(math.log10(error))}"


def level(records: Records, problem: str, error: float) -> dict[str, Any]:
    """Return the results of each tool at an error level; empty if not measured."""
    for result in records.get("accuracy", {}).get("results", ()):
        if result["problem"] == problem:
            for entry in result["levels"]:
                if entry["level"] == error:
                    return dict(entry["tools"])
    return {}


def best_rival(tools: dict[str, Any]) -> tuple[str, dict[str, Any]] | None:
    """Return the fastest rival that reached the level, or None."""
    there = {name: row for name, row in tools.items() if name != OURS and "seconds" in row}
    if not there:
        return None
    name = min(there, key=lambda name: there[name]["seconds"])
    return name, there[name]


def times_faster(title: str, tools: dict[str, Any], goal: float, rival: str | None = None) -> KeyFigure:
    """Return the time of a rival, or of the best rival, over ours at equal errors."""
    if OURS not in tools or "seconds" not in tools[OURS] or (rival is not None and rival not in tools):
        return KeyFigure(title, None, goal)
    found = best_rival({rival: tools[rival]} if rival is not None else tools)
    if found is None:
        return KeyFigure(title, None, goal, remark="no rival got there in the time limit")
    return KeyFigure(f"{title} ({found[0]}, {found[1]['setting']})", found[1]["ratio"], goal)


def earlier(title: str, fine: dict[str, Any], coarse: dict[str, Any]) -> KeyFigure:
    """Return the time of the best rival to a coarse error over ours to a fine error."""
    if "seconds" not in fine.get(OURS, {}):
        return KeyFigure(title, None, 1.0)
    found = best_rival(coarse)
    if found is None:
        return KeyFigure(title, None, 1.0, remark="no rival got there in the time limit")
    return KeyFigure(f"{title} ({found[0]})", found[1]["seconds"] / fine[OURS]["seconds"], 1.0)


def key_figures(records: Records) -> list[KeyFigure]:
    """Return all key figures, in the order of the report."""
    return [*at_equal_errors(records), *with_many_loops(records), *in_batches(records)]


def at_equal_errors(records: Records) -> Iterator[KeyFigure]:
    four_bar = level(records, "four_bar", 1e-6)
    yield times_faster("four-bar to 1e-6: MuJoCo's time over ours", four_bar, 150.0, "mujoco")
    yield times_faster("four-bar to 1e-6: Python loop's time over ours", four_bar, 5.0, "pin+scipy")
    yield times_faster("four-bar to 1e-6: compiled loop's time over ours", four_bar, 2.5, "pin+odeint")
    coarse = level(records, "four_bar", 1e-3)
    yield times_faster("four-bar to 1e-3: MuJoCo's time over ours", coarse, 1.0, "mujoco")
    errors = [
        row["error"]
        for result in records.get("accuracy", {}).get("results", ())
        if result["problem"] == "four_bar"
        for row in result["runs"]
        if row["tool"] == OURS and row.get("error") is not None
    ]
    yield KeyFigure("four-bar: smallest error reached [rad]", min(errors, default=None), 1e-10, False)
    for problem, title in (("double_pendulum", "double pendulum"), ("panda", "Panda")):
        for error in (1e-6, 1e-8):
            tools = level(records, problem, error)
            yield times_faster(f"{title} to {power(error)}: best rival's time over ours", tools, 2.0)
    for problem, title in (("coulomb_pendulum", "angle at 2 s"), ("coulomb_rest", "rest angle")):
        fine, coarse = (level(records, problem, error) for error in (1e-9, 1e-4))
        yield earlier(f"Coulomb pendulum, {title}: best rival's time to 1e-4 over ours to 1e-9", fine, coarse)


def with_many_loops(records: Records) -> Iterator[KeyFigure]:
    found = records.get("scaling", {}).get("results", {"sizes": [], "exponents": {}})
    done = {row["N"]: row for row in found["sizes"] if row["status"] == "ok"}
    exponent = found["exponents"].get(OURS) if 640 in done else None
    yield KeyFigure("N four-bars: exponent of the cost from N = 40 to 640", exponent, 1.1, False)
    ratio = done.get(40, {}).get("ratio", {}).get("mujoco mj_forward")
    yield KeyFigure("40 four-bars: our evaluation's time over mj_forward's", ratio, 1.0, False)


def in_batches(records: Records) -> Iterator[KeyFigure]:
    cases = {r["case"]: r for r in records.get("batches", {}).get("results", ())}
    for name in HELD_BATCHES:
        result = cases.get(name, {"title": name, "ratios": ()})
        ratio = next((r["ratio"] for r in result["ratios"] if r["threads"] == 1), None)
        yield KeyFigure(f"batch of {result['title']}: our steps per second over mujoco.rollout's", ratio, 1.0)
    gains = [
        row["over_one_thread"]
        for result in cases.values()
        for row in result["rows"]
        if row["tool"] == OURS and "over_one_thread" in row
    ]
    possible = [result["two_processes"] for result in cases.values() if "two_processes" in result]
    title = "batch: two threads over one, median of the robots"
    if possible:
        title += f" (two processes: {statistics.median(possible):.2f})"
    yield KeyFigure(title, statistics.median(gains) if gains else None, 1.8)
