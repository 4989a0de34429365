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


def pyramid(rows: int) -> tuple[pn.Scene, list[np.ndarray]]:
    """Return rows of bricks, each with one brick less than the row below, and the centers of the bricks."""
    model, shapes = pin.Model(), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    places, centers, contacts = [], [], []
    for row in range(rows):
        for column in range(rows - row):
            place = (row, 2 * column + row)
            name = f"brick {len(places)}"
            pn.free_body(model, name, coal.Box(*SIZE), mass=MASS, collision_model=shapes)
            contacts += [
                pn.GeometryContact(name, f"brick {k}", mu=MU)
                for k, (below, side) in enumerate(places)
                if below == row - 1 and abs(side - place[1]) == 1
            ]
            if row == 0:
                contacts.append(pn.GeometryContact(name, "ground", mu=MU))
            places.append(place)
            centers.append(np.array([0.5 * SIZE[0] * place[1], 0.0, SIZE[2] * (row + 0.5)]))
    q0 = np.concatenate([[*center, 0.0, 0.0, 0.0, 1.0] for center in centers])
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
