"""Enumeration of stick-slip modes: each element sticks (0), slips forward (1) or slips backward (-1)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

# Violation of a condition that counts as rounding, relative to the limits or to the accelerations.
SLACK = 1e-9
# Condition number of W beyond which the forces of sticking elements are not unique.
SHARED = 1e10


def combinations(velocities: Iterable[float], at_rest: float = 0.0) -> Iterator[tuple[int, ...]]:
    """Return all combinations of modes: the sign of a nonzero slip velocity, all three modes at rest.

    Args:
        velocities: slip velocity of each element.
        at_rest: largest speed that counts as rest.
    """
    return itertools.product(*((0, 1, -1) if abs(u) <= at_rest else (int(np.sign(u)),) for u in velocities))


def enumerate_modes(W, alpha0, limits):
    """Return (modes, f, alpha) of each combination that meets all conditions."""
    n = len(limits)
    size = np.abs(alpha0).max() + (np.abs(W) @ limits).max()
    found = []
    for sticks in itertools.product((True, False), repeat=n):
        S = np.flatnonzero(sticks)
        B = np.flatnonzero(np.logical_not(sticks))
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=len(B)))).reshape(2 ** len(B), len(B)).T
        f = np.zeros((n, signs.shape[1]))
        f[B] = -signs * limits[B, None]
        if len(S):
            WS = W[np.ix_(S, S)]
            if np.linalg.cond(WS) > SHARED:
                continue  # another combination with fewer sticking elements has the same motion
            f[S] = -np.linalg.solve(WS, alpha0[S, None] + W[np.ix_(S, B)] @ f[B])
        alpha = alpha0[:, None] + W @ f
        keeps = (np.abs(f) <= limits[:, None] * (1.0 + SLACK)).all(axis=0)
        keeps &= (signs * alpha[B] >= -SLACK * size).all(axis=0)
        for k in np.flatnonzero(keeps):
            modes = np.zeros(n)
            modes[B] = signs[:, k]
            found.append((modes, f[:, k], alpha[:, k]))
    return found
