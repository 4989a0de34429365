"""Output files: links are followed, permissions stay, devices are left alone, left-over parts go."""

from __future__ import annotations

import dataclasses
import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pin_nonideal as pn
from pin_nonideal.atomic_files import whole_file
from pin_nonideal.cli.main import main
from pin_nonideal.errors import InputError, LoadingError, OutputError, UserFunctionError
from pin_nonideal.scene.base import FROZEN_FIELDS

from ..support.refusals import refuses
from ..support.small_robots import folder, joint, link, robot

LIST = f"{sys.executable} -c 'from pin_nonideal.cli.main import main; raise SystemExit(main([\"list\"]))'"


def write(path, content=b"new"):
    with whole_file(path, "the run") as stream:
        stream.write(content)


def test_a_link_stays_and_its_target_is_written(tmp_path):
    target, link_to = tmp_path / "data" / "run.npz", tmp_path / "run.npz"
    target.parent.mkdir()
    target.write_bytes(b"old")
    link_to.symlink_to(target)
    write(link_to)
    assert link_to.is_symlink()
    assert target.read_bytes() == b"new"


def test_permissions_stay(tmp_path):
    path = tmp_path / "run.npz"
    path.write_bytes(b"old")
    path.chmod(0o640)
    write(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_devices_and_pipes_are_left_alone(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, tmp_path / "null"):
        if path.name == "null":
            path.symlink_to("/dev/null")
        with refuses("it is a device or a pipe; name a file", OutputError):
            write(path)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_links_that_lead_in_a_circle_are_left_alone(tmp_path):
    loop = tmp_path / "run.npz"
    loop.symlink_to(loop)
    with refuses("its symbolic links lead in a circle; name a file", OutputError):
        write(loop)
    assert loop.is_symlink()


def test_a_device_is_no_beginning_of_a_name():
    run = pn.simulate(pn.load("four_bar"), 0.01)
    with refuses('cannot write the trajectory to "/dev/null": it is a device or a pipe', OutputError):
        run.save("/dev/null")
    assert not os.path.exists("/dev/null.npz")


def test_a_device_is_found_before_the_run(capsys, monkeypatch):
    monkeypatch.setattr(pn, "simulate", None)
    assert main(["run", "four_bar", "--duration", "0.1", "--html", "/dev/null"]) == 2
    assert 'cannot write the output to "/dev/null": it is a device or a pipe' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("where", "code", "said"), [("> /dev/full", 2, "cannot print: No space left"), (">&-", 0, "")]
)
def test_output_that_cannot_be_printed_is_said_in_one_line(where, code, said):
    done = subprocess.run(f"{LIST} {where}", shell=True, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == code
    assert said in done.stderr
    assert done.stderr.count("\n") <= 1


def test_parts_of_killed_processes_are_taken_away(tmp_path):
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom pin_nonideal.atomic_files import whole_file\n"
        "with whole_file(Path(sys.argv[1]), 'x') as s:\n    s.write(b'half')\n    s.flush()\n"
        "    os.kill(os.getpid(), 9)\n"
    )
    path = tmp_path / "run.npz"
    subprocess.run([sys.executable, "-c", code, str(path)], check=False)
    assert len(list(tmp_path.iterdir())) == 1
    (half,) = tmp_path.iterdir()
    beginning, owner, process, *ends = half.name.rsplit(".", 4)
    live = half.with_name(
        ".".join((beginning, owner, str(os.getpid()), *ends))
    )  # part file of a running process
    far = half.with_name(".".join((beginning, "00000000", process, *ends)))  # part file of another machine
    for other in (live, far):
        other.write_bytes(b"")
    write(path)
    assert {p.name for p in tmp_path.iterdir()} == {path.name, live.name, far.name}


@pytest.mark.parametrize(("reader", "read"), [("head -1", 1), ("true", 0)])
def test_a_list_that_is_not_read_to_its_end_ends_quietly(reader, read):
    done = subprocess.run(f"{LIST} | {reader}", shell=True, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.stdout.count("\n") == read


def test_times_of_a_saved_run_are_checked(tmp_path):
    run = pn.simulate(pn.load("four_bar"), 0.01)
    for change, words in (
        (np.nan, "t must be finite; it holds nan"),
        (-1.0, "t must not fall; t[1] = -1 follows 0"),
    ):
        run.save(tmp_path / "run.npz")
        with np.load(tmp_path / "run.npz") as file:
            arrays = dict(file)
        arrays["t"][1] = change
        np.savez(tmp_path / "bad.npz", **arrays)
        with refuses(words, LoadingError):
            pn.Trajectory.load(tmp_path / "bad.npz")


def test_a_scene_that_does_not_fit_a_run_is_refused(tmp_path):
    run = pn.simulate(pn.load("four_bar"), 0.01)
    other = dataclasses.replace(run, scene=pn.load("five_bar"))
    for show in (pn.replay, pn.plot):
        with refuses('needs the scene of the run: scene "five_bar" has nq', InputError):
            show(other, tmp_path / "x.html")


def test_the_page_of_robots_says_what_the_list_says():
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "robots.md").read_text(encoding="utf-8")
    assert [name for name, said in pn.robots() if f"| `{name}` | {said} |" not in page] == []


