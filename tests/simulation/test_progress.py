"""Progress bar of a run, as it stands on a terminal when the run has ended."""

from __future__ import annotations

import contextlib

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn


def pendulums(count, **parts):
    """Return equal pendulums beside each other, each with friction in its joint."""
    model = pin.Model()
    for k in range(count):
        joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), f"joint {k}")
        lever = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5]))
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), lever)
    laws = [pn.JointFriction(f"joint {k}", coulomb=0.1) for k in range(count)]
    return pn.Scene(model, laws=laws, q0=[1.0] * count, **parts)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize(
    "options", [{"method": "dop853"}, {"method": "rk4", "dt": 0.01}, {"method": "Radau"}]
)
def test_the_bar_of_a_run_ends_full(count, options, capsys):
    pn.simulate(pendulums(count), 0.25, t0=2.0, progress=True, **options)
    line = capsys.readouterr().err.rstrip().split("\r")[-1]
    assert line.startswith("100%|")
    assert "| 0.25/0.25 s [" in line


def test_the_bar_of_a_run_that_ends_early_stays_there(capsys):
    def half(t, q, v):
        return t - 0.125

    half.terminal = True
    pn.simulate(pendulums(1), 0.25, progress=True, events=[half])
    assert capsys.readouterr().err.rstrip().split("\r")[-1].startswith(" 50%|")


def test_without_a_terminal_there_is_no_bar(capsys):
    pn.simulate(pendulums(1), 0.25)
    assert capsys.readouterr().err == ""


def test_mechanisms_one_after_another_advance_one_bar(monkeypatch):
    """Each of two mechanisms fills half of the bar."""
    times = []
    monkeypatch.setattr(
        "pin_nonideal.simulation.simulate.progress_bar", lambda *_: contextlib.nullcontext(times.append)
    )
    monkeypatch.setattr(
        "pin_nonideal.simulation.decoupled.run_together",
        lambda compiled, q0, v0, options, tick: _run(tick, compiled, q0, v0, options),
    )
    pn.simulate(pendulums(2), 1.0, t0=3.0)
    assert times == [3.25, 3.5, 3.75, 4.0, 4.0]


def _run(tick, compiled, q0, v0, options):
    """Run a mechanism that reports its progress at half time and at its end."""
    for t in (3.5, 4.0):
        tick(t)
    return compiled.program.runner().simulate(q0, v0, options)
