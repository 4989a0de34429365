"""Commands `run` and `resume`: their settings of a run and their output files."""

from __future__ import annotations

import argparse
import os
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import pin_nonideal as pn
from pin_nonideal.atomic_files import mode_of
from pin_nonideal.errors import InputError, OutputError, RunError
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.types import Table
from pin_nonideal.visualization.plotting import picture_format

from .commands import format_events, named_values, plain_value

Writer = tuple[Path, Callable[[Trajectory, Path], Path]]

# Samples of runs with pictures: number per second of simulated time, with bounds for a run.
PICTURE_RATE, PICTURE_SAMPLES = 60.0, (1200, 20_000)


def run_robot(options: argparse.Namespace) -> int:
    """Simulate a robot and write the requested files.

    Args:
        options: options of `run`.
    """
    writers = _writers(options)
    q, v = named_values(options.q, "--q"), named_values(options.v, "--v")
    scene = pn.load(options.robot, **parameters(options.settings))
    settings = _simulation_settings(options)
    return _run_and_write(
        lambda: pn.simulate(scene, options.duration, q=q, v=v, **settings), options, writers
    )


def resume_run(options: argparse.Namespace) -> int:
    """Continue a run from its checkpoint and write the requested files.

    Args:
        options: options of `resume`.
    """
    writers = _writers(options)
    return _run_and_write(lambda: pn.resume(options.file), options, writers)


def _run_and_write(run: Callable[[], Trajectory], options: argparse.Namespace, writers: list[Writer]) -> int:
    """Run, print and write; a failed run writes the samples before its failure."""
    try:
        with warnings.catch_warnings():
            # the printed notes of the run contain the same messages
            warnings.simplefilter("ignore", RuntimeWarning)
            trajectory = run()
    except RunError as error:
        if error.trajectory is not None:
            _print_and_write(error.trajectory, options, writers)
        raise
    _print_and_write(trajectory, options, writers)
    return 0


def _print_and_write(run: Trajectory, options: argparse.Namespace, writers: list[Writer]) -> None:
    if not options.quiet:
        print(run)
    if options.events:
        print(format_events(run))
    for path, writer in writers:
        written = writer(run, path)
        if not options.quiet:
            print(f"wrote {written}")


def _simulation_settings(options: argparse.Namespace) -> Table:
    """Return keyword arguments of `simulate` from the command line, with defaults for pictures."""
    keys = ("method", "rtol", "atol", "dt", "output_dt", "several", "checkpoint")
    values = {key: getattr(options, key) for key in keys}
    settings = {key: value for key, value in values.items() if value is not None}
    pictures = options.html is not None or options.plot is not None
    if pictures and options.output_dt is None:
        low, high = PICTURE_SAMPLES
        count = min(max(PICTURE_RATE * abs(options.duration), low), high)
        if options.duration > 0.0:
            settings["output_dt"] = options.duration / count
    if options.record is not None:
        settings["record"] = tuple(name.strip() for name in options.record.split(",") if name.strip())
    elif pictures:
        settings["record"] = ("forces", "energy")
    return settings


def _writers(options: argparse.Namespace) -> list[Writer]:
    """Return the output files with their writers; the check comes before the run, which may be long."""
    if options.plot is not None:
        picture_format(options.plot)
    outputs: list[tuple[Path | None, Callable[[Trajectory, Path], Path]]] = [
        (options.save, lambda run, path: run.save(path)),
        (options.html, _write_replay),
        (options.plot, _write_figure),
    ]
    writers = [(path, writer) for path, writer in outputs if path is not None]
    for path, _ in writers:
        folder = path.parent
        if not folder.is_dir():
            raise OutputError(f'cannot write "{path}": there is no folder "{folder}"; create it first')
        if path.is_dir():
            raise OutputError(f'cannot write "{path}": it is a folder; give the name of a file')
        mode_of(path, "the output")
        if not os.access(path if path.exists() else folder, os.W_OK):
            raise OutputError(f'cannot write "{path}": no permission; choose another place')
    return writers


def _write_replay(run: Trajectory, path: Path) -> Path:
    pn.replay(run, path)
    return path


def _write_figure(run: Trajectory, path: Path) -> Path:
    pn.plot(run, path)
    return path


def parameters(settings: Sequence[str]) -> Table:
    """Return KEY=VALUE words as keyword arguments.

    Args:
        settings: words of the command line.

    Raises:
        InputError: a word has another form.
    """
    parameters: Table = {}
    for word in settings:
        key, separator, text = word.partition("=")
        if not separator or not key.isidentifier():
            raise InputError(f'--set needs KEY=VALUE, for example --set N=40; got "{word}"')
        parameters[key] = plain_value(text)
    return parameters
