"""Key figures of the recorded results, each beside the goal that it is held to."""

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
    """A measured number and its goal.

    Attributes:
        title: what is measured.
        value: None when it was not measured, or nobody else got there.
        goal: what it is held to.
        at_least: whether the goal is a lower bound, else an upper one.
        remark: shown instead of the value when that is None.
    """

    title: str
    value: float | None
    goal: float
    at_least: bool = True
    remark: str = "not measured"

    @property
    def met(self) -> bool:
        """Whether the goal is reached; nobody else getting there reaches it."""
        if self.value is None:
            return self.remark.startswith("no rival")
        return self.value >= self.goal if self.at_least else self.value <= self.goal

    @property
    def shown(self) -> str:
        """The value in words."""
        if self.value is None:
            return self.remark
        return f"{self.value:.1e}" if 0.0 < self.value < 1e-3 else f"{self.value:.3g}"

    @property
    def bound(self) -> str:
        """The goal in words."""
        return f"{'>=' if self.at_least else '<='} {self.goal:g}"


def power(error: float) -> str:
    """A power of ten, briefly."""
    return f"1e{round(math.log10(error))}"


def level(records: Records, problem: str, error: float) -> dict[str, Any]:
    """What each tool needs to reach an error; empty when that was not measured."""
    for result in records.get("accuracy", {}).get("results", ()):
        if result["problem"] == problem:
            for entry in result["levels"]:
                if entry["level"] == error:
                    return dict(entry["tools"])
    return {}


def best_rival(tools: dict[str, Any]) -> tuple[str, dict[str, Any]] | None:
    """The fastest of the others that got there."""
    there = {name: row for name, row in tools.items() if name != OURS and "seconds" in row}
    if not there:
        return None
    name = min(there, key=lambda name: there[name]["seconds"])
    return name, there[name]


def times_faster(title: str, tools: dict[str, Any], goal: float, rival: str | None = None) -> KeyFigure:
    """Time of a rival, or of the best one, over ours, at equal errors."""
    if OURS not in tools or "seconds" not in tools[OURS] or (rival is not None and rival not in tools):
        return KeyFigure(title, None, goal)
    found = best_rival({rival: tools[rival]} if rival is not None else tools)
    if found is None:
        return KeyFigure(title, None, goal, remark="no rival got there in the time limit")
    return KeyFigure(f"{title} ({found[0]}, {found[1]['setting']})", found[1]["ratio"], goal)


def earlier(title: str, fine: dict[str, Any], coarse: dict[str, Any]) -> KeyFigure:
    """Time of the best rival to a coarse error over ours to a fine one."""
    if "seconds" not in fine.get(OURS, {}):
        return KeyFigure(title, None, 1.0)
    found = best_rival(coarse)
    if found is None:
        return KeyFigure(title, None, 1.0, remark="no rival got there in the time limit")
    return KeyFigure(f"{title} ({found[0]})", found[1]["seconds"] / fine[OURS]["seconds"], 1.0)


def key_figures(records: Records) -> list[KeyFigure]:
    """All of them, in the order of the report."""
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
