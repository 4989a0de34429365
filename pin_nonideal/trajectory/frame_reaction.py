"""Wrench through a fixed joint or frame: the load that the part beyond it receives.

Pinocchio merges the links of fixed joints into the body of a moving joint, but keeps the inertia of each such
link in the frame of its fixed joint, and the order of frames from parent to child. The part beyond a frame
consists of the frames that descend from it on its body, and of the moving joints that they carry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from pin_nonideal.compilation.constraints import frames_of
from pin_nonideal.compilation.contacts import lower_gaps
from pin_nonideal.compilation.resolver import WORLD, Frame, Resolver
from pin_nonideal.description.constraints import KnifeEdge, Rolling
from pin_nonideal.description.forces import SpringDamper, Wrench
from pin_nonideal.description.laws import Drag
from pin_nonideal.errors import InputError
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.kinematics import BodyMotions, frame_index
from pin_nonideal.types import Array, Model

from .fields import RunFields, reactions_of

# Largest part of the forces on a body by which they may miss its recorded reaction.
AGREES = 1e-6
# Part of the weight of the mechanism by which they may miss it where forces cancel, as in free fall.
CANCELS = 1e-9
# Smallest eigenvalue of the inertia that frames leave to their body, relative to the inertia of the body.
LEFT_OVER = -1e-9
CARRIERS = (pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)
# Wrench on a body in world axes about the origin of the world, from the index of a sample and its motions.
LoadAt = Callable[[int, BodyMotions], pin.Force]


class Load(NamedTuple):
    """Wrench on a body.

    Attributes:
        who: words for messages.
        joint: index of the joint that moves the body.
        frame: name of the frame or joint that the load is attached to, or None if it has no name.
        at: the wrench at a sample.
        contact: name of the contact that exerts it, or None.
    """

    who: str
    joint: int
    frame: str | None
    at: LoadAt
    contact: str | None = None


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
    if frame.type == pin.FrameType.BODY and carrier and model.frames[carrier].type in CARRIERS:
        return carrier
    return index


def frame_reaction(run: RunFields, name: str, index: int) -> Array:
    """Compute the wrench through a frame at all samples, in its own axes and in world axes, (nt, 12).

    The wrench is Y a + v x* Y v of the part of the body beyond the frame, with a relative to free fall, plus
    the reactions of the joints on that part, minus the loads on it.

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
    loads = [load for load in _loads(run) if load.joint == joint]
    part = _part_beyond(run.scene, index, loads, who)
    bodies = [_whole_body(model, joint, loads)] if joint else []
    if not joint:  # the universe has no reaction; its children show the same masses and gravity
        bodies = [_whole_body(model, child, _on(run, child)) for child in part.children]
    accelerations = run.a
    assert accelerations is not None  # `by_name` checks it
    wrenches = np.empty((len(run.t), 12))
    for k in range(len(run.t)):
        motions = BodyMotions(model, run.q[k], run.v[k], accelerations[k])
        for body in bodies:
            _require_recorded(run, k, motions, body, who)
        own = place.actInv(_balance(run, k, motions, part)[0])
        R = motions.placement(joint).rotation @ place.rotation
        wrenches[k] = np.concatenate([own.linear, own.angular, R @ own.linear, R @ own.angular])
    return wrenches


def _balance(run: RunFields, k: int, motions: BodyMotions, part: Part) -> tuple[pin.Force, float]:
    """Return the wrench that a part receives, in the joint frame, and the sum of the sizes of its terms."""
    velocity, acceleration = motions.velocity(part.joint), motions.acceleration(part.joint)
    terms = [part.inertia * acceleration, velocity.cross(part.inertia * velocity)]
    to_body = motions.placement(part.joint)
    for child in part.children:
        wrench = reactions_of(run)[str(run.scene.model.names[child])][k, 6:]
        terms.append(to_body.actInv(_about_world(wrench, motions.placement(child).translation)))
    terms += [-to_body.actInv(load.at(k, motions)) for load in part.loads]
    return sum(terms, pin.Force.Zero()), sum(float(np.abs(term.vector).max()) for term in terms)


def _require_recorded(run: RunFields, k: int, motions: BodyMotions, body: Part, who: str) -> None:
    """Check that the loads on a whole body add up to the recorded reaction of its joint.

    Raises:
        InputError: they do not.
    """
    name = str(run.scene.model.names[body.joint])
    found, size = _balance(run, k, motions, body)
    recorded = reactions_of(run)[name][k, :6]
    missed = float(np.abs(found.vector - recorded).max())
    model = run.scene.model
    whole = sum(Y.mass for Y in model.inertias) * float(np.linalg.norm(model.gravity.linear))
    whole += max(float(np.abs(wrench[k]).max()) for wrench in reactions_of(run).values())
    if missed > AGREES * (size + float(np.abs(recorded).max())) + CANCELS * whole:
        raise InputError(
            f"{who}: masses and gravity of the run must be those of its scene; the loads on the body of "
            f'joint "{name}" miss its recorded reaction by {missed:.2g} (N or N m) at t = {run.t[k]:.4g} s; '
            "with parameters of a rollout, make a scene for each run instead"
        )


