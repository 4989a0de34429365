"""Bipeds on box-shaped soles that stand, sway and fall: no false end, no corner through the ground."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import body, empty, frame

# Penetration of a corner beyond the tolerance [m]. Corners that land together differ by the tolerance.
INSIDE = 1e-9
CORNERS = [(-0.08, -0.05), (-0.08, 0.05), (0.12, -0.05), (0.12, 0.05)]


def biped(
    seed: int, mu: float, kp: float = 0.0, kd: float = 0.0, lift: float = 0.0
) -> tuple[pn.Scene, np.ndarray]:
    """A random trunk on two legs of five joints with soles of four corners, tilted and bent a little."""
    rng = np.random.default_rng(seed)
    model, contacts = empty(), []
    trunk = np.diag(rng.uniform(0.2, 0.6, 3))
    base = body(
        model,
        0,
        pin.JointModelFreeFlyer(),
        "trunk",
        rng.uniform(5.0, 20.0),
        lever=np.array([0.0, 0.0, 0.2]),
        inertia=trunk,
    )
    kinds = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRY, pin.JointModelRY, pin.JointModelRX)
    for leg, y in enumerate((-0.1, 0.1)):
        joint, place = base, np.array([0.0, y, 0.0])
        for k, (kind, down) in enumerate(zip(kinds, (0.05, 0.4, 0.4, 0.05, 0.0), strict=True)):
            joint = body(
                model,
                joint,
                kind(),
                f"leg {leg} {k}",
                rng.uniform(0.3, 2.0),
                place=pin.SE3(np.eye(3), place),
                lever=np.array([0.0, 0.0, -0.1]),
                inertia=np.diag(rng.uniform(0.002, 0.02, 3)),
            )
            place = np.array([0.0, 0.0, -down])
        for k, (x, across) in enumerate(CORNERS):
            frame(model, f"sole {leg} {k}", joint, pin.SE3(np.eye(3), np.array([x, across, -0.05])))
            contacts.append(pn.PointContact(f"sole {leg} {k}", mu=mu, name=f"sole {leg} {k}"))
    move = np.concatenate(
        [np.zeros(3), 0.1 * rng.standard_normal(3), 0.08 * rng.standard_normal(model.nv - 6)]
    )
    q = pin.integrate(model, pin.neutral(model), move)
    actuation = {"actuation": pn.HoldPosition(kp=kp, kd=kd)} if kp else {}
    scene = pn.Scene(model, contacts=contacts, q0=pin.neutral(model), **actuation)
    q[2] += lift - heights(scene, q).min()
    return scene, q


def heights(scene: pn.Scene, q: np.ndarray) -> np.ndarray:
    """Return the heights of all corners above the ground."""
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, q)
    return np.array([data.oMf[scene.model.getFrameId(name)].translation[2] for name in scene.contact_names])


def check(seed: int, mu: float, rtol: float, duration: float, **more: float) -> None:
    scene, q = biped(seed, mu, **more)
    still = np.zeros(scene.model.nv)
    run = pn.simulate(scene, duration, q=q, v=still, rtol=rtol, atol=1e-2 * rtol, record="energy")
    assert run.t[-1] == duration
    assert min(heights(scene, at).min() for at in run.q) >= -INSIDE - rtol
    assert len(run.events) > 10
    assert run.energy["impacts"][-1] <= 0.0  # plastic impacts take


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize(("seed", "mu"), [(0, 0.0), (2, 0.3), (8, 0.7)])
def test_falls(seed: int, mu: float, rtol: float) -> None:
    check(seed, mu, rtol, 0.3)


@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
@pytest.mark.parametrize("seed", [2, 3, 9, 11, 19])
def test_a_corner_that_others_hold_hides_no_landing(seed: int, rtol: float) -> None:
    """Gap and gap rate of the corner are rounding, so any instant may be that of its touch."""
    check(seed, 0.0, rtol, 0.3, kp=20.0, kd=0.4)


def test_a_corner_slides_under_hardly_any_load() -> None:
    """Talos leans until a corner of an edge lifts: its load falls to 1e-5 of the load of the other corner."""
    talos = pn.load("talos")
    model, contacts = talos.model, []
    for sole in ("left_sole_link", "right_sole_link"):
        of = model.frames[model.getFrameId(sole)]
        for k, (x, y) in enumerate([(-0.1, -0.06), (-0.1, 0.06), (0.1, -0.06), (0.1, 0.06)]):
            frame(
                model, f"{sole} {k}", of.parentJoint, of.placement * pin.SE3(np.eye(3), np.array([x, y, 0.0]))
            )
            contacts.append(pn.PointContact(f"{sole} {k}", mu=0.7, name=f"{sole} {k}"))
    scene = pn.Scene(model, contacts=contacts, actuation=pn.HoldPosition(kp=500.0, kd=20.0), q0=talos.q0)
    q0 = talos.q0.copy()
    q0[2] -= heights(scene, q0).min()
    scene = pn.Scene(model, contacts=contacts, actuation=pn.HoldPosition(kp=500.0, kd=20.0), q0=q0)
    bent = 0.05 * np.random.default_rng(1).standard_normal(model.nv - 6)
    q = pin.integrate(model, q0, np.concatenate([[0.0, 0.0, 0.02, 0.05, 0.1, 0.0], bent]))
    run = pn.simulate(scene, 0.96, q=q, v=np.zeros(model.nv), rtol=1e-4, atol=1e-6)
    assert run.t[-1] == 0.96
