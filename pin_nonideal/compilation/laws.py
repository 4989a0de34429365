"""Nonideal force laws in the core's program."""

from __future__ import annotations

from functools import singledispatch

from pin_nonideal.core_loader import core
from pin_nonideal.description.laws import Drag, JointFriction, LuGre, SigmoidFriction, UserFriction, UserLaw
from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.types import Array

from .callbacks import Reactions, checked_function, checked_limits
from .friction import LoweringContext, friction_joint, lower_joint_friction
from .resolver import words


@singledispatch
def lower_law(law: object, name: str, out: core.Builder, context: LoweringContext) -> None:
    """Add one law to the program.

    Args:
        law: the description.
        name: its unique name.
        out: the program under construction.
        context: names that the law may use.

    Raises:
        InputError, UnknownNameError: a frame or joint does not exist, or the description does not fit the
        model.
    """
    raise InputError(
        f"a law must be JointFriction, SigmoidFriction, LuGre, Drag, UserLaw or UserFriction; "
        f"got {short_repr(law)}"
    )


@lower_law.register
def _(law: JointFriction, name: str, out: core.Builder, context: LoweringContext) -> None:
    lower_joint_friction(law, name, out, context)


@lower_law.register
def _(law: SigmoidFriction, name: str, out: core.Builder, context: LoweringContext) -> None:
    joint = friction_joint(law.joint, words(law, name), context)
    dof = context.resolver.model.joints[joint].idx_v
    out.add_sigmoid(out.add_law(name), dof, phi1=law.phi1, phi2=law.phi2, phi3=law.phi3)


@lower_law.register
def _(law: LuGre, name: str, out: core.Builder, context: LoweringContext) -> None:
    joint = friction_joint(law.joint, words(law, name), context)
    dof = context.resolver.model.joints[joint].idx_v
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
def _(law: Drag, name: str, out: core.Builder, context: LoweringContext) -> None:
    frame = context.resolver.frame(law.frame, words(law, name))
    out.add_drag(out.add_law(name), frame, coefficient=law.coefficient, exponent=law.exponent)


@lower_law.register
def _(law: UserLaw, name: str, out: core.Builder, context: LoweringContext) -> None:
    nv, names = context.resolver.model.nv, context.reactions()
    shapes = ((nv,), (law.states,)) if law.states else ((nv,),)
    function = checked_function(law.function, f"{words(law, name)}: function", *shapes)

    def call(t: float, q: Array, v: Array, view: core.ReactionView | None, *z: Array) -> object:
        return function(t, q, v, None if view is None else Reactions(view, names), *z)

    reaction = core.Reaction[law.reaction or "none"]
    out.add_user_law(out.add_law(name), states=law.states, reaction=reaction, function=call)


@lower_law.register
def _(law: UserFriction, name: str, out: core.Builder, context: LoweringContext) -> None:
    who, names = words(law, name), context.reactions()
    direction = checked_function(law.direction, f"{who}: direction", (context.resolver.model.nv,))
    limits = checked_limits(law.limit, f"{who}: limit")

    def bounds(t: float, q: Array, v: Array, view: core.ReactionView) -> tuple[float, float]:
        return limits(t, q, v, Reactions(view, names))

    block = out.add_user_slip(name, 1, direction)
    out.add_friction(
        out.add_law(name),
        block,
        name=name,
        load=core.Load.user,
        reaction=core.Reaction.total,
        user_limit=bounds,
        static_ratio=law.static_ratio,
    )
