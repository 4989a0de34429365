"""Onsets of slip in several directions, which SciPy's methods cannot follow, are refused at once by name."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import StepSizeError

from ...support.mechanisms import body, empty, frame

KINDS = {
    "planar": pin.JointModelPlanar(),
    "translation": pin.JointModelTranslation(),
    "ball": pin.JointModelSpherical(),
    "flyer": pin.JointModelFreeFlyer(),
}
METHODS = ["Radau", "BDF", "LSODA"]


def pushed(kind, static_ratio=1.0, straight=False):
    """A body on rough joints, pushed harder and harder in a direction that turns, from rest."""
    model = empty(gravity=(0.0, 0.0, 0.0))
    body(model, 0, KINDS[kind], "b", 1.0, inertia=np.diag([0.1, 0.2, 0.3]))
    area = {"radius": 0.1} if kind in ("planar", "flyer") else {}
    law = pn.JointFriction("b", coulomb=1.0, static_ratio=static_ratio, **area)

    def torque(t, q, v):
        out = np.zeros(model.nv)
        out[:2] = 1.4 * t, 0.5 * t + (0.0 if straight else 0.4 * t**2)
        return out

    return pn.Scene(model, laws=[law], actuation=torque)


def hung():
    """A ball anchor in place of the joint."""
    model = empty(gravity=(0.0, 0.0, 0.0))
    flyer = body(model, 0, pin.JointModelFreeFlyer(), "b", 1.0, inertia=np.diag([0.1, 0.2, 0.3]))
    frame(model, "a", flyer)
    law = pn.JointFriction("pin", coulomb=1.0)
    return pn.Scene(
        model,
        constraints=[pn.PointAnchor("a", name="pin")],
        laws=[law],
        actuation=lambda t, q, v: np.array([0.0, 0.0, 0.0, 1.4 * t, 0.5 * t + 0.4 * t**2, 0.1 * t]),
    )


SCENES = {**{kind: (lambda kind=kind: pushed(kind), "b") for kind in KINDS}, "anchor": (hung, "pin")}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", list(SCENES))
def test_an_onset_in_several_directions_names_the_method_that_follows_it(name, method):
    make, element = SCENES[name]
    scene = make()
    with pytest.raises(StepSizeError) as caught:
        pn.simulate(scene, 1.5, method=method)
    assert re.search(
        rf'{method} cannot continue at t = 0\.6\d+ s: "JointFriction\({element}\)[^"]*" begins to slip in '
        r"several directions with hardly any acceleration, and its direction relaxes faster than any "
        r'step; use method="dop853",',
        str(caught.value),
    )
    assert caught.value.trajectory.stats.evaluations < 2000
    assert caught.value.trajectory.t[-1] == pytest.approx(caught.value.time)
    assert pn.simulate(scene, 1.5).stats.steps < 200


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", list(KINDS))
def test_an_onset_that_jumps_is_followed(kind, method):
    """Static friction is a fifth above kinetic friction, so slip begins with an acceleration."""
    scene = pushed(kind, static_ratio=1.2)
    run, core = (pn.simulate(scene, 1.2, method=m, rtol=1e-9, atol=1e-11) for m in (method, "dop853"))
    np.testing.assert_allclose(run.v[-1], core.v[-1], rtol=0.0, atol=1e-5)
