"""solve(M, F, A, b, C) against the equations of the paper, other methods and exact arithmetic."""

from __future__ import annotations

import numpy as np
import pytest

from oracles.eq40_by_paper import (
    eq40_by_paper,
    exact_road,
    generalized_inverse_road,
    kkt_road,
    letters,
    stacked_road,
)
from pin_nonideal.equation import RANK_TOLERANCE, solve

# Relative agreement of methods: the random problems have condition below 100, the paper's equations square
# it, and 1e4 roundings of 1e-16 are 1e-12.
ROADS = 1e-12
EPS = np.finfo(float).eps

# n, independent rows, redundant rows
SHAPES = [
    (1, 0, 0),
    (1, 1, 0),
    (1, 1, 2),
    (3, 1, 0),
    (4, 2, 0),
    (6, 3, 2),
    (6, 5, 4),
    (7, 7, 0),
    (7, 7, 3),
    (9, 0, 0),
]


def problem(seed, n, independent, redundant, nonideal=True):
    """Return a random well-conditioned problem with redundant rows as combinations of independent rows."""
    rng = np.random.default_rng(seed)
    # Orthogonal times a short range of scales keeps the condition of M below 10 and of A below 10.
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    M = (Q * rng.uniform(0.5, 4.0, n)) @ Q.T
    A = np.linalg.qr(rng.normal(size=(n, n)))[0][:independent] * rng.uniform(0.5, 4.0, (independent, 1))
    A = np.vstack([A, rng.normal(size=(redundant, independent)) @ A])[
        rng.permutation(independent + redundant)
    ]
    b = A @ rng.normal(size=n)
    C = rng.normal(size=n) if nonideal else np.zeros(n)
    return (M + M.T) / 2, rng.normal(size=n), A, b, C


def assert_close(value, reference, tolerance, scale=0.0):
    """Assert a relative error in the Euclidean norm; `scale` is the size of canceling terms."""
    error = np.linalg.norm(np.asarray(value) - reference)
    assert error <= tolerance * max(np.linalg.norm(reference), scale), (
        error,
        np.linalg.norm(reference),
        scale,
    )


def assert_forces(solution, forces, tolerance, scale):
    """Assert equal forces; `scale` is the size of all forces, since a zero part has their rounding."""
    assert_close(solution.a, forces.a, tolerance, scale)
    assert_close(solution.F_ideal, forces.F_ideal, tolerance, scale)
    assert_close(solution.F_nonideal, forces.F_nonideal, tolerance, scale)


class TestRoadsAgree:
    @pytest.mark.parametrize("seed", range(4))
    @pytest.mark.parametrize("nonideal", [False, True])
    @pytest.mark.parametrize("shape", SHAPES)
    def test_all_roads_give_the_same_motion_and_forces(self, shape, nonideal, seed):
        M, F, A, b, C = problem(seed, *shape, nonideal)
        solution = solve(M, F, A, b, C)
        scale = np.linalg.norm(F) + np.linalg.norm(C)
        assert solution.rank == shape[1]
        assert_forces(solution, eq40_by_paper(M, F, A, b, C), ROADS, scale)
        assert_forces(solution, generalized_inverse_road(M, F, A, b, C), ROADS, scale)
        kkt, lam = kkt_road(M, F, A, b, C)
        assert_forces(solution, kkt, ROADS, scale)
        assert_close(solution.lam, lam, ROADS, scale)
        a, F_c = stacked_road(M, F, A, b, C)
        assert_close(solution.a, a, ROADS, scale)
        assert_close(solution.F_ideal + solution.F_nonideal, F_c, ROADS, scale)

    @pytest.mark.parametrize("shape", SHAPES)
    def test_multipliers_belong_to_the_total_motion_and_are_shortest(self, shape):
        M, F, A, b, C = problem(11, *shape)
        s = solve(M, F, A, b, C)
        scale = np.linalg.norm(F) + np.linalg.norm(C)
        assert_close(A.T @ s.lam, s.F_ideal + s.F_nonideal - C, ROADS, scale)
        assert_close(M @ s.a, F + C + A.T @ s.lam, ROADS, scale)
        if A.size:
            assert_close(
                s.lam, np.linalg.pinv(A.T, rcond=1e-9) @ (s.F_ideal + s.F_nonideal - C), ROADS, scale
            )

    @pytest.mark.parametrize("shape", SHAPES)
    def test_acceleration_meets_the_constraints_and_the_prescribed_work(self, shape):
        M, F, A, b, C = problem(12, *shape)
        s = solve(M, F, A, b, C)
        scale = np.linalg.norm(F) + np.linalg.norm(C) + np.linalg.norm(b)
        assert_close(A @ s.a, b, ROADS, scale)
        V = letters(np.eye(len(M)), A).V  # virtual displacements: A V = 0, Eq. (8)
        assert_close(V.T @ (s.F_ideal + s.F_nonideal), V.T @ C, ROADS, scale)  # Eq. (9)
        assert_close(V.T @ s.F_ideal, np.zeros(V.shape[1]), ROADS, scale)

    def test_ideal_part_does_not_depend_on_the_prescribed_work(self):
        M, F, A, b, C = problem(13, 6, 3, 2)
        assert_close(solve(M, F, A, b, C).F_ideal, solve(M, F, A, b).F_ideal, ROADS)
        assert_close(solve(M, F, A, b).F_nonideal, np.zeros(6), 0.0)


