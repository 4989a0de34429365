"""Time steps of joints whose friction follows the load, and samples at events of clipped torques."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

LINK, DT = 0.3, 1e-3
COM = np.array([0.0, 0.0, -0.5 * LINK])
INERTIA = pin.Inertia(1.0, COM, np.diag([0.01, 0.01, 0.005]))


def chain(count: int) -> pin.Model:
    model, parent = pin.Model(), 0
    for i in range(count):
        place = pin.SE3(np.eye(3), 2.0 * COM if i else np.zeros(3))
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"j{i}")
        model.appendBodyToJoint(parent, INERTIA, pin.SE3.Identity())
    return model


@pytest.mark.parametrize("far_contact", [False, True])
@pytest.mark.parametrize("radius", [0.62, 0.64, 0.66])
def test_limits_that_their_own_friction_loads_converge(radius: float, far_contact: bool) -> None:
    """Passes with the last limits do not contract at these radii: the friction of a wide bearing loads it."""
    contacts = [pn.PointContact("j0", height=-9.0)] if far_contact else []
    bearing = pn.JointFriction("j0", mu=0.3, radius=radius)
    scene = pn.Scene(chain(1), laws=[bearing], contacts=contacts, q0=[1.2], v0=[9.0])
    exact = pn.simulate(scene, 0.2, rtol=1e-10, atol=1e-12)
    run = pn.simulate(scene, 0.2, method="moreau", dt=DT)
    np.testing.assert_allclose(run.q[-1], exact.q[-1], rtol=0, atol=1e-4)


@pytest.mark.parametrize("radius", [0.1, 0.15, 0.18, 0.2, 0.21])
def test_limits_of_a_chain_of_wide_bearings_converge(radius: float) -> None:
    laws = [pn.JointFriction(f"j{i}", mu=0.3, radius=radius) for i in range(3)]
    scene = pn.Scene(chain(3), laws=laws, q0=[1.2, 0.5, -0.4], v0=[3.0, -2.0, 8.0])
    exact = pn.simulate(scene, 0.05, rtol=1e-10, atol=1e-12)
    for dt in (DT, 0.1 * DT):
        run = pn.simulate(scene, 0.05, method="moreau", dt=dt)
        np.testing.assert_allclose(run.q[-1], exact.q[-1], rtol=0, atol=0.1 * dt)


def test_samples_at_saturation_record_the_forces_of_their_instant() -> None:
    drive = pn.EffortLimits(pn.HoldPosition(20.0, 1.0), effort=[1.0, 0.5, 2.0])
    laws = [pn.JointFriction(f"j{i}", coulomb=0.3) for i in range(3)]
    scene = pn.Scene(chain(3), laws=laws, actuation=drive, q0=[0.1, 0.2, -0.4])
    options = {"method": "moreau", "dt": DT, "record": ("a", "forces")}
    run, every = (pn.simulate(scene, 0.3, **options, **more) for more in ({"output_dt": 0.01}, {}))
    at_events = [np.flatnonzero(every.t == time)[0] for time in run.t]
    assert len(run) > 31  # events add samples
    np.testing.assert_array_equal(run.q, every.q[at_events])
    np.testing.assert_array_equal(run.a, every.a[at_events])
    np.testing.assert_array_equal(run.F_nonideal, every.F_nonideal[at_events])
