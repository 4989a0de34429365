"""Time steps of smooth friction laws, beside runs of adaptive methods at tight tolerances."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

DURATION = 2.0


def pendulum(law: pn.Law, far_contact: bool = False) -> pn.Scene:
    """Return a pendulum that swings from an angle of 1 rad."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "swing")
    center = np.array([0.0, 0.0, -0.5])
    model.appendBodyToJoint(joint, pin.Inertia(1.0, center, 0.01 * np.eye(3)), pin.SE3.Identity())
    model.addFrame(
        pin.Frame("tip", joint, 0, pin.SE3(np.eye(3), 2.0 * center), pin.FrameType.OP_FRAME), False
    )
    contacts = [pn.PointContact("tip", height=-10.0, mu=0.5)] if far_contact else []
    return pn.Scene(model, laws=[law], contacts=contacts, q0=[1.0])


def bristles(stiffness: float, damping: float) -> pn.LuGre:
    return pn.LuGre(
        "swing",
        stiffness=stiffness,
        damping=damping,
        coulomb=0.3,
        stiction=0.45,
        stribeck_velocity=0.1,
        viscous=0.05,
    )


def error(scene: pn.Scene, dt: float, reference: pn.Trajectory) -> float:
    run = pn.simulate(scene, DURATION, method="moreau", dt=dt, output_dt=0.05)
    return float(np.abs(run.q - reference.q).max())


@pytest.mark.parametrize("far_contact", [False, True])
@pytest.mark.parametrize(
    "law",
    [
        bristles(300.0, 1.0),
        pn.SigmoidFriction("swing", phi1=1.0, phi2=20.0, phi3=0.05),
    ],
    ids=["soft bristles", "sigmoid"],
)
def test_steps_of_smooth_friction_are_of_second_order(law: pn.Law, far_contact: bool) -> None:
    scene = pendulum(law, far_contact)
    reference = pn.simulate(pendulum(law), DURATION, method="Radau", rtol=1e-10, atol=1e-12, output_dt=0.05)
    coarse, fine = error(scene, 1e-3, reference), error(scene, 0.25e-3, reference)
    assert np.log(coarse / fine) / np.log(4.0) > 1.8


@pytest.mark.parametrize("stiffness", [1e5, 1e6, 1e8])
def test_bristles_of_the_literature_take_steps_of_a_millisecond(stiffness: float) -> None:
    law = bristles(stiffness, np.sqrt(stiffness))
    reference = pn.simulate(pendulum(law), DURATION, method="Radau", rtol=1e-9, output_dt=0.05)
    assert error(pendulum(law), 1e-3, reference) < 5e-3  # a reversal inside a step is resolved to first order
