"""Symmetric images of scenes have the image motions.

Contacts are declared in another order, a scene is mirrored, moved with its plane, or its lengths, masses and
times are multiplied.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import body, empty, frame

MIRROR = np.diag([1.0, -1.0, 1.0])
DURATION, SAMPLES = 0.8, 200
# Difference of one motion in other coordinates [m, unit quaternions]: tolerance 1e-10, growth by impacts.
SAME = 1e-7


def drawn(seed: int) -> dict[str, Any]:
    """Return one to three random bodies that fall on a tilted plane and on each other."""
    rng = np.random.default_rng(seed)
    bodies = []
    for i in range(int(rng.integers(1, 4))):
        bodies.append(
            {
                "mass": float(10 ** rng.uniform(-1.0, 1.0)),
                "inertia": np.diag(rng.uniform(0.5, 1.0, 3) * 0.02),
                "at": np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), 0.3 + 0.45 * i]),
                "rpy": rng.uniform(-1.0, 1.0, 3),
                "v": rng.uniform(-1.0, 1.0, 3),
                "w": rng.uniform(-3.0, 3.0, 3),
            }
        )
    normal = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), 1.0])
    normal /= np.linalg.norm(normal)
    contacts: list[tuple[Any, ...]] = []

    def rubs() -> tuple[float, float]:
        return float(rng.choice([0.0, 0.2, 0.6])), float(rng.choice([0.0, 0.0, 0.3, 0.7]))

    for i in range(len(bodies)):
        kind, law = rng.integers(0, 4), rubs()
        if kind == 0:
            corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
            contacts += [("point", law, i, np.array(c) * [0.15, 0.1, 0.08], 0.0) for c in corners]
        elif kind == 1:
            contacts.append(("point", law, i, np.zeros(3), 0.12))
        elif kind == 2:
            contacts.append(("ellipsoid", law, i))
        else:
            contacts += [("point", law, i, np.array([0.0, y, 0.0]), 0.08) for y in (-0.1, 0.1)]
    for i in range(len(bodies)):
        for j in range(i):
            law = rubs()
            contacts.append((("spheres", "capsules", "box")[rng.integers(0, 3)], law, i, j))
    return {
        "bodies": bodies,
        "contacts": contacts,
        "normal": normal,
        "impact": str(rng.choice(["newton", "poisson"])),
    }


def made(
    what: dict[str, Any],
    order: Any = None,
    mirrored: bool = False,
    lengths: float = 1.0,
    masses: float = 1.0,
    times: float = 1.0,
    moved: Any = (0.0, 0.0, 0.0),
) -> pn.Scene:
    """The scene or its image."""
    turn, away = MIRROR if mirrored else np.eye(3), np.array(moved)
    model, q, v = empty(tuple(np.array([0.0, 0.0, -9.81]) * lengths / times**2)), [], []
    frame(model, "ground", 0, pin.SE3(np.eye(3), away))
    for i, b in enumerate(what["bodies"]):
        inertia = b["inertia"] * masses * lengths**2
        joint = body(model, 0, pin.JointModelFreeFlyer(), f"body {i}", b["mass"] * masses, inertia=inertia)
        frame(model, f"middle {i}", joint, pin.SE3.Identity())
        rotation = turn @ pin.utils.rpyToMatrix(*b["rpy"]) @ turn
        q += [*(turn @ b["at"] * lengths + away), *pin.Quaternion(rotation).normalized().coeffs()]
        v += [*(turn @ b["v"] * lengths / times), *(np.linalg.det(turn) * turn @ b["w"] / times)]
    contacts = [_contact(what, number, turn, lengths) for number in range(len(what["contacts"]))]
    return pn.Scene(
        model,
        contacts=contacts if order is None else [contacts[k] for k in order],
        q0=np.array(q),
        v0=np.array(v),
        impact=what["impact"],
    )


def _contact(what: dict[str, Any], number: int, turn: np.ndarray, lengths: float) -> Any:
    kind, (mu, restitution), i, *more = what["contacts"][number]
    name, law = f"middle {i}", {"mu": mu, "restitution": restitution, "name": f"contact {number}"}
    plane = {"plane": "ground", "normal": tuple(turn @ what["normal"]), **law}
    if kind == "point":
        place, radius = more
        return pn.PointContact(name, radius=radius * lengths, offset=tuple(turn @ place * lengths), **plane)
    if kind == "ellipsoid":
        return pn.EllipsoidContact(name, tuple(np.array([0.2, 0.15, 0.1]) * lengths), **plane)
    other = f"middle {more[0]}"
    if kind == "spheres":
        return pn.SphereContact(name, other, 0.12 * lengths, 0.12 * lengths, **law)
    if kind == "capsules":
        ends = np.array([[[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]], [[-0.1, 0.0, 0.0], [0.1, 0.05, 0.0]]])
        first, second = (tuple(map(tuple, pair)) for pair in ends @ turn * lengths)
        return pn.CapsuleContact(name, other, first, second, 0.08 * lengths, 0.08 * lengths, **law)
    size = tuple(np.array([0.3, 0.2, 0.16]) * lengths)
    return pn.BoxContact(name, other, size, 0.1 * lengths, 0.01 * lengths, **law)


def moves(what: dict[str, Any], **image: Any) -> np.ndarray:
    """Places of the bodies in the scene that is the original of an image, (samples, bodies, 7)."""
    lengths, times = image.get("lengths", 1.0), image.get("times", 1.0)
    step = DURATION * times / SAMPLES
    run = pn.simulate(made(what, **image), DURATION * times, output_dt=step, rtol=1e-10, atol=1e-13)
    q = run.q[run.grid].reshape(-1, len(what["bodies"]), 7).copy()
    q[:, :, :3] = (q[:, :, :3] - image.get("moved", np.zeros(3))) / lengths
    if image.get("mirrored"):
        q[:, :, [1, 3, 5]] *= -1.0
    return q


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the difference of two motions."""
    turned = np.sign(np.sum(one[:, :, 3:] * other[:, :, 3:], axis=2, keepdims=True))
    return float(
        max(np.abs(one[..., :3] - other[..., :3]).max(), np.abs(one[..., 3:] - turned * other[..., 3:]).max())
    )


