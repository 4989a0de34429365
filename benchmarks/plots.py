"""Log-log plots of run time against error for each problem, and of cost against size."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .goals import Records

COLORS = {
    "pin_nonideal": "C0",
    "pin+scipy": "C2",
    "pin+odeint": "C5",
    "mujoco": "C1",
    "exudyn": "C4",
    "drake": "C3",
}
COLUMNS = 3
MARKERS, DASHES = "osD^vP*X", ("-", (0, (5, 2)), (0, (1, 1.5)), "-.")


def look(number: int, count: int) -> dict[str, Any]:
    """Return marker and line of a series; of coincident series the first is the widest, the last on top."""
    rest = (count - number) / max(count, 1)
    return {
        "marker": MARKERS[number % len(MARKERS)],
        "markersize": 3.0 + 4.0 * rest,
        "markerfacecolor": "none",
        "linestyle": DASHES[number % len(DASHES)],
        "linewidth": 0.8 + 1.6 * rest,
    }


def lower_front(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the Pareto front of points (seconds, error)."""
    front: list[tuple[float, float]] = []
    for seconds, error in sorted(points):
        if not front or error < front[-1][1]:
            front.append((seconds, error))
    return front


def accuracy(results: list[dict[str, Any]]) -> Figure:
    """Plot a panel for each problem with the Pareto front of each tool."""
    rows = -(-len(results) // COLUMNS)
    figure = Figure(figsize=(4.0 * COLUMNS, 3.0 * rows), layout="constrained")
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for panel, result in zip(panels, results, strict=False):
        for number, (tool, color) in enumerate(COLORS.items()):
            points = [
                (row["seconds"] * 1e3, max(row["error"], result["reference"]["uncertainty"]))
                for row in result["runs"]
                if row["tool"] == tool and row["status"] == "ok"
            ]
            if points:
                curve = zip(*lower_front(points), strict=True)
                panel.loglog(*curve, color=color, label=tool, **look(number, len(COLORS)))
        label(panel, result["title"], "time of the run [ms]", "error [rad or m]")
    for panel in panels[len(results) :]:
        panel.remove()
    shown: dict[str, Any] = {}
    for panel in figure.axes:
        lines, texts = panel.get_legend_handles_labels()
        shown |= dict(zip(texts, lines, strict=True))
    figure.legend(shown.values(), shown.keys(), loc="outside upper center", ncols=len(shown))
    return figure


def scaling(results: dict[str, Any]) -> Figure:
    """Plot the time of an evaluation over N."""
    figure = Figure(figsize=(5.0, 3.6), layout="constrained")
    panel = figure.subplots()
    names = dict.fromkeys(name for row in results["sizes"] for name in row.get("seconds", ()))
    for number, name in enumerate(names):
        points = [
            (r["N"], r["seconds"][name] * 1e6) for r in results["sizes"] if name in r.get("seconds", ())
        ]
        panel.loglog(*zip(*points, strict=True), label=name, **look(number, len(names)))
    label(panel, "N four-bars", "N", "one evaluation [us]")
    panel.legend(fontsize="small")
    return figure


def growth(results: list[dict[str, Any]]) -> Figure:
    """Plot a panel for each case of several sizes: time over size for each tool and group."""
    shown = [result for result in results if result["exponents"] and is_curve(result["rows"])]
    rows = max(1, -(-len(shown) // COLUMNS))
    figure = Figure(figsize=(4.0 * COLUMNS, 3.0 * rows), layout="constrained")
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for panel, result in zip(panels, shown, strict=False):
        series: dict[str, list[tuple[int, float]]] = {}
        for row in result["rows"]:
            for name, seconds in row["seconds"].items():
                series.setdefault(f"{row['group']}: {name}", []).append((row["size"], 1e3 * seconds))
        for number, (name, points) in enumerate(series.items()):
            panel.loglog(*zip(*points, strict=True), label=name, **look(number, len(series)))
        label(panel, result["case"], "size", "time [ms]")
        panel.legend(fontsize="x-small", framealpha=0.5)
    for panel in panels[len(shown) :]:
        panel.remove()
    return figure


def is_curve(rows: list[dict[str, Any]]) -> bool:
    """Check if all sizes in each group are distinct; else the rows are no curve."""
    measured = [(row["group"], row["size"]) for row in rows]
    return len(set(measured)) == len(measured)


def label(panel: Axes, title: str, x: str, y: str) -> None:
    """Set title, axes and grid; ticks are at powers of ten only to keep the file small."""
    panel.set_title(title, fontsize="medium")
    panel.set_xlabel(x)
    panel.set_ylabel(y)
    panel.grid(alpha=0.3)
    panel.minorticks_off()


FIGURES = {"accuracy": accuracy, "scaling": scaling, "growth": growth}


def draw(records: Records, folder: Path) -> None:
    """Write one SVG file for each part with a picture; equal results give equal files."""
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "benchmarks", "svg.fonttype": "none"}):
        for name in FIGURES.keys() & records.keys():
            figure = FIGURES[name](records[name]["results"])
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
