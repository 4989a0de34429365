"""Bodies on the ground whose motions have closed forms: a ball bounces, a box slides to rest or stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import pin_nonideal as pn

from .mjcf_export import numbers

Array = NDArray[np.float64]

GRAVITY = 9.81
RESTITUTION, SLIDING, STANDING = 0.8, 0.3, 0.5  # of the ball; coefficients of friction of both boxes
SLOPE = math.atan(0.4)
EDGES, RADIUS = (0.2, 0.2, 0.1), 0.1  # of the boxes and the ball [m]


@dataclass(frozen=True)
class Case:
    """A body whose motion on the ground has a closed form.

    Attributes:
        name: of the case.
        title: in words.
        scene: with the contacts.
        duration: of the run [s].
        end: where the middle of the body is then [m], (3,).
        geom: the body's shape and friction as attributes of an MJCF geom.
        restitution: of its contacts.
    """

    name: str
    title: str
    scene: pn.Scene
    duration: float
    end: Array
    geom: dict[str, str]
    restitution: float = 0.0


def free_body(inertia: Any, tilt: float = 0.0) -> Any:
    """One free body; gravity leans by `tilt` toward +x."""
    model = pin.Model()
    down = GRAVITY * np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
    model.gravity = pin.Motion(down, np.zeros(3))
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("middle", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


def at(height: float) -> Array:
    return np.array([0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0])


def bouncing() -> Case:
    """A ball between its third and fourth impact."""
    drop, duration = 1.0, 1.9
    model = free_body(pin.Inertia.FromSphere(1.0, RADIUS))
    contact = pn.PointContact("middle", radius=RADIUS, restitution=RESTITUTION)
    begin = math.sqrt(2.0 * drop / GRAVITY)
    speed = GRAVITY * begin * RESTITUTION
    while begin + 2.0 * speed / GRAVITY < duration:
        begin, speed = begin + 2.0 * speed / GRAVITY, speed * RESTITUTION
    since = duration - begin
    end = np.array([0.0, 0.0, RADIUS + speed * since - 0.5 * GRAVITY * since**2])
    scene = pn.Scene(model, contacts=[contact], q0=at(drop + RADIUS))
    geom = {"type": "sphere", "size": numbers(RADIUS), "condim": "1"}
    return Case("bouncing", "a ball bounces", scene, duration, end, geom, RESTITUTION)


def box(mu: float, tilt: float, v0: Array) -> pn.Scene:
    model = free_body(pin.Inertia.FromBox(1.0, *EDGES), tilt)
    contacts = [c for c in pn.box_contacts("middle", EDGES, mu=mu) if c.offset[2] < 0.0]
    return pn.Scene(model, contacts=contacts, q0=at(0.5 * EDGES[2]), v0=v0)


def box_geom(mu: float) -> dict[str, str]:
    half = [0.5 * edge for edge in EDGES]
    return {"type": "box", "size": numbers(half), "condim": "3", "friction": numbers([mu, 0.0, 0.0])}


def sliding() -> Case:
    """A box that friction stops on the way."""
    speed = 2.0
    scene = box(SLIDING, 0.0, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]))
    end = np.array([speed**2 / (2.0 * SLIDING * GRAVITY), 0.0, 0.5 * EDGES[2]])
    return Case("sliding", "a box slides to rest", scene, 1.0, end, box_geom(SLIDING))


def standing() -> Case:
    """A box below its angle of friction: it does not move at all."""
    scene = box(STANDING, SLOPE, np.zeros(6))
    end = np.array([0.0, 0.0, 0.5 * EDGES[2]])
    return Case("standing", "a box stands on a slope for 10 s", scene, 10.0, end, box_geom(STANDING))


CASES = {make.__name__: make for make in (bouncing, sliding, standing)}
