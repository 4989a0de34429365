"""Boxes that slide and spin on four corners, which share the load, beside equations of their own."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn

from ..support.mechanisms import GRAVITY, empty
from ..support.seeds import ranges

KEPT = 1e-7  # [m, rad, m/s, rad/s] at tolerances of 1e-10, over a second
DEPTH = 1e-10  # [m], that no contact sinks below its plane


def thrown(size, mass, mu, v0, q0=None, restitution=0.0):
    model = empty()
    pn.free_body(model, "box", coal.Box(*size), mass=mass)
    if q0 is None:
        q0 = pin.neutral(model)
        q0[2] = 0.5 * size[2]
    corners = pn.box_contacts("box", size, mu=mu, restitution=restitution)
    return pn.Scene(model, contacts=corners, q0=q0, v0=v0)


def loads(size, mass, mu, state):
    """Return the corners, the directions of their slips, and their normal forces of least norm."""
    x, y, turn = state[:3]
    del x, y
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    corners = np.array([(s, t) for s in (-0.5, 0.5) for t in (-0.5, 0.5)]) * np.asarray(size)[:2] @ R.T
    slips = state[3:5] + state[5] * np.column_stack([-corners[:, 1], corners[:, 0]])
    ways = slips / np.linalg.norm(slips, axis=1)[:, None]
    E = np.column_stack([np.ones(4), corners]).T
    lever = 0.5 * size[2] * mu
    G = np.column_stack([np.zeros(4), lever * ways]).T  # moments of friction, which the loads balance
    least = np.linalg.pinv(E)
    N = np.linalg.solve(np.eye(4) - least @ G, least @ [mass * GRAVITY, 0.0, 0.0])
    return corners, ways, N


def rates(t, state, size, mass, mu):
    del t
    corners, ways, N = loads(size, mass, mu, state)
    forces = -mu * N[:, None] * ways
    spin = (corners[:, 0] * forces[:, 1] - corners[:, 1] * forces[:, 0]).sum()
    inertia = mass * (size[0] ** 2 + size[1] ** 2) / 12.0
    return np.concatenate([state[3:], forces.sum(axis=0) / mass, [spin / inertia]])


@pytest.mark.parametrize("seed", range(8))
def test_slides_and_spins(seed):
    """Positions, angle and velocities follow the oracle as long as all corners press and slip."""
    draw = np.random.default_rng(seed)
    size, mass = np.append(draw.uniform(0.2, 0.5, 2), draw.uniform(0.02, 0.08)), draw.uniform(0.5, 3.0)
    mu, v0 = draw.uniform(0.1, 0.8), np.zeros(6)
    v0[[0, 1, 5]] = draw.normal(size=3) * 2.0
    start = np.concatenate([np.zeros(3), v0[[0, 1, 5]]])
    ends = 0.5 * np.linalg.norm(v0[:2]) / (mu * GRAVITY)
    known = solve_ivp(rates, (0.0, ends), start, "DOP853", rtol=1e-11, atol=1e-11, args=(size, mass, mu))
    assert loads(size, mass, mu, known.y[:, -1])[2].min() > 0.0
    run = pn.simulate(thrown(size, mass, mu, v0), ends, rtol=1e-10, atol=1e-10)
    q, v = run.q[-1], run.v[-1]
    R = pin.Quaternion(q[3:7]).matrix()
    found = np.concatenate([q[:2], [np.arctan2(R[1, 0], R[0, 0])], (R @ v[:3])[:2], [v[5]]])
    expected = known.y[:, -1].copy()
    expected[2] = np.arctan2(np.sin(expected[2]), np.cos(expected[2]))
    np.testing.assert_allclose(found, expected, atol=KEPT)


def any_box(seed):
    """Flat on the floor with a push and a spin, or tumbling down on it."""
    draw = np.random.default_rng(seed)
    size, mass = draw.uniform(0.1, 0.5, 3), draw.uniform(0.5, 3.0)
    mu, restitution = draw.uniform(0.05, 1.0), float(draw.choice([0.0, 0.0, 0.3, 0.7]))
    q0, v0 = np.array([0.0, 0.0, 0.5 * size[2], 0.0, 0.0, 0.0, 1.0]), np.zeros(6)
    turn, speed = draw.normal(size=4), draw.normal(size=6) * 2.0
    if seed % 2:
        q0[2], q0[3:], v0 = 0.6, turn / np.linalg.norm(turn), speed
    else:
        v0[[0, 1, 5]] = speed[[0, 1, 5]]
    return thrown(size, mass, mu, v0, q0, restitution), size


def test_four_corners_that_stop_at_once_come_to_rest():
    """The last step passes the rest of all corners, after which slip directions are rounding."""
    run = pn.simulate(any_box(324)[0], 10.0, max_steps=5000)
    assert np.abs(run.v[-1]).max() == 0.0


@pytest.mark.parametrize("seeds", ranges(10, 40, 1000))
def test_boxes_come_to_rest(seeds):
    """No run fails or hangs, no box penetrates, and all boxes come to rest."""
    for seed in seeds:
        scene, size = any_box(seed)
        run = pn.simulate(scene, 10.0, max_steps=5000)
        corners = np.array([c.offset for c in scene.contacts])
        for q in run.q:
            assert (q[2] + corners @ pin.Quaternion(q[3:7]).matrix()[2] > -DEPTH).all(), (seed, size)
        assert np.abs(run.v[-1]).max() == 0.0, seed
