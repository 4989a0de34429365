"""Records of a run by the name of a joint, frame, constraint, contact or law."""

from __future__ import annotations

import functools

import numpy as np
import pinocchio as pin

from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.joint_layout import COS_SIN_JOINTS
from pin_nonideal.states.kinematics import frame_motion
from pin_nonideal.types import Array
from pin_nonideal.validation import choice, text

from .fields import RunFields, reactions_of
from .frame_reaction import carrier_of, frame_reaction
from .missing_array import NOT_RECORDED, REASONS, missing_array
from .records import FrameRecord, JointRecord, LawRecord, angles


def joint_record(run: RunFields, name: str) -> JointRecord:
    """Return the record of one joint; see `Trajectory.joint`."""
    name = text("joint: name", name)
    floating = [place for place in run.joints if place.kind == "JointModelFreeFlyer"]
    known = {"base": floating[0]} if len(floating) == 1 else {}
    known |= {place.name: place for place in run.joints}
    if name not in known:
        raise UnknownNameError(f'no joint "{name}" in this run{nearest(name, known)}')
    place = known[name]
    rates = slice(place.v_first, place.v_first + place.nv)
    v, owner = run.v[:, rates], f'run.joint("{name}")'
    a = run.a[:, rates] if run.recorded("a") else missing_array(f"{owner}.a", REASONS["a"])
    tau = run.tau[:, rates] if run.recorded("tau") else missing_array(f"{owner}.tau", REASONS["tau"])
    q = run.q[:, place.q_first : place.q_first + place.nq]
    if place.kind.startswith(COS_SIN_JOINTS):
        q = np.column_stack([q[:, :-2], angles(q[:, -2:], v[:, -1], run.t)])
    is_scalar = place.nv == 1 and q.shape[1] == 1
    parts = [x[:, 0] if is_scalar and isinstance(x, np.ndarray) else x for x in (q, v, a, tau)]
    return JointRecord(place.name, *parts)


def frame_record(run: RunFields, name: str) -> FrameRecord:
    """Return the record of one frame; see `Trajectory.frame`."""
    name = text("frame: name", name)
    if run.scene is None:
        raise InputError(f'frame("{name}") needs the scene of the run, which this one has lost')
    model = run.scene.model
    known = [str(f.name) for f in model.frames] + [str(n) for n in model.names]
    if name not in known:
        raise UnknownNameError(f'no frame "{name}" in model "{model.name}"{nearest(name, known)}')
    return FrameRecord(name, *frame_motion(model, name, run.q, run.v))


def force_of(run: RunFields, name: str) -> Array:
    """Return the force of one constraint or contact; see `Trajectory.force`."""
    name = text("force: name", name)
    if name not in run.rows:
        raise UnknownNameError(f'no constraint or contact "{name}" in this run{nearest(name, run.rows)}')
    first, end, contact = run.rows[name]
    if contact:
        force: Array = reaction_of(run, name, "world")[:, :3]
        return force
    if not run.recorded("lam"):
        raise InputError(f'force("{name}") needs a run with record="forces"')
    multipliers: Array = run.lam[:, first:end]
    return multipliers


def law_record(run: RunFields, name: str) -> LawRecord:
    """Return the record of one law; see `Trajectory.law`."""
    name = text("law: name", name)
    if name not in run.law_names:
        raise UnknownNameError(f'no law "{name}" in this run{nearest(name, run.law_names)}')
    index, owner = run.law_names.index(name), f'run.law("{name}")'
    force = missing_array(f"{owner}.force", NOT_RECORDED.format('"laws"'))
    power = missing_array(f"{owner}.power", NOT_RECORDED.format('"laws" or "power"'))
    if run.law_forces:
        force = np.zeros(run.v.shape)
        force[:, run.law_dofs[index]] = run.law_forces[name]
        power = np.einsum("ij,ij->i", force, run.v)
    if run.power:  # after three columns of the scene
        power = list(run.power.values())[len(run.power) - len(run.law_names) + index]
    elements = [e for e, law in enumerate(run.element_laws) if law == index]
    columns = elements[0] if len(elements) == 1 else elements
    limit = missing_array(f"{owner}.limit", REASONS["limits"]) if elements else None
    if elements and run.recorded("limits"):
        limit = run.limits[:, columns]
    mode = run.modes[:, columns] if elements and run.modes is not None else None
    return LawRecord(name, force, power, limit, mode, functools.partial(_slip_velocity, run, elements))


def _slip_velocity(run: RunFields, elements: list[int]) -> Array | None:
    """Return the slip velocities of some friction elements, (nt,) or (nt, n), or None without any."""
    if run.scene is None or not elements:
        return None
    compiled = compiled_scene(run.scene)
    program, points = compiled.program, compiled.elements.index
    elements = [e for e in range(len(points)) if points[e] in elements]
    runner, ends = program.runner(), np.cumsum(program.element_sizes)
    chosen = [row for e in elements for row in range(ends[e] - program.element_sizes[e], ends[e])]
    states = zip(run.q, run.v, run.t, strict=True)
    found = np.array(
        [runner.slip_rows(q, v, float(t)).reshape(-1, len(v))[chosen] @ v for q, v, t in states]
    ).reshape(len(run.t), len(chosen))
    return found[:, 0] if len(chosen) == 1 else found


def reaction_of(run: RunFields, name: str, axes: str) -> Array:
    """Return the wrench of a joint, anchor or contact; see `Trajectory.reaction`."""
    name = text("reaction: name", name)
    if not reactions_of(run).recorded:
        raise InputError(f'reaction("{name}") needs a run with record="reactions"')
    begin = 6 * ("own", "world").index(choice("reaction: axes", axes, ("own", "world")))
    wrench: Array = _wrenches(run, name)[:, begin : begin + 6]
    return wrench


def _wrenches(run: RunFields, name: str) -> Array:
    """Wrenches of a joint, anchor or contact as recorded, or those through a fixed joint or frame."""
    if name in reactions_of(run):
        recorded: Array = reactions_of(run)[name]
        return recorded
    model = None if run.scene is None else run.scene.model
    if model is None or name == "universe" or not model.existFrame(name):
        frames = [] if model is None else [str(f.name) for f in model.frames][1:]
        known = [*reactions_of(run), *frames]
        explanation = (
            "" if model is not None else "; fixed joints need the scene of the run, which this one has lost"
        )
        raise UnknownNameError(
            f'no joint, frame, anchor or contact "{name}"{nearest(name, known)}{explanation}'
        )
    index = carrier_of(model, name)
    if model.frames[index].type == pin.FrameType.JOINT:
        of_joint: Array = reactions_of(run)[str(model.frames[index].name)]
        return of_joint
    if not run.recorded("a"):
        raise InputError(f'reaction("{name}") of a fixed joint needs a run with record=("a", "reactions")')
    return frame_reaction(run, name, index)
