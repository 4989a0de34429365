"""Contacts near rounding: initial contact with very small velocity."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import body, empty, frame

G = 9.81
# Height of a flight within rounding for a scene of one meter, see `low_flight` of the core.
LOW = 4e-12
SIZES = (0.2, 0.3, 0.1)


def resting(kind: str, **contact: Any) -> pn.Scene:
    """Return a body in contact with the ground: a ball of 0.1 m, or a box."""
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "body", 1.0, inertia=np.diag([0.01, 0.012, 0.015]))
    frame(model, "middle", joint, pin.SE3.Identity())
    height = 0.1 if kind == "ball" else SIZES[2] / 2.0
    contacts = (
        [pn.PointContact("middle", radius=0.1, **contact)]
        if kind == "ball"
        else pn.box_contacts("middle", SIZES, **contact)
    )
    return pn.Scene(model, contacts=contacts, q0=[0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("speed", [-1e-8, -1e-12, -1e-300, 0.0, 1e-300, 1e-12, 1e-8])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("kind", ["ball", "box"])
def test_what_touches_and_hardly_moves_rests(kind: str, restitution: float, speed: float) -> None:
    """With restitution 1 the body would bounce 1e12 times in half a second, below rounding."""
    scene = resting(kind, mu=0.7, restitution=restitution)
    run = pn.simulate(
        scene, 0.5, v=[0.0, 0.0, speed, 0.0, 0.0, 0.0], record=("forces", "energy"), max_wall=20.0
    )
    assert run.t[-1] == 0.5
    assert run.closed[-1].sum() == (1 if kind == "ball" else 4)
    np.testing.assert_allclose(run.q[:, :3], np.tile(scene.q0[:3], (len(run.t), 1)), atol=2.0 * LOW)
    np.testing.assert_allclose(sum(run.contact_forces.values())[-1], [0.0, 0.0, G], atol=1e-9)
    assert np.abs(run.energy["impacts"]).max() <= G * LOW


def test_what_bounces_higher_than_rounding_goes_on() -> None:
    """An elastic ball of 3e-4 m/s bounces every 2 v / g = 6e-5 s and keeps its energy."""
    speed, duration = 3e-4, 0.02001
    run = pn.simulate(
        resting("ball", restitution=1.0), duration, v=[0.0, 0.0, speed, 0.0, 0.0, 0.0], record="energy"
    )
    strikes = [event.time for event in run.events if event.kind == "impact"]
    np.testing.assert_allclose(np.diff(strikes), 2.0 * speed / G, rtol=1e-6)
    assert len(strikes) == int(duration / (2.0 * speed / G))
    np.testing.assert_allclose(run.energy["total"], run.energy["total"][0], atol=1e-12)
