"""Wrench through a fixed joint or frame: the load that the part beyond it receives.

Pinocchio merges the links of fixed joints into the body of a moving joint. The frame of a fixed joint keeps
the inertia of its link. Frames are in order from parent to child. The part beyond a frame consists of the
frames that descend from it on its body, and of the moving joints that they carry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pin_nonideal.errors import InputError
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.kinematics import BodyMotions, frame_index
from pin_nonideal.types import Array, GeometryModel, Model

from .body_loads import Load, about_world, loads_on_bodies
from .fields import RunFields, reactions_of

# Tolerance of the sum of the forces on a body against its recorded reaction, relative to these forces.
FORCE_BALANCE_TOL = 1e-6
# The same tolerance if forces cancel, as in free fall, relative to the weight of the mechanism.
WEIGHT_BALANCE_TOL = 1e-9
# Minimum eigenvalue of the remaining inertia of a body without its frames, relative to the inertia of the
# body.
MIN_INERTIA_EIGENVALUE = -1e-9
JOINT_FRAME_TYPES = (pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)


@dataclass(frozen=True, eq=False)
class Part:
    """Part of a mechanism beyond a frame, or beyond a moving joint.

    Attributes:
        joint: index of the joint that moves the body of the part.
        inertia: inertia of the part of this body, in the joint frame.
        children: indices of the joints on the part.
        loads: loads on the part.
    """

    joint: int
    inertia: pin.Inertia
    children: list[int]
    loads: list[Load]


def carrier_of(model: Model, name: str) -> int:
    """Return the index of a frame, or for the frame of a link the index of the joint frame that carries it.

    Args:
        model: pinocchio.Model.
        name: name of a frame.
    """
    index = frame_index(model, name)
    frame = model.frames[index]
    carrier = int(frame.parentFrame)
    if frame.type == pin.FrameType.BODY and carrier and model.frames[carrier].type in JOINT_FRAME_TYPES:
        return carrier
    return index


def frame_reaction(run: RunFields, name: str, index: int) -> Array:
    """Compute the wrench through a frame at all samples, in its own axes and in world axes, (nt, 12).

    The wrench is Y a + v x* Y v of the part of the body beyond the frame, plus reactions of the joints on
    this part, minus loads on it. The acceleration a is relative to free fall.

    Args:
        run: the Trajectory, with reactions and accelerations.
        name: name of the frame, for messages.
        index: index of the frame.

    Raises:
        InputError: the model or the scene does not determine the part beyond the frame, or masses or gravity
            of the run differ from those of its scene.
    """
    who = f'reaction("{name}")'
    model = run.scene.model
    joint, place = int(model.frames[index].parentJoint), model.frames[index].placement
    loads = [load for load in loads_on_bodies(run) if load.joint == joint]
    children = [c for c in range(1, model.njoints) if model.parents[c] == joint]
    held = [c for c in children if _child_beyond(model, c, index, who)]
    own_loads = [load for load in loads if _load_beyond(run.scene, load, index, who)]
    part = Part(joint, _inertia_beyond(model, index, who), held, own_loads)
    bodies = [_whole_body(model, joint, loads)] if joint else []
    if not joint:  # the universe has no reaction; its children show the same masses and gravity
        bodies = [_whole_body(model, child, _on(run, child)) for child in part.children]
    accelerations = run.a
    wrenches = np.empty((len(run.t), 12))
    for k in range(len(run.t)):
        motions = BodyMotions(model, run.q[k], run.v[k], accelerations[k])
        for body in bodies:
            _require_balance(run, k, motions, body, who)
        wrench = place.actInv(_balance(run, k, motions, part)[0])
        R = motions.placement(joint).rotation @ place.rotation
        wrenches[k] = np.concatenate([wrench.linear, wrench.angular, R @ wrench.linear, R @ wrench.angular])
    return wrenches


def _balance(run: RunFields, k: int, motions: BodyMotions, part: Part) -> tuple[pin.Force, float]:
    """Return the wrench on a part from its neighbor, in the joint frame, and its scale for rounding.

    The scale is the sum of the largest components of all terms.
    """
    velocity, acceleration = motions.velocity(part.joint), motions.acceleration(part.joint)
    terms = [part.inertia * acceleration, velocity.cross(part.inertia * velocity)]
    to_body = motions.placement(part.joint)
    for child in part.children:
        wrench = reactions_of(run)[str(run.scene.model.names[child])][k, 6:]
        terms.append(to_body.actInv(about_world(wrench, motions.placement(child).translation)))
    terms += [-to_body.actInv(load.at(k, motions)) for load in part.loads]
    return sum(terms, pin.Force.Zero()), sum(float(np.abs(term.vector).max()) for term in terms)


def _require_balance(run: RunFields, k: int, motions: BodyMotions, body: Part, who: str) -> None:
    """Check that the loads on a whole body add up to the recorded reaction of its joint.

    Raises:
        InputError: they do not.
    """
    name = str(run.scene.model.names[body.joint])
    balance, size = _balance(run, k, motions, body)
    recorded = reactions_of(run)[name][k, :6]
    missed = float(np.abs(balance.vector - recorded).max())
    model = run.scene.model
    whole = sum(Y.mass for Y in model.inertias) * float(np.linalg.norm(model.gravity.linear))
    whole += max(float(np.abs(wrench[k]).max()) for wrench in reactions_of(run).values())
    if missed > FORCE_BALANCE_TOL * (size + float(np.abs(recorded).max())) + WEIGHT_BALANCE_TOL * whole:
        raise InputError(
            f"{who}: masses and gravity of the run must be those of its scene; the loads on the body of "
            f'joint "{name}" miss its recorded reaction by {missed:.2g} (N or N m) at t = {run.t[k]:.4g} s; '
            "with parameters of a rollout, make a scene for each run instead"
        )


def _whole_body(model: Model, joint: int, loads: list[Load]) -> Part:
    """Return the body of a joint with all that it carries."""
    children = [c for c in range(1, model.njoints) if model.parents[c] == joint]
    return Part(joint, model.inertias[joint], children, loads)


def _on(run: RunFields, joint: int) -> list[Load]:
    return [load for load in loads_on_bodies(run) if load.joint == joint]


def _is_beyond(model: Model, frame: int, index: int) -> bool | None:
    """Check if a frame lies beyond another frame of its body; None if the order of frames is unclear."""
    joint, passed = model.frames[index].parentJoint, set()
    before = _ancestors(model, index)
    while frame != index:
        if frame in before:
            return False
        if frame == 0:
            return None
        at = model.frames[frame]
        if at.parentJoint == joint and at.type == pin.FrameType.JOINT:
            return False
        passed.add(frame)
        frame = int(at.parentFrame)
        if frame in passed:
            return None
    return True


def _ancestors(model: Model, index: int) -> set[int]:
    """Return the frames of the same body from which a frame descends."""
    joint, ancestors, frame = model.frames[index].parentJoint, set(), int(model.frames[index].parentFrame)
    while frame not in ancestors and frame != index and model.frames[frame].parentJoint == joint:
        ancestors.add(frame)
        frame = int(model.frames[frame].parentFrame)
    return ancestors


def _inertia_beyond(model: Model, index: int, who: str) -> pin.Inertia:
    """Return the inertia of the frames beyond a frame of a body, in the joint frame.

    Raises:
        InputError: the model has no such inertia.
    """
    frame = model.frames[index]
    locked = int(frame.parentFrame) == index and index != 0  # the sign of pinocchio.buildReducedModel
    total = pin.Inertia.Zero()
    for i, each in enumerate(model.frames):
        if each.parentJoint != frame.parentJoint:
            continue
        is_beyond = _is_beyond(model, i, index)
        if is_beyond is None and each.inertia.mass > 0.0:
            raise InputError(
                f'{who}: the model must show on which side of the frame link "{each.name}" lies; its parent '
                "frame leads to no joint, as behind a joint that was locked; keep that joint free, or hold "
                "it by a PrescribedMotion"
            )
        # The frame of a locked joint has the inertia of all links of the joint.
        if is_beyond and (i == index or not locked):
            total += each.placement.act(each.inertia)
    links = any(f.type == pin.FrameType.BODY and f.parentFrame == index for f in model.frames)
    if total.mass == 0.0 and not (frame.type == pin.FrameType.FIXED_JOINT and links):
        raise InputError(
            f"{who}: the model must give the inertia beyond the frame; it has only the inertia of "
            f'the whole body of joint "{model.names[frame.parentJoint]}"; make the frame a fixed joint with '
            "a link"
        )
    if frame.parentJoint == 0:  # the world has no inertia of its own
        return total
    body = model.inertias[frame.parentJoint].toPseudoInertia().toMatrix()
    left = np.linalg.eigvalsh(body - total.toPseudoInertia().toMatrix())
    if left[0] < MIN_INERTIA_EIGENVALUE * float(np.abs(body).max()):
        raise InputError(
            f"{who}: the inertia beyond the frame ({total.mass:.6g} kg) must be part of the inertia of its "
            f"body ({model.inertias[frame.parentJoint].mass:.6g} kg), and is not; the inertia of joint "
            f'"{model.names[frame.parentJoint]}" was changed after its links were merged'
        )
    return total


def _child_beyond(model: Model, child: int, index: int, who: str) -> bool:
    """Check if a joint on the body of a frame lies beyond it.

    Raises:
        InputError: the model does not determine the side.
    """
    name = str(model.names[child])
    is_beyond = None
    if model.existFrame(name, pin.FrameType.JOINT):
        is_beyond = _is_beyond(model, int(model.getFrameId(name, pin.FrameType.JOINT)), index)
    if is_beyond is None:
        raise InputError(
            f'{who}: the model must show on which side of the frame joint "{name}" lies; its joint frame has '
            "no parent frame on this body; add it by model.addJointFrame(joint, parent_frame)"
        )
    return is_beyond


def _load_beyond(scene: Scene, load: Load, index: int, who: str) -> bool:
    """Check if a load on the body of a frame acts on the part of this body on the child side of the frame.

    Raises:
        InputError: the scene does not determine the side.
    """
    model, is_beyond = scene.model, None
    if load.frame is not None and model.existFrame(load.frame):
        is_beyond = _is_beyond(model, frame_index(model, load.frame), index)
        if load.contact is not None and load.frame == str(model.names[load.joint]):
            names = compiled_scene(scene).shapes.get(load.contact, ())
            is_beyond = _shape_beyond(model, scene.collision_model, load.joint, names, index)
    elif load.frame is not None:  # a joint without a frame
        is_beyond = False
    if is_beyond is None:
        place = "it has no frame name" if load.frame is None else f'it is attached to "{load.frame}"'
        raise InputError(
            f"{who}: the scene must show on which side of the frame {load.who} acts; {place}, which belongs "
            "to no link of this body; attach it to the frame of a link"
        )
    return is_beyond


def _shape_beyond(
    model: Model, shapes: GeometryModel | None, joint: int, names: Sequence[str], index: int
) -> bool | None:
    """Check if a contact that names only the moving joint, such as a pair of shapes, lies beyond a frame.

    Each shape of a `GeometryContact` belongs to a link. Another contact lies on the link of the joint itself,
    unless shapes on that body lie beyond the frame.
    """
    body_shapes = [] if shapes is None else [g for g in shapes.geometryObjects if g.parentJoint == joint]
    named = [g for g in body_shapes if g.name in names]
    sides = {_is_beyond(model, int(g.parentFrame), index) for g in named or body_shapes}
    if named:
        return sides.pop() if len(sides) == 1 else None
    return None if sides - {False} else False
