"""Overconstrained loops of hinges with one degree of freedom.

Random linkages of Goldberg, Myard, Sarrus and Bricard, and planar four-bars.  Hinge k is a line through a
point along a unit vector at zero angles. Hinge k joins body k - 1 to body k. Body 0 is the ground, and the
last hinge joins the last body to the ground. The columns of J are the hinges' screws in world axes, and t is
the unit vector with J t = 0:

    v = t s,   t' = -J^+ (J' t),   J'_k = [sum_{i<k} J_i t_i, J_k],
    m s' = f - n s^2,   m = sum of (mass c'.c' + w.I w),   n = sum of (mass c'.c'' + w.I w')

The sums run over all bodies.  c is the center of mass, w the angular velocity, I the inertia about c, f the
generalized force on s, and a prime the derivative along t.  [Lynch and Park, Modern Robotics, 2017, 5 and 8.]
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

# Singular values of J relative to the largest: maximum for the degree of freedom, minimum for the others.
ZERO, APART = 1e-9, 0.02
# Rate of stabilization of the closure gap [1/s], and settings of the integrator.
CLOSING = 20.0
TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-11}


def _turn(axis, angle):
    """Return the rotation matrix of an angle about a unit vector."""
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def _unit(x):
    return x / np.linalg.norm(x)


class HingeLoop:
    """Loop of hinges and bodies.

    Attributes:
        points: points of the hinges at zero angles, (n, 3) [m].
        axes: unit vectors of the hinges at zero angles, (n, 3).
        masses: masses of bodies 1 to n - 1 [kg].
        centers: centers of mass at zero angles, (n - 1, 3) [m].
        inertias: inertias about the centers of mass, (n - 1, 3, 3) [kg m^2].
        gravity: gravity, (3,) [m/s^2].
    """

    def __init__(self, points, axes, rng, end=None):
        """Sample the bodies; the loop closes at the placement `end`, by default the identity."""
        self.end = (np.eye(3), np.zeros(3)) if end is None else end
        self.points, self.axes = np.array(points), np.array([_unit(a) for a in axes])
        self.count = len(self.points)
        self.length = np.abs(self.points - self.points.mean(0)).max()
        moving = self.count - 1
        self.masses = rng.uniform(0.5, 2.0, moving)
        middle = 0.5 * (self.points[:-1] + self.points[1:])
        self.centers = middle + 0.2 * self.length * rng.standard_normal((moving, 3))
        spread = rng.standard_normal((moving, 3, 3))
        self.inertias = 0.02 * self.length**2 * (spread @ spread.transpose(0, 2, 1) + 3.0 * np.eye(3))
        self.gravity = 5.0 * rng.standard_normal(3)

    def scaled(self, length):
        """Return the same loop in another unit of length; its angles have the same motion."""
        other = object.__new__(HingeLoop)
        other.__dict__.update(self.__dict__)
        for name in ("points", "centers", "gravity", "length"):
            setattr(other, name, length * getattr(self, name))
        other.inertias = length**2 * self.inertias
        return other

    def model(self):
        """Return a model with joints "hinge 1" to "hinge n - 1".

        The frames "tip" and "ground" are at the last hinge.
        """
        model, parent, last = pin.Model(), 0, np.zeros(3)
        model.gravity.linear = self.gravity
        for k in range(self.count - 1):
            joint = pin.JointModelRevoluteUnaligned(self.axes[k])
            place = pin.SE3(np.eye(3), self.points[k] - last)
            parent, last = model.addJoint(parent, joint, place, f"hinge {k + 1}"), self.points[k]
            body = pin.Inertia(self.masses[k], self.centers[k] - last, self.inertias[k])
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        for name, joint, at in (("tip", parent, self.points[-1] - last), ("ground", 0, self.points[-1])):
            model.addFrame(pin.Frame(name, joint, 0, pin.SE3(np.eye(3), at), pin.FrameType.OP_FRAME), False)
        return model

    def poses(self, q):
        """Return rotation and translation of every body after its hinge, (n, 3, 3) and (n, 3)."""
        rotations, places = [], []
        R, x = np.eye(3), np.zeros(3)
        for point, axis, angle in zip(self.points, self.axes, q, strict=True):
            turn = _turn(axis, angle)
            x = x + R @ (point - turn @ point)
            R = R @ turn
            rotations.append(R)
            places.append(x)
        return np.array(rotations), np.array(places)

    def lines(self, q):
        """Return points and axes of the hinges at q, in world axes."""
        rotations, places = self.poses(q)
        before = np.concatenate([np.eye(3)[None], rotations[:-1]])
        moved = np.concatenate([np.zeros((1, 3)), places[:-1]])
        points = np.einsum("kij,kj->ki", before, self.points) + moved
        return points, np.einsum("kij,kj->ki", before, self.axes)

    def screws(self, q):
        """Return the twists of the hinges at the world origin (angular, linear), in world axes, (6, n)."""
        points, axes = self.lines(q)
        return np.concatenate([axes, np.cross(points, axes)], axis=1).T

    def gap(self, q):
        """Return the closure gap (6,): rotation vector, and translation over the length."""
        R, x = (poses[-1] for poses in self.poses(q))
        return np.concatenate([pin.log3(R @ self.end[0]), (R @ self.end[1] + x) / self.length])

    def _scale(self, columns):
        return columns / np.array([1.0, 1.0, 1.0, *[self.length] * 3])[:, None]

    def margin(self, q):
        """Return the second smallest singular value of the screws over the largest; 0 at a second freedom."""
        sizes = np.linalg.svd(self._scale(self.screws(q)), compute_uv=False)
        return sizes[self.count - 2] / sizes[0]

    def close(self, q, steps=100):
        """Return angles near q that close the loop after at most `steps` Newton steps, or None."""
        for _ in range(steps):
            gap = self.gap(q)
            if np.abs(gap).max() < 1e-14:
                break
            step = -np.linalg.lstsq(self._scale(self.screws(q)), gap, rcond=1e-6)[0]
            q = q + step * min(1.0, 0.5 / np.abs(step).max())
        return q if np.abs(self.gap(q)).max() < 1e-12 else None

    def along(self, q):
        """Return t, t', c', c'', w, w' and rotation of each moving body, and the step that closes the gap."""
        n, (R, x), points, axes = self.count, self.poses(q), *self.lines(q)
        J = np.concatenate([axes, np.cross(points, axes)], axis=1).T
        U, sizes, Vt = np.linalg.svd(self._scale(J))
        t = Vt[-1]

        def solved(rows):
            return Vt[: n - 1].T @ ((U.T @ rows)[: n - 1] / sizes[: n - 1])

        twists = np.cumsum(J * t, axis=1)
        before = np.concatenate([np.zeros((6, 1)), twists[:, :-1]], axis=1)
        change = np.concatenate(
            [
                np.cross(before[:3], J[:3], axis=0),
                np.cross(before[:3], J[3:], axis=0) + np.cross(before[3:], J[:3], axis=0),
            ]
        )
        dt = -solved(self._scale(change) @ t)
        twists, changes = twists[:, : n - 1].T, np.cumsum(change * t + J * dt, axis=1)[:, : n - 1].T
        centers = np.einsum("kij,kj->ki", R[:-1], self.centers) + x[:-1]
        w, dw = twists[:, :3], changes[:, :3]
        dc = twists[:, 3:] + np.cross(w, centers)
        ddc = changes[:, 3:] + np.cross(dw, centers) + np.cross(w, dc)
        return t, dt, dc, ddc, w, dw, R[:-1], -solved(self.gap(q))

    def acceleration(self, q, v, damping=0.0):
        """Return accelerations of the hinges, (n,); damping acts on all hinges but the last [N m s]."""
        return self._rates(q, v, damping)[1]

    def _rates(self, q, v, damping):
        """Return the component of v along t, the acceleration, and the step that closes the gap."""
        t, dt, dc, ddc, w, dw, R, closing = self.along(q)
        speed = t @ v
        momentum = np.einsum("kij,kj->ki", R @ self.inertias @ R.transpose(0, 2, 1), w)
        m = self.masses @ np.sum(dc * dc, 1) + np.sum(momentum * w)
        n = self.masses @ np.sum(dc * ddc, 1) + np.sum(momentum * dw)
        f = self.masses @ (dc @ self.gravity) - damping * speed * (t[:-1] @ t[:-1])
        return t * speed, t * (f - n * speed**2) / m + dt * speed**2, closing

    def velocity(self, q, speed):
        """Return velocities of the hinges, (n,), scaled to the maximum `speed`."""
        t = self.along(q)[0]
        return t * speed / np.abs(t).max()

    def motion(self, q, v, times, damping=0.0):
        """Return q and v at each time under gravity and damping, (len(times), n) each; starts at time 0."""
        n = self.count

        def rate(_, y):
            along, acceleration, closing = self._rates(y[:n], y[n:], damping)
            return np.concatenate([along + CLOSING * closing, acceleration])

        found = solve_ivp(rate, (0.0, times[-1]), np.concatenate([q, v]), t_eval=times, **TIGHT).y.T
        return found[:, :n], found[:, n:]

    def driven(self, q, drive, times):
        """Return q and v at each time for a first hinge that is driven by drive(t) -> (angle, rate).

        Returns None if the integration fails, for example where t[0], the rate of the first hinge, is zero.
        """

        def rate(time, y):
            t, *_, closing = self.along(y)
            return t * drive(time)[1] / t[0] + CLOSING * closing

        solved = solve_ivp(rate, (0.0, times[-1]), q, t_eval=times, **TIGHT)
        if not solved.success:
            return None
        found = solved.y.T
        turned = [self.along(y)[0] for y in found]
        return found, np.array([t * drive(time)[1] / t[0] for t, time in zip(turned, times, strict=True)])


