"""Hints of errors name a valid remedy, and no remedy leads back to the same error."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, NonFiniteError, StiffnessError

from ..support.mechanisms import body, empty, frame
from ..support.refusals import refuses


def stiff_on_the_ground(**parts):
    """Return a block on the ground with a finger whose damping is a million times its inertia."""
    model = empty()
    block = body(model, 0, pin.JointModelPZ(), "block", 1.0)
    body(model, block, pin.JointModelRX(), "finger", 1e-6, lever=(0.0, 1e-3, 0.0))
    frame(model, "sole", block)
    frame(model, "ground", 0)
    return pn.Scene(
        model,
        contacts=[pn.PointContact("sole", 0.5, plane="ground", name="sole")],
        laws=[pn.JointFriction("finger", viscous=0.1)],
        v0=[0.0, 1.0],
        **parts,
    )


def stiff_and_sampled():
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "slide", 1.0)
    control = pn.SampledControl(lambda t, q, v: [1.0], 0.5)
    return pn.Scene(model, laws=[pn.JointFriction("slide", viscous=1e9)], actuation=control)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (stiff_on_the_ground, 'no implicit method supports contacts that open, such as "sole"'),
        (stiff_and_sampled, "no implicit method supports the held torques of a SampledControl"),
    ],
)
def test_stiffness_names_no_method_that_refuses_the_scene(make, why):
    scene = make()
    with pytest.raises(StiffnessError) as caught:
        pn.simulate(scene, 10.0)
    assert "Radau" not in str(caught.value)
    assert f"or allow the steps with max_steps, since {why}" in str(caught.value)
    with pytest.raises(InputError):
        pn.simulate(scene, 10.0, method="Radau")


def test_the_refusal_of_contacts_names_max_steps():
    words = "with max_steps if the scene is stiff, or keep it closed with unilateral=False"
    with refuses(words, InputError):
        pn.simulate(stiff_on_the_ground(), 1.0, method="Radau")


def test_fixed_steps_that_overflow_name_shorter_ones():
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelPX(), "slide", 1.0)
    scene = pn.Scene(model, forces=[pn.JointSpring("slide", 1e8)], v0=[1.0])
    words = (
        ": the motion overflows if steps of dt = 0.01 s are too long for the stiffest force; use a shorter "
        'dt, or method="dop853", with max_steps if the scene is stiff; the trajectory up'
    )
    with refuses(words, NonFiniteError):
        pn.simulate(scene, 10.0, method="rk4", dt=0.01)
    for method in ("semi_implicit_euler", "moreau"):  # implicit springs
        assert np.abs(pn.simulate(scene, 10.0, method=method, dt=0.01).v).max() <= 1.0
