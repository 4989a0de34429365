"""Figures in print, of one quantity over another, and of several runs."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from matplotlib.figure import Figure

import pin_nonideal as pn
from pin_nonideal.errors import InputError, UnknownNameError
from pin_nonideal.visualization.plotting import MAX_EVENT_LINES, plot

from ..support.replay_runs import add_frame, four_bar, jointed, panda

RECORD = ("forces", "energy", "power", "reactions")


@pytest.fixture(scope="module")
def belt() -> Any:
    return pn.simulate(pn.load("belt_oscillator"), 4.0, output_dt=0.01, record=RECORD)


@pytest.fixture(scope="module")
def arm() -> Any:
    return pn.simulate(pn.load("panda_settling"), 0.5, output_dt=0.01, record=RECORD)


def lines(figure: Any, place: int = 0) -> dict[str, Any]:
    return {line.get_label(): line for line in figure.axes[place].lines}


@pytest.mark.parametrize(("columns", "width"), [(1, 85.0), (2, 176.0)])
def test_printed_figures_are_as_wide_as_columns(columns: int, width: float) -> None:
    figure = plot(four_bar(), columns=columns)
    assert figure.get_figwidth() * 25.4 == pytest.approx(width)
    assert figure.get_suptitle() == ""  # a caption says it in print


def test_printed_curves_are_told_apart_without_color() -> None:
    drawn = list(plot(four_bar(), what="q", columns=1).axes[0].lines)
    dashes = {str(line._dash_pattern) for line in drawn}
    assert len(dashes) == 3
    assert len({line.get_marker() for line in drawn}) == 3


def test_text_of_a_printed_figure_stays_text(tmp_path: Path) -> None:
    plot(four_bar(), tmp_path / "a.svg", what="q", style="paper")
    assert "<text" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    plot(four_bar(), tmp_path / "b.svg", what="q")
    assert "<text" not in (tmp_path / "b.svg").read_text(encoding="utf-8")


def test_settings_of_matplotlib_are_taken() -> None:
    axes = plot(four_bar(), what="q", style={"font.size": 17.0}).axes[0]
    assert axes.xaxis.label.get_fontsize() == pytest.approx(17.0)


def test_one_plot_goes_into_given_axes() -> None:
    own = Figure()
    left, right = own.subplots(1, 2)
    assert plot(four_bar(), what="q", ax=right, title="Angles") is own
    assert len(left.lines) == 0
    assert len(right.lines) == 3
    assert right.get_title() == "Angles"
    with pytest.raises(InputError, match=r"^plot: ax takes one plot; got 2 plots$"):
        plot(four_bar(), what=["q", "v"], ax=left)


def test_a_title_is_the_readers() -> None:
    assert plot(four_bar(), what="q", title="Mine").get_suptitle() == "Mine"
    assert plot(four_bar(), what="q").get_suptitle() == "four_bar"
    assert plot(four_bar(), what="q", title="").get_suptitle() == ""


def test_a_phase_plane_is_velocity_over_position() -> None:
    run = four_bar()
    figure = plot(run, what=["phase crank", "q"])
    curve = lines(figure)["crank"]
    np.testing.assert_array_equal(curve.get_xdata(), run.q[:, 0])
    np.testing.assert_array_equal(curve.get_ydata(), run.v[:, 0])
    assert figure.axes[0].get_xlabel() == "position [rad]"
    assert figure.axes[1].get_xlim() == (0.0, 1.0)  # the time axis is not the phase plane's
    assert set(lines(plot(run, what="phase"))) == {"crank", "coupler", "rocker"}


def limit_dots(figure: Any) -> Any:
    """Return the positions and values of the dots that mark the limit of the law."""
    return next(line for line in figure.axes[0].lines if line.get_marker() == ".").get_data()


def test_friction_stays_within_the_limit_that_is_drawn(belt: Any) -> None:
    figure = plot(belt, what="friction")
    curve, dots = lines(figure)["rubbing"], limit_dots(figure)
    joint = belt.scene.model.joints[belt.scene.model.getJointId("slip")].idx_v
    x, y = curve.get_xdata(), curve.get_ydata()
    assert np.isnan(x).sum() == len(belt.events)  # nothing leads from one mode into another
    x, y = x[np.isfinite(x)], y[np.isfinite(x)]
    np.testing.assert_array_equal(x, belt.v[:, joint])
    for at, friction in zip(x, y, strict=True):
        own = dots[1][dots[0] == at]
        assert own.min() - 1e-9 <= friction <= own.max() + 1e-9
    np.testing.assert_allclose([dots[1].min(), dots[1].max()], [-8.0, 8.0], rtol=1e-9)
    sliding = np.abs(x) > 1e-6
    np.testing.assert_allclose(np.abs(y[sliding]), 5.0, rtol=1e-6)  # mu m g
    assert np.abs(y[~sliding]).max() > 6.0  # it sticks up to 8 N


@pytest.mark.parametrize("what", ["friction bearing", "load bearing"])
def test_the_drawn_limit_has_the_viscous_part_of_the_law(what: str) -> None:
    """While the joint slips, the friction of the law is its dry limit plus the viscous part."""
    law = pn.JointFriction("j0", coulomb=0.1, mu=0.2, radius=0.01, viscous=0.3, name="bearing")
    scene = pn.Scene(jointed(pin.JointModelRY()), laws=[law])
    run = pn.simulate(scene, 1.0, v=[2.0], output_dt=0.01, record=("laws", "reactions"))
    slips = run.law("bearing").mode != 0
    assert slips.sum() > 50
    x, y = lines(plot(run, what=what))["bearing"].get_data()
    drawn = np.isfinite(x)
    dots = dict(zip(*limit_dots(plot(run, what=what)), strict=True))
    law = [dots[at] for at in x[drawn][slips]]
    np.testing.assert_allclose(y[drawn][slips], law, rtol=1e-9)  # and the dots oppose the motion


def test_friction_over_load_grows_as_the_law_says(arm: Any) -> None:
    law = next(x for x in arm.scene.laws if x.joint == "panda_joint2")
    name = law.name or f"JointFriction({law.joint})"
    curve = lines(plot(arm, what=f"load {name}"))[name]
    load = arm.reaction("panda_joint2")[:, :2]
    drawn = np.isfinite(curve.get_xdata())
    np.testing.assert_allclose(curve.get_xdata()[drawn], np.linalg.norm(load, axis=1), rtol=1e-12)
    assert (curve.get_ydata()[drawn] >= 0.0).all()


def test_power_and_torques_are_plots(belt: Any) -> None:
    power = lines(plot(belt, what="power"))["rubbing"]
    np.testing.assert_array_equal(power.get_ydata(), belt.power["rubbing"])
    robot = pn.simulate(pn.load("solo12_standing"), 0.05, record="forces")
    joint = robot.scene.model.joints[robot.scene.model.getJointId("FL_KFE")].idx_v
    np.testing.assert_array_equal(lines(plot(robot, what="tau"))["FL_KFE"].get_ydata(), robot.tau[:, joint])


def test_contacts_show_their_normal_forces() -> None:
    model = jointed(pin.JointModelTranslation(), lever=0.0)
    add_frame(model, "foot", 1, [0.0, 0.0, 0.0])
    scene = pn.Scene(model, contacts=[pn.PointContact("foot", mu=0.3, name="foot")])
    run = pn.simulate(scene, 0.1, v=np.array([1.0, 0.0, 0.0]), record="forces")
    np.testing.assert_allclose(lines(plot(run, what="contacts"))["foot"].get_ydata(), 9.81, rtol=1e-9)


def test_usual_figures_suit_their_scenes(belt: Any) -> None:
    shown = [axes.get_ylabel().split("\n")[0] for axes in plot(belt).axes]
    assert shown == ["Position", "Velocity", "Energy", "Constraint violation", "friction [N]", ""]


def test_several_runs_share_their_axes_and_are_told_apart() -> None:
    one, other = four_bar(), four_bar(count=31)
    other.q = other.q + 0.1
    figure = plot([one, other], what=["q", "energy"][:1], names=["stiff", "soft"])
    drawn = lines(figure)
    np.testing.assert_array_equal(drawn["crank, stiff"].get_ydata(), one.q[:, 0])
    np.testing.assert_array_equal(drawn["crank, soft"].get_ydata(), other.q[:, 0])
    assert drawn["crank, stiff"].get_color() == drawn["crank, soft"].get_color()
    assert drawn["crank, stiff"].get_linestyle() != drawn["crank, soft"].get_linestyle()
    assert "crank, run 2" in lines(plot([one, other], what="q"))


def test_runs_with_and_without_friction_are_compared(belt: Any) -> None:
    """Default plots are those that all runs have; only runs with friction elements have bands of modes."""
    smooth = pn.simulate(belt.scene.replace(laws=[]), 0.1, record="energy")
    figure = plot([belt, smooth], names=["rough", "smooth"])
    assert [label.split("\n")[0] for label in (axes.get_ylabel() for axes in figure.axes)] == [
        *("Position", "Velocity", "Energy", "Constraint violation", "")
    ]
    assert len(plot([smooth, belt], what="modes").axes) == 1


def test_a_cloud_of_events_is_drawn_by_its_density() -> None:
    run = panda()
    times = np.linspace(0.0, 0.25, MAX_EVENT_LINES + 1)
    run.events = [SimpleNamespace(time=t, kind="slip", element="e") for t in times]
    axes = plot(run, what="energy").axes[0]
    assert not [line for line in axes.lines if list(line.get_ydata()) == [0, 1]]
    (marks,) = axes.collections
    assert len(marks.get_segments()) == 200
    assert f"{MAX_EVENT_LINES + 1} events, by density" in [
        text.get_text() for text in axes.get_legend().get_texts()
    ]


def test_modes_in_print_are_hatched(belt: Any) -> None:
    hatches = {bars.get_hatch() for bars in plot(belt, what="modes", columns=2).axes[0].collections}
    assert len(hatches) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"columns": 3}, "plot: columns must be one of"),
        ({"style": "fancy"}, "plot: style must be one of"),
        ({"style": 3}, 'plot: style must be "screen", "paper" or matplotlib settings; got 3'),
        ({"title": 3}, "plot: title must be a string or None; got 3"),
        ({"names": ["a", "b"]}, "a figure of 1 runs needs as many names; got 2"),
        ({"what": "friction"}, 'plot "friction" needs a law in a joint of one degree of freedom'),
        ({"what": "contacts"}, 'plot "contacts" needs a contact, and this scene has none'),
        ({"what": "power"}, 'plot "power" must be recorded: pass record=("power",) to simulate'),
        ({"what": "tau"}, 'plot "tau" must be recorded: pass record=("tau",) to simulate'),
    ],
)
def test_what_a_figure_cannot_be_is_refused(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        plot(four_bar(), **options)


def test_unknown_joints_laws_and_missing_records_are_told(belt: Any) -> None:
    with pytest.raises(UnknownNameError, match='plot "phase crnk": no joint "crnk"; nearest: "crank"'):
        plot(four_bar(), what="phase crnk")
    with pytest.raises(UnknownNameError, match='plot "friction rubing": no law "rubing"'):
        plot(belt, what="friction rubing")
    bare = pn.simulate(belt.scene, 0.1)
    with pytest.raises(InputError, match=r'plot "friction" must be recorded: pass record=\("laws",\)'):
        plot(bare, what="friction")
    laws = pn.simulate(belt.scene, 0.1, record="laws")
    with pytest.raises(InputError, match=r'plot "load" must be recorded: pass record=\("laws", "reac'):
        plot(laws, what="load")
    with pytest.raises(InputError, match=r"^a figure shows at least one run; got none$"):
        plot([])
