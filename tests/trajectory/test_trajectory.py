"""Trajectories: fields, printed texts, and valid and damaged files."""

from __future__ import annotations

import copy
import dataclasses
import io
import json
import os
import pickle
import re
import sys
import zipfile

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, LoadingError, OutputError
from pin_nonideal.trajectory.records import Event

from ..support.mechanisms import body, empty
from ..support.refusals import refuses
from ..support.same_run import assert_same_run


@pytest.fixture(scope="module")
def run():
    scene = pn.load("four_bar")
    return pn.simulate(scene, 0.3, output_dt=0.05, record=("a", "forces", "energy", "power"))


def test_shapes(run):
    scene, n = run.scene, len(run)
    m = max(s.stop for s in scene.constraint_slices.values())
    nq, nv = scene.model.nq, scene.model.nv
    widths = {"q": nq, "v": nv, "a": nv, "F_ideal": nv, "F_nonideal": nv, "lam": m, "lam_ideal": m}
    for key, width in (widths | {"modes": len(scene.element_names)}).items():
        assert getattr(run, key).shape == (n, width), key
    for key in ("t", "violation", "violation_rate"):
        assert getattr(run, key).shape == (n,), key
    assert run.z is None
    columns = ["kinetic", "potential", "total", "actuation", "forces", "constraints", *scene.law_names]
    assert list(run.energy) == [*columns, "projection", "balance"]
    assert list(run.power) == columns[3:]


def test_fields_that_were_not_asked_for_are_not_recorded():
    plain = pn.simulate(pn.load("four_bar"), 0.05)
    for key in ("a", "F_ideal", "F_nonideal", "lam", "lam_ideal", "z"):
        assert not plain.recorded(key), key


@pytest.mark.parametrize("look", [vars, copy.copy, lambda run: run.grid, lambda run: run.samples(0)])
def test_fields_are_there_whoever_looks_first(look):
    """Fields of a run are computed on first access."""
    scene = pn.load("belt_oscillator")
    run, other = (pn.simulate(scene, 0.1, output_dt=0.01) for _ in range(2))
    look(run)
    names = {field.name for field in dataclasses.fields(pn.Trajectory)}
    assert set(vars(run)) == set(vars(other)) == names
    assert_same_run(run, other)
    assert run.t is run.t
    with pytest.raises(AttributeError, match="'Trajectory' object has no attribute 'speed'"):
        _ = run.speed


@pytest.mark.parametrize(
    ("record", "keys"),
    [
        ("lam", ("lam", "F_ideal", "F_nonideal", "lam_ideal")),
        (["F_ideal", "a"], ("F_ideal", "lam", "a")),
        ({"energy"}, ("energy",)),
    ],
)
def test_a_name_of_a_field_records_its_group(record, keys):
    recorded = pn.simulate(
        pn.load("four_bar"), 0.02, record=list(record) if isinstance(record, set) else record
    )
    assert all(getattr(recorded, key) is not None for key in keys)


def test_recorded_forces_belong_to_the_recorded_motion(run):
    """Samples between the steps too: M a = F + F_ideal + F_nonideal with the scene's own solution there."""
    for k in range(len(run)):
        s = run.scene.solve(run.q[k], run.v[k], run.t[k])
        scale = np.abs(s.F_ideal).max() + np.abs(s.F_nonideal).max()
        np.testing.assert_allclose(run.a[k], s.a, rtol=0, atol=1e-9 * np.abs(s.a).max())
        for key in ("F_ideal", "F_nonideal", "lam"):
            np.testing.assert_allclose(getattr(run, key)[k], getattr(s, key), rtol=0, atol=1e-9 * scale)


def test_recorded_acceleration_of_laws_with_states():
    """The states of a law at the sample, not those of the stages, enter the recorded acceleration."""
    model = pn.load("four_bar").model
    law = pn.UserLaw(lambda t, q, v, r, z: (-5.0 * z * np.ones(3), [np.sin(20.0 * t) + v[0]]), states=1)
    scene = pn.Scene(model, laws=[law], v0=[1.0, -2.0, 0.5])
    sampled = pn.simulate(scene, 0.5, output_dt=0.05, record="a", rtol=1e-9)
    frozen_law = pn.UserLaw(lambda t, q, v, r: -5.0 * now * np.ones(3), reaction=None)
    frozen = pn.Scene(model, laws=[frozen_law])
    for k in range(len(sampled)):
        now = float(sampled.z[k, 0])
        expected = frozen.acceleration(sampled.q[k], sampled.v[k])
        np.testing.assert_allclose(sampled.a[k], expected, rtol=1e-9, atol=1e-9)


