"""Mechanisms of one scene that share nothing: each takes its own steps, and the run puts them together.

An event of dry friction ends a step.  Where mechanisms that share neither joint, row nor load stepped
together, each of them would stop at the events of all, and the cost of a run would grow with the square of
their number.  They are found once a scene; each is a scene of its own, whose run is that of it alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.actuation import HoldPosition
from pin_nonideal.constraints import (
    Distance,
    FrameAnchor,
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
)
from pin_nonideal.core import core
from pin_nonideal.dense import DenseOutput, barycentric, dense_output
from pin_nonideal.forces import JointSpring, SpringDamper, Wrench
from pin_nonideal.laws import Drag, JointFriction, SigmoidFriction
from pin_nonideal.scene import Scene
from pin_nonideal.types import Array, Model

from .options import METHODS, SCIPY, RunOptions

Indices = NDArray[np.intp]
# What acts on the bodies that it names and on no other.
LOCAL = (
    *(PointAnchor, FrameAnchor, HingeAnchor, Distance, JointCoupling, PrescribedMotion, KnifeEdge),
    *(JointFriction, SigmoidFriction, Drag, SpringDamper, JointSpring, Wrench),
)
PLACES = ("frame", "frame1", "frame2", "joint", "joint1", "joint2")
COUNTERS = ("steps", "rejected", "evaluations", "factorizations", "projections", "iterations", "limited")


@dataclass(frozen=True, eq=False)
class Component:
    """A mechanism of a scene that shares nothing with the others.

    Attributes:
        scene: it alone.
        q: where its configuration stands in that of the whole, (nq,).
        v: its velocity, (nv,).
        elements: its frictional elements, (ne,).
        works: its columns of work.
    """

    scene: Scene
    q: Indices
    v: Indices
    elements: Indices
    works: Indices


class JoinedEvent(NamedTuple):
    """An event of one component, by the numbers of the whole."""

    time: float
    kind: core.EventKind
    element: int
    of_contact: bool = False


# --- Components of a scene ----------------------------------------------------------------------------------


def components(scene: Scene) -> list[Component]:
    """The mechanisms of a scene, where there are several and dry friction makes events; none otherwise.

    Args:
        scene: the whole.
    """
    found: list[Component] | None = scene.__dict__.get("_components")
    if found is None:
        found = scene.__dict__["_components"] = _components(scene)
    return found


def _components(scene: Scene) -> list[Component]:
    model, program = scene.model, scene._compiled.program
    held = scene.actuation
    by_position = isinstance(held, HoldPosition) and np.ndim(held.kp) == 0 and np.ndim(held.kd) == 0
    said = [*scene.constraints, *scene.laws, *scene.forces]
    whole = (
        not scene.element_names
        or program.states
        or scene.contacts
        or not (held is None or by_position)
        or any(type(one) not in LOCAL for one in said)
        or sum(parent == 0 for parent in list(model.parents)[1:]) < 2
    )
    if whole:
        return []
    tree = _trees(model)
    anchors = dict(zip(scene.constraint_slices, scene.constraints, strict=False))
    touched = [_touched(one, model, tree, anchors) for one in said]
    group = {root: root for root in tree[1:]}
    for roots in touched:
        joined = {group[root] for root in roots}
        group = {root: min(joined) if of in joined else of for root, of in group.items()}
    if len(set(group.values())) < 2 or not all(touched):
        return []
    own = [group[min(roots)] for roots in touched]
    return [
        _component(scene, said, own, [group.get(root) for root in tree], of)
        for of in sorted(set(group.values()))
    ]


def _trees(model: Model) -> list[int]:
    """The joint at the root of each joint's tree."""
    tree = [0]
    for joint, parent in enumerate(list(model.parents)[1:], 1):
        tree.append(tree[parent] if parent else joint)
    return tree


def _touched(one: Any, model: Model, tree: Sequence[int], anchors: dict[str, Any]) -> set[int]:
    """Roots of the trees that a description acts on."""
    roots: set[int] = set()
    for place in (f.name for f in fields(one) if f.name in PLACES):
        name = getattr(one, place)
        if name is None:
            continue
        if place.startswith("joint") and model.existJointName(name):
            roots.add(tree[model.getJointId(name)])
        elif model.existFrame(name):
            roots.add(tree[model.frames[model.getFrameId(name)].parentJoint])
        elif is_dataclass(anchors.get(name)):
            roots |= _touched(anchors[name], model, tree, {})
    return roots - {0}


