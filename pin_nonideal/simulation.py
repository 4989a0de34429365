"""simulate and rollout: a scene and a length of time in, a Trajectory out."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import array, choice, count
from .compilation.failures import LEFT, check_closed
from .errors import InputError, OutputError, RunError, RunInterrupted, UserFunctionError
from .runs.checkpoint import Saver
from .runs.options import SCIPY, run_options
from .scene import Scene
from .trajectory import Event, Stats, Trajectory

Array = NDArray[np.float64]

EVENT_KINDS = ("stick", "slip", "reverse", "pull", "chatter")

NOTHING = np.empty(0)  # what the core does not hand over: fields without a number


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
    record: str | Sequence[str] = (),
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
        record: any of "a", "forces", "energy", "power", or names of fields that they fill.
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
        RunError: the run stopped early; its `trajectory` holds the samples up to there.
        RunInterrupted: Ctrl-C; the same.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"simulate: scene must be a Scene; got {type(scene).__name__}")
    options = run_options(scene, duration, t0, method, rtol, atol, dt, output_dt, record)
    q0, v0 = (
        scene.project(q, v, options["t0"])
        if (q is not None or v is not None or t0)
        else scene.initial_state()
    )
    choice("simulate: progress", progress, (True, False, None))
    if checkpoint is not None:
        if method in SCIPY:
            raise InputError(
                f'simulate: checkpoint needs one of the core\'s methods; "{method}" runs in SciPy, which '
                "does not give its state away"
            )
        Saver(checkpoint, scene, options, checkpoint_interval)
    bar = progress_bar(progress, options)
    options["tick"] = bar.update if bar else None
    begin = time.perf_counter()
    try:
        if method in SCIPY:
            from .runs.scipy_methods import simulate_stiff

            raw = simulate_stiff(scene, q0, v0, options)
        else:
            raw = scene.new_runner().simulate(q0, v0, scene.z0, options)
    finally:
        if bar:
            bar.close()
    return finish(scene, raw, options, time.perf_counter() - begin)


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
    record: str | Sequence[str] = (),
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
        record: as in `simulate`.
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
    options = run_options(scene, duration, t0, method, rtol, atol, dt, output_dt, record)
    if method in SCIPY:
        raise InputError(f'rollout: method must be one of the core\'s; "{method}" runs in SciPy')
    begin = time.perf_counter()
    q0, v0 = scene.nearest_states(starts_q, starts_v, options["t0"], threads)
    outcomes = scene.roll_out(q0, v0, options, threads)
    wall = time.perf_counter() - begin
    results: list[Trajectory] = []
    failed: list[RunError] = []
    for i, outcome in enumerate(outcomes):
        try:
            if outcome is not None:
                results.append(finish(scene, outcome.hand_over(), options, wall))
        except RunError as error:
            error.index = i
            failed.append(error)
    if failed:  # an interrupt before the runs that it ended in other threads
        raise min(failed, key=lambda error: not isinstance(error, RunInterrupted))
    return results


def finish(scene: Scene, raw: dict[str, Any], options: dict[str, Any], wall: float) -> Trajectory:
    """Shapes the core's flat arrays; raises what stopped the run, with the trajectory attached.

    Args:
        scene: the scene that ran.
        raw: arrays by name.
        options: what was asked for.
        wall: wall time [s].

    Raises:
        RunError: the run stopped early.
        OutputError: its first checkpoint could not be written.
    """
    trajectory = shaped(scene, raw, options, wall)
    error = raw["error"]
    if error is None:
        if raw["largest_violation"] > LEFT:
            check_closed(scene, trajectory)
    else:
        last = float(trajectory.t[-1]) if len(trajectory) else options["t0"]
        if isinstance(error, KeyboardInterrupt):
            stopped: RunError = RunInterrupted(
                f"the run was interrupted at t = {last:.4g} s; the trajectory up to there is in "
                "error.trajectory",
                time=last,
            )
            cause: BaseException | None = None
        elif isinstance(error, OutputError):
            raise error
        elif isinstance(error, RunError):
            stopped, cause = error, error.__cause__
        else:
            stopped = UserFunctionError(
                f"a function of the scene failed at t = {last:.4g} s: {error}", time=last
            )
            cause = error if isinstance(error, BaseException) else None
        stopped.time = last if stopped.time is None else stopped.time
        stopped.trajectory = trajectory
        raise stopped from cause
    if raw["failure"] is not None:
        failure = scene.failure(raw["failure"])
        failure.args = (f"{failure}; the trajectory up to there is in error.trajectory", *failure.args[1:])
        failure.trajectory = trajectory
        raise failure
    return trajectory


def shaped(scene: Scene, raw: dict[str, Any], options: dict[str, Any], wall: float) -> Trajectory:
    """A Trajectory from the core's flat arrays.

    Args:
        scene: the scene that ran.
        raw: arrays by name.
        options: what was asked for.
        wall: wall time [s].
    """
    t = raw.get("t", NOTHING)
    steps, rejected, evaluations, factorizations, projections, iterations = raw["counters"]
    nt, nq, nv = len(t), scene.q0.size, scene.v0.size

    def table(key: str, width: int) -> Array:
        result: Array = raw.get(key, NOTHING).reshape(nt, width)
        return result

    fields: dict[str, Any] = {}
    if options["a"]:
        fields["a"] = table("a", nv)
    if options["forces"]:
        m = max((s.stop for s in scene.constraint_slices.values()), default=0)
        for key, width in (("F_ideal", nv), ("F_nonideal", nv), ("lam", m), ("lam_ideal", m)):
            fields[key] = table(key, width)
    if options["power"] or options["energy"]:
        columns = ["actuation", "forces", "constraints", *_columns(scene.law_names)]
        if options["power"]:
            fields["power"] = dict(zip(columns, table("power", len(columns)).T, strict=True))
        if options["energy"]:
            fields["energy"] = _ledger(columns, table("energy", len(columns) + 3))
    if scene.z0.size:
        fields["z"] = table("z", scene.z0.size)
    elements = scene.element_names
    if elements:
        fields["modes"] = table("modes", len(elements)).astype(np.int8)
    if raw["events"]:
        names = dict.fromkeys(EVENT_KINDS, elements) | {"pull": list(scene.constraint_slices)}
        kinds = [(t, EVENT_KINDS[kind], element) for t, kind, element in raw["events"]]
        fields["events"] = [Event(t, kind, names[kind][element]) for t, kind, element in kinds]
    return Trajectory(
        t=t,
        q=table("q", nq),
        v=table("v", nv),
        violation=raw.get("violation", NOTHING),
        violation_rate=raw.get("violation_rate", NOTHING),
        stats=Stats(steps, rejected, evaluations, factorizations, projections, iterations, wall),
        scene=scene,
        element_names=list(elements),
        name=scene.name,
        **fields,
    )


def _ledger(columns: Sequence[str], numbers: Array) -> dict[str, Array]:
    ledger = {
        "kinetic": numbers[:, 0],
        "potential": numbers[:, 1],
        "total": numbers[:, 0] + numbers[:, 1],
    }
    ledger |= dict(zip([*columns, "projection"], numbers[:, 2:].T, strict=True))
    done = numbers[:, 2:].sum(axis=1)
    ledger["balance"] = ledger["total"] - ledger["total"][:1] - done
    return ledger


def _columns(laws: Sequence[str]) -> list[str]:
    """Law names as ledger columns that no other column bears."""
    taken = {"kinetic", "potential", "total", "actuation", "forces", "constraints", "projection", "balance"}
    return [f"law {name}" if name in taken else name for name in laws]


class _Bar:
    def __init__(self, total: float, t0: float) -> None:
        from tqdm import tqdm

        self._t0 = t0
        self._bar = tqdm(
            total=total, unit="s", bar_format="{l_bar}{bar}| {n:.2f}/{total:.2f} s [{elapsed}<{remaining}]"
        )

    def update(self, t: float) -> None:
        self._bar.n = t - self._t0
        self._bar.refresh()

    def close(self) -> None:
        self._bar.close()


def progress_bar(progress: bool | None, options: dict[str, Any]) -> _Bar | None:
    """The bar that shows how far a run has come, or None where it is not wanted.

    Args:
        progress: True, False, or None for a terminal only.
        options: of the run.
    """
    shown = sys.stderr.isatty() if progress is None else progress
    return _Bar(options["duration"], options["t0"]) if shown else None
