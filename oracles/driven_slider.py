"""Harmonically driven mass on a rail with dry and viscous friction: stick and slip in closed form.

While the mass slips in direction d, m dv/dt = f sin(w t) - c v - d L.  Slip begins when f |sin(w t)| exceeds
the static limit.  Nothing is integrated, so c/m has no upper bound.  If c/m is below about 10 w, slips
overlap.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


class DrivenSlider:
    """Slider of mass m [kg], force f [N] at w [rad/s], damping c [N s/m], limit L [N], static ratio."""

    def __init__(self, m: float, f: float, w: float, c: float, limit: float, ratio: float = 1.0) -> None:
        self.m, self.f, self.w, self.c, self.limit, self.static = m, f, w, c, limit, ratio * limit

    def speed(self, t: float, start: float, way: int) -> float:
        """Return the velocity at t in a slip that began at rest at `start`, in the direction `way`."""
        rate = self.c / self.m

        def forced(at: float) -> float:
            swing = rate * np.sin(self.w * at) - self.w * np.cos(self.w * at)
            return self.f / self.m * swing / (rate**2 + self.w**2) - way * self.limit / self.c

        return forced(t) - forced(start) * np.exp(-rate * (t - start))

    def events(self, duration: float) -> list[tuple[float, str]]:
        """Return (time, "slip" or "stick") of each event from rest at t = 0."""
        found: list[tuple[float, str]] = []
        half, give_way = np.pi / self.w, np.arcsin(self.static / self.f) / self.w
        k = 0
        while True:
            start, way = k * half + give_way, 1 if k % 2 == 0 else -1
            if start >= duration:
                return found
            found.append((start, "slip"))
            # The velocity reaches zero between the instants at which the force is at the two limits.
            low = k * half + (np.pi - np.arcsin(self.limit / self.f)) / self.w
            high = (k + 1) * half + np.arcsin(self.limit / self.f) / self.w
            end = brentq(lambda t, a=start, d=way: d * self.speed(t, a, d), low, high, 1e-15)
            if end < duration:
                found.append((end, "stick"))
            k += 1
