"""Rows without freedom hold nothing, on mounts turned at random, where rounding leaves them almost zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import body, empty, frame
from ...support.seeds import seeds

RADIUS, PULL = 0.1, 3.0
ROUNDING = 1e-10


def turned(seed: int) -> pin.SE3:
    rpy = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
    R = pin.rpy.rpyToMatrix(*rpy)
    return pin.SE3(R, RADIUS * R[:, 2])


def cart(mount: pin.SE3) -> pin.Model:
    """A body on a rail along x that weight pulls, and a wheel of the body that turns about y."""
    model = empty(mount.rotation @ np.array([PULL, 0.0, -9.81]))
    slide = body(model, 0, pin.JointModelPX(), "slide", 1.0, place=mount, inertia=0.01 * np.eye(3))
    frame(model, "edge", slide)
    wheel = body(model, slide, pin.JointModelRY(), "wheel", 1.0, inertia=RADIUS**2 * np.eye(3))
    frame(model, "rim", wheel)
    return model


def knife_edge(model: pin.Model, mount: pin.SE3) -> pn.Constraint:
    return pn.KnifeEdge("edge", axis="y", name="edge")


def rolling(model: pin.Model, mount: pin.SE3) -> pn.Constraint:
    return pn.Rolling("rim", RADIUS, axis="y", normal=tuple(mount.rotation[:, 2]), name="wheel")


def rows_of_velocity(model: pin.Model, mount: pin.SE3) -> pn.Constraint:
    """The edge again, and the wheel held to the slide, as one function without residual."""
    at, across = model.getFrameId("edge"), mount.rotation[:, 1]

    def rows(t: float, q: np.ndarray, v: np.ndarray, data: pin.Data) -> tuple[np.ndarray, np.ndarray]:
        J = pin.getFrameJacobian(model, data, at, pin.LOCAL_WORLD_ALIGNED)[:3]
        return np.array([across @ J, [1.0, -RADIUS]]), np.zeros(2)

    def rate(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([across @ mount.rotation[:, 0] * v[0], v[0] - RADIUS * v[1]])

    return pn.UserConstraint(rows, 2, rate=rate, name="rows")


def rows_of_position(model: pin.Model, mount: pin.SE3) -> pn.Constraint:
    """The place across the rail, and the wheel held to the slide, as one function."""
    across = mount.rotation[:, 1] @ mount.rotation[:, 0]

    def rows(t: float, q: np.ndarray, v: np.ndarray, data: pin.Data) -> tuple[np.ndarray, np.ndarray]:
        return np.array([[across, 0.0], [1.0, -RADIUS]]), np.zeros(2)

    def residual(t: float, q: np.ndarray) -> np.ndarray:
        return np.array([across * q[0], q[0] - RADIUS * q[1]])

    return pn.UserConstraint(rows, 2, residual, name="rows")


ALONE, HELD = PULL, PULL * 2.0 / 3.0  # acceleration of the slide, and with the wheel's inertia felt once more
KINDS: tuple[tuple[Callable[[pin.Model, pin.SE3], pn.Constraint], float], ...] = (
    (knife_edge, ALONE),
    (rolling, HELD),
    (rows_of_velocity, HELD),
    (rows_of_position, HELD),
)


@pytest.mark.parametrize("seed", seeds(range(300), count=3))
@pytest.mark.parametrize(("kind", "expected"), KINDS, ids=[kind.__name__ for kind, _ in KINDS])
def test_rows_without_freedom_hold_nothing(
    kind: Callable[[pin.Model, pin.SE3], pn.Constraint], expected: float, seed: int
) -> None:
    mount = turned(seed)
    model = cart(mount)
    scene = pn.Scene(model, constraints=[kind(model, mount)])
    still = np.zeros(2)
    assert scene.acceleration(still, still)[0] == pytest.approx(expected, abs=ROUNDING)
    run = pn.simulate(scene, 1.0)
    assert run.q[-1, 0] == pytest.approx(0.5 * expected, abs=ROUNDING)
    moving = pn.simulate(scene, 1.0, v={"slide": 1.0})
    assert moving.q[-1, 0] == pytest.approx(1.0 + 0.5 * expected, abs=ROUNDING)
    assert not pn.rest(scene, still).rests
    found = pn.inverse_dynamics(scene, still, still, still, actuated=["slide"])
    assert found.tau[0] == pytest.approx(-2.0 * PULL, abs=ROUNDING)
