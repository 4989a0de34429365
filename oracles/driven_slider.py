"""A mass on a rail, pushed to and fro, with dry and viscous friction: its stick and slip in closed form.

m dv/dt = f sin(w t) - c v - d L while it slips the way d, from rest as soon as f |sin(w t)| passes the
static limit.  Nothing is integrated, and c/m may be as large as it likes; below some 10 w slips would run
into each other.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


class DrivenSlider:
    """Mass m [kg], force f [N] at w [rad/s], viscous coefficient c [N s/m], limit L [N], static ratio."""

    def __init__(self, m: float, f: float, w: float, c: float, limit: float, ratio: float = 1.0) -> None:
        self.m, self.f, self.w, self.c, self.limit, self.static = m, f, w, c, limit, ratio * limit

    def speed(self, t: float, start: float, way: int) -> float:
        """Of a slip that began at rest at `start`."""
        rate = self.c / self.m

        def forced(at: float) -> float:
            swing = rate * np.sin(self.w * at) - self.w * np.cos(self.w * at)
            return self.f / self.m * swing / (rate**2 + self.w**2) - way * self.limit / self.c

        return forced(t) - forced(start) * np.exp(-rate * (t - start))

    def events(self, duration: float) -> list[tuple[float, str]]:
        """(time, "slip" or "stick") from rest at t = 0."""
        found: list[tuple[float, str]] = []
        half, give_way = np.pi / self.w, np.arcsin(self.static / self.f) / self.w
        k = 0
        while True:
            start, way = k * half + give_way, 1 if k % 2 == 0 else -1
            if start >= duration:
                return found
            found.append((start, "slip"))
            # The speed passes zero after the force is back at the limit and before it pushes the other way.
            low = k * half + (np.pi - np.arcsin(self.limit / self.f)) / self.w
            high = (k + 1) * half + np.arcsin(self.limit / self.f) / self.w
            end = brentq(lambda t, a=start, d=way: d * self.speed(t, a, d), low, high, 1e-15)
            if end < duration:
                found.append((end, "stick"))
            k += 1
