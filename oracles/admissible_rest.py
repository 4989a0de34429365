"""Forces within Coulomb's cones that hold rigid bodies at rest: linear programs on inner and outer pyramids.

Shares nothing with the core: wrenches of contact forces are balanced body by body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

SIDES = 48  # of a pyramid; inner and outer ones differ by 0.2 %


@dataclass(frozen=True)
class Touch:
    """A point where body `first` rests on body `second` (-1: the world), normal towards `first`."""

    first: int
    second: int
    point: np.ndarray
    normal: np.ndarray
    mu: float


def directions(normal):
    """Two unit vectors across a normal."""
    other = np.eye(3)[np.argmin(np.abs(normal))]
    one = np.cross(normal, other)
    one /= np.linalg.norm(one)
    return one, np.cross(normal, one)


def wrenches(touches, centers, forces):
    """Columns: force and moment on all bodies by each unit force (touch, vector)."""
    columns = np.zeros((6 * len(centers), len(forces)))
    for k, (touch, force) in enumerate(forces):
        for body, sign in ((touch.first, 1.0), (touch.second, -1.0)):
            if body < 0:
                continue
            columns[6 * body : 6 * body + 3, k] += sign * force
            columns[6 * body + 3 : 6 * body + 6, k] += sign * np.cross(touch.point - centers[body], force)
    return columns


def residual_share(touches, centers, loads, outer):
    """Least part of the loads that no forces in the pyramids balance: 0 if bodies can rest, else positive.

    Args:
        touches: of all bodies.
        centers: of mass, by body.
        loads: force and moment about the center on each body, (6 n,).
        outer: pyramids around the cones, else within.
    """
    edges = []
    stretch = 1.0 / np.cos(np.pi / SIDES) if outer else 1.0
    for touch in touches:
        one, two = directions(touch.normal)
        for k in range(SIDES if touch.mu > 0.0 else 1):
            angle = 2.0 * np.pi * k / SIDES
            edge = touch.normal + touch.mu * stretch * (np.cos(angle) * one + np.sin(angle) * two)
            edges.append((touch, edge))
    W = wrenches(touches, centers, edges)
    size = np.abs(loads).max()
    m, n = W.shape
    # minimize s subject to |W f + loads| <= s size
    cost = np.append(np.zeros(n), 1.0)
    A = np.vstack([np.hstack([W, -size * np.ones((m, 1))]), np.hstack([-W, -size * np.ones((m, 1))])])
    b = np.concatenate([-loads, loads])
    found = linprog(cost, A_ub=A, b_ub=b, bounds=[(0.0, None)] * (n + 1), method="highs")
    return found.fun


def may_rest(touches, centers, loads, margin=1e-7):
    """True if rest is admissible, False if it is not, None within the gap between the pyramids."""
    if residual_share(touches, centers, loads, outer=False) <= margin:
        return True
    if residual_share(touches, centers, loads, outer=True) > margin:
        return False
    return None
