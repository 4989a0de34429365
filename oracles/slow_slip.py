"""Slip onset without a drop of the limit, by separate equations of motion and a stiff solver.

A plate on feet slides in its plane, or a body rotates on a ball joint.  For slip velocities u_e and limits
s_e the friction is -s_e u_e / |u_e|.  SciPy's implicit Runge-Kutta method integrates from an initial speed
far below the tolerance.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize
from scipy.spatial.transform import Rotation

GRAVITY = 9.81
FIRST_SPEED = 1e-9  # initial slip speed, along the onset direction
DISTANCE = 1e-11  # tolerance of the search for forces within the limits
HELD = 1e-9  # part of the weight that the forces may leave unbalanced
AT_LIMIT = 1e-5  # relative margin to the limit beyond which a foot sticks
BEGINS = 1e-3  # relative margin to the limit within which a foot begins to slip
NOISE = 1e-10  # relative residual of a dense solution
SETTINGS = {"method": "Radau", "rtol": 1e-9, "atol": 1e-13}


def shortest_pushes(tilts, needed, least):
    """Return x >= 0 of minimum norm with tilts x = needed, by enumeration of zeros; else `least`."""
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
    """Return a zero of a piecewise linear function by Newton's method from x."""
    for _ in range(50):
        now = lack(x)
        step = 1e-6 * np.abs(x).max()
        J = np.array([(lack(x + step * e) - lack(x - step * e)) / (2.0 * step) for e in np.eye(len(x))]).T
        x = x - np.linalg.solve(J, now)
        if np.abs(now).max() <= 1e-13 * np.abs(x).max():
            break
    return x


