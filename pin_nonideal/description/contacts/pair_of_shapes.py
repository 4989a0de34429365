"""A pair of shapes with its contact points: one contact of the user, and several of the core."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TypeVar

from pin_nonideal.validation import Vector3

from . import PointContact
from .base import similar
from .point_names import NumberedNames
from .round import BoxContact, CapsuleContact, Segment
from .solids import CylinderContact, HullContact

C = TypeVar("C")

# Contacts of a sphere, or a point, with a plane or a solid.
# A `CylinderContact` then has no second end of a capsule.
BallContact = PointContact | BoxContact | HullContact | CylinderContact


@dataclass(frozen=True)
class ContactGroup(ABC):
    """Contacts of two bodies that differ in the places of their features; the core adds them together.

    Attributes:
        like: the first contact, whose other fields all contacts share.
        name: name of the pair of shapes.
        number: number of the first contact among the points of the pair of shapes.
    """

    like: BallContact | CapsuleContact
    name: str = field(default="", kw_only=True)
    number: int = field(default=1, kw_only=True)

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def contacts(self) -> Iterator[object]:
        """Yield the description of each contact."""

    @property
    def names(self) -> NumberedNames:
        """Names of the contacts: of the pair of shapes and a number."""
        return NumberedNames(self.name, range(self.number, self.number + len(self)))

    @property
    def mu(self) -> float:
        """Coefficient of friction."""
        return self.like.mu


@dataclass(frozen=True)
class BallContacts(ContactGroup):
    """Contacts of spheres, or points, of a body with a plane or a solid of another body.

    Attributes:
        like: the contact of the first sphere.
        offsets: centers of the spheres in the axes of `frame` [m].
    """

    like: BallContact
    offsets: tuple[Vector3, ...]

    def __len__(self) -> int:
        return len(self.offsets)

    @property
    def frame(self) -> str:
        """Frame of the spheres."""
        return self.like.frame if isinstance(self.like, PointContact) else self.like.frame1

    def contacts(self) -> Iterator[object]:
        """Yield the description of each contact."""
        for name, offset in zip(self.names, self.offsets, strict=True):
            yield similar(self.like, offset=offset, name=name)


@dataclass(frozen=True)
class CapsulePairs(ContactGroup):
    """Contacts of each of some capsules of a body with each of other capsules of another body.

    Attributes:
        like: the contact of the first two capsules.
        lines1: segments of the first capsules in the axes of frame1 [m].
        lines2: segments of the second capsules in the axes of frame2 [m].
    """

    like: CapsuleContact
    lines1: tuple[Segment, ...]
    lines2: tuple[Segment, ...]

    def __len__(self) -> int:
        return len(self.lines1) * len(self.lines2)

    def sides(self) -> tuple[tuple[str, tuple[Segment, ...], float], tuple[str, tuple[Segment, ...], float]]:
        """Return frame, segments and radius of the capsules of each body."""
        c = self.like
        return (c.frame1, self.lines1, c.radius1), (c.frame2, self.lines2, c.radius2)

    def contacts(self) -> Iterator[CapsuleContact]:
        """Yield the description of each contact."""
        for name, (one, other) in zip(self.names, product(self.lines1, self.lines2), strict=True):
            yield similar(self.like, segment1=one, segment2=other, name=name)


@dataclass(frozen=True)
class PairOfShapes:
    """Contact of two shapes, with a contact for each pair of features that can touch.

    Attributes:
        given: description of the pair by the user.
        name: name of the pair.
        shapes: names of both shapes.
        parts: contacts of the manifold, alone or in a `ContactGroup`. If there are several contacts, their
            names are the name of the pair and a number.
    """

    given: object
    name: str
    shapes: tuple[str, str]
    parts: tuple[object, ...]

    @cached_property
    def points(self) -> tuple[object, ...]:
        """Contacts of the manifold."""
        return tuple(point for part in self.parts for point in _contacts(part))

    @property
    def names(self) -> Sequence[str]:
        """Names of the contacts of the manifold."""
        count = sum(len(p) if isinstance(p, ContactGroup) else 1 for p in self.parts)
        return [self.name] if count == 1 else NumberedNames(self.name, range(1, count + 1))


def _contacts(part: object) -> Iterable[object]:
    return part.contacts() if isinstance(part, ContactGroup) else (part,)


def pair_name(shape: str, other: str) -> str:
    """Return the default name of the contact of a shape with another shape, or with the ground.

    Args:
        shape: name of the shape, or of its link.
        other: name of the other shape.
    """
    return f"{shape} on {other}"


def numbered(parts: Iterable[object], name: str) -> tuple[object, ...]:
    """Return the parts of a manifold with names: the name of the pair, and a number if there are several.

    Args:
        parts: contacts without names, alone or in a `ContactGroup`.
        name: name of the pair.
    """
    named: list[object] = []
    number = 1
    given = [part.like if isinstance(part, ContactGroup) and len(part) == 1 else part for part in parts]
    count = sum(len(part) if isinstance(part, ContactGroup) else 1 for part in given)
    for part in given:
        if isinstance(part, ContactGroup):
            named.append(replace(part, name=name, number=number))
            number += len(part)
        else:
            named.append(similar(part, name=name if count == 1 else f"{name} {number}"))
            number += 1
    return tuple(named)


def given_contacts(contacts: Iterable[object]) -> tuple[object, ...]:
    """Return contacts as the user described them.

    Args:
        contacts: descriptions, with pairs of shapes in place of their descriptions.
    """
    return tuple(c.given if isinstance(c, PairOfShapes) else c for c in contacts)


def contact_parts(contacts: Iterable[object]) -> list[object]:
    """Return contacts, with the parts of pairs of shapes in place of the pairs.

    Args:
        contacts: descriptions, with pairs of shapes in place of their descriptions.
    """
    return [each for c in contacts for each in (c.parts if isinstance(c, PairOfShapes) else (c,))]


def split(contact: C) -> C:
    """Return a contact; for a pair of shapes, each contact point becomes a separate part.

    Args:
        contact: a description, or a pair of shapes.
    """
    return replace(contact, parts=contact.points) if isinstance(contact, PairOfShapes) else contact
