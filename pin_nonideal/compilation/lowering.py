"""Lowering of descriptions into the core's builder: rows, then laws that read them, then applied forces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import Rolling
from pin_nonideal.description.contacts import JointLimit
from pin_nonideal.states.rows import row_slices

from .actuation import lower_actuation
from .callbacks import ReactionNames
from .constraints import lower_constraint
from .contacts import lower_contacts, lower_gaps
from .forces import lower_force
from .friction import Surroundings, lower_contact_friction
from .laws import lower_law
from .resolver import Resolution, unique_names


class Descriptions(NamedTuple):
    """Descriptions of a scene, without its model.

    Attributes:
        constraints: descriptions, or constraint models of Pinocchio.
        contacts: descriptions.
        laws: descriptions.
        forces: descriptions.
        actuation: None, an array (nv,), a table by joint name, a function, a description, or a tuple of
            drives.
        terms: provider of M and the bias forces, "core" or "pinocchio".
        impact: the law of restitution, "newton" or "poisson".
        assembly_tolerance: residual that a vanishing row may have [m or rad].
    """

    constraints: tuple[Any, ...]
    contacts: tuple[Any, ...]
    laws: tuple[Any, ...]
    forces: tuple[Any, ...]
    actuation: Any
    terms: str
    impact: str
    assembly_tolerance: float


class Written(NamedTuple):
    """A description that has been added to the builder.

    Attributes:
        kind: "constraint", "contact", "law", "force" or "actuation".
        name: unique among its kind.
        description: the description.
        again: function of (description, builder) that adds a replacement of the description.
    """

    kind: str
    name: str
    description: Any
    again: Callable[[Any, Any], object]


def lower(said: Descriptions, builder: core.Builder, where: Resolution) -> dict[str, Any]:
    """Add one scene to the core's builder.

    Args:
        said: descriptions of the scene.
        builder: the core's program under construction, still empty.
        where: frames and joints by name.

    Returns:
        Constraints and contacts by their unique names.

    Raises:
        InputError, UnknownNameError: a frame, joint or constraint does not exist or does not fit.
    """
    written = lowered(said, builder, where)
    return {each.name: each.description for each in written if each.kind in ("constraint", "contact")}


def lowered(said: Descriptions, builder: core.Builder, where: Resolution) -> Iterator[Written]:
    """Add one scene to the core's builder and yield each description after it is added.

    A contact is yielded twice: after its normal rows and after its friction.

    Args:
        said: descriptions of the scene.
        builder: the core's program under construction, still empty.
        where: frames and joints by name.
    """
    taken: set[str] = set()
    constraint_names = unique_names(said.constraints, taken)
    contact_names = unique_names(said.contacts, taken)
    law_names = unique_names(said.laws, set())
    for c, name in zip(said.constraints, constraint_names, strict=True):
        lower_constraint(c, name, builder, where)
        yield Written("constraint", name, c, partial(_again, lower_constraint, name, where))
    for name, c in lower_contacts(list(zip(contact_names, said.contacts, strict=True)), builder, where):
        yield Written("contact", name, c, partial(_again, lower_gaps, name, where))
    joints = {name: i for i, name in enumerate(where.model.names) if i}
    blocks = {c.name: block for block, c in enumerate(builder.constraints)}
    names = ReactionNames(row_slices(builder), blocks, joints)
    around = Surroundings(where, dict(zip(constraint_names, said.constraints, strict=True)), names)
    for law, name in zip(said.laws, law_names, strict=True):
        lower_law(law, name, builder, around)
        yield Written("law", name, law, partial(_again, lower_law, name, around))
    rolling = [
        (c, name)
        for c, name in zip(said.constraints, constraint_names, strict=True)
        if isinstance(c, Rolling)
    ]
    contacts = zip(said.contacts, contact_names, strict=True)
    for c, name in [*rolling, *(pair for pair in contacts if not isinstance(pair[0], JointLimit))]:
        lower_contact_friction(c, name, builder, around)
        yield Written("contact", name, c, partial(_again, lower_contact_friction, name, around))
    for name, f in zip(unique_names(said.forces, set()), said.forces, strict=True):
        lower_force(f, builder, where)
        yield Written("force", name, f, lambda f, out: lower_force(f, out, where))
    lower_actuation(said.actuation, builder, where, said)
    again = partial(_actuation_again, where, said)
    yield Written("actuation", "actuation", said.actuation, again)
    builder.set_impact(core.ImpactLaw[said.impact])  # last, since it belongs to no description


def _again(write: Callable[..., object], name: str, around: Any, description: Any, out: Any) -> None:
    write(description, name, out, around)


def _actuation_again(where: Resolution, said: Descriptions, actuation: Any, out: Any) -> None:
    lower_actuation(actuation, out, where, said)
