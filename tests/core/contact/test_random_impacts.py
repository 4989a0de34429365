"""Impacts of random articulated bodies on random planes: energy by Pinocchio's mass matrix."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import body, empty, frame

ROUNDING = 1e-12  # energy gain by rounding, relative to the works of an impact
BOOKED = 1e-9  # relative error of the sum of works; reference: larger kinetic energy before or after
JOINTS = (pin.JointModelFreeFlyer, pin.JointModelSpherical, pin.JointModelRX, pin.JointModelRevoluteUnaligned)


def turn(draw):
    return pin.exp3(draw.normal(size=3))


def about_to_strike(draw, elastic):
    """Return a tree of one to six bodies with one to four closed contacts with planes of any direction."""
    model, joint = empty(), 0
    for k in range(int(draw.integers(1, 7))):
        kind = JOINTS[int(draw.integers(len(JOINTS)))] if k else JOINTS[0]
        shape = kind(*(turn(draw)[0] for _ in range(kind is JOINTS[3])))
        place = pin.SE3(turn(draw), draw.uniform(-0.5, 0.5, 3))
        mass = float(10.0 ** draw.uniform(-2.0, 1.0))
        inertia = mass * np.diag(draw.uniform(0.5, 1.0, 3)) * 0.03
        parent = int(draw.integers(0, joint + 1)) if draw.random() < 0.5 else joint
        joint = body(
            model,
            parent,
            shape,
            f"b{k}",
            mass,
            lever=draw.uniform(-0.1, 0.1, 3),
            inertia=inertia,
            place=place,
        )
    q = pin.integrate(model, pin.neutral(model), draw.normal(size=model.nv))
    data = model.createData()
    contacts = []
    for k in range(int(draw.integers(1, 5))):
        link = int(draw.integers(1, model.njoints))
        frame(model, f"p{k}", link, pin.SE3(np.eye(3), draw.uniform(-0.3, 0.3, 3)))
        pin.forwardKinematics(model, data, q)
        point = data.oMi[link].act(model.frames[-1].placement.translation)
        frame(model, f"plane{k}", 0, pin.SE3(turn(draw), point))
        mu, restitution = draw.uniform(0.0, 2.0), draw.uniform(0.0, 1.0) * elastic
        contacts.append(
            pn.PointContact(f"p{k}", plane=f"plane{k}", mu=float(mu), restitution=float(restitution))
        )
    return pn.Scene(model, contacts=contacts, q0=q)


# After the impact, planes of all directions may have several solutions or none.
BEHIND_IMPACT = (
    pn.FrictionParadoxError,
    pn.FrictionConvergenceError,
    pn.InconsistentConstraintsError,
    pn.StepSizeError,
)


def impact(scene, v, **options):
    """Return the events of the impact at the start; errors right after it are ignored."""
    try:
        run = pn.simulate(scene, 1e-9, v=v, **options)
    except BEHIND_IMPACT as error:
        run = error.trajectory
    return [e for e in run.events if e.kind == "impact" and e.time == 0.0]


def kinetic(scene, v):
    data = scene.model.createData()
    return pin.computeKineticEnergy(scene.model, data, scene.q0, v)


def impacts(count, elastic, velocities=20):
    """Yield random impacts with their scene and velocity."""
    found = 0
    for seed in range(count):
        draw = np.random.default_rng(seed)
        scene = about_to_strike(draw, elastic)
        for _ in range(velocities):
            v = draw.normal(size=scene.model.nv)
            events = impact(scene, v)
            if not events:
                continue
            found += 1
            yield scene, v, events
            if found == count:
                return


FEW_AND_MANY = [
    300,
    pytest.param(1000, marks=pytest.mark.slow),
    pytest.param(100000, marks=pytest.mark.stress),
]


@pytest.mark.parametrize("count", FEW_AND_MANY)
def test_plastic_impacts_never_gain(count):
    """For e = 0 friction only dissipates, and its work equals the change of kinetic energy."""
    most, missed = 0.0, 0.0
    for scene, _, events in impacts(count, 0.0):
        works = np.array([e.energy_change for e in events])
        before, after = kinetic(scene, events[0].v_minus), kinetic(scene, events[0].v_plus)
        most = max(most, works.sum() / np.abs(works).sum(), (after - before) / before)
        missed = max(missed, abs(after - before - works.sum()) / max(before, after))
    print(f"{count} impacts: largest gain {most:.1e}, energy that no event tells {missed:.1e}")
    assert most <= ROUNDING
    assert missed <= BOOKED


@pytest.mark.parametrize("count", FEW_AND_MANY)
def test_every_gain_is_told(count):
    """For e > 0 Newton's law with friction may gain energy: events report it, and `strict` ends the run."""
    gains, missed = 0, 0.0
    for scene, v, events in impacts(count, 1.0):
        works = np.array([e.energy_change for e in events])
        before, after = kinetic(scene, events[0].v_minus), kinetic(scene, events[0].v_plus)
        missed = max(missed, abs(after - before - works.sum()) / max(before, after))
        if abs(after - before) <= BOOKED * before:
            continue
        if after < before:
            impact(scene, v, strict=True)
            continue
        gains += 1
        with pytest.raises(pn.ImpactEnergyError):
            impact(scene, v, strict=True)
    print(f"{count} impacts, {gains} of them gain: energy that no event tells {missed:.1e}")
    assert gains > 0
    assert missed <= BOOKED
