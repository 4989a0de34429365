"""Figures of a run: positions, velocities, energy, constraint violation, events and modes over time."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, OutputError
from .files import file_path, whole_file
from .page.signals import MODES, Plot, check_scene, mode_bands, plots_of, wanted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .trajectory import Trajectory

WIDTH, HEIGHT = 8.5, 2.3  # size of a figure and of one of its plots [inch]
COLORS = ("#ea580c", "#2563eb", "#1e293b", "#059669", "#db2777", "#7c3aed", "#0891b2", "#ca8a04")
MODE_COLORS = {1: "#fb923c", -1: "#60a5fa", 0: "#475569"}
EVENT_STYLES = ((0, ()), (0, (4, 2)), (0, (1, 2)), (0, (4, 2, 1, 2)))
# More events than this are drawn so thin that the curves stay visible.
CROWD = 40


def plot(
    run: Trajectory,
    path: str | os.PathLike[str] | None = None,
    what: str | Sequence[str | tuple[str, Mapping[str, NDArray[np.float64]]]] | None = None,
) -> Figure:
    """Draws a run over time, one plot below the other, with the events marked.

    Args:
        run: what `simulate` returned.
        path: file to write, in the format that its ending names (.png, .pdf, .svg); None writes none.
        what: "q", "v", "a", "energy", "work", "violation", "reactions", "modes", names of joints, or pairs of
            a title "what [unit]" and curves by label, (nt,) each. None: q, v, energy, violation and modes, as
            far as the run has them.

    Returns:
        The matplotlib figure, to be changed, shown or saved.

    Raises:
        InputError: something asked for was not recorded, or `what` is empty or no list of plots.
        UnknownNameError: a name in `what` is none of the above.
        OutputError: the file cannot be written, or matplotlib has no such format.
    """
    from matplotlib.figure import Figure  # no pyplot: a program that draws to files needs no window system

    check_scene(run, "a figure")
    if what is None:
        what = ["q", "v", *(["energy"] if run.energy else [])]
        what += [
            *(["violation"] if run.scene.constraint_slices else []),
            *(["modes"] if run.modes is not None else []),
        ]
    items = wanted("plot: what", what)
    if not items:
        raise InputError("plot: what must name at least one plot; got none")
    if "modes" in items and run.modes is None:
        raise InputError('plot "modes" needs an element that sticks or slips, and this scene has none')
    plots: list[Plot | None] = []
    for item in items:
        plots += [None] if item == "modes" else plots_of(run, [item])

    heights = [0.4 + 0.22 * len(run.element_names) if item is None else HEIGHT for item in plots]
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.7), layout="constrained")
    grid: Any = figure.subplots(len(plots), 1, sharex=True, squeeze=False, height_ratios=heights)
    for axes, drawn in zip(grid[:, 0], plots, strict=True):
        if drawn is None:
            _draw_modes(axes, run)
        else:
            _draw_plot(axes, drawn)
            _mark_events(axes, run)
    grid[-1, 0].set_xlabel("time [s]")
    grid[-1, 0].set_xlim(*_limits(run))
    figure.align_ylabels()
    figure.suptitle(run.name, fontsize=12, fontweight="bold", x=0.01, ha="left")
    if path is not None:
        _save(figure, file_path("plot: path", path))
    return figure


def _limits(run: Trajectory) -> tuple[float, float]:
    """First and last time [s], apart also for a run of one sample."""
    first, last = float(run.t[0]), float(run.t[-1])
    return (first, last) if last > first else (first - 0.5, first + 0.5)


def _draw_plot(axes: Axes, item: Plot) -> None:
    marker = "o" if len(item.t) == 1 else ""
    for number, (label, values) in enumerate(item.curves.items()):
        shown = np.where(values > 0.0, values, np.nan) if item.log else values
        axes.plot(item.t, shown, color=COLORS[number % len(COLORS)], lw=1.3, marker=marker, label=label)
    if item.log and any(np.any(values > 0.0) for values in item.curves.values()):
        axes.set_yscale("log")
    axes.set_ylabel(f"{item.title}\n[{item.unit}]")
    axes.grid(color="#e2e8f0", lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if item.curves:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.02), frameon=False, fontsize=8)


def _mark_events(axes: Axes, run: Trajectory) -> None:
    """A vertical line at each event, its style by the kind of event."""
    kinds = list(dict.fromkeys(str(event.kind) for event in run.events))
    width = 0.8 if len(run.events) <= CROWD else 0.3
    for event in run.events:
        style = EVENT_STYLES[kinds.index(str(event.kind)) % len(EVENT_STYLES)]
        axes.axvline(float(event.time), color="#cbd5e1", lw=width, ls=style, zorder=0.5)
    if kinds and axes.get_subplotspec().rowspan.start == 0:  # type: ignore[union-attr]
        styles = [EVENT_STYLES[number % len(EVENT_STYLES)] for number in range(len(kinds))]
        lines = [axes.plot([], [], color="#cbd5e1", lw=1.2, ls=style)[0] for style in styles]
        handles, labels = axes.get_legend_handles_labels()
        axes.legend(
            [*handles, *lines],
            [*labels, *kinds],
            loc="upper left",
            bbox_to_anchor=(1.0, 1.02),
            frameon=False,
            fontsize=8,
        )


def _draw_modes(axes: Axes, run: Trajectory) -> None:
    """A band for each element, colored by its mode."""
    bands = [] if run.modes is None else mode_bands(run.t, run.modes)
    for row, pieces in enumerate(bands):
        spans = [(start, end - start) for start, end, _ in pieces]
        colors = [MODE_COLORS.get(mode, "#f1f5f9") for _, _, mode in pieces]
        axes.broken_barh(spans, (row - 0.35, 0.7), facecolors=colors)
    axes.set_yticks(range(len(bands)), run.element_names)
    axes.set_ylim(len(bands) - 0.5, -0.5)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    swatches = [axes.barh(0, 0, color=MODE_COLORS[mode])[0] for mode in MODES]
    axes.legend(
        swatches, MODES.values(), loc="upper left", bbox_to_anchor=(1.0, 1.02), frameon=False, fontsize=8
    )


def picture_format(path: Path) -> str:
    """The format that the ending of a file names.

    Args:
        path: the file.

    Raises:
        OutputError: matplotlib writes no such format.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    known, ending = sorted(FigureCanvasAgg.get_supported_filetypes()), path.suffix.lower().lstrip(".")
    if ending not in known:
        raise OutputError(
            f'cannot write a figure to "{path}": its ending must be one of {", ".join(known)}; got "{ending}"'
        )
    return ending


def _save(figure: Figure, path: Path) -> None:
    """The figure as a file, whole or not at all."""
    picture = io.BytesIO()
    figure.savefig(picture, format=picture_format(path), dpi=160)
    with whole_file(path, "the figure") as stream:
        stream.write(picture.getvalue())
