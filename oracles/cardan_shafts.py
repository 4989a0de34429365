"""Chains of Cardan joints in closed form: angles, rates, accelerations and the torque at the input.

Shaft k rotates by angle_k about its own axis.  The cross between two shafts has one pin on each shaft, at
right angles: p(angle_k) . r(angle_k+1) = 0.  If the first pin is initially perpendicular to both shafts, this
is tan(out) = tan(in) cos(beta).  Virtual work gives the torque from the effective inertia at the input.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

# Step of the five-point differences by the angle [rad]: truncation and rounding are both near 1e-11.
STEP = 1e-3


def _unit(x):
    return x / np.linalg.norm(x)


def _across(axis, angle):
    """Return a unit vector perpendicular to an axis."""
    u = _unit(np.cross(axis, [0.3, 0.9, 0.2]))
    return np.cos(angle) * u + np.sin(angle) * np.cross(axis, u)


def _turned(axis, vector, angle):
    """Return a vector perpendicular to the axis, rotated by each angle, and its derivative by the angle."""
    side = np.cross(axis, vector)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return c * vector + s * side, c * side - s * vector


def _slope(function, angle):
    return (
        8 * (function(angle + STEP) - function(angle - STEP))
        - function(angle + 2 * STEP)
        + function(angle - 2 * STEP)
    ) / (12 * STEP)


class Shafts:
    """Random shafts joined by crosses, with bearings for the shafts that the joints do not locate.

    Attributes:
        model: pinocchio.Model with a joint "input" and two joints for each cross.
        bearings: frame and axis of each shaft that needs a bearing: all but the first two.
        axes: unit vectors of all shafts.
    """

    def __init__(self, rng, crosses):
        self.crosses, self.axes, self.pins = crosses, [_unit(np.array([1.0, *rng.uniform(-0.1, 0.1, 2)]))], []
        for _ in range(crosses):
            bend, axis = rng.uniform(0.1, 0.8), self.axes[-1]
            self.axes.append(np.cos(bend) * axis + np.sin(bend) * _across(axis, rng.uniform(0.0, 6.3)))
        for axis, following in zip(self.axes, self.axes[1:], strict=False):
            own = _across(axis, rng.uniform(0.0, 6.3))
            self.pins.append((own, _unit(np.cross(following, own))))
        lengths = rng.uniform(0.1, 0.5, crosses)
        self.shaft_inertia, self.cross_inertia = (
            rng.uniform(0.01, 0.1, crosses + 1),
            rng.uniform(1e-4, 1e-3, crosses),
        )
        self.model = model = pin.Model()
        model.gravity.linear = np.zeros(3)

        def add(parent, axis, place, name, mass, inertia):
            joint = pin.JointModelRevoluteUnaligned(axis)
            index = model.addJoint(parent, joint, pin.SE3(np.eye(3), place), name)
            body = pin.Inertia(mass, np.zeros(3), inertia * np.eye(3))
            model.appendBodyToJoint(index, body, pin.SE3.Identity())
            return index

        last = add(0, self.axes[0], np.zeros(3), "input", 1.0, self.shaft_inertia[0])
        self.bearings = []
        for k, (first, second) in enumerate(self.pins):
            place = np.zeros(3) if k == 0 else lengths[k] * self.axes[k]
            last = add(last, first, place, f"first_pin{k}", 0.05, self.cross_inertia[k])
            last = add(last, second, np.zeros(3), f"second_pin{k}", 1.0, self.shaft_inertia[k + 1])
            model.addFrame(pin.Frame(f"shaft{k + 1}", last, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
            if k > 0:
                self.bearings.append((f"shaft{k + 1}", self.axes[k + 1]))

    def angles(self, angle):
        """Return the angles of all shafts, (crosses + 1, n), continuous from zero."""
        found = [angle]
        for k, (own, other) in enumerate(self.pins):
            p, _ = _turned(self.axes[k], own, found[-1])
            side = np.cross(self.axes[k + 1], other)
            sign = np.sign(own @ side)
            x = np.arctan2(-sign * (p @ other), sign * (p @ side))
            found.append(x + 2 * np.pi * np.round((found[-1] - x) / (2 * np.pi)))
        return np.array(found)

    def _pins(self, angle):
        """Return the pins of each cross, their derivatives by the input angle, and all speed ratios."""
        angles, ratios, pins = self.angles(angle), [np.ones_like(angle)], []
        for k, (own, other) in enumerate(self.pins):
            p, dp = _turned(self.axes[k], own, angles[k])
            r, dr = _turned(self.axes[k + 1], other, angles[k + 1])
            ratios.append(-ratios[-1] * np.sum(dp * r, 1) / np.sum(p * dr, 1))
            pins.append((p, r, dp * ratios[-2][:, None], dr * ratios[-1][:, None]))
        return pins, np.array(ratios)

    def inertia(self, angle):
        """Return the effective inertia at the input, (n,)."""
        pins, ratios = self._pins(angle)
        felt = self.shaft_inertia @ ratios**2
        for inertia, (p, r, dp, dr) in zip(self.cross_inertia, pins, strict=True):
            s, ds = np.cross(p, r), np.cross(dp, r) + np.cross(p, dr)
            turn = 0.5 * (np.cross(p, dp) + np.cross(r, dr) + np.cross(s, ds))
            felt = felt + inertia * np.sum(turn**2, 1)
        return felt

    def motion(self, angle, rate, acceleration):
        """Return angles, rates and accelerations, (crosses + 1, n) each, and the input torque, (n,)."""
        _, ratios = self._pins(angle)
        change = _slope(lambda x: self._pins(x)[1], angle)
        torque = self.inertia(angle) * acceleration + 0.5 * _slope(self.inertia, angle) * rate**2
        return self.angles(angle), ratios * rate, change * rate**2 + ratios * acceleration, torque