class TestTheoremsOfThePaper:
    @pytest.fixture(params=[s for s in SHAPES if s[1] > 0], ids=str)
    def paper(self, request):
        M, _, A, _, _ = problem(21, *request.param)
        return letters(M, A)

    def test_gram_schmidt_spans_the_null_space(self, paper):
        assert_close(paper.B @ paper.V, np.zeros((len(paper.B), paper.V.shape[1])), ROADS, 1.0)
        assert paper.V.shape[1] == len(paper.root) - np.linalg.matrix_rank(paper.B, rtol=1e-9)
        assert_close(paper.E @ paper.D, np.zeros_like(paper.D), ROADS, np.linalg.norm(paper.D))

    def test_blocks_invert_the_normal_matrix(self, paper):
        _, _, _, J, D, E = paper
        eye = np.eye(len(J))
        normal = np.block([[eye + D, -eye], [-eye, eye + E]])
        P, S = J @ (eye + E), J @ (eye + D)
        assert_close(np.block([[P, J], [J, S]]) @ normal, np.eye(2 * len(J)), ROADS)  # Eqs. (20)-(23)
        assert_close(S @ E, eye - J @ D, ROADS, 1.0)  # Eq. (24)
        assert_close(J, J.T, ROADS)

    def test_four_moore_penrose_conditions(self, paper):
        B, X = paper.B, paper.J @ paper.B.T
        assert_close(B @ X @ B, B, ROADS)  # Eqs. (41)-(46)
        assert_close(X @ B @ X, X, ROADS)
        assert_close((B @ X).T, B @ X, ROADS)
        assert_close((X @ B).T, X @ B, ROADS)
        assert_close(X, np.linalg.pinv(B, rcond=1e-9), ROADS)

    def test_any_basis_of_the_null_space_gives_the_same_forces(self):
        M, F, A, b, C = problem(22, 6, 3, 2)
        V = letters(M, A).V
        mixed = V @ np.array([[2.0, 0.3, 0.0], [0.0, 1.0, -0.5], [0.4, 0.0, 3.0]])
        reference, other = eq40_by_paper(M, F, A, b, C), eq40_by_paper(M, F, A, b, C, V=mixed)
        for one, two in zip(reference, other, strict=True):
            assert_close(one, two, ROADS)


def ill_conditioned(kind, condition, seed, redundant=False):
    """Return a problem with the condition of M.

    random: random directions are light.  graded: coordinates are light and heavy.  held: constraints act on
    the light directions, as in a closed loop of light links.
    """
    rng = np.random.default_rng(seed)
    n, m = 6, 3
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    A = rng.integers(-4, 5, size=(m, n)).astype(float)  # integers: combinations of rows are exact
    if kind == "graded":
        scale = np.geomspace(1.0, condition**-0.5, n)
        M = scale[:, None] * ((Q * np.linspace(1.0, 3.0, n)) @ Q.T) * scale
    else:
        eigenvalues = np.geomspace(1.0, 1.0 / condition, n)
        if kind == "held":
            eigenvalues = np.where(np.arange(n) < 2, 1.0 / condition, 1.0)
            Q = np.linalg.qr(np.hstack([A[:2].T, Q[:, 2:]]))[0]
        M = (Q * eigenvalues) @ Q.T
    b = rng.integers(-4, 5, size=m).astype(float)
    mix = np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 3.0]]) if redundant else np.zeros((0, 3))
    return (M + M.T) / 2, rng.normal(size=n), A, b, rng.normal(size=n), mix


