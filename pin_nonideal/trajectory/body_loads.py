"""Loads on the bodies of a run: wrenches of constraints, contacts, applied forces and drags."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from pin_nonideal.compilation.constraints import frames_of
from pin_nonideal.compilation.contacts import lower_gaps
from pin_nonideal.compilation.resolver import WORLD, Frame, Resolver
from pin_nonideal.description.constraints import KnifeEdge, Rolling
from pin_nonideal.description.forces import SpringDamper, Wrench
from pin_nonideal.description.laws import Drag
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.kinematics import BodyMotions
from pin_nonideal.types import Array

from .contact_points import contact_bodies
from .fields import RunFields, reactions_of

# Wrench on a body in world axes about the origin of the world, from the index of a sample and its motions.
LoadAt = Callable[[int, BodyMotions], pin.Force]


class Load(NamedTuple):
    """Wrench on a body.

    Attributes:
        who: prefix of error messages.
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


def loads_on_bodies(run: RunFields) -> Iterator[Load]:
    """Yield the wrenches on all bodies by constraints, contacts, applied forces and drags.

    Args:
        run: fields of the run, with reactions.
    """
    compiled = compiled_scene(run.scene)
    resolver = Resolver(compiled.model, compiled.q0)
    for name in compiled.described:
        if name not in reactions_of(run):
            continue
        c = compiled.described[name]
        if frames := _frames(c, name, resolver):
            yield from _pair(run, name, c, *frames)
    for name in compiled.points:
        if name in reactions_of(run):
            yield from _pair_of_shapes(run, name)
    for f in compiled.spec.forces:
        if isinstance(f, Wrench):
            yield _wrench_loads(run, f, resolver.frame(f.frame, "reaction"))
        elif isinstance(f, SpringDamper):
            yield from _sprung(f, *resolver.pair(f, "reaction"))
    for law in compiled.spec.laws:
        if isinstance(law, Drag):
            yield _drag_loads(law, resolver.frame(law.frame, "reaction"))


class _Frames:
    """Substitute for the core's builder that records the frames of a contact."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def __getattr__(self, _: str) -> Callable[..., int]:
        def note(*arguments: Any, **__: Any) -> int:
            self.frames += [x for x in arguments if isinstance(x, tuple) and len(x) == 3 and len(x[1]) == 9]
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
    first, second = noted.frames
    return first, second


def _pair(run: RunFields, name: str, c: Any, first: Frame, second: Frame) -> Iterator[Load]:
    """Yield the wrench of a constraint or contact on the bodies of both of its frames."""
    for frame, sign, keys in ((first, 1.0, ("frame1", "frame")), (second, -1.0, ("frame2", "plane"))):
        place = next((str(getattr(c, key)) for key in keys if getattr(c, key, None) is not None), None)
        if place is None and not hasattr(c, "joint1_placement"):
            place = "universe"

        def at(k: int, motions: BodyMotions, sign: float = sign) -> pin.Force:
            return sign * about_world(reactions_of(run)[name][k, 6:], motions.point(first))

        yield Load(f'"{name}"', frame[0], place, at, name if run.rows[name][2] else None)


def _pair_of_shapes(run: RunFields, name: str) -> Iterator[Load]:
    """Yield the wrench of a pair of shapes with several points on both of its bodies."""
    bodies = contact_bodies(compiled_scene(run.scene), name)
    for joint, sign in ((bodies.joint, 1.0), (bodies.other, -1.0)):

        def at(k: int, motions: BodyMotions, sign: float = sign) -> pin.Force:
            origin = motions.placement(bodies.joint).translation
            return sign * about_world(reactions_of(run)[name][k, 6:], origin)

        yield Load(f'"{name}"', joint, str(run.scene.model.names[joint]), at, name)


def _wrench_loads(run: RunFields, f: Wrench, frame: Frame) -> Load:
    def at(k: int, motions: BodyMotions) -> pin.Force:
        value = f.value(float(run.t[k])) if callable(f.value) else f.value
        return about_world(np.asarray(value, dtype=float).reshape(6), motions.point(frame))

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
        return about_world(np.concatenate([force, np.zeros(3)]), x1)

    def push(k: int, motions: BodyMotions) -> pin.Force:
        return -pull(k, motions)

    yield Load(f'the SpringDamper at "{f.frame1}"', first[0], f.frame1, pull)
    yield Load(f'the SpringDamper at "{f.frame2}"', second[0], f.frame2 or "universe", push)


def _drag_loads(law: Drag, frame: Frame) -> Load:
    def at(k: int, motions: BodyMotions) -> pin.Force:
        u = motions.point_velocity(frame)
        speed = float(np.linalg.norm(u))
        force = -law.coefficient * speed ** (law.exponent - 1.0) * u if speed > 0.0 else np.zeros(3)
        return about_world(np.concatenate([force, np.zeros(3)]), motions.point(frame))

    return Load(f'the Drag at "{law.frame}"', frame[0], law.frame, at)


def about_world(wrench: Array, point: Array) -> pin.Force:
    """Return a wrench about a point, in world axes, as a wrench about the origin of the world.

    Args:
        wrench: force and moment [N; N m], (6,).
        point: the point in the world [m], (3,).
    """
    return pin.Force(wrench[:3], wrench[3:] + np.cross(point, wrench[:3]))
