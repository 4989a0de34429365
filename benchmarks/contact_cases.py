"""Contact cases with closed forms: a bouncing ball, a box that slides to rest, and a box at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import pin_nonideal as pn

from .mjcf_export import numbers

Array = NDArray[np.float64]

GRAVITY = 9.81
RESTITUTION, SLIDING, STANDING = 0.8, 0.3, 0.5  # ball; friction coefficients of the boxes
SLOPE = math.atan(0.4)
EDGES, RADIUS = (0.2, 0.2, 0.1), 0.1  # boxes and ball [m]


@dataclass(frozen=True)
class Case:
    """Body on the ground with a motion in closed form.

    Attributes:
        name: name of the case.
        title: title in tables.
        scene: scene with the contacts.
        duration: duration of the run [s].
        end: position of the body's center at the end [m], (3,).
        geom: shape and friction of the body as attributes of an MJCF geom.
        restitution: coefficient of restitution of the contacts.
    """

    name: str
    title: str
    scene: pn.Scene
    duration: float
    end: Array
    geom: dict[str, str]
    restitution: float = 0.0


def one_body(shape: Any, tilt: float = 0.0) -> Any:
    """Return a model of one free body of 1 kg; gravity is tilted by `tilt` [rad] toward +x."""
    model = pin.Model()
    down = GRAVITY * np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
    model.gravity = pin.Motion(down, np.zeros(3))
    pn.free_body(model, "body", shape, mass=1.0)
    return model


def at(height: float) -> Array:
    return np.array([0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0])


def bouncing() -> Case:
    """Return the case of a bouncing ball, which ends between the third and the fourth impact."""
    drop, duration = 1.0, 1.9
    model = one_body(coal.Sphere(RADIUS))
    contact = pn.PointContact("body", radius=RADIUS, restitution=RESTITUTION)
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
    model = one_body(coal.Box(*EDGES), tilt)
    contacts = [c for c in pn.box_contacts("body", EDGES, mu=mu) if c.offset[2] < 0.0]
    return pn.Scene(model, contacts=contacts, q0=at(0.5 * EDGES[2]), v0=v0)


def box_geom(mu: float) -> dict[str, str]:
    half = [0.5 * edge for edge in EDGES]
    return {"type": "box", "size": numbers(half), "condim": "3", "friction": numbers([mu, 0.0, 0.0])}


def sliding() -> Case:
    """Return the case of a box that friction brings to rest."""
    speed = 2.0
    scene = box(SLIDING, 0.0, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]))
    end = np.array([speed**2 / (2.0 * SLIDING * GRAVITY), 0.0, 0.5 * EDGES[2]])
    return Case("sliding", "a box slides to rest", scene, 1.0, end, box_geom(SLIDING))


def standing() -> Case:
    """Return the case of a box on a slope below the friction angle, which does not move."""
    scene = box(STANDING, SLOPE, np.zeros(6))
    end = np.array([0.0, 0.0, 0.5 * EDGES[2]])
    return Case("standing", "a box stands on a slope for 10 s", scene, 10.0, end, box_geom(STANDING))


CASES = {make.__name__: make for make in (bouncing, sliding, standing)}
