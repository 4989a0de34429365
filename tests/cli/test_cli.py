"""The command `pin-nonideal`: output, files, exit codes and the effect of Ctrl-C."""

from __future__ import annotations

import importlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import pin_nonideal as pn
from pin_nonideal.cli.main import EXIT_BROKEN_PIPE, EXIT_ERROR, EXIT_INTERRUPTED, main
from pin_nonideal.cli.run import parameters

# Short motion: other tests check the motion itself.
SHORT = ["--duration", "0.05"]
# Time for the first step of the run, and time to stop and write files after Ctrl-C.
HEAD_START_SECONDS = 1.0
STOP_SECONDS = 30.0


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    """Return standard error, which must be one line."""
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    return text.rstrip("\n")


class TestRun:
    def test_prints_the_run(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["run", "four_bar", *SHORT]) == 0
        captured = capsys.readouterr()
        assert "violation" in captured.out
        assert captured.err == ""  # no progress bar without a terminal

    def test_save(self, tmp_path: Path) -> None:
        path = tmp_path / "run.npz"
        assert main(["run", "four_bar", *SHORT, "--save", str(path), "--output-dt", "0.01"]) == 0
        run = pn.Trajectory.load(path)
        assert run.t[-1] == pytest.approx(0.05, abs=1e-15)
        assert len(run.t) == 6
        assert not run.recorded("F_ideal")

    def test_record(self, tmp_path: Path) -> None:
        path = tmp_path / "run.npz"
        assert main(["run", "four_bar", *SHORT, "--save", str(path), "--record", "a, forces"]) == 0
        run = pn.Trajectory.load(path)
        assert run.recorded("a")
        assert run.recorded("F_ideal")
        assert not run.energy

    def test_fixed_step_method(self, tmp_path: Path) -> None:
        path = tmp_path / "run.npz"
        assert main(["run", "four_bar", *SHORT, "--method", "rk4", "--dt", "0.005", "--save", str(path)]) == 0
        assert len(pn.Trajectory.load(path).t) == 11

    def test_pictures_record_forces_and_energy(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        html, plot, save = tmp_path / "run.html", tmp_path / "run.png", tmp_path / "run.npz"
        assert (
            main(["run", "four_bar", *SHORT, "--html", str(html), "--plot", str(plot), "--save", str(save)])
            == 0
        )
        assert html.read_text(encoding="utf-8").startswith("<!")
        assert plot.read_bytes().startswith(b"\x89PNG")
        run = pn.Trajectory.load(save)
        assert run.recorded("F_ideal")
        assert run.energy
        out = capsys.readouterr().out
        assert [f"wrote {path}" in out for path in (html, plot, save)] == [True, True, True]

    def test_parameter_of_a_generated_robot(self, tmp_path: Path) -> None:
        path = tmp_path / "run.npz"
        assert main(["run", "n_four_bar", "--set", "N=3", *SHORT, "--save", str(path)]) == 0
        assert pn.Trajectory.load(path).v.shape[1] == pn.load("n_four_bar", N=3).model.nv


def test_values_of_settings() -> None:
    assert parameters(["N=3", "length=1e-3", "closed=true", "open=false", "shape=a=b", "empty="]) == {
        "N": 3,
        "length": 1e-3,
        "closed": True,
        "open": False,
        "shape": "a=b",
        "empty": "",
    }


class TestErrors:
    def test_unknown_robot(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["run", "four_barr"]) == EXIT_ERROR
        assert 'nearest: "four_bar"' in error_line(capsys)

    def test_unknown_method(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["run", "four_bar", "--method", "dop835"]) == EXIT_ERROR
        assert 'nearest: "dop853"' in error_line(capsys)

    def test_negative_duration(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["run", "four_bar", "--duration", "-1"]) == EXIT_ERROR
        assert error_line(capsys).startswith("pin-nonideal: error: ")

    def test_setting_without_value(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["run", "n_four_bar", "--set", "N"]) == EXIT_ERROR
        assert error_line(capsys) == (
            'pin-nonideal: error: --set needs KEY=VALUE, for example --set N=40; got "N"'
        )

    def test_missing_folder_is_found_before_the_run(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(pn, "simulate", lambda *args, **settings: pytest.fail("the run was started"))
        path = tmp_path / "no" / "run.html"
        assert main(["run", "four_bar", "--html", str(path)]) == EXIT_ERROR
        assert error_line(capsys) == (
            f'pin-nonideal: error: cannot write "{path}": there is no folder "{path.parent}"; create it first'
        )

    def test_output_that_is_a_folder(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["run", "four_bar", "--save", str(tmp_path)]) == EXIT_ERROR
        assert error_line(capsys) == (
            f'pin-nonideal: error: cannot write "{tmp_path}": it is a folder; give the name of a file'
        )

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
    def test_output_without_permission(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        tmp_path.chmod(0o500)
        path = tmp_path / "run.npz"
        assert main(["run", "four_bar", "--save", str(path)]) == EXIT_ERROR
        assert error_line(capsys) == (
            f'pin-nonideal: error: cannot write "{path}": no permission; choose another place'
        )

    def test_an_unknown_picture_is_found_before_the_run(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(pn, "simulate", lambda *args, **settings: pytest.fail("the run was started"))
        path = tmp_path / "run.xyz"
        assert main(["run", "four_bar", "--plot", str(path)]) == EXIT_ERROR
        line = error_line(capsys)
        assert line.startswith(
            f'pin-nonideal: error: cannot write a figure to "{path}": its ending must be one'
        )
        assert line.endswith('got "xyz"')

    def test_the_file_that_was_written_is_named(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert main(["run", "four_bar", *SHORT, "--save", str(tmp_path / "run")]) == 0
        assert f"wrote {tmp_path / 'run.npz'}\n" in capsys.readouterr().out

    def test_unknown_option(self, capsys: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit) as caught:
            main(["run", "four_bar", "--durations", "1"])
        assert caught.value.code == EXIT_ERROR
        assert "unrecognized arguments: --durations 1" in capsys.readouterr().err

    def test_failed_run_leaves_what_was_computed(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        computed = pn.simulate(pn.load("four_bar"), 0.05)

        def fail(*args: Any, **settings: Any) -> Any:
            error = pn.NonFiniteError("acceleration is not finite at t = 0.05 s", time=0.05)
            error.trajectory = computed
            raise error

        monkeypatch.setattr(pn, "simulate", fail)
        path = tmp_path / "run.npz"
        assert main(["run", "four_bar", "--save", str(path)]) == EXIT_ERROR
        assert error_line(capsys) == "pin-nonideal: error: acceleration is not finite at t = 0.05 s"
        assert pn.Trajectory.load(path).t[-1] == computed.t[-1]


# The command prints a word when the run begins. The test then sends Ctrl-C.
COMMAND = """
import sys
import pin_nonideal as pn
from pin_nonideal.cli.main import main

simulate = pn.simulate

def announced(*args, **settings):
    print("begins", flush=True)
    return simulate(*args, **settings)

pn.simulate = announced
sys.exit(main())
"""


class TestInterrupt:
    @pytest.mark.skipif(os.name != "posix", reason="signals")
    def test_ctrl_c_keeps_what_was_computed(self, tmp_path: Path) -> None:
        path = tmp_path / "run.npz"
        # The duration exceeds the wait of the test. One sample a second keeps the file small.
        words = ["run", "four_bar", "--duration", "1e7", "--output-dt", "1", "--save", str(path)]
        process = subprocess.Popen(
            [sys.executable, "-c", COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "begins\n"
            time.sleep(HEAD_START_SECONDS)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=STOP_SECONDS)
        finally:
            process.kill()
        assert process.returncode == EXIT_INTERRUPTED, err
        assert f"wrote {path}" in out
        assert err.startswith("pin-nonideal: interrupted")
        assert err.count("\n") == 1
        assert 0.0 < pn.Trajectory.load(path).t[-1] < 1e7

    def test_interrupt_outside_of_a_run(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def load(*args: Any, **parameters: Any) -> Any:
            raise KeyboardInterrupt

        monkeypatch.setattr(pn, "load", load)
        assert main(["run", "four_bar"]) == EXIT_INTERRUPTED
        assert error_line(capsys) == "pin-nonideal: interrupted"


class TestOutputThatCannotBeWritten:
    """The same in other processes: `tests/loading/test_files.py`."""

    def test_a_reader_that_closed_the_pipe_ends_the_command(self, monkeypatch: pytest.MonkeyPatch) -> None:
        reader, writer = os.pipe()
        os.close(reader)
        with os.fdopen(writer, "w") as closed:
            monkeypatch.setattr(sys, "stdout", closed)
            assert main(["list"]) == EXIT_BROKEN_PIPE

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
    def test_a_full_disk_is_an_error(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with open("/dev/full", "w") as full:
            monkeypatch.setattr(sys, "stdout", full)
            assert main(["list"]) == EXIT_ERROR
        assert error_line(capsys) == "pin-nonideal: error: cannot print: No space left on device"


class TestListInfoBench:
    def test_list_names_the_robots_and_the_examples(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["list"]) == 0
        robots, found = capsys.readouterr().out.split("examples: pin-nonideal example NAME\n")
        assert robots.startswith("robots: pin-nonideal run NAME\n")
        names = [[line.split()[0] for line in text.splitlines()] for text in (robots, found)]
        assert {"four_bar", "slider_crank", "five_bar", "andrews_squeezer"} <= set(names[0])
        assert {"paper_a_particle", "paper_b_ring", "paper_c_incline", "gripper"} <= set(names[1])

    def test_list_all_names_the_robots_of_example_robot_data(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """All names that `load` reads; robots of SDF files are not among them."""
        assert main(["list", "--all"]) == 0
        title = "robots of example-robot-data: pin-nonideal run NAME\n"
        names = {line.split()[0] for line in capsys.readouterr().out.split(title)[1].splitlines()}
        assert {"panda", "talos", "ur5"} <= names
        assert "cassie" not in names

    def test_an_example_writes_its_figure(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.chdir(tmp_path)
        assert main(["example", "friction_loaded_joint"]) == 0
        assert capsys.readouterr().out.endswith("wrote friction_loaded_joint.png\n")
        assert (tmp_path / "friction_loaded_joint.png").stat().st_size > 1000

    def test_an_unknown_example_is_an_error(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["example", "griper"]) == EXIT_ERROR
        assert error_line(capsys) == 'pin-nonideal: error: no example "griper"; nearest: "gripper"'

    def test_info(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["info", "four_bar"]) == 0
        out = capsys.readouterr().out
        assert [word in out for word in ("joint", "loop", "row", "rank", "mobility")] == [True] * 5

    def test_bench_runs_the_folder_of_the_checkout(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        folder = tmp_path / "benchmarks"
        folder.mkdir()
        (folder / "__main__.py").write_text("import sys; print(__name__, sys.argv[1:])", encoding="utf-8")
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", list(sys.argv))
        assert main(["bench", "four_bar", "--quick"]) == 0
        assert capsys.readouterr().out == "__main__ ['four_bar', '--quick']\n"

    def test_bench_and_examples_need_their_folders(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.chdir(tmp_path)
        for name in ("cli.main", "loading.library.example_scripts"):
            installed = str((tmp_path / "pin_nonideal" / name.replace(".", "/")).with_suffix(".py"))
            monkeypatch.setattr(importlib.import_module(f"pin_nonideal.{name}"), "__file__", installed)
        assert main(["bench", "four_bar"]) == EXIT_ERROR
        assert error_line(capsys) == (
            "pin-nonideal: error: bench needs the folder benchmarks of a checkout; run it there: "
            "git clone, cd, pin-nonideal bench"
        )
        assert main(["list"]) == 0
        assert capsys.readouterr().out.endswith("examples: pin-nonideal example NAME\n")

    def test_the_command_is_installed(self) -> None:
        command = shutil.which("pin-nonideal", path=str(Path(sys.executable).parent))
        assert command is not None
        done = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"pin-nonideal {pn.__version__}\n"
