"""Uniqueness of motions from rest, beside motions from random starts of the cone problem."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import block_diag

import pin_nonideal as pn

from ...support.seeds import seeds

STARTS, SAME = 20, 1e-7
NORMAL_FIRST = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def body_on_points(seed, count, friction):
    """Return a scene of one body on points of a plane under a random load, with W, w0 and mu."""
    rng = np.random.default_rng(seed)
    gravity = 5.0 * rng.normal(size=3) + [0.0, 0.0, 2.0]
    inertia = np.diag(rng.uniform(0.5, 1.0, 3)) * 10.0 ** rng.uniform(-4.0, -2.0)
    points = 0.3 * rng.normal(size=(count, 3))
    points[:, 2] = points[0, 2]
    mu = rng.uniform(*friction)
    model = pin.Model()
    model.gravity.linear[:] = gravity
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), inertia), pin.SE3.Identity())
    for k, point in enumerate(points):
        model.addFrame(pin.Frame(f"{k}", joint, 0, pin.SE3(np.eye(3), point), pin.FrameType.OP_FRAME))
    q0 = pin.neutral(model)
    q0[2] = -points[0, 2]
    scene = pn.Scene(model, contacts=[pn.PointContact(f"{k}", mu=mu) for k in range(count)], q0=q0)
    rows = np.vstack([np.hstack([NORMAL_FIRST, -NORMAL_FIRST @ pin.skew(point)]) for point in points])
    yields = block_diag(np.eye(3), np.linalg.inv(inertia))
    return scene, rows @ yields @ rows.T, rows @ yields @ np.append(gravity, np.zeros(3)), mu


def count_motions(W, w0, mu, seed):
    rng, found = np.random.default_rng(seed), []
    for _ in range(STARTS):
        start = rng.normal(size=len(w0)) * 10.0 ** rng.uniform(-1.0, 2.0)
        solution = pn.cone_complementarity(W, w0, [mu] * (len(w0) // 3), start=start)
        a = W @ solution.f + w0
        if all(np.abs(a - other).max() > SAME * (np.abs(w0).max() + np.abs(a).max()) for other in found):
            found.append(a)
    return len(found)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("seed", seeds(range(400)))
def test_a_motion_that_is_called_unique_is_the_only_one(seed, count):
    scene, W, w0, mu = body_on_points(seed, count, (0.2, 4.0))
    unique = scene.solve(*scene.initial_state()).unique
    if unique is True:
        assert count_motions(W, w0, mu, seed) == 1


@pytest.mark.parametrize(
    ("seed", "count", "friction", "several"),
    [
        (2, 3, (0.1, 1.0), "error"),
        (976, 4, (0.1, 1.0), "error"),
        (541, 5, (0.2, 4.0), "error"),
        (472, 4, (0.2, 4.0), "continue"),
        (472, 5, (0.2, 4.0), "continue"),
    ],
)
def test_a_motion_that_one_contact_after_another_does_not_show_is_sought_jointly(
    seed, count, friction, several
):
    """Contacts decided one by one had no motion, several, or one whose slip does not oppose its friction."""
    scene, W, w0, mu = body_on_points(seed, count, friction)
    a = scene.solve(*scene.initial_state(), several=several).a
    points = [scene.model.frames[scene.model.getFrameId(f"{k}")].placement.translation for k in range(count)]
    found = np.concatenate([NORMAL_FIRST @ (a[:3] + np.cross(a[3:], point)) for point in points])
    expected = W @ pn.cone_complementarity(W, w0, [mu] * count).f + w0
    assert np.abs(found - expected).max() < SAME * np.abs(expected).max()


def test_several_motions_are_not_called_unique():
    several = 0
    for seed in range(60):
        scene, W, w0, mu = body_on_points(seed, 2, (0.2, 4.0))
        if count_motions(W, w0, mu, seed) > 1:
            several += 1
            assert scene.solve(*scene.initial_state()).unique is not True
    assert several >= 3


def test_rest_of_many_rough_contacts_is_no_proof():
    """Five light rods, each on two points with strong friction."""
    model, contacts = pin.Model(), []
    for k in range(5):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"rod {k}")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), 1e-4 * np.eye(3)), pin.SE3.Identity())
        for side in (-1.0, 1.0):
            place = pin.SE3(np.eye(3), np.array([0.3 * side, 0.0, 0.0]))
            model.addFrame(pin.Frame(f"{k} {side}", joint, 0, place, pin.FrameType.OP_FRAME))
            contacts.append(pn.PointContact(f"{k} {side}", mu=2.0))
    scene = pn.Scene(model, contacts=contacts)
    solution = scene.solve(*scene.initial_state())
    assert not solution.a.any()
    assert solution.unique is None


def test_weak_friction_is_proven_to_have_one_motion():
    """The bodies are up to a thousand times lighter about their axes than on their levers."""
    scenes = [body_on_points(seed, 2, (0.0, 0.1))[0] for seed in range(40)]
    assert sum(scene.solve(*scene.initial_state()).unique is True for scene in scenes) >= 20