def _of_lengths(lengths, twists, rng):
    """Return points and axes of a loop of links with these lengths and twists, at a random pose, or None.

    [Denavit and Hartenberg, A kinematic notation for lower-pair mechanisms, 1955.]
    """
    R, x, points, axes = np.eye(3), np.zeros(3), [], []
    for length, twist in zip(lengths, twists, strict=True):
        points.append(x)
        axes.append(R[:, 2])
        x = x + R[:, 0] * length
        R = R @ _turn(np.array([1.0, 0.0, 0.0]), twist)
    loop = HingeLoop(points, axes, rng, (R, x))
    q = loop.close(rng.uniform(-np.pi, np.pi, len(lengths)))
    return None if q is None else loop.lines(q)


def goldberg(rng):
    """Goldberg linkage: two Bennett linkages without their common link.

    [Goldberg, New five-bar linkages, 1943.]
    """
    twists = rng.uniform(0.3, 2.6, 3)
    a, b, c = rng.uniform(0.3, 0.8) * np.sin(twists)
    alpha, beta, gamma = twists
    return _of_lengths([b, a, b + c, a, c], [beta, alpha, beta + gamma, alpha, gamma], rng)


def myard(rng):
    """Myard linkage: two mirrored Bennett linkages.

    [Myard, Contribution à la géométrie des systèmes articulés, 1931.]
    """
    twist, b = rng.uniform(0.5, 1.3), rng.uniform(0.3, 0.8)
    a, right = b * np.sin(twist), 0.5 * np.pi
    return _of_lengths([a, b, 0.0, b, a], [twist, right, np.pi - 2.0 * twist, right, np.pi - twist], rng)


