"""Friction elements of contacts in the core's program: sliding, spinning and rolling."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import Rolling
from pin_nonideal.description.contacts import Contact, UserContact
from pin_nonideal.description.contacts.pair_of_shapes import BallContacts, CapsulePairs
from pin_nonideal.description.contacts.round import BoxContact
from pin_nonideal.description.contacts.solids import (
    CylinderContact,
    EllipsoidContact,
    HullContact,
    RevolvedContact,
    RimContact,
)
from pin_nonideal.errors import InputError, UserFunctionError
from pin_nonideal.types import Array

from .callbacks import checked_function, named_function
from .friction import LoweringContext
from .resolver import Frame, Resolver, rotated_frame, words

# Scales of random displacements from q0 [rad or m] at which a function is called for the shape of its result.
SAMPLE_DISPLACEMENTS = (0.0, 0.1, 1.0)


def has_friction(c: object) -> bool:
    """Check if a contact has sliding friction, or resists spinning or rolling.

    Args:
        c: description of a contact or of a rolling constraint.
    """
    return any(getattr(c, key, 0.0) > 0.0 for key in ("mu", "torsional", "rolling"))


def lower_contact_friction(
    c: Contact | BallContacts | CapsulePairs | Rolling,
    name: str,
    out: core.Builder,
    context: LoweringContext,
) -> None:
    """Add the friction elements of a contact: sliding, spinning about the normal, and rolling resistance.

    Args:
        c: description of a contact or of a rolling constraint, or a group of contacts.
        name: its unique name.
        out: the program under construction.
        context: names of the scene.
    """
    if not has_friction(c):
        return
    if isinstance(c, CapsulePairs):
        like = c.like
        lines1, lines2 = context.resolver.capsule_pairs(c, words(like, name))
        out.add_capsule_pair_friction(
            c.name,
            c.number,
            lines1=lines1,
            lines2=lines2,
            radius1=like.radius1,
            first=context.blocks[name],
            mu=like.mu,
            static_ratio=like.static_ratio,
        )
        return
    if isinstance(c, BallContacts):
        lower_contact_friction(c.like, name, out, context)
        frames = context.resolver.other_balls(c, words(c.like, name))
        out.repeat_contact_friction(c.name, c.number + 1, frames1=frames)
        return
    law = out.add_law(name)
    slip = _user_slip if isinstance(c, UserContact) else _flat_slip if hasattr(c, "plane") else _round_slip
    elements = slip(c, name, out, context.resolver)
    for element, block, coefficient in elements:
        out.add_friction(
            law,
            block,
            name=element,
            load=core.Load.multiplier,
            reaction=core.Reaction.total,
            anchor=context.blocks[name],
            row=2 if isinstance(c, Rolling) else 0,
            mu=coefficient,
            static_ratio=getattr(c, "static_ratio", 1.0),
        )


def _round_slip(c: Any, name: str, out: core.Builder, resolver: Resolver) -> list[tuple[str, int, float]]:
    """Add the slip directions of a contact of two solids; return (name, block, coefficient)."""
    who = words(c, name)
    if isinstance(c, HullContact):
        f1, f2, hull = resolver.hull(c, who)
        return [(name, out.add_hull_slip(name, f1, f2, solid=hull, radius1=c.radius1), c.mu)]
    if isinstance(c, CylinderContact):
        f1, f2, solid, half1 = resolver.cylinder(c, who)
        if half1 == 0.0:
            return [(name, out.add_revolved_slip(name, f1, f2, solid=solid, radius1=c.radius1), c.mu)]
        block = out.add_capsule_cylinder_slip(name, f1, f2, solid=solid, half1=half1, radius1=c.radius1)
        return [(name, block, c.mu)]
    if isinstance(c, RimContact):
        f1, f2, hull = resolver.rim(c, who)
        return [(name, out.add_disk_hull_slip(name, f1, f2, solid=hull, rim=c.rim), c.mu)]
    if isinstance(c, RevolvedContact):
        f1, f2, one, other = resolver.rims(c, who)
        radii = {"radius1": c.radius1, "radius2": c.radius2}
        return [(name, out.add_cylinder_cylinder_slip(name, f1, f2, first=one, second=other, **radii), c.mu)]
    if isinstance(c, BoxContact):
        f1, f2, half = resolver.box(c, who)
        return [(name, out.add_box_slip(name, f1, f2, solid=half, radius1=c.radius1), c.mu)]
    f1, f2, half1, half2 = resolver.capsules(c, who)
    block = out.add_capsule_capsule_slip(name, f1, f2, half1=half1, half2=half2, radius1=c.radius1)
    return [(name, block, c.mu)]


def _user_slip(c: Any, name: str, out: core.Builder, resolver: Resolver) -> list[tuple[str, int, float]]:
    """Add slip directions that the user defines; return (name, block, coefficient)."""
    who, nv = f"{words(c, name)}: directions", resolver.model.nv
    shape = _shape_of_directions(named_function(c.directions, who), resolver)
    if shape not in ((1, nv), (2, nv)):
        raise InputError(f"{who} must return one or two rows of {nv} numbers each; got shape {shape}")
    function = checked_function(c.directions, who, shape)
    block = out.add_user_slip(name, shape[0], lambda t, q: function(t, q).ravel())
    return [(name, block, c.mu)]


def _shape_of_directions(directions: Callable[..., Array], resolver: Resolver) -> tuple[int, ...]:
    """Return the shape of the directions at q0, or near q0 if the function raises there."""
    generator = np.random.default_rng(5)
    for part in SAMPLE_DISPLACEMENTS:
        with suppress(UserFunctionError):
            move = part * generator.standard_normal(resolver.model.nv)
            return np.shape(directions(0.0, pin.integrate(resolver.model, resolver.q0, move)))
    return np.shape(directions(0.0, resolver.q0))


def _flat_slip(c: Any, name: str, out: core.Builder, resolver: Resolver) -> list[tuple[str, int, float]]:
    """Add the slip directions of a contact with a plane; return (name, block, coefficient) per element."""
    f1, f2, (t1, t2, n) = resolver.contact(c, words(c, name))
    if isinstance(c, EllipsoidContact):
        body, along = rotated_frame(f1, c.rpy), {"tangent1": t1, "tangent2": t2, "normal": n}
        return [(name, out.add_plane_ellipsoid_slip(name, body, f2, semiaxes=c.semiaxes, **along), c.mu)]
    level, sliding = _rotated_frame(f2, np.column_stack([t1, t2, n])), getattr(c, "mu", 0.0)
    elements = []
    if sliding:
        block = out.add_plane_point_slip(name, f1, f2, radius=c.radius, tangent1=t1, tangent2=t2, normal=n)
        elements.append((name, block, sliding))
    for part, coefficient, axes in (("torsional", c.torsional, [2]), ("rolling", c.rolling, [0, 1])):
        if coefficient:
            block = out.add_spin_slip(f"{name} {part}", f1, level, axes=axes)
            elements.append((f"{name} {part}", block, coefficient))
    return elements


def _rotated_frame(frame: Frame, axes: Array) -> Frame:
    """Return the frame with new axes, which are the columns of `axes` in the old axes."""
    joint, R, p = frame
    return joint, (np.reshape(R, (3, 3)) @ axes).ravel().tolist(), p
