"""Impacts of planar contacts with friction by enumeration of all modes: Newton's and Poisson's laws."""

from __future__ import annotations

import itertools

import numpy as np

# Velocities and impulses below this size, relative to the largest, may have either sign.
EDGE = 1e-9


def percussions(W, u, mu, given):
    """Return all impulses P (normal, tangential of each contact) in addition to `given` normal impulses.

    P solves 0 <= P_n complementary to u_n+ >= 0, with |P_t| <= mu (given + P_n) against the slip.
    """
    count = len(mu)
    normals, tangents = np.arange(0, 2 * count, 2), np.arange(1, 2 * count, 2)
    start = u + W[:, normals] @ given
    found = []
    for modes in itertools.product(itertools.product((False, True), (0, -1, 1)), repeat=count):
        # Unknowns P, two equations for each contact.
        A, b = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
        for k, (closed, slip) in enumerate(modes):
            n, t = normals[k], tangents[k]
            if closed:
                A[n], b[n] = W[n], -start[n]
            else:
                A[n, n] = 1.0
            if slip:
                A[t, t], A[t, n], b[t] = 1.0, mu[k] * slip, -mu[k] * slip * given[k]
            else:
                A[t], b[t] = W[t], -start[t]
        if abs(np.linalg.det(A)) < 1e-12:
            continue
        P = np.linalg.solve(A, b)
        after = start + W @ P
        edge_u, edge_P = EDGE * np.abs(u).max(), EDGE * max(np.abs(P).max(), given.max(), 1e-300)
        limit = mu * (given + P[normals])
        slips = np.array([slip for _, slip in modes])
        fits = (P[normals] >= -edge_P).all() and (after[normals] >= -edge_u).all()
        fits &= (np.abs(P[tangents]) <= limit + edge_P).all() and (slips * after[tangents] >= -edge_u).all()
        if fits:
            found.append(P)
    return found


def velocities_after(W, u, mu, e, law):
    """Return all contact velocities after the impact that the law admits, (n, 2 contacts)."""
    count = len(mu)
    none, normals = np.zeros(count), np.arange(0, 2 * count, 2)
    if law == "newton":
        raised = u.copy()
        raised[normals] += e * np.minimum(0.0, u[normals])
        return [u + W @ P for P in percussions(W, raised, mu, none)]
    out = []
    for P in percussions(W, u, mu, none):
        given = e * np.maximum(0.0, P[normals])
        for more in percussions(W, u + W @ P, mu, given):
            out.append(u + W @ (P + more) + W[:, normals] @ given)
    return out
