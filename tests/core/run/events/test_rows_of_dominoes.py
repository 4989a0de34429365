"""Rows of dominoes that fall: event-driven runs beside time stepping at short steps."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.mechanisms import empty
from ....support.seeds import seeds

DURATION, STEP = 0.35, 1e-4  # s
PER_STEP = 10.0  # largest difference to time stepping, per step [m/s, or 1/s of a quaternion]


def row(seed: int) -> pn.Scene:
    """Return dominoes of two widths in a row, of which the first turns about its front edge."""
    rng = np.random.default_rng(seed)
    count, thick, high = int(rng.integers(2, 6)), rng.uniform(0.02, 0.05), rng.uniform(0.15, 0.25)
    wide, apart, spin = rng.uniform(0.05, 0.12), rng.uniform(1.5, 3.0) * thick, rng.uniform(1.5, 4.0)
    mu = rng.uniform(0.1, 0.8)
    model, shapes = empty((0.0, 0.0, -9.81)), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    for k in range(count):
        box = coal.Box(thick, wide * (1.0 - 0.1 * (k % 2)), high)
        place = (apart * k, 0.0, 0.5 * high)
        pn.free_body(model, f"domino {k}", box, density=500.0, collision_model=shapes, place=place)
    contacts = pn.ground_contacts(model, shapes, mu=mu)
    contacts += [pn.GeometryContact(f"domino {k + 1}", f"domino {k}", mu=mu) for k in range(count - 1)]
    v = np.zeros(6 * count)
    v[:6] = (0.5 * high * spin, 0.0, 0.5 * thick * spin, 0.0, spin, 0.0)
    return pn.Scene(model, contacts=contacts, collision_model=shapes, v0=v)


@pytest.mark.parametrize("seed", seeds(range(100)))
def test_events_of_falling_dominoes_follow_time_stepping(seed: int) -> None:
    """Leaning dominoes that friction can hold may rest or fall back: events rest, and the comparison ends."""
    scene = row(seed)
    run = pn.simulate(scene, DURATION)
    rests = ~run.v.any(axis=1)
    end = int(np.argmax(rests)) if rests.any() else -1
    steps = pn.simulate(scene, run.t[end], method="moreau", dt=STEP, output_dt=run.t[end])
    assert np.abs(run.q[end] - steps.q[-1]).max() < PER_STEP * STEP
