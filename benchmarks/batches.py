"""Throughput of batches: pn.rollout against mujoco.rollout, including the call from Python.

Both record every step.  Only completed steps count: MuJoCo stops a diverged state and pads its output.  One
thread is timed by the processor time of the process, which is independent of the load of the machine.  Two
threads are timed by wall time.  Two processes without shared data, with half of the batch each, give the
upper bound of their gain.  The batch is long compared with the start of a thread, which may take a
millisecond on a virtual machine.
"""

from __future__ import annotations

import math
import multiprocessing
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

import pin_nonideal as pn

from . import cases, timing
from .problems import Problem

DT = 2e-3
STATES, STEPS = 64, 200
LONG = 0.2  # minimum time of a batch in one thread [s]
MAX_STATES = 4096
SPREAD = 0.05  # standard deviation of the initial velocities around the scene's [rad/s or m/s]
OURS, RIVALS = "pin_nonideal", ("mujoco Euler", "mujoco implicitfast")

CASES: dict[str, Callable[[], Problem]] = {
    maker.__name__: maker
    for maker in (cases.panda, cases.four_bar, cases.n_four_bar, cases.talos, cases.solo12_held)
}

# Returns the number of completed steps, and the failure message, empty if there is none.
Call = Callable[[], tuple[int, str]]


def starts(problem: Problem, scene: pn.Scene, count: int) -> tuple[Any, Any]:
    """Return random consistent states around the problem's initial state."""
    generator = np.random.default_rng(5)
    pairs = []
    for _ in range(count):
        v = problem.v0 + SPREAD * generator.standard_normal(problem.model.nv)
        pairs.append(scene.project(problem.q0, v))
    return np.array([q for q, _ in pairs]), np.array([v for _, v in pairs])


def ours(scene: pn.Scene, q: Any, v: Any, steps: int, threads: int) -> Call:
    """Return a call of pn.rollout."""

    def call() -> tuple[int, str]:
        try:
            runs = pn.rollout(scene, q, v, steps * DT, method="semi_implicit_euler", dt=DT, jobs=threads)
        except pn.RunError as error:
            return 0, str(error)
        return sum(run.stats.steps for run in runs), ""

    return call


def theirs(problem: Problem, q: Any, v: Any, steps: int, threads: int, integrator: str) -> Call:
    """Return a call of mujoco.rollout with its default constraints.

    The warm start is disabled: with and without it, Newton's method takes one iteration on held joints.
    """
    import mujoco
    from mujoco import rollout

    from .tools.mujoco import INTEGRATORS, Coordinates, lighten, states

    mj = states(problem)
    lighten(mj)
    mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
    mj.opt.timestep = DT
    mj.opt.integrator = getattr(mujoco.mjtIntegrator, INTEGRATORS[integrator])
    coordinates = Coordinates(problem.model, mj)
    data = [mujoco.MjData(mj) for _ in range(threads)]
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.zeros((len(q), mujoco.mj_stateSize(mj, full)))
    for k in range(len(q)):
        data[0].qpos[:], data[0].qvel[:] = coordinates.there(q[k], v[k])
        mujoco.mj_getState(mj, data[0], initial[k], full)
    pool = rollout.Rollout(nthread=threads)

    def call() -> tuple[int, str]:
        state, _ = pool.rollout(mj, data, initial, nstep=steps)
        times = np.round(state[:, :, 0] / DT)  # the first entry of a state is its time
        made = sum(np.unique(one).size for one in times)
        return made, "" if made == len(q) * steps else f"diverged: {made} of {len(q) * steps} steps"

    return call