def _about_world(wrench: Array, point: Array) -> pin.Force:
    """Return a wrench about a point, in world axes, as a wrench about the origin of the world."""
    return pin.Force(wrench[:3], wrench[3:] + np.cross(point, wrench[:3]))


def _whole_body(model: Model, joint: int, loads: list[Load]) -> Part:
    """Return the body of a joint with all that it carries."""
    children = [c for c in range(1, model.njoints) if model.parents[c] == joint]
    return Part(joint, model.inertias[joint], children, loads)


def _on(run: RunFields, joint: int) -> list[Load]:
    return [load for load in _loads(run) if load.joint == joint]


def _part_beyond(scene: Scene, index: int, loads: list[Load], who: str) -> Part:
    """Return the part beyond a frame.

    Raises:
        InputError: the model does not determine the part beyond the frame.
    """
    model = scene.model
    joint = int(model.frames[index].parentJoint)
    children = [c for c in range(1, model.njoints) if model.parents[c] == joint]
    held = [c for c in children if _child_beyond(model, c, index, who)]
    own = [load for load in loads if _load_beyond(scene, load, index, who)]
    return Part(joint, _inertia_beyond(model, index, who), held, own)


def _beyond(model: Model, frame: int, index: int) -> bool | None:
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
    joint, found, frame = model.frames[index].parentJoint, set(), int(model.frames[index].parentFrame)
    while frame not in found and frame != index and model.frames[frame].parentJoint == joint:
        found.add(frame)
        frame = int(model.frames[frame].parentFrame)
    return found


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
        is_beyond = _beyond(model, i, index)
        if is_beyond is None and each.inertia.mass > 0.0:
            raise InputError(
                f'{who}: the model must tell on which side of the frame link "{each.name}" lies; its parent '
                "frame leads to no joint, as behind a joint that was locked; keep that joint free, or hold "
                "it by a PrescribedMotion"
            )
        if is_beyond and (i == index or not locked):  # a locked joint has the inertia of all of its links
            total += each.placement.act(each.inertia)
    links = any(f.type == pin.FrameType.BODY and f.parentFrame == index for f in model.frames)
    if total.mass == 0.0 and not (frame.type == pin.FrameType.FIXED_JOINT and links):
        raise InputError(
            f"{who}: the model must give the inertia beyond the frame; it keeps none there, only that of "
            f'the whole body of joint "{model.names[frame.parentJoint]}"; make the frame a fixed joint with '
            "a link"
        )
    if frame.parentJoint == 0:  # the world has no inertia of its own
        return total
    body = model.inertias[frame.parentJoint].toPseudoInertia().toMatrix()
    left = np.linalg.eigvalsh(body - total.toPseudoInertia().toMatrix())
    if left[0] < LEFT_OVER * float(np.abs(body).max()):
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
        is_beyond = _beyond(model, int(model.getFrameId(name, pin.FrameType.JOINT)), index)
    if is_beyond is None:
        raise InputError(
            f'{who}: the model must tell on which side of the frame joint "{name}" lies; its joint frame has '
            "no parent frame on this body; add it by model.addJointFrame(joint, parent_frame)"
        )
    return is_beyond


def _load_beyond(scene: Scene, load: Load, index: int, who: str) -> bool:
    """Check if a load on the body of a frame acts beyond it.

    Raises:
        InputError: the scene does not determine the side.
    """
    model, is_beyond = scene.model, None
    if load.frame is not None and model.existFrame(load.frame):
        is_beyond = _beyond(model, frame_index(model, load.frame), index)
        if load.contact is not None and load.frame == str(model.names[load.joint]):
            is_beyond = _shape_beyond(scene, load.joint, load.contact, index)
    elif load.frame is not None:  # a joint without a frame
        is_beyond = False
    if is_beyond is None:
        place = "it has no frame name" if load.frame is None else f'it is attached to "{load.frame}"'
        other = "" if load.contact is None else ", or leave out the name of a GeometryContact"
        raise InputError(
            f"{who}: the scene must tell on which side of the frame {load.who} acts; {place}, which belongs "
            f"to no link of this body; attach it to the frame of a link{other}"
        )
    return is_beyond


def _shape_beyond(scene: Scene, joint: int, contact: str, index: int) -> bool | None:
    """Check if a contact that names only the moving joint, as those of collision shapes, lies beyond a frame.

    The name of such a contact contains the names of its shapes, and each shape belongs to a link. A contact
    with another name lies on the link of the joint itself, unless shapes on that body lie beyond the frame.
    """
    shapes = scene.collision_model
    own = [] if shapes is None else [g for g in shapes.geometryObjects if g.parentJoint == joint]
    named = [g for g in own if g.name in contact]
    sides = {_beyond(scene.model, int(g.parentFrame), index) for g in named or own}
    if named:
        return sides.pop() if len(sides) == 1 else None
    return None if sides - {False} else False


