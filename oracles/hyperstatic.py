"""Loads of redundant rows by dense methods: minimum norm, and feasibility of compressive loads."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

import pin_nonideal as pn

from .applied_forces import given_force, mass_matrix
from .rows import rows
from .solutions import kkt_acceleration

HELD = 1e-9  # rank tolerance of A, relative to the largest singular value


def minimum_norm(A, force):
    """Return lam of minimum norm with A^T lam = force, for all rows including duplicates."""
    return np.linalg.lstsq(A.T, force, rcond=HELD)[0]


def pressing_rows(scene):
    """Return the indices in `lam` of the normal forces of contacts and of rolling."""
    slices = list(scene.constraint_slices.values())
    said = [*scene.constraints, *scene.contacts]
    found = []
    for c, rows_of in zip(said, slices, strict=True):
        if isinstance(c, pn.PointContact):
            found.append(rows_of.start)
        elif isinstance(c, pn.Rolling):
            found.append(rows_of.start + 2)
    return found


def constraint_force(scene, q, v, t):
    """Return A, and the constraint force M a - F of the motion without laws, by a dense system."""
    A, b = rows(scene, q, v, t)
    M, F = mass_matrix(scene.model, q), given_force(scene, q, v, t)
    return A, M @ kkt_acceleration(M, F, A, b) - F


def largest_least_load(A, force, pressing):
    """Return the largest s such that all `pressing` rows can carry at least s, by a linear program."""
    lam = minimum_norm(A, force)
    _, s, Vt = np.linalg.svd(A.T)
    Z = Vt[np.count_nonzero(s > HELD * s[0]) :].T
    size = np.abs(lam).max()
    n = Z.shape[1]
    inequality = np.hstack([-Z[pressing], np.ones((len(pressing), 1))])
    found = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=inequality,
        b_ub=lam[pressing] / size,
        bounds=[(None, None)] * n + [(None, 10.0)],
    )
    return -found.fun * size
