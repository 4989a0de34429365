"""References: closed forms by quadrature where there is one freedom, published values, else dense mechanics.

None of them calls an algorithm of Pinocchio or of this package; `uncertainty` says how far to trust them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .dense import DenseTree

Array = NDArray[np.float64]

ROUNDING = 1e-13  # what sums of some hundred terms of order one lose


@dataclass(frozen=True)
class Reference:
    """Configuration at the end of a problem.

    Attributes:
        q: configuration.
        uncertainty: what its coordinates may be wrong by [rad or m].
        how: in words.
    """

    q: Array
    uncertainty: float
    how: str


# --- one freedom: t = integral of sqrt(I / (2 (E - V))) ----------------------------------------------------


def place_after(t: float, start: float, speed: Callable[[Array], Array], direction: float = 1.0) -> float:
    """The coordinate x at time t of a motion from `start` that never stops, with dx/dt = direction speed(x).

    Args:
        t: time [s].
        start: x at time zero.
        speed: positive speed at many places at once.
        direction: 1 or -1.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    step = 0.05  # of the panels; 24 nodes resolve a smooth integrand to rounding there
    x, left = start, t
    while True:
        half = 0.5 * direction * step
        duration = 0.5 * step * float(weights @ (1.0 / speed(x + half + half * nodes)))
        if duration > left:
            break
        x, left = x + direction * step, left - duration
    length = step * left / duration
    for _ in range(50):  # Newton, on the length of the last panel
        half = 0.5 * direction * length
        miss = 0.5 * length * float(weights @ (1.0 / speed(x + half + half * nodes))) - left
        move = miss * float(speed(np.array([x + direction * length]))[0])
        length -= move
        if abs(move) < 1e-15:
            break
    return x + direction * length


def four_bar_quadrature(problem: Any) -> Reference:
    """Crank-rocker in the x-z plane: angles from +x towards +z, closed by the cosine rule."""
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
        """Absolute angles of coupler and rocker, for the branch of this model (the rocker's tip above)."""
        gap = l1 * np.exp(1j * x) - ground  # from the rocker's pivot to the crank's tip
        d = np.abs(gap)
        y = np.angle(gap) - np.arccos((d**2 + l3**2 - l2**2) / (2.0 * d * l3))
        return np.angle(ground + l3 * np.exp(1j * y) - l1 * np.exp(1j * x)), y

    def energies(x: Array) -> tuple[Array, Array]:
        """Inertia about x, and potential."""
        w, y = angles(x)
        e1, e2, e3 = np.exp(1j * x), np.exp(1j * w), np.exp(1j * y)
        # l1 e1 + l2 e2 w' = l3 e3 y' across and along the coupler give both ratios of speeds.
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

    x = place_after(problem.duration, x0, speed, np.sign(rate0))
    w, y = angles(np.array([x]))
    q = np.array(problem.q0)
    start = angles(np.array([x0]))
    q[model.joints[crank].idx_q] = x
    q[model.joints[rocker].idx_q] += y[0] - start[1][0]
    turned = q[model.joints[coupler].idx_q] + w[0] - start[0][0] - (x - x0)
    q[model.joints[coupler].idx_q] = turned
    return Reference(q, ROUNDING * abs(x), "quadrature of the energy equation")


def n_four_bar_quadrature(problem: Any) -> Reference:
    """Cranks in parallel: I phi'^2 / 2 + P cos(phi) = E, uniform rods of 1 kg and 1 m (IFToMM A02)."""
    model = problem.model
    n = (model.nq - 1) // 2
    g = -model.gravity.linear[2]
    inertia, weight = (n + 1) / 3.0 + n, ((n + 1) / 2.0 + n) * g
    energy = 0.5 * inertia * problem.v0[0] ** 2 + weight
    x = place_after(problem.duration, 0.0, lambda x: np.sqrt(2.0 * (energy - weight * np.cos(x)) / inertia))
    q = np.array([x if name.startswith("crank") else -x for name in model.names if name != "universe"])
    return Reference(q, ROUNDING * abs(x), "quadrature of the energy equation")


