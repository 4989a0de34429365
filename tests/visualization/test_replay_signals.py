"""Curves, events and modes as the replay and the figures show them."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, UnknownNameError
from pin_nonideal.visualization.page.coordinates import positions, velocities
from pin_nonideal.visualization.page.mode_timeline import mode_bands
from pin_nonideal.visualization.page.signals import (
    INTERVALS,
    MAX_CURVES,
    Plot,
    plots_of,
)

from ..support.replay_runs import four_bar, jointed, panda, run_of

ROUNDING = 1e-12


def test_the_usual_plots_are_those_that_the_run_has() -> None:
    titles = [plot.title for plot in plots_of(four_bar(), None)]
    assert titles == ["Constraint violation", "Reactions, |lam|", "Position"]
    assert [plot.title for plot in plots_of(panda(), None)] == ["Energy", "Position"]


def test_energies_share_one_axis_and_work_has_its_own() -> None:
    energy, work = plots_of(panda(), ["energy", "work"])
    assert (list(energy.curves), energy.unit) == (["kinetic", "potential", "total"], "J")
    assert list(work.curves) == ["friction"]


def test_violation_is_on_a_logarithmic_axis() -> None:
    (plot,) = plots_of(four_bar(), ["violation"])
    assert plot.log
    assert plot.unit == "m, rad"


def test_the_size_of_a_reaction_is_the_norm_of_its_rows() -> None:
    run = four_bar()
    (plot,) = plots_of(run, ["reactions"])
    np.testing.assert_allclose(plot.curves["loop"], np.sqrt(np.sum(run.lam**2, axis=1)), atol=ROUNDING)


def test_a_joints_name_plots_its_position_and_its_velocity() -> None:
    run = four_bar()
    place, rate = plots_of(run, ["coupler"])
    np.testing.assert_array_equal(place.curves["coupler"], run.q[:, 1])
    np.testing.assert_array_equal(rate.curves["coupler"], run.v[:, 1])
    assert (place.unit, rate.unit) == ("rad", "rad/s")


def test_curves_of_ones_own_carry_title_and_unit() -> None:
    run = four_bar()
    (plot,) = plots_of(run, [("Tip height [mm]", {"tip": 2.0 * run.t})])
    assert (plot.title, plot.unit) == ("Tip height", "mm")
    np.testing.assert_array_equal(plot.curves["tip"], 2.0 * run.t)


@pytest.mark.parametrize("chosen", [3, object, [None], [("Tip", [1.0])], [("Tip [m]", {}, {})], [(0, {})]])
def test_what_is_no_list_of_plots_is_refused(chosen) -> None:
    run = four_bar()
    for what, call in (("plots", plots_of), ("plot: what", lambda run, x: pn.plot(run, what=x))):
        with pytest.raises(InputError, match=f"^{what} must (be a list|hold names, and pairs of a title)"):
            call(run, chosen)


@pytest.mark.parametrize("curve", [["a"], [None], np.array([1.0 + 2.0j]), [[1.0], [1.0, 2.0]]])
def test_curves_of_no_numbers_are_refused(curve) -> None:
    message = f'curve "tip" of plot "Tip" must hold numbers; got {curve!r}'
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        plots_of(four_bar(), [("Tip", {"tip": curve})])


def test_what_cannot_be_plotted_is_refused() -> None:
    run = four_bar()
    with pytest.raises(UnknownNameError, match='no plot and no joint "energi"; nearest: "energy"'):
        plots_of(run, ["energi"])
    for name, record in (("energy", "energy"), ("work", "energy"), ("a", "a")):
        message = f'plot "{name}" must be recorded: pass record=("{record}",) to simulate'
        with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
            plots_of(run, [name])
    for name in ("violation", "reactions"):
        with pytest.raises(InputError, match=f'plot "{name}" needs a constraint, and this scene has none'):
            plots_of(panda(), [name])
    message = r'curve "tip" of plot "Tip" must have shape \(61,\), one value per sample; got \(3,\)'
    with pytest.raises(InputError, match=message):
        plots_of(run, [("Tip", {"tip": np.zeros(3)})])


def test_no_more_curves_than_can_be_told_apart_and_those_that_move_most() -> None:
    model = jointed(*[pin.JointModelRZ()] * 12)
    run = run_of(model, np.linspace(0.0, 1.0, 5), lambda t: t * np.arange(12.0))
    (plot,) = plots_of(run, ["q"])
    assert list(plot.curves) == [f"j{number}" for number in range(12 - MAX_CURVES, 12)]


def test_turning_and_sliding_joints_are_on_axes_of_their_own() -> None:
    model = jointed(pin.JointModelRZ(), pin.JointModelPX())
    run = run_of(model, [0.0, 1.0], lambda t: np.array([t, 2.0 * t]))
    assert [(plot.title, plot.unit) for plot in plots_of(run, ["q", "v"])] == [
        ("Position", "rad"),
        ("Position", "m"),
        ("Velocity", "rad/s"),
        ("Velocity", "m/s"),
    ]


def test_a_continuous_joint_is_an_angle_without_jumps() -> None:
    model = jointed(pin.JointModelRUBZ())
    t = np.linspace(0.0, 1.0, 40)
    run = run_of(model, t, lambda x: np.array([np.cos(9.0 * x), np.sin(9.0 * x)]))
    (angle,) = positions(model, run.q)
    np.testing.assert_allclose(angle.values, 9.0 * t, atol=ROUNDING)


@pytest.mark.parametrize(
    ("joint", "places", "rates"),
    [
        (pin.JointModelFreeFlyer(), ["x", "y", "z"], ["vx", "vy", "vz", "wx", "wy", "wz"]),
        (pin.JointModelTranslation(), ["x", "y", "z"], ["vx", "vy", "vz"]),
        (pin.JointModelPlanar(), ["x", "y", "angle"], ["vx", "vy", "wz"]),
        (pin.JointModelSpherical(), [], ["wx", "wy", "wz"]),
    ],
    ids=["free", "translation", "planar", "spherical"],
)
def test_joints_of_several_degrees_of_freedom_show_their_components(
    joint: object, places: list[str], rates: list[str]
) -> None:
    model = jointed(joint)
    q, v = np.tile(pin.neutral(model), (3, 1)), np.zeros((3, model.nv))
    assert [item.label for item in positions(model, q)] == [f"j0 {name}" for name in places]
    assert [item.label for item in velocities(model, v)] == [f"j0 {name}" for name in rates]


def test_thinning_keeps_both_ends_and_every_peak() -> None:
    t = np.linspace(0.0, 1.0, 50_001)
    peak, dip = np.zeros(len(t)), np.sin(t)
    peak[12_345], dip[40_001] = 7.0, -3.0
    plot = Plot("Title", "N", t, {"peak": peak, "dip": dip})
    thin = plot.thinned()
    assert len(thin.t) <= 4 * INTERVALS + 2
    assert thin.curves["peak"].max() == 7.0
    assert thin.curves["dip"].min() == -3.0
    assert (thin.t[0], thin.t[-1]) == (0.0, 1.0)
    assert t[12_345] in thin.t
    short = Plot("Title", "N", t[:100], {"peak": peak[:100]})
    assert short.thinned() is short


def test_bands_hold_a_mode_from_its_sample_to_the_next_change() -> None:
    t = np.array([0.0, 1.0, 2.0, 3.0])
    bands = mode_bands(t, np.array([[0, 1], [0, 1], [-1, 1], [1, 1]], dtype=np.int8))
    assert bands[0] == [(0.0, 2.0, 0), (2.0, 3.0, -1), (3.0, 3.0, 1)]
    assert bands[1] == [(0.0, 3.0, 1)]


def test_joints_without_a_torque_are_left_out_of_the_plot_of_torques() -> None:
    run = pn.simulate(pn.load("four_bar"), 0.01, record=("forces",), progress=False)
    (plot,) = plots_of(run, ["tau"])
    assert list(plot.curves) == ["crank_joint"]
    assert plot.note == "zero in 2 other joints"
    still = pn.simulate(pn.load("rough_four_bar"), 0.01, record=("tau",), progress=False)
    assert len(plots_of(still, ["tau"])[0].curves) == 3
