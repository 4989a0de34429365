"""simulate: a scene and a length of time in, a Trajectory out."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from pin_nonideal.compilation.error_context import stiff_hint
from pin_nonideal.errors import InputError
from pin_nonideal.scene.scene import Scene, compiled_scene, scene_states
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.types import State
from pin_nonideal.validation import choice

from .decoupled import run_apart, run_together, stepped_apart
from .events import Asked, asked_callback, asked_events
from .options import SCIPY, kept_options
from .progress import progress_bar
from .results import finish


def simulate(
    scene: Scene,
    duration: float,
    q: State | None = None,
    v: State | None = None,
    *,
    t0: float = 0.0,
    method: str = "dop853",
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    dt: float | None = None,
    output_dt: float | None = None,
    max_steps: float | None = None,
    max_wall: float | None = None,
    record: str | Sequence[str] = (),
    events: str | Callable[..., Any] | Sequence[Any] | None = None,
    callback: Callable[..., Any] | None = None,
    several: str = "error",
    strict: bool = False,
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
        q: initial configuration, (nq,) or by joint name (see `Scene`); the scene's when None.  It is
            projected onto the constraints first (`Scene.project`): an array by the least move, while entries
            that are named are held and the others follow.  `Trajectory.notes` lists moves of more than a
            little, and those of an array that was given here are a RuntimeWarning.
        v: initial velocity, (nv,) or by joint name; the scene's when None.  The same holds for it.
        t0: initial time [s].
        method: "dop853" (order 8) or "dopri5" (order 5), adaptive; "rk4", "semi_implicit_euler" or "moreau"
            (time stepping at velocity level), fixed dt; "Radau", "BDF" or "LSODA" by SciPy, for stiff scenes.
        rtol: relative tolerance of adaptive methods, 1e-8 when None.
        atol: absolute tolerance, a number or an array (2 nv,) for positions and velocities, 1e-10 when None;
            states of laws take the number, or the smallest of the array.
        dt: step of the fixed-step methods [s].
        output_dt: time between samples [s]; every accepted step when None.  Events are samples as well;
            `run.grid` tells which samples lie on the grid t0 + k output_dt, both ends among them.
        max_steps: most steps that the run may take; when None as many as it takes, but a stiff scene stops as
            soon as an explicit method would take 100,000 more.
        max_wall: most wall time that the run may take [s]; as much as it takes when None.
        record: any of "a", "tau", "forces" (which include "laws" and "tau"), "laws", "reactions", "energy",
            "power", "dense" (interpolants of the steps, for `run.at`), or names of fields that they fill.
        events: functions (t, q, v) -> number whose zeros are events, as in SciPy's solve_ivp: `terminal`
            (True, or how many of them end the run) and `direction` (its sign: only where the value rises, or
            falls) are attributes of the function.  A step ends at each, found as accurately as the step; a
            value that is zero at the start is no event there.  `run.user_events` holds them.  "separate",
            alone or in the list, keeps all events out of the samples, which then lie on the grid exactly.
        callback: called as callback(t, q, v) before every step; True ends the run there, torques (nv,) are
            those of the actuation from there on, None changes nothing.  Of the core's methods only.
        several: what to do where the laws allow several motions: "error" stops with a FrictionParadoxError
            that shows two; "continue" goes on with the one nearest to the motion before (at the start, that
            of least friction), and an event of kind "several" says from when on.  What rests and might slip
            as well goes on resting either way, with such an event.
        strict: whether an impact that gains energy, as Newton's law of restitution with friction may, is an
            ImpactEnergyError; an event of kind "impact" with a positive energy_change tells it otherwise.
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
        DivergenceError: speeds grow without bound over many decades, and max_steps was not given; `joint`,
            `source` and `rate` say where, by what and how.
        WallTimeError: `max_wall` is over.
        RunError: the run stopped early; its `trajectory` holds the samples up to there.
        ImpactEnergyError: an impact gained energy, and `strict` was asked for.
        RunInterrupted: Ctrl-C; the same.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"simulate: scene must be a Scene; got {type(scene).__name__}")
    asked = asked_events(events)
    steps = (method, rtol, atol, dt, output_dt, max_steps)
    kept = (max_wall, asked.names, asked.separate)
    options = kept_options(scene, duration, t0, *steps, record, several, *kept, strict)
    q0, v0 = (
        scene.project(q, v, options.t0) if (q is not None or v is not None or t0) else scene.initial_state()
    )
    own = q is None and v is None and not t0
    states = scene_states(scene)
    moved = [] if own else states.configuration_notes(q, q0)
    followed = states.start_notes() if own else states.velocity_notes(v, v0)
    notes = moved + followed
    for given, told in ((q, moved), (v, followed)):
        if told and given is not None and not isinstance(given, Mapping):
            warnings.warn(f"simulate: {told[0]}", RuntimeWarning, stacklevel=2)
    choice("simulate: progress", progress, (True, False, None))
    between = asked_callback(callback, scene.model.nv)
    _check_together(method, asked, callback, checkpoint)
    saver = None
    if checkpoint is not None:
        from .checkpoint import Saver

        saver = Saver(checkpoint, scene, options, checkpoint_interval, notes=notes)
    hints: list[str] = []
    explicit_only = compiled_scene(scene).explicit_only

    def hint(at: float, dof: int, rate: float, decays: bool) -> None:
        hints.append(f"from t = {at:.4g} s on {stiff_hint(scene.model, dof, rate, decays, explicit_only)}")
        warnings.warn(f"simulate: {hints[0]}", RuntimeWarning, stacklevel=4)

    begin = time.perf_counter()
    with progress_bar(progress, options) as tick:
        if method in SCIPY:
            from .scipy_solvers import simulate_stiff

            outcome, stopped = simulate_stiff(scene, q0, v0, options, tick, asked.watched)
        else:
            parts = [] if saver or between else stepped_apart(scene, options)
            apart = run_apart(scene, parts, q0, v0, options, tick) if parts else None
            # Where all step together, what fails is told.
            outcome = apart or run_together(
                scene,
                q0,
                v0,
                options,
                tick=tick,
                save=saver,
                save_interval=saver.interval if saver else 0.0,
                events=asked.watched,
                callback=between,
                hint=hint,
            )
            stopped = outcome.stopped
    return finish(scene, outcome, stopped, options, time.perf_counter() - begin, [*notes, *hints])


def _check_together(method: str, asked: Asked, callback: object, checkpoint: object) -> None:
    """Refuses what does not go together.

    Raises:
        InputError: see above.
    """
    if method in SCIPY and checkpoint is not None:
        raise InputError(
            f'simulate: checkpoint needs one of the core\'s methods; "{method}" runs in SciPy, which '
            "does not give its state away"
        )
    if method in SCIPY and callback is not None:
        raise InputError(
            f'simulate: callback needs one of the core\'s methods; "{method}" runs in SciPy, whose steps '
            "go on from earlier ones"
        )
    if checkpoint is not None and (asked.watched or callback is not None):
        raise InputError(
            "simulate: checkpoint cannot hold functions; leave out events and callback, or the checkpoint"
        )