class TestIllConditionedMass:
    @pytest.mark.parametrize("redundant", [False, True])
    @pytest.mark.parametrize("condition", [1e3, 1e6, 1e9, 1e12])
    @pytest.mark.parametrize("kind", ["random", "graded", "held"])
    def test_against_exact_arithmetic(self, kind, condition, redundant):
        for seed in range(4):
            M, F, A, b, C, mix = ill_conditioned(kind, condition, seed, redundant)
            forces, lam = exact_road(M, F, A, b, C)
            rows, right = np.vstack([A, mix @ A]), np.concatenate([b, mix @ b])
            s = solve(M, F, rows, right, C)
            assert s.rank == len(A)
            # The solution changes by the rounding of M times its condition if a light direction is free and
            # mixed. If constraints act on it, or a single coordinate is light, the change is 1e4 roundings.
            tolerance = EPS * condition + 1e-13 if kind == "random" else 1e-12
            for value, reference in zip((s.a, s.F_ideal, s.F_nonideal), forces, strict=True):
                assert_close(value, reference, tolerance)
            if not redundant:
                assert_close(s.lam, lam, tolerance)
            # Backward error: equations hold to rounding of their terms for any condition.
            assert_close(
                M @ s.a - F - C - rows.T @ s.lam, 0.0, 1e-14, np.linalg.norm(M) * np.linalg.norm(s.a) + 10.0
            )
            assert_close(rows @ s.a, right, 1e-14, np.linalg.norm(rows) * np.linalg.norm(s.a))

    def test_squaring_the_condition_would_show(self):
        """A direct solution with the Delassus matrix A M^-1 A^T misses the tolerance of the test above."""
        M, F, A, b, C, _ = ill_conditioned("held", 1e12, 0)
        G = A @ np.linalg.solve(M, A.T)
        lam = np.linalg.solve(G, b - A @ np.linalg.solve(M, F + C))
        a = np.linalg.solve(M, F + C + A.T @ lam)
        exact = exact_road(M, F, A, b, C)[0].a
        assert np.linalg.norm(a - exact) > 1e-8 * np.linalg.norm(exact)


