"""Growth of cost with size: deep chains and rings, independent mechanisms, a humanoid, feet, short runs.

Each row has the times of all tools that can compute it.  If accelerations are compared, it also has their
errors relative to a recursion in long double.  Tools of a row are timed in the same rounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from oracles.long_recursion import LongTree

from . import build_peers, timing
from .evaluation import our_batch
from .problems import Problem

OURS, ABA, ODEINT, MUJOCO = "pin_nonideal", "pinocchio aba in C++", "aba + odeint in C++", "mujoco"
MAX_NESTED = 300  # maximum nesting of XML elements that Python writes
MAX_CUBED = 500  # maximum nv of tools with memory of order nv^3
SWAYING = 0.2  # duration of the first phase of the humanoid's motion [s]
MIN_RUN, LONG_RUN = 1e-3, 0.05  # length of a turn [s]
COULOMB: dict[str, Any] = {"coulomb": 0.1}
LOADED: dict[str, Any] = {"mu": 0.1, "radius": 0.05}


@dataclass
class Row:
    """Contestants that are timed together.

    Attributes:
        group: name of a series of rows of growing size.
        size: number of links, mechanisms, feet or runs.
        what: description of the computation.
        batches: batches by contestant.
        errors: error of the acceleration or of the motion, by contestant.
        per: divisor of the times, such as simulated seconds or steps.
    """

    group: str
    size: int
    what: str
    batches: dict[str, timing.Batch]
    errors: dict[str, float] = field(default_factory=dict)
    per: float = 1.0


# --- Models -------------------------------------------------------------------------------------------------


def chain(links: int, turn: float = 0.0, axes: str = "xyz") -> Any:
    """Return a chain of equal links of 0.1 m; the joint axes cycle through `axes`."""
    model, parent = pin.Model(), 0
    kinds = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
    for i in range(links):
        lever = np.array([0.0, 0.0, -0.1 if i else 0.0])
        place = pin.SE3(pin.rpy.rpyToMatrix(0.0, turn if i else 0.0, 0.0), lever)
        parent = model.addJoint(parent, kinds[axes[i % len(axes)]](), place, f"j{i}")
        solid = pin.Inertia(0.1, np.array([0.0, 0.0, -0.05]), np.diag([1e-4, 1e-4, 1e-5]))
        model.appendBodyToJoint(parent, solid, pin.SE3.Identity())
    end = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.1]))
    model.addFrame(pin.Frame("tip", parent, 0, end, pin.FrameType.OP_FRAME))
    return model


def pendulums(count: int, law: dict[str, Any]) -> tuple[pn.Scene, Any]:
    """Return independent double pendulums with joint friction, and their initial configuration."""
    model, start = pin.Model(), []
    lengths = np.random.default_rng(3).uniform(0.3, 0.6, (count, 2))
    angles = np.random.default_rng(4).uniform(0.0, 2.0, (count, 2))
    for k in range(count):
        parent = 0
        for level in range(2):
            place = np.array([0.0, k, 0.0] if level == 0 else [0.0, 0.0, -lengths[k, 0]])
            name = f"joint{level} of {k}"
            parent = model.addJoint(parent, pin.JointModelRY(), pin.SE3(np.eye(3), place), name)
            lever = pin.SE3(np.eye(3), np.array([0.0, 0.0, -lengths[k, level]]))
            model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.05), lever)
            start.append(angles[k, level])
    laws = [pn.JointFriction(name, **law) for name in list(model.names)[1:]]
    return pn.Scene(model, laws=laws), np.array(start)


def table(feet: int) -> pn.Scene:
    """Return a body on feet on a circle, with a force and a moment beyond the friction limits of the feet."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "table")
    model.appendBodyToJoint(joint, pin.Inertia(10.0, np.zeros(3), 0.3 * np.eye(3)), pin.SE3.Identity())
    turn = 2.0 * np.pi * np.arange(feet) / feet
    places = np.column_stack([0.3 * np.cos(turn), 0.3 * np.sin(turn), np.full(feet, -0.3)])
    for k, place in enumerate([*places, np.array([0.05, 0.02, -0.25])]):
        name = f"foot {k}" if k < feet else "pushed"
        placement = pin.SE3(np.eye(3), place)
        model.addFrame(pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME))
    q0 = pin.neutral(model)
    q0[2] = 0.3
    contacts = [pn.PointContact(f"foot {k}", mu=0.7, static_ratio=1.0) for k in range(feet)]
    push = pn.Wrench("pushed", [90.0, 20.0, 0.0, 0.0, 0.0, 5.0])
    return pn.Scene(model, contacts=contacts, forces=[push], q0=q0)


