"""Scenes of many bodies in contact, for this package and for MuJoCo from the same numbers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import pin_nonideal as pn

from .mjcf_export import numbers

Array = NDArray[np.float64]

DENSITY = 1000.0  # [kg/m^3]


@dataclass(frozen=True)
class Body:
    """A box, a ball or a capsule.

    Attributes:
        size: edges of a box, radius of a ball, or radius of a capsule and length of its center line [m].
        at: position of the center [m], (3,).
        turn: roll, pitch and yaw [rad], (3,).
        v0: linear and angular velocity in the axes of the body [m/s, rad/s], (6,).
        density: density [kg/m^3].
    """

    size: tuple[float, ...]
    at: tuple[float, float, float]
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    v0: tuple[float, ...] = (0.0,) * 6
    density: float = DENSITY

    @property
    def kind(self) -> str:
        """Kind of the shape."""
        return ("sphere", "capsule", "box")[len(self.size) - 1]

    @property
    def shape(self) -> Any:
        """Shape of Coal; the axis of a capsule is z."""
        return {"sphere": coal.Sphere, "capsule": coal.Capsule, "box": coal.Box}[self.kind](*self.size)


@dataclass(frozen=True)
class ContactScene:
    """Bodies on the ground, free or linked to a rope.

    Attributes:
        title: title in tables.
        bodies: the bodies.
        mu: coefficient of friction of all contacts.
        pairs: indices of bodies that may touch; None for all pairs.
        walls: distance of four walls from the middle [m], 0 for none.
        damping: damping of the ball joints between capsules of a rope [N m s/rad]; None for free bodies.
        duration: duration of the run [s].
        rests: whether the bodies must not move.
    """

    title: str
    bodies: Sequence[Body]
    mu: float = 0.5
    pairs: Sequence[tuple[int, int]] | None = None
    walls: float = 0.0
    damping: float | None = None
    duration: float = 1.0
    rests: bool = False
    planes: list[tuple[tuple[float, float, float], float]] = field(init=False)

    def __post_init__(self) -> None:
        planes = [((0.0, 0.0, 1.0), 0.0)]
        if self.walls > 0.0:
            sides = ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))
            planes += [(side, -self.walls) for side in sides]
        object.__setattr__(self, "planes", planes)

    def free(self) -> Sequence[Body]:
        """Return the bodies with a free joint: all, or the first link of a rope."""
        return self.bodies if self.damping is None else self.bodies[:1]

    def touching(self) -> list[tuple[int, int]]:
        """Return the pairs of bodies that may touch."""
        count = len(self.bodies)
        return list(((j, i) for i in range(count) for j in range(i)) if self.pairs is None else self.pairs)


def ours(given: ContactScene) -> pn.Scene:
    """Return the scene of this package."""
    model, shapes = pin.Model(), pin.GeometryModel()
    q: list[float] = []
    v: list[float] = []
    for k, body in enumerate(given.free()):
        pn.free_body(model, f"body{k}", body.shape, body.density, collision_model=shapes)
        q += [*body.at, *pin.Quaternion(pin.rpy.rpyToMatrix(*body.turn)).coeffs()]
        v += body.v0
    laws = []
    for k in range(len(given.free()), len(given.bodies)):
        link = given.bodies[k]
        to_next = pin.SE3(np.eye(3), np.array([0.0, 0.0, link.size[1] * (0.5 if k == 1 else 1.0)]))
        center = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5 * link.size[1]]))
        joint = model.addJoint(k, pin.JointModelSpherical(), to_next, f"joint{k}")
        radius, length = link.size
        mass = link.density * np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
        model.appendBodyToJoint(joint, pin.Inertia.FromCapsule(mass, radius, length), center)
        shapes.addGeometryObject(pin.GeometryObject(f"body{k}", joint, center, link.shape))
        laws.append(pn.JointFriction(f"joint{k}", viscous=given.damping))
        q += [0.0, 0.0, 0.0, 1.0]
        v += [0.0] * 3
    contacts = []
    for k, (normal, height) in enumerate(given.planes):
        plane = coal.Halfspace(np.array(normal), height)
        shapes.addGeometryObject(pin.GeometryObject(f"plane{k}", 0, pin.SE3.Identity(), plane))
        contacts += [
            pn.GeometryContact(f"body{i}", f"plane{k}", mu=given.mu) for i in range(len(given.bodies))
        ]
    contacts += [pn.GeometryContact(f"body{j}", f"body{i}", mu=given.mu) for j, i in given.touching()]
    start = {"q0": np.array(q), "v0": np.array(v)}
    return pn.Scene(model, contacts=contacts, collision_model=shapes, laws=laws, **start)


def mujocos(given: ContactScene, h: float) -> tuple[Any, Any]:
    """Return MuJoCo's model and data (Newton's solver, elliptic cones)."""
    import mujoco

    root = ET.Element("mujoco")
    ET.SubElement(root, "option", timestep=repr(h), cone="elliptic", solver="Newton")
    ET.SubElement(ET.SubElement(root, "default"), "geom", friction=numbers([given.mu, 0.0, 0.0]), condim="3")
    world = ET.SubElement(root, "worldbody")
    for normal, height in given.planes:
        at = numbers([height * x for x in normal])
        ET.SubElement(world, "geom", type="plane", size="9 9 1", pos=at, zaxis=numbers(normal))
    parent = world
    for k, body in enumerate(given.bodies):
        if given.damping is None or k == 0:
            turn = pin.Quaternion(pin.rpy.rpyToMatrix(*body.turn))
            place = {"pos": numbers(body.at), "quat": numbers([turn.w, turn.x, turn.y, turn.z])}
            item, center = ET.SubElement(world, "body", place), 0.0
            ET.SubElement(item, "freejoint")
        else:
            end = body.size[1] * (0.5 if k == 1 else 1.0)
            item, center = ET.SubElement(parent, "body", pos=numbers([0.0, 0.0, end])), 0.5 * body.size[1]
            ET.SubElement(item, "joint", type="ball", damping=repr(given.damping))
        parent = item
        size = {"box": [0.5 * x for x in body.size], "capsule": [body.size[0], 0.5 * body.size[-1]]}
        geom = {
            "type": body.kind,
            "size": numbers(size.get(body.kind, body.size)),
            "pos": numbers([0.0, 0.0, center]),
        }
        touches = {} if given.damping is None else {"contype": "0"}  # links of a rope touch the ground alone
        ET.SubElement(item, "geom", geom, density=repr(body.density), **touches)
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    for k, body in enumerate(given.free()):
        axes = pin.rpy.rpyToMatrix(*body.turn)
        data.qvel[6 * k : 6 * k + 3] = axes @ body.v0[:3]
        data.qvel[6 * k + 3 : 6 * k + 6] = body.v0[3:]
    return model, data


def stack(count: int) -> ContactScene:
    """Return a stack of boxes, each a little beside the one below."""
    edge = 0.2
    bodies = [Body((edge,) * 3, (0.003 * k, 0.0, edge * (k + 0.5))) for k in range(count)]
    pairs = [(k + 1, k) for k in range(count - 1)]
    return ContactScene(f"stack of {count} boxes", bodies, pairs=pairs, rests=True)


def sliding(count: int) -> ContactScene:
    """Return boxes side by side that slide and turn on the ground for the whole run."""
    edge = 0.2
    bodies = [
        Body((edge,) * 3, (0.0, 0.4 * k, 0.5 * edge), v0=(3.0 + 0.1 * k, 0.0, 0.0, 0.0, 0.0, 0.5 * k))
        for k in range(count)
    ]
    pairs = [(k + 1, k) for k in range(count - 1)]
    return ContactScene(f"{count} boxes that slide", bodies, mu=0.25, pairs=pairs)


def heavy_on_light(ratio: float) -> ContactScene:
    """Return two boxes, the upper one `ratio` times as heavy."""
    edge = 0.2
    bodies = [
        Body((edge,) * 3, (0.0, 0.0, 0.5 * edge)),
        Body((edge,) * 3, (0.01, 0.0, 1.5 * edge), density=ratio * DENSITY),
    ]
    return ContactScene(f"a box of {ratio:.0e} times the mass on another", bodies, rests=True)


def dominoes(count: int) -> ContactScene:
    """Return a row of dominoes of two widths, of which the first falls on the others."""
    thick, high, apart, spin = 0.03, 0.2, 0.08, 3.0
    push = (0.5 * high * spin, 0.0, 0.5 * thick * spin, 0.0, spin, 0.0)  # about the front edge
    bodies = [
        Body(
            (thick, 0.1 - 0.01 * (k % 2), high),
            (apart * k, 0.0, 0.5 * high),
            v0=push if k == 0 else (0.0,) * 6,
        )
        for k in range(count)
    ]
    pairs = [(k + 1, k) for k in range(count - 1)]
    return ContactScene(f"{count} dominoes", bodies, mu=0.4, pairs=pairs, duration=1.5)


def balls_in_box(count: int) -> ContactScene:
    """Return balls that fall into a box without lid."""
    rng, radius, side = np.random.default_rng(0), 0.05, 3 if count <= 40 else 4
    bodies = []
    for k in range(count):
        i, level = k % (side * side), k // (side * side)
        x, y = ((i % side, i // side) - np.full(2, 0.5 * (side - 1))) * 2.3 * radius
        dx, dy = 0.004 * rng.uniform(-1.0, 1.0, 2)
        bodies.append(Body((radius,), (x + dx, y + dy, radius + 2.3 * radius * level + 0.02)))
    return ContactScene(f"{count} balls in a box", bodies, mu=0.4, walls=0.06 * side)


def wall(rows: int, columns: int) -> ContactScene:
    """Return a wall of bricks, each on two others; bricks at the open side of a row tip over."""
    size = (0.4, 0.2, 0.2)
    at: list[tuple[float, int]] = []
    bodies = []
    for row in range(rows):
        for column in range(columns):
            x = size[0] * (column + 0.5 * (row % 2))
            at.append((x, row))
            bodies.append(Body(size, (x, 0.0, size[2] * (row + 0.5))))
    pairs = [
        (i, j)
        for i, (x, row) in enumerate(at)
        for j, (other, below) in enumerate(at)
        if below == row - 1 and abs(x - other) < 0.9 * size[0]
    ]
    return ContactScene(f"a wall of {rows * columns} bricks", bodies, pairs=pairs)


def rope(count: int) -> ContactScene:
    """Return a rope of capsules that falls on the ground, one end first."""
    link = Body((0.01, 0.04), (0.0, 0.0, 0.05), (0.0, 0.5 * np.pi - 0.2, 0.0))
    return ContactScene(f"a rope of {count} links", [link] * count, pairs=[], damping=1e-3)
