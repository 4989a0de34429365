"""From descriptions to the compiled core: names become indices, user functions become checked ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core import load_core
from pin_nonideal.errors import InputError

from .callbacks import ReactionNames
from .constraints import lower_constraint, lower_contact
from .forces import lower_actuation, lower_force
from .laws import Surroundings, lower_contact_friction, lower_law
from .names import Resolution, unique_names
from .program import Lowered

core = load_core()


def lower(
    model: Any,
    q0: NDArray[np.float64],
    *,
    constraints: Sequence[Any],
    contacts: Sequence[Any],
    laws: Sequence[Any],
    forces: Sequence[Any],
    actuation: Any,
    terms: str = "core",
    builder: Any = None,
) -> Lowered:
    """Writes one scene into the core's builder: rows first, then the laws that read them, then given forces.

    Args:
        model: pinocchio.Model.
        q0: configuration at which `frame2=None` and lengths left out are read, (nq,).
        constraints: descriptions, or constraint models of Pinocchio.
        contacts: descriptions.
        laws: descriptions.
        forces: descriptions.
        actuation: None, an array (nv,), a function, or a description.
        terms: who computes M and the bias forces, "core" or "pinocchio".
        builder: what the scene is written into; a new program of the core when None.

    Returns:
        The program under construction with its names.

    Raises:
        InputError, UnknownNameError: what a description refers to does not exist or does not fit.
    """
    try:
        out = Lowered(core.Builder(model, terms == "pinocchio") if builder is None else builder)
    except ValueError as error:
        raise InputError(str(error)) from None
    where = Resolution(model, q0)
    taken: set[str] = set()
    constraint_names = unique_names(constraints, taken)
    contact_names = unique_names(contacts, taken)
    law_names = unique_names(laws, set())
    for c, name in zip(constraints, constraint_names, strict=True):
        lower_constraint(c, name, out, where)
    for c, name in zip(contacts, contact_names, strict=True):
        lower_contact(c, name, out, where)
    joints = {name: i for i, name in enumerate(model.names) if i}
    names = ReactionNames(out.slices, out.blocks, joints)
    around = Surroundings(where, dict(zip(constraint_names, constraints, strict=True)), names)
    for law, name in zip(laws, law_names, strict=True):
        lower_law(law, name, out, around)
    for c, name in zip(contacts, contact_names, strict=True):
        lower_contact_friction(c, name, out, where)
    for f in forces:
        lower_force(f, out, where)
    lower_actuation(actuation, out, where)
    return out
