"""A smooth motion through samples of configurations, on the Lie groups of the joints."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, Model

from .joint_layout import joint_places

# Times this close to an end of the samples count as the end: relative, and in seconds below 1 s.
TIME_ROUNDING = 1e-12
# Step of the difference for the rate of a Jacobian, in the unit of the displacement.
DIFFERENCE_STEP = 1e-5


class ReferenceMotion:
    """A motion q(t) through samples, with its velocity and acceleration.

    Between the samples k and k + 1, q(t) = q_k (+) x(t) with a cubic x(t) in tangent coordinates, and q and v
    agree with the samples at both ends. Without velocities, the rates of a cubic spline through the summed
    displacements of the samples are used (not-a-knot ends). Joints with vector configurations then follow
    this spline, with a continuous acceleration. Outside the samples, the motion rests at its ends.

    Args:
        model: pinocchio.Model.
        times: increasing sample times [s], (nt,) with nt >= 1.
        q: configurations, (nt, nq).
        v: velocities, (nt, nv), or None.
        rounding: distance from the first or last sample at which a time counts as the time of this sample,
            relative, and in seconds below 1 s.
    """

    def __init__(
        self, model: Model, times: Array, q: Array, v: Array | None = None, rounding: float = TIME_ROUNDING
    ) -> None:
        self._model, self._times, self._q = model, times, q
        self._curved = _is_curved(model)
        self._still = np.zeros(model.nv)
        self._room = rounding * max(1.0, float(np.abs(times).max()))
        if times.size == 1:
            return
        lengths = np.diff(times)[:, None]
        moves = np.array([pin.difference(model, a, b) for a, b in pairwise(q)])
        rates = _spline_rates(times, moves) if v is None else v
        ends = rates[1:].copy()
        if self._curved:
            for k, (start, move) in enumerate(zip(q[:-1], moves, strict=True)):
                ends[k] = np.linalg.solve(_jacobian(model, start, move), ends[k])
        self._coefficients = np.stack(
            [
                rates[:-1],
                (3.0 * moves / lengths - 2.0 * rates[:-1] - ends) / lengths,
                (rates[:-1] + ends - 2.0 * moves / lengths) / lengths**2,
            ],
            axis=1,
        )

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Return q (nq,), v (nv,) and a (nv,) at time t [s]."""
        times = self._times
        if not times[0] - self._room <= t <= times[-1] + self._room or times.size == 1:
            return self._q[0 if t < times[-1] else -1], self._still, self._still
        k = min(max(int(np.searchsorted(times, t, side="right")) - 1, 0), times.size - 2)
        s, start = t - float(times[k]), self._q[k]
        c1, c2, c3 = self._coefficients[k]
        x = s * (c1 + s * (c2 + s * c3))
        rate, change = c1 + s * (2.0 * c2 + 3.0 * s * c3), 2.0 * c2 + 6.0 * s * c3
        q = np.asarray(pin.integrate(self._model, start, x))
        if not self._curved:
            return q, rate, change
        step = DIFFERENCE_STEP / max(1.0, float(np.abs(rate).max()))
        before, at, after = (_jacobian(self._model, start, x + d * rate) for d in (-step, 0.0, step))
        return q, at @ rate, at @ change + (after - before) @ rate / (2.0 * step)


def break_times(model: Model, times: Array, with_rates: bool) -> Array:
    """Return times at which the velocity or acceleration of a reference may jump [s], ascending, (n,).

    These are the ends of the samples. Two times, one floating-point spacing apart, enclose the jump of the
    velocity at each end. Inner samples are times of the result unless the acceleration is continuous.

    Args:
        model: pinocchio.Model.
        times: increasing sample times [s], (nt,).
        with_rates: whether velocities are given at the samples.
    """
    if times.size == 1:
        return np.zeros(0)
    first, last = float(times[0]), float(times[-1])
    before, after = (np.spacing(max(abs(end), last - first)) for end in (first, last))
    inner = times[1:-1] if with_rates or _is_curved(model) else times[:0]
    return np.array([first - before, first, *inner, last, last + after])


def _is_curved(model: Model) -> bool:
    """Check if a joint has configurations that are not vectors, with more than one axis of rotation."""
    return any(place.nq != place.nv and place.nv > 1 for place in joint_places(model))


def _jacobian(model: Model, q: Array, x: Array) -> Array:
    """Return the Jacobian of q (+) x with respect to x, (nv, nv)."""
    return np.asarray(pin.dIntegrate(model, q, x, pin.ArgumentPosition.ARG1))


def _spline_rates(times: Array, moves: Array) -> Array:
    """Return the rates at the samples of a cubic spline through the summed displacements, (nt, nv)."""
    from scipy.interpolate import CubicSpline

    sums = np.vstack([np.zeros(moves.shape[1]), np.cumsum(moves, axis=0)])
    return np.asarray(CubicSpline(times, sums)(times, 1))
