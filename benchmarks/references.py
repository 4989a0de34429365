"""References: quadrature for one degree of freedom, published values, else dense mechanics.

References call no algorithm of Pinocchio or of this package.  `uncertainty` bounds their error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracles.dense import DenseScene

Array = NDArray[np.float64]

ROUNDING = 1e-13  # rounding error of sums of several hundred terms of order one


@dataclass(frozen=True)
class Reference:
    """Reference configurations at the times of a problem.

    Attributes:
        q: configurations, (k, nq).
        uncertainty: error bound of the coordinates [rad or m].
        how: description of the method.
    """

    q: Array
    uncertainty: float
    how: str


# --- one freedom: t = integral of sqrt(I / (2 (E - V))) ----------------------------------------------------


def place_after(t: float, start: float, speed: Callable[[Array], Array], direction: float = 1.0) -> float:
    """Return x at time t of a motion from `start` that never stops, with dx/dt = direction speed(x).

    Args:
        t: time [s].
        start: x at time zero.
        speed: positive speed for an array of x.
        direction: 1 or -1.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    step = 0.05  # panel length; 24 nodes resolve a smooth integrand to rounding
    x, left = start, t
    while True:
        half = 0.5 * direction * step
        duration = 0.5 * step * float(weights @ (1.0 / speed(x + half + half * nodes)))
        if duration > left:
            break
        x, left = x + direction * step, left - duration
    length = step * left / duration
    for _ in range(50):  # Newton's method for the length of the last panel
        half = 0.5 * direction * length
        miss = 0.5 * length * float(weights @ (1.0 / speed(x + half + half * nodes))) - left
        move = miss * float(speed(np.array([x + direction * length]))[0])
        length -= move
        if abs(move) < 1e-15:
            break
    return x + direction * length


def four_bar_quadrature(problem: Any) -> Reference:
    """Solve the crank-rocker in the x-z plane: angles from +x towards +z, closed by the cosine rule."""
    model = problem.model
    joint = {name: i for i, name in enumerate(model.names)}
    crank, coupler, rocker = (joint[f"{name}_joint"] for name in ("crank", "coupler", "rocker"))

    def planar(vector: Any) -> complex:
        return complex(vector[0], vector[2])

    ground = planar(model.jointPlacements[rocker].translation)
    l1 = planar(model.jointPlacements[coupler].translation).real
    l2, l3 = (
        planar(model.frames[model.getFrameId(n)].placement.translation).real
        for n in ("coupler_tip", "rocker_tip")
    )
    bodies = [model.inertias[i] for i in (crank, coupler, rocker)]
    g = -model.gravity.linear[2]

    def angles(x: Array) -> tuple[Array, Array]:
        """Return absolute angles of coupler and rocker, on the branch of this model (rocker tip above)."""
        gap = l1 * np.exp(1j * x) - ground  # from the rocker's pivot to the crank's tip
        d = np.abs(gap)
        y = np.pi + np.angle(-gap) - np.arccos((d**2 + l3**2 - l2**2) / (2.0 * d * l3))
        return np.angle(ground + l3 * np.exp(1j * y) - l1 * np.exp(1j * x)), y

    def energies(x: Array) -> tuple[Array, Array]:
        """Return the effective inertia of x, and the potential energy."""
        w, y = angles(x)
        e1, e2, e3 = np.exp(1j * x), np.exp(1j * w), np.exp(1j * y)
        # Components of l1 e1 + l2 e2 w' = l3 e3 y' give both velocity ratios.
        y_rate = l1 * np.real(e1 * np.conj(1j * e2)) / (l3 * np.real(e3 * np.conj(1j * e2)))
        w_rate = -l1 * np.real(e1 * np.conj(1j * e3)) / (l2 * np.real(e2 * np.conj(1j * e3)))
        inertia, potential = np.zeros_like(x), np.zeros_like(x)
        levers = [planar(body.lever) for body in bodies]
        places = [levers[0] * e1, l1 * e1 + levers[1] * e2, ground + levers[2] * e3]
        rates = [1j * levers[0] * e1, 1j * (l1 * e1 + levers[1] * e2 * w_rate), 1j * levers[2] * e3 * y_rate]
        for body, place, rate, turning in zip(bodies, places, rates, (1.0, w_rate, y_rate), strict=True):
            inertia += body.mass * np.abs(rate) ** 2 + body.inertia[1, 1] * turning**2
            potential += body.mass * g * np.imag(place)
        return inertia, potential

    x0, rate0 = float(problem.q0[model.joints[crank].idx_q]), float(problem.v0[model.joints[crank].idx_v])
    inertia, potential = energies(np.array([x0]))
    energy = float(0.5 * inertia[0] * rate0**2 + potential[0])

    def speed(x: Array) -> Array:
        inertia, potential = energies(x)
        return np.sqrt(2.0 * (energy - potential) / inertia)

    x = np.array([place_after(t, x0, speed, np.sign(rate0)) for t in problem.times])
    (w0, y0), (w, y) = angles(np.array([x0])), angles(x)
    q = np.tile(problem.q0, (len(x), 1))
    q[:, model.joints[crank].idx_q] = x
    q[:, model.joints[rocker].idx_q] += y - y0
    q[:, model.joints[coupler].idx_q] += w - w0 - (x - x0)
    return Reference(q, ROUNDING * float(np.abs(x).max()), "quadrature of the energy equation")


