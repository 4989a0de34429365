"""Random bodies with one to eight contacts dropped on the floor: impacts, chatter, sliding and rest."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import body, empty, frame
from ...support.same_run import assert_same_run
from ...support.seeds import ranges, seeds

DEPTH = 1e-10  # maximum penetration [m]


def dropped(seed, *, plastic=False):
    draw = np.random.default_rng(seed)
    count = int(draw.integers(1, 9))
    model = empty()
    inertia = np.diag(draw.uniform(0.01, 0.1, 3) + 0.05)
    mass, lever = draw.uniform(0.5, 3.0), draw.uniform(-0.05, 0.05, 3)
    joint = body(model, 0, pin.JointModelFreeFlyer(), "b", mass, lever=lever, inertia=inertia)
    for k in range(count):
        frame(model, f"p{k}", joint, pin.SE3(np.eye(3), draw.uniform(-0.3, 0.3, 3)))
    q0 = pin.neutral(model)
    q0[2] = 1.0
    turn = draw.normal(size=4)
    q0[3:] = turn / np.linalg.norm(turn)
    restitution = np.zeros(count) if plastic else draw.uniform(0.0, 0.8, count)
    contacts = [
        pn.PointContact(f"p{k}", mu=float(draw.uniform(0.0, 1.0)), restitution=float(restitution[k]))
        for k in range(count)
    ]
    return pn.Scene(model, contacts=contacts, q0=q0, v0=draw.normal(size=6))


def deepest(scene, run):
    """Return the largest penetration of any contact in any sample, by Pinocchio's kinematics only [m]."""
    data, depth = scene.model.createData(), 0.0
    frames = [scene.model.getFrameId(contact.frame) for contact in scene.contacts]
    for q in run.q:
        pin.framesForwardKinematics(scene.model, data, q)
        depth = max(depth, *(-data.oMf[f].translation[2] for f in frames))
    return depth


RATTLING = [10, 13, 31, 75, 82, 88, 120, 128, 133, 149, 178, 181, 195, 246, 286, 349, 352, 423, 571, 622]


@pytest.mark.parametrize("seed", seeds(RATTLING))
def test_contacts_that_rattle_come_to_rest(seed):
    """Two or more contacts chatter in alternation: the end of one series makes another contact rebound."""
    scene = dropped(seed)
    run = pn.simulate(scene, 3.0, record="energy", max_steps=20000)
    assert deepest(scene, run) < DEPTH
    assert "chatter" not in {e.kind for e in run.events}
    # Error of the steps, relative to 5 to 50 J.
    assert np.abs(run.energy["balance"]).max() < 1e-5 * run.energy["total"][0]


def test_a_slip_of_rounding_comes_to_rest():
    """The direction of a slip of 2e-9 m/s relaxes faster than any step that the tolerances require."""
    run = pn.simulate(dropped(636), 3.0, max_steps=2000)
    assert run.t[-1] == 3.0


@pytest.mark.parametrize("those", ranges(5, 60, 1000))
def test_random_bodies_dropped(those, kept, tmp_path):
    """No run fails, hangs or penetrates; every tenth is repeated and resumed in flight bit by bit."""
    path = tmp_path / "run"
    for seed in those:
        scene = dropped(seed)
        run = pn.simulate(scene, 3.0, max_steps=20000)
        assert np.isfinite(run.q).all()
        assert np.isfinite(run.v).all()
        assert deepest(scene, run) < DEPTH
        if seed % 10:
            continue
        kept.clear()
        options = {"max_steps": 20000, "checkpoint": path, "checkpoint_interval": 0.0}
        assert_same_run(run, pn.simulate(scene, 3.0, **options))
        path.write_bytes(kept[len(kept) // 2])
        assert_same_run(run, pn.resume(path, scene, checkpoint_interval=1e9))


def test_plastic_impacts_never_gain():
    impacts = 0
    for seed in range(1000, 1020):
        run = pn.simulate(dropped(seed, plastic=True), 3.0, max_steps=20000)
        assert run.violation.max() < DEPTH
        at_once = {}
        for e in run.events:
            if e.kind == "impact":
                scale, change = at_once.get(e.time, (0.0, 0.0))
                at_once[e.time] = scale + abs(e.energy_change), change + e.energy_change
        assert all(change <= 1e-12 * scale + 1e-15 for scale, change in at_once.values())
        impacts += len(at_once)
    assert impacts > 60


def test_resumed_in_flight(kept, tmp_path):
    """Runs resumed from checkpoints in flight, between impacts and at rest are bitwise the same."""
    path, scene, record = tmp_path / "run", dropped(13), ("energy", "forces")
    alone = pn.simulate(scene, 3.0, record=record)
    assert_same_run(alone, pn.simulate(scene, 3.0, record=record, checkpoint=path, checkpoint_interval=0.0))
    states = list(kept)
    assert len(states) > alone.stats.steps
    for k in np.linspace(0, len(states) - 1, 12).astype(int):
        path.write_bytes(states[k])
        assert_same_run(alone, pn.resume(path, scene, checkpoint_interval=1e9))