def _component(
    scene: Scene, said: Sequence[Any], own: Sequence[int], group: Sequence[int | None], of: int
) -> Component:
    joints = [joint for joint, each in enumerate(group) if each == of]
    model, q, v = _alone(scene.model, joints)
    mine = [one for one, each in zip(said, own, strict=True) if each == of]
    held = scene.actuation
    if isinstance(held, HoldPosition) and held.q is not None:
        held = replace(held, q=np.asarray(held.q)[q])
    alone = Scene(
        model,
        constraints=[one for one in mine if any(one is each for each in scene.constraints)],
        laws=[one for one in mine if any(one is each for each in scene.laws)],
        forces=[one for one in mine if any(one is each for each in scene.forces)],
        actuation=held,
        q0=scene.q0[q],
        v0=scene.v0[v],
        name=scene.name,
        terms=scene.terms,
        assembly_tolerance=scene._assembly_tolerance,
    )
    elements = [scene.element_names.index(name) for name in alone.element_names]
    powers = scene._compiled.program.power_names
    works = [powers.index(name) for name in alone._compiled.program.power_names]
    return Component(alone, q, v, np.array(elements, dtype=np.intp), np.array(works, dtype=np.intp))


def _alone(model: Model, joints: Sequence[int]) -> tuple[Model, Indices, Indices]:
    """Some trees of a model as a model, and where its coordinates stand in the whole."""
    alone, number = pin.Model(), {0: 0}
    alone.name, alone.gravity = model.name, model.gravity
    q: list[int] = []
    v: list[int] = []
    for joint in joints:
        kind = model.joints[joint]
        at_q, at_v = slice(kind.idx_q, kind.idx_q + kind.nq), slice(kind.idx_v, kind.idx_v + kind.nv)
        number[joint] = alone.addJoint(
            number[model.parents[joint]], kind, model.jointPlacements[joint], model.names[joint]
        )
        alone.appendBodyToJoint(number[joint], model.inertias[joint], pin.SE3.Identity())
        mine = alone.joints[number[joint]]
        to_q, to_v = slice(mine.idx_q, mine.idx_q + mine.nq), slice(mine.idx_v, mine.idx_v + mine.nv)
        for name in ("lowerPositionLimit", "upperPositionLimit"):
            getattr(alone, name)[to_q] = getattr(model, name)[at_q]
        for name in ("armature", "rotorInertia", "rotorGearRatio", "damping", "friction"):
            if hasattr(model, name):
                getattr(alone, name)[to_v] = getattr(model, name)[at_v]
        q.extend(range(at_q.start, at_q.stop))
        v.extend(range(at_v.start, at_v.stop))
    for frame in list(model.frames)[1:]:
        if frame.parentJoint in number and not alone.existFrame(frame.name, frame.type):
            joint = number[frame.parentJoint]
            alone.addFrame(pin.Frame(frame.name, joint, 0, frame.placement, frame.type), False)
    return alone, np.array(q, dtype=np.intp), np.array(v, dtype=np.intp)


# --- Their runs ---------------------------------------------------------------------------------------------


def stepped_apart(scene: Scene, options: RunOptions) -> list[Component]:
    """The components that take their own steps in a run; none where all step together.

    Args:
        scene: what runs.
        options: of the run.
    """
    apart = METHODS[options.method] and options.method not in SCIPY and not options.event_names
    return components(scene) if apart and options.max_steps == 0 and options.max_wall == 0.0 else []


def run_together(scene: Scene, q0: Array, v0: Array, options: RunOptions, **more: Any) -> core.Outcome:
    """A run of all mechanisms in common steps, in a workspace that an earlier run of the scene has left.

    Args:
        scene: what runs.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        options: of the run.
        **more: what the core takes beside.
    """
    idle: list[core.Runner] = scene.__dict__.setdefault("_idle_runners", [])
    try:
        runner = idle.pop()
    except IndexError:  # the first run, or others are under way
        runner = scene._compiled.program.runner()
    outcome = runner.simulate(q0, v0, options, **more)
    idle.append(runner)
    return outcome