def humanoid() -> tuple[pn.Scene, Any, Any]:
    """Return Talos with two feet fixed in 6D, position control and dry joint friction, and its state."""
    robot = pn.load("talos")
    model = robot.model
    scene = pn.Scene(
        model,
        constraints=[pn.FrameAnchor("left_sole_link"), pn.FrameAnchor("right_sole_link")],
        laws=[pn.JointFriction(str(name), coulomb=20.0) for name in list(model.names)[2:]],
        actuation=pn.HoldPosition(kp=500.0, kd=20.0),
        q0=robot.q0,
    )
    bent = np.concatenate([np.zeros(6), 0.02 * np.random.default_rng(1).standard_normal(model.nv - 6)])
    return scene, *scene.project(pin.integrate(model, scene.q0, bent), np.zeros(model.nv))


# --- Contestants --------------------------------------------------------------------------------------------


def mujoco_model(model: Any, q: Any, v: Any) -> Any:
    """Return MuJoCo's model of a tree and its coordinate map, or None if MuJoCo is not installed."""
    with suppress(ImportError):
        from .tools.mujoco import Coordinates, states

        problem = Problem(name="tree", title="", model=model, q0=q, v0=v, duration=0.0)
        mj = states(problem)
        return mj, Coordinates(model, mj)
    return None


def forward(model: Any, q: Any, v: Any) -> tuple[timing.Batch, Any] | None:
    """Return a batch of MuJoCo's evaluation of a tree, and its acceleration."""
    found = mujoco_model(model, q, v)
    if found is None:
        return None
    import mujoco

    mj, places = found
    data = mujoco.MjData(mj)
    data.qpos[:], data.qvel[:] = places.there(q, v)
    mujoco.mj_forward(mj, data)
    return timing.per_call(lambda: mujoco.mj_forward(mj, data)), np.array(data.qacc)


def peers(model: Any) -> dict[str, Any]:
    """Return the built C++ peers of Pinocchio; their data take 32 nv^3 bytes."""
    if model.nv > MAX_CUBED:
        return {}
    modules = {name: build_peers.load(name) for name in build_peers.NAMES}
    return {name: module.Peer(model, [], 0.0, 1) for name, module in modules.items() if module is not None}


def largest(found: Any, exact: Any) -> float:
    return float(np.abs(found - np.asarray(exact, dtype=float)).max() / np.abs(exact).max())


# --- Rows ---------------------------------------------------------------------------------------------------


def chains(sizes: tuple[int, ...]) -> Iterator[Row]:
    """One evaluation of open chains."""
    for links in sizes:
        model, rng = chain(links), np.random.default_rng(links)
        q, v = 0.3 * rng.standard_normal(links), rng.standard_normal(links)
        scene, none = pn.Scene(model), np.zeros(links)
        exact = LongTree(model).acceleration(q, v, none)
        row = Row("chain", links, "evaluation", {OURS: our_batch(scene, q, v)})
        row.errors[OURS] = largest(scene.acceleration(q, v), exact)
        for name, peer in peers(model).items():
            row.batches[f"{ABA} ({name})"] = timing.counted(partial(peer.time_aba, q, v, world=False))
            row.errors[f"{ABA} ({name})"] = largest(pin.aba(model, model.createData(), q, v, none), exact)
        if links <= MAX_NESTED and (theirs := forward(model, q, v)):
            row.batches[MUJOCO], row.errors[MUJOCO] = theirs[0], largest(theirs[1], exact)
        yield row


def motions(sizes: tuple[int, ...]) -> Iterator[Row]:
    """0.1 s of hanging chains at a tolerance of 1e-10, ours beside a compiled loop around aba."""
    for links in sizes:
        model, duration, tolerance = chain(links, axes="y"), 0.1, 1e-10
        q, v, scene = np.full(links, 0.02), np.zeros(links), pn.Scene(model)
        run = partial(pn.simulate, scene, duration, q, v, output_dt=duration, progress=False)
        finest = run(rtol=1e-13, atol=1e-13).q[-1]
        row = Row("chain in motion", links, "0.1 s at 1e-10", {})
        row.batches[OURS] = timing.per_call(partial(run, rtol=tolerance, atol=tolerance))
        row.errors[OURS] = float(np.abs(run(rtol=tolerance, atol=tolerance).q[-1] - finest).max())
        for name, peer in peers(model).items():

            def theirs(peer: Any = peer, q: Any = q, v: Any = v) -> Any:
                there, speed, end = np.empty_like(q), np.empty_like(v), np.array([0.1])
                peer.integrate(
                    q, v, 0.0 * v, end, "fehlberg78", 1e-10, 1e-10, 10**7, q_out=there, v_out=speed
                )
                return there

            row.batches[f"{ODEINT} ({name})"] = timing.per_call(theirs)
            row.errors[f"{ODEINT} ({name})"] = float(np.abs(theirs() - finest).max())
        yield row


