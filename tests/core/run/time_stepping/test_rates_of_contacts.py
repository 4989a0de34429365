"""Rates of closed contacts at the ends of time steps are zero to rounding, for bodies that tumble."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

DT = 2e-3  # [s]
# Rate of a closed contact that is rounding error, relative to the largest velocity [m/s or rad/s].
ROUNDING = 1e-12


def thrown(seed: int) -> pn.Scene:
    """Return a box, a can or a capsule that tumbles on a floor."""
    rng = np.random.default_rng(seed)
    shape = (coal.Box(0.2, 0.14, 0.1), coal.Cylinder(0.06, 0.15), coal.Capsule(0.05, 0.12))[seed % 3]
    model, shapes = pin.Model(), pin.GeometryModel()
    pn.free_body(model, "body", shape, 1000.0, collision_model=shapes)
    shapes.addGeometryObject(pn.ground("floor"))
    contacts = [pn.GeometryContact("body", "floor", mu=rng.uniform(0.1, 0.7))]
    axis = rng.normal(size=3)
    turn = pin.Quaternion(pin.exp3(axis / np.linalg.norm(axis) * rng.uniform(0.2, 3.0))).coeffs()
    start = {"q0": np.concatenate([[0.0, 0.0, 0.2], turn]), "v0": rng.normal(size=6) * [1, 1, 1, 4, 4, 4]}
    return pn.Scene(model, contacts=contacts, collision_model=shapes, **start)


@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(k, marks=pytest.mark.slow) for k in range(6, 40))]
)
def test_closed_contacts_neither_open_nor_close_at_the_end_of_a_step(seed: int) -> None:
    """Before, each second step left rates of 3e-5 m/s, and `at` gave other velocities than the samples."""
    run = pn.simulate(thrown(seed), 0.8, method="moreau", dt=DT, record="dense")
    scale = 1.0 + np.abs(run.v).max()
    assert run.violation_rate.max() <= ROUNDING * scale
    for k in range(1, len(run.t) - 1):
        assert np.abs(run.at(run.t[k]).v - run.v[k]).max() <= ROUNDING * scale
