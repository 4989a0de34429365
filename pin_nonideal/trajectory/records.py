"""Parts of a run: its events and counters, and what belongs to one law, joint or frame."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.types import Array, Placement

LEDGER = ("kinetic", "potential", "total", "balance")  # columns of every ledger of energy


@dataclass(frozen=True, eq=False)
class Event:
    """Something that happened between two smooth stretches of motion.

    Attributes:
        time: when [s].
        kind: "stick", "slip" or "reverse" of a frictional element, "pull" of a contact or wheel that must
            pull from now on, however it shares its load with others, "chatter" where a cluster of events was
            bridged by time stepping, "several" from where on the laws allow other motions too, "paradox" from
            where on "moreau" goes through modes that allow none; of contacts that may open "impact" with an
            impulse, "touch_down" where one closes without, or its bouncing ends, and "lift_off" where one
            opens; of joints with `EffortLimits` "saturate" where a drive is asked for more than it has, and
            "desaturate" where it gives again what is asked; "jump" of a prescribed motion or length whose
            rate jumps; "relaxed" of a contact from where on steps of "moreau" miss its laws, because no forces
            meet them or none were found.
        element: name of the law, contact, joint or constraint.
        impulse: of an impact [N s], (3,): along the contact's normal, then along its directions of slip; of a
            jump (impulse, 0, 0), of the motion's row [N s or N m s].
        energy_change: kinetic energy that an impact gave at this contact [J], negative for a loss; of a jump
            the work of the motion's impulse.
        v_minus: velocity before an impact or jump, (nv,).
        v_plus: velocity after it, (nv,).
        miss: of "relaxed" the velocity by which the laws are missed [m/s or rad/s].
    """

    time: float
    kind: str
    element: str
    impulse: Array | None = None
    energy_change: float = 0.0
    v_minus: Array | None = None
    v_plus: Array | None = None
    miss: float = 0.0

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Event):
            return NotImplemented
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return all(np.array_equal(x, y) for x, y in pairs)

    def __hash__(self) -> int:
        return hash((self.time, self.kind, self.element))


@dataclass(frozen=True)
class Stats:
    """Counters of a run.

    Attributes:
        steps: accepted steps.
        rejected: rejected steps.
        evaluations: evaluations of Eq. (40).
        factorizations: factorizations of the constraint rows.
        projections: projections that moved the state.
        iterations: passes of the implicit reaction equation.
        wall_s: wall time [s].
        signorini: in time stepping the largest miss of w_n >= 0, f_n >= 0, f_n w_n = 0 of contacts that may
            open, as part of what is in play (`ConeResiduals`).
        coulomb: that of |f_t| <= mu f_n.
        dissipation: that of maximum dissipation.
        limited_by_rounding: accepted steps whose error was the rounding of the accelerations, beyond the
            tolerances: shorter steps would not have made it less.
        rounding: largest rounding of an acceleration, as part of the largest one, where it was measured (in
            runs of more than 20,000 adaptive steps of the core), else 0.
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    factorizations: int = 0
    projections: int = 0
    iterations: int = 0
    wall_s: float = 0.0
    signorini: float = 0.0
    coulomb: float = 0.0
    dissipation: float = 0.0
    limited_by_rounding: int = 0
    rounding: float = 0.0


@dataclass(frozen=True, eq=False)
class LawRecord:
    """What one law did over a run.

    Attributes:
        name: of the law.
        force: its part of C in M a = F + C + A^T lam, what sticks included [N or N m], (nt, nv), or None.
        power: of that force [W], (nt,), or None.
        limit: of its frictional element: static where it sticks, else kinetic [N or N m], (nt,), or
            (nt, n) of a law of n elements; None without any, or not recorded.
        mode: of its element, +1 or -1 for slip, 0 for stick, shaped alike, or None.
    """

    name: str
    force: Array | None
    power: Array | None
    limit: Array | None
    mode: NDArray[np.int8] | None


@dataclass(frozen=True, eq=False)
class UserEventRecord:
    """Where a function of the user was zero.

    Attributes:
        name: of the function.
        t: times [s], (n,).
        q: configurations there, (n, nq).
        v: velocities there, (n, nv).
    """

    name: str
    t: Array
    q: Array
    v: Array


class Sample(SimpleNamespace):
    """A run at one instant: the fields of a Trajectory that were recorded, each without its first axis."""


@dataclass(frozen=True, eq=False)
class JointRecord:
    """What one joint did over a run; arrays (nt,) of a joint of one degree of freedom, else (nt, n).

    Attributes:
        name: of the joint.
        q: its configuration [rad or m]; of an endless joint the angle, counted on over whole turns, and so
            the last number of a planar joint, (x, y, angle).
        v: its velocity.
        a: its acceleration, or None; record "a".
        tau: torque or force of the actuation in it [N m or N], or None; record "tau" or "forces".
    """

    name: str
    q: Array
    v: Array
    a: Array | None
    tau: Array | None


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """How one frame moved over a run.

    Attributes:
        name: of the frame.
        translation: place of its origin in the world [m], (nt, 3).
        rotation: its axes in the world, by columns, (nt, 3, 3).
        velocity: of its origin, then of its rotation, in world axes [m/s; rad/s], (nt, 6); Pinocchio's
            LOCAL_WORLD_ALIGNED.
    """

    name: str
    translation: Array
    rotation: Array
    velocity: Array

    @property
    def placement(self) -> list[Placement]:
        """Placement in the world, a pinocchio.SE3 for each sample."""
        import pinocchio as pin

        return [pin.SE3(R, p) for R, p in zip(self.rotation, self.translation, strict=True)]


def angles(pairs: Array, v: Array, t: Array) -> Array:
    """Angles of (cos, sin) pairs, counted on over whole turns, (nt,).

    Between two samples the angle changes by the whole turns that bring it nearest to the mean of both
    velocities times the time between.

    Args:
        pairs: (nt, 2).
        v: rate of the angle [rad/s], (nt,).
        t: times [s], (nt,).
    """
    principal = np.arctan2(pairs[:, 1], pairs[:, 0])
    expected = 0.5 * (v[1:] + v[:-1]) * np.diff(t)
    turns = np.round((expected - np.diff(principal)) / (2.0 * np.pi))
    return np.asarray(principal + 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(turns)])[: len(t)])
