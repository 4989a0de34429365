"""Figures of a run: contents of each axis, and complete files or none."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, OutputError, UnknownNameError
from pin_nonideal.visualization.plotting import MAX_THICK_EVENTS, plot

from ..support.replay_runs import four_bar, jointed, panda, run_of


def labels(figure: Any) -> list[str]:
    return [axes.get_ylabel() for axes in figure.axes]


def curve(axes: Any, label: str) -> Any:
    (found,) = [line for line in axes.lines if line.get_label() == label]
    return found


def test_the_usual_figure_shows_what_the_run_has() -> None:
    assert labels(plot(four_bar())) == [
        "Position\n[rad]",
        "Velocity\n[rad/s]",
        "Constraint violation\n[m, rad]",
    ]
    assert labels(plot(panda())) == ["Position\n[rad]", "Velocity\n[rad/s]", "Energy\n[J]", ""]


def test_curves_carry_the_runs_numbers_and_the_joints_names() -> None:
    run = four_bar()
    position, velocity, violation = plot(run).axes
    for number, joint in enumerate(("crank", "coupler", "rocker")):
        np.testing.assert_array_equal(curve(position, joint).get_ydata(), run.q[:, number])
        np.testing.assert_array_equal(curve(velocity, joint).get_ydata(), run.v[:, number])
        np.testing.assert_array_equal(curve(position, joint).get_xdata(), run.t)
    assert violation.get_yscale() == "log"
    assert [text.get_text() for text in position.get_legend().get_texts()] == ["crank", "coupler", "rocker"]
    assert velocity.get_xlim() == (0.0, 1.0)


def test_a_violation_of_exactly_zero_leaves_a_gap_on_the_logarithmic_axis() -> None:
    run = four_bar()
    run.violation[:5] = 0.0
    values = curve(plot(run, what=["violation"]).axes[0], "largest residual").get_ydata()
    assert np.isnan(values[:5]).all()
    assert np.isfinite(values[5:]).all()
    run.violation[:] = 0.0
    assert plot(run, what=["violation"]).axes[0].get_yscale() == "linear"  # nothing to take the logarithm of


def test_events_are_marked_in_every_plot_over_time() -> None:
    figure = plot(panda())
    for axes in figure.axes[:-1]:
        assert 0.2 in [line.get_xdata()[0] for line in axes.lines if len(line.get_xdata()) == 2]
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert names[-1] == "slip"


def test_many_events_are_drawn_thin() -> None:
    run = panda()

    def widths(count: int) -> set[float]:
        run.events = [SimpleNamespace(time=0.001 * k, kind="slip", element="e") for k in range(count)]
        lines = plot(run, what=["energy"]).axes[0].lines
        return {line.get_linewidth() for line in lines if list(line.get_ydata()) == [0, 1]}

    assert max(widths(MAX_THICK_EVENTS + 1)) < min(widths(MAX_THICK_EVENTS))


def test_modes_are_bands_named_by_their_elements() -> None:
    run = panda()
    axes = plot(run, what=["modes"]).axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["panda_joint2"]
    spans = [path.get_extents().intervalx for path in axes.collections[0].get_paths()]
    change = run.t[np.flatnonzero(np.diff(run.modes[:, 0]))[0] + 1]
    np.testing.assert_allclose(spans, [[0.0, change], [change, 0.5]])


def test_chosen_plots_come_in_the_given_order() -> None:
    run = four_bar()
    figure = plot(run, what=["reactions", "crank", ("Own [mm]", {"a": run.t})])
    assert labels(figure) == [
        "Reactions, |lam|\n[N, N m]",
        "crank\n[rad]",
        "crank, velocity\n[rad/s]",
        "Own\n[mm]",
    ]


def test_one_sample_can_be_drawn() -> None:
    run = run_of(jointed(pin.JointModelRZ()), [2.0], lambda t: np.array([t]))
    axes = plot(run).axes[0]
    assert axes.get_xlim() == (1.5, 2.5)
    assert curve(axes, "j0").get_marker() == "o"


@pytest.mark.parametrize("ending", ["png", "pdf", "svg", "PNG"])
def test_the_ending_of_the_path_is_the_format(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"figure.{ending}"
    plot(four_bar(), path, what=["q"])
    start = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[ending.lower()]
    assert path.read_bytes().startswith(start)
    assert os.listdir(tmp_path) == [path.name]


def test_a_figure_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r'its ending must be one of .*pdf.*png.*svg.*; got "xyz"$'):
        plot(four_bar(), tmp_path / "figure.xyz", what=["q"])
    path = tmp_path / "absent" / "figure.png"
    message = f'cannot write the figure to "{path}": No such file or directory; '
    message += "name a file in a folder that can be written"
    with pytest.raises(OutputError, match=f"^{re.escape(message)}$"):
        plot(four_bar(), path, what=["q"])
    assert os.listdir(tmp_path) == []


def test_what_cannot_be_drawn_is_refused() -> None:
    run = four_bar()
    with pytest.raises(InputError, match="plot: what must name at least one plot; got none"):
        plot(run, what=[])
    with pytest.raises(
        InputError, match='plot "modes" needs an element that sticks or slips, and this scene has none'
    ):
        plot(run, what=["modes"])
    with pytest.raises(UnknownNameError, match='no plot and no joint "crnk"; nearest: "crank"'):
        plot(run, what=["crnk"])
    run.scene = None
    with pytest.raises(InputError, match="a figure needs the scene of the run"):
        plot(run)


@pytest.mark.parametrize("run", [None, pn.load("four_bar")])
def test_what_is_no_run_is_refused(run: Any) -> None:
    for draw, what in ((plot, "a figure"), (pn.replay, "a replay")):
        message = f"{what} shows a Trajectory, the result of `simulate`; got {type(run).__name__}"
        with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
            draw(run)


def test_one_name_stands_for_a_list_of_it() -> None:
    run = pn.simulate(pn.load("four_bar"), 0.05, record="energy")
    assert len(plot(run, what="energy").axes) == 1
    assert pn.replay(run, plots="energy").text == pn.replay(run, plots=["energy"]).text


def test_a_simulated_run_is_drawn() -> None:
    run = pn.simulate(pn.load("four_bar"), 0.05, record=("forces", "energy", "a"))
    figure = plot(run, what=["q", "v", "a", "energy", "work", "violation", "reactions", "modes"])
    assert len(figure.axes) == 8
    figure.canvas.draw()


def test_drawing_needs_no_window_system() -> None:
    script = (
        "import sys\n"
        "import pin_nonideal\n"
        "assert 'matplotlib' not in sys.modules\n"
        "from tests.support.replay_runs import four_bar\n"
        "pin_nonideal.plot(four_bar())\n"
        "print('matplotlib.pyplot' in sys.modules)\n"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "False", done.stderr
