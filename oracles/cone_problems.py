"""Random contact problems with Coulomb friction, and enumeration of all modes of planar problems.

The module is independent of the package: bodies are masses, inertias and contact points.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

# Violation of a condition that counts as rounding, relative to the terms of the condition.
SLACK = 1e-9
# Condition number beyond which the forces of a combination are not unique.
SHARED = 1e9


@dataclass
class ConeProblem:
    """Contact problem w = W f + w0 with `dim` rows for each contact."""

    W: np.ndarray
    w0: np.ndarray
    mu: np.ndarray
    dim: int


def random_problem(rng, *, planar=False, max_contacts=8, driven=False):
    """Return a problem of one to four bodies that touch each other and the ground at random points.

    Masses are 1 to 1e6.  W = H M^-1 H^T is rank-deficient if it has more rows than degrees of freedom.  A
    solution exists for w0 = H v, unless the surfaces are `driven` against each other.
    """
    dim, dof = (2, 3) if planar else (3, 6)
    bodies, contacts = int(rng.integers(1, 5)), int(rng.integers(1, max_contacts + 1))
    mass = 10.0 ** (rng.uniform(0.0, 6.0, bodies) * rng.integers(0, 2))
    inertia = (
        mass[:, None] * rng.uniform(0.05, 0.5, (bodies, 1)) ** 2 * rng.uniform(0.3, 1.0, (bodies, dof - dim))
    )
    M = np.hstack([np.repeat(mass[:, None], dim, axis=1), inertia]).ravel()
    flat = rng.random() < 0.3
    H = np.zeros((contacts * dim, bodies * dof))
    for c in range(contacts):
        normal = np.array([0.0, 0.0, 1.0]) if flat else rng.standard_normal(3)
        normal[1] *= not planar
        axes = np.linalg.qr(np.column_stack([normal, rng.standard_normal((3, 2))]))[0].T
        if planar:
            normal /= np.linalg.norm(normal)
            axes = np.array([normal, [normal[2], 0.0, -normal[0]]])
        first, second = int(rng.integers(bodies)), int(rng.integers(bodies + 1))
        for body, sign in {first: 1.0, second: -1.0}.items() if first != second else [(first, 1.0)]:
            if body == bodies:
                continue
            point = rng.uniform(-0.3, 0.3, 3)
            turning = np.cross(point * [1.0, not planar, 1.0], axes)
            rows = np.hstack([axes[:, ::2], turning[:, 1:2]]) if planar else np.hstack([axes, turning])
            H[c * dim : (c + 1) * dim, body * dof : (body + 1) * dof] = sign * rows
    v = rng.standard_normal(bodies * dof)
    if rng.random() < 0.5:  # falling under gravity
        v = np.where(np.arange(bodies * dof) % dof == dim - 1, -9.81, v * rng.integers(0, 2))
    w0 = H @ v + driven * rng.standard_normal(contacts * dim)
    mu = np.where(rng.random(contacts) < 0.2, 0.0, rng.uniform(0.0, 2.0, contacts))
    return ConeProblem((H / M) @ H.T, w0, mu, dim)


def planar_solutions(problem, near):
    """Return f of every combination of modes (open, stick, slip) that meets all conditions.

    If f is not unique in a combination, returns the solution with w nearest to that of the forces `near`.
    """
    W, w0, mu = problem.W, problem.w0, problem.mu
    unit = 1.0 / np.sqrt(np.repeat(np.diag(W).reshape(-1, 2).max(axis=1), 2))  # W scaled to about 1
    size = np.abs(unit * w0).max() or 1.0
    W, w0, near = unit[:, None] * W * unit, unit * w0 / size, near / unit / size
    found = []
    for modes in itertools.product(("open", "stick", 1.0, -1.0), repeat=len(mu)):
        equal, positive = [], []  # rows r, r0 of r . f + r0 = 0 and >= 0
        for c, mode in enumerate(modes):
            n, t = 2 * c, 2 * c + 1
            e = np.eye(len(w0))
            if mode == "open":
                equal += [(e[n], 0.0), (e[t], 0.0)]
                positive += [(W[n], w0[n])]
                continue
            equal += [(W[n], w0[n])]
            positive += [(e[n], 0.0)]
            if mode == "stick":
                equal += [(W[t], w0[t])]
                positive += [(mu[c] * e[n] + e[t], 0.0), (mu[c] * e[n] - e[t], 0.0)]
            else:
                equal += [(e[t] + mode * mu[c] * e[n], 0.0)]
                positive += [(mode * W[t], mode * w0[t])]
        f = _forces(equal, positive, W, near)
        if f is not None:
            found.append(size * unit * f)
    return found


def _forces(equal, positive, W, near):
    """Return the solution of the equations and inequalities with W f nearest to W `near`, or None."""
    A, b = np.array([r for r, _ in equal]), -np.array([r0 for _, r0 in equal])
    G, h = np.array([r for r, _ in positive]), np.array([r0 for _, r0 in positive])
    if np.linalg.cond(A) < SHARED:
        f = np.linalg.solve(A, b)
        return f if (G @ f + h >= -SLACK * (1.0 + np.abs(G) @ np.abs(f))).all() else None
    n, one = len(b), np.ones((len(b), 1))  # unknowns: f and the minimized maximum of |W (f - near)|
    conditions = np.vstack(
        [np.hstack([-G, np.zeros((len(h), 1))]), np.hstack([W, -one]), np.hstack([-W, -one])]
    )
    found = linprog(
        np.append(np.zeros(n), 1.0),
        A_ub=conditions,
        b_ub=np.concatenate([h + SLACK, W @ near, -W @ near]),
        A_eq=np.hstack([A, 0.0 * one]),
        b_eq=b,
        bounds=(None, None),
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return found.x[:n] if found.status == 0 else None
