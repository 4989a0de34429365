"""Applied forces in the core's program."""

from __future__ import annotations

from functools import singledispatch

from pin_nonideal.core_loader import core
from pin_nonideal.description.forces import JointSpring, SpringDamper, UserForce, Wrench
from pin_nonideal.errors import InputError, short_repr

from .callbacks import checked_function
from .resolver import Resolver, words


@singledispatch
def lower_force(f: object, out: core.Builder, resolver: Resolver) -> None:
    """Add one applied force to the program.

    Args:
        f: the description.
        out: the program under construction.
        resolver: frames and joints by name.

    Raises:
        InputError, UnknownNameError: a frame or joint does not exist, or the description does not fit the
        model.
    """
    raise InputError(f"a force must be SpringDamper, JointSpring, Wrench or UserForce; got {short_repr(f)}")


@lower_force.register
def _(f: SpringDamper, out: core.Builder, resolver: Resolver) -> None:
    frame1, frame2 = resolver.pair(f, words(f))
    out.add_spring_damper(frame1, frame2, stiffness=f.stiffness, damping=f.damping, rest_length=f.rest_length)


@lower_force.register
def _(f: JointSpring, out: core.Builder, resolver: Resolver) -> None:
    joint = resolver.joint(f.joint, words(f))
    out.add_joint_spring(joint, stiffness=f.stiffness, rest=f.rest, damping=f.damping)


@lower_force.register
def _(f: Wrench, out: core.Builder, resolver: Resolver) -> None:
    frame = resolver.frame(f.frame, words(f))
    if callable(f.value):
        out.add_wrench(frame, function=checked_function(f.value, f"{words(f)}: value", (6,)))
    else:
        out.add_wrench(frame, value=list(f.value))


@lower_force.register
def _(f: UserForce, out: core.Builder, resolver: Resolver) -> None:
    out.add_user_force(checked_function(f.function, f"{words(f)}: function", (resolver.model.nv,)))