class TestRowsInAnyForm:
    # Rows over twelve decades: 1e-12 of agreement, since scale enters each row's rounding alike.
    @pytest.mark.parametrize("seed", range(4))
    def test_scale_of_rows_changes_nothing_but_the_multipliers(self, seed):
        M, F, A, b, C = problem(31 + seed, 7, 4, 2)
        scale = 10.0 ** np.random.default_rng(seed).uniform(-6, 6, len(A))
        reference, scaled = solve(M, F, A, b, C), solve(M, F, scale[:, None] * A, scale * b, C)
        assert scaled.rank == reference.rank == 4
        for name in ("a", "F_ideal", "F_nonideal"):
            assert_close(getattr(scaled, name), getattr(reference, name), ROADS)
        pull = (scale[:, None] * A).T @ scaled.lam
        assert_close(pull, A.T @ reference.lam, ROADS)

    def test_multipliers_of_independent_rows_take_the_inverse_scale(self):
        M, F, A, b, C = problem(35, 6, 4, 0)
        scale = np.array([1e-6, 1e3, -2.0, 1e6])
        assert_close(
            scale * solve(M, F, scale[:, None] * A, scale * b, C).lam, solve(M, F, A, b, C).lam, ROADS
        )

    @pytest.mark.parametrize("seed", range(4))
    def test_order_of_rows_permutes_the_multipliers(self, seed):
        M, F, A, b, C = problem(41 + seed, 7, 4, 3)
        order = np.random.default_rng(seed).permutation(len(A))
        reference, permuted = solve(M, F, A, b, C), solve(M, F, A[order], b[order], C)
        for name in ("a", "F_ideal", "F_nonideal"):
            assert_close(getattr(permuted, name), getattr(reference, name), ROADS)
        assert_close(permuted.lam, reference.lam[order], ROADS)

    def test_copies_share_the_load_equally(self):
        M, F, A, b, C = problem(51, 5, 2, 0)
        reference = solve(M, F, A, b, C)
        thrice = solve(M, F, np.vstack([A, A, A]), np.concatenate([b, b, b]), C)
        assert thrice.rank == 2
        assert_close(thrice.a, reference.a, ROADS)
        assert_close(thrice.lam, np.tile(reference.lam / 3.0, 3), ROADS)

    def test_a_copy_twice_as_large_takes_twice_the_multiplier(self):
        """Shortest lam with lam_1 + 2 lam_2 = -1 is (-1, -2) / 5."""
        s = solve(np.eye(2), [1.0, 0.0], [[1.0, 0.0], [2.0, 0.0]], [0.0, 0.0])
        assert_close(s.lam, np.array([-0.2, -0.4]), ROADS)

    def test_units_of_coordinates_change_nothing(self):
        """With coordinates in micrometers and megameters, q = S q', M' = S M S and A' = A S."""
        M, F, A, b, C = problem(52, 6, 3, 1)
        S = 10.0 ** np.array([-6.0, 6.0, -6.0, 6.0, -6.0, -6.0])
        reference, other = solve(M, F, A, b, C), solve(S[:, None] * M * S, S * F, A * S, b, S * C)
        assert other.rank == 3
        assert_close(S * other.a, reference.a, ROADS)
        assert_close(other.F_ideal / S, reference.F_ideal, ROADS)
        assert_close(other.F_nonideal / S, reference.F_nonideal, ROADS)

    def test_zero_rows_are_allowed(self):
        M, F, A, b, C = problem(53, 5, 2, 0)
        reference = solve(M, F, A, b, C)
        s = solve(M, F, np.vstack([np.zeros(5), A]), np.concatenate([[0.0], b]), C)
        assert s.rank == 2
        assert s.lam[0] == 0.0
        assert_close(s.a, reference.a, ROADS)
        only = solve(M, F, np.zeros((2, 5)), np.zeros(2), C)
        assert only.rank == 0
        assert_close(only.a, np.linalg.solve(M, F + C), ROADS)
        assert_close(only.lam, np.zeros(2), 0.0)

    def test_rounding_of_a_vanishing_row_is_no_constraint(self):
        """A planar loop closed in space has a row of 1e-17: scaled up it would lock the robot."""
        M, F, A, b, C = problem(54, 5, 2, 0)
        noise = 1e-17 * np.random.default_rng(0).normal(size=5)
        s = solve(M, F, np.vstack([A, noise]), np.concatenate([b, [1e-17]]), C)
        assert s.rank == 2
        assert_close(s.a, solve(M, F, A, b, C).a, ROADS)

    def test_rank_tolerance_parts_redundant_from_independent(self):
        tilt = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
        for angle, rank in [(RANK_TOLERANCE / 10, 1), (RANK_TOLERANCE * 10, 2)]:
            A = tilt * [1.0, angle, 1.0]
            assert solve(np.eye(3), np.zeros(3), A, A @ [1.0, 1.0, 0.0]).rank == rank

    def test_as_many_rows_as_coordinates_leave_nothing_to_the_forces(self):
        M, F, A, b, C = problem(55, 5, 5, 0)
        s = solve(M, F, A, b, C)
        assert_close(s.a, np.linalg.solve(A, b), ROADS)
        assert_close(s.F_nonideal, np.zeros(5), ROADS, np.linalg.norm(C))

    def test_no_rows(self):
        M, F, _, _, C = problem(56, 5, 0, 0)
        for s in (solve(M, F, C=C), solve(M, F, np.zeros((0, 5)), [], C)):
            assert s.rank == 0
            assert s.lam.shape == (0,)
            assert_close(s.a, np.linalg.solve(M, F + C), ROADS)
            assert_close(s.F_ideal, np.zeros(5), 0.0)
            assert_close(s.F_nonideal, C, 0.0)

    def test_huge_and_tiny_rows(self):
        for size in (1e200, 1e-200):
            s = solve(np.eye(2), [1.0, 1.0], [[size, 0.0]], [3.0 * size])
            assert s.rank == 1
            assert_close(s.a, np.array([3.0, 1.0]), ROADS)
