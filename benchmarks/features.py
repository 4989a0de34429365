"""Cost of each feature of a scene, added one at a time to the same mechanism, and of inactive features.

The mechanism is the planar five-bar, which still moves if one of its joints sticks.  Steps are rk4 steps with
four evaluations each, which shows the cost of a step beyond its evaluations.  Inactive features are timed
relative to the scene without them.  The cost of an event is measured with chains of hinges that stick and
slip, relative to the same chains with viscous hinges, which have no events.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from . import timing
from .evaluation import compiled_batches, our_batch
from .problems import Problem

DT = 1e-3
STEPS = 200

# Chains of links of 1 m and 1 kg, released horizontally, with hinge friction [N m] or viscosity [N m s].
LINKS = (10, 20, 50, 100)
COULOMB, VISCOUS = 5.0, 1e-3
CHAIN_SECONDS = 1.0


@dataclass(frozen=True)
class Stage:
    """Scene with a feature and all features before it.

    Attributes:
        name: name of the feature.
        scene: scene with the feature.
        settings: settings of the run.
        sticks: whether the last friction element sticks.
    """

    name: str
    scene: pn.Scene
    settings: dict[str, Any] = field(default_factory=dict)
    sticks: bool = False


def five_bar(constraints: list[Any], laws: list[Any], v0: Any = None, **extra: Any) -> pn.Scene:
    """Return the package's five-bar with other constraints and laws; by default its motors counter-rotate."""
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
    """Return the features in the order in which they are added."""
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
    """Run STEPS steps; the cost of a step includes the start and the arrays of the run."""
    return pn.simulate(stage.scene, STEPS * DT, method="rk4", dt=DT, progress=False, **stage.settings)


def evaluation_batch(scene: pn.Scene) -> timing.Batch:
    return our_batch(scene, *scene.initial_state())


def added(rounds: int, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Measure the cost of every stage per evaluation and per step."""
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
    """Measure evaluations of scenes with inactive features, relative to the scene without them."""
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


def chain(links: int, **friction: float) -> pn.Scene:
    """Return a chain from the ground along x; each hinge about y has this friction."""
    model = pin.Model()
    rod = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag([1e-3, 1.0, 1.0]) / 12.0)
    for k in range(links):
        place = pin.SE3(np.eye(3), np.array([float(k > 0), 0.0, 0.0]))
        model.appendBodyToJoint(
            model.addJoint(k, pin.JointModelRY(), place, f"hinge{k}"), rod, pin.SE3.Identity()
        )
    return pn.Scene(model, laws=[pn.JointFriction(name, **friction) for name in model.names[1:]])


def events(quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Measure evaluations and time of an event, without the cost of the steps."""
    rows = []
    for links in LINKS[:2] if quick else LINKS:
        scenes = {"rough": chain(links, coulomb=COULOMB), "smooth": chain(links, viscous=VISCOUS)}
        calls = {name: partial(pn.simulate, s, CHAIN_SECONDS, progress=False) for name, s in scenes.items()}
        rough, smooth = calls["rough"](), calls["smooth"]()
        times = timing.paired(
            {name: timing.per_call(call) for name, call in calls.items()}, 2 if quick else 5
        )
        steps, smooth_steps = (run.stats.steps + run.stats.rejected for run in (rough, smooth))
        own = steps / smooth_steps  # steps relative to the smooth run
        count = len(rough.events)
        evaluations = (rough.stats.evaluations - own * smooth.stats.evaluations) / count
        seconds = (times["rough"].best - own * times["smooth"].best) / count
        step = times["smooth"].best / smooth_steps
        rows.append(
            {"links": links, "events": count, "evaluations": evaluations, "time": seconds, "step": step}
        )
        say(f"  {links} links: {count} events of {evaluations:.1f} evaluations, {seconds * 1e6:.0f} us each")
    return rows


def measure(quick: bool, say: Callable[[str], None] = print) -> dict[str, Any]:
    """Measure the cost of features, of inactive features and of events."""
    rounds = 10 if quick else 60
    return {"added": added(rounds, say), "absent": absent(rounds, say), "events": events(quick, say)}