def coulomb_swings(problem: Any) -> Reference:
    """I x'' = -P sin(x) - c sgn(x') from rest: swings by quadrature, turning points by the energy."""
    body, c, g = problem.model.inertias[1], float(problem.coulomb[0]), -problem.model.gravity.linear[2]
    weight = -body.mass * g * body.lever[2]
    inertia = body.mass * body.lever[2] ** 2 + body.inertia[1, 1]
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x, left = float(problem.q0[0]), problem.duration
    while weight * abs(np.sin(x)) > c:
        a, side = abs(x), np.sign(x)  # from a down to -b, friction acting upwards
        b = a
        for _ in range(100):  # weight (cos b - cos a) = c (a + b)
            b -= (weight * (np.cos(b) - np.cos(a)) - c * (a + b)) / (-weight * np.sin(b) - c)
        middle, half = 0.5 * (a - b), 0.5 * (a + b)

        def density(s: Array, middle: float = middle, half: float = half, a: float = a) -> Array:
            """dt/ds at x = middle + half cos(s), which removes both square roots."""
            x = middle + half * np.cos(s)
            work = 2.0 * weight * np.sin(0.5 * (a - x)) * np.sin(0.5 * (a + x)) - c * (a - x)
            return half * np.sin(s) / np.sqrt(2.0 * work / inertia)

        def passed(s: float, density: Callable[[Array], Array] = density) -> float:
            return 0.5 * s * float(weights @ density(0.5 * s * (1.0 + nodes)))

        if passed(np.pi) > left:
            low, high = 0.0, np.pi
            while high - low > 4e-16 * np.pi:
                s = 0.5 * (low + high)
                low, high = (s, high) if passed(s) < left else (low, s)
                if s in (low, high) and 0.5 * (low + high) in (low, high):
                    break
            return Reference(
                np.array([side * (middle + half * np.cos(low))]), 1e-13, "quadrature of each half swing"
            )
        x, left = -side * b, left - passed(np.pi)
    return Reference(np.array([x]), 1e-14, "turning points of the energy equation")


# --- published --------------------------------------------------------------------------------------------

# Quadrature of the energy with 30 digits; agrees with Test Set for IVP Solvers (Bari) to its 1e-9.
ANDREWS_END = {
    "beta": 15.8107711951537071, "theta": -15.7563710584118395, "gamma": 0.0408222401196458049,
    "phi": -0.534730116342079594, "delta": 0.524409965879954069, "omega": 0.534730116342079594,
    "epsilon": 1.04808074104193787,
}  # fmt: skip


def published_andrews(problem: Any) -> Reference:
    q = np.array(problem.q0)
    for name, value in ANDREWS_END.items():
        q[problem.model.joints[problem.model.getJointId(name)].idx_q] = value
    return Reference(q, 1e-11, "published quadrature of the energy equation")


# --- dense mechanics --------------------------------------------------------------------------------------


def dense_tree(problem: Any) -> DenseTree:
    """The problem's mechanics in `dense`, without its friction."""
    model = problem.model
    probe = DenseTree(model)
    probe.update(problem.q0, problem.v0)

    def place(name: str) -> tuple[int, Array]:
        frame = model.frames[model.getFrameId(name)]
        return frame.parentJoint, frame.placement.translation.copy()

    def ends(item: Any) -> tuple[int, Array, int, Array]:
        joint, point = place(item.frame1)
        if item.frame2 is None:
            return joint, point, 0, probe.point(joint, point)[0]
        return joint, point, *place(item.frame2)

    anchors = [(*ends(a), ["xyz".index(axis) for axis in a.axes]) for a in problem.anchors]
    springs = [(ends(s), s) for s in problem.springs]
    torque = np.zeros(model.nv) if problem.torque is None else problem.torque

    def forces(t: float, tree: DenseTree) -> Array:
        force = torque.copy()
        if problem.hold is not None:
            kp, kd = problem.hold
            force[6:] += kp[6:] * (problem.q0[7:] - tree.q[7:]) - kd[6:] * tree.v[6:]
        for (joint1, point1, joint2, point2), spring in springs:
            one, two = tree.point(joint1, point1), tree.point(joint2, point2)
            gap = one[0] - two[0]
            length = float(np.linalg.norm(gap))
            pull = spring.stiffness * (length - spring.rest_length)
            pull += spring.damping * float(gap @ (one[1] - two[1])) / length
            force -= (one[3] - two[3]).T @ (pull * gap / length)
        return force

    return DenseTree(model, anchors, forces)


def dense_motion(problem: Any) -> Reference:
    tree = dense_tree(problem)
    tight, _ = tree.motion(problem.q0, problem.v0, problem.duration, 1e-13)
    loose, _ = tree.motion(problem.q0, problem.v0, problem.duration, 1e-12)
    miss = float(np.abs(tight - loose).max())
    return Reference(tight, max(miss, ROUNDING), "SciPy DOP853 at 1e-13 on a dense KKT system")


def dense_friction(problem: Any) -> Reference:
    from .dense_friction import friction_motion

    tree = dense_tree(problem)
    rough = friction_motion(tree, problem, 0.01)
    fine = friction_motion(tree, problem, 0.004)
    miss = float(np.abs(rough - fine).max())
    return Reference(
        fine, max(miss, ROUNDING), "SciPy DOP853 at 1e-13 between events, dense, modes by enumeration"
    )