def half(name: str, states: int, steps: int, which: int) -> Call:
    """Return a call of pn.rollout for the first or second half of a batch, in one thread."""
    problem = CASES[name]()
    scene = problem.scene()
    part = slice(which * states // 2, (which + 1) * states // 2)
    q, v = starts(problem, scene, states)
    return ours(scene, q[part], v[part], steps, 1)


def follow(name: str, states: int, steps: int, orders: Connection) -> None:
    """Run the second process: compute its half of the batch on each request."""
    call = half(name, states, steps, 1)
    with suppress(EOFError):  # the first process has closed the pipe
        while orders.recv():
            call()
            orders.send(True)


@contextmanager
def two_processes(name: str, states: int, steps: int) -> Iterator[Callable[[], object]]:
    """Return a batch in two processes, half each: the upper bound of the gain of two threads."""
    context = multiprocessing.get_context("spawn")
    orders, theirs_end = context.Pipe()
    other = context.Process(target=follow, args=(name, states, steps, theirs_end), daemon=True)
    other.start()
    theirs_end.close()  # otherwise the end of the other process goes unnoticed
    call = half(name, states, steps, 0)

    def both() -> None:
        orders.send(True)
        call()
        orders.recv()

    try:
        yield both
    finally:
        orders.close()
        other.join()


def batch_of(function: Callable[[], Any], clock: Callable[[], float]) -> timing.Batch:
    """Return a batch timed by a clock of all threads."""

    def batch(count: int) -> float:
        begin = clock()
        for _ in range(count):
            function()
        return (clock() - begin) / count

    return batch


def long_batch(problem: Problem, scene: pn.Scene, steps: int) -> int:
    """Return the number of states of a batch of at least LONG seconds, a multiple of STATES."""
    call = ours(scene, *starts(problem, scene, STATES), steps, 1)
    seconds = min(batch_of(call, time.process_time)(1) for _ in range(3))
    return min(STATES * math.ceil(LONG / seconds), MAX_STATES)


def measure_case(name: str, states: int | None, steps: int, rounds: int) -> dict[str, Any]:
    """Return steps per second of one robot by tool and threads; `states` None for a batch of LONG seconds."""
    problem = CASES[name]()
    scene = problem.scene()
    if states is None:
        states = long_batch(problem, scene, steps)
    q, v = starts(problem, scene, states)
    calls: dict[tuple[str, int], Call] = {}
    for threads in (1, 2):
        calls[OURS, threads] = ours(scene, q, v, steps, threads)
        for rival in RIVALS:
            try:
                calls[rival, threads] = theirs(problem, q, v, steps, threads, rival.split()[1])
            except ImportError:
                continue
    made = {who: call() for who, call in calls.items()}
    good = {who: call for who, call in calls.items() if not made[who][1]}
    single = {who: batch_of(call, time.process_time) for who, call in good.items() if who[1] == 1}
    processor = timing.paired(single, rounds)
    batches = {who: batch_of(call, time.perf_counter) for who, call in good.items()}
    with two_processes(name, states, steps) as both:
        batches["processes", 2] = batch_of(both, time.perf_counter)
        wall = timing.paired(batches, 2 * rounds)
    rows = []
    for who, (count, failure) in made.items():
        row: dict[str, Any] = {"tool": who[0], "threads": who[1], "status": failure or "ok"}
        rows.append(row)
        if not failure:
            row["steps_per_second"] = count / (processor[who] if who in processor else wall[who]).best
            if who[1] == 2:
                row["over_one_thread"] = timing.ratio(wall[who[0], 1], wall[who])
    result: dict[str, Any] = {"title": problem.title, "states": states, "steps": steps, "rows": rows}
    if (OURS, 1) in wall:
        result["two_processes"] = timing.ratio(wall[OURS, 1], wall["processes", 2])
    result["ratios"] = [
        {"threads": threads, **against_the_best(times, threads)}
        for threads, times in ((1, processor), (2, wall))
    ]
    return result


def against_the_best(times: dict[tuple[str, int], timing.Times], threads: int) -> dict[str, Any]:
    """Return the fastest rival with this number of threads, and our steps over its steps in the same time."""
    rivals = [who for who in times if who[0] in RIVALS and who[1] == threads]
    if not rivals or (OURS, threads) not in times:
        return {"against": None, "ratio": None}
    best = min(rivals, key=lambda who: times[who].best)
    return {"against": best[0], "ratio": timing.ratio(times[best], times[OURS, threads])}


def measure(quick: bool, only: str | None, say: Callable[[str], None] = print) -> list[dict[str, Any]]:
    """Measure all robots, or one."""
    results = []
    for name in CASES:
        if only not in (None, name):
            continue
        size = (16, 50, 3) if quick else (None, STEPS, 9)
        result = {"case": name, **measure_case(name, *size)}
        results.append(result)
        say(f"  {result['title']}: two processes gain {result.get('two_processes', math.nan):.2f}")
        for row in result["rows"]:
            notes = [row["status"]]
            if row["status"] == "ok":
                notes = [f"{row['steps_per_second'] / 1e3:.0f} k steps/s"]
            notes += [f"{row['over_one_thread']:.2f} of one thread"] if "over_one_thread" in row else []
            say(f"    {row['tool']}, {row['threads']} threads: {', '.join(notes)}")
        for row in result["ratios"]:
            if row["against"]:
                say(f"    {row['ratio']:.2f} times {row['against']} in {row['threads']} threads")
    return results
