"""Parts of a run: events, counters, and records of one law, joint or frame."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.types import Array, Placement

from .missing_array import MissingArray


@dataclass(frozen=True, eq=False)
class Event:
    """Instant between two smooth intervals of the motion, such as an impact or a change of mode.

    Attributes:
        time: time of the event [s].
        kind: kind of the event. Friction elements: "stick", "slip", "reverse". Contacts and wheels: "pull" if
            the contact needs tension from this time on, for every distribution of its load. Clusters of
            events: "chatter" if time stepping bridges a cluster. Ambiguity: "several" if the laws also allow
            other motions from this time on, "paradox" if "moreau" continues from this time on through modes
            that allow no motion. Unilateral contacts: "impact" with an impulse, "touch_down" if a gap closes
            without an impulse or its rebounds end, "lift_off" if it opens. Joints with `EffortLimits`:
            "saturate" if the demand on a drive exceeds its limit, "desaturate" if it returns below.
            Prescribed motions and lengths: "jump" if the prescribed rate is discontinuous.
            Time stepping: "relaxed" of a contact if steps of "moreau" violate its laws from this time on.
        element: name of the law, contact, joint or constraint.
        impulse: impulse of an impact [N s], (3,), along the contact's normal, then along its slip directions,
            a sum over the points of a pair of shapes; for a jump (impulse, 0, 0) of the motion's row [N s or
            N m s].
        energy_change: change of the kinetic energy due to an impact at this contact [J], negative for a loss;
            for a jump, the work of the motion's impulse.
        v_minus: velocity before an impact or jump, (nv,).
        v_plus: velocity after an impact or jump, (nv,).
        miss: velocity by which a "relaxed" step violates the laws [m/s or rad/s].
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
        iterations: iterations of the implicit reaction equation.
        wall_s: wall time [s].
        motion: largest residual of the equation of motion, relative to the largest force of the scene; 0 in
            time stepping, and in scenes without friction and contacts.
        signorini: largest residual of w_n >= 0, f_n >= 0, f_n w_n = 0 of unilateral contacts, relative to the
            largest force of the scene. In time stepping the scale is that of `ConeResiduals`.
        coulomb: largest residual of |f_t| <= mu f_n and |f| <= limit.
        dissipation: largest residual of maximum dissipation.
        limited_by_rounding: accepted steps whose error exceeds the tolerances because of rounding in the
            accelerations; shorter steps would not reduce it.
        rounding: largest rounding error of an acceleration relative to the largest acceleration; 0 if it was
            not measured. This rounding is measured in runs of more than 20,000 adaptive steps of the core.
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    factorizations: int = 0
    projections: int = 0
    iterations: int = 0
    wall_s: float = 0.0
    motion: float = 0.0
    signorini: float = 0.0
    coulomb: float = 0.0
    dissipation: float = 0.0
    limited_by_rounding: int = 0
    rounding: float = 0.0


class _Record:
    """Record with a name, whose text states the shapes of its arrays instead of their numbers."""

    name: str

    def __repr__(self) -> str:
        shown = [entry.name for entry in fields(self) if entry.repr and entry.name != "name"]  # type: ignore[arg-type]
        parts = ", ".join(f"{name} {_size(getattr(self, name))}" for name in shown)
        return f'<{type(self).__name__} "{self.name}": {parts}>'


def _size(value: object) -> str:
    if isinstance(value, np.ndarray):
        return str(value.shape)
    if isinstance(value, MissingArray):
        return "not recorded"
    return str(len(value)) if isinstance(value, list) else repr(value)


@dataclass(frozen=True, eq=False, repr=False)
class LawRecord(_Record):
    """Force, power, limit and mode of one law over a run.

    Arrays that the run did not record are false in a condition; other uses raise an InputError.

    Attributes:
        name: name of the law.
        force: part of C in M a = F + C + A^T lam that belongs to the law, including sticking elements [N or N
            m], (nt, nv); record "laws".
        power: power of the force [W], (nt,); record "laws" or "power".
        limit: friction limit of the law's element, static if it sticks, else kinetic [N or N m], (nt,), or
            (nt, n) for a law of n elements, None without elements; record "laws" or "forces".
        mode: mode of the element, +1 or -1 for slip, 0 for stick, with the shape of `limit`, or None.
    """

    name: str
    force: Array
    power: Array
    limit: Array | None
    mode: NDArray[np.int8] | None
    _slip: Callable[[], Array | None] = field(default=lambda: None, repr=False)

    @functools.cached_property
    def slip_velocity(self) -> Array | None:
        """Slip velocity of the law's element [rad/s or m/s], (nt,), positive in mode +1.

        Laws of several directions, such as contacts in space, have the shape (nt, n). The value is None for a
        law without elements and for a run without a scene. The first access computes it.
        """
        return self._slip()


