"""Pendulum on a cart with prescribed motion, integrated by SciPy between the breaks of the motion.

The angle is measured from the vertical, L is the length to the center of mass and J the inertia about the
pivot: J angle'' = m L (x'' cos(angle) - g sin(angle)).  The unknowns are the angle and the momentum
u = J angle' - m L cos(angle) x', with u' = m L sin(angle) (angle' x' - g).  u keeps its value where x' jumps,
and contains no x'', which may be large.
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
    """Pendulum with length [m], mass [kg] and central inertia [kg m^2]."""

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
        """Return (angle, rate) at the end, and the work done at the jumps of the cart's velocity."""
        lever = self.mass * self.length
        J = lever * self.length + self.inertia

        def turning(angle, momentum, speed):
            return (momentum + lever * np.cos(angle) * speed) / J

        speed = function(0.0)[1]
        state = np.array([start[0], J * start[1] - lever * np.cos(start[0]) * speed])
        begin, work = 0.0, 0.0
        for stop in [t for t in sorted(breaks) if 0.0 < t < duration] + [duration]:
            low, high = np.nextafter(begin, np.inf), np.nextafter(stop, -np.inf)

            def rate(t, y, low=low, high=high):
                speed = function(min(max(t, low), high))[1]
                turns = turning(*y, speed)
                return [turns, lever * np.sin(y[0]) * (turns * speed - GRAVITY)]

            run = solve_ivp(rate, (begin, stop), state, method="DOP853", rtol=REFERENCE, atol=REFERENCE)
            state, begin = run.y[:, -1], stop
            if stop < duration:
                before, after = (function(np.nextafter(stop, side * np.inf))[1] for side in (-1, 1))
                angle = state[0]
                work += self.kinetic(after, (angle, turning(*state, after)))
                work -= self.kinetic(before, (angle, turning(*state, before)))
        return (state[0], turning(*state, function(duration)[1])), work

    def kinetic(self, speed, state):
        """Return the kinetic energy of cart and pendulum [J]."""
        angle, rate = state
        lever = self.mass * self.length
        J = lever * self.length + self.inertia
        return (
            0.5 * (CART_MASS + self.mass) * speed**2
            + 0.5 * J * rate**2
            - lever * speed * rate * np.cos(angle)
        )
