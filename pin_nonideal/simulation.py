"""simulate and rollout: a scene and a length of time in, a Trajectory out."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .actuation import SampledControl
from .checkpoint import Saver
from .checks import array, choice, count, label, nonnegative, number, positive, sequence
from .errors import InputError, OutputError, RunError, RunInterrupted, UserFunctionError
from .failures import check_closed
from .scene import Scene
from .trajectory import Event, Stats, Trajectory

Array = NDArray[np.float64]

ADAPTIVE = ("dop853", "dopri5")
FIXED = ("rk4", "semi_implicit_euler", "moreau")
SCIPY = ("Radau", "BDF", "LSODA")
RECORDS = ("a", "forces", "energy", "power")
FIELDS = {"F_ideal": "forces", "F_nonideal": "forces", "lam": "forces", "lam_ideal": "forces"}
EVENT_KINDS = ("stick", "slip", "reverse", "pull", "chatter")
DEFAULT_RTOL, DEFAULT_ATOL = 1e-8, 1e-10
# Times are floating-point numbers: a step of fewer of their spacings is off by more than a percent, and one
# shorter than a spacing leads nowhere.
LEAST_SPACINGS = 100.0
MOST_SAMPLES = 1e8  # some gigabytes for a small robot
# No step meets a tolerance below rounding; the square of what misses it must not overflow.
LEAST_RTOL, LEAST_ATOL = 1e-14, 1e-100


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

    Adaptive methods keep the local error of every coordinate below atol + rtol |y|; the state is put back on
    the constraints after every step, so that violations stay at rounding.  Dry friction sticks and slips at
    located events.

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
    options = _options(scene, duration, t0, method, rtol, atol, dt, output_dt, record)
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
            from .stiff import simulate_stiff

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
    if method in SCIPY:
        raise InputError(f'rollout: method must be one of the core\'s; "{method}" runs in SciPy')
    options = _options(scene, duration, t0, method, rtol, atol, dt, output_dt, record)
    starts = [scene.project(a, b, options["t0"]) for a, b in zip(starts_q, starts_v, strict=True)]
    begin = time.perf_counter()
    q0, v0 = (np.ascontiguousarray([s[i] for s in starts]).reshape(len(starts), -1) for i in (0, 1))
    raws = scene.roll_out(q0, v0, options, threads)
    wall = time.perf_counter() - begin
    results = []
    for i, raw in enumerate(raws):
        try:
            results.append(finish(scene, raw, options, wall))
        except RunError as error:
            error.index = i
            raise
    return results


def _options(
    scene: Scene,
    duration: Any,
    t0: Any,
    method: Any,
    rtol: Any,
    atol: Any,
    dt: Any,
    output_dt: Any,
    record: Any,
) -> dict[str, Any]:
    methods = (*ADAPTIVE, *FIXED, *SCIPY)
    choice("simulate: method", method, methods)
    if method in FIXED:
        if dt is None:
            raise InputError(f'simulate: method "{method}" needs a step dt')
        unused = [name for name, value in (("rtol", rtol), ("atol", atol)) if value is not None]
        if unused:
            raise InputError(
                f'simulate: method "{method}" takes steps of the length dt; leave {" and ".join(unused)} out'
            )
    elif dt is not None:
        raise InputError(f'simulate: method "{method}" chooses its own steps; leave dt out, or set output_dt')
    nv = scene.model.nv
    if nv == 0:
        raise InputError(f'simulate: "{scene.name}" has no joint that moves; there is nothing to simulate')
    tolerance = np.full(2 * nv + scene.z0.size, DEFAULT_ATOL)
    if atol is not None:
        given = np.asarray(atol)
        if given.ndim == 0:
            tolerance[:] = nonnegative("simulate: atol", atol)
        else:
            tolerance[: 2 * nv] = array("simulate: atol", atol, (2 * nv,))
            tolerance[2 * nv :] = tolerance[: 2 * nv].min()
            if (tolerance < 0.0).any():
                raise InputError(f"simulate: atol must not be negative; got {tolerance.min():g}")
    relative = DEFAULT_RTOL if rtol is None else nonnegative("simulate: rtol", rtol)
    if relative == 0.0 and not (tolerance > 0.0).all():
        raise InputError("simulate: rtol and atol must not both be zero; set one of them")
    begin, length = number("simulate: t0", t0), positive("simulate: duration", duration)
    steps = {"dt": dt, "output_dt": output_dt}
    lengths = {key: positive(f"simulate: {key}", value) for key, value in steps.items() if value is not None}
    _check_clock(scene, begin, length, lengths)
    wanted = {record} if isinstance(record, str) else set(sequence("simulate: record", record))
    groups = set()
    for name in wanted:
        groups.add(FIELDS.get(name, name))
        choice("simulate: record", FIELDS.get(name, name), RECORDS)
    return {
        "method": method,
        "duration": length,
        "t0": begin,
        "rtol": max(relative, LEAST_RTOL) if relative else 0.0,
        "atol": np.ascontiguousarray(np.maximum(tolerance, LEAST_ATOL)),
        **{key: lengths.get(key, 0.0) for key in steps},
        **{key: key in groups for key in RECORDS},
        "tick": None,
        "save": None,
    }


def _check_clock(scene: Scene, t0: float, duration: float, lengths: dict[str, float]) -> None:
    """Refuses lengths of time that floating-point times near the end of the run cannot tell apart.

    Args:
        scene: what to simulate.
        t0: initial time [s].
        duration: length of time [s].
        lengths: dt and output_dt, as far as given [s].

    Raises:
        InputError: a length is too short, or leaves more samples than a run can hold.
    """
    end = max(abs(t0), abs(t0 + duration))
    spacing = float(np.spacing(end))
    named = {f"simulate: {key}": value for key, value in {"duration": duration, **lengths}.items()}
    if isinstance(scene.actuation, SampledControl):
        named[f"{label(scene.actuation)}: period"] = scene.actuation.period
    for what, value in named.items():
        if not value >= LEAST_SPACINGS * spacing:  # also when the end is beyond all numbers
            raise InputError(
                f"{what} must be at least {LEAST_SPACINGS:g} times the spacing of floating-point times, "
                f"which is {spacing:.2g} s at t = {end:g} s; got {value:g} s"
            )
    key = next((key for key in ("output_dt", "dt") if key in lengths), None)
    if key is not None and duration / lengths[key] > MOST_SAMPLES:
        raise InputError(
            f"simulate: {key} must leave at most {MOST_SAMPLES:g} samples; {lengths[key]:g} s leaves "
            f"{duration / lengths[key]:.2g}; set a longer {'output_dt' if key == 'dt' else key}"
        )


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
    nt = len(raw["t"])
    model = scene.model
    elements, laws = len(scene.element_names), scene.law_names

    def table(key: str, width: int) -> Array:
        result: Array = raw[key].reshape(nt, width)
        return result

    m = max((s.stop for s in scene.constraint_slices.values()), default=0)
    fields: dict[str, Any] = {}
    if options["a"]:
        fields["a"] = table("a", model.nv)
    if options["forces"]:
        for key, width in (("F_ideal", model.nv), ("F_nonideal", model.nv), ("lam", m), ("lam_ideal", m)):
            fields[key] = table(key, width)
    columns = ["actuation", "forces", "constraints", *_columns(laws)]
    if options["power"]:
        fields["power"] = dict(zip(columns, table("power", len(columns)).T, strict=True))
    if options["energy"]:
        numbers = table("energy", len(columns) + 3)
        ledger = {
            "kinetic": numbers[:, 0],
            "potential": numbers[:, 1],
            "total": numbers[:, 0] + numbers[:, 1],
        }
        ledger |= dict(zip([*columns, "projection"], numbers[:, 2:].T, strict=True))
        done = numbers[:, 2:].sum(axis=1)
        ledger["balance"] = ledger["total"] - ledger["total"][:1] - done
        fields["energy"] = ledger
    if scene.z0.size:
        fields["z"] = table("z", scene.z0.size)
    contacts = list(scene.constraint_slices)
    names = {3: contacts}
    events = [
        Event(t, EVENT_KINDS[kind], names.get(kind, scene.element_names)[element])
        for t, kind, element in raw["events"]
    ]
    counters = ("steps", "rejected", "evaluations", "factorizations", "projections", "iterations")
    return Trajectory(
        t=raw["t"],
        q=table("q", model.nq),
        v=table("v", model.nv),
        violation=raw["violation"],
        violation_rate=raw["violation_rate"],
        modes=table("modes", elements).astype(np.int8) if elements else None,
        events=events,
        stats=Stats(**{key: int(raw[key]) for key in counters}, wall_s=wall),
        scene=scene,
        element_names=list(scene.element_names),
        name=scene.name,
        **fields,
    )


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
