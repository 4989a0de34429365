"""Free bodies between planes and on each other, at rest, with the touches that an oracle needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.optimize import fsolve

import pin_nonideal as pn
from oracles.admissible_rest import Touch, directions

GRAVITY = 9.81
TOUCHING = 1e-9  # [m], which nearer bodies of a pile do


@dataclass(frozen=True)
class Wedged:
    """A scene with its touches, centers of mass and loads, as `oracles.admissible_rest` takes them."""

    scene: pn.Scene
    touches: list[Touch]
    centers: np.ndarray
    loads: np.ndarray


def unit(x):
    return x / np.linalg.norm(x)


def model_of(inertias, gravity):
    """Bodies on free-flyer joints, each with a frame at its center."""
    model = pin.Model()
    model.gravity.linear[:] = gravity
    for k, inertia in enumerate(inertias):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"body{k}")
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        add_frame(model, f"center{k}", joint, np.zeros(3), np.eye(3))
    return model


def add_frame(model, name, joint, point, rotation):
    model.addFrame(pin.Frame(name, joint, 0, pin.SE3(rotation, point), pin.FrameType.OP_FRAME))


def add_plane(model, name, point, normal):
    one, two = directions(normal)
    add_frame(model, name, 0, point, np.column_stack([one, two, normal]))


def loads_of(inertias, gravity):
    return np.concatenate([np.append(inertia.mass * gravity, np.zeros(3)) for inertia in inertias])


def ball_between_planes(seed):
    """A ball that two to four planes touch, most of them from below."""
    rng = np.random.default_rng(seed)
    radius, mu = rng.uniform(0.05, 0.3), rng.uniform(0.02, 1.0)
    gravity = GRAVITY * unit(rng.normal(size=3))
    inertia = pin.Inertia.FromSphere(rng.uniform(0.5, 3.0), radius)
    model = model_of([inertia], gravity)
    contacts, touches = [], []
    for k in range(rng.integers(2, 5)):
        normal = unit(rng.normal(size=3))
        if normal @ gravity > 0.0 and rng.random() < 0.8:
            normal = -normal
        add_plane(model, f"plane{k}", -radius * normal, normal)
        contacts.append(pn.PointContact("center0", mu=mu, plane=f"plane{k}", radius=radius, name=f"touch{k}"))
        touches.append(Touch(0, -1, -radius * normal, normal, mu))
    return Wedged(pn.Scene(model, contacts=contacts), touches, np.zeros((1, 3)), loads_of([inertia], gravity))


def on_feet(inertia, gravity, feet, mu):
    """A body on points, each on a plane of its own: (point, normal)."""
    model = model_of([inertia], gravity)
    contacts, touches = [], []
    for k, (point, normal) in enumerate(feet):
        add_frame(model, f"foot{k}", 1, point, np.eye(3))
        add_plane(model, f"plane{k}", point, normal)
        contacts.append(pn.PointContact(f"foot{k}", mu=mu, plane=f"plane{k}", name=f"touch{k}"))
        touches.append(Touch(0, -1, point, normal, mu))
    return Wedged(pn.Scene(model, contacts=contacts), touches, np.zeros((1, 3)), loads_of([inertia], gravity))


def box_in_corner(seed):
    """A box in the corner of a floor and two walls, four points on each, under a slanted gravity."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.1, 0.5, 3)
    gravity = GRAVITY * unit(0.4 * rng.normal(size=3) - np.abs(rng.normal(size=3)))
    feet = []
    for axis in range(3):
        for one in (-1, 1):
            for two in (-1, 1):
                point = -size / 2
                point[(axis + 1) % 3] *= one
                point[(axis + 2) % 3] *= two
                feet.append((point, np.eye(3)[axis]))
    return on_feet(pin.Inertia.FromBox(rng.uniform(0.5, 3.0), *size), gravity, feet, rng.uniform(0.02, 0.8))


