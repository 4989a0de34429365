"""Slip onset of a body on feet: the largest load that friction within the limits of the feet can hold.

The normal forces of more than three feet are the minimum-norm solution, as the package documents.  The moment
of friction changes the normal forces linearly.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from .slow_slip import Plate

FEASIBLE = 1e-9  # largest violation of a feasible solution [N]


class Stance:
    """Body with feet on the plane z = 0 under a growing load.

    Args:
        feet: positions relative to the center of mass [m], (n, 3).
        weight: weight of the body [N].
        mu: static coefficient of friction.
        load: rate of the force at `at` [N/s].
        at: point of application relative to the center of mass [m].
        couple: rate of the moment [N m/s].
    """

    def __init__(self, feet, weight, mu, load, at, couple):
        self.feet, self.mu, n = np.asarray(feet, float), mu, len(feet)
        self.load, self.couple = np.asarray(load, float), np.cross(at, load) + couple
        self.at, self.turning = at, np.asarray(couple, float)
        presses = np.array([np.ones(n), self.feet[:, 1], -self.feet[:, 0]])  # force z, moments x and y
        share = np.linalg.pinv(presses)
        self.normal0 = share @ [weight, 0.0, 0.0]
        self.normal_t = share @ [-self.load[2], -self.couple[0], -self.couple[1]]
        # Friction (fx, fy) at a foot has the moments (-z fy, z fx) about x and y.
        z, none = self.feet[:, 2], np.zeros(n)
        self.normal_f = -share @ np.array(
            [np.zeros(2 * n), np.ravel([none, -z], order="F"), np.ravel([z, none], order="F")]
        )
        x, y = self.feet[:, 0], self.feet[:, 1]
        self.holds = np.array(
            [
                np.ravel([none + 1, none], order="F"),
                np.ravel([none, none + 1], order="F"),
                np.ravel([-y, x], order="F"),
            ]
        )

    def normals(self, f, t):
        return self.normal0 + self.normal_t * t + self.normal_f @ f

    def plate(self, mu):
        """Return the sliding body as a plate of 10 kg."""
        return Plate(self.feet, mu, lambda t: np.concatenate([self.load * t, self.turning * t]), self.at)

    def gives_way(self, guess):
        """Return the time of slip onset, the normal forces then, and their violation.

        The result is the latest time of six searches.
        The feasible set of times is convex, but a search may end at a feasible time before the optimum.
        """
        found = [self.search(part * guess) for part in (0.1, 0.3, 0.6, 1.0, 2.0, 3.0)]
        held = [each for each in found if each[2] <= FEASIBLE]
        return max(held, key=lambda each: each[0]) if held else min(found, key=lambda each: each[2])

    def search(self, guess):
        """Return the result of one search, from a guess of the time."""
        n = len(self.feet)
        against = np.array([self.load[0], self.load[1], self.couple[2]])

        def room(x):
            normals, f = self.normals(x[:-1], x[-1] * guess), x[:-1].reshape(n, 2)
            return np.concatenate([self.mu**2 * normals**2 - (f**2).sum(axis=1), normals])

        found = minimize(
            lambda x: -x[-1],
            np.append(np.zeros(2 * n), 0.5),
            jac=lambda x: np.append(np.zeros(2 * n), -1.0),
            constraints=[
                {"type": "eq", "fun": lambda x: self.holds @ x[:-1] + against * x[-1] * guess},
                {"type": "ineq", "fun": room},
            ],
            bounds=[(None, None)] * (2 * n) + [(0.0, None)],
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-15},
        )
        t = found.x[-1] * guess
        lacks = max(-room(found.x).min(), np.abs(self.holds @ found.x[:-1] + against * t).max())
        return t, self.normals(found.x[:-1], t), lacks
