"""Figures of runs: quantities over time or against each other, events and modes, for a screen or in print."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.atomic_files import check_writable, file_path, whole_file
from pin_nonideal.errors import InputError, OutputError, short_repr
from pin_nonideal.visualization.page.figure_styles import Style
from pin_nonideal.visualization.page.mode_timeline import bands_of, has_open_contact
from pin_nonideal.visualization.page.signals import Plot, parse_plots, plots_of, runs_and_names
from pin_nonideal.visualization.page.style import MODES, UNKNOWN_MODE
from pin_nonideal.visualization.page.xy_plots import Relation, friction_joints, is_relation, relations_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pin_nonideal.trajectory.trajectory import Trajectory

EVENT_STYLES = ((0, ()), (0, (4, 2)), (0, (1, 2)), (0, (4, 2, 1, 2)))
# Number of events above which their lines become thin, and above which they are drawn as a density.
MAX_THICK_EVENTS, MAX_EVENT_LINES = 40, 400
HATCHES = {1: "////", -1: "\\\\\\\\", 0: "", 2: "....", 3: "xxxx"}  # hatches of modes in print


def plot(
    run: Trajectory | Sequence[Trajectory],
    path: str | os.PathLike[str] | None = None,
    what: str | Sequence[str | tuple[str, Mapping[str, NDArray[np.float64]]]] | None = None,
    *,
    ax: Axes | None = None,
    columns: int | None = None,
    title: str | None = None,
    style: str | Mapping[str, Any] | None = None,
    names: Sequence[str] | None = None,
) -> Figure:
    """Draw a run, or several in the same axes, one plot below the other, with the events marked.

    Args:
        run: trajectory of `simulate`, or a list of several.
        path: file to write, in the format of its suffix (.png, .pdf, .svg); None writes no file.
        what: names of plots. Over time: "q", "v", "a", "tau", "F_nonideal", "energy", "work", "power",
            "violation", "reactions", "contacts", "gaps" (of unilateral contacts), "modes", names of joints,
            or pairs of a title "name [unit]" and curves by label, (nt,) each. Quantities against each other:
            "phase", "phase JOINT" (velocity against position), "friction", "friction LAW" (against slip
            velocity, with its limit), "load", "load LAW" (friction against the load of the bearing). None
            selects plots by the scene and the recorded fields.
        ax: matplotlib axes for one plot, instead of a new figure.
        columns: 1 or 2 columns of a printed page, 85 or 176 mm wide; None for a screen.
        title: heading; None for the name of the scene on a screen and no heading in print, "" for no heading.
        style: "screen", "paper" (dashes and markers for grayscale print, editable text in .svg and .pdf) or
            matplotlib settings by name. None selects "paper" if `columns` is given, else "screen".
        names: names of several runs; None for their numbers.

    Returns:
        Matplotlib figure, which can be changed, shown or saved. A notebook displays it as the result of
            a cell.

    Raises:
        InputError: a requested field was not recorded, `what` is empty or not a list of plots, `ax` is given
            for several plots, or `columns`, `style`, `title` or `names` are invalid.
        UnknownNameError: a name in `what` is unknown.
        OutputError: the file cannot be written, or matplotlib does not support its format.
    """
    import matplotlib as mpl

    runs, labels = runs_and_names(run, names, "a figure")
    target = None if path is None else file_path("plot: path", path)
    if target is not None:
        picture_format(target)
        check_writable(target, "the figure")
    look = Style(columns, style)
    if title is not None and not isinstance(title, str):
        raise InputError(f"plot: title must be a string or None; got {short_repr(title)}")
    if ax is not None and not (hasattr(ax, "plot") and hasattr(ax, "figure")):
        raise InputError(f"plot: ax must be axes of matplotlib; got {short_repr(ax)}")
    drawn = _requested_plots(runs, default_plots(runs) if what is None else what)
    if ax is not None and len(drawn) != 1:
        raise InputError(f"plot: ax takes one plot; got {len(drawn)} plots")
    settings: Any = look.settings
    with mpl.rc_context(settings):
        figure = _figure(runs, labels, drawn, look, ax)
        heading = title if title is not None else ("" if look.print or ax is not None else runs[0].name)
        if heading and ax is not None:
            ax.set_title(heading)
        elif heading:
            figure.suptitle(heading, fontsize=12, fontweight="bold", x=0.01, ha="left")
        if target is not None:
            _save(figure, target)
    return figure


def default_plots(runs: Sequence[Trajectory]) -> list[str]:
    """Return the default plots of runs: plots that all runs have, and modes if any run has modes.

    Args:
        runs: the runs.
    """
    first, *others = [_default_plots(run) for run in runs]
    common = [kind for kind in first if all(kind in other for other in others)]
    return common + (["modes"] if any(bands_of(run) for run in runs) else [])


def _default_plots(first: Trajectory) -> list[str]:
    """Return the default plots of a scene for which its run has recorded fields."""
    kinds = ["q", "v", *(["energy"] if first.energy else [])]
    if first.scene.contacts and first.recorded("lam"):
        kinds.append("contacts")
    if has_open_contact(first):
        kinds.append("gaps")
    if first.scene.constraint_slices:
        kinds.append("violation")
    if getattr(first, "law_forces", None) and friction_joints(first):
        kinds.append("friction")
    return kinds


Drawn = tuple[str, list[Any]]


def _requested_plots(runs: Sequence[Trajectory], what: Any) -> list[Drawn]:
    """Return the kind of each plot, with its data by run."""
    items = parse_plots("plot: what", what)
    if not items:
        raise InputError("plot: what must name at least one plot; got none")
    drawn: list[Drawn] = []
    for item in items:
        if item == "modes":
            banded = [run for run in runs if bands_of(run)]
            if not banded:
                raise InputError(
                    'plot "modes" needs an element that sticks or slips, and this scene has none'
                )
            drawn += [("modes", [run]) for run in banded]
            continue
        over = is_relation(item) and item not in [str(name) for name in runs[0].scene.model.names]
        each = [relations_of(run, item) if over else plots_of(run, [item]) for run in runs]
        kind = "relation" if over else "time"
        drawn += [(kind, list(parts)) for parts in zip(*each, strict=False)]
    return drawn


def _figure(
    runs: Sequence[Trajectory], labels: Sequence[str], drawn: list[Drawn], look: Style, ax: Axes | None
) -> Figure:
    """Return the figure with all plots; plots over time share the time axis."""
    # No pyplot, because drawing to files needs no window system.
    from .notebook_figure import NotebookFigure

    if ax is not None:
        figure, axes = ax.figure, [ax]
    else:
        heights = [_height(kind, parts, look) for kind, parts in drawn]
        figure = NotebookFigure(figsize=(look.width, sum(heights) + 0.7), layout="constrained")
        axes = list(figure.subplots(len(drawn), 1, squeeze=False, height_ratios=heights)[:, 0])
    timed = [place for place, (kind, _) in zip(axes, drawn, strict=True) if kind != "relation"]
    for place in timed[1:]:
        place.sharex(timed[0])
    for place, (kind, parts) in zip(axes, drawn, strict=True):
        if kind == "modes":
            _draw_modes(place, parts[0], look)
        elif kind == "relation":
            _draw_relation(place, parts, labels, look)
        else:
            _draw_plot(place, parts, labels, look)
            if len(runs) == 1:
                _mark_events(place, runs[0], look, place is timed[0])
    if timed:
        for place in timed[:-1]:
            place.tick_params(labelbottom=False)
        timed[-1].set_xlabel("time [s]")
        timed[-1].set_xlim(*_limits(runs))
    if ax is None:
        figure.align_ylabels()
    return figure  # type: ignore[return-value]


def _height(kind: str, parts: list[Any], look: Style) -> float:
    """Return the height of a plot [inch]."""
    if kind == "modes":
        return 0.4 + 0.22 * len(bands_of(parts[0]))
    return look.height if kind == "time" else min(1.4 * look.height, 0.75 * look.width)


def _limits(runs: Sequence[Trajectory]) -> tuple[float, float]:
    """Return the limits of the time axis [s], distinct also for a run of one sample."""
    first, last = min(float(run.t[0]) for run in runs), max(float(run.t[-1]) for run in runs)
    return (first, last) if last > first else (first - 0.5, first + 0.5)


def _draw_plot(axes: Axes, parts: Sequence[Plot], labels: Sequence[str], look: Style) -> None:
    """Draw curves over time, of all runs."""
    for number, item in enumerate(parts):
        for index, (label, values) in enumerate(item.curves.items()):
            shown = np.where(values > 0.0, values, np.nan) if item.log else values
            name = label if len(parts) == 1 else f"{label}, {labels[number]}"
            axes.plot(item.t, shown, label=name, **look.line(index, len(item.t), number, len(parts)))
    item = parts[0]
    if item.log and any(np.any(values > 0.0) for values in item.curves.values()):
        axes.set_yscale("log")
    axes.set_ylabel(f"{item.title}\n[{item.unit}]" + (f"\n{item.note}" if item.note else ""))
    _finish(axes, look)


def _draw_relation(axes: Axes, parts: Sequence[Relation], labels: Sequence[str], look: Style) -> None:
    """Draw one quantity against another, of all runs, and the limits of the law as points."""
    for number, item in enumerate(parts):
        for index, (label, (x, y)) in enumerate(item.curves.items()):
            name = label if len(parts) == 1 else f"{label}, {labels[number]}"
            line = look.line(index, len(x), number, len(parts))
            axes.plot(x, y, label=name, **line)
            if label in item.bounds:
                axes.plot(*item.bounds[label], ls="", marker=".", ms=2.0, color=line["color"], alpha=0.35)
    if any(item.bounds for item in parts):
        axes.plot([], [], ls="", marker=".", ms=3.0, color="#64748b", label="limit of the law")
    axes.set_xlabel(parts[0].x)
    axes.set_ylabel(parts[0].y + (f"\n{parts[0].note}" if parts[0].note else ""))
    _finish(axes, look)


def _finish(axes: Axes, look: Style) -> None:
    axes.grid(color="#e2e8f0", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**look.legend())


def _mark_events(axes: Axes, run: Trajectory, look: Style, legend: bool) -> None:
    """Mark each event by a vertical line whose style shows its kind, or many events by their density."""
    kinds = list(dict.fromkeys(str(event.kind) for event in run.events))
    if len(run.events) > MAX_EVENT_LINES:
        counts, edges = np.histogram([float(event.time) for event in run.events], bins=200)
        shade = counts / counts.max()
        colors = [(0.58, 0.64, 0.72, 0.6 * s) for s in shade]
        low = axes.get_xaxis_transform()  # at the bottom of the plot
        axes.vlines((edges[1:] + edges[:-1]) / 2.0, 0.0, 0.06, colors, transform=low, lw=1.5)
        if legend:
            axes.plot([], [], color="#94a3b8", lw=3.0, label=f"{len(run.events)} events, by density")
            axes.legend(**look.legend())
        return
    width = 0.8 if len(run.events) <= MAX_THICK_EVENTS else 0.3
    for event in run.events:
        style = EVENT_STYLES[kinds.index(str(event.kind)) % len(EVENT_STYLES)]
        axes.axvline(float(event.time), color="#cbd5e1", lw=width, ls=style, zorder=0.5)
    if kinds and legend:
        handles, names = axes.get_legend_handles_labels()
        styles = [EVENT_STYLES[number % len(EVENT_STYLES)] for number in range(len(kinds))]
        lines = [axes.plot([], [], color="#94a3b8", lw=1.2, ls=style)[0] for style in styles]
        axes.legend([*handles, *lines], [*names, *kinds], **look.legend())


def _draw_modes(axes: Axes, run: Trajectory, look: Style) -> None:
    """Draw a band for each element, colored by its mode."""
    names, bands = [list(column) for column in zip(*bands_of(run), strict=True)]
    present = [mode for mode in MODES if any(piece[2] == mode for pieces in bands for piece in pieces)]
    for row, pieces in enumerate(bands):
        if not look.print:
            spans = [(start, end - start) for start, end, _ in pieces]
            colors = [MODES.get(mode, UNKNOWN_MODE)[0] for _, _, mode in pieces]
            axes.broken_barh(spans, (row - 0.35, 0.7), facecolors=colors)
            continue
        for mode in present:
            spans = [(start, end - start) for start, end, which in pieces if which == mode]
            axes.broken_barh(spans, (row - 0.35, 0.7), **_print_mode(mode))
    axes.set_yticks(range(len(bands)), names)
    axes.set_ylim(len(bands) - 0.5, -0.5)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    looks = [_print_mode(mode) if look.print else {"facecolor": MODES[mode][0]} for mode in present]
    swatches = [axes.barh(0, 0, **one)[0] for one in looks]
    axes.legend(swatches, [MODES[mode][1] for mode in present], **look.legend())


def _print_mode(mode: int) -> dict[str, Any]:
    return {"facecolor": MODES[mode][0], "hatch": HATCHES[mode], "edgecolor": "white", "linewidth": 0.0}


def picture_format(path: Path) -> str:
    """Return the format of a file by its suffix.

    Args:
        path: path of the file.

    Raises:
        OutputError: matplotlib does not support the format.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    known, ending = sorted(FigureCanvasAgg.get_supported_filetypes()), path.suffix.lower().lstrip(".")
    if ending not in known:
        raise OutputError(
            f'cannot write a figure to "{path}": its ending must be one of {", ".join(known)}; got "{ending}"'
        )
    return ending


def _save(figure: Figure, path: Path) -> None:
    """Write the figure to a file, completely or not at all."""
    picture = io.BytesIO()
    figure.savefig(picture, format=picture_format(path), dpi=160)
    with whole_file(path, "the figure") as stream:
        stream.write(picture.getvalue())