def rings(sizes: tuple[int, ...]) -> Iterator[Row]:
    """One evaluation of closed rings, and 0.2 s of their motion."""
    for links in sizes:
        model = chain(links, turn=2.0 * np.pi / links, axes="yyx")
        scene = pn.Scene(model, constraints=[pn.PointAnchor("tip")])
        q, v = scene.project(np.zeros(links), 0.2 * np.cos(np.arange(links)))
        A, b = scene._compiled.program.runner().rows(q, v, 0.0)[:2]
        exact = LongTree(model).constrained(q, v, np.zeros(links), A.reshape(3, links), b)
        errors = {OURS: largest(scene.acceleration(q, v), exact)}
        yield Row("ring", links, "evaluation", {OURS: our_batch(scene, q, v)}, errors)
        run = partial(pn.simulate, scene, 0.2, q, v, output_dt=0.2, progress=False)
        yield Row("ring in motion", links, "0.2 s at defaults", {OURS: timing.per_call(run)})


def forests(sizes: tuple[int, ...]) -> Iterator[Row]:
    """2 s of double pendulums that rub."""
    for law, name in ((COULOMB, "Coulomb"), (LOADED, "load-dependent")):
        for count in sizes:
            scene, q = pendulums(count, law)
            run = partial(pn.simulate, scene, 2.0, q, output_dt=2.0, progress=False)
            yield Row(f"double pendulums, {name} friction", count, "2 s", {OURS: timing.per_call(run)})


def standing(sizes: tuple[int, ...]) -> Iterator[Row]:
    """A simulated second of a humanoid with dry friction in all joints, and one step of time stepping."""
    del sizes
    scene, q, v = humanoid()
    run = partial(pn.simulate, scene, 1.0, q, v, output_dt=1.0, progress=False)
    yield Row("Talos on two feet", 1, "1 s by dop853", {OURS: timing.per_call(run)})
    steps = partial(run, method="moreau", dt=1e-3)
    yield Row("Talos on two feet", 1, "a step of moreau", {OURS: timing.per_call(steps)}, per=1000.0)
    swaying = partial(pn.simulate, scene, SWAYING, q, v, **steps.keywords)
    what = f"a step of moreau in its first {SWAYING:g} s"
    yield Row("Talos on two feet", 1, what, {OURS: timing.per_call(swaying)}, per=1e3 * SWAYING)


def slipping(sizes: tuple[int, ...]) -> Iterator[Row]:
    """0.5 s of a table that begins to slip."""
    for feet in sizes:
        scene = table(feet)
        settings: dict[str, dict[str, Any]] = {
            "dop853": {},
            "rk4 of 1 ms": {"method": "rk4", "dt": 1e-3},
            "moreau of 1 ms": {"method": "moreau", "dt": 1e-3},
        }
        for name, setting in settings.items():
            run = partial(pn.simulate, scene, 0.5, output_dt=0.5, progress=False, **setting)
            yield Row(f"feet that slip, {name}", feet, "0.5 s", {OURS: timing.per_call(run)})


