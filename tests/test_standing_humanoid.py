"""A humanoid on two feet with dry friction in all joints: postures near singular ones, in which much sticks.

The pitch axes of two straight legs are parallel but for the little by which the pelvis leans.  When the other
joints stick, the feet then hold that little by a millionth of their forces.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

SOLES = ("left_sole_link", "right_sole_link")
# By which a sole may leave its place: far above rounding, far below what dropped rows would let it drift [m].
KEPT = 1e-9


def standing(coulomb: float, kp: float, kd: float) -> pn.Scene:
    """Talos, held by a controller of positions."""
    talos = pn.load("talos")
    model = talos.model
    return pn.Scene(
        model,
        constraints=[pn.FrameAnchor(sole) for sole in SOLES],
        laws=[pn.JointFriction(name, coulomb=coulomb) for name in list(model.names)[2:]],
        actuation=pn.HoldPosition(kp=kp, kd=kd),
        q0=talos.q0,
    )


@pytest.mark.parametrize(
    ("coulomb", "kp", "kd", "seed"),
    [(20.0, 500.0, 20.0, 1), (20.0, 500.0, 20.0, 2), (20.0, 200.0, 5.0, 1), (5.0, 200.0, 5.0, 1)],
)
def test_stands_on_both_soles(coulomb: float, kp: float, kd: float, seed: int) -> None:
    scene = standing(coulomb, kp, kd)
    model = scene.model
    rng = np.random.default_rng(seed)
    bent = np.concatenate([np.zeros(6), 0.02 * rng.standard_normal(model.nv - 6)])
    q, v = scene.project(pin.integrate(model, scene.q0, bent), np.zeros(model.nv))
    run = pn.simulate(scene, 1.0, q=q, v=v, max_steps=2000, record="energy")
    assert run.t[-1] == 1.0
    data = model.createData()
    for k in range(0, len(run), 5):
        pin.framesForwardKinematics(model, data, run.q[k])
        places = [data.oMf[model.getFrameId(sole)].copy() for sole in SOLES]
        if k == 0:
            first = places
        for now, then in zip(places, first, strict=True):
            assert np.abs(pin.log6(then.actInv(now)).vector).max() < KEPT
    rubbed = np.sum([run.energy[name] for name in scene.law_names], axis=0)
    assert (np.diff(rubbed) < 1e-9).all()  # friction only takes
    assert np.abs(run.energy["balance"]).max() < 1e-5