def run_apart(
    scene: Scene,
    parts: Sequence[Component],
    q0: Array,
    v0: Array,
    options: RunOptions,
    tick: Callable[[float], None] | None,
) -> core.Outcome | None:
    """Runs each component alone and puts their motions together; None where one of them fails.

    Args:
        scene: the whole.
        parts: its components.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        options: of the run.
        tick: is told the time, or None.
    """
    outcomes = []
    for k, part in enumerate(parts):
        own = _options_of(part, options, len(v0))
        told = _after(tick, k, len(parts), options)
        outcome = run_together(part.scene, q0[part.q], v0[part.v], own, tick=told)
        stopped = outcome.stopped
        if isinstance(stopped, core.CoreFailure):
            return None
        if stopped is not None:
            return _joined(scene, [], [], options, stopped)
        outcomes.append(outcome)
    return _joined(scene, parts, outcomes, options)


def roll_apart(
    scene: Scene, parts: Sequence[Component], q0: Array, v0: Array, options: RunOptions, threads: int
) -> list[core.Outcome | None]:
    """What `run_apart` gives for each of many states, on several threads.

    Args:
        scene: the whole.
        parts: its components.
        q0: initial configurations, (n, nq).
        v0: initial velocities, (n, nv).
        options: of the runs.
        threads: how many.
    """
    of_parts = []
    for part in parts:
        states = (np.ascontiguousarray(q0[:, part.q]), np.ascontiguousarray(v0[:, part.v]))
        own = _options_of(part, options, v0.shape[1])
        program = part.scene._compiled.program
        of_parts.append(core.rollout(program, *states, own, threads, [], np.zeros((len(q0), 0))))
    results: list[core.Outcome | None] = []
    for k, outcomes in enumerate(zip(*of_parts, strict=True)):
        if all(one is not None and one.stopped is None for one in outcomes):
            results.append(_joined(scene, parts, cast(list[core.Outcome], outcomes), options))
        else:  # together, which tells what stops them
            program = scene._compiled.program
            results += core.rollout(program, q0[k : k + 1], v0[k : k + 1], options, 1, [], np.zeros((1, 0)))
    return results


def _options_of(part: Component, options: RunOptions, nv: int) -> RunOptions:
    atol = np.concatenate([options.atol[part.v], options.atol[nv + part.v]])
    silent = replace(options, a=False, forces=False, power=False, laws=False, reactions=False, tau=False)
    return replace(silent, atol=atol, dense=True)


def _after(
    tick: Callable[[float], None] | None, k: int, n: int, options: RunOptions
) -> Callable[[float], None] | None:
    """The time told by the k-th of n runs, as a part of all of them."""
    if tick is None:
        return None
    t0, duration = options.t0, options.duration
    return lambda t: tick(t0 + (k * duration + t - t0) / n)


# --- Put together -------------------------------------------------------------------------------------------


def _joined(
    scene: Scene,
    parts: Sequence[Component],
    outcomes: Sequence[core.Outcome],
    options: RunOptions,
    stopped: BaseException | None = None,
) -> core.Outcome:
    """The outcome of the whole, with samples on the asked grid and at all events.

    Without a grid they are at the steps of the component that takes most.
    """
    dense = [
        dense_output(one, options, part.v.size, part.elements.size)
        for one, part in zip(outcomes, parts, strict=True)
    ]
    events = sorted(
        (
            JoinedEvent(event.time, event.kind, int(part.elements[event.element]))
            for one, part in zip(outcomes, parts, strict=True)
            for event in one.events
        ),
        key=lambda event: event.time,
    )
    if options.output_dt:
        times = [one.t for one in outcomes]
    else:
        times = [
            max((one.t for one in outcomes), key=len, default=np.zeros(0)),
            np.array([e.time for e in events]),
        ]
    t = np.unique(np.concatenate(times or [np.zeros(0)]))
    motion = _motion(scene, parts, dense, t)
    joined = SimpleNamespace(**_samples(scene, options, t, *motion))
    for name in COUNTERS:
        setattr(joined, name, sum(getattr(one, name) for one in outcomes))
    joined.rounding = max((one.rounding for one in outcomes), default=0.0)
    joined.events, joined.stopped = events, stopped
    if options.dense:
        _join_dense(scene, parts, dense, joined)
    return cast(core.Outcome, joined)


