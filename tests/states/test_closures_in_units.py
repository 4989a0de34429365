"""The nearest closure of a loop does not depend on its unit, its mount, or on rows that are stated twice."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import body, empty, frame
from ..support.seeds import seeds

CLOSE = 1e-5  # difference of search results, in units of the mechanism


def planar_loop(seed: int, length: float = 1.0, times: int = 1, factor: float | None = None) -> pn.Scene:
    """Joints that turn and slide in a plane of some mount, closed by all three rows of a point.

    In another unit of length, the loop stated several times, or once more as functions times a factor.
    """
    draw, model, joint = np.random.default_rng([3, seed]), empty(), 0
    mount = pin.SE3(pin.exp3(draw.normal(size=3)), length * draw.normal(0.0, 0.3, 3))
    place, lever, moments = mount, (0.1 * length, 0.0, 0.0), 0.01 * length**2 * np.eye(3)
    model.gravity = pin.Motion(length * model.gravity.linear, np.zeros(3))
    for k in range(int(draw.integers(2, 5))):
        kind = pin.JointModelRY()
        if draw.random() < 0.3:
            angle = draw.uniform(-3.0, 3.0) if draw.random() < 0.5 else 0.0
            kind = pin.JointModelPrismaticUnaligned(np.array([np.cos(angle), 0.0, np.sin(angle)]))
        joint = body(model, joint, kind, f"j{k}", 1.0, place=place, lever=lever, inertia=moments)
        place = pin.SE3(np.eye(3), np.array([length * draw.uniform(0.2, 0.6), 0.0, 0.0]))
    frame(model, "tip", joint, place)
    post = mount * pin.SE3(np.eye(3), np.array([length * draw.uniform(0.3, 0.8), 0.0, 0.0]))
    kind = pin.JointModelPX() if draw.random() < 0.5 else pin.JointModelRY()
    joint = body(model, 0, kind, "last", 1.0, place=post, lever=lever, inertia=moments)
    frame(model, "pin", joint, pin.SE3(np.eye(3), np.array([0.3 * length, 0.0, 0.0])))
    loops = [pn.PointAnchor("tip", "pin", name=f"loop {k}") for k in range(times)]
    if factor is not None:
        loops.append(by_hand(pn.Scene(model, constraints=loops), factor))
    return pn.Scene(model, constraints=loops)


def by_hand(scene: pn.Scene, factor: float) -> pn.UserConstraint:
    """The rows of a scene as functions of the user's, times a factor."""
    runner, still = scene._compiled.program.runner(), np.zeros(scene.model.nv)

    def rows(t, q, v):
        A, b, phi, rate = runner.rows(np.array(q), np.array(v), t)
        return factor * A.reshape(len(phi), -1), factor * b, factor * phi, factor * rate

    return pn.UserConstraint(
        lambda t, q, v, data: rows(t, q, v)[:2],
        len(rows(0.0, scene.q0, still)[2]),
        residual=lambda t, q: rows(t, q, still)[2],
        rate=lambda t, q, v: rows(t, q, v)[3],
        name="by hand",
    )


def closed(seed: int, length: float = 1.0, **more) -> np.ndarray | None:
    """The nearest closure to a configuration near or far, slides over the unit of length, or None."""
    scene = planar_loop(seed, length, **more)
    draw = np.random.default_rng([4, seed])
    q = 10.0 ** draw.uniform(-1.5, 0.3) * draw.normal(size=scene.model.nv)
    slides = np.array(["P" in joint.shortname() for joint in list(scene.model.joints)[1:]])
    unit = np.where(slides, length, 1.0)
    try:
        return scene.project(unit * q)[0] / unit
    except pn.LoopClosureError:
        return None


SAME = [{"length": 1e-3}, {"length": 1e3}, {"times": 2}, {"factor": 7.3e3}, {"factor": 1e-4}]


@pytest.mark.parametrize("seed", seeds(range(300), count=1))
def test_units_and_copies_of_rows_change_no_closure(seed: int) -> None:
    found = closed(seed)
    for changed in SAME:
        same = closed(seed, **changed)
        assert (found is None) == (same is None), changed
        if found is not None:
            np.testing.assert_allclose(same, found, rtol=0.0, atol=CLOSE * (1.0 + np.abs(found).max()))


def test_rows_of_rounding_by_hand_alone_change_no_closure() -> None:
    """All three rows of a planar loop as functions: the one across the plane holds nothing."""
    scene = planar_loop(0)
    alone = pn.Scene(scene.model, constraints=[by_hand(scene, 7.3e3)])
    q = scene.project(closed(0))[0]
    near = q + 1e-3
    np.testing.assert_allclose(alone.project(near)[0], scene.project(near)[0], rtol=0.0, atol=CLOSE)
