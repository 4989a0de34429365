"""Sweeps that are kept in a folder, on clusters, with failures; grids and samples of parameters."""

from __future__ import annotations

import functools
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import joblib
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.sweeps import sweep as sweeping
from pin_nonideal.sweeps.pack import read_records
from pin_nonideal.sweeps.store import append_records

from ..support.refusals import refuses
from ..support.same_run import assert_same_run


def pendulum(mass=1.0, damping=0.1, breaks=False):
    """A damped pendulum; one that breaks raises after 0.05 s."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "swing")
    lever = np.array([0.0, 0.0, -1.0])
    model.appendBodyToJoint(1, pin.Inertia(mass, lever, 0.01 * np.eye(3)), pin.SE3.Identity())

    def drive(t, q, v):
        if breaks and t > 0.05:
            raise ValueError("broke")
        return -damping * v

    rub = pn.JointFriction("swing", viscous=damping)
    return pn.Scene(model, q0=[1.0], actuation=drive if breaks else None, laws=[rub])


def amplitude(run):
    return {"amplitude": np.abs(run.q).max()}


GRID = pn.sweep_grid(mass=[1.0, 2.0], damping=[0.05, 0.1, 0.2])


def assert_are_their_runs(runs, parameters, duration=0.1):
    for run, p in zip(runs, parameters, strict=True):
        assert_same_run(run, pn.simulate(pendulum(**p), duration))


@pytest.mark.parametrize("backend", ["threading", "loky"])
def test_a_store_holds_the_runs(tmp_path, backend):
    with joblib.parallel_config(backend=backend):
        kept = pn.sweep(pendulum, GRID, 0.1, jobs=2, store=tmp_path / "runs", measure=amplitude)
    assert len(kept) == 6
    assert_are_their_runs(kept, GRID)
    assert_are_their_runs(kept[1:3], GRID[1:3])
    assert [r["parameters"] for r in kept.records] == GRID
    assert kept.missing == []
    assert kept.failures == {}
    again = pn.Sweep(tmp_path / "runs")
    assert again.records == kept.records
    assert str(again) == f"sweep in {tmp_path / 'runs'}: 6 of 6 runs, 0 of them failed"


def test_the_summary_is_that_of_the_runs(tmp_path):
    kept = pn.sweep(pendulum, GRID, 0.1, jobs=1, store=tmp_path / "runs", measure=amplitude)
    largest = [np.abs(run.q).max() for run in kept]
    told = kept.summary()
    assert told["amplitude"]["mean"] == pytest.approx(np.mean(largest))
    assert told["amplitude"]["std"] == pytest.approx(np.std(largest))
    assert told["amplitude"]["quantiles"][0.5] == pytest.approx(np.median(largest))
    assert told["steps"]["worst"] == int(np.argmax([run.stats.steps for run in kept]))
    assert {"violation", "wall_s", "evaluations", "t_end"} <= set(told)


def packs(store):
    """Contents of the files that hold runs."""
    return {path: path.read_bytes() for path in store.glob("*.runs")}


def test_what_is_missing_is_done_and_what_is_there_is_not_done_again(tmp_path):
    """The index, or the end of a file after a run, may be lost or truncated."""
    store = tmp_path / "runs"
    kept = pn.sweep(pendulum, GRID, 0.1, jobs=1, store=store, measure=amplitude)
    index = store / "index.jsonl"
    lines = index.read_text().splitlines(keepends=True)
    index.write_text("".join(lines[:3]) + lines[3][:10])  # as a kill leaves it
    (last,) = (path for path in packs(store) if path.name.startswith("0000005"))
    last.write_bytes(last.read_bytes()[:-1])
    before = packs(store)
    assert pn.Sweep(store).missing == [5]
    assert pn.Sweep(store).records[:5] == kept.records[:5]
    assert pn.Sweep(store)._repr_html_().count(">missing<") == 1
    with refuses("run 5 of the sweep in", pn.LoadingError):
        pn.Sweep(store)[5]
    again = pn.sweep(pendulum, GRID, 0.1, jobs=1, store=store, measure=amplitude)
    assert again.missing == []
    assert {path: content for path, content in packs(store).items() if path in before} == before
    assert_are_their_runs(again, GRID)
    assert [r["amplitude"] for r in again.records] == [r["amplitude"] for r in kept.records]


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_kill_loses_nothing_that_was_done(tmp_path, jobs):
    """A process is killed during a sweep; the same call computes the missing runs."""
    store = tmp_path / "runs"
    code = f"""
    import sys
    sys.path.insert(0, {str(Path(__file__).parents[2])!r})
    import pin_nonideal as pn
    from tests.sweeps.test_sweep_store import pendulum
    parameters = pn.sweep_grid(mass=[1.0 + 0.1 * k for k in range(200)])
    pn.sweep(pendulum, parameters, 20.0, jobs={jobs}, store={str(store)!r})
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], start_new_session=True)
    deadline = time.monotonic() + 120
    while sum(b.count(b"header.npy") // 2 for b in packs(store).values()) < 5 and time.monotonic() < deadline:
        assert process.poll() is None
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    begun = packs(store)
    left = pn.Sweep(store).missing
    assert 0 < len(left) <= 195
    parameters = pn.sweep_grid(mass=[1.0 + 0.1 * k for k in range(200)])
    kept = pn.sweep(pendulum, parameters, 20.0, jobs=jobs, store=store)
    assert kept.missing == []
    after = packs(store)
    assert {path: after[path] for path in begun} == begun
    assert sum(len(list(read_records(path, 0))) for path in after) == 200  # none of them twice
    for k in (0, 4, 199):
        assert_same_run(kept[k], pn.simulate(pendulum(**parameters[k]), 20.0))


def test_a_run_knows_its_robot(tmp_path):
    """A scene from `load` is loaded again; a run is an archive in the format of `save`."""
    points = [{"name": "four_bar"}, {"name": "slider_crank"}]
    kept = pn.sweep(pn.load, points, 0.1, jobs=1, store=tmp_path / "runs", record="forces")
    run = kept.load(1)
    assert run.scene.name == "slider_crank"
    assert kept[1].scene is None
    saved = pn.Trajectory.load(run.save(tmp_path / "run.npz"))
    assert_same_run(saved, pn.simulate(pn.load("slider_crank"), 0.1, record="forces"))
    with refuses('Trajectory.load: the scene "four_bar" is not the one of the run', pn.InputError):
        kept.load(1, pn.load("four_bar"))
    with pytest.raises(IndexError):
        kept[2]


def test_a_store_of_another_form_is_refused(tmp_path):
    pn.sweep(pendulum, GRID[:1], 0.1, jobs=1, store=tmp_path)
    index = tmp_path / "index.jsonl"
    index.write_text(index.read_text().replace('"format": 2', '"format": 1'))
    with refuses("holds no sweep of this version: its format is 1 instead of 2", pn.LoadingError):
        pn.sweep(pendulum, GRID[:1], 0.1, jobs=1, store=tmp_path)


@pytest.mark.parametrize("stored", [False, True])
def test_failures_are_results(tmp_path, stored):
    parameters = [{"mass": 1.0}, {"breaks": True}, {"mass": -1.0}, {"mass": 2.0}]
    store = tmp_path / "runs" if stored else None
    runs = pn.sweep(pendulum, parameters, 0.1, jobs=1, store=store, failures="keep")
    assert_same_run(runs[0], pn.simulate(pendulum(), 0.1))
    assert_same_run(runs[3], pn.simulate(pendulum(mass=2.0), 0.1))
    if stored:
        assert list(runs.failures) == [1, 2]
        assert "UserFunctionError: actuation raised ValueError: broke" in runs.failures[1]
        assert 0.0 < runs[1].t[-1] < 0.1
        assert runs[1].failure is not None
        with refuses("has no samples; it failed: InputError: ", pn.LoadingError):
            runs[2]
    else:
        assert isinstance(runs[1], pn.UserFunctionError)
        assert runs[1].index == 1
        assert 0.0 < runs[1].trajectory.t[-1] < 0.1
        assert isinstance(runs[2], pn.InputError)
    with pytest.raises(pn.UserFunctionError) as stopped:
        pn.sweep(pendulum, parameters[:2], 0.1, jobs=1)
    assert stopped.value.index == 1


def test_what_a_store_refuses(tmp_path):
    store = tmp_path / "runs"
    pn.sweep(pendulum, GRID[:1], 0.1, jobs=1, store=store)
    for other in ((GRID[:2], 0.1, {}), (GRID[:1], 0.2, {}), (GRID[:1], 0.1, {"rtol": 1e-6})):
        with refuses(
            f'sweep: store "{store}" holds another sweep: its parameters, duration or options', pn.InputError
        ):
            pn.sweep(pendulum, other[0], other[1], jobs=1, store=store, **other[2])
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")
    with refuses("must be empty or hold this sweep; it holds other files", pn.InputError):
        pn.sweep(pendulum, GRID[:1], 0.1, jobs=1, store=tmp_path / "full")
    with refuses(f'"{tmp_path}" holds no sweep: there is no index.jsonl in it', pn.LoadingError):
        pn.Sweep(tmp_path)
    with refuses("sweep: failures must be one of 'raise', 'keep'; got 'ignore'", pn.InputError):
        pn.sweep(pendulum, GRID, 0.1, failures="ignore")
    with refuses("sweep: duration must be a number; got None", pn.InputError):
        pn.sweep(pendulum, GRID, None)
    with refuses("sweep: parameters must hold mappings of keyword arguments; got {1: 2}", pn.InputError):
        pn.sweep(pendulum, [{1: 2}], 0.1)
    with refuses("sweep: make raised TypeError: ", pn.UserFunctionError):
        pn.sweep(len, GRID, 0.1, jobs=1)
    with refuses(
        "sweep: make must return a Scene; got 1.0 for {'mass': 1.0, 'damping': 0.05}", pn.UserFunctionError
    ):
        pn.sweep(lambda mass, damping: mass, GRID, 0.1, jobs=1)
    with refuses("sweep: measure writes into the index of a store; name one", pn.InputError):
        pn.sweep(pendulum, GRID, 0.1, measure=amplitude)
    with refuses("sweep: measure must return numbers by name; got 3", pn.UserFunctionError):
        pn.sweep(pendulum, GRID, 0.1, jobs=1, store=tmp_path / "three", measure=lambda run: 3)
    with refuses("sweep: measure must be a function (run) -> numbers by name; got 3", pn.InputError):
        pn.sweep(pendulum, GRID, 0.1, measure=3)


class Damped:
    """Factory of pendulums with its own damping."""

    def __init__(self, damping):
        self.damping = damping

    def __call__(self, **parameters):
        return pendulum(damping=self.damping, **parameters)


def test_files_that_cannot_be_read_or_written_are_named(tmp_path):
    """A folder in place of a file stands for every error of the system."""
    runs = pn.sweep(pendulum, GRID[:2], 0.1, jobs=1, store=tmp_path / "runs")
    for file in runs.folder.glob("*.runs"):
        file.unlink()
        file.mkdir()
    with refuses(f'cannot read run 0 from "{runs.folder}', pn.LoadingError):
        runs[0]
    index = runs.folder / "index.jsonl"
    index.unlink()
    index.mkdir()
    with refuses(f'cannot write "{index}": ', pn.OutputError):
        append_records(runs.folder, [{"run": 1}])
    (tmp_path / "file").write_text("")
    with refuses(f'cannot write the sweep to "{tmp_path / "file"}": ', pn.OutputError):
        pn.sweep(pendulum, GRID[:1], 0.1, jobs=1, store=tmp_path / "file")


def test_makers_are_told_apart_by_what_they_hold(tmp_path):
    for name, maker in (("object", Damped), ("partial", lambda x: functools.partial(pendulum, damping=x))):
        store, points = tmp_path / name, [{"mass": 1.0}]
        pn.sweep(maker(0.1), points, 0.1, jobs=1, store=store, atol=np.full(2, 1e-9))
        pn.sweep(maker(0.1), points, 0.1, jobs=1, store=store, atol=np.full(2, 1e-9))
        with refuses("holds another sweep", pn.InputError):
            pn.sweep(maker(0.2), points, 0.1, jobs=1, store=store, atol=np.full(2, 1e-9))


def test_a_full_disk_is_named(tmp_path, monkeypatch):
    """Earlier runs are kept, and the interrupted run is repeated."""
    resource = pytest.importorskip("resource")
    store = tmp_path / "runs"
    whole = pn.sweep(pendulum, GRID, 0.1, jobs=1, store=tmp_path / "whole")
    size = max(len(content) for content in packs(whole.folder).values())
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    monkeypatch.setattr(sweeping, "TASKS_PER_WORKER", 1)  # several runs in one file
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(2.5 * size), limits[1]))
    try:
        with refuses("cannot write the run to", pn.OutputError):
            pn.sweep(pendulum, GRID, 0.1, jobs=1, store=store)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert pn.Sweep(store).missing == [2, 3, 4, 5]
    kept = pn.sweep(pendulum, GRID, 0.1, jobs=1, store=store)
    assert kept.missing == []
    assert_are_their_runs(kept, GRID)


