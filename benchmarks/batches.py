"""Throughput of batches: pn.rollout against mujoco.rollout, the call from Python included.

Both record every step.  Only steps really made count: MuJoCo stops a diverged state and pads its output.
One thread is timed by the processor time of the process, which other users of the machine do not stretch; two
threads by wall time, beside what they can gain at most at that moment: hashing in two threads, which share
nothing.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

import pin_nonideal as pn

from . import cases, timing
from .problems import Problem

DT = 2e-3
STATES, STEPS = 64, 200
SPREAD = 0.05  # of the velocities of the batch around the scene's [rad/s or m/s]
OURS, RIVALS = "pin_nonideal", ("mujoco Euler", "mujoco implicitfast")
HASHED = bytes(20_000_000)

CASES: dict[str, Callable[[], Problem]] = {
    maker.__name__: maker
    for maker in (cases.panda, cases.four_bar, cases.n_four_bar, cases.talos, cases.solo12_held)
}

# Returns the steps really made, and what went wrong, empty when nothing did.
Call = Callable[[], tuple[int, str]]


def starts(problem: Problem, scene: pn.Scene, count: int) -> tuple[Any, Any]:
    """States around the problem's, all consistent."""
    generator = np.random.default_rng(5)
    pairs = []
    for _ in range(count):
        v = problem.v0 + SPREAD * generator.standard_normal(problem.model.nv)
        pairs.append(scene.project(problem.q0, v))
    return np.array([q for q, _ in pairs]), np.array([v for _, v in pairs])


def ours(scene: pn.Scene, q: Any, v: Any, steps: int, threads: int) -> Call:
    """A call of pn.rollout."""

    def call() -> tuple[int, str]:
        try:
            runs = pn.rollout(scene, (q, v), steps * DT, method="semi_implicit_euler", dt=DT, threads=threads)
        except pn.RunError as error:
            return 0, str(error)
        return sum(run.stats.steps for run in runs), ""

    return call


def theirs(problem: Problem, q: Any, v: Any, steps: int, threads: int, integrator: str) -> Call:
    """A call of mujoco.rollout, with the constraints of its defaults.

    Without warm start: its Newton method ends after one iteration on joints that are held, warm or cold.
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
        times = np.round(state[:, :, 0] / DT)  # the first number of a state is its time
        made = sum(np.unique(one).size for one in times)
        return made, "" if made == len(q) * steps else f"diverged: {made} of {len(q) * steps} steps"

    return call


def hashing(threads: int) -> Callable[[], object]:
    """Two pieces of work that share nothing, in one or two threads."""
    pool = ThreadPoolExecutor(threads)
    return lambda: list(pool.map(lambda _: hashlib.sha256(HASHED).digest(), range(2)))


def batch_of(function: Callable[[], Any], clock: Callable[[], float]) -> timing.Batch:
    """A batch timed by a clock of all threads."""

    def batch(count: int) -> float:
        begin = clock()
        for _ in range(count):
            function()
        return (clock() - begin) / count

    return batch


def measure_case(problem: Problem, states: int, steps: int, rounds: int) -> dict[str, Any]:
    """Steps a second of one robot, by tool and number of threads."""
    scene = problem.scene()
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
    batches |= {("hashing", n): batch_of(hashing(n), time.perf_counter) for n in (1, 2)}
    wall = timing.paired(batches, rounds)
    rows = []
    for who, (count, failure) in made.items():
        row: dict[str, Any] = {"tool": who[0], "threads": who[1], "status": failure or "ok"}
        rows.append(row)
        if not failure:
            row["steps_per_second"] = count / (processor[who] if who in processor else wall[who]).best
            if who[1] == 2:
                row["over_one_thread"] = wall[who[0], 1].best / wall[who].best
    result: dict[str, Any] = {"title": problem.title, "states": states, "steps": steps, "rows": rows}
    result["two_threads_at_most"] = wall["hashing", 1].best / wall["hashing", 2].best
    result["ratios"] = [
        {"threads": threads, **against_the_best(times, threads)}
        for threads, times in ((1, processor), (2, wall))
    ]
    return result


def against_the_best(times: dict[tuple[str, int], timing.Times], threads: int) -> dict[str, Any]:
    """The fastest rival with this number of threads, and our steps over its steps in the same time."""
    rivals = [who for who in times if who[0] in RIVALS and who[1] == threads]
    if not rivals or (OURS, threads) not in times:
        return {"against": None, "ratio": None}
    best = min(rivals, key=lambda who: times[who].best)
    return {"against": best[0], "ratio": timing.ratio(times[best], times[OURS, threads])}


def measure(quick: bool, only: str | None, say: Callable[[str], None] = print) -> list[dict[str, Any]]:
    """All robots, or one."""
    results = []
    for name, maker in CASES.items():
        if only not in (None, name):
            continue
        size = (16, 50, 3) if quick else (STATES, STEPS, 9)
        result = {"case": name, **measure_case(maker(), *size)}
        results.append(result)
        say(f"  {result['title']}: two threads could gain {result['two_threads_at_most']:.2f}")
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
