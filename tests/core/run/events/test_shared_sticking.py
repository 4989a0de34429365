"""Geared joints that stick together until their driver overcomes the friction of all."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....scene.test_symmetries import check
from ....support.seeds import ranges

GRAVITY = 9.81
RAMP = 2.0  # torque after one second [N m]


def geared_shafts(rng: np.random.Generator, loaded: bool) -> tuple[pn.Scene, float]:
    """Return shafts geared to the first one, which a rising torque drives, and the time at which they move.

    The friction of shaft i that turns r_i times as fast takes |r_i| times its limit from the torque.
    """
    model = pin.Model()
    shafts = int(rng.integers(2, 5))
    ratios = np.concatenate([[1.0], rng.uniform(0.3, 2.0, shafts - 1) * rng.choice([-1.0, 1.0], shafts - 1)])
    holds = rng.uniform(0.05, 0.3, shafts)
    masses = rng.uniform(0.5, 3.0, shafts)
    laws, constraints = [], []
    for i in range(shafts):
        joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), f"shaft {i}")
        inertia = np.diag(rng.uniform(0.01, 0.05, 3))
        model.appendBodyToJoint(joint, pin.Inertia(masses[i], np.zeros(3), inertia), pin.SE3.Identity())
        name = f"friction {i}"
        if loaded:
            radius = holds[i] / (0.5 * masses[i] * GRAVITY)
            laws.append(pn.JointFriction(f"shaft {i}", mu=0.5, radius=radius, name=name))
        else:
            laws.append(pn.JointFriction(f"shaft {i}", coulomb=holds[i], name=name))
        if i:
            constraints.append(pn.JointCoupling(f"shaft {i}", "shaft 0", ratio=ratios[i], name=f"gear {i}"))
    values = np.zeros((2, shafts))
    values[1, 0] = RAMP
    drive = pn.actuation.Table([0.0, 1.0], values)
    return pn.Scene(model, constraints=constraints, laws=laws, actuation=drive), float(
        np.abs(ratios) @ holds
    ) / RAMP


@pytest.mark.parametrize("method", ["dop853", "dopri5"])
@pytest.mark.parametrize("loaded", [False, True], ids=["constant limits", "limits by load"])
@pytest.mark.parametrize("seeds", ranges(6, 300))
def test_geared_shafts_begin_to_turn_together_where_all_friction_is_overcome(
    seeds: range, loaded: bool, method: str
) -> None:
    for seed in seeds:
        scene, onset = geared_shafts(np.random.default_rng(seed), loaded)
        run = pn.simulate(scene, min(onset + 0.04, 1.0), method=method, rtol=1e-10)
        slips = [event.time for event in run.events]
        assert all(event.kind == "slip" for event in run.events), seed
        if onset >= 1.0:
            assert slips == [], seed
            continue
        assert sorted(str(event.element) for event in run.events) == sorted(scene.element_names), seed
        assert slips == pytest.approx([onset] * len(slips), abs=1e-9), seed


def worm_drive(rng: np.random.Generator) -> pn.Scene:
    """Return a self-locking worm that lifts a rack, with friction by load in the thread and the bearing."""
    model = pin.Model()
    pitch = float(rng.uniform(0.0005, 0.003)) * rng.choice([-1.0, 1.0])
    worm = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "worm")
    model.appendBodyToJoint(worm, pin.Inertia(0.5, np.zeros(3), np.diag([1e-3] * 3)), pin.SE3.Identity())
    rack = model.addJoint(worm, pin.JointModelHZ(pitch), pin.SE3.Identity(), "rack")
    mass = float(rng.uniform(2.0, 10.0))
    model.appendBodyToJoint(rack, pin.Inertia(mass, np.zeros(3), np.diag([1e-2] * 3)), pin.SE3.Identity())
    laws = [
        pn.JointFriction("rack", mu=0.3, axial_radius=rng.uniform(4.0, 10.0) * abs(pitch), name="thread"),
        pn.JointFriction("worm", mu=0.05, axial_radius=rng.uniform(0.005, 0.02), name="bearing"),
    ]
    drive = pn.actuation.Table([0.0, 1.0], [[0.0, 0.0], [rng.choice([-3.0, 3.0]), 0.0]])
    guide = pn.JointCoupling("rack", "worm", ratio=-1.0, name="guide")
    return pn.Scene(model, constraints=[guide], laws=laws, actuation=drive)


def first_motion(scene: pn.Scene) -> float:
    """Return the time at which the rest of a scene ends, by bisection of its motions."""
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        rests = not np.any(scene.solve(np.zeros(2), np.zeros(2), middle).a)
        low, high = (middle, high) if rests else (low, middle)
    return high


@pytest.mark.parametrize("seeds", ranges(6, 100, 500))
def test_a_worm_and_its_bearing_begin_to_turn_together_although_each_load_depends_on_both(
    seeds: range,
) -> None:
    for seed in seeds:
        scene = worm_drive(np.random.default_rng(seed))
        onset = first_motion(scene)
        assert 0.0 < onset < 0.95, seed
        run = pn.simulate(scene, onset + 0.04, rtol=1e-10)
        assert [event.kind for event in run.events] == ["slip", "slip"], seed
        assert [event.time for event in run.events] == pytest.approx([onset, onset], abs=1e-9), seed


def test_a_self_locking_worm_moves_at_once_with_its_bearing() -> None:
    scene = pn.load("worm_drive")
    run = pn.simulate(scene, 5.0, rtol=1e-10)
    assert [event.kind for event in run.events] == ["stick", "stick", "slip", "slip"]
    times = [event.time for event in run.events]
    assert times[0] == times[1]
    assert times[2] == times[3]


def test_a_worm_rests_on_a_mount_that_a_drive_accelerates() -> None:
    check("robot worm_drive", "accelerated", ["simulate dop853", "solve"])
