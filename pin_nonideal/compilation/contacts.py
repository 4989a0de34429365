"""Contacts as blocks of rows in the core's program."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import get_args

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts import (
    BoxContact,
    CapsuleContact,
    Contact,
    JointLimit,
    PointContact,
    SphereContact,
    UserContact,
)
from pin_nonideal.description.contacts.pair_of_shapes import BallContacts, CapsulePairs, ContactGroup
from pin_nonideal.description.contacts.point_names import ContactOfPoint
from pin_nonideal.description.contacts.solids import (
    CylinderContact,
    EllipsoidContact,
    HullContact,
    RevolvedContact,
    RimContact,
)
from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.types import Model

from .callbacks import checked_function
from .constraints import user_rate, user_rows
from .contact_groups import STOPS
from .resolver import Resolver, rotated_frame, words

RoundContact = HullContact | BoxContact | RevolvedContact | SphereContact | CapsuleContact

# Value of Pinocchio for joints without limits [rad or m].
NO_LIMIT = np.finfo(float).max


def lower_contacts(
    contacts: Sequence[tuple[str, Contact | BallContacts | CapsulePairs]],
    contact_of: ContactOfPoint,
    out: core.Builder,
    resolver: Resolver,
) -> Iterator[tuple[str, Contact | BallContacts | CapsulePairs, int]]:
    """Add the normal rows of all contacts; `lower_contact_friction` adds their friction after all rows.

    Bilateral contacts are added before unilateral contacts. Their rows are in the order of the descriptions.

    Args:
        contacts: unique names and descriptions; a `ContactGroup` has the name of its first contact.
        contact_of: contact of each point of the pairs of shapes with several points.
        out: the program under construction.
        resolver: frames and joints by name.

    Yields:
        Name, description and first block of each added contact.

    Raises:
        InputError, UnknownNameError: a frame or joint does not exist, or the description does not fit the
        model.
    """
    kinds = (*get_args(Contact), ContactGroup)
    for name, c in contacts:
        if not isinstance(c, kinds):
            known = ", ".join(kind.__name__ for kind in get_args(Contact))
            raise InputError(f"a contact must be one of {known}; got {short_repr(c)}")
        if isinstance(c, JointLimit):
            _check_limit(c, words(c, name), resolver)
    blocks: dict[int, Sequence[int]] = {}
    for opens in (False, True):
        for i, (name, c) in enumerate(contacts):
            if getattr(c, "unilateral", True) is opens:
                blocks[i] = lower_gaps(c, name, out, resolver)
                yield name, c, blocks[i][0]
    pairs: dict[str, int] = {}
    pair_of = []
    for name, _ in contacts:
        pair = contact_of.get(name)
        pair_of.append(-1 if pair is None else pairs.setdefault(pair, len(pairs)))
    out.order_contacts(
        [block for i in range(len(contacts)) for block in blocks[i]],
        [pair_of[i] for i in range(len(contacts)) for _ in blocks[i]],
    )


def lower_gaps(
    c: Contact | BallContacts | CapsulePairs, name: str, out: core.Builder, resolver: Resolver
) -> Sequence[int]:
    """Add the normal rows of one contact and return the indices of its blocks.

    Args:
        c: the description, or a group of contacts.
        name: its unique name.
        out: the program under construction.
        resolver: frames and joints by name.
    """
    if isinstance(c, CapsulePairs):
        like = c.like
        lines1, lines2 = resolver.capsule_pairs(c, words(like, name))
        radius = like.radius1 + like.radius2
        first = out.add_capsule_pairs(
            c.name, c.number, lines1=lines1, lines2=lines2, radius=radius, restitution=like.restitution
        )
        return range(first, first + len(c))
    if isinstance(c, BallContacts):
        (first,) = lower_gaps(c.like, name, out, resolver)
        out.repeat_contact(c.name, c.number + 1, frames1=resolver.other_balls(c, words(c.like, name)))
        return range(first, first + len(c))
    if isinstance(c, JointLimit):
        return _stops(c, name, out, resolver)
    if isinstance(c, PointContact):
        return [_on_plane(c, name, out, resolver)]
    if isinstance(c, UserContact):
        who = words(c, name)
        rows, gap = user_rows(c, 1, who, resolver), checked_function(c.gap, f"{who}: gap", (1,))
        block = out.add_user_gap(name, rows=rows, gap=gap, rate=user_rate(c, 1, who, rows, gap))
        out.set_unilateral(restitution=c.restitution)
        return [block]
    who = words(c, name)
    if isinstance(c, EllipsoidContact):
        f1, f2, (_, _, normal) = resolver.contact(c, who)
        axes = rotated_frame(f1, c.rpy)
        block = out.add_plane_ellipsoid(name, axes, f2, normal=normal, semiaxes=c.semiaxes)
    elif isinstance(c, CylinderContact):
        f1, f2, solid, half1 = resolver.cylinder(c, who)
        if half1 == 0.0:
            block = out.add_revolved(name, f1, f2, solid=solid, radius=c.radius1 + c.radius2)
        else:
            radius = c.radius1 + c.radius2
            block = out.add_capsule_cylinder(name, f1, f2, solid=solid, half1=half1, radius=radius)
    elif isinstance(c, RimContact):
        f1, f2, hull = resolver.rim(c, who)
        block = out.add_disk_hull(name, f1, f2, solid=hull, rim=c.rim, radius=c.radius2)
    else:
        block = _round_gap(c, name, who, out, resolver)
    out.set_unilateral(restitution=c.restitution)
    return [block]


def _round_gap(c: RoundContact, name: str, who: str, out: core.Builder, resolver: Resolver) -> int:
    """Add the row of a contact between two solids with rounding radii."""
    radius = c.radius1 + c.radius2
    if isinstance(c, HullContact):
        f1, f2, hull = resolver.hull(c, who)
        return out.add_hull(name, f1, f2, solid=hull, radius=radius)
    if isinstance(c, BoxContact):
        f1, f2, half = resolver.box(c, who)
        return out.add_box(name, f1, f2, solid=half, radius=radius)
    if isinstance(c, RevolvedContact):
        f1, f2, one, other = resolver.rims(c, who)
        return out.add_cylinder_cylinder(name, f1, f2, first=one, second=other, radius=radius)
    f1, f2, half1, half2 = resolver.capsules(c, who)
    return out.add_capsule_capsule(name, f1, f2, half1=half1, half2=half2, radius=radius)


def _on_plane(c: PointContact, name: str, out: core.Builder, resolver: Resolver) -> int:
    f1, f2, (_, _, normal) = resolver.contact(c, words(c, name))
    block = out.add_plane_point(name, f1, f2, normal=normal, radius=c.radius)
    if c.unilateral:
        out.set_unilateral(restitution=c.restitution)
    return block


def _stops(c: JointLimit, name: str, out: core.Builder, resolver: Resolver) -> list[int]:
    """Add the finite stops of a joint, "NAME lower" and "NAME upper"."""
    blocks = []
    for which, sign, bound in zip(STOPS, (1.0, -1.0), stops_of(c, name, resolver), strict=True):
        if math.isfinite(bound):
            blocks.append(
                out.add_limit(f"{name} {which}", resolver.joint(c.joint, name), bound=bound, sign=sign)
            )
            out.set_unilateral(restitution=c.restitution)
    return blocks


def stops_of(c: JointLimit, name: str, resolver: Resolver) -> tuple[float, float]:
    """Return the positions of the lower and upper stop [rad or m]; a missing stop is infinite.

    Args:
        c: the description.
        name: its unique name.
        resolver: frames and joints by name.
    """
    model, joint = resolver.model, resolver.joint(c.joint, words(c, name))
    at = model.joints[joint].idx_q
    lower = float(model.lowerPositionLimit[at]) if c.lower is None else c.lower
    upper = float(model.upperPositionLimit[at]) if c.upper is None else c.upper
    return (-math.inf if lower <= -NO_LIMIT else lower), (math.inf if upper >= NO_LIMIT else upper)


def has_stops(model: Model, at: int) -> bool:
    """Check if the model bounds a position on at least one side.

    Args:
        model: pinocchio.Model.
        at: index of the position in q.
    """
    return bool(model.lowerPositionLimit[at] > -NO_LIMIT or model.upperPositionLimit[at] < NO_LIMIT)


def _check_limit(c: JointLimit, who: str, resolver: Resolver) -> None:
    """Check that a joint has one position coordinate and ordered stops, at least one of them finite.

    Raises:
        InputError, UnknownNameError: see above.
    """
    joint = resolver.model.joints[resolver.joint(c.joint, who)]
    if joint.nq != 1:
        raise InputError(
            f'{who}: joint "{c.joint}" turns without end and has no stops; it is {joint.shortname()}'
        )
    lower, upper = stops_of(c, who, resolver)
    if not (math.isfinite(lower) or math.isfinite(upper)):
        raise InputError(f'{who}: the model gives joint "{c.joint}" no finite limits; give lower or upper')
    if not lower < upper:
        raise InputError(f"{who}: lower must be below upper; got {lower:g} and {upper:g}")
