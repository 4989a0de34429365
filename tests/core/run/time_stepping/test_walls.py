"""Pyramids of bricks: rest is decided tree by tree, and recorded forces hold each brick within the cones."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

SIZE = np.array([0.2, 0.1, 0.1])  # of a brick [m]
MU, MASS, GRAVITY = 0.6, 2.0, 9.81
ROUNDING = 1e-7  # part of the weight of the pyramid


def pyramid(
    rows: int, length: float = 1.0, mass: float = 1.0, shuffled: bool = False
) -> tuple[pn.Scene, list[np.ndarray]]:
    """Return rows of bricks, each with one brick less than the row below, and the centers of the bricks.

    The scene may have other units, and bricks and contacts may be in another order.
    """
    size, rng = length * SIZE, np.random.default_rng(rows)
    places = [(row, 2 * column + row) for row in range(rows) for column in range(rows - row)]
    centers = [np.array([0.5 * size[0] * side, 0.0, size[2] * (row + 0.5)]) for row, side in places]
    model, shapes = pin.Model(), pin.GeometryModel()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY * length])
    shapes.addGeometryObject(pn.ground())
    order = rng.permutation(len(places)) if shuffled else range(len(places))
    for k in order:
        pn.free_body(model, f"brick {k}", coal.Box(*size), mass=MASS * mass, collision_model=shapes)
    q0 = np.concatenate([[*centers[k], 0.0, 0.0, 0.0, 1.0] for k in order])
    contacts = [
        pn.GeometryContact(f"brick {k}", f"brick {m}", mu=MU)
        for k, (row, side) in enumerate(places)
        for m, (below, other) in enumerate(places)
        if below == row - 1 and abs(side - other) == 1
    ]
    contacts += [pn.GeometryContact(f"brick {k}", "ground", mu=MU) for k in range(rows)]
    if shuffled:
        contacts = [contacts[i] for i in rng.permutation(len(contacts))]
    return pn.Scene(model, contacts=contacts, collision_model=shapes, q0=q0), centers


@pytest.mark.parametrize("rows", [3, 7, pytest.param(12, marks=pytest.mark.slow)])
def test_a_pyramid_rests_on_forces_within_the_cones(rows: int) -> None:
    scene, centers = pyramid(rows)
    run = pn.simulate(scene, 0.02, method="moreau", dt=1e-3, output_dt=0.01, record="contact_points")
    assert not run.v.any()
    weight = MASS * GRAVITY
    carried = {f"brick {k}": np.array([0.0, 0.0, -weight, 0.0, 0.0, 0.0]) for k in range(len(centers))}
    for name, points in run.contact_points.items():
        forces, at = points.forces[-1], points.places[-1]
        assert (forces[:, 2] >= -ROUNDING * weight * len(centers)).all()
        friction = np.linalg.norm(forces[:, :2], axis=1)
        assert (friction <= MU * forces[:, 2] + ROUNDING * weight * len(centers)).all()
        for body, sign in zip(run.contact(name).bodies, (1.0, -1.0), strict=True):
            if body in carried:
                arms = at - centers[int(body.split()[1])]
                carried[body] += sign * np.append(forces.sum(axis=0), np.cross(arms, forces).sum(axis=0))
    assert max(np.abs(wrench).max() for wrench in carried.values()) < ROUNDING * weight * len(centers)


def test_a_brick_beyond_its_support_tips_and_the_others_rest() -> None:
    scene, centers = pyramid(6)
    q = scene.q0.copy()
    q[-7] += 1.1 * SIZE[0]  # the top brick
    run = pn.simulate(scene, 0.05, q=q, method="moreau", dt=1e-3, output_dt=0.01)
    speeds = np.abs(run.v[-1].reshape(-1, 6)).max(axis=1)
    assert speeds[-1] > 0.1
    assert (speeds == 0.0).sum() > len(centers) // 2


def shares(scene: pn.Scene) -> dict[frozenset[str], float]:
    """Return the size of the force of each contact at rest, by its bodies."""
    run = pn.simulate(scene, 0.01, method="moreau", dt=1e-3, output_dt=0.01, record="forces")
    assert not run.v.any()
    forces = {
        frozenset(run.contact(name).bodies): run.contact_forces[name][-1] for name in run.contact_forces
    }
    return {bodies: float(np.linalg.norm(force)) for bodies, force in forces.items()}


@pytest.mark.parametrize("rows", [4, pytest.param(8, marks=pytest.mark.slow)])
def test_units_and_order_change_no_load(rows: int) -> None:
    loads = shares(pyramid(rows)[0])
    images = {
        "another order": (pyramid(rows, shuffled=True)[0], 1.0),
        "millimeters": (pyramid(rows, length=1e3)[0], 1e3),
        "grams": (pyramid(rows, mass=1e3)[0], 1e3),
    }
    for name, (scene, unit) in images.items():
        for bodies, load in shares(scene).items():
            assert load / unit == pytest.approx(loads[bodies], abs=1e-9 * max(loads.values())), name
