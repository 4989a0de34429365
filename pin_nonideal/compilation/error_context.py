"""Conversion of failures of the core to exceptions that name joints, constraints and elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pinocchio as pin

from pin_nonideal.core_loader import core
from pin_nonideal.errors import (
    DivergenceError,
    FrictionConvergenceError,
    FrictionParadoxError,
    ImpactEnergyError,
    InconsistentConstraintsError,
    LoopClosureError,
    NonFiniteError,
    RunError,
    RunInterrupted,
    SingularMassError,
    StepSizeError,
    StiffnessError,
    WallTimeError,
)
from pin_nonideal.types import Model

from .contact_groups import contact_names

MAX_NAMED = 4  # names in a message
LAWS = ("the equation of motion", "Signorini's conditions", "the limit of friction", "maximum dissipation")


def open_loop_error(name: str, gaps: dict[str, float], t: float, after: str = "") -> LoopClosureError:
    """Return the exception of a run that has left its constraints.

    Args:
        name: constraint with the largest gap.
        gaps: gap of each constraint [m or rad].
        t: time [s].
        after: text to append to the message.
    """
    return LoopClosureError(
        f'loop "{name}" has opened by t = {t:.4g} s: gap {gaps[name]:.2g} (m or rad); no position near there '
        f"satisfies all constraints: check lengths and drives{after}",
        gaps=gaps,
        time=t,
    )


def singular_position(names: Sequence[str], t: float) -> StepSizeError:
    """Return the exception of a run whose constraints have become dependent.

    Args:
        names: constraints with dependent rows.
        t: time [s].
    """
    who = (
        f"constraint {_list_names(names)} is" if len(names) == 1 else f"constraints {_list_names(names)} are"
    )
    rows = "its rows" if len(names) == 1 else "their rows"
    return StepSizeError(
        f"{who} in a singular position at t = {t:.6g} s, such as full stretch or a dead point, where {rows} "
        "become dependent and the motion ends or is not determined; drive another joint, or stay away from "
        "the position",
        time=t,
    )


class Circumstances(NamedTuple):
    """Parts of a scene that errors of its runs refer to.

    Attributes:
        explicit_only: message on a part of the scene that no implicit method supports, or empty.
        sources: names of the actuation, the applied forces and the laws.
        pairs: frames of each contact by its name, the second one empty for the world.
        contact_of: contact of each point of a pair of shapes.
        moving: names of the prescribed motions.
        method: method of the run, empty outside of runs.
    """

    explicit_only: str
    sources: tuple[str, str, str]
    pairs: dict[str, tuple[str, str]]
    contact_of: Mapping[str, str]
    moving: Sequence[str] = ()
    method: str = ""


def named_failure(
    failure: core.CoreFailure, model: Model, program: core.Program, around: Circumstances
) -> RunError:
    """Return the exception of a failure, with names in place of the core's indices.

    Args:
        failure: the core's CoreFailure.
        model: pinocchio.Model.
        program: the core's program.
        around: parts of the scene that the message may name.
    """
    kinds, kind, t, value = core.FailureKind, failure.kind, failure.time, failure.value

    def named(names: Sequence[str], chosen: Sequence[int]) -> list[str]:
        return contact_names((names[i] for i in chosen), around.contact_of)

    if kind is kinds.singular_mass:
        return _singular(model, failure.elements[0], t)
    if kind is kinds.inconsistent:
        names = named([*program.block_names, *program.element_names], failure.elements)
        rubs = not set(names).isdisjoint(program.element_names)
        if value == 0.0:  # the failure of an impact has no residual
            return _inseparable(names, t, model, around)
        return _inconsistent(names, value, t, rubs)
    if kind is kinds.not_finite:
        return NonFiniteError(f"acceleration is not finite at t = {t:.4g} s", time=t)
    if kind is kinds.paradox:
        elements = named(program.element_names, failure.elements)
        return _paradox(elements or contact_names(program.law_names, around.contact_of), failure)
    if kind is kinds.not_converged:
        names = named(program.element_names, failure.elements)
        names = names or named(program.block_names, program.contacts)
        return _modes_error(names, t, around.method)
    if kind is kinds.unmet_law:
        law, index = failure.elements
        dof_names = [str(model.names[joint_of(model, i)]) for i in range(model.nv)]
        names = [dof_names, program.block_names, program.element_names, program.element_names][law]
        return _law_error(LAWS[law], named(names, [index])[0], value, t)
    if kind is kinds.closure:
        name = named(program.block_names, failure.elements[:1])[0]
        return open_loop_error(name, {name: value}, t)
    if kind is kinds.interrupted:
        return RunInterrupted(f"the run was interrupted at t = {t:.4g} s", time=t)
    if kind is kinds.impact_energy:
        names = named(program.block_names, failure.elements)
        return _impact_energy_error(names, value, t, _contact_bodies(model, names, around.pairs))
    if kind is kinds.stiff:
        return _stiffness_error(model, failure.elements[0], value, t, around.explicit_only)
    if kind is kinds.growing:
        return _divergence_error(model, failure.elements[0], around.sources[failure.elements[1]], value, t)
    if kind is kinds.steps:
        return StepSizeError(
            f"the run has taken all of its max_steps = {value:.0f} steps by t = {t:.4g} s; allow more, "
            "loosen rtol and atol, or simulate a shorter duration",
            time=t,
        )
    if kind is kinds.wall:
        return WallTimeError(
            f"the run has taken its max_wall = {value:g} s of wall time by t = {t:.4g} s; allow more, loosen "
            "rtol and atol, or simulate a shorter duration",
            time=t,
        )
    return _stuck(value, t, around.explicit_only)


def _list_names(names: Sequence[str]) -> str:
    """Return names for a message: each in quotes, and the number of those beyond the first few."""
    shown = [f'"{name}"' for name in names[:MAX_NAMED]]
    if len(names) > MAX_NAMED:
        shown.append(f"{len(names) - MAX_NAMED} more")
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"


def _contact_bodies(model: Model, names: Sequence[str], pairs: dict[str, tuple[str, str]]) -> str:
    """Return the two bodies of the first contact for a message, or an empty text if it has no frames."""
    frames = next((pairs[name] for name in names if name in pairs), None)
    if frames is None:
        return ""
    one, other = (_body(model, frame) for frame in frames)
    return f" ({one} on {other})"


def _body(model: Model, name: str) -> str:
    """Return the body that carries a frame for a message: its name, or that of its joint, or the world."""
    if not name or not model.existFrame(name):
        return "the world"
    frame = model.frames[model.getFrameId(name)]
    if frame.parentJoint == 0:
        return "the world"
    if frame.type != pin.FrameType.BODY:
        above = model.frames[frame.parentFrame]
        bodies = [
            f for f in model.frames if f.parentJoint == frame.parentJoint and f.type == pin.FrameType.BODY
        ]
        if above.type == pin.FrameType.BODY:
            frame = above
        elif bodies:
            frame = bodies[0]
        else:
            return f'the body of joint "{model.names[frame.parentJoint]}"'
    return f'body "{frame.name}"'


def _impact_energy_error(names: Sequence[str], gain: float, t: float, bodies: str) -> RunError:
    return ImpactEnergyError(
        f"the impact at {_list_names(names)}{bodies} at t = {t:.6g} s gains {gain:.3g} J, as Newton's law of "
        'restitution with friction may; use Scene(..., impact="poisson"), a smaller restitution, or '
        "strict=False",
        element=", ".join(names),
        gain=gain,
        time=t,
    )


def _divergence_error(model: Model, dof: int, source: str, rate: float, t: float) -> RunError:
    joint = str(model.names[joint_of(model, dof)])
    return DivergenceError(
        f'the speed of joint "{joint}" grows without bound by t = {t:.4g} s, by a factor of e every '
        f"{1.0 / rate:.2g} s, over many decades, and {source} does the most work on it: the motion is "
        "unstable; check the signs, gains and delays there, or allow the motion with max_steps",
        joint=joint,
        source=source,
        rate=rate,
        time=t,
    )


def _stiffness_error(model: Model, dof: int, rate: float, t: float, explicit_only: str) -> RunError:
    joint = str(model.names[joint_of(model, dof)])
    ways_out = (
        f"check its damping, stiffness and inertia, or allow the steps with max_steps, since {explicit_only}"
        if explicit_only
        else 'check its damping, stiffness and inertia, use method="Radau", or allow the steps with max_steps'
    )
    return StiffnessError(
        f'joint "{joint}" is stiff at t = {t:.4g} s: its motion relaxes at {rate:.2g} 1/s, and an explicit '
        f"method needs equally short steps, too many to reach the end; {ways_out}",
        joint=joint,
        rate=rate,
        time=t,
    )


def stiff_hint(model: Model, dof: int, rate: float, decays: bool, explicit_only: str) -> str:
    """Return a hint for a run that is slow because its steps resolve a fast motion.

    Args:
        model: pinocchio.Model.
        dof: degree of freedom whose force contributes most to the fastest motion.
        rate: rate of the fastest motion [1/s].
        decays: whether the motion decays; otherwise it oscillates.
        explicit_only: message on a part of the scene that no implicit method supports, or empty.
    """
    joint = str(model.names[joint_of(model, dof)])
    if decays:
        ways_out = (
            f"check its damping, stiffness and inertia, or wait, since {explicit_only}"
            if explicit_only
            else 'use method="Radau", or check its damping, stiffness and inertia'
        )
        return (
            f'joint "{joint}" is stiff: its motion relaxes at {rate:.2g} 1/s, and an explicit method needs '
            f"equally short steps; {ways_out}"
        )
    ways_out = "" if explicit_only else 'damp them and use method="Radau", or '
    return (
        f'joint "{joint}" swings at {rate:.2g} rad/s, and the steps follow it; if these vibrations do not '
        f"matter, {ways_out}loosen rtol and atol"
    )


def joint_of(model: Model, dof: int) -> int:
    """Return the index of the joint that owns a degree of freedom."""
    return next(i for i, j in enumerate(model.joints) if i and j.idx_v <= dof < j.idx_v + j.nv)


def _paradox(names: Sequence[str], failure: core.CoreFailure) -> RunError:
    shown, t = core.Solutions, failure.time
    solutions, way_out = {
        shown.several: (
            "several solutions",
            'continue with the nearer one by several="continue", reduce mu,',
        ),
        shown.none: ("no solution", "reduce mu,"),
    }.get(failure.solutions, ("no solution or several", "reduce mu,"))
    are_several = failure.solutions == shown.several
    limits = " and ".join(", ".join(f"{x:.4g}" for x in each) for each in failure.limits if are_several)
    return FrictionParadoxError(
        f"friction of {_list_names(names)} has {solutions} at t = {t:.4g} s: "
        + (f"limits of {limits} (N m or N), " if limits else "")
        + f'det(I - d lam\'/d lam) = {failure.value:.3g}; {way_out} or use reaction="ideal"',
        element=", ".join(names),
        determinant=failure.value,
        time=t,
        solutions=failure.accelerations if are_several else (),
        limits=failure.limits if are_several else (),
    )


def _modes_error(names: Sequence[str], t: float, method: str) -> RunError:
    remedy = "use shorter steps" if method == "moreau" else 'tighten rtol, use method="moreau"'
    whose = f" of {_list_names(names)}" if names else ""
    return FrictionConvergenceError(
        f"the modes (stick or slip){whose} were not found at t = {t:.4g} s, although a motion may exist; "
        f"change an initial value a little, {remedy}, or give modes to solve",
        element=", ".join(names),
        time=t,
    )


def _law_error(law: str, name: str, residual: float, t: float) -> RunError:
    return FrictionConvergenceError(
        f'no motion that satisfies {law} at "{name}" was found at t = {t:.4g} s: the residual is '
        f"{residual:.1e} of the largest force; change an initial value a little, tighten rtol, or use "
        'method="moreau"',
        element=name,
        time=t,
    )


def _stuck(steps: float, t: float, explicit_only: str) -> RunError:
    last = "or loosen rtol and atol" if explicit_only else 'loosen rtol and atol, or use "Radau"'
    if steps:
        return StepSizeError(
            f"the run makes no progress: after {steps:.0f} steps it has reached t = {t:.4g} s; "
            f"simulate a shorter duration, {last}",
            time=t,
        )
    return StepSizeError(
        f"the step size fell below rounding at t = {t:.6g} s: the motion is singular there, or stiff; "
        f"check the last samples, {last}",
        time=t,
    )


def _inseparable(names: Sequence[str], t: float, model: Model, around: Circumstances) -> RunError:
    """Return the error of contacts that no forces keep apart."""
    if around.moving:
        why = (
            f"prescribed motion ({_list_names(around.moving)}) may drive them into each other: end it before "
            "they touch, or drive the joint by a force, such as actuation=HoldPosition"
        )
    elif around.method == "moreau":
        why = "other constraints or contacts keep them from moving apart: use shorter steps, or reduce mu"
    else:
        why = (
            "other constraints keep them from moving apart; lower restitution, or use "
            'Scene(..., impact="poisson")'
        )
    how = "" if around.method == "moreau" else " with their restitution"
    bodies = f"the bodies at {_list_names(names)}{_contact_bodies(model, names, around.pairs)}"
    return InconsistentConstraintsError(
        f"{bodies} cannot separate{how} at t = {t:.2f} s: {why}",
        time=t,
    )


def _inconsistent(names: Sequence[str], residual: float, t: float, rubs: bool) -> RunError:
    quoted = _list_names(names)
    if len(names) > 1:
        blame, remedy = f"constraints {quoted} contradict each other", "leave one of them out"
    else:
        blame, remedy = f"constraint {quoted} contradicts itself", "leave one of its rows out"
    remedy += ", or give both the same motion"
    if rubs:
        remedy = (
            "a prescribed motion begins to move sticking friction: use a method of the core, such as "
            '"dop853", in which the friction slips'
        )
    return InconsistentConstraintsError(
        f"{blame}: residual {abs(residual):.1e} m/s^2 at t = {t:.2f} s; {remedy}", time=t
    )


def _singular(model: Model, dof: int, t: float) -> RunError:
    joint = joint_of(model, dof)
    bodies = [f.name for f in model.frames if f.parentJoint == joint and f.type == pin.FrameType.BODY]
    links = ", ".join(f'"{b}"' for b in bodies) or "its body"
    return SingularMassError(
        f'the mass matrix must be positive definite; it is singular at joint "{model.names[joint]}" '
        f"(t = {t:.4g} s): give {links} mass and inertia, or the joint an armature",
        time=t,
    )