def uneven_stance(seed):
    """A body on three to eight feet at different heights, each on ground of its own slope."""
    rng = np.random.default_rng(seed)
    slope, way, count = rng.uniform(0.0, 0.5), rng.uniform(0.0, 2 * np.pi), rng.integers(3, 9)
    gravity = GRAVITY * np.array([np.sin(slope) * np.cos(way), np.sin(slope) * np.sin(way), -np.cos(slope)])
    feet = []
    for k in range(count):
        angle = 2 * np.pi * (k + rng.uniform(-0.3, 0.3)) / count
        point = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), -rng.uniform(0.05, 0.25)])
        feet.append((point, unit(np.array([0.3 * rng.normal(), 0.3 * rng.normal(), 1.0]))))
    inertia = pin.Inertia.FromBox(rng.uniform(0.5, 3.0), 0.3, 0.3, 0.1)
    return on_feet(inertia, gravity, feet, rng.uniform(0.05, 0.8))


def table_in_valley(seed):
    """Four feet, two on each slope of a valley, beside each other."""
    rng = np.random.default_rng(seed)
    slope, turn = rng.uniform(0.05, 0.6), rng.uniform(-0.2, 0.2)
    feet = [
        (np.array([x, y, -0.3]), np.array([-np.sign(x) * np.sin(slope), 0.0, np.cos(slope)]))
        for x in (-0.4, 0.4)
        for y in (-0.25, 0.25)
    ]
    gravity = GRAVITY * np.array([np.sin(turn), 0.3 * np.sin(turn), -np.cos(turn)])
    return on_feet(pin.Inertia.FromBox(5.0, 0.8, 0.5, 0.05), gravity, feet, rng.uniform(0.02, 0.8))


def pile_of_balls(seed):
    """Two to six balls on a floor and on each other, in a plane or in space; one of four floors is tilted."""
    rng = np.random.default_rng(seed)
    flat = rng.random() < 0.5
    on_balls, on_floor = rng.uniform(0.02, 0.9, 2)
    radii, centers = balls(rng, flat, int(rng.integers(2, 7)))
    tilt = rng.uniform(0.0, 0.1) * (rng.random() < 0.25)
    gravity = GRAVITY * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    inertias = [pin.Inertia.FromSphere(rng.uniform(0.3, 2.0), radius) for radius in radii]
    return _pile(radii, centers, inertias, gravity, on_balls, on_floor)


def pile_with_several_motions():
    """Six balls in a plane with three motions."""
    radii = [0.11396322101744352, 0.06560279174443182, 0.0515205361549716]
    radii += [0.09121202811184786, 0.12783717366334107, 0.08137158639239336]
    x = [-0.06518191782262772, 0.2600859423071222, -0.222760770969005]
    x += [0.13478616832955695, 0.013800516792057967, -0.24830949187492546]
    z = [*radii[:3], 0.15989411885211713, 0.34250032060987323, 0.18193364552368213]
    masses = [1.9716376774666857, 1.4858349760825647, 0.5686331627256419]
    masses += [0.5848578783559729, 1.2100979970287027, 0.730490210970817]
    centers = np.column_stack([x, np.zeros(6), z])
    inertias = [pin.Inertia.FromSphere(mass, radius) for mass, radius in zip(masses, radii, strict=True)]
    gravity = np.array([0.0, 0.0, -GRAVITY])
    return _pile(radii, centers, inertias, gravity, 0.7871721248338499, 0.18183842423635843)


def _pile(radii, centers, inertias, gravity, on_balls, on_floor):
    """Balls of these inertias on a floor and on each other, with these coefficients of friction."""
    model = model_of(inertias, gravity)
    q0 = pin.neutral(model)
    contacts, touches = [], []
    for k, (radius, center) in enumerate(zip(radii, centers, strict=True)):
        q0[7 * k : 7 * k + 3] = center
        if center[2] - radius < TOUCHING:
            contacts.append(pn.PointContact(f"center{k}", mu=on_floor, radius=radius, name=f"floor{k}"))
            touches.append(Touch(k, -1, center - [0.0, 0.0, radius], np.array([0.0, 0.0, 1.0]), on_floor))
        for other in range(k):
            apart = center - centers[other]
            if np.linalg.norm(apart) - radius - radii[other] < TOUCHING:
                pair = f"center{k}", f"center{other}", radius, radii[other]
                contacts.append(pn.SphereContact(*pair, mu=on_balls, name=f"{k} on {other}"))
                point = centers[other] + radii[other] * unit(apart)
                touches.append(Touch(k, other, point, unit(apart), on_balls))
    scene = pn.Scene(model, contacts=contacts, q0=q0)
    return Wedged(scene, touches, np.array(centers), loads_of(inertias, gravity))


