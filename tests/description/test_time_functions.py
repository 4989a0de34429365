"""Functions of time: values against SciPy and closed forms, derivatives against differences."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pin_nonideal.description.time_functions import Constant, constant, polynomial, sinusoid, spline
from pin_nonideal.errors import InputError

TIMES = np.array([0.0, 0.3, 0.5, 1.4, 2.0])
VALUES = np.array([1.0, -0.5, 0.25, 2.0, 1.5])
FUNCTIONS = {
    "constant": constant(2.5),
    "sinusoid": sinusoid(0.7, 3.0, 0.2, -1.0),
    "polynomial": polynomial([1.0, -2.0, 0.5, 0.25]),
    "clamped spline": spline(TIMES, VALUES),
    "natural spline": spline(TIMES, VALUES, "natural"),
}
# Central differences of step h of a smooth function of size one: truncation h^2, rounding eps / h.
STEP = 1e-5
DIFFERENCE = 1e-9


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_rate_and_acceleration_are_the_derivatives(function):
    for t in (0.11, 0.42, 0.9, 1.77):
        value, rate, acceleration = function(t)
        before, after = function(t - STEP), function(t + STEP)
        assert math.isfinite(value)
        assert rate == pytest.approx((after[0] - before[0]) / (2 * STEP), abs=100 * DIFFERENCE)
        assert acceleration == pytest.approx((after[1] - before[1]) / (2 * STEP), abs=100 * DIFFERENCE)


def test_sinusoid_is_offset_plus_amplitude_times_sine():
    assert sinusoid(2.0, 3.0, 0.5, 1.0)(0.25)[0] == pytest.approx(1.0 + 2.0 * math.sin(1.25), rel=1e-15)


def test_sinusoid_beyond_the_range_of_angles_is_no_number():
    assert np.isnan(sinusoid(2.0, 1e300)(1e300)).all()


def test_polynomial_runs_from_low_power_to_high():
    assert polynomial([1, 2, 3, 4])(2.0) == (49.0, 62.0, 54.0)


@pytest.mark.parametrize("ends", ["clamped", "natural"])
def test_spline_is_the_cubic_spline_of_scipy(ends):
    ours, theirs = spline(TIMES, VALUES, ends), CubicSpline(TIMES, VALUES, bc_type=ends)
    for t in np.linspace(TIMES[0], TIMES[-1], 41):
        # The tridiagonal system is diagonally dominant: both are good to rounding of numbers up to 100.
        np.testing.assert_allclose(ours(t), [theirs(t), theirs(t, 1), theirs(t, 2)], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("ends", ["clamped", "natural"])
def test_spline_pieces_join_with_continuous_value_rate_and_acceleration(ends):
    function = spline(TIMES, VALUES, ends)
    assert function.coefficients.shape == (4, 4)
    for i, h in enumerate(np.diff(TIMES)[:-1]):
        c, d = function.coefficients[i], function.coefficients[i + 1]
        end = (c @ [1, h, h**2, h**3], c @ [0, 1, 2 * h, 3 * h**2], c @ [0, 0, 2, 6 * h])
        np.testing.assert_allclose(end, [d[0], d[1], 2 * d[2]], atol=1e-12)


def test_spline_holds_its_ends():
    function = spline(TIMES, VALUES)
    assert function(-1.0) == (1.0, 0.0, 0.0)
    assert function(9.0) == (1.5, 0.0, 0.0)
    assert function(0.0)[1] == pytest.approx(0.0, abs=1e-14)
    assert function(2.0)[1] == pytest.approx(0.0, abs=1e-14)


def test_spline_of_two_samples():
    assert spline([0.0, 2.0], [1.0, 3.0])(1.0)[0] == pytest.approx(2.0, rel=1e-15)
    assert spline([0.0, 2.0], [1.0, 3.0], "natural")(0.5) == pytest.approx((1.5, 1.0, 0.0), abs=1e-15)


def test_spline_keeps_its_own_samples():
    values = VALUES.copy()
    function = spline(TIMES, values)
    values[:] = 0.0
    assert function(0.0)[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        function.coefficients[0, 0] = 0.0


REFUSED = {
    "constant of text": (lambda: constant("1"), "Constant: value must be a number; got '1'"),
    "constant of nan": (lambda: constant(math.nan), "Constant: value must be finite; got nan"),
    "sinusoid of infinity": (
        lambda: sinusoid(1.0, math.inf),
        "Sinusoid: omega must be finite; got inf",
    ),
    "polynomial of a number": (
        lambda: polynomial(3),
        "Polynomial: coefficients must have shape (n,); got shape ()",
    ),
    "empty polynomial": (
        lambda: polynomial([]),
        "Polynomial: coefficients must hold at least one number; got none",
    ),
    "polynomial with nan": (
        lambda: polynomial([1.0, math.nan]),
        "Polynomial: coefficients must be finite; entry [1] is nan",
    ),
    "spline of one sample": (
        lambda: spline([0.0], [1.0]),
        "Spline: times must hold at least two samples; got 1",
    ),
    "spline with repeated time": (
        lambda: spline([0.0, 1.0, 1.0], [0, 1, 2]),
        "Spline: times must increase; times[2] = 1 does not follow times[1] = 1; "
        "sort the samples and drop repeated ones",
    ),
    "spline of unequal lengths": (
        lambda: spline([0.0, 1.0], [1.0, 2.0, 3.0]),
        "Spline: values must have shape (2,); got shape (3,)",
    ),
    "spline with unknown ends": (
        lambda: spline([0.0, 1.0], [1.0, 2.0], "clampd"),
        "Spline: ends must be one of 'clamped', 'natural'; got 'clampd'; nearest: \"clamped\"",
    ),
}


@pytest.mark.parametrize(("make", "message"), REFUSED.values(), ids=REFUSED)
def test_refusals_say_what_must_hold(make, message):
    with pytest.raises(InputError, match="^" + re.escape(message) + "$"):
        make()


def test_equal_numbers_make_equal_functions():
    assert constant(1) == Constant(1.0)
    assert sinusoid(1, 2) == sinusoid(1.0, 2.0)
    assert hash(polynomial([1, 2])) == hash(polynomial([1.0, 2.0]))
