"""Bodies that slide, roll and tip over the edges of a table, beside closed forms and conserved quantities."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, at

TABLE = (0.4, 0.4, 0.1)  # edges of the table, with its middle at the origin [m]
TIME, ENERGY = 1e-9, 1e-9  # tolerances [s], [J]
# A gap of 1e-14 m counts as open. A body of 0.1 m that turns into it reaches this speed [rad/s].
TURNING = 1e-5


def on_a_table(
    shape: coal.CollisionGeometry,
    height: float,
    velocity: tuple[float, ...],
    turn: float = 0.0,
    mu: float = 0.0,
) -> pn.Scene:
    """Return a body of 1 kg on a table, turned about z, with a height and a velocity in the world."""
    model, shapes = pin.Model(), pin.GeometryModel()
    model.gravity.linear[:] = 0.0, 0.0, -GRAVITY
    pn.free_body(model, "body", shape, mass=1.0, collision_model=shapes)
    shapes.addGeometryObject(pin.GeometryObject("table", 0, pin.SE3.Identity(), coal.Box(*TABLE)))
    way = pin.utils.rotate("z", turn)
    q0 = [0.0, 0.0, 0.5 * TABLE[2] + height, *pin.Quaternion(way).coeffs()]
    v0 = np.concatenate([way.T @ velocity[:3], way.T @ velocity[3:]])
    contact = pn.GeometryContact("body", "table", mu=mu)
    return pn.Scene(model, contacts=[contact], collision_model=shapes, q0=q0, v0=v0)


def lost_energy(scene: pn.Scene, run: pn.Trajectory) -> float:
    """Return the loss of energy beyond the one that impacts state [J], by Pinocchio."""
    data = scene.model.createData()
    first, last = (
        pin.computeKineticEnergy(scene.model, data, run.q[k], run.v[k])
        + pin.computePotentialEnergy(scene.model, data, run.q[k])
        for k in (0, -1)
    )
    return float(first - last + sum(e.energy_change for e in run.events if e.kind == "impact"))


@pytest.mark.parametrize("turn", [0.0, 0.1, 0.3, np.pi / 4.0, 1.2])
@pytest.mark.parametrize("speed", [0.7, 2.0])
def test_a_box_slides_over_an_edge_without_friction(speed: float, turn: float) -> None:
    """The box moves on unturned until its center passes the edge; it keeps its energy."""
    scene = on_a_table(coal.Box(0.1, 0.08, 0.06), 0.03, (speed, 0.0, 0.0, 0.0, 0.0, 0.0), turn)
    run = pn.simulate(scene, 0.6)
    assert run.t[-1] == 0.6
    assert abs(lost_energy(scene, run)) < ENERGY
    assert "chatter" not in {e.kind for e in run.events}
    impulses = [abs(e.impulse).max() for e in run.events if e.kind == "impact" and e.time < 0.15 / speed]
    assert max(impulses, default=0.0) < 1e-7
    tips = 0.5 * TABLE[0] / speed
    before = run.t < tips
    np.testing.assert_allclose(run.q[before, 0], speed * run.t[before], atol=1e-12)
    np.testing.assert_allclose(run.q[before, 2], 0.08, atol=1e-12)
    assert np.abs(run.v[before][:, 3:5]).max() < TURNING
    assert np.abs(run.v[run.t > tips + 0.01][:, 3:5]).max() > 0.01
    # No force along the table, and no moment about the vertical before the box tips.
    np.testing.assert_allclose(run.v[before][:, 5], 0.0, atol=1e-12)


def fall_along_edge(speed: float, radius: float) -> tuple[float, float]:
    """Return angle and time from the edge at which a sliding ball leaves it, by energy and quadrature."""
    cosine = (speed**2 + 2.0 * GRAVITY * radius) / (3.0 * GRAVITY * radius)
    angle = np.arccos(min(1.0, cosine))
    nodes, weights = np.polynomial.legendre.leggauss(60)
    theta = 0.5 * angle * (nodes + 1.0)
    rate = np.sqrt(speed**2 + 2.0 * GRAVITY * radius * (1.0 - np.cos(theta))) / radius
    return float(angle), float(0.5 * angle * np.sum(weights / rate))


@pytest.mark.parametrize("speed", [0.2, 0.5, 0.65, 0.75, 1.5])
def test_a_ball_without_friction_leaves_an_edge_where_its_load_ends(speed: float) -> None:
    """It turns about the edge until g cos = v^2 / r: at once if v^2 > g r, and then flies on a parabola."""
    radius = 0.05
    scene = on_a_table(coal.Sphere(radius), radius, (speed, 0.0, 0.0, 0.0, 0.0, 0.0))
    run = pn.simulate(scene, 0.2 / speed + 0.15, rtol=1e-11, atol=1e-12)
    angle, turning = fall_along_edge(speed, radius)
    leaves = 0.2 / speed + turning
    assert at(run, "lift_off") == pytest.approx([leaves], abs=TIME)
    at_angle = np.array([0.2 + radius * np.sin(angle), 0.05 + radius * np.cos(angle)])
    rate = np.sqrt(speed**2 + 2.0 * GRAVITY * radius * (1.0 - np.cos(angle)))
    velocity = rate * np.array([np.cos(angle), -np.sin(angle)])
    flies = run.t[-1] - leaves
    drop = np.array([0.0, -GRAVITY * flies])
    last = at_angle + flies * (velocity + 0.5 * drop)
    np.testing.assert_allclose(run.q[-1, [0, 2]], last, atol=1e-8)
    np.testing.assert_allclose(run.v[-1, [0, 2]], velocity + drop, atol=1e-8)


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_fixed_steps_leave_an_edge_too(speed: float) -> None:
    scene = on_a_table(coal.Box(0.1, 0.08, 0.06), 0.03, (speed, 0.0, 0.0, 0.0, 0.0, 0.0), 0.3)
    run = pn.simulate(scene, 0.2 / speed, method="rk4", dt=1e-3)
    np.testing.assert_allclose(run.q[-1, :3], [0.2, 0.0, 0.08], atol=1e-9)
