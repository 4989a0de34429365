"""The core's failures as exceptions that name what is to blame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.core import load_core
from pin_nonideal.errors import (
    FrictionParadoxError,
    InconsistentConstraintsError,
    LoopClosureError,
    NonFiniteError,
    RunError,
    RunInterrupted,
    SingularMassError,
    StepSizeError,
)

from .analysis import rows_at
from .program import Lowered

core = load_core()

# A sample with a larger gap than this [m or rad] has left the constraints: after every step projection comes
# down to rounding, and in singular positions to the square root of it.
LEFT = 1e-6


def check_closed(scene: Any, trajectory: Any) -> None:
    """Raises when a run has left its constraints, as it must when a drive pulls a loop apart.

    Args:
        scene: the scene that ran.
        trajectory: its samples.

    Raises:
        LoopClosureError: with the samples before.
    """
    if not scene.constraint_slices:
        return
    left = trajectory.violation > LEFT
    if not left.any():
        return
    k = int(left.argmax())
    t = float(trajectory.t[k])
    residual = np.abs(rows_at(scene.new_runner(), trajectory.q[k], trajectory.v[k], t)[2])
    gaps = {key: float(residual[rows].max()) for key, rows in scene.constraint_slices.items()}
    name = max(gaps, key=lambda key: gaps[key])
    stopped = _opened(name, gaps, t, "; the trajectory up to there is in error.trajectory")
    stopped.trajectory = trajectory.first(k)
    raise stopped


def _opened(name: str, gaps: dict[str, float], t: float, after: str = "") -> LoopClosureError:
    return LoopClosureError(
        f'loop "{name}" has opened by t = {t:.4g} s: gap {gaps[name]:.2g} (m or rad); no position near there '
        f"satisfies all constraints: check lengths and drives{after}",
        gaps=gaps,
        time=t,
    )


def named_failure(failure: Any, model: Any, low: Lowered) -> RunError:
    """The exception that says in names what the core says in numbers.

    Args:
        failure: the core's CoreFailure.
        model: pinocchio.Model.
        low: the program with its names.
    """
    kinds, kind, t, value = core.FailureKind, failure.kind, failure.time, failure.value
    if kind is kinds.singular_mass:
        return _singular(model, failure.elements[0], t)
    if kind is kinds.inconsistent:
        return _inconsistent([*low.blocks, *low.friction_names], failure.elements, value, t)
    if kind is kinds.not_finite:
        return NonFiniteError(f"acceleration is not finite at t = {t:.4g} s", time=t)
    if kind is kinds.paradox:
        names = (low.friction_names[i] for i in failure.elements)
        return _paradox(", ".join(names) or ", ".join(low.law_names), value, t)
    if kind is kinds.closure:
        name = list(low.blocks)[failure.elements[0]]
        return _opened(name, {name: value}, t)
    if kind is kinds.interrupted:
        return RunInterrupted(f"the run was interrupted at t = {t:.4g} s", time=t)
    return _stuck(value, t)


def _paradox(element: str, determinant: float, t: float) -> RunError:
    return FrictionParadoxError(
        f'friction of "{element}" has no solution or several at t = {t:.4g} s: '
        f'det(I - d lam\'/d lam) = {determinant:.3g}; reduce mu, or use reaction="ideal"',
        element=element,
        determinant=determinant,
        time=t,
    )


def _stuck(steps: float, t: float) -> RunError:
    if steps:
        return StepSizeError(
            f"the run would never end: after {steps:.0f} steps it has come to t = {t:.4g} s; "
            'simulate a shorter duration, loosen rtol and atol, or use "Radau"',
            time=t,
        )
    return StepSizeError(
        f"the step size fell below rounding at t = {t:.6g} s: the motion is singular there, or stiff; "
        'look at the last samples, loosen rtol and atol, or use "Radau"',
        time=t,
    )


def _inconsistent(names: Sequence[str], items: list[int], residual: float, t: float) -> RunError:
    quoted = " and ".join(f'"{names[i]}"' for i in items)
    blame = (
        f"constraints {quoted} contradict each other"
        if len(items) > 1
        else f"constraint {quoted} contradicts itself"
    )
    return InconsistentConstraintsError(
        f"{blame}: residual {abs(residual):.1e} m/s^2 at t = {t:.2f} s", time=t
    )


def _singular(model: Any, dof: int, t: float) -> RunError:
    joint = next(i for i, j in enumerate(model.joints) if i and j.idx_v <= dof < j.idx_v + j.nv)
    bodies = [f.name for f in model.frames if f.parentJoint == joint and f.type == pin.FrameType.BODY]
    links = ", ".join(f'"{b}"' for b in bodies) or "its body"
    return SingularMassError(
        f'the mass matrix must be positive definite; it is singular at joint "{model.names[joint]}" '
        f"(t = {t:.4g} s): give {links} mass and inertia, or the joint an armature",
        time=t,
    )
