"""Time of one constrained acceleration: the core of this package against Pinocchio in C++.

Model, state and compiler flags are the same.  The accelerations of the peers are checked against ours first.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from . import build_peers, cases, timing
from .problems import Problem
from .tools import pinocchio_scipy as loop

SAME_ACCELERATION = 1e-9  # relative; with a proximal term of 1e-12 Pinocchio agrees to 1e-13
PINOCCHIO_TERMS = 'pin_nonideal, terms="pinocchio"'


CASES: dict[str, Callable[[], Problem]] = {
    maker.__name__: maker
    for maker in (
        cases.four_bar,
        cases.solo12,
        cases.talos,
        cases.panda,
        cases.solo12_free,
        cases.talos_free,
    )
}


def our_batch(scene: pn.Scene, q: Any, v: Any) -> timing.Batch:
    """Return a batch of evaluations of the core."""
    runner = scene._compiled.program.runner()
    return timing.counted(lambda count: runner.time_evaluations(q, v, 0.0, count))


def compiled_batches(case: Problem) -> dict[str, timing.Batch]:
    """Return batches of Pinocchio's evaluation in C++, from the wheel's libraries and from its headers."""
    batches: dict[str, timing.Batch] = {}
    q, v = np.array(case.q0), np.array(case.v0)
    for name in build_peers.NAMES:
        module = build_peers.load(name)
        if module is None:
            continue
        peer = module.Peer(case.model, loop.anchors(case), loop.proximal(case).mu, 1)
        check_same(case, peer)
        if case.anchors:
            run = partial(peer.time_constraint_dynamics, q, v)
            batches[f"{name} constraintDynamics"] = timing.counted(run)
        else:
            for world in (False, True):
                label = f"{name} aba {'WORLD' if world else 'LOCAL'}"
                batches[label] = timing.counted(partial(peer.time_aba, q, v, world=world))
    return batches


def check_same(case: Problem, peer: Any) -> None:
    """Check that the peer computes the same acceleration.

    Raises:
        RuntimeError: the accelerations differ by more than SAME_ACCELERATION.
    """
    theirs = np.empty(case.model.nv)
    peer.acceleration(np.array(case.q0), np.array(case.v0), theirs)
    ours = case.scene().acceleration(case.q0, case.v0)
    miss = float(np.abs(theirs - ours).max()) / max(1.0, float(np.abs(ours).max()))
    if not miss < SAME_ACCELERATION:
        raise RuntimeError(f"{case.name}: the accelerations differ by {miss:.1e} relative")


def python_batch(case: Problem) -> timing.Batch:
    """Return a batch of Pinocchio's evaluation called from Python, with data and settings created once."""
    model, q, v, tau = case.model, np.array(case.q0), np.array(case.v0), np.zeros(case.model.nv)
    data = model.createData()
    if not case.anchors:
        return timing.per_call(lambda: pin.aba(model, data, q, v, tau))
    models, datas = loop.containers(loop.anchors(case))
    settings = loop.proximal(case)
    pin.initConstraintDynamics(model, data, models, datas)
    return timing.per_call(lambda: pin.constraintDynamics(model, data, q, v, tau, models, datas, settings))


def mujoco_batch(case: Problem) -> timing.Batch | None:
    """Return a batch of mj_forward without warm start, which at a fixed state would start at the solution."""
    try:
        import mujoco
    except ImportError:
        return None
    from .tools.mujoco import Coordinates, lighten, states

    mj = states(case)
    lighten(mj)
    mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
    data = mujoco.MjData(mj)
    data.qpos[:], data.qvel[:] = Coordinates(case.model, mj).there(case.q0, case.v0)
    return timing.per_call(lambda: mujoco.mj_forward(mj, data))


def measure_case(case: Problem, rounds: int) -> dict[str, Any]:
    """Return the times of all tools on one case, and ours over Pinocchio's faster build and over MuJoCo."""
    scene = case.scene()
    batches = {
        "pin_nonideal": our_batch(scene, case.q0, case.v0),
        PINOCCHIO_TERMS: our_batch(case.scene("pinocchio"), case.q0, case.v0),
        **compiled_batches(case),
    }
    batches["pinocchio from Python"] = python_batch(case)
    rival = mujoco_batch(case)
    if rival is not None:
        batches["mujoco mj_forward"] = rival
    times = timing.paired(batches, rounds)
    compiled = [name for name in times if name.startswith("pinocchio_")]
    result: dict[str, Any] = {
        "title": case.title, "nv": case.model.nv,
        "rows": scene._compiled.program.rows if case.anchors else 0,
        "seconds": {name: t.best for name, t in times.items()},
        "own_pass": timing.ratio(times["pin_nonideal"], times[PINOCCHIO_TERMS]),
    }  # fmt: skip
    if compiled:
        best = min(compiled, key=lambda name: times[name].best)
        result |= {"peer": best, "ratio": timing.ratio(times["pin_nonideal"], times[best])}
    if rival is not None:
        result["ratio_mujoco"] = timing.ratio(times["pin_nonideal"], times["mujoco mj_forward"])
    return result


def measure(quick: bool, only: str | None, say: Callable[[str], None] = print) -> list[dict[str, Any]]:
    """Measure all cases, or one."""
    results = []
    for name, maker in CASES.items():
        if only not in (None, name):
            continue
        result = {"case": name, **measure_case(maker(), 20 if quick else 200)}
        results.append(result)
        ours = result["seconds"]["pin_nonideal"] * 1e6
        versus = (
            f", {result['ratio']:.2f} of {result['peer']}" if "ratio" in result else ", C++ peers not built"
        )
        say(f"  {result['title']}: {ours:.2f} us{versus}")
        theirs = result["seconds"][PINOCCHIO_TERMS] * 1e6
        say(f"    {PINOCCHIO_TERMS}: {theirs:.2f} us; the own pass takes {result['own_pass']:.2f} of it")
    return results
