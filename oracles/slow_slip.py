"""Slip that begins at rest without a drop of the limit, by equations of motion of its own and a stiff solver.

A plate on feet slides in its plane, a ball on a pivot turns: with the slip velocities u_e and the limits s_e
the friction is -s_e u_e / |u_e|.  SciPy's implicit Runge-Kutta method follows the direction of slip from a
speed far below what the tolerance sees.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize
from scipy.spatial.transform import Rotation

GRAVITY = 9.81
FIRST_SPEED = 1e-9  # of slip, along the direction in which it begins
DISTANCE = 1e-11  # of the search for forces within the limits
HELD = 1e-9  # part of the weight that forces found may leave unbalanced
AT_LIMIT = 1e-5  # part of a limit by which a foot holds that does not slip
BEGINS = (
    1e-3  # part of a limit by which a foot holds that begins to slip: limits are tried beside the true ones
)
NOISE = 1e-10  # part of the loads that a dense solution leaves
SETTINGS = {"method": "Radau", "rtol": 1e-9, "atol": 1e-13}


def shortest_pushes(tilts, needed, least):
    """The shortest x >= 0 with tilts x = needed, by trying which are zero; `least` where there is none."""
    n = len(least)
    size = np.abs(least).max()
    for count in range(1, n):
        for zero in combinations(range(n), count):
            kept = [k for k in range(n) if k not in zero]
            dual = np.linalg.lstsq(tilts[:, kept] @ tilts[:, kept].T, needed, rcond=1e-12)[0]
            x = tilts.T @ dual
            x[list(zero)] = 0.0
            met = np.abs(tilts @ x - needed).max() <= NOISE * size
            if met and x.min() >= -NOISE * size and (tilts[:, list(zero)].T @ dual <= NOISE * size).all():
                return x
    return least


def solved(lack, x):
    """Zero of a function that is piecewise linear, by Newton's method from x."""
    for _ in range(50):
        now = lack(x)
        step = 1e-6 * np.abs(x).max()
        J = np.array([(lack(x + step * e) - lack(x - step * e)) / (2.0 * step) for e in np.eye(len(x))]).T
        x = x - np.linalg.solve(J, now)
        if np.abs(now).max() <= 1e-13 * np.abs(x).max():
            break
    return x


