"""Constraints as blocks of rows in the core's program."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import singledispatch
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import (
    Distance,
    FrameAnchor,
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
    Rolling,
    UserConstraint,
)
from pin_nonideal.description.contacts import UserContact
from pin_nonideal.description.time_functions import Constant
from pin_nonideal.errors import InputError, UnknownNameError, short_repr
from pin_nonideal.types import Array, PinocchioConstraint
from pin_nonideal.validation import axis_triad, unit_axis

from .callbacks import breaks, checked_function, time_function
from .resolver import Frame, Resolver, placed_on, words

# Largest denominator of a rational gear ratio for which the coupled angle of endless joints is constrained.
MAX_GEAR = 64
# A ratio within this distance of a fraction is treated as that fraction.
GEAR_ROUNDING = 1e-12
# Step of central differences in time, relative to max(1 s, |t|), and their weights, of tenth order: a
# compromise between rounding and curvature. The error is 4e-13 of the residual up to 100 rad/s.
TIME_DIFFERENCE = 8e-4
DIFFERENCE_WEIGHTS = (5.0 / 6.0, -5.0 / 21.0, 5.0 / 84.0, -5.0 / 504.0, 1.0 / 1260.0)


@singledispatch
def lower_constraint(c: PinocchioConstraint, name: str, out: core.Builder, resolver: Resolver) -> None:
    """Add one constraint to the program: a description of this package, or a constraint model of Pinocchio.

    Args:
        c: the description.
        name: its unique name.
        out: the program under construction.
        resolver: frames and joints by name.

    Raises:
        InputError, UnknownNameError: a frame or joint does not exist, or the description does not fit the
        model.
    """
    kind = type(c).__name__
    known = ("RigidConstraintModel", "PointAnchorConstraintModel", "FrameAnchorConstraintModel")
    if kind not in known:
        raise InputError(
            f"a constraint must be one of this package's or of Pinocchio's {', '.join(known)}; "
            f"got {short_repr(c)}"
        )
    f1, f2 = frames_of(c, resolver, kind)
    if kind == "PointAnchorConstraintModel" or (
        kind == "RigidConstraintModel" and c.type == pin.ContactType.CONTACT_3D
    ):
        out.add_point(name, f1, f2, axes=[0, 1, 2])
    else:
        out.add_frame(name, f1, f2)


def frames_of(c: PinocchioConstraint, resolver: Resolver, who: str) -> tuple[Frame, Frame]:
    """Return both frames of an anchor, or of a constraint model of Pinocchio.

    Args:
        c: the description.
        resolver: frames and joints by name.
        who: prefix of error messages.
    """
    if hasattr(c, "joint1_placement"):
        return placed_on(c.joint1_id, c.joint1_placement), placed_on(c.joint2_id, c.joint2_placement)
    return resolver.pair(c, who)


@lower_constraint.register
def _(c: PointAnchor, name: str, out: core.Builder, resolver: Resolver) -> None:
    f1, f2 = resolver.pair(c, words(c, name))
    axes = ["xyz".index(a) for a in c.axes]
    out.add_point(name, f1, f2, axes=axes)


@lower_constraint.register
def _(c: FrameAnchor, name: str, out: core.Builder, resolver: Resolver) -> None:
    f1, f2 = resolver.pair(c, words(c, name))
    out.add_frame(name, f1, f2)


@lower_constraint.register
def _(c: HingeAnchor, name: str, out: core.Builder, resolver: Resolver) -> None:
    who = words(c, name)
    f1, f2 = resolver.pair(c, who)
    t1, t2, u = axis_triad(resolver.hinge_axis(c, who))
    normal1 = [-x for x in t2]
    out.add_hinge(name, f1, f2, axis=u, normal1=normal1, normal2=t1)


@lower_constraint.register
def _(c: Distance, name: str, out: core.Builder, resolver: Resolver) -> None:
    who = words(c, name)
    f1, f2 = resolver.pair(c, who)
    length = c.length
    if length is None:
        gap = float(np.linalg.norm(resolver.in_world(f1).translation - resolver.in_world(f2).translation))
        if gap == 0.0:
            raise InputError(f"{who}: the frames start at the same place; a distance must be positive")
        length = Constant(gap)
    elif not callable(length):
        length = Constant(length)
    out.add_breaks(breaks(length, who))
    out.add_distance(name, f1, f2, length=time_function(length, who))


@lower_constraint.register
def _(c: JointCoupling, name: str, out: core.Builder, resolver: Resolver) -> None:
    who = words(c, name)
    j1, j2 = resolver.joint(c.joint1, who), resolver.joint(c.joint2, who)
    endless = [resolver.model.joints[j].nq == 2 for j in (j1, j2)]
    period, position = 0.0, True
    turn = 2.0 * math.pi
    if endless[0] and endless[1]:
        from fractions import Fraction

        gear = Fraction(c.ratio).limit_denominator(MAX_GEAR)
        position = abs(float(gear) - c.ratio) < GEAR_ROUNDING
        period = turn / gear.denominator
    elif endless[0]:
        period = turn
    elif endless[1]:
        period = turn * abs(c.ratio)
    out.add_coupling(name, j1, j2, ratio=c.ratio, offset=c.offset, period=period, position=position)


@lower_constraint.register
def _(c: PrescribedMotion, name: str, out: core.Builder, resolver: Resolver) -> None:
    who = words(c, name)
    joint = resolver.joint(c.joint, who)
    period = 2.0 * math.pi if resolver.model.joints[joint].nq == 2 else 0.0
    out.add_breaks(breaks(c.function, who))
    out.add_motion(name, joint, function=time_function(c.function, who), period=period)


@lower_constraint.register
def _(c: KnifeEdge, name: str, out: core.Builder, resolver: Resolver) -> None:
    who = words(c, name)
    frame = resolver.frame(c.frame, who)
    out.add_knife_edge(name, frame, axis=unit_axis(who, c.axis))


@lower_constraint.register
def _(c: Rolling, name: str, out: core.Builder, resolver: Resolver) -> None:
    who = words(c, name)
    plane = resolver.plane(c.plane, who)
    frame = resolver.frame(c.frame, who)
    t1, t2, n = axis_triad(unit_axis(who, c.normal))
    sphere = c.axis is None
    axis = (0.0, 0.0, 1.0) if c.axis is None else unit_axis(who, c.axis)
    out.add_rolling(
        name,
        frame,
        plane,
        radius=c.radius,
        sphere=sphere,
        axis=axis,
        tangent1=t1,
        tangent2=t2,
        normal=n,
    )


@lower_constraint.register
def _(c: UserConstraint, name: str, out: core.Builder, resolver: Resolver) -> None:
    who = words(c, name)
    rows = user_rows(c, c.size, who, resolver)
    residual = None if c.residual is None else checked_function(c.residual, f"{who}: residual", (c.size,))
    rate = user_rate(c, c.size, who, rows, residual)
    out.add_user(name, c.size, rows=rows, residual=residual, rate=rate)


def user_rows(c: UserConstraint | UserContact, size: int, who: str, resolver: Resolver) -> Callable[..., Any]:
    """Wrap the user's rows as a function of (t, q, v) that computes Pinocchio's data for them.

    Args:
        c: the description.
        size: number of rows.
        who: prefix of error messages.
        resolver: resolver of the model.
    """
    model = resolver.model
    function = checked_function(c.function, f"{who}: function", (size, model.nv), (size,))
    if getattr(c.function, "needs_data", True) is False:  # functions of this package that need q and v only
        return lambda t, q, v: function(t, q, v, None)
    local = threading.local()

    def rows(t: float, q: Array, v: Array) -> object:
        if not hasattr(local, "data"):
            local.data = model.createData()
        data = local.data
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data)
        pin.updateFramePlacements(model, data)
        return function(t, q, v, data)

    return rows


def user_rate(
    c: UserConstraint | UserContact,
    size: int,
    who: str,
    rows: Callable[..., Any],
    residual: Callable[..., Array] | None,
) -> Callable[..., Array] | None:
    """Return the user's rate, or A v plus a time difference of the residual, or None without a residual.

    Args:
        c: the description.
        size: number of rows.
        who: prefix of error messages.
        rows: result of `user_rows`.
        residual: checked function of (t, q).
    """
    if c.rate is not None:
        return checked_function(c.rate, f"{who}: rate", (size,))
    if residual is None:
        return None

    def rate(t: float, q: Array, v: Array) -> Array:
        step = TIME_DIFFERENCE * max(1.0, abs(t))
        moving = sum(
            weight / step * (residual(t + k * step, q) - residual(t - k * step, q))
            for k, weight in enumerate(DIFFERENCE_WEIGHTS, 1)
        )
        result: Array = rows(t, q, v)[0] @ v + moving
        return result

    return rate


def anchor_frames(
    constraints: Sequence[tuple[str, object]], resolver: Resolver
) -> list[tuple[str, int, int | None]]:
    """Return (name, frame id, frame id or None for the world) of constraints between two indexed frames.

    Args:
        constraints: names and descriptions.
        resolver: frames and joints by name.
    """
    frames: list[tuple[str, int, int | None]] = []
    for name, c in constraints:
        if isinstance(c, (PointAnchor, FrameAnchor, HingeAnchor, Distance)):
            with suppress(UnknownNameError):  # a joint without a frame
                second = None if c.frame2 is None else resolver.frame_id(c.frame2, "")
                frames.append((name, resolver.frame_id(c.frame1, ""), second))
    return frames