def short(sizes: tuple[int, ...]) -> Iterator[Row]:
    """One step of the Panda: by simulate, by rollout of very many, by scene.step."""
    scene = pn.load("panda_friction")
    scene = pn.Scene(scene.model, q0=scene.q0)
    q, v = scene.initial_state()
    dt, method = 1e-3, "semi_implicit_euler"
    found = mujoco_model(scene.model, q, v)
    count = sizes[0]
    Q, V = np.tile(q, (count, 1)), np.tile(v, (count, 1))
    once = partial(pn.simulate, scene, dt, q, v, method=method, dt=dt, progress=False)
    yield Row("short runs", 1, "simulate of one step", {OURS: timing.per_call(once)})
    many = partial(pn.rollout, scene, Q, V, dt, method=method, dt=dt, as_arrays=True)
    batches = {OURS: timing.per_call(many)}
    by_two = {OURS: timing.per_call(partial(many, jobs=2))}
    step = {OURS: timing.per_call(lambda: scene.step(q, v, None, dt))}
    if found is not None:
        import mujoco
        from mujoco import rollout

        mj, places = found
        mj.opt.timestep = dt
        data = mujoco.MjData(mj)
        data.qpos[:], data.qvel[:] = places.there(q, v)
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        initial = np.zeros((count, mujoco.mj_stateSize(mj, full)))
        for state in initial:
            mujoco.mj_getState(mj, data, state, full)
        pool = rollout.Rollout(nthread=0)
        batches[MUJOCO] = timing.per_call(lambda: pool.rollout(mj, [data], initial, nstep=1))
        step[MUJOCO] = timing.per_call(lambda: mujoco.mj_step(mj, data))
    yield Row("short runs", count, "a run of one step in a rollout", batches, per=float(count))
    yield Row("short runs", count, "a run of one step in a rollout by two threads", by_two, per=float(count))
    yield Row("short runs", 1, "scene.step, mj_step", step)


# Sizes of each case: full run and quick run.
CASES: dict[Callable[[tuple[int, ...]], Iterator[Row]], tuple[tuple[int, ...], tuple[int, ...]]] = {
    chains: ((10, 30, 100, 300, 1000), (10, 100)),
    motions: ((10, 30, 100, 300), (10,)),
    rings: ((30, 100, 300), (30,)),
    forests: ((10, 20, 40, 80, 160, 320), (5, 10)),
    standing: ((1,), (1,)),
    slipping: ((3, 4, 6, 8), (3,)),
    short: ((10_000,), (100,)),
}


def measure(quick: bool, only: str | None, say: Callable[[str], None] = print) -> list[dict[str, Any]]:
    """Measure all cases, or one."""
    results = []
    for make, (all_sizes, few) in CASES.items():
        if only not in (None, make.__name__):
            continue
        rows: list[dict[str, Any]] = []
        for row in make(few if quick else all_sizes):
            try:
                rows.append(timed(row, 3 if quick else 5))
            except pn.PinNonidealError as error:
                say(f"  {row.group} {row.size}, {row.what}: {type(error).__name__}: {error}")
                rows.append(failed(row, f"{type(error).__name__}"))
                continue
            shown = ", ".join(f"{name} {1e6 * t:.4g} us" for name, t in rows[-1]["seconds"].items())
            wrong = ", ".join(f"{name} {e:.1e}" for name, e in row.errors.items())
            say(f"  {row.group} {row.size}, {row.what}: {shown}" + (f"; errors {wrong}" if wrong else ""))
        slopes = exponents(rows)
        for group, slope in slopes.items():
            say(f"  {group}: exponent {slope:.2f}")
        about = (make.__doc__ or "").strip()
        results.append({"case": make.__name__, "about": about, "rows": rows, "exponents": slopes})
    return results


def timed(row: Row, rounds: int) -> dict[str, Any]:
    """Return a row with the times of its contestants, and ours over each of the others."""
    times = timing.paired(row.batches, rounds, MIN_RUN if row.what == "evaluation" else LONG_RUN)
    return {
        "group": row.group,
        "size": row.size,
        "what": row.what,
        "seconds": {name: t.best / row.per for name, t in times.items()},
        "ratio": {name: timing.ratio(times[OURS], t) for name, t in times.items() if name != OURS},
        "errors": row.errors,
    }


def failed(row: Row, how: str) -> dict[str, Any]:
    """Return the entry of a row that failed."""
    named = {"group": row.group, "size": row.size, "what": f"{row.what}: {how}"}
    return named | {"seconds": {}, "ratio": {}, "errors": {}}


def exponents(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return the exponents of our cost by group, between the last size and the one nearest to an eighth."""
    found = {}
    for group in dict.fromkeys(row["group"] for row in rows):
        times = {
            row["size"]: row["seconds"][OURS] for row in rows if row["group"] == group and row["seconds"]
        }
        if len(times) < 2:
            continue
        last = max(times)
        first = min((n for n in times if n < last), key=lambda n: abs(math.log(last / n) - math.log(8.0)))
        found[group] = math.log(times[last] / times[first]) / math.log(last / first)
    return found
