"""Body of unit inertia moved by the friction of an oscillating partner, in closed form between mode changes.

The partner has the velocity u(t) = cos(omega t + phase).  Dry friction of the limit c is the only force on
the body.  A body slipping at velocity w has dw/dt = -c sgn(w - u).  The body sticks while |du/dt| <= c.  The
roots of w(t) - u(t) are located on a fine grid and at the minima between its points.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

GRID = 1500  # points in a quarter period: a minimum between two points is close to a parabola
NEAR = 1e-4  # a minimum of the slip speed below this value may cross zero
ROUNDING = 1e-12


class Partner:
    """Exact motion of the body.

    Attributes:
        omega: angular frequency of the partner [rad/s].
        phase: its phase at t = 0 [rad].
        limit: friction limit over the inertia.
    """

    def __init__(self, omega, phase, limit):
        self.omega, self.phase, self.limit = omega, phase, limit

    def velocity(self, t):
        return np.cos(self.omega * t + self.phase)

    def rate(self, t):
        return -self.omega * np.sin(self.omega * t + self.phase)

    def body(self, w, duration):
        """Return the final velocity, the displacement and the number of mode changes of the body.

        Args:
            w: velocity of the body at t = 0.
            duration: length of time [s].
        """
        t, way, changes = 0.0, 0.0, 0
        mode = float(np.sign(w - self.velocity(t)))
        while t < duration:
            end = min(duration, t + 0.5 * np.pi / self.omega)
            if mode == 0.0:
                end, gives_way = self._rest(t, end)
                way += (self._angle(end) - self._angle(t)) / self.omega
                w = self.velocity(end)
                mode = -float(np.sign(self.rate(end))) if gives_way else 0.0
                changes += gives_way
            else:
                end, meets = self._slip(t, end, w, mode)
                way += w * (end - t) - 0.5 * mode * self.limit * (end - t) ** 2
                w = self.velocity(end) if meets else w - mode * self.limit * (end - t)
                if meets:
                    mode = 0.0 if abs(self.rate(end)) <= self.limit else -float(np.sign(self.rate(end)))
                changes += meets
            t = end
        return w, way, changes

    def _angle(self, t):
        return np.sin(self.omega * t + self.phase)

    def _rest(self, t, end):
        """Return the end of sticking, and whether the body begins to slip there."""

        def margin(s):
            return self.limit - abs(self.rate(s))

        if margin(t) < -ROUNDING:
            return t, True
        grid = np.linspace(t, end, GRID)
        past = np.flatnonzero(self.limit - np.abs(self.rate(grid))[1:] < 0.0)
        if not len(past):
            return end, False
        low, high = grid[past[0]], grid[past[0] + 1]
        return (brentq(margin, low, high, xtol=1e-15) if margin(low) > 0.0 else low), True

    def _slip(self, t, end, w, mode):
        """Return the end of slipping, and whether the slip velocity is zero there."""

        def gap(s):
            return mode * (w - mode * self.limit * (s - t) - self.velocity(s))

        grid = np.linspace(t, end, GRID)
        gaps = mode * (w - mode * self.limit * (grid - t) - self.velocity(grid))
        below = np.flatnonzero(gaps[1:] < 0.0)
        last = below[0] + 1 if len(below) else len(grid) - 1
        bracket = (grid[last - 1], grid[last]) if len(below) else None
        for i in range(1, last):
            if gaps[i] > gaps[i - 1] or gaps[i] > gaps[i + 1] or gaps[i] > NEAR * (1.0 + self.limit):
                continue

            def slope(s):
                return -self.limit - mode * self.rate(s)

            if slope(grid[i - 1]) < 0.0 < slope(grid[i + 1]):
                lowest = brentq(slope, grid[i - 1], grid[i + 1], xtol=1e-15)
                if gap(lowest) < 0.0:
                    bracket = (grid[i - 1], lowest)
                    break
        if bracket is None:
            return end, False
        low, high = bracket
        if gap(low) <= 0.0:  # the slip velocity is still zero: starts at the first positive value
            ahead = [s for s in np.linspace(low, high, 50)[1:-1] if gap(s) > 0.0]
            if not ahead:
                return low, True
            low = ahead[0]
        return brentq(gap, low, high, xtol=1e-16), True
