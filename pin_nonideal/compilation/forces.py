"""Applied forces and actuation in the core's program."""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any

import numpy as np

from pin_nonideal.core_loader import core
from pin_nonideal.description.actuation import EffortLimits, HoldPosition, SampledControl, Table
from pin_nonideal.description.forces import JointSpring, SpringDamper, UserForce, Wrench
from pin_nonideal.errors import InputError
from pin_nonideal.states.parsing import named_configuration, named_joint_samples, named_joint_values
from pin_nonideal.types import Array, Model
from pin_nonideal.validation import by_name

from .callbacks import checked
from .delay import DelayedTorque
from .resolver import Resolution, words


@singledispatch
def lower_force(f: object, out: core.Builder, where: Resolution) -> None:
    """Add one applied force to the program.

    Args:
        f: the description.
        out: the program under construction.
        where: frames and joints by name.

    Raises:
        InputError, UnknownNameError: a frame or joint does not exist or does not fit.
    """
    raise InputError(f"a force must be SpringDamper, JointSpring, Wrench or UserForce; got {f!r}")


@lower_force.register
def _(f: SpringDamper, out: core.Builder, where: Resolution) -> None:
    frame1, frame2 = where.pair(f, words(f))
    out.add_spring_damper(frame1, frame2, stiffness=f.stiffness, damping=f.damping, rest_length=f.rest_length)


@lower_force.register
def _(f: JointSpring, out: core.Builder, where: Resolution) -> None:
    joint = where.joint(f.joint, words(f))
    out.add_joint_spring(joint, stiffness=f.stiffness, rest=f.rest, damping=f.damping)


@lower_force.register
def _(f: Wrench, out: core.Builder, where: Resolution) -> None:
    frame = where.frame(f.frame, words(f))
    if callable(f.value):
        out.add_wrench(frame, function=checked(f.value, f"{words(f)}: value", (6,)))
    else:
        out.add_wrench(frame, value=list(f.value))


@lower_force.register
def _(f: UserForce, out: core.Builder, where: Resolution) -> None:
    out.add_user_force(checked(f.function, f"{words(f)}: function", (where.model.nv,)))


# Efforts from here on are unlimited: Pinocchio stores the largest float for no limit.
UNBOUNDED = 1e300


def lower_actuation(u: Any, out: core.Builder, where: Resolution) -> None:
    """Set the actuation of the scene.

    Args:
        u: None, an array (nv,), a function, or a description.
        out: the program under construction.
        where: frames and joints by name.

    Raises:
        InputError: shapes do not fit the model.
    """
    model, nv = where.model, where.model.nv
    if u is None:
        return
    if isinstance(u, EffortLimits):
        lower_actuation(u.actuation, out, where)
        least, most = _efforts(u, model)
        out.limit_effort(least=least, most=most)
    elif isinstance(u, SampledControl):
        if u.delay_in_samples:  # runs have their own delayed torques, see `delayed_torque`
            initial = initial_torque(u, model)
            out.set_sampled_torque(lambda t, q, v: initial, u.period)
        else:
            out.set_sampled_torque(_sampled_torque(u, model), u.period)
    elif isinstance(u, HoldPosition):
        q = where.q0 if u.q is None else named_configuration(model, u.q, where.q0, f"{words(u)}: q")
        kp, kd = _gains(u, "kp", model), _gains(u, "kd", model)
        out.set_hold_position(kp=kp, kd=kd, q=np.ascontiguousarray(q))
    elif isinstance(u, Table):
        times = np.asarray(u.times)
        values = named_joint_samples(model, u.values, times.size, f"{words(u)}: values")
        out.set_torque_table(times.tolist(), np.ascontiguousarray(values))
    elif callable(u):
        out.set_torque_function(checked(_torques_of(u, model, "actuation"), "actuation", (nv,)))
    else:
        out.set_constant_torque(tau=named_joint_values(model, u, "actuation"))


def delayed_torque(u: SampledControl, model: Model, t0: float, by_thread: bool) -> DelayedTorque:
    """Return the delayed torques of one run, or of the runs of a rollout.

    Args:
        u: a sampled control with a delay.
        model: pinocchio.Model.
        t0: start time of the runs [s].
        by_thread: whether runs go on in several threads at once, each run in one thread.
    """
    function, initial = _sampled_torque(u, model), initial_torque(u, model)
    return DelayedTorque(function, u.delay_in_samples, initial, t0, by_thread)


def _sampled_torque(u: SampledControl, model: Model) -> Callable[..., Any]:
    who = f"{words(u)}: function"
    return checked(_torques_of(u.function, model, who), who, (model.nv,))


def initial_torque(u: SampledControl, model: Model) -> Array:
    """Return the torque before the first delayed one arrives, (nv,).

    Args:
        u: a sampled control.
        model: pinocchio.Model.
    """
    if u.initial is None:
        return np.zeros(model.nv)
    return np.ascontiguousarray(named_joint_values(model, u.initial, f"{words(u)}: initial"))


def _torques_of(function: Callable[..., Any], model: Model, who: str) -> Callable[..., Any]:
    """A function of torques that may return them by joint name."""

    def torques(*arguments: Any) -> Any:
        tau = function(*arguments)
        if type(tau) is np.ndarray or by_name(tau) is None:
            return tau
        return named_joint_values(model, tau, who)

    return torques


def _efforts(u: EffortLimits, model: Model) -> tuple[Array, Array]:
    """Return the lower and upper effort limit of each degree of freedom; no limit is infinite."""
    if u.effort is not None:
        if isinstance(u.effort, float):
            most = np.full(model.nv, u.effort)
        else:
            most = named_joint_values(model, u.effort, f"{words(u)}: effort", others=np.inf)
        return -most, most
    least, most = model.lowerEffortLimit.copy(), model.upperEffortLimit.copy()
    unstated = least >= most
    least[unstated | (least <= -UNBOUNDED)] = -np.inf
    most[unstated | (most >= UNBOUNDED)] = np.inf
    return np.ascontiguousarray(least), np.ascontiguousarray(most)


def _gains(u: HoldPosition, key: str, model: Model) -> Array:
    """Return a gain for each degree of freedom; a scalar acts on joints with one degree of freedom."""
    gain, who = getattr(u, key), f"{words(u)}: {key}"
    if isinstance(gain, float):
        single = np.zeros(model.nv)
        for joint in list(model.joints)[1:]:
            if joint.nv == 1:
                single[joint.idx_v] = float(gain)
        return single
    full = named_joint_values(model, gain, who)
    if key == "kp":
        for index, joint in list(enumerate(model.joints))[1:]:
            part = full[joint.idx_v : joint.idx_v + joint.nv]
            if joint.nq != joint.nv and joint.nv > 1 and (part != 0.0).any():
                raise InputError(
                    f'{who} must be zero on joint "{model.names[index]}", whose configuration is no '
                    "vector; drive it by a function"
                )
    return full
