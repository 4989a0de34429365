"""What each feature of a scene costs, added one at a time to the same mechanism, and what absent ones cost.

The mechanism is the planar five-bar, which still moves when one of its joints sticks.  Steps are steps of
rk4, four evaluations each, so that what a step needs beside them shows.  What is absent, or stated and never
acts, is timed beside the scene without it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

import pin_nonideal as pn

from . import timing
from .evaluation import compiled_batches, our_batch
from .problems import Problem

DT = 1e-3
STEPS = 200


@dataclass(frozen=True)
class Stage:
    """A scene with a feature and all before it.

    Attributes:
        name: of the feature.
        scene: with it.
        settings: of the run.
        sticks: whether its last frictional element sticks.
    """

    name: str
    scene: pn.Scene
    settings: dict[str, Any] = field(default_factory=dict)
    sticks: bool = False


def five_bar(constraints: list[Any], laws: list[Any], v0: Any = None, **extra: Any) -> pn.Scene:
    """The package's five-bar with other constraints and laws; its motors turn against each other."""
    base = pn.load("five_bar")
    q0, _ = base.initial_state()
    if v0 is None:
        v0 = np.zeros(base.model.nv)
        v0[[place(base.model, "motor1"), place(base.model, "motor2")]] = 1.0, -0.5
    return pn.Scene(base.model, constraints=constraints, laws=laws, q0=q0, v0=v0, **extra)


def place(model: Any, joint: str) -> int:
    return int(model.joints[model.getJointId(joint)].idx_v)


def the_loop() -> Any:
    return pn.load("five_bar").constraints[0]


def stages() -> list[Stage]:
    """Features in the order in which they are added."""
    loop = the_loop()
    viscous = pn.JointFriction("elbow1", viscous=0.003, name="elbow 1")
    coulomb = replace(viscous, coulomb=1e-3)
    loaded = replace(coulomb, mu=0.05, radius=0.005)
    holding = pn.JointFriction("motor2", coulomb=100.0, name="motor 2")
    moving = five_bar([loop], [])
    angle = float(moving.initial_state()[0][place(moving.model, "motor2")])
    still = five_bar([loop, pn.PrescribedMotion("motor2", pn.constant(angle))], []).initial_state()[1]
    stuck = five_bar([loop], [loaded, holding], still)
    return [
        Stage("open chains, nothing else", five_bar([], [])),
        Stage("+ loop (2 rows)", five_bar([loop], [])),
        Stage("+ viscous law", five_bar([loop], [viscous])),
        Stage("+ Coulomb law", five_bar([loop], [coulomb])),
        Stage("+ load dependence", five_bar([loop], [loaded])),
        Stage("+ sticking element", stuck, sticks=True),
        Stage("+ recording of forces", stuck, {"record": ("forces",)}, True),
        Stage("+ energy ledger", stuck, {"record": ("forces", "energy")}, True),
    ]


def run(stage: Stage) -> pn.Trajectory:
    """A run of STEPS steps; its start and its arrays count as part of the steps."""
    return pn.simulate(stage.scene, STEPS * DT, method="rk4", dt=DT, progress=False, **stage.settings)


def evaluation_batch(scene: pn.Scene) -> timing.Batch:
    return our_batch(scene, *scene.initial_state())


def added(rounds: int, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Cost of every stage per evaluation and per step."""
    found = stages()
    for stage in found:
        modes = run(stage).modes
        if stage.sticks and (modes is None or (modes[:, -1] != 0).any()):
            raise RuntimeError(f"{stage.name}: the joint that should stick moves")
    evaluations = timing.paired({s.name: evaluation_batch(s.scene) for s in found}, rounds)
    runs = timing.paired({s.name: timing.per_call(partial(run, s)) for s in found}, rounds)
    rows = []
    for stage in found:
        evaluation, step = evaluations[stage.name].best, runs[stage.name].best / STEPS
        rows.append({"feature": stage.name, "evaluation": evaluation, "step": step})
        say(f"  {stage.name:26} {evaluation * 1e6:6.2f} us an evaluation, {step * 1e6:6.2f} a step")
    return rows


def absent(rounds: int, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Evaluations of scenes that state what never acts, over those of the scene without it."""
    loop = the_loop()
    plain = five_bar([loop], [])
    idle = {
        "third row of the planar loop": five_bar([replace(loop, axes="xyz")], []),
        "the loop stated twice": five_bar([loop, replace(loop, name="again")], []),
        "torques that are zero": five_bar([loop], [], actuation=np.zeros(plain.model.nv)),
    }
    batches = {"": evaluation_batch(plain)} | {name: evaluation_batch(s) for name, s in idle.items()}
    times = timing.paired(batches, rounds)
    rows = [
        {"absent": name, "against": "the scene without it", "ratio": timing.ratio(times[name], times[""])}
        for name in idle
    ]
    free = five_bar([], [])
    q0, v0 = free.initial_state()
    case = Problem(name="five_bar", title="", model=free.model, q0=q0, v0=v0, duration=0.0)
    times = timing.paired({"": evaluation_batch(free), **compiled_batches(case)}, rounds)
    peers = [name for name in times if name]
    if peers:
        best = min(peers, key=lambda name: times[name].best)
        ratio = timing.ratio(times[""], times[best])
        rows.append({"absent": "constraints and laws", "against": best, "ratio": ratio})
    for row in rows:
        say(f"  {row['absent']}: {row['ratio']:.2f} of {row['against']}")
    return rows


def measure(quick: bool, say: Callable[[str], None] = print) -> dict[str, Any]:
    """What features add, and what absent ones cost."""
    rounds = 10 if quick else 60
    return {"added": added(rounds, say), "absent": absent(rounds, say)}
