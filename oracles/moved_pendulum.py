"""A pendulum under a cart that moves as prescribed: integrated by SciPy between the breaks of the motion.

With the angle from the vertical, the length L to the center of mass and the inertia J about the pivot,
J angle'' = m L (x'' cos(angle) - g sin(angle)); where x' jumps by d, angle' jumps by m L cos(angle) d / J.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

REFERENCE = 1e-13
GRAVITY = 9.81
CART_MASS = 2.0


@dataclass
class Pendulum:
    """Length [m], mass [kg] and central inertia [kg m^2]."""

    length: float
    mass: float
    inertia: float

    def model(self):
        model = pin.Model()
        cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
        model.appendBodyToJoint(
            cart, pin.Inertia(CART_MASS, np.zeros(3), 0.1 * np.eye(3)), pin.SE3.Identity()
        )
        swing = model.addJoint(cart, pin.JointModelRY(), pin.SE3.Identity(), "swing")
        body = pin.Inertia(self.mass, np.array([0.0, 0.0, -self.length]), self.inertia * np.eye(3))
        model.appendBodyToJoint(swing, body, pin.SE3.Identity())
        return model

    def motion(self, function: Callable, breaks, start, duration):
        """(angle, rate) at the end, and the work that the jumps of the cart's rate have done."""
        lever = self.mass * self.length
        J = lever * self.length + self.inertia
        state, begin, work = np.array(start, float), 0.0, 0.0
        stops = [t for t in sorted(breaks) if 0.0 < t < duration] + [duration]
        for stop in stops:
            low, high = np.nextafter(begin, np.inf), np.nextafter(stop, -np.inf)

            def rate(t, y, low=low, high=high):
                x2 = function(min(max(t, low), high))[2]
                return [y[1], lever * (x2 * np.cos(y[0]) - GRAVITY * np.sin(y[0])) / J]

            run = solve_ivp(rate, (begin, stop), state, method="DOP853", rtol=REFERENCE, atol=REFERENCE)
            state, begin = run.y[:, -1].copy(), stop
            if stop < duration:
                before, after = (function(np.nextafter(stop, side * np.inf))[1] for side in (-1, 1))
                energy = self.kinetic(before, state)
                state[1] += lever * np.cos(state[0]) * (after - before) / J
                work += self.kinetic(after, state) - energy
        return state, work

    def kinetic(self, speed, state):
        """Kinetic energy of cart and pendulum [J]."""
        angle, rate = state
        lever = self.mass * self.length
        J = lever * self.length + self.inertia
        return (
            0.5 * (CART_MASS + self.mass) * speed**2
            + 0.5 * J * rate**2
            - lever * speed * rate * np.cos(angle)
        )
