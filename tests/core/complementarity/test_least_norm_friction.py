"""Least-norm friction forces within their limits beside SciPy's SLSQP and a rule for two elements."""

import numpy as np
import pytest
from scipy.optimize import minimize

from pin_nonideal._core import least_norm_friction


def random_response(rng: np.random.Generator, rows: int, rank: int) -> np.ndarray:
    directions = rng.normal(size=(rows, rank))
    return directions @ directions.T


@pytest.mark.parametrize("seed", range(20))
def test_forces_have_least_norm_within_their_limits_and_keep_the_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    dims = list(rng.integers(1, 4, size=rng.integers(2, 6)))
    elements = [slice(end - n, end) for n, end in zip(dims, np.cumsum(dims), strict=True)]
    rows = sum(dims)
    W = random_response(rng, rows, max(1, rows - int(rng.integers(1, 4))))
    force = rng.normal(size=rows)
    middles = np.concatenate([rng.normal(size=1) * 0.2 if n == 1 else np.zeros(n) for n in dims])

    def distances(force: np.ndarray) -> np.ndarray:
        return np.array([np.linalg.norm((force - middles)[element]) for element in elements])

    sizes = distances(force) * rng.uniform(1.0, 1.5, len(dims))
    found, shared = least_norm_friction(W, dims, sizes, middles, force)
    assert found
    assert W @ shared == pytest.approx(W @ force, rel=1e-9, abs=1e-9 * np.abs(W @ force).max())
    assert np.all(distances(shared) <= sizes * (1 + 1e-12))

    unit = np.concatenate(
        [np.full(n, np.diag(W)[e].mean() ** -0.5) for n, e in zip(dims, elements, strict=True)]
    )
    values, vectors = np.linalg.eigh(W)
    free = vectors[:, values < 1e-9 * values[-1]]
    oracle = minimize(
        lambda z: np.sum(((force + free @ z) / unit) ** 2),
        np.zeros(free.shape[1]),
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
        constraints={"type": "ineq", "fun": lambda z: sizes**2 - distances(force + free @ z) ** 2},
    )
    assert np.sum((shared / unit) ** 2) <= oracle.fun * (1 + 1e-6)


def test_a_weak_element_takes_its_limit_and_a_strong_one_the_remainder() -> None:
    W = np.array([[1.0, -1.0], [-1.0, 1.0]])
    for force in ([0.3, -0.7], [0.2, -0.8], [0.1, -0.9]):
        found, shared = least_norm_friction(W, [1, 1], np.array([0.3, 2.0]), np.zeros(2), np.array(force))
        assert found
        assert shared == pytest.approx([0.3, -0.7], rel=1e-12)
