"""A pair of shapes with its contact points: one contact of the user, and several of the core."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class PairOfShapes:
    """Contact of two shapes, with a contact for each pair of features that can touch.

    Attributes:
        given: description of the pair by the user.
        name: name of the pair.
        shapes: names of both shapes.
        points: contacts of the manifold. If there are several, their names are the name of the pair and a
            number.
    """

    given: object
    name: str
    shapes: tuple[str, str]
    points: tuple[object, ...]


def given_contacts(contacts: Iterable[object]) -> tuple[object, ...]:
    """Return contacts as the user described them.

    Args:
        contacts: descriptions, with pairs of shapes in place of their descriptions.
    """
    return tuple(c.given if isinstance(c, PairOfShapes) else c for c in contacts)


def point_contacts(contacts: Iterable[object]) -> list[object]:
    """Return contacts, with the points of pairs of shapes in place of the pairs.

    Args:
        contacts: descriptions, with pairs of shapes in place of their descriptions.
    """
    return [each for c in contacts for each in (c.points if isinstance(c, PairOfShapes) else (c,))]
