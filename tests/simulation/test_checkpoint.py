"""A resumed run is bitwise equal to a run without interruption."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import textwrap
import time
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, LoadingError, OutputError, RunError, RunInterrupted
from pin_nonideal.loading.robot_files import robot_folders
from pin_nonideal.simulation import checkpoint
from pin_nonideal.simulation.options import run_options

from ..support.mechanisms import again
from ..support.random_trees import add
from ..support.refusals import refuses
from ..support.same_run import assert_same_run
from ..support.scenes import kinds, random_cases
from ..support.standing import balls

ALL = ("a", "forces", "energy", "power")


def cart():
    """A mass on a rail, pulled so that it slips, sticks and reverses, with a user law that has a state."""
    model = pin.Model()
    model.name = "cart"
    model.gravity = pin.Motion(np.array([0.0, 0.0, -9.81]), np.zeros(3))
    add(model, "rail", "prismatic x", 0, np.random.default_rng(0))
    add(model, "swing", "revolute y", 1, np.random.default_rng(1))
    pull = pn.Wrench("rail tip", lambda t: [30.0 * np.sin(4.0 * t), 0.0, 0.0, 0.0, 0.0, 0.0])
    rub = [
        pn.JointFriction("rail", mu=0.2, coulomb=2.0, static_ratio=1.3, viscous=0.1),
        pn.UserLaw(
            lambda t, q, v, r, z: (np.array([0.0, -0.1 * z[0]]), [v[1] - z[0]]), states=1, name="wear"
        ),
    ]
    return pn.Scene(model, laws=rub, forces=[pull], q0=[0.0, 0.7], name="cart")


def driven_arm():
    """The package's arm under a torque that is sampled and held."""
    scene = pn.load("panda_friction")
    control = pn.SampledControl(lambda t, q, v: -20.0 * (q - scene.q0) - 2.0 * v + np.sin(7.0 * t), 0.013)
    return pn.Scene(scene.model, laws=scene.laws, q0=scene.q0, actuation=control, name="arm")


def mixed_arm():
    """The package's arm with joints that a sampled control drives, beside joints that follow a table."""
    scene = pn.load("panda_friction")
    names, times = list(scene.model.names)[1:], np.linspace(0.0, 0.2, 12)
    brake = pn.SampledControl(
        lambda t, q, v: dict(zip(names[:3], -5.0 * v[:3], strict=True)), 0.013, joints=names[:3]
    )
    ramps = pn.Table(times, {name: 20.0 * np.sin(9.0 * times + k) for k, name in enumerate(names[3:])})
    return scene.replace(actuation=[brake, ramps])


def weak_arm():
    """Return an arm whose motors reach their effort limits again and again."""
    scene = pn.load("panda_friction")
    drive = pn.EffortLimits(lambda t, q, v: 60.0 * np.sin(9.0 * t + np.arange(len(v))), 40.0)
    return pn.Scene(scene.model, laws=scene.laws, q0=scene.q0, actuation=drive, name="weak arm")


# Every method of the core; friction that sticks and slips; loops, redundant ones too; held torques.
RUNS = {
    "events": (cart, 1.5, {"record": ALL, "rtol": 1e-6}),
    "effort": (weak_arm, 0.4, {"record": ALL, "rtol": 1e-6}),
    "events on a grid": (cart, 1.5, {"record": ALL, "output_dt": 0.02, "method": "dopri5"}),
    "fixed steps with events": (cart, 1.5, {"record": "energy", "method": "rk4", "dt": 0.01}),
    "time stepping": (cart, 1.5, {"record": ALL, "method": "moreau", "dt": 0.01, "output_dt": 0.03}),
    "loop": (lambda: pn.load("four_bar"), 1.0, {"record": ALL}),
    "loop, order 1": (lambda: pn.load("four_bar"), 0.2, {"method": "semi_implicit_euler", "dt": 1e-3}),
    "redundant loops": (lambda: pn.load("n_four_bar", N=4), 0.5, {"record": "forces", "output_dt": 0.05}),
    "sliding feet": (lambda: pn.load("solo12_standing"), 0.2, {"record": "energy", "rtol": 1e-5}),
    "sampled torque": (driven_arm, 0.2, {"record": "energy"}),
    "sampled torque beside a table": (mixed_arm, 0.2, {"record": ALL, "rtol": 1e-6}),
    "time stepping beside a table": (mixed_arm, 0.2, {"record": ALL, "method": "moreau", "dt": 5e-3}),
    "events, Pinocchio's terms": (
        lambda: again(cart(), terms="pinocchio"),
        1.5,
        {"record": ALL, "rtol": 1e-6},
    ),
    "redundant loops, Pinocchio's terms": (
        lambda: pn.load("n_four_bar", N=4, terms="pinocchio"),
        0.5,
        {"record": "forces", "output_dt": 0.05},
    ),
    "rolling": (lambda: pn.load("rolling_disk"), 0.5, {"output_dt": 0.1}),
    "slow slip": (lambda: balls(2)[0], 1.0, {"output_dt": 0.02, "record": ALL}),
}


