"""resume: continuation of a stopped run from its checkpoint."""

from __future__ import annotations

import os
import time

from pin_nonideal.atomic_files import file_path
from pin_nonideal.errors import InputError, LoadingError
from pin_nonideal.loading.load import load
from pin_nonideal.scene.scene import Scene, compiled_scene, require_scene
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.validation import choice, nonnegative

from .checkpoint import Saver, read_checkpoint, refuse_other_scene
from .progress import progress_bar
from .results import finish


def resume(
    path: str | os.PathLike[str],
    scene: Scene | None = None,
    *,
    checkpoint_interval: float | None = None,
    progress: bool | None = None,
) -> Trajectory:
    """Resume a run from the file that `simulate(..., checkpoint=path)` wrote.

    The trajectory is bitwise equal to an uninterrupted run from its start: samples, recorded quantities,
    events and counters. `stats.wall_s` is the sum over all parts. The file is updated as before, so a run may
    be stopped any number of times. For a finished run, the trajectory is returned at once.

    The file does not hold memory of user functions. User functions must depend on their arguments only, and
    keep memory in the states of a `UserLaw`.

    Args:
        path: the file.
        scene: the scene of the run, built as before; None loads it again with the arguments of `load`.
        checkpoint_interval: wall time between checkpoints [s]; None keeps the previous interval.
        progress: progress bar on standard error; None shows it on a terminal only.

    Returns:
        The Trajectory of the whole run.

    Raises:
        LoadingError: the file is missing, damaged, or of another version, or its robot does not load.
        InputError: the scene is missing, or is not the scene of the run.
        OutputError: the file cannot be written.
        RunError: the run stopped early; its `trajectory` holds the samples before the stop.
        RunInterrupted: Ctrl-C was pressed; its `trajectory` holds the samples before the stop.
    """
    source = file_path("resume: path", path)
    choice("resume: progress", progress, (True, False, None))
    if checkpoint_interval is not None:
        nonnegative("resume: checkpoint_interval", checkpoint_interval)
    if scene is not None:
        require_scene("resume", scene)
    held = read_checkpoint(source)
    if scene is None:
        if held.origin is None:
            raise InputError(
                f'resume: the scene "{held.scene}" of "{source}" was not made by load(name); make it again '
                "and pass it: resume(path, scene=scene)"
            )
        scene = load(held.origin["name"], **held.origin["parameters"])
    compiled, options = compiled_scene(scene), held.options
    refuse_other_scene(held, compiled, scene.name, source)
    interval = held.interval if checkpoint_interval is None else checkpoint_interval
    program, delayed = compiled.program_of_runs(options.t0)
    if delayed is not None:
        delayed.pending = held.delayed
    saver = Saver(source, scene, options, interval, held.wall_s, held.notes, delayed)
    begin = time.perf_counter()
    try:
        with progress_bar(progress, options) as tick:
            runner = program.runner()
            outcome = runner.resume(held.state, options, tick=tick, save=saver, save_interval=saver.interval)
    except ValueError as error:
        raise LoadingError(f'"{source}" is damaged: {error}') from error
    wall = held.wall_s + time.perf_counter() - begin
    return finish(scene, outcome, outcome.stopped, options, wall, held.notes)