# --- Loads on bodies ----------------------------------------------------------------------------------------


def _loads(run: RunFields) -> Iterator[Load]:
    """Yield the wrenches on all bodies: of constraints and contacts, of applied forces and of drags."""
    scene: Scene = run.scene
    resolver = Resolver(scene.model, scene.q0)
    for name, c in compiled_scene(scene).described.items():
        if name in reactions_of(run) and (frames := _frames(c, name, resolver)):
            yield from _pair(run, name, c, *frames)
    for f in scene.forces:
        if isinstance(f, Wrench):
            yield _pushed(run, f, resolver.frame(f.frame, "reaction"))
        elif isinstance(f, SpringDamper):
            yield from _sprung(f, *resolver.pair(f, "reaction"))
    for law in scene.laws:
        if isinstance(law, Drag):
            yield _dragged(law, resolver.frame(law.frame, "reaction"))


class _Frames:
    """Substitute for the core's builder that records the frames of a contact."""

    def __init__(self) -> None:
        self.found: list[Frame] = []

    def __getattr__(self, _: str) -> Callable[..., int]:
        def note(*arguments: Any, **__: Any) -> int:
            self.found += [x for x in arguments if isinstance(x, tuple) and len(x) == 3 and len(x[1]) == 9]
            return 0

        return note


def _frames(c: Any, name: str, resolver: Resolver) -> tuple[Frame, Frame] | None:
    """Return both frames of a constraint or contact in the form of the core, or None without frames."""
    if isinstance(c, KnifeEdge):
        return resolver.frame(c.frame, name), WORLD
    if isinstance(c, Rolling):
        return resolver.frame(c.frame, name), resolver.plane(c.plane, name)
    if hasattr(c, "joint1_placement") or (hasattr(c, "frame1") and not hasattr(c, "restitution")):
        return frames_of(c, resolver, name)
    if not (hasattr(c, "frame") or hasattr(c, "frame1")):
        return None
    noted: Any = _Frames()
    lower_gaps(c, name, noted, resolver)
    first, second = noted.found
    return first, second


def _pair(run: RunFields, name: str, c: Any, first: Frame, second: Frame) -> Iterator[Load]:
    """Yield the wrench of a constraint or contact on the bodies of both of its frames."""
    for frame, sign, keys in ((first, 1.0, ("frame1", "frame")), (second, -1.0, ("frame2", "plane"))):
        place = next((str(getattr(c, key)) for key in keys if getattr(c, key, None) is not None), None)
        if place is None and not hasattr(c, "joint1_placement"):
            place = "universe"

        def at(k: int, motions: BodyMotions, sign: float = sign) -> pin.Force:
            return sign * _about_world(reactions_of(run)[name][k, 6:], motions.point(first))

        yield Load(f'"{name}"', frame[0], place, at, name if run.rows[name][2] else None)


def _pushed(run: RunFields, f: Wrench, frame: Frame) -> Load:
    def at(k: int, motions: BodyMotions) -> pin.Force:
        value = f.value(float(run.t[k])) if callable(f.value) else f.value
        return _about_world(np.asarray(value, dtype=float).reshape(6), motions.point(frame))

    return Load(f'the Wrench at "{f.frame}"', frame[0], f.frame, at)


def _sprung(f: SpringDamper, first: Frame, second: Frame) -> Iterator[Load]:
    def pull(k: int, motions: BodyMotions) -> pin.Force:
        x1, x2 = motions.point(first), motions.point(second)
        way, rate = x1 - x2, motions.point_velocity(first) - motions.point_velocity(second)
        length = float(np.linalg.norm(way))
        force = -f.stiffness * way
        if length > 0.0:
            along = way / length
            force = -(f.stiffness * (length - f.rest_length) + f.damping * (along @ rate)) * along
        return _about_world(np.concatenate([force, np.zeros(3)]), x1)

    def push(k: int, motions: BodyMotions) -> pin.Force:
        return -pull(k, motions)

    yield Load(f'the SpringDamper at "{f.frame1}"', first[0], f.frame1, pull)
    yield Load(f'the SpringDamper at "{f.frame2}"', second[0], f.frame2 or "universe", push)


def _dragged(law: Drag, frame: Frame) -> Load:
    def at(k: int, motions: BodyMotions) -> pin.Force:
        u = motions.point_velocity(frame)
        speed = float(np.linalg.norm(u))
        force = -law.coefficient * speed ** (law.exponent - 1.0) * u if speed > 0.0 else np.zeros(3)
        return _about_world(np.concatenate([force, np.zeros(3)]), motions.point(frame))

    return Load(f'the Drag at "{law.frame}"', frame[0], law.frame, at)