@pytest.mark.parametrize("case", RUNS)
def test_every_part_of_a_run_goes_on_bit_by_bit(case, kept, tmp_path):
    make, duration, options = RUNS[case]
    alone = pn.simulate(make(), duration, **options)
    path = tmp_path / "run"
    scene = make()
    assert_same_run(alone, pn.simulate(scene, duration, **options, checkpoint=path, checkpoint_interval=0.0))
    states, chosen = list(kept), np.random.default_rng(0)
    assert len(states) > alone.stats.steps  # one before each step, and the last
    for k in sorted({0, len(states) - 1, *chosen.integers(len(states), size=6).tolist()}):
        path.write_bytes(states[k])
        assert_same_run(alone, pn.resume(path, scene, checkpoint_interval=1e9))


CASES = kinds() | random_cases(4)
METHODS = ("dop853", "rk4", "moreau", "semi_implicit_euler")
# Prescribed motions that start friction or break, and contacts that strike and open.
SHORT = ("started loop 0", "started with friction Spline", "motion Spline", "touching BoxContact")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "name", [n if n in SHORT else pytest.param(n, marks=pytest.mark.slow) for n in CASES]
)
def test_a_run_of_any_scene_resumes_bit_by_bit(name, method, kept, tmp_path):
    case, path = CASES[name](), tmp_path / "run"
    duration = min(case.duration, 3.0)
    options: dict = {"record": ALL, "max_wall": 10.0}
    if method != "dop853":
        options |= {"method": method, "dt": max(case.dt, duration / 200.0)}
    if method == "moreau":  # most steps are no samples
        options["output_dt"] = duration / 19.3
    start = case.q0, case.v0
    try:
        alone = pn.simulate(case.scene, duration, *start, **options)
    except RunError:
        pytest.skip("the method does not finish this run")
    written = pn.simulate(case.scene, duration, *start, **options, checkpoint=path, checkpoint_interval=0.0)
    assert_same_run(alone, written)
    states, chosen = list(kept), np.random.default_rng(0)
    for k in sorted({0, len(states) - 1, *chosen.integers(len(states), size=5).tolist()}):
        path.write_bytes(states[k])
        assert_same_run(alone, pn.resume(path, case.scene, checkpoint_interval=1e9))


def test_a_run_that_is_stopped_again_and_again(kept, tmp_path):
    path = tmp_path / "run"
    alone = pn.simulate(cart(), 1.0, record=ALL, rtol=1e-5)
    pn.simulate(cart(), 1.0, record=ALL, rtol=1e-5, checkpoint=path, checkpoint_interval=0.0)
    steps = len(kept)
    path.write_bytes(kept[0])
    for _ in range(steps):
        kept.clear()
        run = pn.resume(path, cart(), checkpoint_interval=0.0)  # from each file by one step
        assert_same_run(alone, run)
        if len(kept) < 3:
            break
        path.write_bytes(kept[1])
    assert len(kept) < 3


SCRIPT = """
    import sys
    import pin_nonideal as pn
    scene = pn.load("n_four_bar", N=3)
    pn.simulate(scene, 60.0, record="energy", checkpoint=sys.argv[1], checkpoint_interval=0.0)
"""


def test_the_state_of_a_run_grows_no_faster_than_the_robot(tmp_path):
    """Local loops need room for themselves, and none for pairs of loops that share nothing."""
    sizes = []
    for N in (40, 80, 160):
        path = tmp_path / f"{N}"
        pn.simulate(pn.load("n_four_bar", N=N), 0.01, method="rk4", dt=0.005, checkpoint=path)
        sizes.append(path.stat().st_size)
    assert sizes[2] - sizes[1] <= 2.1 * (sizes[1] - sizes[0])