class Plate:
    """A body that three feet or more hold to a level plane, under a wrench that moves with it.

    Feet stand below the center of mass, loaded by least norm over those that share the load: of all loads, or
    of those that do not pull.

    Attributes:
        feet: places of the feet (n, 3) in the body [m], all of the same height.
        mu: coefficient of friction of all feet.
        wrench: function of time: force and couple in world axes [N, N m].
        at: where the force acts [m].
        mass: of the body [kg].
        inertia: about each axis [kg m^2].
        pulls: whether feet are kept where they would have to pull.
    """

    def __init__(self, feet, mu, wrench, at, mass=10.0, inertia=0.3, pulls=True):
        self.feet, self.at = np.asarray(feet, dtype=float), np.asarray(at, dtype=float)
        self.pulls = pulls
        self.mu, self.wrench, self.mass, self.inertia = mu, wrench, mass, inertia

    def given(self, t, angle):
        """Feet in the axes of the plane; force and moment about the center of mass."""
        turn = Rotation.from_rotvec([0.0, 0.0, angle])
        force, couple = np.reshape(self.wrench(t), (2, 3))
        moment = couple + np.cross(turn.apply(self.at), force)
        return turn.apply(self.feet), force - [0.0, 0.0, self.mass * GRAVITY], moment

    def loads(self, feet, force, moment, friction):
        """Normal forces of least norm that balance what turns the plate over, for friction forces (n, 2)."""
        tilts = np.vstack([np.ones(len(feet)), feet[:, 1], -feet[:, 0]])
        h = feet[:, 2]
        by_friction = np.array([0.0, -(h * friction[:, 1]).sum(), (h * friction[:, 0]).sum()])
        needed = -(np.array([force[2], moment[0], moment[1]]) + by_friction)
        least = np.linalg.pinv(tilts) @ needed
        return least if self.pulls or least.min() >= 0.0 else shortest_pushes(tilts, needed, least)

    def acceleration(self, t, angle, directions):
        """Of x, y and the angle where the feet slip in these directions (n, 2); and the loads."""
        feet, force, moment = self.given(t, angle)

        def lack(loads):
            return loads - self.loads(feet, force, moment, -self.mu * loads[:, None] * directions)

        start = self.loads(feet, force, moment, np.zeros((len(feet), 2)))
        loads = solved(lack, start)
        friction = -self.mu * loads[:, None] * directions
        turning = moment[2] + (feet[:, 0] * friction[:, 1] - feet[:, 1] * friction[:, 0]).sum()
        return np.array([*(force[:2] + friction.sum(axis=0)) / self.mass, turning / self.inertia]), loads

    def sharings(self, t, angle, spin, directions, mu):
        """All loads of kept feet that slip in these directions, and rub where they pull as well.

        A foot whose direction is not a number is held: what it is given turns the plate about it.  One that
        all of its limit holds begins to slip against its friction.
        """
        found = self._sharings(t, angle, spin, directions, mu)
        for loads, friction in found:
            limits, size = mu * np.abs(loads), np.linalg.norm(friction, axis=1)
            begins = np.isnan(directions).any(axis=1) & (np.abs(size - limits) <= BEGINS * limits)
            if begins.any():
                directions = np.where(begins[:, None], -friction / size[:, None], directions)
                return self.sharings(t, angle, spin, directions, mu)
        return [loads for loads, _ in found]

    def _sharings(self, t, angle, spin, directions, mu):
        """Loads and friction where some feet slip and the others are held."""
        feet, force, moment = self.given(t, angle)
        unit = np.nan_to_num(directions)
        held = np.flatnonzero(np.isnan(directions).any(axis=1))
        slips = np.flatnonzero(~np.isnan(directions).any(axis=1))
        n = len(slips)

        def lack(x, signs):
            friction = np.zeros((len(feet), 2))
            friction[slips] = -mu * x[:n, None] * unit[slips]
            friction[held] = x[n:].reshape(-1, 2)
            loads = self.loads(feet, force, moment, friction)
            along = (force[:2] + friction.sum(axis=0)) / self.mass
            turning = moment[2] + (feet[:, 0] * friction[:, 1] - feet[:, 1] * friction[:, 0]).sum()
            about = turning / self.inertia * np.column_stack([-feet[:, 1], feet[:, 0]])
            of_feet = along + about - spin**2 * feet[:, :2]
            return np.concatenate([loads[slips] - signs * x[:n], of_feet[held].ravel()]), loads, friction

        found = []
        for signs in product((1.0, -1.0), repeat=n):
            first = lack(np.zeros(n + 2 * len(held)), signs)[0]
            J = np.array([lack(e, signs)[0] - first for e in np.eye(len(first))]).T
            x = np.linalg.solve(J, -first)
            if x[:n].min() >= 0.0:
                found.append(lack(x, signs)[1:])
        return found

    def slip(self, angle, v):
        feet = Rotation.from_rotvec([0.0, 0.0, angle]).apply(self.feet)
        return np.column_stack([v[0] - v[2] * feet[:, 1], v[1] + v[2] * feet[:, 0]])

    def excess(self, t):
        """Least part of the limits by which some foot passes its own while all rest, and the forces.

        Kept feet have the loads of least norm; feet that cannot pull have any that hold.
        """
        feet, force, moment = self.given(t, 0.0)
        if not self.pulls:
            return self.excess_of_any_loads(feet, force, moment)
        n = len(feet)
        balance = np.zeros((3, 2 * n))
        balance[0, ::2] = balance[1, 1::2] = 1.0
        balance[2, ::2], balance[2, 1::2] = -feet[:, 1], feet[:, 0]
        given = np.array([*force[:2], moment[2]])
        size = self.mu * self.mass * GRAVITY

        def margins(x):
            f = size * x[:-1].reshape(n, 2)
            limits = self.mu * self.loads(feet, force, moment, f)
            part = 1.0 + x[-1]
            return (part * abs(part) * limits**2 - (f**2).sum(axis=1)) / size**2

        def search(slack):
            return minimize(
                lambda x: x[-1],
                np.append(-np.linalg.pinv(balance) @ given / size, slack),
                jac=lambda x: np.eye(len(x))[-1],
                constraints=[
                    {"type": "eq", "fun": lambda x: (balance @ x[:-1]) * 1.0 + given / size},
                    {"type": "ineq", "fun": margins},
                ],
                method="SLSQP",
                options={"ftol": DISTANCE, "maxiter": 500},
            )

        found = search(1.0)
        if found.x[-1] > 1.0:  # worse than where it began, or that was no start
            found = min(found, search(2.0 * found.x[-1]), key=lambda one: one.x[-1])
        return found.x[-1], size * found.x[:-1].reshape(n, 2)

    def excess_of_any_loads(self, feet, force, moment):
        """The least s with |f| <= mu N + s of each foot over all loads N >= 0 in balance, and f."""
        n = len(feet)
        size = self.mass * GRAVITY
        friction, loads = np.zeros((6, 2 * n)), np.zeros((6, n))
        friction[0, ::2] = friction[1, 1::2] = loads[2] = 1.0
        friction[3, 1::2], friction[4, ::2] = -feet[:, 2], feet[:, 2]
        friction[5, ::2], friction[5, 1::2] = -feet[:, 1], feet[:, 0]
        loads[3], loads[4] = feet[:, 1], -feet[:, 0]
        balance = np.hstack([friction, loads, np.zeros((6, 1))])
        given = np.concatenate([force, moment]) / size

        def margins(x):
            f, limits = x[: 2 * n].reshape(n, 2), self.mu * x[2 * n : -1] + x[-1]
            return np.concatenate([limits * np.abs(limits) - (f**2).sum(axis=1), x[2 * n : -1]])

        def search(slack):
            return minimize(
                lambda x: x[-1],
                np.append(-np.linalg.pinv(balance[:, :-1]) @ given, slack),
                jac=lambda x: np.eye(len(x))[-1],
                constraints=[
                    {"type": "eq", "fun": lambda x: balance @ x + given},
                    {"type": "ineq", "fun": margins},
                ],
                method="SLSQP",
                options={"ftol": DISTANCE, "maxiter": 500},
            )

        ends = [search(slack) for slack in (0.1, 1.0, 10.0)]
        balanced = [one for one in ends if np.abs(balance @ one.x + given).max() <= HELD and one.success]
        if not balanced:  # the plate tips over
            return np.inf, np.zeros((n, 2))
        found = min(balanced, key=lambda one: one.x[-1])
        return found.x[-1] / self.mu, size * found.x[: 2 * n].reshape(n, 2)

    def give_way(self, latest):
        """The instant at which no forces within the limits hold the plate any more."""
        return brentq(lambda t: min(self.excess(t)[0], 1.0), 0.0, latest, xtol=1e-12)

    def onset(self, start):
        """Directions in which feet begin to slip when the plate gives way; not a number where one holds."""
        friction = self.excess(start)[1]
        size = np.linalg.norm(friction, axis=1)
        at_limit = size > (1.0 - AT_LIMIT) * self.mu * np.abs(self.loads(*self.given(start, 0.0), friction))
        return np.where(at_limit[:, None], -friction / size[:, None], np.nan)

    def run(self, start, duration, **settings):
        """State (x, y, angle and their rates) a time after it gave way."""
        directions = -self.excess(start)[1]
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        rows = np.array([self.slip(0.0, e).ravel() for e in np.eye(3)]).T
        across = np.column_stack([-directions[:, 1], directions[:, 0]])
        by_foot = np.einsum("ek,ekj->ej", across, rows.reshape(-1, 2, 3))
        way = np.linalg.svd(by_foot)[2][-1]
        along = np.einsum("ek,ekj,j->e", directions, rows.reshape(-1, 2, 3), way)
        way *= np.sign(along.sum()) / np.abs(along).max()

        def rate(t, y):
            u = self.slip(y[2], y[3:])
            n = u / np.linalg.norm(u, axis=1)[:, None]
            return np.concatenate([y[3:], self.acceleration(t, y[2], n)[0]])

        first = np.concatenate([np.zeros(3), FIRST_SPEED * way])
        return solve_ivp(rate, (start, start + duration), first, **{**SETTINGS, **settings}).y[:, -1]


