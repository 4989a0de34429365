"""Styles of figures: for a screen, or for one or two printed columns with curves distinct in grayscale."""

from __future__ import annotations

from collections.abc import Mapping

from pin_nonideal.errors import InputError, nearest, short_repr
from pin_nonideal.types import Table
from pin_nonideal.validation import choice

from .style import CURVES

MM = 1.0 / 25.4  # [inch]
# Widths of one and two columns of a printed page, and of a window [inch]. Ratio of the height of a plot to
# its width.
WIDTHS = {1: 85.0 * MM, 2: 176.0 * MM, None: 8.5}
RATIOS = {1: 0.5, 2: 0.24, None: 0.27}
STYLES = ("screen", "paper")
# Distinction without color: dashes and markers at some samples.
DASHES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
# Dashes of compared runs.
RUN_DASHES = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)))

SCREEN: Table = {"font.size": 9.0, "legend.fontsize": 8.0}
PAPER: Table = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}


def _check_settings(style: Mapping[str, object]) -> Table:
    """Return settings, checked to be settings of matplotlib.

    Raises:
        InputError: matplotlib has no setting of a name, or refuses its value.
    """
    from matplotlib import RcParams, rcParams

    for key, value in style.items():
        if key not in rcParams:
            raise InputError(f'plot: style: matplotlib has no setting "{key}"{nearest(str(key), rcParams)}')
        try:
            RcParams({key: value})
        except (ValueError, TypeError) as error:
            raise InputError(f"plot: style: {error}") from None
    return dict(style)


class Style:
    """Settings of one figure."""

    def __init__(self, columns: int | None, style: str | Mapping[str, object] | None) -> None:
        choice("plot: columns", columns, (None, 1, 2))
        if not (style is None or isinstance(style, (str, Mapping))):
            raise InputError(
                f'plot: style must be "screen", "paper" or matplotlib settings; got {short_repr(style)}'
            )
        self.print = columns is not None if style is None else style == "paper"
        if isinstance(style, str):
            choice("plot: style", style, STYLES)
        self.settings = dict(PAPER if self.print else SCREEN)
        if isinstance(style, Mapping):
            self.settings |= _check_settings(style)
        self.width = WIDTHS[columns]
        self.height = RATIOS[columns] * self.width

    def legend(self) -> Table:
        """Return the position of legends: beside a plot, in print above it."""
        if self.print:
            place = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 2 if self.width < 4.0 else 5}
            return {
                **place,
                "frameon": False,
                "borderaxespad": 0.1,
                "handlelength": 2.6,
                "columnspacing": 1.0,
            }
        return {"loc": "upper left", "bbox_to_anchor": (1.0, 1.02), "frameon": False}

    def line(self, number: int, samples: int, run: int = 0, runs: int = 1) -> Table:
        """Return the line style of one curve of one run.

        Args:
            number: number of the curve in its plot.
            samples: number of samples of the curve.
            run: number of the run.
            runs: number of compared runs.
        """
        look: Table = {"color": CURVES[number % len(CURVES)]}
        look["linewidth"] = 1.0 if self.print else 1.3
        if runs > 1:
            look["linestyle"] = RUN_DASHES[run % len(RUN_DASHES)]
        elif self.print:
            look["linestyle"] = DASHES[number % len(DASHES)]
        if samples == 1:
            look["marker"] = "o"
        elif self.print:
            # Markers of different curves have different positions.
            start = (0.05 + 0.13 * number / 8.0) % 0.13 + 0.02 * run
            look |= {
                "marker": MARKERS[(number + run) % len(MARKERS)],
                "markersize": 3.0,
                "markevery": (start, 0.13),
            }
            look["markerfacecolor"] = "white"
        return look
