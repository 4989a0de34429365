"""Screw and nut as two free bodies with contact and friction at one flank of the thread.

The flank has a normal force N >= 0 and friction mu N along the thread.  Both forces are resolved by the
angles of the thread as in textbooks on machine elements, without the coordinates of a coupling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Screw:
    """Screw that rotates about its axis, and nut that translates along the axis.

    Attributes:
        J: inertia of the screw [kg m^2].
        m: mass of the nut [kg].
        radius: mean radius of the thread [m].
        lead_angle: lead angle of the thread [rad].
        pressure_angle: pressure angle of the flank in the normal section [rad].
        mu: coefficient of friction.
    """

    J: float
    m: float
    radius: float
    lead_angle: float
    pressure_angle: float
    mu: float

    @property
    def ratio(self):
        """Return the travel of the nut per angle of the screw [m/rad]."""
        return self.radius * np.tan(self.lead_angle)

    def directions(self):
        """Return (force on the nut, torque on the screw) of unit N, and of unit friction against motion."""
        c, s, flank = np.cos(self.lead_angle), np.sin(self.lead_angle), np.cos(self.pressure_angle)
        return np.array([flank * c, -flank * s * self.radius]), np.array([-s, -c * self.radius])

    def sliding(self, force, torque, sign):
        """Return all (screw acceleration, flank force) at this sign of rotation; negative: other flank."""
        normal, rub = self.directions()
        found = []
        for flank in (1.0, -1.0):
            pair = flank * normal + sign * self.mu * rub
            # m ratio a = force + pair[0] N, J a = torque + pair[1] N
            a, N = np.linalg.solve([[self.m * self.ratio, -pair[0]], [self.J, -pair[1]]], [force, torque])
            if N >= 0.0:
                found.append((a, flank * N))
        return found

    def holds(self, force, torque):
        """Return the friction for rest over mu N: the screw sticks if the ratio is at most 1."""
        normal, rub = self.directions()
        N, friction = np.linalg.solve(np.column_stack([normal, rub]), [-force, -torque])
        return abs(friction) / (self.mu * abs(N))
