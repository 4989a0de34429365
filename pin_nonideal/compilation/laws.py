"""Nonideal laws, and the friction of contacts, in the core's program."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from typing import Any, NamedTuple

import pinocchio as pin

from pin_nonideal.constraints import HingeAnchor, JointCoupling
from pin_nonideal.contacts import PointContact
from pin_nonideal.core import core
from pin_nonideal.errors import InputError, UnknownNameError, UserFunctionError, nearest
from pin_nonideal.laws import Drag, JointFriction, LuGre, SigmoidFriction, UserFriction, UserLaw
from pin_nonideal.types import Array

from .callbacks import ReactionNames, Reactions, checked
from .names import Resolution, words


class Surroundings(NamedTuple):
    """What a law may refer to.

    Attributes:
        where: frames and joints by name.
        constraints: descriptions of the constraints by name.
        reactions: names that the user's laws may ask reactions for.
    """

    where: Resolution
    constraints: dict[str, object]
    reactions: ReactionNames


@singledispatch
def lower_law(law: object, name: str, out: core.Builder, around: Surroundings) -> None:
    """Adds one law to the program.

    Args:
        law: the description.
        name: its unique name.
        out: the program under construction.
        around: what it may refer to.

    Raises:
        InputError, UnknownNameError: what it refers to does not exist or does not fit.
    """
    raise InputError(
        f"a law must be JointFriction, SigmoidFriction, LuGre, Drag, UserLaw or UserFriction; got {law!r}"
    )


def _rubbing_joint(name: str, who: str, around: Surroundings, *, freedoms: tuple[int, ...] = (1,)) -> int:
    """Index of a joint that a friction law may act on: one that moves, and is no mimic joint."""
    joint = around.where.joint(name, who, freedoms=freedoms)
    for c in around.constraints.values():
        if isinstance(c, JointCoupling) and c.joint1 == name and (c.name or "").endswith("mimic"):
            raise InputError(
                f'{who}: joint "{name}" is a mimic joint, driven by "{c.joint2}"; '
                f'put the friction on "{c.joint2}"'
            )
    return joint


@lower_law.register
def _(law: JointFriction, name: str, out: core.Builder, around: Surroundings) -> None:
    if law.joint in around.constraints and not around.where.model.existJointName(law.joint):
        _anchor_friction(law, name, out, around)
    else:
        _joint_friction(law, name, out, around)


@lower_law.register
def _(law: SigmoidFriction, name: str, out: core.Builder, around: Surroundings) -> None:
    joint = _rubbing_joint(law.joint, words(law, name), around)
    dof = around.where.model.joints[joint].idx_v
    out.add_sigmoid(out.add_law(name), dof, phi1=law.phi1, phi2=law.phi2, phi3=law.phi3)


@lower_law.register
def _(law: LuGre, name: str, out: core.Builder, around: Surroundings) -> None:
    joint = _rubbing_joint(law.joint, words(law, name), around)
    dof = around.where.model.joints[joint].idx_v
    out.add_lugre(
        out.add_law(name),
        dof,
        stiffness=law.stiffness,
        damping=law.damping,
        viscous=law.viscous,
        coulomb=law.coulomb,
        stiction=law.coulomb if law.stiction is None else law.stiction,
        stribeck_velocity=law.stribeck_velocity,
    )


@lower_law.register
def _(law: Drag, name: str, out: core.Builder, around: Surroundings) -> None:
    frame = around.where.frame(law.frame, words(law, name))
    out.add_drag(out.add_law(name), frame, coefficient=law.coefficient, exponent=law.exponent)


@lower_law.register
def _(law: UserLaw, name: str, out: core.Builder, around: Surroundings) -> None:
    nv, names = around.where.model.nv, around.reactions
    shapes = ((nv,), (law.states,)) if law.states else ((nv,),)
    function = checked(law.function, f"{words(law, name)}: function", *shapes)

    def call(t: float, q: Array, v: Array, view: core.ReactionView | None, *z: Array) -> Any:
        return function(t, q, v, None if view is None else Reactions(view, names), *z)

    reaction = core.Reaction[law.reaction or "none"]
    out.add_user_law(out.add_law(name), states=law.states, reaction=reaction, function=call)


@lower_law.register
def _(law: UserFriction, name: str, out: core.Builder, around: Surroundings) -> None:
    who, names = words(law, name), around.reactions
    direction = checked(law.direction, f"{who}: direction", (around.where.model.nv,))
    limit = checked(law.limit, f"{who}: limit", ())

    def bound(t: float, q: Array, v: Array, view: core.ReactionView) -> float:
        value = float(limit(t, q, v, Reactions(view, names)))
        if value < 0.0:
            raise UserFunctionError(f"{who}: limit must not be negative; got {value:g}")
        return value

    block = out.add_user_slip(name, direction)
    out.add_friction(
        out.add_law(name),
        block,
        load=core.Load.user,
        reaction=core.Reaction.total,
        user_limit=bound,
        static_ratio=law.static_ratio,
    )


def _joint_friction(law: JointFriction, name: str, out: core.Builder, around: Surroundings) -> None:
    """Friction in a joint of the tree."""
    where, constraints, who = around.where, around.constraints, words(law, name)
    model = where.model
    if not model.existJointName(law.joint) and constraints:
        known = [*list(model.names)[1:], *constraints]
        if not model.existFrame(law.joint, pin.FrameType.FIXED_JOINT):
            raise UnknownNameError(f'{who}: no joint or anchor "{law.joint}"{nearest(law.joint, known)}')
    joint = _rubbing_joint(law.joint, who, around, freedoms=(1, 3))
    load, axis = where.bearing(joint)
    if load is core.Load.none:
        raise InputError(
            f'{who}: joint "{law.joint}" must be revolute, prismatic, helical or spherical; '
            f"it is {model.joints[joint].shortname()}"
        )
    _check_radius(law, who, load)
    dof, count = model.joints[joint].idx_v, model.joints[joint].nv
    index = out.add_law(name)
    if law.viscous:
        out.add_viscous(index, law.viscous, dof=dof, count=count)
    if _is_dry(law):
        block = out.add_dof_slip(name, dof=dof, count=count)
        _dry_friction(law, out, index, block, load, axis, joint=joint)


def _anchor_friction(law: JointFriction, name: str, out: core.Builder, around: Surroundings) -> None:
    """Friction in a hinge that closes a loop."""
    anchor, who = around.constraints[law.joint], words(law, name)
    if not isinstance(anchor, HingeAnchor):
        raise InputError(
            f'{who}: "{law.joint}" is a {type(anchor).__name__}, which has no axis to rub about; '
            "use a HingeAnchor"
        )
    _check_radius(law, who, core.Load.revolute)
    f1, f2 = around.where.pair(anchor, who)
    axis = list(around.where.hinge_axis(anchor, who))
    block = out.add_hinge_slip(name, f1, f2, axis=axis)
    index = out.add_law(name)
    if law.viscous:
        out.add_viscous(index, law.viscous, block=block)
    if _is_dry(law):
        anchored = around.reactions.blocks[law.joint]
        _dry_friction(law, out, index, block, core.Load.revolute, axis, anchor=anchored)


def _check_radius(law: JointFriction, who: str, load: core.Load) -> None:
    """A coefficient without a radius would be no friction at all."""
    radii = {core.Load.revolute: ("radius", "axial_radius"), core.Load.spherical: ("radius",)}.get(load, ())
    if law.mu and radii and not any(getattr(law, key) for key in radii):
        needed = " or ".join(radii)
        raise InputError(
            f"{who}: mu needs a positive {needed} on a joint that turns, for torque = mu radius force"
        )


def _is_dry(law: JointFriction) -> bool:
    return bool(law.coulomb or law.preload or law.mu)


def _dry_friction(
    law: JointFriction,
    out: core.Builder,
    index: int,
    block: int,
    load: core.Load,
    axis: Sequence[float],
    *,
    joint: int = -1,
    anchor: int = -1,
) -> None:
    """The element that sticks and slips along a block, loaded by a joint or by the block of an anchor."""
    out.add_friction(
        index,
        block,
        load=load if law.mu else core.Load.none,
        reaction=core.Reaction[law.reaction if law.mu else "none"],
        joint=joint,
        anchor=anchor,
        axis=axis,
        constant=law.coulomb + law.preload,
        mu=law.mu,
        radius=law.radius,
        axial_radius=law.axial_radius,
        inverse_span=0.0 if law.span is None else 1.0 / law.span,
        static_ratio=law.static_ratio,
        stribeck_velocity=law.stribeck_velocity or 0.0,
    )


def lower_contact_friction(c: PointContact, name: str, out: core.Builder, around: Surroundings) -> None:
    """Adds the Coulomb friction along the plane of a contact.

    Args:
        c: the description.
        name: its unique name.
        out: the program under construction.
        around: what it may refer to.
    """
    if c.mu == 0.0:
        return
    f1, f2, (t1, t2, n) = around.where.contact(c, words(c, name))
    law = out.add_law(name)
    block = out.add_contact_slip(name, f1, f2, radius=c.radius, tangent1=t1, tangent2=t2, normal=n)
    out.add_friction(
        law,
        block,
        load=core.Load.contact,
        reaction=core.Reaction.total,
        anchor=around.reactions.blocks[name],
        mu=c.mu,
        static_ratio=c.static_ratio,
    )