@dataclass(frozen=True, eq=False, repr=False)
class UserEventRecord(_Record):
    """Zeros of a function of the user.

    Attributes:
        name: name of the function.
        t: times of the zeros [s], (n,).
        q: configurations at these times, (n, nq).
        v: velocities at these times, (n, nv).
    """

    name: str
    t: Array
    q: Array
    v: Array


class Sample(SimpleNamespace):
    """Run at one instant: the recorded fields of a Trajectory, each without its first axis."""


@dataclass(frozen=True, eq=False, repr=False)
class JointRecord(_Record):
    """Motion of one joint over a run; arrays (nt,) for one degree of freedom, else (nt, n).

    Arrays that the run did not record are false in a condition; other uses raise an InputError.

    Attributes:
        name: name of the joint.
        q: configuration [rad or m]. The angle of an unbounded joint is continuous over full turns, as is the
            last number of a planar joint, (x, y, angle).
        v: velocity.
        a: acceleration; record "a".
        tau: torque or force of the actuation [N m or N]; record "tau" or "forces".
    """

    name: str
    q: Array
    v: Array
    a: Array
    tau: Array


@dataclass(frozen=True, eq=False, repr=False)
class ContactPoints(_Record):
    """Points of one contact over a run.

    Attributes:
        name: name of the contact.
        points: names of the k points; points of a pair of shapes are numbered.
        closed: whether each point is closed, (nt, k).
        gaps: gap of each point [m], (nt, k).
        places: position of each point in the world [m], (nt, k, 3).
        forces: normal force and friction at each point, in world axes, on the body on which the force of the
            contact acts [N], (nt, k, 3).
    """

    name: str
    points: list[str]
    closed: NDArray[np.bool_]
    gaps: Array
    places: Array
    forces: Array


@dataclass(frozen=True, eq=False, repr=False)
class ContactRecord(_Record):
    """Resultant of one contact over a run, of all of its contact points.

    Attributes:
        name: name of the contact.
        points: names of its contact points.
        bodies: names of the joints of the two bodies; "universe" is the world. The force acts on the first:
            the body of the contact's first frame, or for several points the later joint of the model.
        closed: whether a contact point is closed, (nt,).
        force: resultant of the normal forces and the friction, in world axes [N], (nt, 3).
        torque: moment of these forces about `center`, in world axes [N m], (nt, 3). This moment does not
            include torsional and rolling resistance.
        normal_force: sum of the normal forces [N], (nt,).
        center: center of pressure, the mean of the contact points weighted by their normal forces, in the
            world [m], (nt, 3); not a number without a normal force.
        gap: least gap of the points [m], (nt,).
    """

    name: str
    points: list[str]
    bodies: tuple[str, str]
    closed: NDArray[np.bool_]
    force: Array
    torque: Array
    normal_force: Array
    center: Array
    gap: Array


@dataclass(frozen=True, eq=False, repr=False)
class FrameRecord(_Record):
    """Motion of one frame over a run.

    Attributes:
        name: name of the frame.
        translation: position of the frame's origin in the world [m], (nt, 3).
        rotation: rotation matrix to world axes, (nt, 3, 3).
        velocity: linear velocity of the origin and angular velocity, in world axes [m/s; rad/s], (nt, 6), as
            Pinocchio's LOCAL_WORLD_ALIGNED.
    """

    name: str
    translation: Array
    rotation: Array
    velocity: Array

    @property
    def placement(self) -> list[Placement]:
        """Return the placement in the world, a pinocchio.SE3 for each sample."""
        import pinocchio as pin

        return [pin.SE3(R, p) for R, p in zip(self.rotation, self.translation, strict=True)]


def angles(pairs: Array, v: Array, t: Array) -> Array:
    """Return continuous angles of (cos, sin) pairs over full turns, (nt,).

    The number of full turns between two samples is chosen so that the change is nearest to the mean of both
    rates times the time difference.

    Args:
        pairs: cosines and sines, (nt, 2).
        v: rates of the angle [rad/s], (nt,).
        t: times [s], (nt,).
    """
    principal = np.arctan2(pairs[:, 1], pairs[:, 0])
    expected = 0.5 * (v[1:] + v[:-1]) * np.diff(t)
    turns = np.round((expected - np.diff(principal)) / (2.0 * np.pi))
    return np.asarray(principal + 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(turns)])[: len(t)])
