"""simulate: time integration of a scene to a Trajectory."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Sequence

from numpy.typing import ArrayLike

from pin_nonideal.atomic_files import check_writable, file_path
from pin_nonideal.compilation.error_context import stiff_hint
from pin_nonideal.errors import InputError
from pin_nonideal.scene.scene import Scene, compiled_scene, require_scene, scene_states
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.types import State
from pin_nonideal.validation import by_name, choice, nonnegative

from .decoupled import decoupled_components, run_decoupled, run_together
from .events import RunRequests, parse_callback, parse_events
from .methods import SCIPY
from .options import cached_options
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
    events: str | Callable[..., object] | Sequence[object] | None = None,
    callback: Callable[..., object] | None = None,
    several: str = "error",
    strict: bool = False,
    progress: bool | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_interval: float = 60.0,
) -> Trajectory:
    """Simulate a scene in time, on its constraints.

    Adaptive methods keep the local error of each coordinate below atol + rtol |y|. The tolerance of a
    velocity is at least the rounding error of the largest velocity. After each step, the state is projected
    onto the constraints, so that violations stay at rounding. Transitions of dry friction are located events.

    Args:
        scene: scene to simulate.
        duration: duration [s].
        q: initial configuration, (nq,) or by joint name (see `Scene`); the scene's when None. It is projected
            onto the constraints (`Scene.project`): an array by the least displacement, a table with its named
            entries held. `Trajectory.notes` lists notable displacements; for an array, they are also a
            RuntimeWarning.
        v: initial velocity, (nv,) or by joint name; the scene's when None. The velocity is projected like q.
        t0: initial time [s].
        method: "dop853" (order 8) or "dopri5" (order 5), adaptive; "rk4", "semi_implicit_euler" or "moreau"
            (time stepping at velocity level), fixed dt; "Radau", "BDF" or "LSODA" by SciPy, for stiff scenes.
        rtol: relative tolerance of adaptive methods, from 1e-14 to 0.1, or 0 for atol alone; 1e-8 when None.
        atol: absolute tolerance, a number or an array (2 nv,) for positions and velocities, 1e-10 when None;
            for states of laws, the number or the smallest entry of the array.
        dt: step of the fixed-step methods [s].
        output_dt: time between samples [s]; every accepted step when None. Events are samples as well;
            `run.grid` is the mask of samples on the grid t0 + k output_dt, both ends included.
        max_steps: maximum number of steps. None sets no limit, except that a stiff scene stops as soon as an
            explicit method would need 100,000 more steps.
        max_wall: maximum wall time [s]; no limit when None.
        record: any of "a", "tau", "forces" (which include "laws" and "tau"), "contact_points" (points of
            contacts with gap and force, which include "forces"), "laws", "reactions" (which include "a"),
            "energy", "power", "dense" (interpolants of the steps, for `run.at`), or names of fields that they
            fill.
        events: functions (t, q, v) -> number whose zeros are events, as in SciPy's solve_ivp. A function may
            have the attributes `terminal` (True, or the number of events that ends the run) and `direction`
            (positive for rising zeros only, negative for falling ones). A step ends at each event, with the
            accuracy of the step. A zero at the start is not an event. `run.user_events` holds the events.
            "separate", alone or in the list, keeps all events out of the samples, which then lie exactly on
            the grid.
        callback: function called as callback(t, q, v) before every step. True ends the run, torques (nv,)
            replace the actuation from this time on, and None changes nothing. Methods of the core only.
        several: behavior if the laws admit several motions. "error" raises a FrictionParadoxError with two
            of the motions. "continue" selects the motion nearest to the previous motion (at the start, the
            motion of least friction) and records an event of kind "several". An element at rest that may
            also slip stays at rest in both cases, with such an event.
        strict: whether an impact that gains energy raises an ImpactEnergyError; Newton's law of restitution
            with friction may gain energy. Otherwise an event of kind "impact" has a positive energy_change.
        progress: progress bar on standard error; None shows it on a terminal only.
        checkpoint: file from which `resume` can continue the run if it is killed; None for no file. The file
            is replaced atomically at the start, at the end, on Ctrl-C between two steps, and every
            `checkpoint_interval`. Methods of the core only.
        checkpoint_interval: wall time between checkpoints [s]; 0 for a checkpoint after every step.

    Returns:
        The Trajectory.

    Raises:
        InputError: an argument does not fit.
        OutputError: the checkpoint cannot be written.
        LoopClosureError: the initial state cannot be projected onto the constraints, or the run left them.
        StiffnessError: the scene is stiff and the method explicit; `joint` and `rate` hold the stiff joint
            and its relaxation rate.
        DivergenceError: speeds grow without bound over many decades, and max_steps is None; `joint`, `source`
            and `rate` hold the joint, the force with the most work on it, and the growth rate.
        WallTimeError: `max_wall` is exceeded.
        RunError: the run stopped early; its `trajectory` holds the samples before the stop.
        ImpactEnergyError: an impact gained energy, and `strict` is True.
        RunInterrupted: Ctrl-C was pressed; its `trajectory` holds the samples before the stop. The trajectory
            is empty if decoupled mechanisms ran one after another.
    """
    require_scene("simulate", scene)
    requests, between = parse_events(events), parse_callback(callback, scene.model.nv)
    choice("simulate: progress", progress, (True, False, None))
    steps = (method, rtol, atol, dt, output_dt, max_steps)
    more = (record, several, max_wall, requests.names, requests.separate, strict)
    compiled = compiled_scene(scene)
    options = cached_options(compiled, scene.name, duration, t0, *steps, *more)
    _check_together(method, requests, callback, checkpoint)
    nonnegative("simulate: checkpoint_interval", checkpoint_interval)
    if checkpoint is not None:
        check_writable(file_path("simulate: checkpoint", checkpoint), "the checkpoint")
    q0, v0 = (
        scene.project(q, v, options.t0) if (q is not None or v is not None or t0) else scene.initial_state()
    )
    own = q is None and v is None and not t0
    states = scene_states(scene)
    moved = [] if own else states.configuration_notes(q, q0)
    followed = states.start_notes() if own else states.velocity_notes(v, v0)
    notes = moved + followed
    for start, notes_of_start in ((q, moved), (v, followed)):
        if notes_of_start and start is not None and by_name(start) is None:
            warnings.warn(f"simulate: {notes_of_start[0]}", RuntimeWarning, stacklevel=2)
    program, delayed = compiled.program_of_runs(options.t0)
    saver = None
    if checkpoint is not None:
        from .checkpoint import Saver

        saver = Saver(checkpoint, scene, options, checkpoint_interval, notes=notes, delayed=delayed)
    hints: list[str] = []
    explicit_only = compiled.explicit_only

    def hint(at: float, dof: int, rate: float, decays: bool) -> None:
        hints.append(f"from t = {at:.4g} s on {stiff_hint(scene.model, dof, rate, decays, explicit_only)}")
        warnings.warn(f"simulate: {hints[0]}", RuntimeWarning, stacklevel=4)

    begin = time.perf_counter()
    with progress_bar(progress, options) as tick:
        if method in SCIPY:
            from .scipy_solvers import simulate_stiff

            outcome, stopped = simulate_stiff(compiled, q0, v0, options, tick, requests.watched)
        else:
            parts = [] if saver or between else decoupled_components(compiled, options)
            merged = run_decoupled(compiled, parts, q0, v0, options, tick) if parts else None
            # If a component fails, a run in common steps reports the failure.
            outcome = merged or run_together(
                compiled,
                q0,
                v0,
                options,
                program,
                tick=tick,
                save=saver,
                save_interval=saver.interval if saver else 0.0,
                events=requests.watched,
                callback=between,
                hint=hint,
            )
            stopped = outcome.stopped
        if tick is not None and stopped is None and len(outcome.t):
            tick(float(outcome.t[-1]))  # the core shows the time only at intervals
    return finish(scene, outcome, stopped, options, time.perf_counter() - begin, [*notes, *hints])


def _check_together(method: str, requests: RunRequests, callback: object, checkpoint: object) -> None:
    """Check that method, events, callback and checkpoint can be combined.

    Raises:
        InputError: see above.
    """
    if method in SCIPY and checkpoint is not None:
        raise InputError(
            f'simulate: checkpoint needs one of the core\'s methods; "{method}" runs in SciPy, which '
            "hides its state"
        )
    if method in SCIPY and callback is not None:
        raise InputError(
            f'simulate: callback needs one of the core\'s methods; "{method}" runs in SciPy, whose steps '
            "depend on earlier steps"
        )
    if checkpoint is not None and (requests.watched or callback is not None):
        raise InputError(
            "simulate: checkpoint cannot hold functions; leave out events and callback, or the checkpoint"
        )
