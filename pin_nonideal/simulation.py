"""simulate and rollout: a scene and a length of time in, a Trajectory out."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence

from numpy.typing import ArrayLike

from .checks import array, choice, count
from .core import core
from .errors import InputError, RunError, RunInterrupted
from .runs.checkpoint import Saver
from .runs.options import SCIPY, run_options
from .runs.progress import progress_bar
from .runs.results import finish
from .scene import Scene
from .trajectory import Trajectory


def simulate(
    scene: Scene,
    duration: float,
    q: ArrayLike | None = None,
    v: ArrayLike | None = None,
    *,
    t0: float = 0.0,
    method: str = "dop853",
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    dt: float | None = None,
    output_dt: float | None = None,
    max_steps: float | None = None,
    record: str | Sequence[str] = (),
    several: str = "error",
    progress: bool | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_interval: float = 60.0,
) -> Trajectory:
    """Integrates a scene in time, on its constraints.

    Adaptive methods keep the local error of every coordinate below atol + rtol |y| (that of a velocity not
    below the rounding of the largest one); the state is put back on the constraints after every step, so that
    violations stay at rounding.  Dry friction sticks and slips at located events.

    Args:
        scene: what to simulate.
        duration: length of time [s].
        q: initial configuration, (nq,); the scene's when None.  It is projected onto the constraints first.
        v: initial velocity, (nv,); the scene's when None.
        t0: initial time [s].
        method: "dop853" (order 8) or "dopri5" (order 5), adaptive; "rk4", "semi_implicit_euler" or "moreau"
            (time stepping at velocity level), fixed dt; "Radau", "BDF" or "LSODA" by SciPy, for stiff scenes.
        rtol: relative tolerance of adaptive methods, 1e-8 when None.
        atol: absolute tolerance, a number or an array (2 nv,) for positions and velocities, 1e-10 when None;
            states of laws take the number, or the smallest of the array.
        dt: step of the fixed-step methods [s].
        output_dt: time between samples [s]; every accepted step when None.  Events are samples as well.
        max_steps: most steps that the run may take; when None as many as it takes, but a stiff scene stops as
            soon as an explicit method would take 100,000 more.
        record: any of "a", "forces" (which include "laws"), "laws", "reactions", "energy", "power", or names
            of fields that they fill.
        several: what to do where the laws allow several motions: "error" stops with a FrictionParadoxError
            that shows two; "continue" goes on with the one nearest to the motion before (at the start, that
            of least friction), and an event of kind "several" says from when on.  What rests and might slip
            as well goes on resting either way, with such an event.
        progress: progress bar on standard error; None shows it on a terminal only.
        checkpoint: file that the run is kept in, so that `resume` goes on with it should it be killed; None
            for none.  It is replaced whole, at the start, at the end, on Ctrl-C between two steps, and every
            `checkpoint_interval`.  Of the core's methods only.
        checkpoint_interval: wall time between checkpoints [s]; 0 for one after every step.

    Returns:
        The Trajectory.

    Raises:
        InputError: an argument does not fit.
        OutputError: the checkpoint cannot be written.
        LoopClosureError: the initial state cannot be put on the constraints, or the run was pulled off them.
        StiffnessError: the scene is stiff, and the method explicit; `joint` and `rate` say where and how.
        RunError: the run stopped early; its `trajectory` holds the samples up to there.
        RunInterrupted: Ctrl-C; the same.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"simulate: scene must be a Scene; got {type(scene).__name__}")
    options = run_options(scene, duration, t0, method, rtol, atol, dt, output_dt, max_steps, record, several)
    q0, v0 = (
        scene.project(q, v, options.t0) if (q is not None or v is not None or t0) else scene.initial_state()
    )
    choice("simulate: progress", progress, (True, False, None))
    saver = None
    if checkpoint is not None:
        if method in SCIPY:
            raise InputError(
                f'simulate: checkpoint needs one of the core\'s methods; "{method}" runs in SciPy, which '
                "does not give its state away"
            )
        saver = Saver(checkpoint, scene, options, checkpoint_interval)
    begin = time.perf_counter()
    with progress_bar(progress, options) as tick:
        if method in SCIPY:
            from .runs.scipy_methods import simulate_stiff

            outcome, stopped = simulate_stiff(scene, q0, v0, options, tick)
        else:
            interval = saver.interval if saver else 0.0
            runner = scene._compiled.program.runner()
            outcome = runner.simulate(q0, v0, options, tick=tick, save=saver, save_interval=interval)
            stopped = outcome.stopped
    return finish(scene, outcome, stopped, options, time.perf_counter() - begin)


def rollout(
    scene: Scene,
    q: ArrayLike | tuple[ArrayLike, ArrayLike],
    v: ArrayLike | None = None,
    duration: float | None = None,
    *,
    t0: float = 0.0,
    method: str = "dop853",
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    dt: float | None = None,
    output_dt: float | None = None,
    max_steps: float | None = None,
    record: str | Sequence[str] = (),
    several: str = "error",
    threads: int = 1,
) -> list[Trajectory]:
    """Runs many initial states in native threads; each result is bitwise that of its own `simulate`.

    Called as rollout(scene, q, v, duration), or with a pair of states as rollout(scene, (q, v), duration).

    Args:
        scene: what to simulate.
        q: initial configurations, (n, nq).
        v: initial velocities, (n, nv).
        duration: length of time [s].
        t0: initial time [s].
        method: one of the core's methods (not SciPy's).
        rtol: relative tolerance.
        atol: absolute tolerance, a number or an array (2 nv,).
        dt: step of the fixed-step methods [s].
        output_dt: time between samples [s]; every accepted step when None.
        max_steps: as in `simulate`.
        record: as in `simulate`.
        several: "error" or "continue", as in `simulate`.
        threads: number of native threads.

    Returns:
        One Trajectory a state.

    Raises:
        InputError: an argument does not fit.
        RunError: a run stopped early; `trajectory` of the first one that did, and `index` tells which.
        RunInterrupted: Ctrl-C, which ends all runs; the same, of one that it met.  Others are lost.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"rollout: scene must be a Scene; got {type(scene).__name__}")
    threads = count("rollout: threads", threads, least=1)
    if isinstance(q, tuple) and len(q) == 2 and (v is None or duration is None):
        (q, v), duration = q, v if duration is None else duration  # type: ignore[assignment]
    if v is None or duration is None:
        raise InputError("rollout needs q, v and a duration: rollout(scene, q, v, duration)")
    starts_q = array("rollout: q", q, (None, scene.model.nq))
    starts_v = array("rollout: v", v, (None, scene.model.nv))
    if len(starts_q) != len(starts_v):
        raise InputError(f"rollout: q and v must have as many rows; got {len(starts_q)} and {len(starts_v)}")
    options = run_options(scene, duration, t0, method, rtol, atol, dt, output_dt, max_steps, record, several)
    if method in SCIPY:
        raise InputError(f'rollout: method must be one of the core\'s; "{method}" runs in SciPy')
    begin = time.perf_counter()
    q0, v0 = scene._project_all(starts_q, starts_v, options.t0, threads)
    outcomes = core.rollout(scene._compiled.program, q0, v0, options, threads)
    wall = time.perf_counter() - begin
    results: list[Trajectory] = []
    failed: list[RunError] = []
    for i, outcome in enumerate(outcomes):
        try:
            if outcome is not None:
                results.append(finish(scene, outcome, outcome.stopped, options, wall))
        except RunError as error:
            error.index = i
            failed.append(error)
    if failed:  # an interrupt before the runs that it ended in other threads
        raise min(failed, key=lambda error: not isinstance(error, RunInterrupted))
    return results