def test_what_needs_the_scene_says_so(run, tmp_path):
    dense = pn.simulate(run.scene, 0.1, record="dense")
    lost = pn.Trajectory.load(dense.save(tmp_path / "run.npz"), scene=None)
    with refuses("at(t) needs the scene of the run, which this one has lost", InputError):
        lost.at(0.05)
    with refuses('frame("coupler_tip") needs the scene of the run, which this one has lost', InputError):
        lost.frame("coupler_tip")
    with refuses('at(t) needs a run with record="dense"', InputError):
        run.at(0.05)


def test_events_are_equal_by_their_values():
    """Equal events have one hash, and an event equals nothing else."""
    one, same = (Event(0.5, "impact", "foot", impulse=np.array([1.0, 0.2, 0.0])) for _ in range(2))
    assert one == same
    assert len({one, same}) == 1
    assert one != dataclasses.replace(one, impulse=np.array([1.0, 0.3, 0.0]))
    assert one != (0.5, "impact", "foot")


def test_tables_of_pandas_say_what_to_install(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with refuses("to_dataframe needs pandas, which cannot be imported", InputError):
        run.to_dataframe()


def test_words(run):
    lines = str(run).splitlines()
    assert lines[0] == "four_bar: 0 to 0.3 s, 7 samples"
    assert lines[1].startswith(f"  steps {run.stats.steps} ({run.stats.rejected} rejected), evaluations ")
    assert lines[2].startswith("  violation ")
    assert lines[3].startswith("  energy [J]: kinetic ")
    assert lines[-1].startswith("  wall time ")


# --- Files -------------------------------------------------------------------------------------------------


def test_a_file_gives_everything_back(run, tmp_path):
    path = run.save(tmp_path / "four_bar")
    assert path == tmp_path / "four_bar.npz"
    back = pn.Trajectory.load(path)
    assert_same_run(back, run)
    assert back.stats.wall_s == run.stats.wall_s
    assert back.name == "four_bar"
    assert back.scene.name == "four_bar"
    assert str(back) == str(run)


def test_interpolants_of_an_earlier_version_come_back(tmp_path):
    """These held one direction of slip a step, that of the step's end."""
    model = empty()
    body(model, 0, pin.JointModelSpherical(), "ball", 1.0, lever=(0.0, 0.0, -0.3), inertia=0.01 * np.eye(3))
    scene = pn.Scene(model, laws=[pn.JointFriction("ball", coulomb=0.2)], v0=[1.0, 2.0, 0.5])
    run = pn.simulate(scene, 0.5, record="dense")
    with np.load(run.save(tmp_path / "new.npz")) as new:
        arrays = dict(new)
    del arrays["loose/dense/sought"]
    arrays["loose/dense/directions"] = arrays["loose/dense/directions"][:, -1]
    np.savez(tmp_path / "earlier.npz", **arrays)
    back, times = pn.Trajectory.load(tmp_path / "earlier.npz", scene), np.linspace(0.0, 0.5, 33)
    np.testing.assert_allclose(back.at(times).q, run.at(times).q, rtol=0.0, atol=1e-15)
    assert not back.dense.sought.any()


def test_events_and_states_of_laws_come_back(tmp_path):
    law = pn.UserLaw(lambda t, q, v, r, z: (-z * np.ones(3), [v[0]]), states=1)
    scene = pn.Scene(pn.load("four_bar").model, laws=[law, pn.JointFriction("rocker_joint", coulomb=0.05)])
    run = pn.simulate(scene, 1.0, v=[1.0, -2.0, 0.5])
    assert run.events
    back = pn.Trajectory.load(run.save(tmp_path / "run.npz"))
    assert_same_run(back, run)


def test_long_runs_are_written_as_they_are(run, tmp_path):
    """Digits of a motion hardly pack, and packing takes many times as long as writing."""
    long = pn.simulate(pn.load("four_bar"), 2.0, output_dt=1e-4)
    for written, kind in ((run, zipfile.ZIP_DEFLATED), (long, zipfile.ZIP_STORED)):
        with zipfile.ZipFile(written.save(tmp_path / "run.npz")) as archive:
            assert {entry.compress_type for entry in archive.infolist()} == {kind}
        assert_same_run(pn.Trajectory.load(tmp_path / "run.npz"), written)


def cannot_write(path, reason):
    message = (
        f'cannot write the trajectory to "{path}": {reason}; name a file in a folder that can be written'
    )
    return refuses(message, OutputError)


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_file_gets_the_permissions_of_any_new_file(run, tmp_path):
    plain = tmp_path / "plain"
    plain.write_text("")
    assert run.save(tmp_path / "run.npz").stat().st_mode == plain.stat().st_mode


@pytest.mark.parametrize("path", [None, 3, b"run.npz", ""])
def test_names_of_files_that_are_none(run, path):
    with refuses(f"Trajectory.save: path must be the name of a file; got {path!r}", InputError):
        run.save(path)
    with refuses(f"Trajectory.load: path must be the name of a file; got {path!r}", InputError):
        pn.Trajectory.load(path)


def test_a_run_shows_itself_in_one_line(run):
    assert repr(run) == f'<Trajectory "{run.name}": {len(run)} samples to {run.t[-1]:g} s, 0 events>'


def test_a_file_is_replaced_whole_or_not_at_all(run, tmp_path, monkeypatch):
    path = run.save(tmp_path / "run.npz")
    before = path.read_bytes()

    def full_disk(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full_disk)
    with cannot_write(path, "No space left on device"):
        run.save(path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["run.npz"]


def test_an_unwritable_place(run, tmp_path):
    path = tmp_path / "nowhere" / "run.npz"
    with cannot_write(path, "No such file or directory"):
        run.save(path)
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "run.npz"
    with cannot_write(path, "Not a directory"):
        run.save(path)
    folder = tmp_path / "run.npz"
    folder.mkdir()
    with cannot_write(folder, "Is a directory"):
        run.save(folder)
    assert sorted(os.listdir(tmp_path)) == ["file", "run.npz"]


def cannot_read(path, reason):
    return refuses(f'cannot read a trajectory from "{path}": {reason}', LoadingError)


def cannot_read_because(path):
    """Return the whole message of this package on an unreadable file."""
    advice = "; it must be an .npz file written by Trajectory.save"
    reason = "its content is damaged or of another kind"
    return pytest.raises(
        LoadingError, match="^" + re.escape(f'cannot read a trajectory from "{path}": {reason}{advice}') + "$"
    )


def test_a_missing_file(tmp_path):
    path = tmp_path / "no.npz"
    with cannot_read(path, "there is no such file; it must be"):
        pn.Trajectory.load(path)


@pytest.mark.parametrize("part", [0.0, 0.2, 0.7, 0.999])
def test_a_truncated_file(run, tmp_path, part):
    path = run.save(tmp_path / "run.npz")
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    with cannot_read_because(path):
        pn.Trajectory.load(path)


def test_a_damaged_file(run, tmp_path):
    path = run.save(tmp_path / "run.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 40] = bytes(40)
    path.write_bytes(bytes(data))
    with cannot_read_because(path):
        pn.Trajectory.load(path)


class Command:
    """Runs when it is unpickled."""

    def __reduce__(self):
        return (os.mkdir, ("came_true",))


def test_a_file_that_tries_to_run_code(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plain = tmp_path / "plain.npz"
    plain.write_bytes(pickle.dumps(Command()))
    hidden = tmp_path / "hidden.npz"
    np.savez(hidden, header=np.array([Command()], dtype=object), t=np.zeros(1))
    for path in (plain, hidden):
        with cannot_read(path, "its content is damaged or of another kind"):
            pn.Trajectory.load(path)
    assert not (tmp_path / "came_true").exists()


def rewrite(path, **changes):
    """The file with other members; None leaves one out."""
    with np.load(path) as file:
        members = {key: file[key] for key in file.files}
    header = json.loads(str(members["header"]))
    header |= changes.pop("header", {})
    members["header"] = np.array(json.dumps(header))
    members |= changes
    np.savez(path, **{key: x for key, x in members.items() if x is not None})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"header": {"format": 99}}, "must have format 1; it has 99"),
        ({"q": None}, "is no complete trajectory: q missing"),
        ({"v": np.zeros((2, 3))}, "v must have 7 rows as t has; got shape (2, 3)"),
        ({"t": np.zeros((7, 2))}, "t must be one column; got shape (7, 2)"),
        ({"lam": np.array(["a"] * 7)}, "lam must hold numbers; got str"),
        ({"header": {"energy": ["kinetic", "total"]}}, "its energy has no potential, balance"),
    ],
)
def test_a_file_that_is_no_trajectory_of_this_version(run, tmp_path, changes, message):
    path = run.save(tmp_path / "run.npz")
    rewrite(path, **changes)
    with refuses(message, LoadingError):
        pn.Trajectory.load(path)


def test_other_archives(tmp_path):
    path = tmp_path / "other.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    with cannot_read(path, "its content is damaged or of another kind"):
        pn.Trajectory.load(path)
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    path.write_bytes(buffer.getvalue())
    with cannot_read_because(path):
        pn.Trajectory.load(path)


def test_records_show_shapes_instead_of_numbers(run):
    scene, n = run.scene, len(run)
    joint, frame = scene.model.names[1], scene.model.frames[-1].name
    arrays = f"q {(n,)}, v {(n,)}, a {(n,)}, tau {(n,)}"
    assert repr(run.joint(joint)) == f'<JointRecord "{joint}": {arrays}>'
    arrays = f"translation {(n, 3)}, rotation {(n, 3, 3)}, velocity {(n, 6)}"
    assert repr(run.frame(frame)) == f'<FrameRecord "{frame}": {arrays}>'
    plain = pn.simulate(scene, 0.1, output_dt=0.1).joint(joint)
    assert repr(plain).endswith("a not recorded, tau not recorded>")
