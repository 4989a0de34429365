"""Torques of single joints that dry friction holds at rest, and torques that move them slowly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.states.rows import MIN_SINGULAR_VALUE
from pin_nonideal.types import Array

from .limit_cones import LimitCones
from .residual import AtRest

# Tolerance of the ends of a band relative to the largest force, and maximum number of iterations to an end.
BAND_TOL, MAX_PASSES = 1e-12, 60
# Torque, relative to the largest force, beyond which friction counts as growing without bound.
UNBOUNDED_TORQUE = 1e9
# Velocity at which slip of several directions is evaluated, relative to the unit motion of the joint.
SLIP_VELOCITY = 1e-8


@dataclass(frozen=True)
class HoldingTorque:
    """Torques of one joint at rest, with the torques of all other joints unchanged.

    For any torque of the drive within the band [low, high] the whole scene stays at rest. A torque beyond the
    band moves some body. The ends belong to the static limits of friction. Slow motion is the motion of least
    norm that the constraints admit, with vanishing speed, without acceleration and with sliding friction. The
    torque of slow motion differs from the end of the band by the static ratio only, if nothing else limits
    the band. A joint locks itself if its band contains the torque zero. Effort limits of the drive do not
    count.

    Attributes:
        low: smallest torque that holds [N m or N]; -inf without bound, and NaN if no torque of this joint
            alone holds the scene.
        high: largest torque that holds [N m or N]; inf without bound, and NaN if no torque holds.
        lowering: torque for slow motion in the negative direction [N m or N]; -inf if friction grows as fast
            as the torque, and NaN if the constraints admit no motion or the motion is not determined.
        raising: torque for slow motion in the positive direction [N m or N]; inf if friction grows as fast as
            the torque, and NaN as for `lowering`.
    """

    low: float
    high: float
    lowering: float
    raising: float

    @property
    def band(self) -> tuple[float, float]:
        """Smallest and largest torque that holds, (low, high) [N m or N]."""
        return self.low, self.high


def holding_torques(
    compiled: CompiledScene,
    q: Array,
    tau: Array,
    t: float,
    open_rows: NDArray[np.bool_],
    dofs: list[int] | None = None,
) -> dict[str, HoldingTorque]:
    """Return the holding torques of each joint of one degree of freedom that a law of dry friction acts on.

    Args:
        compiled: the compiled scene.
        q: configuration on the constraints, (nq,).
        tau: torques of all drives, (nv,).
        t: time [s].
        open_rows: mask of rows of open contacts, (m,).
        dofs: driven degrees of freedom; all when None.
    """
    at_rest = AtRest(compiled, tau, t, q)
    at_rest.open = open_rows
    return {
        name: _Joint(at_rest, q, tau, dof).holding()
        for name, dof in _friction_joints(at_rest, q).items()
        if dofs is None or dof in dofs
    }


def _friction_joints(at_rest: AtRest, q: Array) -> dict[str, int]:
    """Return the degree of freedom of each joint with one freedom that a law of dry friction acts on.

    Friction of contacts and rolling bodies widens the bands, but belongs to no joint.
    """
    program, model = at_rest.program, at_rest.compiled.model
    if not len(program.element_sizes):
        return {}
    D = np.abs(at_rest.directions(q)[0])
    acts, first = np.zeros(model.nv, dtype=bool), 0
    for law, size in zip(program.element_laws, program.element_sizes, strict=True):
        own = D[first : first + size]
        first += size
        if law < len(at_rest.compiled.spec.laws):  # laws come before the friction of contacts
            acts |= (own > MIN_SINGULAR_VALUE * own.max(axis=1, initial=0.0, keepdims=True)).any(axis=0)
    return {
        str(model.names[j]): int(model.idx_vs[j])
        for j in range(1, model.njoints)
        if model.nvs[j] == 1 and acts[model.idx_vs[j]]
    }


class _Ends(NamedTuple):
    """Ends of a band under the friction limits at one torque, and these limits, (ne,)."""

    low: float
    high: float
    limits: Array

    def at(self, side: int) -> float:
        """Return the low end for side 0, the high end for side 1."""
        return self.high if side else self.low


class _Joint:
    """Torques of one joint, with the torques of all others unchanged."""

    def __init__(self, at_rest: AtRest, q: Array, tau: Array, dof: int) -> None:
        self.rest, self.q, self.tau, self.dof = at_rest, q, tau, dof
        self.known: dict[float, _Ends] = {}
        self.scale = 0.0

    def holding(self) -> HoldingTorque:
        low, high = self.band()
        ways = (self.slow_torque(sign) for sign in (-1.0, 1.0))
        return HoldingTorque(low, high, *ways)

    # --- Band -----------------------------------------------------------------------------------------------

    def band_at(self, x: float) -> _Ends:
        """Return the ends of the band under the friction limits at one torque, and these limits."""
        if x not in self.known:
            torque = self.tau.copy()
            torque[self.dof] = x
            self.rest.tau = torque
            cones = LimitCones(self.rest, self.q, self.dof)
            # Effort limits may have changed the torque that acts.
            acting = float((self.rest.forces(self.q) - self.rest.undriven(self.q))[self.dof])
            low, high = cones.span()
            self.scale = self.scale or float(cones.unit / cones.lengths[-1])
            self.known[x] = _Ends(acting + low, acting + high, cones.constant)
        return self.known[x]

    def band(self) -> tuple[float, float]:
        """Return the smallest and the largest torque that holds, or NaN."""
        try:
            inside = self.holding_torque()
            if inside is None:
                return math.nan, math.nan
            return self.consistent_end(inside, 0), self.consistent_end(inside, 1)
        except core.CoreFailure:
            return math.nan, math.nan

    def holding_torque(self) -> float | None:
        """Return a torque that holds, or None. Friction limits may depend on the torque."""
        own = float(self.tau[self.dof])
        self.band_at(own)  # sets the scale
        for start in (own, 0.0, self.scale, -self.scale):
            x = start
            for _ in range(MAX_PASSES):
                low, high, _ = self.band_at(x)
                if low <= x <= high:
                    return x
                if math.isnan(low):
                    break
                both = math.isfinite(low) and math.isfinite(high)
                x = 0.5 * (low + high) if both else min(max(x, low), high)
        return None

    def consistent_end(self, inside: float, side: int) -> float:
        """Return an end x of the band that equals the end under the friction limits at x."""
        sign = (-1.0, 1.0)[side]
        within = inside
        for k in range(MAX_PASSES):
            x, limits = self.band_at(within).at(side), self.band_at(within).limits
            if not math.isfinite(x) or abs(x - within) <= BAND_TOL * (self.scale + abs(x)):
                return x
            if self.same_limits(x, limits):
                return x
            there = self.band_at(x).at(side)
            if not sign * (there - x) >= 0.0:
                return self.bisect_end(within, x)
            within = x
            if k == 0:
                far = inside + sign * UNBOUNDED_TORQUE * self.scale
                if sign * (self.band_at(far).at(side) - far) >= 0.0:
                    return sign * math.inf
        return self.bisect_end(within, inside + sign * UNBOUNDED_TORQUE * self.scale)

    def same_limits(self, x: float, limits: Array) -> bool:
        """Check if the friction limits at a torque are the given ones."""
        return bool(
            np.allclose(self.band_at(x).limits, limits, rtol=BAND_TOL, atol=BAND_TOL * (self.scale + abs(x)))
        )

    def bisect_end(self, within: float, outside: float) -> float:
        """Return the end of the band between a torque that holds and one that does not, by bisection."""
        for _ in range(2 * MAX_PASSES):
            middle = 0.5 * (within + outside)
            low, high, _ = self.band_at(middle)
            if low <= middle <= high:
                within = middle
            else:
                outside = middle
            if abs(outside - within) <= BAND_TOL * (self.scale + abs(within)):
                break
        return within

    # --- Slow motion ----------------------------------------------------------------------------------------

    def slow_torque(self, sign: float) -> float:
        """Return the torque at which slow motion in one direction needs no other force."""
        direction = self.slow_direction(sign)
        if direction is None:
            return math.nan
        way, opens = direction
        modes, several = self.modes(way)
        speed = SLIP_VELOCITY * way if several or opens else self.rest.still
        torque = self.tau.copy()

        def power(x: float) -> float:
            """Power of all forces along the motion; the power rises with sign times the torque."""
            torque[self.dof] = x
            now = self.rest.runner.solve(self.q, speed, self.rest.t, torque, modes, frozen=True)
            clipped = x - float((now.F - undriven)[self.dof])
            return float((now.F + now.C) @ way + clipped * way[self.dof])

        try:
            undriven = self.rest.runner.solve(
                self.q, speed, self.rest.t, self.rest.still, modes, frozen=True
            ).F
            return _root(power, float(self.tau[self.dof]), sign, self.scale or 1.0)
        except core.CoreFailure:
            return math.nan

    def slow_direction(self, sign: float) -> tuple[Array, bool] | None:
        """Return the motion of least norm with unit rate of the joint, and whether it opens a contact.

        Contacts stay closed if the joint can move with closed contacts. The result is None if the constraints
        admit no motion.
        """
        way = self._least_motion(sign)
        if way is not None or not self.rest.gaps.any():
            return None if way is None else (way, False)
        closed, before = self.rest.gaps & ~self.rest.open, self.rest.open
        rows = self.rest.rows(self.q)[closed]
        self.rest.open = self.rest.gaps
        try:
            way = self._least_motion(sign)
        finally:
            self.rest.open = before
        if way is None or (rows @ way < -MIN_SINGULAR_VALUE).any():
            return None
        return way, True

    def _least_motion(self, sign: float) -> Array | None:
        free = self.rest.free(self.q)
        own = free[self.dof]
        part = float(own @ own)
        return None if part <= MIN_SINGULAR_VALUE else np.asarray(sign * (free @ own) / part)

    def modes(self, way: Array) -> tuple[list[core.Mode], bool]:
        """Return the modes of all elements in a motion, and whether one with several directions slips."""
        rows = self.rest.directions(self.q)[0]
        sizes = list(self.rest.program.element_sizes)
        slip, first, modes, several = rows @ way, 0, [], False
        quiet = MIN_SINGULAR_VALUE * (1.0 + float(np.abs(way).max()))
        limits = self.limits()
        for e, size in enumerate(sizes):
            own = slip[first : first + size]
            first += size
            if np.linalg.norm(own) <= quiet:
                modes.append(core.Mode.sticking if limits[e] > 0.0 else core.Mode.unloaded)
                continue
            backward = size == 1 and own[0] < 0.0
            modes.append(core.Mode.slip_minus if backward else core.Mode.slip_plus)
            several |= size > 1
        return modes, several

    def limits(self) -> Array:
        """Return the static limits of all elements, zero for elements that carry no load, (ne,)."""
        self.rest.tau = self.tau
        stuck = [core.Mode.sticking] * len(self.rest.program.element_sizes)
        try:
            return np.array(
                self.rest.runner.solve(
                    self.q, self.rest.still, self.rest.t, self.tau, stuck, frozen=True
                ).limits
            )
        except core.CoreFailure:
            return np.ones(len(stuck))


def _root(power: Callable[[float], float], start: float, sign: float, scale: float) -> float:
    """Return the torque with zero power, infinite if there is none; the power rises along sign * torque."""
    from scipy.optimize import brentq

    at = power(start)
    if at == 0.0:
        return start
    # Without friction that depends on the load the power is linear, and this is the torque.
    x = start - sign * at
    step = abs(at) if at else scale
    toward = -sign if at > 0.0 else sign
    for _ in range(MAX_PASSES):
        there = power(x)
        if abs(there) <= BAND_TOL * (scale + abs(x)) * 0.01:
            return x
        if (there > 0.0) != (at > 0.0):
            return float(brentq(power, start, x, xtol=BAND_TOL * scale, rtol=4.0 * np.finfo(float).eps))
        step *= 2.0
        x = start + toward * step
        if abs(x) > UNBOUNDED_TORQUE * (scale + abs(start)):
            break
    return math.copysign(math.inf, toward)
