"""Functions of time with two derivatives, for prescribed joints and lengths.

Any Python function t -> (value, rate, acceleration) is accepted. The classes below store their numbers as
fields, so that the compiled core evaluates them without calls into Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.types import Array
from pin_nonideal.validation import array, choice, number

Sample = tuple[float, float, float]
TimeFunction = Callable[[float], Sample]


@dataclass(frozen=True)
class Constant:
    """f(t) = value.

    Args:
        value: constant value, in the unit of the driven quantity.
    """

    value: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", number("Constant: value", self.value))

    def __call__(self, t: float) -> Sample:
        """(value, rate, acceleration) at time t [s]."""
        return (self.value, 0.0, 0.0)


@dataclass(frozen=True)
class Sinusoid:
    """f(t) = offset + amplitude sin(omega t + phase).

    Args:
        amplitude: amplitude, in the unit of the driven quantity.
        omega: angular frequency [rad/s].
        phase: phase angle [rad].
        offset: mean value.
    """

    amplitude: float
    omega: float
    phase: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        for key in ("amplitude", "omega", "phase", "offset"):
            object.__setattr__(self, key, number(f"Sinusoid: {key}", getattr(self, key)))

    def __call__(self, t: float) -> Sample:
        """(value, rate, acceleration) at time t [s]; NaN if the angle overflows."""
        w = self.omega
        angle = w * t + self.phase
        if not math.isfinite(angle):
            return (math.nan, math.nan, math.nan)
        s, c = self.amplitude * math.sin(angle), self.amplitude * math.cos(angle)
        return (self.offset + s, w * c, -w * w * s)


@dataclass(frozen=True)
class Polynomial:
    """f(t) = c0 + c1 t + c2 t^2 + ...

    Args:
        coefficients: coefficients in ascending powers, at least one.
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        c = array("Polynomial: coefficients", self.coefficients, (None,))
        if c.size == 0:
            raise InputError("Polynomial: coefficients must hold at least one number; got none")
        object.__setattr__(self, "coefficients", tuple(float(x) for x in c))

    def __call__(self, t: float) -> Sample:
        """(value, rate, acceleration) at time t [s]."""
        return _horner(self.coefficients, t)


@dataclass(frozen=True, eq=False)
class Spline:
    """Cubic spline through samples, with continuous value, rate and acceleration between them.

    On piece i, with s = t - breaks[i]:  f = c[i, 0] + c[i, 1] s + c[i, 2] s^2 + c[i, 3] s^3.
    Before the first and after the last time, the end value is held with rate zero. Clamped ends (the default)
    have rate zero, so the rate is continuous. At natural ends (acceleration zero) the rate jumps.

    Args:
        times: sample times [s], increasing, shape (n,) with n >= 2.
        values: samples, shape (n,).
        ends: "clamped" (rate zero at both ends) or "natural" (acceleration zero at both ends).

    Attributes:
        breaks: sample times, shape (n,), read-only.
        coefficients: shape (n - 1, 4), low to high, read-only.
    """

    times: Sequence[float] | NDArray[np.float64]
    values: Sequence[float] | NDArray[np.float64]
    ends: str = "clamped"
    breaks: NDArray[np.float64] = field(init=False, repr=False)
    coefficients: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        times = array("Spline: times", self.times, (None,))
        if times.size < 2:
            raise InputError(f"Spline: times must hold at least two samples; got {times.size}")
        values = array("Spline: values", self.values, (times.size,))
        disorder = np.flatnonzero(np.diff(times) <= 0.0)
        if disorder.size:
            i = int(disorder[0])
            raise InputError(
                f"Spline: times must increase; times[{i + 1}] = {times[i + 1]:g} does not follow "
                f"times[{i}] = {times[i]:g}; sort the samples and drop repeated ones"
            )
        choice("Spline: ends", self.ends, ("clamped", "natural"))
        coefficients = _spline_coefficients(times, values, clamped=self.ends == "clamped")
        coefficients.setflags(write=False)
        for key, value in (
            ("times", times),
            ("values", values),
            ("breaks", times),
            ("coefficients", coefficients),
        ):
            object.__setattr__(self, key, value)

    def __call__(self, t: float) -> Sample:
        """(value, rate, acceleration) at time t [s]."""
        if t < self.breaks[0]:
            return (float(self.values[0]), 0.0, 0.0)
        if t > self.breaks[-1]:
            return (float(self.values[-1]), 0.0, 0.0)
        i = min(int(np.searchsorted(self.breaks, t, side="right")) - 1, len(self.breaks) - 2)
        return _horner(self.coefficients[i], t - float(self.breaks[i]))


