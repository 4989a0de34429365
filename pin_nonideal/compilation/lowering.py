"""Lowering of descriptions into the core's builder: rows, then laws that read them, then applied forces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import Rolling
from pin_nonideal.description.contacts import JointLimit
from pin_nonideal.description.contacts.pair_of_shapes import contact_parts, given_contacts
from pin_nonideal.description.contacts.point_names import ContactOfPoint, NumberedNames, UsedNames
from pin_nonideal.description.scene_spec import SceneSpec

from .actuation import lower_actuation
from .callbacks import ReactionNames
from .constraints import lower_constraint
from .contact_friction import has_friction, lower_contact_friction
from .contact_groups import grouped_rows, points_by_pair
from .contacts import lower_contacts, lower_gaps
from .forces import lower_force
from .friction import LoweringContext
from .laws import lower_law
from .resolver import Resolver, unique_names


class LoweredItem(NamedTuple):
    """A description that has been added to the builder.

    Attributes:
        kind: "constraint", "contact", "law", "force" or "actuation".
        name: unique among its kind.
        description: the description.
        relower: function of (description, builder) that adds a replacement of the description.
        prepare: functions of drives that runs call before their first step, see `BoundDrive`.
    """

    kind: str
    name: str
    description: Any
    relower: Callable[[object, Any], object]
    prepare: Sequence[Callable[[], object]] = ()


class LoweredScene(NamedTuple):
    """A scene that has been added to the builder.

    Attributes:
        described: constraints and contacts by their unique names, a `ContactGroup` by its first name.
        prepare: functions of drives that runs call before their first step, see `BoundDrive`.
    """

    described: dict[str, object]
    prepare: list[Callable[[], object]]


def lower(spec: SceneSpec, builder: core.Builder, resolver: Resolver) -> LoweredScene:
    """Add one scene to the core's builder.

    Args:
        spec: descriptions of the scene.
        builder: the core's program under construction, still empty.
        resolver: frames and joints by name.

    Raises:
        InputError, UnknownNameError: a frame, joint or constraint does not exist, or a description does not
        fit the model.
    """
    items = list(lower_stepwise(spec, builder, resolver))
    described = {each.name: each.description for each in items if each.kind in ("constraint", "contact")}
    return LoweredScene(described, [prepare for each in items for prepare in each.prepare])


def lower_stepwise(spec: SceneSpec, builder: core.Builder, resolver: Resolver) -> Iterator[LoweredItem]:
    """Add one scene to the core's builder and yield each description after it is added.

    A contact is yielded twice: after its normal rows and after its friction.

    Args:
        spec: descriptions of the scene.
        builder: the core's program under construction, still empty.
        resolver: frames and joints by name.
    """
    used_names = UsedNames()
    constraint_names = unique_names(spec.constraints, used_names)
    own_names = unique_names(spec.contacts, used_names.copy())  # of contacts, before their points
    contacts: list[Any] = contact_parts(spec.contacts)
    contact_names = unique_names(contacts, used_names)
    given = given_contacts(spec.contacts)
    points = points_by_pair(spec.contacts)
    names_of_contacts = UsedNames()  # a contact with friction has a law of its name, and its points have laws
    for name, c in zip(own_names, given, strict=True):
        if has_friction(c):
            names_of_contacts.add(name)
    for pair, names in points.items():
        names_of_contacts.add_points(NumberedNames(pair, range(1, len(names) + 1)))
    law_names = unique_names(spec.laws, names_of_contacts)
    for c, name in zip(spec.constraints, constraint_names, strict=True):
        lower_constraint(c, name, builder, resolver)
        yield LoweredItem("constraint", name, c, partial(_relower, lower_constraint, name, resolver))
    blocks = {name: block for block, name in enumerate(builder.block_names)}
    contact_of = ContactOfPoint(points)
    named = list(zip(contact_names, contacts, strict=True))
    for name, contact, first in lower_contacts(named, contact_of, builder, resolver):
        blocks[name] = first
        yield LoweredItem("contact", name, contact, partial(_relower, lower_gaps, name, resolver))
    reactions = partial(_reaction_names, builder, contact_of, resolver)
    constraints: dict[str, object] = dict(zip(constraint_names, spec.constraints, strict=True))
    context = LoweringContext(resolver, constraints, blocks, reactions)
    for law, name in zip(spec.laws, law_names, strict=True):
        lower_law(law, name, builder, context)
        yield LoweredItem("law", name, law, partial(_relower, lower_law, name, context))
    rolling = [
        (c, name)
        for c, name in zip(spec.constraints, constraint_names, strict=True)
        if isinstance(c, Rolling)
    ]
    rubbing = [(c, n) for c, n in zip(contacts, contact_names, strict=True) if not isinstance(c, JointLimit)]
    for touching, name in [*rolling, *rubbing]:
        lower_contact_friction(touching, name, builder, context)
        yield LoweredItem("contact", name, touching, partial(_relower, lower_contact_friction, name, context))
    for name, f in zip(unique_names(spec.forces, UsedNames()), spec.forces, strict=True):
        lower_force(f, builder, resolver)
        yield LoweredItem("force", name, f, lambda f, out: lower_force(f, out, resolver))
    prepare = lower_actuation(spec.actuation, builder, resolver, spec)
    relower = partial(_relower_actuation, resolver, spec)
    yield LoweredItem("actuation", "actuation", spec.actuation, relower, prepare)
    builder.set_impact(core.ImpactLaw[spec.impact])  # last, since it belongs to no description


def _reaction_names(builder: core.Builder, contact_of: ContactOfPoint, resolver: Resolver) -> ReactionNames:
    """Return the names by which user laws access reactions, after all constraints and contacts are added."""
    blocks = {name: block for block, name in enumerate(builder.block_names)}
    joints = {name: i for i, name in enumerate(resolver.model.names) if i}
    return ReactionNames(grouped_rows(builder, contact_of), blocks, joints)


def _relower(
    write: Callable[..., object], name: str, context: object, description: object, out: object
) -> None:
    write(description, name, out, context)


def _relower_actuation(resolver: Resolver, spec: SceneSpec, actuation: object, out: Any) -> None:
    lower_actuation(actuation, out, resolver, spec)
