"""Contacts with planes of moving bodies, against closed forms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.mechanisms import GRAVITY, TIGHT, body, empty, frame

ROUNDING = 1e-12


def test_a_ball_on_a_turntable_runs_in_a_circle():
    """The velocity rotates at 2/7 of the table's rate (Weltner, Am. J. Phys. 47, 1979, 984)."""
    r, omega = 0.05, 3.0
    model = empty((0.0, 0.0, -GRAVITY))
    frame(model, "table", body(model, 0, pin.JointModelRZ(), "turn", 1.0, inertia=np.eye(3)))
    ball = body(model, 0, pin.JointModelFreeFlyer(), "ball", 2.0, inertia=0.4 * 2.0 * r * r * np.eye(3))
    frame(model, "middle", ball)
    up, x, v = np.array([0.0, 0.0, 1.0]), np.array([0.3, 0.1, r]), np.array([0.2, -0.1, 0.0])
    spin = np.cross(up, (v - omega * np.cross(up, x)) / r)
    contact = pn.PointContact("middle", mu=10.0, plane="table", radius=r)
    drive = pn.PrescribedMotion("turn", pn.polynomial([0.0, omega]))
    q0, v0 = [0.0, *x, 0.0, 0.0, 0.0, 1.0], [omega, *v, *spin]
    scene = pn.Scene(model, constraints=[drive], contacts=[contact], q0=q0, v0=v0)
    run = pn.simulate(scene, 5.0, **TIGHT)
    assert run.events == []
    rate = 2.0 / 7.0 * omega
    turned = pin.exp3(np.array([0.0, 0.0, rate * 5.0]))
    radius = np.cross(v, up) / rate  # from the center of the circle
    expected = x - radius + turned @ radius
    assert run.q[-1, 1:4] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("speed", [0.5, -0.5])
@pytest.mark.parametrize("e", [0.0, 0.6])
def test_a_ball_strikes_a_plank_on_a_pivot(e, speed):
    """P (1/m + d^2/J) = (1 + e) v with approach velocity v; the plank rotates to or from the ball."""
    m, J, d, r = 0.7, 0.3, 0.4, 0.05
    model = empty((0.0, 0.0, 0.0))
    frame(model, "plank", body(model, 0, pin.JointModelRY(), "pivot", 1.0, inertia=J * np.eye(3)))
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    joint = body(model, joint, pin.JointModelPZ(), "z", m)
    frame(model, "ball", joint)
    contact = pn.PointContact("ball", plane="plank", radius=r, restitution=e)
    scene = pn.Scene(model, contacts=[contact], q0=[0.0, d, r], v0=[speed, 0.0, -2.0])
    impact = pn.simulate(scene, 1e-3).events[0]
    P = (1.0 + e) * (2.0 - speed * d) / (1.0 / m + d * d / J)
    assert impact.impulse == pytest.approx([P, 0.0, 0.0], rel=1e-12)
    assert impact.v_plus == pytest.approx([speed + d * P / J, 0.0, -2.0 + P / m], abs=ROUNDING)


class TestBoxOnTable:
    """A box of 0.2 m by 0.5 m on an accelerated table: it slides above mu g and tips above b/h g."""

    def solve(self, acceleration, mu):
        model = empty((0.0, 0.0, -GRAVITY))
        frame(model, "table", body(model, 0, pin.JointModelPX(), "drive", 1.0))
        size, mass = np.array([0.2, 0.3, 0.5]), 2.0
        inertia = mass / 12.0 * np.diag((size @ size) - size**2)
        joint = body(model, 0, pin.JointModelFreeFlyer(), "box", mass, inertia=inertia)
        frame(model, "middle", joint)
        scene = pn.Scene(
            model,
            constraints=[pn.PrescribedMotion("drive", pn.polynomial([0.0, 0.0, 0.5 * acceleration]))],
            contacts=pn.box_contacts("middle", size, "table", mu=mu),
            q0=[0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0],
        )
        return scene.solve(scene.q0, scene.v0)

    @pytest.mark.parametrize("side", [-1e-9, 1e-9])
    def test_slides(self, side):
        acceleration = 0.3 * GRAVITY * (1.0 + side)
        now = self.solve(acceleration, 0.3)
        assert now.a[1] == pytest.approx(min(acceleration, 0.3 * GRAVITY), abs=1e-12)
        assert (now.modes[now.closed] == (1 if side > 0.0 else 0)).all()

    @pytest.mark.parametrize("side", [-1e-9, 1e-9])
    def test_tips(self, side):
        now = self.solve(0.4 * GRAVITY * (1.0 + side), 0.8)
        assert now.closed.sum() == (2 if side > 0.0 else 4)
        assert (abs(now.a[5]) > ROUNDING) is np.bool_(side > 0.0)
