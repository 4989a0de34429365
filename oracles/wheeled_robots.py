"""Robots on wheels that roll without slip, and their planar kinematics.

The models are Pinocchio's.  SciPy integrates their motion from the no-slip conditions only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

KINDS = ("differential", "casters", "ackermann", "omni")
# Tolerance of the reference: a hundredth of the tightest tolerance of a test.
REFERENCE = 1e-13


@dataclass
class Robot:
    """Robot and its motion.

    Attributes:
        model: pinocchio.Model with a joint "base".
        wheels: frame and radius of each `Rolling`.
        moved: name and function of time of each prescribed joint.
        omni: rows A of omnidirectional wheels, A v = 0, or None.
        q0: initial configuration, with the wheels on the plane.
        rate: t, (x, y, heading, swivels) -> their rates.
        y0: (x, y, heading, swivels) at the start.
        swivels: names of the joints whose angles follow x, y and heading in y.
    """

    model: pin.Model
    wheels: list[tuple[str, float]]
    moved: list[tuple[str, Callable]]
    omni: np.ndarray | None = None
    q0: np.ndarray = field(default=None)
    rate: Callable = field(default=None)
    y0: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    swivels: list[str] = field(default_factory=list)

    def reference(self, duration):
        """Return (x, y, heading, swivels) at the end, and the larger of path length and angle turned."""

        def rate(t, y):
            slopes = self.rate(t, y[:-2])
            return [*slopes, np.hypot(slopes[0], slopes[1]), abs(slopes[2])]

        run = solve_ivp(
            rate, (0.0, duration), [*self.y0, 0.0, 0.0], method="DOP853", rtol=REFERENCE, atol=REFERENCE
        )
        return run.y[:-2, -1], run.y[-2:, -1].max()

    def place(self, q):
        """Return (x, y, heading, swivels) of a configuration."""
        angles = [q[self.model.joints[self.model.getJointId(name)].idx_q] for name in self.swivels]
        if self.model.nvs[1] == 3:
            return np.array([q[0], q[1], np.arctan2(q[3], q[2]), *angles])
        R = pin.Quaternion(q[3:7]).matrix()
        return np.array([q[0], q[1], np.arctan2(R[1, 0], R[0, 0]), *angles])

    def miss(self, q, duration):
        """Return the largest difference from the reference, over max(1, path length, angle turned)."""
        end, way = self.reference(duration)
        apart = self.place(q) - end
        apart[2] = np.angle(np.exp(1j * apart[2]))
        return np.abs(apart).max() / max(1.0, way)


def _add(model, parent, joint, place, name, inertia):
    index = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array(place, float)), name)
    model.appendBodyToJoint(index, inertia, pin.SE3.Identity())
    return index


def _wheel(model, parent, place, name, radius, mass):
    disk = pin.Inertia(mass, np.zeros(3), mass * radius**2 * np.diag([0.25, 0.5, 0.25]))
    index = _add(model, parent, pin.JointModelRY(), place, name, disk)
    model.addFrame(pin.Frame(f"{name}_rim", index, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return f"{name}_rim", radius


def _chassis(rng, size, radius, *, free=False):
    model = pin.Model()
    mass = rng.uniform(0.5, 30.0)
    box = pin.Inertia(mass, 0.2 * size * rng.uniform(-1.0, 1.0, 3), 0.3 * mass * size**2 * np.eye(3))
    joint = pin.JointModelFreeFlyer() if free else pin.JointModelPlanar()
    base = _add(model, 0, joint, [0.0, 0.0, 0.0 if free else radius], "base", box)
    return model, base, mass


def _drive(rng, sinusoid, polynomial):
    if rng.random() < 0.5:
        return polynomial([0.0, rng.uniform(-4.0, 4.0)])
    return sinusoid(rng.uniform(0.5, 4.0), rng.uniform(0.3, 3.0), rng.uniform(0.0, 6.0))


def _start(robot, radius):
    model = robot.model
    robot.q0 = pin.neutral(model)
    if model.nvs[1] == 6:
        robot.q0[2] = radius
    for name, function in robot.moved:
        robot.q0[model.joints[model.getJointId(name)].idx_q] = function(0.0)[0]
    for name, angle in zip(robot.swivels, robot.y0[3:], strict=True):
        robot.q0[model.joints[model.getJointId(name)].idx_q] = angle
    return robot


def differential(rng, functions, casters=0):
    """Return a robot with two independently driven wheels on one axle, and passive casters."""
    radius, track = rng.uniform(0.03, 0.3), rng.uniform(0.1, 0.6)
    model, base, mass = _chassis(rng, track, radius, free=casters > 0 and rng.random() < 0.5)
    light = mass * 10.0 ** rng.uniform(-3.0, -0.5)
    wheels = [
        _wheel(model, base, [0.0, side * track / 2, 0.0], name, radius, light)
        for name, side in (("left", 1), ("right", -1))
    ]
    left, right = _drive(rng, *functions), _drive(rng, *functions)
    robot = Robot(model, wheels, [("left", left), ("right", right)])
    places = []
    for k in range(casters):
        small = radius * rng.uniform(0.3, 0.8)
        trail = small * rng.uniform(0.3, 1.2)
        x = rng.choice([-1, 1]) * (1.5 * trail + rng.uniform(0.6, 1.6) * track)
        y = rng.uniform(-0.3, 0.3) * track
        fork = pin.Inertia(0.02 * mass, np.array([trail / 2, 0, 0]), 0.02 * mass * trail**2 * np.eye(3))
        swivel = _add(model, base, pin.JointModelRZ(), [x, y, 0.0], f"swivel{k}", fork)
        wheels.append(_wheel(model, swivel, [trail, 0, small - radius], f"caster{k}", small, 0.01 * mass))
        robot.swivels.append(f"swivel{k}")
        robot.y0.append(rng.uniform(-np.pi, np.pi))
        places.append((x, y, trail))

    def rate(t, state):
        a, b = left(t)[1], right(t)[1]
        v, turn = radius * (a + b) / 2, radius * (b - a) / track
        slopes = [v * np.cos(state[2]), v * np.sin(state[2]), turn]
        for (x, y, trail), angle in zip(
            places, state[3:], strict=True
        ):  # the caster does not slip along its axle
            across = -np.sin(angle) * (v - turn * y) + np.cos(angle) * turn * x
            slopes.append(-turn - across / trail)
        return slopes

    robot.rate = rate
    return _start(robot, radius)


def _steering(angle, length, offset):
    """Return t -> (angle, rate, acceleration) of a wheel at an offset; all axles meet in one point."""

    def function(t):
        d, d1, d2 = angle(t)
        T = np.tan(d)
        T1 = (1 + T * T) * d1
        T2 = (1 + T * T) * (d2 + 2 * T * d1 * d1)
        far = length - offset * T
        size = far**2 + length**2 * T**2
        g1 = length**2 / size
        g2 = -(length**2) * (2 * length**2 * T - 2 * offset * far) / size**2
        return np.arctan2(length * T, far), g1 * T1, g1 * T2 + g2 * T1 * T1

    return function


def ackermann(rng, functions, drives=True):
    """Return a four-wheel car: one rear wheel drives, or no wheel drives and the steering is fixed."""
    sinusoid, polynomial = functions
    radius, track, length = rng.uniform(0.05, 0.3), rng.uniform(0.3, 0.8), rng.uniform(0.5, 1.5)
    model, base, mass = _chassis(rng, track, radius)
    light = mass * 10.0 ** rng.uniform(-3.0, -1.0)
    if drives:
        middle = sinusoid(rng.uniform(0.1, 0.4), rng.uniform(0.2, 2.0), rng.uniform(0.0, 6.0))
    else:
        middle = polynomial([rng.choice([-1, 1]) * rng.uniform(0.1, 0.4)])
    robot = Robot(model, [], [])
    for name, side in (("left", 1), ("right", -1)):
        robot.wheels.append(_wheel(model, base, [0, side * track / 2, 0], f"rear_{name}", radius, light))
        fork = pin.Inertia(0.1 * light, np.zeros(3), 0.1 * light * radius**2 * np.eye(3))
        steer = _add(model, base, pin.JointModelRZ(), [length, side * track / 2, 0], f"steer_{name}", fork)
        robot.wheels.append(_wheel(model, steer, [0, 0, 0], f"front_{name}", radius, light))
        robot.moved.append((f"steer_{name}", _steering(middle, length, side * track / 2)))
    if not drives:
        return _start(robot, radius), middle(0.0)[0], length
    drive = _drive(rng, *functions)
    robot.moved.append(("rear_left", drive))

    def rate(t, state):
        curve = np.tan(middle(t)[0]) / length
        v = radius * drive(t)[1] / (1 - curve * track / 2)
        return [v * np.cos(state[2]), v * np.sin(state[2]), v * curve]

    robot.rate = rate
    return _start(robot, radius)


def omni(rng, functions):
    """Return a robot with three omnidirectional wheels, each with one constraint along its plane."""
    radius = rng.uniform(0.03, 0.1)
    model, base, mass = _chassis(rng, 0.3, radius)
    light = mass * 10.0 ** rng.uniform(-3.0, -1.0)
    rows = np.zeros((3, 6))
    moved = []
    for k in range(3):
        toward = 2 * np.pi * k / 3 + rng.uniform(-0.2, 0.2)
        at, along = 0.3 * np.array([np.cos(toward), np.sin(toward)]), [-np.sin(toward), np.cos(toward)]
        _wheel(model, base, [*at, 0.0], f"wheel{k}", radius, light)
        rows[k, :3] = [*along, at[0] * along[1] - at[1] * along[0]]
        rows[k, 3 + k] = -radius
        moved.append((f"wheel{k}", _drive(rng, *functions)))
    to_body = np.linalg.inv(rows[:, :3]) * radius

    def rate(t, state):
        vx, vy, turn = to_body @ [function(t)[1] for _, function in moved]
        c, s = np.cos(state[2]), np.sin(state[2])
        return [c * vx - s * vy, s * vx + c * vy, turn]

    return _start(Robot(model, [], moved, omni=rows, rate=rate), radius)


def robot(rng, kind, functions):
    """Return a robot of one of KINDS; `functions` are the package's `sinusoid` and `polynomial`."""
    if kind == "casters":
        return differential(rng, functions, casters=int(rng.integers(1, 3)))
    return {"differential": differential, "ackermann": ackermann, "omni": omni}[kind](rng, functions)