def n_four_bar_quadrature(problem: Any) -> Reference:
    """Solve parallel cranks: I phi'^2 / 2 + P cos(phi) = E, uniform rods of 1 kg and 1 m (IFToMM A02)."""
    model = problem.model
    n = (model.nq - 1) // 2
    g = -model.gravity.linear[2]
    inertia, weight = (n + 1) / 3.0 + n, ((n + 1) / 2.0 + n) * g
    energy = 0.5 * inertia * problem.v0[0] ** 2 + weight

    def speed(x: Array) -> Array:
        return np.sqrt(2.0 * (energy - weight * np.cos(x)) / inertia)

    x = np.array([place_after(t, 0.0, speed) for t in problem.times])
    signs = np.array([1.0 if name.startswith("crank") else -1.0 for name in list(model.names)[1:]])
    return Reference(np.outer(x, signs), ROUNDING * float(x.max()), "quadrature of the energy equation")


def coulomb_swings(problem: Any) -> Reference:
    """Solve I x'' = -P sin(x) - c sgn(x') from rest: swings by quadrature, reversals by the energy."""
    body, c, g = problem.model.inertias[1], float(problem.coulomb[0]), -problem.model.gravity.linear[2]
    weight = -body.mass * g * body.lever[2]
    inertia = body.mass * body.lever[2] ** 2 + body.inertia[1, 1]
    places = [coulomb_place(float(problem.q0[0]), t, weight, inertia, c) for t in problem.times]
    return Reference(np.array(places)[:, None], ROUNDING, "quadrature of the energy equation, swing by swing")


def coulomb_place(x: float, left: float, weight: float, inertia: float, c: float) -> float:
    """Return the angle after the time `left` [s] from rest at x."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    while weight * abs(np.sin(x)) > c:
        a, side = abs(x), np.sign(x)  # swing from a to -b
        b = a
        for _ in range(100):  # weight (cos b - cos a) = c (a + b)
            b -= (weight * (np.cos(b) - np.cos(a)) - c * (a + b)) / (-weight * np.sin(b) - c)
        middle, half = 0.5 * (a - b), 0.5 * (a + b)

        def density(s: Array, middle: float = middle, half: float = half, a: float = a) -> Array:
            """Return dt/ds at x = middle + half cos(s), which removes both square-root singularities."""
            x = middle + half * np.cos(s)
            work = 2.0 * weight * np.sin(0.5 * (a - x)) * np.sin(0.5 * (a + x)) - c * (a - x)
            return half * np.sin(s) / np.sqrt(2.0 * work / inertia)

        def passed(s: float, density: Callable[[Array], Array] = density) -> float:
            return 0.5 * s * float(weights @ density(0.5 * s * (1.0 + nodes)))

        if passed(np.pi) > left:
            low, high = 0.0, np.pi
            for _ in range(60):  # bisection, to rounding
                s = 0.5 * (low + high)
                low, high = (s, high) if passed(s) < left else (low, s)
            return side * (middle + half * np.cos(low))
        x, left = -side * b, left - passed(np.pi)
    return x


# --- published --------------------------------------------------------------------------------------------

# Quadrature of the energy with 30 digits; agrees with Test Set for IVP Solvers (Bari) to its 1e-9.
ANDREWS_END = {
    "beta": 15.8107711951537071, "theta": -15.7563710584118395, "gamma": 0.0408222401196458049,
    "phi": -0.534730116342079594, "delta": 0.524409965879954069, "omega": 0.534730116342079594,
    "epsilon": 1.04808074104193787,
}  # fmt: skip


# --- dense mechanics --------------------------------------------------------------------------------------


def dense_motion(problem: Any) -> Reference:
    dense = DenseScene(problem.scene())
    tight, loose = (dense.motion(problem.q0, problem.v0, problem.times, rtol) for rtol in (1e-13, 1e-12))
    miss = float(np.abs(tight - loose).max())
    return Reference(tight, max(miss, ROUNDING), "SciPy DOP853 at 1e-13 on a dense KKT system")


def andrews(problem: Any) -> Reference:
    """Solve by dense mechanics; the end is replaced by the published value, which gives the uncertainty."""
    reference = dense_motion(problem)
    end = reference.q[-1].copy()
    for name, value in ANDREWS_END.items():
        end[problem.model.joints[problem.model.getJointId(name)].idx_q] = value
    miss = float(np.abs(end - reference.q[-1]).max())
    reference.q[-1] = end
    return Reference(reference.q, max(miss, reference.uncertainty), f"{reference.how}; its end published")


def dense_friction(problem: Any) -> Reference:
    from oracles.dense_friction import friction_motion

    dense = DenseScene(problem.scene())
    rough = friction_motion(dense, problem, 0.01)
    fine = friction_motion(dense, problem, 0.004)
    miss = float(np.abs(rough - fine).max())
    return Reference(
        fine, max(miss, ROUNDING), "SciPy DOP853 at 1e-13 between events, dense, modes by enumeration"
    )