def balls(rng, flat, count):
    """Radii and centers: a new ball lies on the floor, or on two (in space three) earlier ones."""
    radii, centers = [], []
    while len(radii) < count:
        radius, need = rng.uniform(0.05, 0.15), 2 if flat else 3
        if len(radii) >= need and rng.random() < 0.7:
            below = rng.choice(len(radii), need, replace=False)

            def gaps(x, below=below, radius=radius):
                apart = [np.linalg.norm(x - centers[k]) - radii[k] - radius for k in below]
                return [*apart, x[1]] if flat else apart

            start = np.mean([centers[k] for k in below], axis=0) + np.array([0.0, 0.0, 1.5 * radius])
            center, _, found, _ = fsolve(gaps, start, full_output=True, xtol=1e-15)
            if found != 1 or center[2] < 1.02 * radius or np.abs(gaps(center)).max() > 1e-13:
                continue
        else:
            center = np.array([rng.uniform(-0.3, 0.3), 0.0 if flat else rng.uniform(-0.3, 0.3), radius])
        clear = [
            np.linalg.norm(center - c) >= r + radius - 1e-12 for c, r in zip(centers, radii, strict=True)
        ]
        if all(clear):
            radii.append(radius)
            centers.append(center)
    return radii, centers


def beside_a_rough_rotor(case):
    """The same bodies beside a pendulum whose friction holds it, in one scene."""
    model = case.scene.model.copy()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3(np.eye(3), np.array([0.0, 0.0, 5.0])), "rotor")
    model.appendBodyToJoint(
        joint, pin.Inertia(1.0, np.array([0.0, 0.1, 0.0]), 0.01 * np.eye(3)), pin.SE3.Identity()
    )
    scene = pn.Scene(
        model,
        contacts=case.scene.contacts,
        laws=[pn.JointFriction("rotor", coulomb=2.0)],
        q0=np.append(case.scene.q0, 0.0),
    )
    return Wedged(scene, case.touches, case.centers, case.loads)


def on_points(case):
    """The inertia, gravity and (point, normal, mu) of a case of one body."""
    inertia = case.scene.model.inertias[1]
    touches = [(touch.point, touch.normal, touch.mu) for touch in case.touches]
    return inertia, case.loads[:3] / inertia.mass, touches


def transformed(inertia, gravity, touches, *, turn=None, length=1.0, mass=1.0, order=None, copies=1):
    """Acceleration from rest of one body after a change, in the first axes and units.

    Args:
        inertia: of the body.
        gravity: in world axes.
        touches: (point, normal, mu) of each contact.
        turn: rotation of the world, (3, 3).
        length: new units of length per old one.
        mass: new units of mass per old one.
        order: permutation of the contacts.
        copies: times that each contact is stated.
    """
    turn = np.eye(3) if turn is None else turn
    order = range(len(touches)) if order is None else order
    body = pin.Inertia(inertia.mass * mass, np.zeros(3), inertia.inertia * mass * length**2)
    model = model_of([body], turn @ gravity * length)
    contacts = []
    for k in order:
        point, normal, mu = touches[k]
        for copy in range(copies):
            name = f"{k} {copy}"
            add_frame(model, f"foot {name}", 1, point * length, np.eye(3))
            add_plane(model, f"plane {name}", turn @ point * length, turn @ normal)
            touch = pn.PointContact(f"foot {name}", mu=mu, plane=f"plane {name}", name=f"touch {name}")
            contacts.append(touch)
    q0 = np.concatenate([np.zeros(3), pin.Quaternion(turn).coeffs()])
    scene = pn.Scene(model, contacts=contacts, q0=q0)
    a = scene.solve(*scene.initial_state()).a.copy()  # in the axes of the body, which turn with the world
    a[:3] /= length
    return a


FAMILIES = (ball_between_planes, box_in_corner, uneven_stance, table_in_valley, pile_of_balls)
