"""resume: a run that was stopped goes on from its checkpoint."""

from __future__ import annotations

import os
import time

from pin_nonideal.atomic_files import file_path
from pin_nonideal.errors import InputError, LoadingError
from pin_nonideal.loading.load import load
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.validation import choice

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
    """Goes on with a run from the file that `simulate(..., checkpoint=path)` wrote.

    The trajectory is bitwise the one of the run left alone, from its very start: samples, recorded
    quantities, events and counters; `stats.wall_s` adds up the parts.  The file is kept up to date as
    before, so that a run may be stopped any number of times; of a run that had ended, it gives the
    trajectory at once.

    What functions of the user remember between calls is not in the file: let them depend on their
    arguments only, and keep what must be remembered in the states of a `UserLaw`.

    Args:
        path: the file.
        scene: the scene of the run, made as it was then; None loads it again by the name and parameters that
            `load` was given.
        checkpoint_interval: wall time between checkpoints [s]; as before when None.
        progress: progress bar on standard error; None shows it on a terminal only.

    Returns:
        The Trajectory of the whole run.

    Raises:
        LoadingError: the file is missing, damaged, or of another version; or its robot does not load.
        InputError: the scene is missing, or not the one of the run.
        OutputError: the file cannot be written.
        RunError: the run stopped early; its `trajectory` holds the samples up to there.
        RunInterrupted: Ctrl-C; the same.
    """
    source = file_path("resume: path", path)
    held = read_checkpoint(source)
    if scene is None:
        if held.origin is None:
            raise InputError(
                f'resume: the scene "{held.scene}" of "{source}" was not made by load(name); make it again '
                "and pass it: resume(path, scene=scene)"
            )
        scene = load(held.origin["name"], **held.origin["parameters"])
    elif not isinstance(scene, Scene):
        raise InputError(f"resume: scene must be a Scene; got {type(scene).__name__}")
    refuse_other_scene(held, scene, source)
    choice("resume: progress", progress, (True, False, None))
    options = held.options
    interval = held.interval if checkpoint_interval is None else checkpoint_interval
    saver = Saver(source, scene, options, interval, held.wall_s, held.notes)
    begin = time.perf_counter()
    try:
        with progress_bar(progress, options) as tick:
            runner = compiled_scene(scene).program.runner()
            outcome = runner.resume(held.state, options, tick=tick, save=saver, save_interval=saver.interval)
    except ValueError as error:
        raise LoadingError(f'"{source}" is damaged: {error}') from error
    wall = held.wall_s + time.perf_counter() - begin
    return finish(scene, outcome, outcome.stopped, options, wall, held.notes)