IMAGES: dict[str, dict[str, Any]] = {
    "mirrored": {"mirrored": True},
    "moved": {"moved": np.array([3.0, -7.0, 2.0])},
    "scaled": {"lengths": 0.5, "masses": 32.0, "times": 4.0},
}


@pytest.mark.parametrize("image", IMAGES)
@pytest.mark.parametrize("seed", [0, 1, 10, 13, 18, 36, 54, 95])
def test_images_of_a_scene_move_as_its_images(seed: int, image: str) -> None:
    what = drawn(seed)
    assert apart(moves(what), moves(what, **IMAGES[image])) < SAME


@pytest.mark.parametrize("seed", [94, 124, 167, 172, 279, 332, 362])
def test_the_order_of_contacts_is_of_no_matter(seed: int) -> None:
    """Faces land with four corners, which share the impulse in many ways, and friction follows the shares."""
    what = drawn(seed)
    order = np.random.default_rng(seed + 10**6).permutation(len(what["contacts"]))
    assert apart(moves(what), moves(what, order=order)) < SAME


def test_rounding_of_an_impact_is_no_event() -> None:
    """A resting box is struck from the side: the impulses at its corners are rounding."""
    what = drawn(172)
    run = pn.simulate(made(what), DURATION, rtol=1e-10, atol=1e-13)
    strikes: dict[float, list[float]] = {}
    for event in run.events:
        if event.kind == "impact":
            strikes.setdefault(event.time, []).append(float(np.linalg.norm(event.impulse)))
    assert len(strikes) > 10
    assert all(min(sizes) > 1e-14 * max(sizes) for sizes in strikes.values())
