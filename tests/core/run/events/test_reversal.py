"""Reversal of a body at the same instant as slip onset of a sticking contact."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.mechanisms import body, empty, frame, hinge

# Energy error of the steps, of 40 J. Friction in the wrong direction has an error of 0.02 J.
BALANCED = 1e-8
# Error of fixed steps of 1e-4 s and of default tolerances of adaptive methods [m or rad, and their rates].
AGREED = 1e-4

# State of a body that rocks on two feet, with three arms on their stops and a fourth limb on the floor.
Q = [
    *(0.09696395065729727, -0.33381903009585595, -0.04978739597504663),
    *(-0.9636872296683546, 0.263022590521419, 0.04003821805126653, -0.022868785381238006),
    *(0.041491076567847916, 0.4165768345965559, -0.1791905566305888, 0.5010555228345275),
]
ROCKS = np.array([0.02, -0.02, 0.0, 0.4, 0.4, 0.0, -0.848172, 0.0, 0.0, 0.0])


def limbs():
    """A trunk on two feet with random limbs of one hinge each."""
    draw = np.random.default_rng(99)
    model, contacts, laws = empty(), [], []
    trunk = body(model, 0, pin.JointModelFreeFlyer(), "trunk", 2.0, inertia=0.05 * np.eye(3))
    for name, side in (("left", 1.0), ("right", -1.0)):
        frame(model, name, trunk, pin.SE3(np.eye(3), np.array([0.1 * side, 0.1 * side, -0.05])))
        contacts.append(pn.PointContact(name, mu=0.6, restitution=0.2))
    for k in range(draw.integers(1, 5)):
        parent, axis = int(draw.integers(1, model.njoints)), draw.normal(size=3)
        joint = body(
            model,
            parent,
            hinge(*axis / np.linalg.norm(axis)),
            f"j{k}",
            0.4,
            place=pin.SE3(np.eye(3), draw.uniform(-0.2, 0.2, 3)),
            lever=(0.0, 0.0, -0.1),
            inertia=4e-3 * np.eye(3),
        )
        frame(model, f"f{k}", joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.22])))
        mu, e = float(draw.uniform(0.1, 0.9)), float(draw.uniform(0.0, 0.5))
        contacts.append(pn.PointContact(f"f{k}", mu=mu, radius=0.02, restitution=e))
        lower, upper = -float(draw.uniform(0.1, 0.8)), float(draw.uniform(0.1, 0.8))
        contacts.append(pn.JointLimit(f"j{k}", lower, upper, restitution=float(draw.choice([0, 0.3]))))
        if draw.random() < 0.5:
            laws.append(pn.JointFriction(f"j{k}", coulomb=0.02, viscous=0.01))
        elif draw.random() < 0.4:
            laws.append(pn.JointFriction(f"j{k}", mu=0.1, radius=0.02, viscous=0.01))
    return pn.Scene(model, contacts=contacts, laws=laws)


@pytest.mark.parametrize("method", ["dop853", "dopri5"])
@pytest.mark.parametrize("speed", [0.3, 0.55])
def test_rocks_back(method, speed):
    """The run agrees with fixed steps, and its energy ledger closes."""
    scene = limbs()
    run = pn.simulate(scene, 0.15, q=Q, v=speed * ROCKS, method=method, record="energy")
    fixed = pn.simulate(scene, 0.15, q=Q, v=speed * ROCKS, method="rk4", dt=1e-4)
    assert np.abs(run.energy["balance"]).max() < BALANCED
    np.testing.assert_allclose(run.q[-1], fixed.q[-1], rtol=0.0, atol=AGREED)
    np.testing.assert_allclose(run.v[-1], fixed.v[-1], rtol=0.0, atol=AGREED)
    assert run.v[-1][3] < 0.0 < run.v[0][3]
