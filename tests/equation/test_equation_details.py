"""solve_details(M, F, A, b, C): the paper's matrices beside the literal formulas."""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn
from oracles.eq40_by_paper import eq40_by_paper, letters
from tests.equation.test_equation import ROADS, SHAPES, assert_close, ill_conditioned, problem

# Backward errors of products of well-conditioned factors: some n^2 roundings of 1e-16.
ROUNDING = 1e-13


@pytest.fixture(params=[(shape, seed) for shape in SHAPES for seed in range(3)], ids=str)
def drawn(request):
    shape, seed = request.param
    return problem(seed, *shape)


def test_matrices_are_those_of_the_literal_formulas(drawn):
    M, F, A, b, C = drawn
    d = pn.solve_details(M, F, A, b, C)
    paper = letters(M, A)
    assert_close(d.a_free, np.linalg.solve(M, F), ROADS)  # Eq. (1)
    assert_close(d.M_root, paper.root, ROADS)  # Eq. (5)
    assert_close(d.B, paper.B, ROADS)  # Eq. (7)
    assert_close(d.J, paper.J, ROADS)  # Eq. (33)
    assert_close(d.B_pinv, d.J @ d.B.T, ROADS)  # Eqs. (41)-(46)
    assert d.V.shape == (len(M), len(M) - d.rank)
    assert_close(d.V @ d.V.T, paper.E, ROADS)  # Eq. (18): the columns may differ, their span does not


def test_forces_and_acceleration_are_those_of_solve(drawn):
    M, F, A, b, C = drawn
    d = pn.solve_details(M, F, A, b, C)
    s = pn.solve(M, F, A, b, C)
    literal = eq40_by_paper(M, F, A, b, C)
    for name in ("a", "F_ideal", "F_nonideal", "lam"):
        np.testing.assert_array_equal(getattr(d, name), getattr(s, name))
    assert d.rank == s.rank
    root_inverse = d.M_root_inverse
    n = len(M)
    scale = np.linalg.norm(M) * np.linalg.norm(literal.a)
    assert_close(d.F_ideal, d.M_root @ d.J @ d.B.T @ (b - A @ d.a_free), ROADS, scale)  # Eq. (39)
    assert_close(d.F_nonideal, d.M_root @ (np.eye(n) - d.J @ d.B.T @ d.B) @ root_inverse @ C, ROADS, scale)


def test_blocks_of_the_inverse_of_the_normal_matrix(drawn):
    """Eqs. (20)-(24): [[P, J], [J, S]] with P = J (I + E), S = J (I + D) inverts that of Eq. (15)."""
    M, F, A, b, C = drawn
    d = pn.solve_details(M, F, A, b, C)
    n = len(M)
    D, E, eye = d.B.T @ d.B, d.V @ d.V.T, np.eye(n)
    stacked = np.block([[eye, -eye], [d.B, np.zeros(d.B.shape)], [np.zeros(d.V.T.shape), d.V.T]])  # Eq. (15)
    P, S = d.J @ (eye + E), d.J @ (eye + D)
    inverse = np.block([[P, d.J], [d.J, S]])
    assert_close(stacked.T @ stacked @ inverse, np.eye(2 * n), ROADS * 1e2)


@pytest.mark.parametrize("kind", ["random", "held"])
@pytest.mark.parametrize("redundant", [False, True])
def test_condition_of_1e12(kind, redundant):
    M, F, A, b, C, mix = ill_conditioned(kind, 1e12, 1, redundant)
    d = pn.solve_details(M, F, np.vstack([A, mix @ A]), np.concatenate([b, mix @ b]), C)
    size = np.linalg.norm(M)
    assert np.linalg.norm(d.M_root @ d.M_root - M) <= ROUNDING * size
    np.testing.assert_array_equal(d.M_root, d.M_root.T)
    X, B = d.B_pinv, d.B
    # The four conditions of Moore and Penrose, Eqs. (41)-(46), on rows that M^(-1/2) stretches by up to 1e6.
    stretch = ROUNDING * np.linalg.cond(d.M_root)
    for left, right in ((B @ X @ B, B), (X @ B @ X, X), (B @ X, (B @ X).T), (X @ B, (X @ B).T)):
        assert np.linalg.norm(left - right) <= stretch * max(np.linalg.norm(right), 1.0)
    assert np.linalg.norm(B @ d.V) <= stretch * np.linalg.norm(B)


def test_without_constraints_the_paper_is_newton():
    d = pn.solve_details(np.diag([2.0, 4.0]), [2.0, 2.0], C=[1.0, 0.0])
    np.testing.assert_allclose(d.a, [1.5, 0.5], rtol=1e-15)
    np.testing.assert_allclose(d.J, np.eye(2), atol=1e-15)
    assert d.rank == 0
    assert d.B.shape == (0, 2)


def test_bead_on_a_ring():
    """Eqs. (61)-(66): B = m^(-1/2) [x, y], V = m^(1/2) [y, -x]^T up to its length and sign."""
    m, x, y = 3.0, 0.6, 0.8
    d = pn.solve_details(m * np.eye(2), [0.0, -9.81 * m], [[x, y]], [-1.0])
    np.testing.assert_allclose(d.B, [[x / np.sqrt(m), y / np.sqrt(m)]], rtol=1e-15)
    np.testing.assert_allclose(np.abs(d.V[:, 0]), [y, x], rtol=1e-14)
    np.testing.assert_allclose(d.M_root, np.sqrt(m) * np.eye(2), atol=1e-15)


def test_arguments_are_checked_as_in_solve():
    with pytest.raises(pn.InputError, match=r"M must be symmetric, got M\[0, 1\] = 1 but M\[1, 0\] = 0"):
        pn.solve_details([[2.0, 1.0], [0.0, 2.0]], [1.0, 1.0])
