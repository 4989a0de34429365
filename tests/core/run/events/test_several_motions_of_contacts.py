"""A run that takes one of several motions goes on by time stepping where no motion of contacts is known."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

COUNT = 10
THICK, HIGH, APART = 0.03, 0.2, 0.08  # [m]
SPIN = 3.0  # speed about the front edge [rad/s]


def dominoes() -> pn.Scene:
    """Return a row of dominoes of two widths, of which the first falls on the others."""
    model, shapes = pin.Model(), pin.GeometryModel()
    for k in range(COUNT):
        shape = coal.Box(THICK, 0.1 - 0.01 * (k % 2), HIGH)
        place = (APART * k, 0.0, 0.5 * HIGH)
        pn.free_body(model, f"domino {k}", shape, 1000.0, collision_model=shapes, place=place)
    contacts = pn.ground_contacts(model, shapes, mu=0.4)
    contacts += [pn.GeometryContact(f"domino {k + 1}", f"domino {k}", mu=0.4) for k in range(COUNT - 1)]
    v0 = np.zeros(model.nv)
    v0[[0, 2, 4]] = 0.5 * HIGH * SPIN, 0.5 * THICK * SPIN, SPIN
    return pn.Scene(model, contacts=contacts, collision_model=shapes, v0=v0)


@pytest.mark.slow
def test_dominoes_that_lie_on_each_other_go_on() -> None:
    """Which motion is taken decides later modes. At 0.769 s nothing tells if the laws have a motion."""
    run = pn.simulate(dominoes(), 0.77, output_dt=0.01, progress=False, several="continue")
    assert run.t[-1] == pytest.approx(0.77)
    assert any(event.kind == "chatter" and event.time > 0.76 for event in run.events)
    assert run.violation.max() < 1e-6