class Stubborn:
    def __reduce__(self):
        raise TypeError("cannot pickle this")


def test_what_cannot_be_sent_is_named():
    lock = threading.Lock()
    reason = "must be picklable for another process; TypeError: cannot pickle"
    with refuses(f"sweep: parameters[1] {reason}", pn.InputError):
        pn.sweep(pendulum, [{"mass": 1.0}, {"mass": Stubborn()}], 0.1, jobs=2)
    with refuses(f"sweep: make {reason}", pn.InputError):
        pn.sweep(lambda mass: pendulum(mass, lock), [{"mass": 1.0}] * 2, 0.1, jobs=2)
    with refuses(f"sweep: callback {reason}", pn.InputError):
        pn.sweep(pendulum, [{"mass": 1.0}] * 2, 0.1, jobs=2, callback=lambda t, q, v: bool(lock))


# --- Clusters ----------------------------------------------------------------------------------------------

THOUSAND = pn.sweep_grid(mass=np.linspace(1.0, 2.0, 200), damping=[0.05, 0.06, 0.07, 0.08, 0.09])


@pytest.mark.slow
def test_processes_carry_a_sweep(tmp_path):
    runs = pn.sweep(pendulum, THOUSAND, 0.1, jobs=2)
    kept = pn.sweep(pendulum, THOUSAND, 0.1, jobs=2, store=tmp_path / "runs")
    assert_are_their_runs(runs, THOUSAND)
    assert_are_their_runs(kept, THOUSAND)