def constant(value: float) -> Constant:
    """f(t) = value; see `Constant`.

    Args:
        value: constant value, in the unit of the driven quantity.

    Returns:
        The function t -> (value, rate, acceleration).

    Raises:
        InputError: `value` is not a finite number.
    """
    return Constant(value)


def sinusoid(amplitude: float, omega: float, phase: float = 0.0, offset: float = 0.0) -> Sinusoid:
    """f(t) = offset + amplitude sin(omega t + phase); see `Sinusoid`.

    Args:
        amplitude: amplitude, in the unit of the driven quantity.
        omega: angular frequency [rad/s].
        phase: phase angle [rad].
        offset: mean value.

    Returns:
        The function t -> (value, rate, acceleration).

    Raises:
        InputError: an argument is not a finite number.
    """
    return Sinusoid(amplitude, omega, phase, offset)


def polynomial(coefficients: Sequence[float]) -> Polynomial:
    """f(t) = c0 + c1 t + c2 t^2 + ...; see `Polynomial`.

    Args:
        coefficients: coefficients in ascending powers, at least one.

    Returns:
        The function t -> (value, rate, acceleration).

    Raises:
        InputError: there is no coefficient, or a coefficient is not a finite number.
    """
    return Polynomial(coefficients)  # type: ignore[arg-type]


def spline(times: ArrayLike, values: ArrayLike, ends: str = "clamped") -> Spline:
    """Cubic spline through samples; see `Spline`.

    Args:
        times: sample times [s], increasing, shape (n,) with n >= 2.
        values: samples, shape (n,).
        ends: "clamped" (rate zero at both ends) or "natural" (acceleration zero at both ends).

    Returns:
        The function t -> (value, rate, acceleration).

    Raises:
        InputError: times do not increase, shapes differ, or numbers are not finite.
    """
    return Spline(times, values, ends)  # type: ignore[arg-type]


def _horner(coefficients: Sequence[float] | Array, s: float) -> Sample:
    """Return value and two derivatives of a polynomial with coefficients in ascending powers."""
    value = rate = half = 0.0
    for c in reversed(coefficients):
        half = half * s + rate
        rate = rate * s + value
        value = value * s + float(c)
    return (value, rate, 2.0 * half)


def _spline_coefficients(
    t: NDArray[np.float64], y: NDArray[np.float64], *, clamped: bool
) -> NDArray[np.float64]:
    """Compute the coefficients (n - 1, 4) of the C2 cubic spline, from second derivatives m at the samples.

    At inner samples, continuity of the rate gives h[i-1] m[i-1] + 2 (h[i-1] + h[i]) m[i] + h[i] m[i+1] =
    6 (d[i] - d[i-1]) with steps h and slopes d. The tridiagonal system is diagonally dominant and is solved
    by Thomas' algorithm.
    """
    n = t.size
    h = np.diff(t)
    d = np.diff(y) / h
    lower, diagonal, upper, right = np.zeros(n), np.ones(n), np.zeros(n), np.zeros(n)
    lower[1:-1], diagonal[1:-1], upper[1:-1] = h[:-1], 2.0 * (h[:-1] + h[1:]), h[1:]
    right[1:-1] = 6.0 * np.diff(d)
    if clamped:
        diagonal[0], upper[0], right[0] = 2.0 * h[0], h[0], 6.0 * d[0]
        lower[-1], diagonal[-1], right[-1] = h[-1], 2.0 * h[-1], -6.0 * d[-1]
    for i in range(1, n):
        w = lower[i] / diagonal[i - 1]
        diagonal[i] -= w * upper[i - 1]
        right[i] -= w * right[i - 1]
    m = np.zeros(n)
    m[-1] = right[-1] / diagonal[-1]
    for i in range(n - 2, -1, -1):
        m[i] = (right[i] - upper[i] * m[i + 1]) / diagonal[i]
    return np.column_stack(
        [y[:-1], d - h * (2.0 * m[:-1] + m[1:]) / 6.0, m[:-1] / 2.0, np.diff(m) / (6.0 * h)]
    )
