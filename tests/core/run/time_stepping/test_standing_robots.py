"""Robots on feet with several contacts, held by drives: contacts carry the change of momentum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

DT = 1e-3  # [s]
LANDED = 0.05  # duration after which all feet stand [s]
OFF = 0.02  # part of the weight: an acceleration at an instant beside the difference of a step


def corners(link: str) -> list[pn.PointContact]:
    """Return contacts at the corners of a sole."""
    places = [(x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.06, 0.06)]
    return [pn.PointContact(link, mu=0.7, offset=at, name=f"{link} {k}") for k, at in enumerate(places)]


def talos(stiffness: float, damping: float) -> Any:
    scene = pn.load("talos")
    feet = [*corners("left_sole_link"), *corners("right_sole_link")]
    return scene.replace(add_contacts=feet, actuation=pn.HoldPosition(stiffness, damping)).put_on_ground()


@pytest.mark.parametrize("gains", [(5000.0, 100.0), (20000.0, 300.0)], ids=str)
def test_contacts_carry_the_change_of_momentum(gains: tuple[float, float]) -> None:
    scene = talos(*gains)
    model = scene.model
    data, mass = model.createData(), sum(inertia.mass for inertia in list(model.inertias)[1:])
    run = pn.simulate(scene, 0.3, method="moreau", dt=DT, output_dt=DT, record="forces", progress=False)
    states = zip(run.q, run.v, strict=True)
    momentum = [pin.computeCentroidalMomentum(model, data, q, v).linear.copy() for q, v in states]
    rates = np.gradient(np.array(momentum), DT, axis=0)
    carried = sum(run.contact_forces[contact.name] for contact in scene.contacts)
    needed = rates - mass * model.gravity.linear
    standing = run.t > LANDED
    assert run.closed[standing].all()
    assert np.abs(carried - needed)[standing][:-1].max() < OFF * mass * 9.81
