"""Curves, surfaces and disks of user constraints against their closed forms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.visualization.page import constraint_curves
from pin_nonideal.visualization.page.constraint_curves import Guide, guides_of
from pin_nonideal.visualization.page.frames import sample

from ..support.replay_runs import jointed


@pytest.fixture(autouse=True)
def _short_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Follow open curves for one extent of the path, which takes less time."""
    monkeypatch.setattr(constraint_curves, "MAX_EXTENTS", 1)
    monkeypatch.setattr(constraint_curves, "CURVE_STEPS", 20)


def particle() -> pin.Model:
    return jointed(pin.JointModelTranslation(), lever=0.0)


def guides(scene: pn.Scene, duration: float = 1.0) -> list[Guide]:
    run = pn.simulate(scene, duration, rtol=1e-10, atol=1e-10)
    return guides_of(run, sample(run))


def helix(limit: float = np.inf) -> pn.UserConstraint:
    """x = cos z and y = sin z; the functions raise beyond the heights -limit and limit."""

    def checked(z: float) -> float:
        if abs(z) > limit:
            raise ValueError("the table ends here")
        return z

    def rows(t: float, q: np.ndarray, v: np.ndarray, data: pin.Data) -> tuple[np.ndarray, np.ndarray]:
        z = checked(q[2])
        A = np.array([[1.0, 0.0, np.sin(z)], [0.0, 1.0, -np.cos(z)]])
        return A, -(v[2] ** 2) * np.array([np.cos(z), np.sin(z)])

    return pn.UserConstraint(
        rows,
        2,
        residual=lambda t, q: q[:2] - [np.cos(checked(q[2])), np.sin(q[2])],
        rate=lambda t, q, v: np.array([v[0] + np.sin(q[2]) * v[2], v[1] - np.cos(q[2]) * v[2]]),
        name="helix",
    )


def on_helix(limit: float = np.inf) -> pn.Scene:
    start = np.array([0.0, 1.0, 1.0])
    return pn.Scene(particle(), constraints=[helix(limit)], q0=[1.0, 0.0, 0.0], v0=start)


def test_an_open_curve_in_space_goes_on_beside_the_path() -> None:
    (guide,) = guides(on_helix())
    assert (guide.kind, guide.columns, guide.closed) == ("curve", 1, False)
    x, y, z = guide.points.T
    np.testing.assert_allclose(x, np.cos(z), atol=1e-9)
    np.testing.assert_allclose(y, np.sin(z), atol=1e-9)
    assert (np.abs(np.diff(z)) > 0.0).all()
    assert z.min() < 0.0 < z.max()  # the particle starts at the height zero


def test_a_function_that_fails_beside_the_path_has_no_guide() -> None:
    scene = on_helix(limit=0.08)
    run = pn.simulate(scene, 0.05)
    assert np.ptp(run.q[:, 2]) < 0.08
    assert guides_of(run, sample(run)) == []


def test_a_constraint_on_velocities_is_the_disk_of_allowed_directions() -> None:
    """z' = y x' leaves the directions normal to (-y, 0, 1), which turn with y."""
    skate = pn.UserConstraint(
        lambda t, q, v, data: (np.array([[-q[1], 0.0, 1.0]]), np.array([v[1] * v[0]])),
        1,
        rate=lambda t, q, v: np.array([v[2] - q[1] * v[0]]),
    )
    model = particle()
    model.gravity.linear = np.zeros(3)
    scene = pn.Scene(model, constraints=[skate], q0=[0.0, -0.5, 0.0], v0=[0.4, 1.0, -0.2])
    run = pn.simulate(scene, 1.0, output_dt=0.05)
    motion = sample(run)
    (disk,) = guides_of(run, motion)
    assert disk.kind == "disk"
    y = motion.q[:, 1]
    expected = np.stack([-y, np.zeros_like(y), np.ones_like(y)], axis=1) / np.sqrt(1.0 + y**2)[:, None]
    assert disk.normals is not None
    np.testing.assert_allclose(disk.normals, expected, atol=0.05)  # y may change by that between two samples
    path = motion.point(disk.joint, disk.point)
    assert disk.size == pytest.approx(0.12 * np.linalg.norm(np.ptp(path, axis=0)), rel=1e-12)


def test_constraints_without_a_curve_have_no_guide() -> None:
    """A row on the rotation of a body, and one that holds a point in place."""
    free = jointed(pin.JointModelFreeFlyer(), lever=0.0)
    upright = pn.UserConstraint(
        lambda t, q, v, data: (np.eye(6)[3:4], np.zeros(1)), 1, rate=lambda t, q, v: v[3:4].copy()
    )
    assert guides(pn.Scene(free, constraints=[upright]), 0.1) == []
    pinned = pn.UserConstraint(
        lambda t, q, v, data: (np.eye(3), np.zeros(3)),
        3,
        residual=lambda t, q: q.copy(),
        rate=lambda t, q, v: v.copy(),
    )
    assert guides(pn.Scene(particle(), constraints=[pinned]), 0.1) == []


def test_large_models_have_no_guides(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search for the point of a constraint is left out beyond a number of degrees of freedom."""
    run = pn.simulate(on_helix(), 0.1)
    monkeypatch.setattr(constraint_curves, "MAX_DOFS", 2)
    assert guides_of(run, sample(run)) == []
