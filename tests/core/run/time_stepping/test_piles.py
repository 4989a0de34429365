"""Piles in time stepping: the laws hold in every step, whatever the number and the masses of the bodies."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

RADIUS = 0.05
WALL = 0.18  # [m], distance of the walls from the middle
SIDES = ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))
LAWS = 1e-9  # largest residual of the laws of contact, relative to the velocities and forces of an element


def balls_in_a_box(count: int, seed: int, ratio: float = 1.0, mu: float = 0.4) -> pn.Scene:
    """Balls in layers of nine above the floor of a box, every second one `ratio` times as heavy."""
    rng = np.random.default_rng(seed)
    model, q, contacts = pin.Model(), [], []
    for k in range(count):
        pn.free_body(model, f"ball{k}", coal.Sphere(RADIUS), mass=0.5 * (ratio if k % 2 else 1.0))
        place, layer = k % 9, k // 9
        across = 2.3 * RADIUS * np.array([place % 3 - 1, place // 3 - 1]) + 0.004 * rng.uniform(-1.0, 1.0, 2)
        q += [*across, 1.4 * RADIUS + 2.3 * RADIUS * layer, 0.0, 0.0, 0.0, 1.0]
        contacts.append(pn.PointContact(f"ball{k}", radius=RADIUS, mu=mu))
        contacts += [
            pn.PointContact(f"ball{k}", radius=RADIUS, mu=mu, normal=n, height=-WALL, name=f"wall {k} {i}")
            for i, n in enumerate(SIDES)
        ]
        contacts += [pn.SphereContact(f"ball{k}", f"ball{m}", RADIUS, RADIUS, mu=mu) for m in range(k)]
    return pn.Scene(model, contacts=contacts, q0=np.array(q))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))])
@pytest.mark.parametrize("ratio", [1.0, 1e3])
def test_the_laws_hold_in_each_step(seed: int, ratio: float) -> None:
    run = pn.simulate(balls_in_a_box(20, seed, ratio), 0.5, method="moreau", dt=1e-3, output_dt=0.05)
    told = {event.kind for event in run.events}
    if "relaxed" not in told:
        assert max(run.stats.signorini, run.stats.coulomb, run.stats.dissipation) < 100.0 * LAWS
    centers = run.q[:, [7 * k + i for k in range(20) for i in range(3)]].reshape(len(run.t), 20, 3)
    inside = 1e-3 * 2.0 * np.sqrt(2.0 * 9.81 * 0.4)  # a step's approach of two balls that fell from the top
    assert centers[..., 2].min() > RADIUS - inside
    assert np.abs(centers[..., :2]).max() < WALL - RADIUS + inside
    gaps = np.linalg.norm(centers[:, :, None] - centers[:, None], axis=-1) + 10.0 * np.eye(20)
    assert gaps.min() > 2.0 * RADIUS - inside


def test_a_pile_loses_energy() -> None:
    run = pn.simulate(balls_in_a_box(12, 3), 0.6, method="moreau", dt=1e-3, output_dt=0.02, record="energy")
    total = run.energy["kinetic"] + run.energy["potential"]
    assert (np.diff(total) < 1e-9 * np.abs(total).max()).all()


def test_separate_piles_move_as_if_alone() -> None:
    """Islands of contacts are solved one by one, so a pile far away changes nothing but rounding."""

    def pile(copies: int) -> pn.Scene:
        model, q, contacts = pin.Model(), [], []
        for copy in range(copies):
            for k, (x, z) in enumerate(((0.0, 1.0), (2.0, 1.0), (0.96, 2.8))):
                name = f"{copy} {k}"
                pn.free_body(model, name, coal.Sphere(RADIUS), mass=0.5)
                q += [RADIUS * x + 3.0 * copy, 0.0, RADIUS * z, 0.0, 0.0, 0.0, 1.0]
                contacts.append(pn.PointContact(name, radius=RADIUS, mu=0.3))
                contacts += [pn.SphereContact(name, f"{copy} {m}", RADIUS, RADIUS, mu=0.3) for m in range(k)]
        return pn.Scene(model, contacts=contacts, q0=np.array(q))

    one, two = (pn.simulate(pile(copies), 0.3, method="moreau", dt=1e-3, output_dt=0.05) for copies in (1, 2))
    np.testing.assert_allclose(two.q[:, :21], one.q, rtol=0.0, atol=1e-7)  # the top ball rolls off
