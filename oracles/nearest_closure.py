"""Nearest consistent configuration, by SciPy's general optimizers from many starts.

The problem is min d^T M(q) d subject to residual(q + d) = 0, in coordinates in which the metric is the
identity.  SLSQP computes the derivatives of the residual by finite differences.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares, minimize

from .applied_forces import mass_matrix

CLOSED = 1e-8  # residual of a closed configuration, relative to `size`


def distance(model, q, other):
    """Return the distance from q to another configuration, in the metric of M(q)."""
    d = pin.difference(model, q, other)
    return float(np.sqrt(d @ mass_matrix(model, q) @ d))


def nearest_by_search(model, q, residual, size=1.0, starts=8, spread=0.5, unit=1.0, seed=0):
    """Return the smallest distance to the constraints over all starts, and the configuration.

    Args:
        model: pinocchio.Model.
        q: initial configuration, (nq,).
        residual: q -> phi, (m,).
        size: scale of the residual.
        starts: number of starts: q and random perturbations of q.
        spread: standard deviation of the perturbations [units].
        unit: scale of each coordinate, a number or (nv,).
        seed: seed of the perturbations.
    """
    rng = np.random.default_rng(seed)
    scale = np.linalg.inv(np.linalg.cholesky(mass_matrix(model, q)).T)  # d = scale x
    longest = np.linalg.norm(np.linalg.solve(scale, unit * np.ones(model.nv)))
    scale = scale * longest

    def phi(x):
        return residual(pin.integrate(model, q, scale @ x)) / size

    best, where = np.inf, None
    for k in range(starts):
        d = spread * unit * rng.standard_normal(model.nv) if k else np.zeros(model.nv)
        x = least_squares(phi, np.linalg.solve(scale, d), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        constraint = {"type": "eq", "fun": phi}
        found = minimize(
            lambda x: 0.5 * x @ x,
            x,
            jac=lambda x: x,
            constraints=constraint,
            method="SLSQP",
            options={"ftol": 1e-15, "maxiter": 300},
        ).x
        if np.abs(phi(found)).max() < CLOSED and np.linalg.norm(found) < best:
            best, where = float(np.linalg.norm(found)), pin.integrate(model, q, scale @ found)
    return best * longest, where


def nearest_outside(model, q, residual, gaps, size):
    """Return the smallest distance from q to a configuration without residual or penetration, from one start.

    Args:
        model: pinocchio.Model.
        q: initial configuration, (nq,).
        residual: q -> phi, (m,), m may be zero.
        gaps: q -> gap, (k,).
        size: scale of the gaps: the penetration at q.

    Returns:
        The distance, and the largest violation of the conditions there, relative to `size`.
    """
    scale = size * np.linalg.inv(np.linalg.cholesky(mass_matrix(model, q)).T)  # d = scale x

    def at(x):
        return pin.integrate(model, q, scale @ x)

    constraints = [{"type": "ineq", "fun": lambda x: gaps(at(x)) / size}]
    if len(residual(q)):
        constraints.append({"type": "eq", "fun": lambda x: residual(at(x)) / size})
    found = minimize(
        lambda x: 0.5 * x @ x,
        np.zeros(model.nv),
        jac=lambda x: x,
        constraints=constraints,
        method="SLSQP",
        options={"ftol": 1e-16, "maxiter": 500},
    ).x
    missed = max(-gaps(at(found)).min(), np.abs(residual(at(found))).max(initial=0.0)) / size
    return size * float(np.linalg.norm(found)), missed
