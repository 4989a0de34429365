"""Other commands than `run`: states by name, resume, replay, sweep, equilibrium, info, completion."""

from __future__ import annotations

import json
import shutil
import subprocess

import numpy as np
import pytest

import pin_nonideal as pn
from pin_nonideal.cli.main import main

from ..support.small_robots import ARM, folder, link, robot

ONE = ["--duration", "0.1"]


def fails(capsys, words):
    assert main(words) == 2
    return capsys.readouterr().err.strip()


def test_states_by_name(tmp_path, capsys):
    path = folder(tmp_path, "model: {free_flyer: true}", robot(link("base"), *ARM[1:5]))
    out = tmp_path / "run.npz"
    states = ["--q", "elbow=0.5", "--q", "base.xyz=0,0,1", "--q", "base.rpy=0,0,1", "--v", "shoulder=2"]
    assert main(["run", str(path), *ONE, *states, "--save", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    run = pn.Trajectory.load(out)
    q = {"elbow": 0.5, "base": {"xyz": [0, 0, 1], "rpy": [0, 0, 1]}}
    expected = pn.simulate(pn.load(path), 0.1, q=q, v={"shoulder": 2.0})
    np.testing.assert_array_equal(run.q, expected.q)
    words = ["run", str(path), *ONE]
    assert '--q elbow=0.5 or --q base.xyz=0,0,1; got "elbow"' in fails(capsys, [*words, "--q", "elbow"])
    assert 'no joint "elbw"; nearest: "elbow"' in fails(capsys, [*words, "--q", "elbw=1"])
    assert 'got "elbow=up"' in fails(capsys, [*words, "--v", "elbow=up"])


def test_events_are_printed(capsys):
    assert main(["run", "rough_four_bar", "--duration", "1", "--events", "--quiet"]) == 0
    run = pn.simulate(pn.load("rough_four_bar"), 1.0)
    assert run.events
    assert capsys.readouterr().out.splitlines() == [
        f"{e.time:.9g} s  {e.kind}  {e.element}" for e in run.events
    ]
    assert main(["run", "four_bar", *ONE, "--events", "--quiet"]) == 0
    assert capsys.readouterr().out == "no events\n"


def test_checkpoint_and_resume(tmp_path, capsys):
    kept, saved = tmp_path / "run.checkpoint", tmp_path / "again.npz"
    assert main(["run", "four_bar", *ONE, "--checkpoint", str(kept)]) == 0
    assert main(["resume", str(kept), "--save", str(saved)]) == 0
    assert "four_bar: 0 to 0.1 s" in capsys.readouterr().out
    np.testing.assert_array_equal(pn.Trajectory.load(saved).q, pn.simulate(pn.load("four_bar"), 0.1).q)
    assert "cannot read a checkpoint from" in fails(capsys, ["resume", str(tmp_path / "none")])


def test_replay_of_a_saved_run(tmp_path, capsys):
    run = tmp_path / "run.npz"
    assert main(["run", "four_bar", *ONE, "--save", str(run)]) == 0
    assert main(["replay", str(run)]) == 0
    assert f"wrote {tmp_path / 'run.html'}" in capsys.readouterr().out
    assert main(["replay", str(run), str(tmp_path / "page.html")]) == 0
    assert (tmp_path / "page.html").stat().st_size > 1e5
    pn.simulate(pn.Scene(pn.load("four_bar").model), 0.1).save(run)
    assert "names no robot that `load` finds; give one: --robot" in fails(capsys, ["replay", str(run)])


def test_info_for_programs(capsys):
    assert main(["info", "rough_four_bar", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    scene = pn.load("rough_four_bar")
    assert [j["name"] for j in told["joints"]] == [str(n) for n in scene.model.names][1:]
    assert told["nv"] == scene.model.nv
    np.testing.assert_array_equal(told["q0"], scene.initial_state()[0])
    assert {"constraints", "laws", "source", "licence", "notes", "dropped"} <= set(told)


def test_equilibrium(capsys):
    assert main(["equilibrium", "four_bar", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    found = pn.equilibrium(pn.load("four_bar"))
    np.testing.assert_allclose(np.concatenate(list(told["q"].values())), found.q, rtol=0, atol=1e-15)
    assert told["stable"] == found.stable
    assert main(["equilibrium", "four_bar"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] in ("stable", "unstable", "neutral")
    assert len(lines) == 1 + len(told["q"])


SWEEP = """
robot: n_four_bar
duration: 0.05
grid: {N: [1, 2, 3]}
options: {output_dt: 0.05}
store: runs
jobs: 1
"""


def test_a_sweep_from_a_file(tmp_path, capsys):
    path = tmp_path / "ladders.yaml"
    path.write_text(SWEEP)
    assert main(["sweep", str(path)]) == 0
    assert "3 of 3 runs, 0 of them failed" in capsys.readouterr().out
    kept = pn.Sweep(tmp_path / "runs")
    for k, N in enumerate((1, 2, 3)):
        alone = pn.simulate(pn.load("n_four_bar", N=N), 0.05, output_dt=0.05)
        np.testing.assert_array_equal(kept[k].q, alone.q)
    runs = str(tmp_path / "runs")
    assert main(["replay", runs, "--run", "2"]) == 0
    page = tmp_path / "runs.2.html"
    assert capsys.readouterr().out == f"wrote {page}\n"
    assert page.stat().st_size > 10_000
    assert "--run must be at least 0 and below 3; got 3" in fails(capsys, ["replay", runs, "--run", "3"])
    assert "--run K selects a run in the folder of a sweep" in fails(capsys, ["replay", runs])
    assert 'ladders.yaml" is no folder' in fails(capsys, ["replay", str(path), "--run", "0"])
    path.write_text(SWEEP.replace("0.05\n", "0.07\n", 1))
    assert "holds another sweep" in fails(capsys, ["sweep", str(path)])


@pytest.mark.parametrize(
    ("yaml", "message"),
    [
        ("[]", "must be a table with the keys robot, parameters, duration"),
        ("robot: four_bar", 'needs the key "duration"'),
        ("{robot: four_bar, duration: 1, gird: {}}", 'unknown key "gird"; nearest: "grid"'),
        ("{robot: four_bar, duration: 1}", "must have one of the keys grid and samples"),
        ("{robot: four_bar, duration: 1, grid: 3}", "grid must be a table; got 3"),
        ("{robot: four_bar, duration: 1, samples: {sed: 3}}", 'samples: unknown key "sed"; nearest: "seed"'),
        ("{robot: four_bar", "cannot be read as plain YAML"),
    ],
)
def test_sweep_files_that_do_not_fit(tmp_path, capsys, yaml, message):
    path = tmp_path / "sweep.yaml"
    path.write_text(yaml)
    assert message in fails(capsys, ["sweep", str(path)])


def test_samples_from_a_file(tmp_path, capsys):
    path = tmp_path / "sweep.yaml"
    path.write_text("{robot: four_bar, duration: 0.01, samples: {n: 2, ranges: {mu: [0.1, 0.2]}}, jobs: 1}")
    assert main(["sweep", str(path)]) == 0
    out = capsys.readouterr().out
    assert "2 of 2 runs, 2 of them failed" in out
    assert 'takes no parameter "mu"' in out


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for word in ("equilibrium", "four_bar", "checkpoint", "output-dt", "example", "gripper"):
        assert word in script
    if shell == "bash" and shutil.which("bash"):
        for words, name in (("equilibrium four", "four_bar"), ("example grip", "gripper")):
            asked = (
                f'COMP_WORDS=(pin-nonideal {words}); COMP_CWORD=2; _pin_nonideal; echo "${{COMPREPLY[@]}}"'
            )
            told = subprocess.run(
                ["bash", "-c", f"{script}\n{asked}"], capture_output=True, text=True, check=True
            )
            assert name in told.stdout.split()
