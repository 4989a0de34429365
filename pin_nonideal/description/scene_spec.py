"""Descriptions of a scene, without its model."""

from __future__ import annotations

from typing import NamedTuple

from .constraints import Constraint
from .contacts import Contact
from .contacts.pair_of_shapes import PairOfShapes
from .forces import Force
from .laws import Law


class SceneSpec(NamedTuple):
    """Descriptions of a scene, without its model.

    Attributes:
        constraints: descriptions, or constraint models of Pinocchio.
        contacts: descriptions, with a `PairOfShapes` in place of each `GeometryContact`.
        laws: descriptions.
        forces: descriptions.
        actuation: None, an array (nv,), a table by joint name, a function, a description, or a tuple of
            drives.
        terms: provider of M and the bias forces, "core" or "pinocchio".
        impact: restitution law, "newton" or "poisson".
        assembly_tolerance: residual that a vanishing row may have [m or rad].
    """

    constraints: tuple[Constraint, ...]
    contacts: tuple[Contact | PairOfShapes, ...]
    laws: tuple[Law, ...]
    forces: tuple[Force, ...]
    actuation: object
    terms: str
    impact: str
    assembly_tolerance: float
