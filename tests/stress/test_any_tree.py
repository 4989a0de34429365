"""Random trees of all joints of Pinocchio: both providers give Pinocchio's accelerations.

Composites are nested, hold free flyers, and have more than six freedoms; bodies may be massless.  The seed of
each is its number; `check(1234)` looks at one again.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.applied_forces import given_force, mass_matrix
from oracles.rows import rows
from oracles.solutions import kkt_acceleration
from pin_nonideal.errors import SingularMassError

from ..support.random_trees import any_joint, state, tree
from .test_random_mechanisms import closures

FEW, MANY, BLOCK = 60, 10_000, 100
# Sums of a few dozen products in another order.
ROUNDING = 1e-12
# Relative error of accelerations for a condition of M below KNOWN, which magnifies rounding.
SOLVED = 1e-9
KNOWN = 1e5
# Rows whose singular values all lie outside this band are dependent or not, and no tolerance decides.
DEPENDENT, INDEPENDENT = 1e-11, 1e-3
# A singular M that is definite by rounding: no result can be checked.
SINGULAR = 1e13


def mechanism(seed):
    """Model, state and closures."""
    rng = np.random.default_rng(seed)
    armature = rng.uniform() < 0.7
    model = tree([any_joint(rng) for _ in range(int(rng.integers(1, 6)))], rng, armature=armature)
    for i in range(1, model.njoints):
        if rng.uniform() < 0.1:
            model.inertias[i] = pin.Inertia.Zero()
    q, v = state(model, rng, speed=float(rng.choice([0.0, 1.0, 5.0])))
    return model, q, v, closures(model, q, rng, most=3), rng.standard_normal(model.nv)


def check(seed):
    """Compare both providers with pin.aba or a dense system of constraints; return the number of cases."""
    model, q, v, constraints, tau = mechanism(seed)
    M = mass_matrix(model, q)
    condition = (
        np.linalg.cond(M / np.sqrt(np.outer(np.diag(M), np.diag(M)))) if (np.diag(M) > 0).all() else np.inf
    )
    bias = pin.nonLinearEffects(model, model.createData(), q, v)
    still = pin.nonLinearEffects(model, model.createData(), q, np.zeros(model.nv))
    compared = 0
    for terms in ("core", "pinocchio"):
        free = pn.Scene(model, q0=q, terms=terms)
        found = free._compiled.program.runner().terms(q, v)
        np.testing.assert_allclose(found[0].reshape(M.shape), M, rtol=0, atol=ROUNDING * np.abs(M).max())
        size = np.abs(bias).max() + np.abs(still).max()
        np.testing.assert_allclose(found[1], bias, rtol=0, atol=ROUNDING * size)
        if condition > SINGULAR:
            continue
        try:
            a = free.acceleration(q, v, tau)
        except SingularMassError:
            assert condition > KNOWN
            continue
        in_play = np.abs(M) @ np.abs(a) + np.abs(bias) + np.abs(tau)
        assert (np.abs(M @ a + bias - tau) <= SOLVED * in_play.max()).all()
        if condition > KNOWN:
            continue
        expected = pin.aba(model, model.createData(), q, v, tau)
        np.testing.assert_allclose(a, expected, rtol=0, atol=SOLVED * np.abs(expected).max())
        compared += 1
        if constraints:
            compared += check_constrained(model, q, v, constraints, tau, M, terms)
    return compared


def check_constrained(model, q, v, constraints, tau, M, terms):
    """The constrained acceleration by a dense KKT matrix; whether the rank was beyond doubt."""
    scene = pn.Scene(model, constraints=constraints, q0=q, actuation=tau, terms=terms)
    q, v = scene.project(q, v)
    A, b = rows(scene, q, v, 0.0)
    B = np.linalg.solve(np.linalg.cholesky(M), A.T)
    length = np.linalg.norm(B, axis=0)
    long = length > DEPENDENT * length.max()
    s = np.linalg.svd(B[:, long] / length[long], compute_uv=False)
    if ((s > DEPENDENT) & (s < INDEPENDENT)).any():
        return 0
    a, F = scene.acceleration(q, v), given_force(scene, q, v, 0.0)
    expected = kkt_acceleration(M, F, A, b)
    in_play = np.abs(expected).max() + np.abs(np.linalg.solve(M, F)).max() + np.abs(b).max()
    np.testing.assert_allclose(a, expected, rtol=0, atol=SOLVED * in_play)
    return 1


@pytest.mark.parametrize("seed", range(FEW))
def test_tree(seed):
    check(seed)


@pytest.mark.stress
@pytest.mark.parametrize("block", range(MANY // BLOCK))
def test_trees(block):
    failed, compared = [], 0
    for seed in range(block * BLOCK, (block + 1) * BLOCK):
        try:
            compared += check(seed)
        except Exception as error:  # all seeds of the block are looked at
            failed.append((seed, repr(error)))
    assert not failed
    assert compared > BLOCK
