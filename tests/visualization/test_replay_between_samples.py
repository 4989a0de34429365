"""States between the samples of a run: cubics, closed loops, and the time that a page takes."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description.time_functions import Sinusoid
from pin_nonideal.visualization.page.between_samples import Cubics
from pin_nonideal.visualization.page.frames import sample

from ..support.replay_runs import four_bar, jointed, run_of

ROUNDING = 1e-12
JOINTS = {
    "in one plane": (pin.JointModelRZ(), pin.JointModelPX(), pin.JointModelRUBZ()),
    "in space": (
        pin.JointModelFreeFlyer(),
        pin.JointModelRX(),
        pin.JointModelRUBY(),
        pin.JointModelSpherical(),
    ),
}


def random_run(joints: tuple, count: int = 6) -> SimpleNamespace:
    model = jointed(*joints)
    rng = np.random.default_rng(3)
    steps = [0.3 * rng.normal(size=model.nv) for _ in range(count - 1)]
    q = [pin.neutral(model)]
    for step in steps:
        q.append(pin.integrate(model, q[-1], step))
    scene = SimpleNamespace(model=model, constraint_slices={})
    times = np.sort(rng.uniform(0.0, 1.0, size=count))
    return SimpleNamespace(t=times, q=np.array(q), v=rng.normal(size=(count, model.nv)), scene=scene)


@pytest.mark.parametrize("joints", JOINTS.values(), ids=JOINTS)
def test_cubics_meet_the_samples_with_their_velocities(joints: tuple) -> None:
    run = random_run(joints)
    cubics, k = Cubics(run), np.arange(5)
    for part, samples in ((0.0, k), (1.0, k + 1)):
        s = np.full(5, part)
        for q, expected in zip(cubics.configurations(k, s), run.q[samples], strict=True):
            assert np.abs(pin.difference(run.scene.model, q, expected)).max() < ROUNDING
        np.testing.assert_allclose(cubics.velocities(k, s), run.v[samples], atol=1e-10)


@pytest.mark.parametrize("joints", JOINTS.values(), ids=JOINTS)
def test_velocities_are_those_of_the_configurations(joints: tuple) -> None:
    run = random_run(joints)
    cubics, k, s, step = Cubics(run), np.arange(5), np.linspace(0.1, 0.9, 5), 1e-6
    ahead, back = cubics.configurations(k, s + step), cubics.configurations(k, s - step)
    rates = [pin.difference(run.scene.model, *pair) for pair in zip(back, ahead, strict=True)]
    h = np.diff(run.t)[:, None]
    np.testing.assert_allclose(rates / (2.0 * step * h), cubics.velocities(k, s), atol=1e-6, rtol=1e-6)


def gap(run: object, q: np.ndarray) -> float:
    """Distance of the two ends of the four-bar's loop [m]."""
    model, data = run.scene.model, run.scene.model.createData()
    pin.framesForwardKinematics(model, data, q)
    one, other = (data.oMf[model.getFrameId(name)].translation for name in ("coupler_tip", "rocker_tip"))
    return float(np.linalg.norm(one - other))


def test_loops_are_closed_between_samples() -> None:
    run = four_bar(count=13)
    k, s = np.arange(12), np.full(12, 0.5)
    assert max(gap(run, q) for q in Cubics(run).configurations(k, s)) > 1e-5
    q, moved = Cubics(run).closed(k, s, 1.0, 1e-3)
    assert max(gap(run, x) for x in q) < 1e-9
    assert 1e-6 < moved.max() < 1e-2


def test_loops_that_cannot_be_closed_are_told() -> None:
    run = four_bar(count=13)
    run.q[6] = [0.0, 0.0, np.pi]  # crank and coupler point away from the rocker
    q, moved = Cubics(run).closed(np.array([2, 5]), np.array([0.5, 0.9]), 1.0, 1e-3)
    assert np.isfinite(moved[0])
    assert not moved[1] < 0.3
    assert np.isfinite(q).all()


def test_what_moves_in_time_is_closed_at_its_time() -> None:
    model = jointed(pin.JointModelPX(), pin.JointModelRZ())
    motion = pn.PrescribedMotion("j0", Sinusoid(0.1, 2.0), name="shaker")
    scene = pn.Scene(model, constraints=[motion], name="shaken")
    run = pn.simulate(scene, 1.0, output_dt=0.05)
    k, s = np.arange(len(run.t) - 1), np.full(len(run.t) - 1, 0.4)
    q, _ = Cubics(run).closed(k, s, 1.0, 1e-3)
    times = run.t[:-1] + 0.4 * np.diff(run.t)
    rows = scene._compiled.program.runner()
    residual = [rows.rows(x, np.zeros(2), t)[2].max() for x, t in zip(q, times, strict=True)]
    assert np.abs(residual).max() < 1e-9


def test_the_frames_of_a_hundred_seconds_are_closed_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closing the loops of every frame by itself took ten times as long."""
    run = pn.simulate(pn.load("four_bar"), 100.0, record=("forces", "energy"))
    calls, closed = [], Cubics.closed

    def counted(cubics: Cubics, k: np.ndarray, *rest: object) -> object:
        calls.append(len(k))
        return closed(cubics, k, *rest)

    monkeypatch.setattr(Cubics, "closed", counted)
    pn.replay(run, tmp_path / "page.html")
    assert sum(calls) >= len(run.t) - 1
    assert len(calls) <= 10
    assert (tmp_path / "page.html").stat().st_size < 3_000_000
    assert len(sample(run).times) > len(run.t)


def test_a_progress_bar_tells_the_stages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    monkeypatch.setattr("pin_nonideal.visualization.progress.DELAY", 0.0)
    run = run_of(jointed(pin.JointModelRZ()), np.linspace(0.0, 1.0, 9), lambda t: np.array([t]))
    pn.replay(run, tmp_path / "page.html")
    assert capsys.readouterr().err == ""  # no terminal
    pn.replay(run, tmp_path / "page.html", progress=True)
    shown = capsys.readouterr().err
    assert "replay: motion" in shown
    assert "5/5" in shown
