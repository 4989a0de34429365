"""A screw and its nut as two free bodies between which one flank of the thread presses and rubs.

The flank pushes with N >= 0 along its normal and rubs with mu N along the thread, both forces resolved by the
angles of the thread as in any textbook on machine elements.  Nothing is written in coordinates of a coupling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Screw:
    """A screw that turns about its axis, and a nut that moves along it.

    Attributes:
        J: inertia of the screw [kg m^2].
        m: mass of the nut [kg].
        radius: mean radius of the thread [m].
        lead_angle: of the thread [rad].
        pressure_angle: of the flank in the normal section [rad].
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
        """Way of the nut over angle of the screw [m/rad]."""
        return self.radius * np.tan(self.lead_angle)

    def directions(self):
        """(Force on the nut, torque on the screw) of a unit of N, and of one of friction that slows them."""
        c, s, flank = np.cos(self.lead_angle), np.sin(self.lead_angle), np.cos(self.pressure_angle)
        return np.array([flank * c, -flank * s * self.radius]), np.array([-s, -c * self.radius])

    def sliding(self, force, torque, sign):
        """Every (acceleration of the screw, flank force) at this sign of turning; negative: other flank."""
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
        """Friction over mu N that keeps it at rest: it sticks while this is at most 1."""
        normal, rub = self.directions()
        N, friction = np.linalg.solve(np.column_stack([normal, rub]), [-force, -torque])
        return abs(friction) / (self.mu * abs(N))
