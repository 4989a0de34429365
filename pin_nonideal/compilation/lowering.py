"""From descriptions to the core's builder: rows first, then the laws that read them, then given forces."""

from __future__ import annotations

from typing import Any, NamedTuple

from pin_nonideal.constraints import Rolling
from pin_nonideal.core import core
from pin_nonideal.states.rows import row_slices

from .callbacks import ReactionNames
from .constraints import lower_constraint, lower_contact
from .forces import lower_actuation, lower_force
from .friction import Surroundings, lower_contact_friction
from .laws import lower_law
from .names import Resolution, unique_names


class Descriptions(NamedTuple):
    """What the user said of a scene beside its model.

    Attributes:
        constraints: descriptions, or constraint models of Pinocchio.
        contacts: descriptions.
        laws: descriptions.
        forces: descriptions.
        actuation: None, an array (nv,), a function, or a description.
        terms: who computes M and the bias forces, "core" or "pinocchio".
    """

    constraints: tuple[Any, ...]
    contacts: tuple[Any, ...]
    laws: tuple[Any, ...]
    forces: tuple[Any, ...]
    actuation: Any
    terms: str


def lower(said: Descriptions, builder: core.Builder, where: Resolution) -> None:
    """Writes one scene into the core's builder.

    Args:
        said: what it is made of.
        builder: the core's program under construction, empty so far.
        where: frames and joints by name.

    Raises:
        InputError, UnknownNameError: what a description refers to does not exist or does not fit.
    """
    taken: set[str] = set()
    constraint_names = unique_names(said.constraints, taken)
    contact_names = unique_names(said.contacts, taken)
    law_names = unique_names(said.laws, set())
    for c, name in zip(said.constraints, constraint_names, strict=True):
        lower_constraint(c, name, builder, where)
    for c, name in zip(said.contacts, contact_names, strict=True):
        lower_contact(c, name, builder, where)
    joints = {name: i for i, name in enumerate(where.model.names) if i}
    blocks = {c.name: block for block, c in enumerate(builder.constraints)}
    names = ReactionNames(row_slices(builder), blocks, joints)
    around = Surroundings(where, dict(zip(constraint_names, said.constraints, strict=True)), names)
    for law, name in zip(said.laws, law_names, strict=True):
        lower_law(law, name, builder, around)
    rolling = [
        (c, name)
        for c, name in zip(said.constraints, constraint_names, strict=True)
        if isinstance(c, Rolling)
    ]
    for c, name in [*rolling, *zip(said.contacts, contact_names, strict=True)]:
        lower_contact_friction(c, name, builder, around)
    for f in said.forces:
        lower_force(f, builder, where)
    lower_actuation(said.actuation, builder, where)