class Ball:
    """A body on a ball joint at the origin, rubbed by mu radius times the force in the joint, under a moment.

    Attributes:
        mass: [kg].
        center: of mass, in the body [m].
        inertia: (3, 3) about the center of mass [kg m^2].
        lever: mu radius [m].
        wrench: function of time: force at `end` and couple in world axes [N, N m].
        end: where the force acts, in the body [m].
    """

    def __init__(self, mass, center, inertia, lever, wrench, end):
        self.mass, self.lever, self.wrench = mass, lever, wrench
        self.center, self.end = np.asarray(center, dtype=float), np.asarray(end, dtype=float)
        self.inertia = inertia + mass * (
            self.center @ self.center * np.eye(3) - np.outer(self.center, self.center)
        )

    def acceleration(self, t, turn, omega, friction):
        """Of the angle (body axes) under a friction moment, and the size of the force in the joint."""
        force, couple = np.reshape(self.wrench(t), (2, 3))
        force, couple = turn.inv().apply(force), turn.inv().apply(couple)
        weight = turn.inv().apply([0.0, 0.0, -self.mass * GRAVITY])
        moment = couple + np.cross(self.end, force) + np.cross(self.center, weight) + friction
        alpha = np.linalg.solve(self.inertia, moment - np.cross(omega, self.inertia @ omega))
        place = np.cross(alpha, self.center) + np.cross(omega, np.cross(omega, self.center))
        return alpha, np.linalg.norm(self.mass * place - weight - force)

    def slipping(self, t, turn, omega, direction):
        """Acceleration where the joint slips in a direction: the limit is a fixed point."""
        limit = 0.0
        for _ in range(100):
            alpha, load = self.acceleration(t, turn, omega, -limit * direction)
            if abs(self.lever * load - limit) <= 1e-15 * limit:
                break
            limit = self.lever * load
        return alpha

    def holding(self, t, turn):
        """The friction moment that holds the body at rest, and its limit."""
        none, _ = self.acceleration(t, turn, np.zeros(3), np.zeros(3))
        moment = -self.inertia @ none
        return moment, self.lever * self.acceleration(t, turn, np.zeros(3), moment)[1]

    def give_way(self, turn, first, last):
        def margin(t):
            moment, limit = self.holding(t, turn)
            return limit - np.linalg.norm(moment)

        return brentq(margin, first, last, xtol=1e-14)

    def run(self, turn, start, duration, **settings):
        """Rotation and angular velocity (body axes) a time after the body gave way."""

        def rate(t, y):
            here = Rotation.from_quat(y[:4])
            omega = y[4:]
            x, y_, z, w = y[:4]
            a, b, c = omega
            spin = 0.5 * np.array(
                [w * a + y_ * c - z * b, w * b + z * a - x * c, w * c + x * b - y_ * a, 0.0]
            )
            spin[3] = -0.5 * (x * a + y_ * b + z * c)
            return np.concatenate([spin, self.slipping(t, here, omega, omega / np.linalg.norm(omega))])

        moment, _ = self.holding(start, turn)
        first = np.concatenate([turn.as_quat(), -FIRST_SPEED * moment / np.linalg.norm(moment)])
        return solve_ivp(rate, (start, start + duration), first, **{**SETTINGS, **settings}).y[:, -1]