class Plate:
    """Body with at least three feet on a level plane, under a wrench at a body-fixed point.

    The normal forces of the feet are the minimum-norm solution: of all loads, or of nonnegative loads.

    Attributes:
        feet: positions of the feet in the body [m], (n, 3), all at the same height.
        mu: coefficient of friction of all feet.
        wrench: function of time: force and couple in world axes [N, N m].
        at: point of application of the force in the body [m].
        mass: mass of the body [kg].
        inertia: moment of inertia about each axis [kg m^2].
        pulls: whether the contacts are bilateral, with tension allowed.
    """

    def __init__(self, feet, mu, wrench, at, mass=10.0, inertia=0.3, pulls=True):
        self.feet, self.at = np.asarray(feet, dtype=float), np.asarray(at, dtype=float)
        self.pulls = pulls
        self.mu, self.wrench, self.mass, self.inertia = mu, wrench, mass, inertia

    def given(self, t, angle):
        """Return feet in the axes of the plane, and force and moment about the center of mass."""
        turn = Rotation.from_rotvec([0.0, 0.0, angle])
        force, couple = np.reshape(self.wrench(t), (2, 3))
        moment = couple + np.cross(turn.apply(self.at), force)
        return turn.apply(self.feet), force - [0.0, 0.0, self.mass * GRAVITY], moment

    def loads(self, feet, force, moment, friction):
        """Return minimum-norm normal forces that balance the plate under friction forces (n, 2)."""
        tilts = np.vstack([np.ones(len(feet)), feet[:, 1], -feet[:, 0]])
        h = feet[:, 2]
        by_friction = np.array([0.0, -(h * friction[:, 1]).sum(), (h * friction[:, 0]).sum()])
        needed = -(np.array([force[2], moment[0], moment[1]]) + by_friction)
        least = np.linalg.pinv(tilts) @ needed
        return least if self.pulls or least.min() >= 0.0 else shortest_pushes(tilts, needed, least)

    def acceleration(self, t, angle, directions):
        """Return accelerations of x, y and the angle for slip directions (n, 2), and the loads."""
        feet, force, moment = self.given(t, angle)

        def lack(loads):
            return loads - self.loads(feet, force, moment, -self.mu * loads[:, None] * directions)

        start = self.loads(feet, force, moment, np.zeros((len(feet), 2)))
        loads = solved(lack, start)
        friction = -self.mu * loads[:, None] * directions
        turning = moment[2] + (feet[:, 0] * friction[:, 1] - feet[:, 1] * friction[:, 0]).sum()
        return np.array([*(force[:2] + friction.sum(axis=0)) / self.mass, turning / self.inertia]), loads

    def sharings(self, t, angle, spin, directions, mu):
        """Return all loads of bilateral feet for slip directions; friction acts under tension, too.

        A foot with a nan direction sticks.  A sticking foot at its limit begins to slip against its friction.
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
        """Return loads and friction for some slipping feet and the others sticking."""
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
        """Return the smallest relative excess over the limits with which all feet rest, and the forces.

        The excess is negative if forces within the limits hold the plate. Kept feet have minimum-norm loads;
        feet that cannot pull have any loads that hold.
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
        if found.x[-1] > 1.0:  # the search diverged or its start was infeasible: repeats with more slack
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
        """Return the time after which no forces within the limits hold the plate."""
        return brentq(lambda t: min(self.excess(t)[0], 1.0), 0.0, latest, xtol=1e-12)

    def onset(self, start):
        """Return the slip directions of the feet at slip onset; nan for a foot that sticks."""
        friction = self.excess(start)[1]
        size = np.linalg.norm(friction, axis=1)
        at_limit = size > (1.0 - AT_LIMIT) * self.mu * np.abs(self.loads(*self.given(start, 0.0), friction))
        return np.where(at_limit[:, None], -friction / size[:, None], np.nan)

    def run(self, start, duration, **settings):
        """Return the state (x, y, angle and their rates) `duration` after slip onset."""
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
    """Body on a ball joint at the origin with the friction limit mu radius times the joint force.

    Attributes:
        mass: mass [kg].
        center: center of mass, in the body [m].
        inertia: inertia about the joint, (3, 3) [kg m^2]; the constructor takes it about the center of mass.
        lever: mu radius [m].
        wrench: function of time: force at `end` and couple in world axes [N, N m].
        end: point of application of the force, in the body [m].
    """

    def __init__(self, mass, center, inertia, lever, wrench, end):
        self.mass, self.lever, self.wrench = mass, lever, wrench
        self.center, self.end = np.asarray(center, dtype=float), np.asarray(end, dtype=float)
        self.inertia = inertia + mass * (
            self.center @ self.center * np.eye(3) - np.outer(self.center, self.center)
        )

    def acceleration(self, t, turn, omega, friction):
        """Return the angular acceleration (body axes) under friction, and the norm of the joint force."""
        force, couple = np.reshape(self.wrench(t), (2, 3))
        force, couple = turn.inv().apply(force), turn.inv().apply(couple)
        weight = turn.inv().apply([0.0, 0.0, -self.mass * GRAVITY])
        moment = couple + np.cross(self.end, force) + np.cross(self.center, weight) + friction
        alpha = np.linalg.solve(self.inertia, moment - np.cross(omega, self.inertia @ omega))
        place = np.cross(alpha, self.center) + np.cross(omega, np.cross(omega, self.center))
        return alpha, np.linalg.norm(self.mass * place - weight - force)

    def slipping(self, t, turn, omega, direction):
        """Return the acceleration for slip in a direction, with the limit by fixed-point iteration."""
        limit = 0.0
        for _ in range(100):
            alpha, load = self.acceleration(t, turn, omega, -limit * direction)
            if abs(self.lever * load - limit) <= 1e-15 * limit:
                break
            limit = self.lever * load
        return alpha

    def holding(self, t, turn):
        """Return the friction moment that holds the body at rest, and its limit."""
        none, _ = self.acceleration(t, turn, np.zeros(3), np.zeros(3))
        moment = -self.inertia @ none
        return moment, self.lever * self.acceleration(t, turn, np.zeros(3), moment)[1]

    def give_way(self, turn, first, last):
        def margin(t):
            moment, limit = self.holding(t, turn)
            return limit - np.linalg.norm(moment)

        return brentq(margin, first, last, xtol=1e-14)

    def run(self, turn, start, duration, **settings):
        """Return quaternion and angular velocity (body axes) `duration` after slip onset."""

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