Motion = tuple[Array, Array, Array, Array]  # states, modes, directions, moved


def _motion(scene: Scene, parts: Sequence[Component], dense: Sequence[DenseOutput], t: Array) -> Motion:
    """States of the whole at some times, with the modes, directions of slip and moved energy there."""
    nq, nv, ne = scene.model.nq, scene.model.nv, len(scene.element_names)
    work = dense[0].states.shape[2] - parts[0].q.size - parts[0].v.size if dense else 0
    columns = len(scene._compiled.program.power_names) if work else 0
    states, modes = np.zeros((t.size, nq + nv + columns)), np.zeros((t.size, ne))
    directions, moved = np.zeros((t.size, ne, 3)), np.zeros(t.size)
    for part, one in zip(parts, dense, strict=True):
        step = np.clip(np.searchsorted(one.times[:, 0], t, side="right") - 1, 0, len(one) - 1)
        begin, end = one.times[step].T
        at = (t - begin) / (end - begin)
        own = np.einsum("kp,kps->ks", barycentric(at, one.states.shape[1]), one.states[step])
        first, last = part.q.size, part.q.size + part.v.size
        states[:, part.q], states[:, nq + part.v] = own[:, :first], own[:, first:last]
        if columns:
            states[:, nq + nv + part.works] += own[:, last:]
        modes[:, part.elements] = one.modes[step]
        directions[:, part.elements] = one.directions[step].reshape(t.size, -1, 3)
        before = np.concatenate([[0.0], one.moved])[step]
        moved += before + at * (one.moved[step] - before)
    return states, modes, directions.reshape(t.size, -1), moved


def _samples(
    scene: Scene, options: RunOptions, t: Array, states: Array, modes: Array, directions: Array, moved: Array
) -> dict[str, Any]:
    """The samples as the core has them: evaluated where more than the state of a tree is asked for."""
    program, (nq, nv) = scene._compiled.program, (scene.model.nq, scene.model.nv)
    asked = (
        options.a,
        options.tau,
        options.forces,
        options.laws,
        options.reactions,
        options.power,
        options.energy,
    )
    evaluated = any(asked) or program.rows or nq != nv
    k, none = t.size if evaluated else 0, np.zeros((0, nv))
    held = (modes[:k], directions[:k], none, moved[:k])
    inside = core.sample_inside(program, options, t[:k], states[:k], *held)
    samples = {name: getattr(inside, name) for name in dir(core.Outcome) if not name.startswith("_")}
    if evaluated:
        return samples
    return samples | {
        "t": t,
        "q": np.ascontiguousarray(states[:, :nq]).ravel(),
        "v": np.ascontiguousarray(states[:, nq : nq + nv]).ravel(),
        "violation": np.zeros(t.size),
        "violation_rate": np.zeros(t.size),
        "modes": modes.astype(np.int8).ravel(),
    }


def _join_dense(
    scene: Scene, parts: Sequence[Component], dense: Sequence[DenseOutput], joined: SimpleNamespace
) -> None:
    """Interpolants between all steps of all components: the polynomials of each, on shorter stretches."""
    ends = np.unique(np.concatenate([one.times.ravel() for one in dense]))
    points = dense[0].states.shape[1]
    part = 0.5 * (1.0 - np.cos(np.pi * np.arange(points) / (points - 1)))
    stretches = np.stack([ends[:-1], ends[1:]], axis=1)
    # Inside, so that the ends of a stretch belong to it.
    inside = np.clip(part, 1e-9, 1.0 - 1e-9)
    t = (stretches[:, :1] + inside * np.diff(stretches, axis=1)).ravel()
    states, modes, directions, _ = _motion(scene, parts, dense, t)
    joined.dense_times, joined.dense_states = stretches.ravel(), states.ravel()
    joined.dense_modes = modes[::points].astype(np.int8).ravel()
    joined.dense_directions = directions[::points].ravel()
    joined.dense_torque = np.zeros(0)
    joined.dense_moved = _motion(scene, parts, dense, ends[1:])[3]