def test_a_model_that_is_changed_after_the_scene_was_made_is_refused(tmp_path):
    scene = pn.load(folder(tmp_path))
    scene.model.inertias[1].mass = 7.0
    for act in (
        lambda: pn.simulate(scene, 0.1),
        lambda: scene.solve(scene.q0, scene.v0),
        lambda: scene.acceleration(scene.q0, scene.v0),
        lambda: scene.step(scene.q0, scene.v0, None, 0.1),
        scene.initial_state,
    ):
        with refuses("was changed after the scene was made", InputError):
            act()
    with pytest.raises(ValueError, match="read-only"):
        scene.q0[0] = 1.0


@pytest.mark.parametrize("key", FROZEN_FIELDS)
def test_what_a_scene_was_made_of_cannot_be_exchanged(tmp_path, key):
    scene = pn.load(folder(tmp_path))
    with refuses(
        f'{key} of scene "{scene.name}" is fixed at construction and cannot be exchanged', InputError
    ):
        setattr(scene, key, getattr(scene, key))
    scene.name = "another"


def test_configurations_of_a_saved_run_are_checked(tmp_path):
    pn.simulate(pn.load("four_bar"), 0.01).save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        arrays = dict(file)
    arrays["v"][1, 0] = np.inf
    np.savez(tmp_path / "bad.npz", **arrays)
    with refuses("v must be finite; it holds inf", LoadingError):
        pn.Trajectory.load(tmp_path / "bad.npz")


@pytest.mark.parametrize("text", ["duration: 1:30", "duration: 010", "parameters: {N: 012}"])
def test_numbers_that_mean_something_else_are_refused_in_sweeps_too(tmp_path, capsys, text):
    (tmp_path / "sweep.yaml").write_text(f"robot: four_bar\ngrid: {{}}\n{text}\n")
    assert main(["sweep", str(tmp_path / "sweep.yaml")]) == 2
    assert "is octal or sexagesimal in YAML" in capsys.readouterr().err


YAML = {
    "octal": (
        "gravity: [0, 0, -012]",
        "-012 is octal or sexagesimal in YAML (line 1); write decimals, or a text",
    ),
    "sexagesimal": ("initial: {q: {elbow: 1:30}}", "1:30 is octal or sexagesimal in YAML (line 1)"),
    "far base": ("model: {base: {xyz: [1e300, 0, 0]}}", "xyz and rpy must be at most 1e+09 (m, rad); got"),
    "kind": ("notes: 3", "must be a list of names; got 3"),
    "number": ("3", "must be a table of keys; got an int"),
}


@pytest.mark.parametrize(("text", "message"), YAML.values(), ids=YAML)
def test_numbers_that_mean_something_else_in_yaml_are_refused(tmp_path, text, message):
    with refuses(message):
        pn.load(folder(tmp_path, text))


def test_an_empty_table_is_a_robot_without_extras(tmp_path):
    assert pn.load(folder(tmp_path, "")).model.nv == 2


def test_errors_of_functions_tell_the_time(tmp_path):
    def torque(t, q, v):
        if t > 0.05:
            raise RuntimeError("out of reach")
        return np.zeros(2)

    scene = pn.load(folder(tmp_path))
    with pytest.raises(UserFunctionError, match=r"out of reach \(at t = \d\.\d+ s\)"):
        pn.simulate(pn.Scene(scene.model, actuation=torque), 1.0)


def test_info_lists_forces_actuation_and_limits(tmp_path):
    text = robot(link("base"), link("a"), joint("turn", "base", "a", limits='lower="-1" upper="2"'))
    yaml = "forces: [{JointSpring: {joint: turn, stiffness: 2.0}}]\nactuation: {torques: {turn: 1.0}}"
    said = pn.load(folder(tmp_path, yaml, text)).report()
    for line in (
        "  force turn (JointSpring)",
        "  actuation constant torques",
        "  limits, which the motion may pass: turn",
    ):
        assert line in said


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root gives files away")
def test_the_owner_stays(tmp_path):
    there = tmp_path / "run.npz"
    there.write_bytes(b"")
    os.chown(there, 1234, 1234)
    write(there, b"x")
    assert (there.stat().st_uid, there.stat().st_gid, there.read_bytes()) == (1234, 1234, b"x")