@pytest.mark.slow
def test_dask_carries_a_sweep(tmp_path):
    distributed = pytest.importorskip("distributed")
    parameters = THOUSAND
    client = distributed.Client(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with client, joblib.parallel_config(backend="dask"):
        runs = pn.sweep(pendulum, parameters, 0.1, jobs=-1)
        kept = pn.sweep(pendulum, parameters, 0.1, jobs=-1, store=tmp_path / "runs")
    assert_are_their_runs(runs, parameters)
    assert_are_their_runs(kept, parameters)


@pytest.mark.slow
def test_ray_carries_a_sweep(tmp_path):
    ray = pytest.importorskip("ray")
    from ray.util.joblib import register_ray

    register_ray()
    parameters = THOUSAND
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        with joblib.parallel_config(backend="ray"):
            runs = pn.sweep(pendulum, parameters, 0.1, jobs=2)
            kept = pn.sweep(pendulum, parameters, 0.1, jobs=2, store=tmp_path / "runs")
    finally:
        ray.shutdown()
    assert_are_their_runs(runs, parameters)
    assert_are_their_runs(kept, parameters)


# --- Parameters --------------------------------------------------------------------------------------------


def test_grids():
    assert pn.sweep_grid(a=[1, 2], b=["x", "y"]) == [
        {"a": 1, "b": "x"},
        {"a": 1, "b": "y"},
        {"a": 2, "b": "x"},
        {"a": 2, "b": "y"},
    ]
    assert pn.sweep_grid() == [{}]
    assert json.dumps(pn.sweep_grid(m=np.linspace(0, 1, 3))) == '[{"m": 0.0}, {"m": 0.5}, {"m": 1.0}]'
    with refuses("sweep_grid: a must be a list of values; got array(3)", pn.InputError):
        pn.sweep_grid(a=np.array(3))
    with refuses("sweep_grid: a must be a list of values; got 3", pn.InputError):
        pn.sweep_grid(a=3)


@pytest.mark.parametrize("kind", ["sobol", "latin", "halton", "random"])
def test_samples_fill_their_box(kind):
    points = pn.sweep_samples(64, kind=kind, seed=1, mu=(0.1, 0.5), mass=(2.0, 4.0))
    x = np.array([[p["mu"], p["mass"]] for p in points])
    assert (x >= [0.1, 2.0]).all()
    assert (x <= [0.5, 4.0]).all()
    assert points == pn.sweep_samples(64, kind=kind, seed=1, mu=(0.1, 0.5), mass=(2.0, 4.0))
    assert points != pn.sweep_samples(64, kind=kind, seed=2, mu=(0.1, 0.5), mass=(2.0, 4.0))
    if kind in ("latin", "sobol"):  # one point in each of 64 strips
        strips = np.floor((x - [0.1, 2.0]) / [0.4, 2.0] * 64)
        assert all(len(set(column)) == 64 for column in strips.T)


def test_samples_that_do_not_fit():
    with refuses("sweep_samples: seed must be an integer; got ''", pn.InputError):
        pn.sweep_samples(4, seed="", mu=(0.0, 1.0))
    with refuses("sweep_samples: n must be at least 1; got 0", pn.InputError):
        pn.sweep_samples(0, mu=(0, 1))
    with refuses("sweep_samples needs the range of a parameter", pn.InputError):
        pn.sweep_samples(3)
    with refuses("sweep_samples: mu must have shape (2,); got shape (3,)", pn.InputError):
        pn.sweep_samples(3, mu=(0, 1, 2))
