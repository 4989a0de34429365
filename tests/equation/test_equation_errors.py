"""Arguments, results and errors of solve(M, F, A, b, C), with exact messages."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pin_nonideal.equation import RESIDUAL_TOLERANCE, solve
from pin_nonideal.errors import (
    InconsistentConstraintsError,
    InputError,
    NonFiniteError,
    PinNonidealError,
    SingularMassError,
)

EPS = np.finfo(float).eps


class TestContract:
    def test_lists_and_integers_are_taken_and_left_alone(self):
        M, A = [[2, 0], [0, 1]], np.array([[1, 1]])
        s = solve(M, [4, 0], A, [0], [0, 0])
        np.testing.assert_allclose(s.a, [4.0 / 3.0, -4.0 / 3.0], rtol=1e-15)  # a few roundings
        assert A.dtype.kind == "i"
        assert M == [[2, 0], [0, 1]]

    def test_inputs_are_not_written_to(self):
        arguments = [
            2.0 * EYE,
            ONES.copy(),
            np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0]]),
            np.array([1.0, 2.0]),
            ONES.copy(),
        ]
        copies = [x.copy() for x in arguments]
        for x in arguments:
            x.setflags(write=False)
        s = solve(*arguments)
        for x, copy in zip(arguments, copies, strict=True):
            np.testing.assert_array_equal(x, copy)
        s.a[0] = s.lam[0] = s.F_ideal[0] = s.F_nonideal[0] = 0.0  # results are writable copies

    def test_solution_is_frozen_and_has_no_modes(self):
        s = solve([[1.0]], [1.0])
        assert s.modes.shape == (0,)
        assert isinstance(s.rank, int)
        with pytest.raises(dataclasses.FrozenInstanceError):
            s.rank = 3


def check(error, message, *arguments, **keywords):
    with pytest.raises(error) as caught:
        solve(*arguments, **keywords)
    assert str(caught.value) == message
    assert isinstance(caught.value, PinNonidealError)


EYE = np.eye(3)
ONES = np.ones(3)
ROW = [[1.0, 0.0, 0.0]]


class TestMessages:
    @pytest.mark.parametrize("M", [np.ones((2, 3)), ONES, 1.0, np.zeros((0, 0))])
    def test_mass_of_wrong_shape(self, M):
        shape = np.shape(M)
        check(InputError, f"M must have shape (n, n) with n >= 1, got {shape}; pass the mass matrix", M, ONES)

    def test_vectors_of_wrong_shape(self):
        check(
            InputError, "F must have shape (3,) to fit M, got (2,); one force per coordinate", EYE, [1.0, 2.0]
        )
        check(
            InputError,
            "F must have shape (3,) to fit M, got (3, 1); one force per coordinate",
            EYE,
            np.ones((3, 1)),
        )
        check(
            InputError,
            "C must have shape (3,) to fit M, got (1,); one force per coordinate",
            *(EYE, ONES, ROW, [0.0], [1.0]),
        )

    def test_rows_of_wrong_shape(self):
        check(
            InputError,
            "A must have shape (m, 3) to fit M, got (3,); one row per constraint",
            EYE,
            ONES,
            ONES,
            [0.0],
        )
        check(
            InputError,
            "A must have shape (m, 3) to fit M, got (1, 2); one row per constraint",
            EYE,
            ONES,
            [[1, 2]],
            [0],
        )
        check(
            InputError,
            "b must have shape (1,) to fit A, got (2,); one value per row of A",
            EYE,
            ONES,
            ROW,
            [0, 0],
        )
        check(
            InputError, "b must have shape (1,) to fit A, got (); one value per row of A", EYE, ONES, ROW, 0.0
        )

    def test_half_a_constraint(self):
        check(InputError, "A and b must be given together, got A without b; pass b as well", EYE, ONES, ROW)
        check(
            InputError, "A and b must be given together, got b without A; pass A as well", EYE, ONES, b=[0.0]
        )

    @pytest.mark.parametrize(
        ("value", "kind"),
        [
            ("abc", "str"),
            ([1.0, 2j, 0.0], "list"),
            (None, "NoneType"),
            ([[1.0], [2.0, 3.0]], "list"),
            ([True], "list"),
        ],
    )
    def test_no_numbers(self, value, kind):
        check(InputError, f"F must hold real numbers, got {kind}; pass floats", EYE, value)

    @pytest.mark.parametrize("position", range(5))
    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_not_finite(self, position, bad):
        arguments = [EYE.copy(), ONES.copy(), np.array(ROW), np.zeros(1), ONES.copy()]
        arguments[position].flat[-1] = bad
        name = "MFAbC"[position]
        where = ["2, 2", "2", "0, 2", "0", "2"][position]
        message = f"{name} must be finite, got {bad} at {name}[{where}]; check how it is computed"
        check(InputError, message, *arguments)

    def test_mass_not_symmetric(self):
        message = (
            "M must be symmetric, got M[0, 2] = 0.5 but M[2, 0] = 0; mirror the triangle that was computed"
        )
        check(InputError, message, EYE + 0.5 * np.eye(3, k=2), ONES)

    def test_rounding_is_no_asymmetry_and_both_triangles_count(self):
        M = EYE + 1e-11 * np.eye(3, k=2)
        np.testing.assert_array_equal(solve(M, ONES).a, solve(M.T, ONES).a)

    @pytest.mark.parametrize(
        ("M", "eigenvalues"),
        [
            (np.diag([1.0, 0.0, 2.0]), "0.000e+00 (largest 2.000e+00)"),
            (np.diag([1.0, -3.0, 2.0]), "-3.000e+00 (largest 2.000e+00)"),
            (np.array([[1.0, 2.0], [2.0, 1.0]]), "-1.000e+00 (largest 3.000e+00)"),
            (np.zeros((3, 3)), "0.000e+00 (largest 0.000e+00)"),
        ],
    )
    def test_mass_not_positive_definite(self, M, eigenvalues):
        message = (
            f"M must be positive definite, got smallest eigenvalue {eigenvalues};"
            " give every link a positive mass and inertia"
        )
        check(SingularMassError, message, M, np.ones(len(M)))

    def test_mass_singular_to_rounding(self):
        """A ball joint of three revolutes in gimbal lock: Cholesky succeeds, but no digit is significant."""
        M = np.array([[1.0, 1.0 - EPS / 2], [1.0 - EPS / 2, 1.0]])
        np.linalg.cholesky(M)
        with pytest.raises(
            SingularMassError, match=r"^M must be positive definite, got smallest eigenvalue "
        ):
            solve(M, ONES[:2])

    def test_rows_that_contradict(self):
        message = (
            "constraint rows 0 and 2 contradict each other: A a - b must be 0, got 3.1e-02 in row 2;"
            " correct b or remove a row"
        )
        check(
            InconsistentConstraintsError, message, EYE, ONES, [[1, 0, 0], [0, 1, 0], [1, 0, 0]], [1, 0, 0.969]
        )

    def test_every_row_of_the_contradiction_is_named_and_no_other(self):
        A = [[1.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 1.0, 0.0], [3.0, 4.0, 0.0]]
        with pytest.raises(
            InconsistentConstraintsError, match=r"^constraint rows 0, 2 and 3 contradict each other: "
        ):
            solve(EYE, ONES, A, [1.0, 1.0, 1.0, 8.0])

    def test_zero_row_that_contradicts(self):
        message = "row 1 of A is zero: b[1] must be 0, got 0.5; correct b or remove the row"
        check(InconsistentConstraintsError, message, EYE, ONES, [[1, 0, 0], [0, 0, 0]], [0.0, 0.5])
        message = "row 0 of A is zero: b[0] must be 0, got 1e-05; correct b or remove the row"
        check(InconsistentConstraintsError, message, EYE, ONES, [[0, 0, 0]], [1e-5])

    def test_more_demands_than_coordinates(self):
        with pytest.raises(InconsistentConstraintsError, match="contradict each other"):
            solve([[1.0]], [0.0], [[1.0], [2.0]], [1.0, 1.0])

    def test_contradiction_is_judged_beside_the_accelerations(self):
        """Rounding of b passes, ten times the tolerance does not, at any size of the accelerations."""
        A = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
        for size in (1e-6, 1.0, 1e9):
            solve(EYE, size * ONES, A, size * np.array([1.0, 1.0 + 1e-13]))
            with pytest.raises(
                InconsistentConstraintsError, match=r"^constraint rows 0 and 1 contradict each other"
            ):
                solve(EYE, size * ONES, A, size * np.array([1.0, 1.0 + 100.0 * RESIDUAL_TOLERANCE]))

    def test_overflow(self):
        message = "acceleration must be finite, got an overflow; change the units of M, F or A"
        check(NonFiniteError, message, 1e-200 * EYE, 1e200 * ONES)
