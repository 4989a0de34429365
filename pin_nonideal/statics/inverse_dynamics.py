"""inverse_dynamics: torques for a given acceleration, with loop constraints and friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.core_loader import core
from pin_nonideal.errors import FrictionConvergenceError, InputError, short_repr
from pin_nonideal.scene.scene import Scene, compiled_scene, require_scene
from pin_nonideal.states.parsing import (
    find_joint,
    named_configuration,
    named_joint_values,
    named_velocity,
)
from pin_nonideal.states.rows import MIN_SINGULAR_VALUE, minimum_norm, rows_at
from pin_nonideal.types import Array, Model, State, Table
from pin_nonideal.validation import array, by_name, number, sequence

from .holding import HoldingTorque, holding_torques
from .residual import AtRest, weight

Limits = tuple[Array, Array]  # least and largest torque of each driven degree of freedom [N m or N]

# Tolerance of A a = b, relative to its terms.
ACCELERATION_TOL = 1e-6
ROUNDING = 1e-6  # acceleration scale without weight [m/s^2 or rad/s^2], multiplied by ACCELERATION_TOL
# Rounding error of a row, relative to its length and to the accelerations of all bodies in the metric of
# M^-1.
MOTION_ROUNDING = 1e-13
# Slip rates and slip accelerations below this fraction of 1 + the largest velocity or acceleration count as
# zero.
AT_REST = 1e-9
# Maximum number of iterations for load-dependent friction, and their relative tolerance.
MAX_PASSES, FRICTION_TOL = 200, 1e-13
DIFFERENCE_STEP = 1e-6  # step along the motion for the time derivative of slip rows [s]


@dataclass(frozen=True, eq=False)
class InverseDynamics:
    """Torques of a motion.

    Attributes:
        tau: torques of all degrees of freedom, zero if not actuated [N m or N], (nv,).
        lam: multipliers of all rows under these torques, (m,).
        left: largest generalized force that the torques cannot supply along the admissible motions; zero, up
            to rounding, if the torques suffice.
    """

    tau: Array
    lam: Array
    left: float
    _holding: Callable[[], dict[str, HoldingTorque]] = field(default=dict, repr=False)

    @cached_property
    def holding(self) -> dict[str, HoldingTorque]:
        """Torques that friction holds and torques of slow motion, by joint name, computed on first access.

        The joints are the actuated ones of one degree of freedom that a law of dry friction acts on. The
        other joints keep the torques `tau`. Empty unless v = 0 and a = 0.
        """
        return self._holding()

    def __getstate__(self) -> Table:
        return {**vars(self), "holding": self.holding, "_holding": dict}


def inverse_dynamics(
    scene: Scene,
    q: State,
    v: State,
    a: State,
    actuated: Sequence[str] | None = None,
    *,
    bounds: tuple[object, object] | Mapping[str, tuple[object, object]] | None = None,
    t: float = 0.0,
) -> InverseDynamics:
    """Compute the torques of least norm that give the scene the acceleration a.

    If joints are driven by forces and by torques, the norm multiplies forces by a lever arm: the root mean
    square radius of gyration of the driven joints.

    The torques satisfy free^T (M a - F - C - tau) = 0 along the motions `free` that the constraints admit.
    The torques act on the actuated joints only. Friction C follows from the reactions under these torques.
    The scene's actuation is ignored. A sticking element that stays at rest exerts no friction. At rest,
    `holding` has the band of torques around tau in which friction holds the scene. Contacts that are open, or
    that the motion opens, exert no force.

    Args:
        scene: the scene.
        q: configuration, (nq,) or by joint name, on the constraints.
        v: velocity, (nv,) or by joint name.
        a: acceleration, (nv,) or by joint name (zero for missing joints); it must satisfy the constraints.
        actuated: names of the driven joints; all when None.
        bounds: lower and upper torque limits: numbers, arrays of the actuated degrees of freedom, or by joint
            name, without limit for missing joints; or one table by joint name of such pairs.
        t: time [s].

    Returns:
        The InverseDynamics; `scene.acceleration(q, v, tau=result.tau)` returns a if `left` is zero.

    Raises:
        InputError: an argument does not fit, or a violates the constraints.
        UnknownNameError: a joint does not exist.
        FrictionConvergenceError: the iteration for load-dependent friction did not converge.
    """
    require_scene("inverse_dynamics", scene)
    model, still = scene.model, np.zeros(scene.model.nv)
    at = named_configuration(model, q, scene.q0, "inverse_dynamics: q")
    speed = named_velocity(model, v, scene.v0, "inverse_dynamics: v")
    acceleration = named_velocity(model, a, still, "inverse_dynamics: a")
    time = number("inverse_dynamics: t", t)
    dofs = _driven(model, actuated)
    limits = None if bounds is None else _bounds(model, bounds, dofs)
    rest = AtRest(compiled_scene(scene), still, time, at)
    return torques_of_motion(rest, at, speed, acceleration, dofs, scene.name, limits)


def torques_of_motion(
    rest: AtRest, q: Array, v: Array, a: Array, dofs: list[int], name: str, limits: Limits | None = None
) -> InverseDynamics:
    """Return the torques of a motion with the time and the contacts of `rest`, see `inverse_dynamics`."""
    A, b, _, rate = rows_at(rest.runner, q, v, rest.t)
    if len(A):
        allowed = _allowed_residual(rest, q, v, a, A, b)
        _open_contacts(rest, A, b, rate, a, allowed)
        _check_follows(rest, A, b, a, allowed)
    result = _Torques(rest, q, v, a, dofs).solve(limits, name)
    if v.any() or a.any():
        return result
    at_rest = rest.compiled, q, result.tau, rest.t, rest.open, dofs
    return replace(result, _holding=partial(holding_torques, *at_rest))


def _driven(model: Model, actuated: Sequence[str] | None) -> list[int]:
    """Return the degrees of freedom of the actuated joints."""
    if actuated is None:
        return list(range(model.nv))
    if isinstance(actuated, str):
        raise InputError(f"inverse_dynamics: actuated must be a list of joints; got {short_repr(actuated)}")
    joints = [
        find_joint(model, name, "inverse_dynamics: actuated") for name in sequence("actuated", actuated)
    ]
    return [int(model.idx_vs[j]) + k for j in joints for k in range(model.nvs[j])]


def _bounds(model: Model, bounds: object, dofs: list[int]) -> Limits:
    """Least and largest torque of each actuated degree of freedom."""
    pairs = by_name(bounds)
    if pairs is not None:
        for name, pair in pairs.items():
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                raise InputError(
                    f'inverse_dynamics: bounds of "{name}" must be a pair (least, largest); '
                    f"got {short_repr(pair)}"
                )
        bounds = tuple({name: pair[k] for name, pair in pairs.items()} for k in range(2))
    if not isinstance(bounds, (tuple, list)) or len(bounds) != 2:
        raise InputError(
            f"inverse_dynamics: bounds must be a pair (least, largest); got {short_repr(bounds)}"
        )

    def bound(k: int, others: float) -> Array:
        entry, what = bounds[k], f"bounds: {('least', 'largest')[k]}"
        if by_name(entry) is not None:
            return named_joint_values(model, entry, what, others)[dofs]
        if np.ndim(entry) == 0:
            return np.full(len(dofs), float(array(what, entry, ())))
        return array(what, entry, (len(dofs),))

    lower, upper = bound(0, -np.inf), bound(1, np.inf)
    if not (lower < upper).all():
        raise InputError("inverse_dynamics: bounds must leave room: each least torque below the largest")
    return lower, upper


def _allowed_residual(rest: AtRest, q: Array, v: Array, a: Array, A: Array, b: Array) -> Array:
    """Return the allowed residual of each row of A a = b, relative to its terms and to gravity, (m,)."""
    lengths = rest.scaled_rows(q, rest.root(q))[1]
    terms = np.abs(A) @ np.abs(a) + np.abs(b) + lengths * weight(rest.compiled.model) + ROUNDING
    rounding = MOTION_ROUNDING * lengths * _size_of_accelerations(rest.compiled.model, q, v, a)
    return np.asarray(ACCELERATION_TOL * terms + rounding)


def _size_of_accelerations(model: Model, q: Array, v: Array, a: Array) -> float:
    """Return the size of the accelerations of all bodies, weighted by their inertia [sqrt(kg) m/s^2].

    The square is sum m |a_c|^2 + max(I) (|alpha|^2 + |omega|^4), with the acceleration a_c of the center of
    mass, so steady rotation counts too.
    """
    data, square = model.createData(), 0.0
    pin.forwardKinematics(model, data, q, v, a)
    for body, speed, change in zip(model.inertias, data.v, data.a, strict=True):
        omega, alpha, lever = speed.angular, change.angular, body.lever
        center = change.linear + np.cross(alpha, lever)
        center += np.cross(omega, speed.linear + np.cross(omega, lever))
        spin = float(alpha @ alpha + (omega @ omega) ** 2)
        square += float(body.mass * center @ center + np.trace(body.inertia) * spin)
    return float(np.sqrt(square))


def _open_contacts(rest: AtRest, A: Array, b: Array, rate: Array, a: Array, allowed: Array) -> None:
    """Open the contacts whose gaps the motion opens, by their rate or by their acceleration A a - b."""
    if rest.gaps.any():
        rest.release((rate > AT_REST * (1.0 + np.abs(rate).max())) | (A @ a - b > allowed))


def _check_follows(rest: AtRest, A: Array, b: Array, a: Array, allowed: Array) -> None:
    """Raise InputError if an acceleration violates A a = b of a constraint or closed contact."""
    missed = np.where(rest.open, 0.0, np.abs(A @ a - b))
    if (missed > allowed).any():
        worst = int(np.argmax(missed / allowed))
        point = next(n for n, s in rest.compiled.slices.items() if s.start <= worst < s.stop)
        name = rest.compiled.contact(point)
        raise InputError(
            f'inverse_dynamics: a must satisfy the constraints, A a = b; "{name}" violates it by '
            f"{missed[worst]:.2g} (m/s^2 or rad/s^2); use a result of scene.acceleration, or solve for the "
            "dependent joints"
        )


class _Torques:
    """Torques of one motion, by iterations over load-dependent friction."""

    def __init__(self, rest: AtRest, q: Array, v: Array, a: Array, dofs: list[int]) -> None:
        self.rest, self.q, self.v, self.a, self.free = rest, q, v, a, rest.free(q)
        self.select = np.eye(len(v))[:, dofs]
        self.M = rest.mass(q)
        self.arms = rest.units(self.M, self.free, dofs)
        # Lengths of the unit torques in the metric of M^-1.
        self.lengths = np.sqrt(np.diag(np.linalg.inv(self.M))[dofs]) / self.arms
        self.modes, self.directions = self._modes()

    def _modes(self) -> tuple[list[Any], Array]:
        """Return modes and unit directions, from slip or from its acceleration at rest, (d,)."""
        runner, t, v, model = self.rest.runner, self.rest.t, self.v, self.rest.compiled.model
        rows = [
            runner.slip_rows(pin.integrate(model, self.q, s * DIFFERENCE_STEP * v), v, t).reshape(-1, len(v))
            for s in (-1.0, 0.0, 1.0)
        ]
        gained = (rows[2] - rows[0]) @ v / (2.0 * DIFFERENCE_STEP)
        slip, change = rows[1] @ v, rows[1] @ self.a + gained
        quiet = AT_REST * (1.0 + np.abs(v).max(initial=0.0))
        quiet_change = AT_REST * (1.0 + np.abs(self.a).max(initial=0.0))
        modes, directions, first = [], np.zeros(len(slip)), 0
        for size in self.rest.program.element_sizes:
            own = slice(first, first + size)
            first += size
            moving = np.linalg.norm(slip[own]) > quiet
            along = slip[own] if moving else change[own]
            if not moving and np.linalg.norm(along) <= quiet_change:
                modes.append(core.Mode.unloaded)
                continue
            directions[own] = along / np.linalg.norm(along)
            modes.append(core.Mode.slip_minus if size == 1 and along[0] < 0.0 else core.Mode.slip_plus)
        return modes, directions

    def _motion(self, tau: Array) -> core.Instant:
        """Solve Eq. (40) for given torques, with the modes and slip directions of the motion."""
        return self.rest.runner.solve(
            self.q, self.v, self.rest.t, tau, self.modes, directions=self.directions
        )

    def solve(self, limits: Limits | None, name: str) -> InverseDynamics:
        """Iterate torques of least norm, within their limits, until friction agrees with the reactions."""
        G = self.free.T @ self.select / self.arms
        root = np.linalg.cholesky(self.free.T @ self.M @ self.free)
        scaled = np.linalg.solve(root, G) / self.lengths
        moments = None if limits is None else (limits[0] * self.arms, limits[1] * self.arms)
        tau, before = np.zeros(len(self.v)), np.inf
        for _ in range(MAX_PASSES):
            now = self._motion(tau)
            undriven = now.F - tau + now.C  # forces without the torques
            needed = self.free.T @ (self.M @ self.a - undriven)
            u = _bounded_least_squares(scaled, np.linalg.solve(root, needed), self.lengths, moments)
            change = self.select @ (u / self.arms) - tau
            tau = self.select @ (u / self.arms)
            scale = float(
                np.abs(undriven).max(initial=0.0)
                + np.abs(tau).max(initial=0.0)
                + np.abs(self.M @ self.a).max()
            )
            size = float(np.abs(change).max(initial=0.0))
            if size <= FRICTION_TOL * scale or (size >= before and size <= 1e3 * FRICTION_TOL * scale):
                break
            before = size
        else:
            raise FrictionConvergenceError(
                f"inverse_dynamics: friction and torques did not converge in {MAX_PASSES} passes; the "
                f'friction of "{name}" depends too much on the torques here',
                element=", ".join(self.rest.compiled.elements.names),
            )
        lam = self._motion(tau).lam
        left = float(np.abs(self.free @ (G @ u - needed)).max(initial=0.0))
        rows = self.rest.compiled.multipliers.groups
        return InverseDynamics(tau, rows.sum(np.asarray(lam)), left)


def _bounded_least_squares(scaled: Array, needed: Array, lengths: Array, limits: Limits | None) -> Array:
    """Solve min |scaled (lengths u) - needed| for the u of least norm; active limits hold exactly."""
    u = minimum_norm(scaled, needed, lengths)
    if limits is None or ((limits[0] <= u) & (u <= limits[1])).all():
        return np.asarray(u)
    from scipy.optimize import lsq_linear

    lower, upper = limits
    left, values, right = np.linalg.svd(scaled, full_matrices=False)
    G = left @ (np.where(values > MIN_SINGULAR_VALUE, values, 0.0)[:, None] * right) * lengths
    weight = 1e4 * max(1.0, float(np.linalg.norm(G)))
    rows = np.vstack([weight * G, np.eye(G.shape[1])])
    near = lsq_linear(rows, np.append(weight * needed, np.zeros(G.shape[1])), limits, method="bvls").x
    room = 1e-9 * (upper - lower)
    free = (near > lower + room) & (near < upper - room)
    u = np.where(near <= lower + room, lower, np.where(near >= upper - room, upper, 0.0))
    u[free] = minimum_norm(scaled[:, free], needed - G[:, ~free] @ u[~free], lengths[free])
    return np.asarray(np.clip(u, lower, upper))