def test_a_killed_process_leaves_a_file_to_go_on_from(tmp_path):
    alone = pn.simulate(pn.load("n_four_bar", N=3), 60.0, record="energy")
    generator = np.random.default_rng()
    part = 0
    for attempt in range(3):
        path = tmp_path / f"run {attempt}"
        process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(SCRIPT), str(path)])
        while not path.exists() and process.poll() is None:
            time.sleep(0.01)
        time.sleep(generator.uniform(0.0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
        part += process.returncode == -signal.SIGKILL
        assert_same_run(alone, pn.resume(path, checkpoint_interval=1e9))  # made by load: no scene needed
        assert_same_run(alone, pn.resume(path))  # the end of the run was written as well
    assert part > 0  # a killed run, not one that had ended


def test_an_interrupted_run_loses_nothing(tmp_path):
    path, scene = tmp_path / "run", pn.load("four_bar")
    alone = pn.simulate(scene, 100.0)

    def interrupt(t):
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "pin_nonideal.simulation.simulate.progress_bar", lambda *_: contextlib.nullcontext(interrupt)
        )
        with pytest.raises(RunInterrupted) as caught:
            pn.simulate(scene, 100.0, progress=True, checkpoint=path)
    stopped = caught.value.trajectory
    assert 0.0 < stopped.t[-1] < 100.0
    run = pn.resume(path)
    assert_same_run(alone, run)
    assert run.stats.wall_s > stopped.stats.wall_s


def test_files_and_parameters_are_found_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(Path(robot_folders()["four_bar"]).parent)
    scene = pn.load("./four_bar/robot.urdf", free_flyer=True, package_dirs=".")
    path = tmp_path / "run"
    alone = pn.simulate(scene, 0.1, checkpoint=path)
    monkeypatch.chdir(tmp_path)
    assert_same_run(alone, pn.resume(path))


# --- What is refused ---------------------------------------------------------------------------------------


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "run"
    pn.simulate(cart(), 0.2, checkpoint=path)
    return path


def test_a_scene_that_no_name_makes_must_be_passed(written):
    message = (
        f'resume: the scene "cart" of "{written}" was not made by load(name); make it again and pass it: '
        "resume(path, scene=scene)"
    )
    with refuses(message, InputError):
        pn.resume(written)


def other_mass():
    scene = cart()
    model = scene.model.copy()
    model.inertias[1] = pin.Inertia(1.1, np.zeros(3), np.eye(3))
    return pn.Scene(model, laws=scene.laws, forces=scene.forces, q0=scene.q0, name="cart")


def other_law():
    scene = cart()
    laws = [pn.JointFriction("rail", mu=0.2000001, coulomb=2.0, static_ratio=1.3, viscous=0.1), scene.laws[1]]
    return pn.Scene(scene.model, laws=laws, forces=scene.forces, q0=scene.q0, name="cart")


def other_force():
    scene = cart()
    return pn.Scene(scene.model, laws=scene.laws, q0=scene.q0, name="cart")


@pytest.mark.parametrize("other", [other_mass, other_law, other_force])
def test_another_scene(other, written):
    message = (
        f'resume: the scene must be the one that "{written}" was written with ("cart"); "cart" differs from '
        "it in its model, constraints, laws, contacts, forces or actuation"
    )
    with refuses(message, InputError):
        pn.resume(written, other())


def test_a_scene_that_is_none(written):
    with refuses("resume: scene must be a Scene; got str", InputError):
        pn.resume(written, "cart")


def rewritten(path, **changes):
    """The file with another header."""
    with np.load(path) as file:
        header, state = json.loads(str(file["header"])), file["state"]
    header |= changes
    with open(path, "wb") as file:
        np.savez(file, header=np.array(json.dumps(header)), state=state)


@pytest.mark.parametrize("changes", [{"format": 99}, {"version": ["0.0.1", "other"]}])
def test_another_version(changes, written):
    rewritten(written, **changes)
    message = (
        f'"{written}" was written by another version of pin_nonideal; finish the run with that version, or '
        "start it again"
    )
    with refuses(message, LoadingError):
        pn.resume(written, cart())


def test_a_state_that_was_not_written(written):
    rewritten(written, digest="0" * 64)
    with refuses(f'"{written}" is damaged: its state differs from the written state', LoadingError):
        pn.resume(written, cart())


def test_damaged_files(written):
    """Cut anywhere, or with any byte changed: refused, or as good as the whole file (a byte nobody reads)."""
    whole, generator = written.read_bytes(), np.random.default_rng(0)
    alone, unread = pn.simulate(cart(), 0.2), 0
    for end in generator.integers(len(whole), size=20):
        written.write_bytes(whole[:end])
        with pytest.raises(LoadingError, match="cannot read a checkpoint from"):
            pn.resume(written, cart())
    for place in generator.integers(len(whole), size=60):
        spoiled = bytearray(whole)
        spoiled[place] ^= int(generator.integers(1, 256))
        written.write_bytes(bytes(spoiled))
        try:
            run = pn.resume(written, cart())
        except LoadingError as error:
            reason = str(error)
        else:
            assert_same_run(alone, run)
            unread += 1
            continue
        assert f'"{written}"' in reason
    assert unread < 10  # times and permissions of the members of an archive


def test_a_damaged_header(written):
    """An open bracket in the header of an array, which NumPy reports with an error of Python's tokenizer."""
    written.write_bytes(written.read_bytes().replace(b"'shape': ()", b"'shape': (("))
    with pytest.raises(LoadingError, match="cannot read a checkpoint from"):
        pn.resume(written, cart())


def states_of(scene, duration):
    """Return the states that the core writes, and the options to read them."""
    states = []
    steps = ("dop853", 1e-6, None, None, None, None)
    options = run_options(scene._compiled, scene.name, duration, 0.0, *steps, (), "error")
    q, v = scene.initial_state()
    scene._compiled.program.runner().simulate(q, v, options, save=states.append)
    return states, options


def resumed(scene, state, options):
    """Return the record of a run resumed from a state, or None if the state is rejected."""
    try:
        return scene._compiled.program.runner().resume(state, options)
    except ValueError as error:
        reason = str(error)
    assert reason == "the state does not fit the scene"
    return None


def test_states_that_do_not_fit():
    """States of another scene, truncated states, and states with inserted bytes are rejected."""
    scene = cart()
    states, options = states_of(scene, 0.2)
    state, others = states[0], states_of(pn.load("four_bar"), 1e-3)[0]
    for other in (b"", state[:-1], state + b"\0", others[0], bytes(1000)):
        assert resumed(scene, other, options) is None
    for place in range(0, len(state), 8):
        assert resumed(scene, state[:place] + b"\1" * 8 + state[place:], options) is None, place


def test_states_that_were_made_up():
    """Eight bytes exchanged anywhere: lengths, modes and indices are refused, and nothing is overrun."""
    scene = cart()
    states, options = states_of(scene, 0.2)
    state, refused = states[0], 0
    for place in range(0, len(state) - 7, 16):
        record = resumed(scene, state[:place] + b"\xff" * 8 + state[place + 8 :], options)
        refused += record is None
        assert record is None or len(record.q) == len(record.t) * scene.model.nq
    record = resumed(scene, state, options)
    arrays = [x for x in (getattr(record, name) for name in dir(record)) if isinstance(x, np.ndarray)]
    assert refused > sum(x.size > 0 for x in arrays)  # each is preceded by its length


def test_no_file_and_other_files(tmp_path):
    with pytest.raises(
        LoadingError, match=r'cannot read a checkpoint from ".*missing": there is no such file'
    ):
        pn.resume(tmp_path / "missing")
    path = pn.simulate(pn.load("four_bar"), 0.01).save(tmp_path / "trajectory")
    with pytest.raises(LoadingError, match="it must be a file that simulate"):
        pn.resume(path)


def test_nothing_in_a_file_is_executed(tmp_path):
    path = tmp_path / "run"

    class Trap:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "executed",))

    with open(path, "wb") as file:
        np.savez(file, header=np.array([Trap()], dtype=object), state=np.zeros(1, dtype=np.uint8))
    with pytest.raises(LoadingError, match="cannot read a checkpoint from"):
        pn.resume(path)
    assert not (tmp_path / "executed").exists()