def sarrus(rng):
    """Sarrus linkage: two groups of three parallel hinges, which guide a plate along a straight line."""
    first, second = _unit(rng.standard_normal(3)), _unit(rng.standard_normal(3))
    return rng.uniform(-0.5, 0.5, (6, 3)), [first] * 3 + [second] * 3


def line_symmetric(rng):
    """Line-symmetric linkage: three hinges and their images under half a turn.

    [Bricard, Leçons de cinématique, 1927.]
    """
    points, axes = rng.uniform(-0.5, 0.5, (3, 3)), rng.standard_normal((3, 3))
    half = np.diag([-1.0, -1.0, 1.0])
    return np.concatenate([points, points @ half]), np.concatenate([axes, axes @ half])


def plane_symmetric(rng):
    """Plane-symmetric linkage: two hinges in a plane, and two pairs mirrored in it. [Bricard, 1927.]"""
    points, axes = rng.uniform(-0.5, 0.5, (4, 3)), rng.standard_normal((4, 3))
    mirror = np.diag([1.0, 1.0, -1.0])
    for k in (0, 3):
        points[k, 2] = axes[k, 2] = 0.0
    return np.concatenate([points, points[2:0:-1] @ mirror]), np.concatenate([axes, axes[2:0:-1] @ mirror])


def trihedral(rng):
    """Trihedral linkage: twists alternate between +-90 degrees. [Bricard, 1927.]

    The squared lengths of links 1, 3, 5 and of links 2, 4, 6 have equal sums.
    """
    while True:
        lengths = rng.uniform(0.2, 0.8, 6)
        last = lengths[0] ** 2 + lengths[2] ** 2 + lengths[4] ** 2 - lengths[1] ** 2 - lengths[3] ** 2
        if last > 0.01:
            break
    lengths[5] = np.sqrt(last)
    return _of_lengths(lengths, [0.5 * np.pi, -0.5 * np.pi] * 3, rng)


def planar(rng):
    """Planar four-bar."""
    points, axis = rng.uniform(-0.5, 0.5, (4, 2)), _unit(rng.standard_normal(3))
    plane = np.linalg.svd(axis[None])[2][1:]
    return points @ plane, [axis] * 4


FAMILIES = (goldberg, myard, sarrus, line_symmetric, plane_symmetric, trihedral, planar)


def drawn(family, seed):
    """Return a random loop of a family that has one degree of freedom at its assembly."""
    rng = np.random.default_rng([FAMILIES.index(family), seed])
    while True:
        lines = family(rng)
        if lines is None:
            continue
        loop = HingeLoop(*lines, rng)
        sizes = np.linalg.svd(loop._scale(loop.screws(np.zeros(loop.count))), compute_uv=False)
        if loop.count > len(sizes):
            sizes = np.append(sizes, 0.0)
        if sizes[loop.count - 1] < 1e-9 * sizes[0] and sizes[loop.count - 2] > 5 * APART * sizes[0]:
            return loop
