"""Body that swings on a ball pivot with friction until it comes to rest, by separate equations of motion.

The friction torque of the pivot is -s w / |w| with s = constant + rub |f|.  f is the force of the pivot.
SciPy's explicit Runge-Kutta method of order 8 integrates the angular velocity w to a speed below the
resolution of the samples.  The last phase is extrapolated linearly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

SETTINGS = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
LEAST = 1e-7  # speed at which linear extrapolation begins, relative to the initial speed


@dataclass
class HungBody:
    """Body on a ball pivot with friction.

    Attributes:
        mass: mass of the body [kg].
        center: center of mass from the pivot, in body axes [m].
        inertia: inertia about the center of mass, in body axes [kg m^2].
        gravity: gravity in world axes [m/s^2].
        constant: load-independent part of the friction torque [N m].
        rub: load-dependent friction torque over the force of the pivot [m].
    """

    mass: float
    center: np.ndarray
    inertia: np.ndarray
    gravity: np.ndarray
    constant: float
    rub: float

    def acceleration(self, turn: Rotation, w: np.ndarray) -> np.ndarray:
        """Return the angular acceleration in body axes [rad/s^2]."""
        c, weight = self.center, turn.inv().apply(self.gravity)
        about_pivot = self.inertia + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        moment = self.mass * np.cross(c, weight) - np.cross(w, about_pivot @ w)
        free, slowing = np.linalg.solve(about_pivot, np.stack([moment, -w / np.linalg.norm(w)], axis=1)).T
        # The force of the pivot is f0 + s f1, so that s = constant + rub |f0 + s f1|.
        f0 = self.mass * (np.cross(free, c) + np.cross(w, np.cross(w, c)) - weight)
        f1 = self.mass * np.cross(slowing, c)
        square = 1.0 - self.rub**2 * (f1 @ f1)
        linear = self.constant + self.rub**2 * (f0 @ f1)
        rest = self.constant**2 - self.rub**2 * (f0 @ f0)
        s = (linear + np.sqrt(linear**2 - square * rest)) / square
        return free + s * slowing

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the derivatives of the quaternion (x, y, z, w) and of the angular velocity."""
        (x, b, z, r), w = y[:4], y[4:]
        turns = np.array([[r, -z, b], [z, r, -x], [-b, x, r], [-x, -b, -z]])
        return np.concatenate([0.5 * turns @ w, self.acceleration(Rotation.from_quat(y[:4]), w)])

    def rest(self, y: np.ndarray, duration: float) -> float | None:
        """Return the time at which the body comes to rest, or None if it moves until the end."""
        least = LEAST * np.linalg.norm(y[4:])

        def slow(t, y):
            return np.linalg.norm(y[4:]) - least

        slow.terminal = True
        run = solve_ivp(self.rate, (0.0, duration), y, events=slow, **SETTINGS)
        if not run.t_events[0].size:
            return None
        w, a = run.y[4:, -1], self.rate(0.0, run.y[:, -1])[4:]
        return run.t[-1] - w @ w / (w @ a)

    def states(self, y: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the states at increasing times before rest, (k, 7); restarts the integrator each time."""
        found, t = [], 0.0
        for later in times:
            y = solve_ivp(self.rate, (t, later), y, **SETTINGS).y[:, -1]
            found.append(y)
            t = later
        return np.array(found)