def test_a_place_that_cannot_be_written(tmp_path):
    path = tmp_path / "nowhere" / "run"
    message = (
        f'cannot write the checkpoint to "{path}": No such file or directory; name a file in a folder that '
        "can be written"
    )
    with refuses(message, OutputError):
        pn.simulate(pn.load("four_bar"), 0.1, checkpoint=path)


def test_a_disk_that_fills_up(tmp_path, monkeypatch):
    """A run that has a checkpoint does not die of a full disk."""
    path, count = tmp_path / "run", []
    write = checkpoint.whole_file

    def fail_later(*arguments):
        count.append(1)
        if len(count) > 1:
            raise OutputError("no room")
        return write(*arguments)

    monkeypatch.setattr(checkpoint, "whole_file", fail_later)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        run = pn.simulate(pn.load("four_bar"), 0.1, checkpoint=path, checkpoint_interval=0.0)
    assert run.t[-1] == 0.1
    assert str(told[0].message) == "no room; the run continues, and the last checkpoint stays"
    monkeypatch.undo()
    assert_same_run(run, pn.resume(path))


def test_methods_of_scipy_have_no_checkpoint(tmp_path):
    message = (
        'simulate: checkpoint needs one of the core\'s methods; "Radau" runs in SciPy, which hides its state'
    )
    with refuses(message, InputError):
        pn.simulate(pn.load("four_bar"), 0.1, method="Radau", checkpoint=tmp_path / "run")


def test_runs_of_a_sweep_have_no_checkpoint(tmp_path):
    message = "sweep: checkpoint is the file of one run; its runs would overwrite one another's"
    with refuses(message, InputError):
        pn.sweep(pn.load, [{"name": "four_bar"}], 0.1, checkpoint=tmp_path / "run")


@pytest.mark.parametrize(
    ("interval", "message"), [(-1.0, "must not be negative; got -1"), ("s", "must be a number")]
)
def test_intervals(interval, message, tmp_path):
    with pytest.raises(InputError, match=f"simulate: checkpoint_interval {message}"):
        pn.simulate(pn.load("four_bar"), 0.1, checkpoint=tmp_path / "run", checkpoint_interval=interval)
