"""Contacts of collision geometry: each pair of shapes as the contacts of its analytic manifold.

A half-space meets a sphere or an ellipsoid at one point, a capsule at its two ends, a box or a convex mesh at
its corners, a cylinder or a cone at its rims, its faces and its tip.  Spheres and capsules meet each other at
one place.  Boxes and convex meshes meet spheres, capsules and each other with corners on faces and edges on
edges: solids with flat faces touch in no other way.  Cylinders and cones meet spheres, and with their faces,
sides, rims and tips capsules, boxes, convex meshes and each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import pinocchio as pin

from pin_nonideal.atomic_files import file_path
from pin_nonideal.description.laws import static_ratio as ratio_of_static
from pin_nonideal.errors import InputError, LoadingError, short_repr
from pin_nonideal.validation import fraction, label, nonnegative, optional_text, positive, text

from .manifold import Place, manifold
from .shapes import shape_of

__all__ = ["GeometryContact", "geometry_contacts"]


@dataclass(frozen=True)
class GeometryContact:
    """Two shapes of a scene's collision model touch, with Coulomb friction there.

    Gap: the least distance of the shapes [m].  They become the contacts of their analytic manifold when the
    scene is made: a half-space with spheres, ellipsoids, capsules (both ends), boxes and convex meshes
    (corners), cylinders and cones (rims, eight points of a face, the tip); spheres and capsules with each
    other (one place); boxes and convex meshes with spheres, capsules and each other (corners on faces, edges
    on edges); cylinders and cones with all of these and each other (sides, rims, eight points of a face and
    the chords between them, the tip).  Where edges meet edges they are rounded; the faces
    stay where they are.
    Rows: 1 for each place that is closed.  lam: the normal force there [N].

    Args:
        geometry1: name of a geometry object of the collision model.
        geometry2: name of another one, on another body.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results; several places are numbered.
        rounding: radius to which edges are rounded where boxes and convex meshes meet each other, cylinders
            or cones, and rims where these meet each other, and how far the rim of a cylinder or cone stands
            back behind its face, but against spheres [m]; a thousandth of the least edge of both, of the
            radius, and of the largest ball inside two cylinders or cones, when None.
    """

    geometry1: str
    geometry2: str
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None
    rounding: float | None = None

    def __post_init__(self) -> None:
        optional_text("GeometryContact: name", self.name)
        who = label(self)
        text(f"{who}: geometry1", self.geometry1)
        text(f"{who}: geometry2", self.geometry2)
        object.__setattr__(self, "mu", nonnegative(f"{who}: mu", self.mu))
        object.__setattr__(self, "static_ratio", ratio_of_static(who, self.static_ratio))
        object.__setattr__(self, "restitution", fraction(f"{who}: restitution", self.restitution))
        if self.rounding is not None:
            object.__setattr__(self, "rounding", positive(f"{who}: rounding", self.rounding))


def geometry_contacts(
    model: pin.Model,
    collision_model: pin.GeometryModel,
    srdf: str | Path | None = None,
    *,
    mu: float = 0.0,
    static_ratio: float = 1.0,
    restitution: float = 0.0,
) -> list[Place]:
    """The contacts of a collision model's pairs.

    Args:
        model: pinocchio.Model.
        collision_model: pinocchio.GeometryModel; its own collision pairs, or where it has none all pairs of
            different bodies.
        srdf: path of an SRDF file whose disabled pairs are left out.
        mu: kinetic coefficient of friction of all.
        static_ratio: static over kinetic friction of all, at least 1.
        restitution: of all, 0 to 1.

    Returns:
        Descriptions for `Scene(contacts=)`.

    Raises:
        InputError: an argument does not fit, a pair has no analytic manifold, or a mesh is not convex.
        LoadingError: the SRDF file cannot be read.
    """
    for what, value, kind in (
        ("model", model, pin.Model),
        ("collision_model", collision_model, pin.GeometryModel),
    ):
        if not isinstance(value, kind):
            raise InputError(
                f"geometry_contacts: {what} must be a pinocchio.{kind.__name__}; got {short_repr(value)}"
            )
    mu = nonnegative("geometry_contacts: mu", mu)
    static_ratio = ratio_of_static("geometry_contacts", static_ratio)
    restitution = fraction("geometry_contacts: restitution", restitution)
    pairs = collision_model.copy()
    objects = list(pairs.geometryObjects)
    if len(pairs.collisionPairs) == 0:
        for i, j in combinations(range(len(objects)), 2):
            if objects[i].parentJoint != objects[j].parentJoint:
                pairs.addCollisionPair(pin.CollisionPair(i, j))
    if srdf is not None:
        path = file_path("geometry_contacts: srdf", srdf)
        try:
            pin.removeCollisionPairs(model, pairs, str(path), False)
        except Exception as error:  # Pinocchio's and its XML reader's own
            raise LoadingError(f'geometry_contacts: srdf "{path}" must be an SRDF file: {error}') from error
    found = []
    for pair in pairs.collisionPairs:
        names = objects[pair.first].name, objects[pair.second].name
        found += _manifold(GeometryContact(*names, mu, static_ratio, restitution), model, pairs)
    return found


def with_geometry(contacts: Iterable[Any], model: pin.Model, geometry: Any) -> tuple[Any, ...]:
    """Contacts with those of geometry in place of each `GeometryContact`.

    Args:
        contacts: descriptions.
        model: pinocchio.Model.
        geometry: pinocchio.GeometryModel, or a function without arguments that gives it or None.

    Raises:
        InputError, UnknownNameError: a geometry does not exist or has no analytic manifold with the other.
    """
    given = tuple(contacts)
    if not any(isinstance(c, GeometryContact) for c in given):
        return given
    shapes = geometry() if callable(geometry) else geometry
    if shapes is None:
        raise InputError("a GeometryContact needs the scene's collision_model; pass one, or use PointContact")
    nested = [_manifold(c, model, shapes) if isinstance(c, GeometryContact) else [c] for c in given]
    return tuple(c for several in nested for c in several)


def _manifold(c: GeometryContact, model: pin.Model, geometry: pin.GeometryModel) -> list[Place]:
    """The contacts of one pair of shapes."""
    who = label(c)
    first, second = (shape_of(who, name, model, geometry) for name in (c.geometry1, c.geometry2))
    if first.frame == second.frame:
        raise InputError(f"{who}: both geometries are on the same body, which cannot touch itself")
    ground, thing = (first, second) if first.normal is not None else (second, first)
    base = c.name or f"{thing.name} on {ground.name}"
    more = {"mu": c.mu, "static_ratio": c.static_ratio, "restitution": c.restitution}
    return manifold(who, first, second, c.rounding, base, more)
