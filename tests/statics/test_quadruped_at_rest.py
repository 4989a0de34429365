"""A quadruped whose twelve joints rub, on four feet: more elements hold than freedoms move.

Some all but copy others. Energy is the oracle: no friction ever gives any, whatever modes were found, and
the ledger closes. Changes of mode come to an end.
"""

import numpy as np
import pytest

import pin_nonideal as pn

CONSTANT = {"coulomb": 0.05, "viscous": 0.01}
LOADED = {"mu": 0.01, "radius": 0.02, "preload": 0.01}


def come_to_rest(friction, sway, seed):
    """Run of two seconds from a stance of which each joint is `sway` [rad] off the even one."""
    standing = pn.load("solo12_standing")
    joints = list(standing.model.names)[2:]
    laws = [pn.JointFriction(joint, name=joint, **friction) for joint in joints]
    scene = pn.Scene(
        standing.model, constraints=standing.constraints, laws=laws, actuation=standing.actuation
    )
    q = standing.q0.copy()
    q[7:] += sway * np.random.default_rng(seed).standard_normal(12)
    q, v = scene.project(q, standing.v0)
    run = pn.simulate(scene, 2.0, q=q, v=v, record="energy", max_steps=20_000)
    rise = max(np.diff(run.energy[joint]).max() for joint in joints)
    assert rise < 1e-11  # J of 0.1: of work integrated to the tolerance, by joints that hardly move
    assert np.abs(run.energy["balance"]).max() < 1e-8
    return run


def random_friction(seed):
    """Friction of all joints, and how far the stance is from the even one [rad]."""
    rng = np.random.default_rng(seed)
    friction = {
        "mu": 10 ** rng.uniform(-3, -1.2),
        "radius": 0.02,
        "preload": 10 ** rng.uniform(-3, -1),
        "coulomb": float(rng.choice([0, 0.03])),
    }
    if rng.random() < 0.3:
        friction = {"coulomb": 10 ** rng.uniform(-2, 0)}
    if rng.random() < 0.3:
        friction["static_ratio"] = 1.2
    return friction, float(rng.choice([0, 0, 0.02, 0.1]))


@pytest.mark.parametrize(
    ("friction", "sway", "seed"),
    [
        pytest.param(CONSTANT, 0.0, 0, marks=pytest.mark.slow),
        (CONSTANT, 0.05, 0),
        pytest.param(LOADED, 0.0, 0, marks=pytest.mark.slow),
        (LOADED, 0.05, 1),
        pytest.param(LOADED, 0.05, 3, marks=pytest.mark.slow),
    ],
)
def test_it_comes_to_rest(friction, sway, seed):
    """Forces within the limits decide if two joints can stick where a third is nearly redundant."""
    assert (come_to_rest(friction, sway, seed).v[-1] == 0.0).all()


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (13, 37, 49, 55))]
)
def test_random_friction_never_gives_energy(seed):
    """Stances in which changes of mode once went round in a circle, at one instant."""
    run = come_to_rest(*random_friction(seed), seed)
    assert "chatter" not in {event.kind for event in run.events}
    assert len(run.events) < 300


@pytest.mark.stress
def test_friction_of_any_stance():
    """Never more than a cluster of events that is bridged, and never energy.

    Eight sticking joints hold a stance in which the other four nearly jam.  Loads there grow beyond the range
    of a unique solution, which the run reports.
    """
    jammed = 0
    for seed in range(100, 160):
        try:
            run = come_to_rest(*random_friction(seed), seed)
        except (pn.FrictionParadoxError, pn.FrictionConvergenceError):
            jammed += 1
            continue
        assert sum(event.kind == "chatter" for event in run.events) < 3, seed
    assert jammed <= 4
