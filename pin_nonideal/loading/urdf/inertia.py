"""Why a mass matrix is not positive definite, in the words of the model: which joints and links to mend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pin_nonideal.core_loader import core
from pin_nonideal.errors import SingularMassError
from pin_nonideal.types import Model

# Rounding in M is a few units in the last place of the largest term of each entry; once rows and columns
# are scaled to a unit diagonal, an eigenvalue below this many units cannot be told from zero.
SINGULAR = 16.0 * float(np.finfo(float).eps)


def mass_diagnosis(model: Model, q: ArrayLike | None = None) -> str | None:
    """Tells what makes M(q) singular or indefinite.

    M is scaled to a unit diagonal first, so that light links beside heavy ones are no fault.

    Args:
        model: pinocchio.Model.
        q: configuration, shape (nq,); None for the neutral one.

    Returns:
        None when M(q) is positive definite, otherwise a sentence that names joints and links and says what to
        do.
    """
    if model.nv == 0:
        return None
    q = pin.neutral(model) if q is None else np.asarray(q, dtype=float)
    runner = core.Builder(model).finish().runner()
    M = runner.terms(q, np.zeros(model.nv))[0].reshape(model.nv, model.nv)
    diagonal = M.diagonal()
    largest = float(diagonal.max())
    bare = [i for i in range(model.nv) if not diagonal[i] > SINGULAR**2 * max(largest, 0.0)]
    if bare:
        joints = _joints_of(model, bare)
        return (
            f"{_quoted('joint', [model.names[j] for j in joints])} {'moves' if len(joints) == 1 else 'move'} "
            f"no inertia: give {_quoted('link', _links_beyond(model, joints))} a mass and a moment of "
            "inertia in the robot's file, or make the joint fixed"
        )
    scale = 1.0 / np.sqrt(diagonal)
    scaled = scale[:, None] * M * scale
    try:  # much cheaper than eigenvalues, and enough for nearly every robot
        np.linalg.cholesky(scaled - SINGULAR * model.nv * np.eye(model.nv))
        return None
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(scaled)
    direction = np.abs(vectors[:, 0])
    joints = _joints_of(model, [int(i) for i in np.flatnonzero(direction > 0.1 * direction.max())])
    suspects = _light_links(model, joints) or _links_beyond(model, joints)
    return (
        f"a motion of {_quoted('joint', [model.names[j] for j in joints])} meets no inertia (smallest "
        f"eigenvalue of the scaled M is {values[0]:.1e}): give {_quoted('link', suspects)} a mass and a "
        "moment of inertia, start elsewhere if axes are parallel only here, or make three revolute "
        "joints in a row one ball joint"
    )


def require_positive_mass(model: Model, q: ArrayLike | None, name: str | None) -> None:
    """Raises unless M(q) is positive definite.

    Args:
        model: pinocchio.Model.
        q: configuration, shape (nq,); None for the neutral one.
        name: name of the robot in the message; None for the model's own.

    Raises:
        SingularMassError: with the sentence of `mass_diagnosis`.
    """
    fault = mass_diagnosis(model, q)
    if fault is not None:
        raise SingularMassError(f'mass matrix of "{name or model.name}" must be positive definite; {fault}')


def _joints_of(model: Model, dofs: Sequence[int]) -> list[int]:
    """Joints that own the given degrees of freedom."""
    return [
        j
        for j in range(1, model.njoints)
        if any(model.idx_vs[j] <= i < model.idx_vs[j] + model.nvs[j] for i in dofs)
    ]


def _links_beyond(model: Model, joints: Sequence[int]) -> list[str]:
    """Names of the links that the joints carry directly; of the joints when they carry no named link."""
    links = [f.name for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint in joints]
    return links or [model.names[j] for j in joints]


def _light_links(model: Model, joints: Sequence[int]) -> list[str]:
    """Links on the joints without mass, or without moment of inertia."""
    light = [
        j
        for j in joints
        if model.inertias[j].mass <= 0.0 or float(np.linalg.eigvalsh(model.inertias[j].inertia)[0]) <= 0.0
    ]
    return _links_beyond(model, light) if light else []


def _quoted(word: str, names: Sequence[str]) -> str:
    """Word, in the plural when needed, and up to four quoted names."""
    shown = ", ".join(f'"{n}"' for n in names[:4]) + (", ..." if len(names) > 4 else "")
    return f"{word}{'' if len(names) == 1 else 's'} {shown}"
