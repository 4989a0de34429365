"""Diagnosis of a mass matrix that is not positive definite, in terms of joints and links."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pin_nonideal.core_loader import core
from pin_nonideal.errors import SingularMassError
from pin_nonideal.types import Model

# Threshold of singularity. The rounding error of M is a few units in the last place of the largest term of
# each entry. After rows and columns are scaled to a unit diagonal, smaller eigenvalues cannot be
# distinguished from zero.
MIN_EIGENVALUE = 16.0 * float(np.finfo(float).eps)


def mass_diagnosis(model: Model, q: ArrayLike | None = None) -> str | None:
    """Return the reason why M(q) is singular or indefinite.

    M is scaled to a unit diagonal first, so that light links beside heavy ones are accepted.

    Args:
        model: pinocchio.Model.
        q: configuration, (nq,); None for the neutral configuration.

    Returns:
        None if M(q) is positive definite, otherwise a sentence that names joints and links and a remedy.
    """
    if model.nv == 0:
        return None
    q = pin.neutral(model) if q is None else np.asarray(q, dtype=float)
    runner = core.Builder(model).finish().runner()
    M = runner.terms(q, np.zeros(model.nv))[0].reshape(model.nv, model.nv)
    diagonal = M.diagonal()
    largest = float(diagonal.max())
    weightless_dofs = [i for i in range(model.nv) if not diagonal[i] > MIN_EIGENVALUE**2 * max(largest, 0.0)]
    if weightless_dofs:
        joints = _joints_of(model, weightless_dofs)
        return (
            f"{_quote('joint', [model.names[j] for j in joints])} {'moves' if len(joints) == 1 else 'move'} "
            f"no inertia: give {_quote('link', _links_beyond(model, joints))} a mass and a moment of "
            "inertia in the robot's file, or make the joint fixed"
        )
    scale = 1.0 / np.sqrt(diagonal)
    scaled = scale[:, None] * M * scale
    try:  # Much cheaper than eigenvalues, and sufficient for nearly every robot.
        np.linalg.cholesky(scaled - MIN_EIGENVALUE * model.nv * np.eye(model.nv))
        return None
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(scaled)
    direction = np.abs(vectors[:, 0])
    joints = _joints_of(model, [int(i) for i in np.flatnonzero(direction > 0.1 * direction.max())])
    suspects = _light_links(model, joints) or _links_beyond(model, joints)
    return (
        f"a motion of {_quote('joint', [model.names[j] for j in joints])} meets no inertia (smallest "
        f"eigenvalue of the scaled M is {values[0]:.1e}): give {_quote('link', suspects)} a mass and a "
        "moment of inertia, start elsewhere if axes are parallel only here, or make three revolute "
        "joints in a row one ball joint"
    )


def require_positive_mass(model: Model, q: ArrayLike | None, name: str | None) -> None:
    """Check that M(q) is positive definite.

    Args:
        model: pinocchio.Model.
        q: configuration, (nq,); None for the neutral configuration.
        name: name of the robot in the message; None for the name of the model.

    Raises:
        SingularMassError: M(q) is not positive definite; the message contains the result of `mass_diagnosis`.
    """
    fault = mass_diagnosis(model, q)
    if fault is not None:
        raise SingularMassError(f'mass matrix of "{name or model.name}" must be positive definite; {fault}')


def _joints_of(model: Model, dofs: Sequence[int]) -> list[int]:
    """Return the joints of the given degrees of freedom."""
    return [
        j
        for j in range(1, model.njoints)
        if any(model.idx_vs[j] <= i < model.idx_vs[j] + model.nvs[j] for i in dofs)
    ]


def _links_beyond(model: Model, joints: Sequence[int]) -> list[str]:
    """Return the names of the links on the joints, or of the joints if they carry no named link."""
    links = [f.name for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint in joints]
    return links or [model.names[j] for j in joints]


def _light_links(model: Model, joints: Sequence[int]) -> list[str]:
    """Return the links on the joints without mass, or without moment of inertia."""
    light = [
        j
        for j in joints
        if model.inertias[j].mass <= 0.0 or float(np.linalg.eigvalsh(model.inertias[j].inertia)[0]) <= 0.0
    ]
    return _links_beyond(model, light) if light else []


def _quote(word: str, names: Sequence[str]) -> str:
    """Return a word, plural if needed, with up to four quoted names."""
    shown = ", ".join(f'"{n}"' for n in names[:4]) + (", ..." if len(names) > 4 else "")
    return f"{word}{'' if len(names) == 1 else 's'} {shown}"
