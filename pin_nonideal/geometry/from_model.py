"""Contacts of collision geometry: each pair of shapes is replaced by the contacts of its analytic manifold.

A half-space touches a sphere or an ellipsoid at one point, a capsule at its two ends, a box or a convex mesh
at its corners, and a cylinder or a cone at its rims, faces and tip. Spheres and capsules touch each other at
one point. Boxes and convex meshes touch spheres, capsules and each other with corners on faces and with edges
on edges; solids with flat faces have no other contacts. Cylinders and cones touch spheres, and they touch
capsules, boxes, convex meshes and each other with faces, sides, rims and tips.
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

from .manifold import ManifoldContact, manifold
from .shapes import shape_of

__all__ = ["GeometryContact", "geometry_contacts"]


@dataclass(frozen=True)
class GeometryContact:
    """Contact of two shapes of a scene's collision model, with Coulomb friction.

    Gap: least distance of the shapes [m]. When a scene is compiled, the pair is replaced by the contacts of
    its analytic manifold. A half-space touches spheres, ellipsoids, capsules (both ends), boxes and convex
    meshes (corners), cylinders and cones (rims, eight points of a face, tip). Spheres and capsules touch each
    other at one point. Boxes and convex meshes touch spheres, capsules and each other (corners on faces,
    edges on edges). Cylinders and cones touch all of these and each other (sides, rims, eight points of a
    face and the chords between them, tip). Edges that touch edges are rounded. The faces keep their
    positions.
    Rows: 1 for each closed contact point. lam: normal force at that point [N].

    Args:
        geometry1: name of a geometry object of the collision model.
        geometry2: name of a geometry object on another body.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: name in messages and results; if there are several contact points, their names are numbered.
        rounding: radius of rounded edges [m], for boxes and convex meshes against each other and against
            cylinders or cones. The same length rounds the rims of two cylinders or cones, and is the inset of
            a cylinder's or cone's rim behind its face, except against spheres. None selects a thousandth of
            the shortest edge of both shapes, of the radius, or of the radius of the largest ball inside two
            cylinders or cones.
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
) -> list[ManifoldContact]:
    """Return the contacts of the pairs of a collision model.

    Args:
        model: pinocchio.Model.
        collision_model: pinocchio.GeometryModel. Its collision pairs are used, or all pairs on different
            bodies if it has no collision pairs.
        srdf: path of an SRDF file whose disabled pairs are excluded.
        mu: kinetic coefficient of friction of all contacts.
        static_ratio: static over kinetic friction of all contacts, at least 1.
        restitution: coefficient of restitution of all contacts, 0 to 1.

    Returns:
        Descriptions for `Scene(contacts=)`.

    Raises:
        InputError: an argument is invalid, a pair has no analytic manifold, or a mesh is not convex.
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
        except Exception as error:  # errors of Pinocchio and of its XML reader
            raise LoadingError(f'geometry_contacts: srdf "{path}" must be an SRDF file: {error}') from error
    found = []
    for pair in pairs.collisionPairs:
        names = objects[pair.first].name, objects[pair.second].name
        found += _manifold(GeometryContact(*names, mu, static_ratio, restitution), model, pairs)
    return found


def expand_geometry_contacts(
    contacts: Iterable[object], model: pin.Model, geometry: object
) -> tuple[Any, ...]:
    """Return contacts in which each `GeometryContact` is replaced by the contacts of its manifold.

    Args:
        contacts: descriptions of contacts.
        model: pinocchio.Model.
        geometry: pinocchio.GeometryModel, or a function without arguments that returns it or None.

    Raises:
        InputError, UnknownNameError: a geometry does not exist, or the pair has no analytic manifold.
    """
    items = tuple(contacts)
    if not any(isinstance(c, GeometryContact) for c in items):
        return items
    shapes = geometry() if callable(geometry) else geometry
    if shapes is None:
        raise InputError("a GeometryContact needs the scene's collision_model; pass one, or use PointContact")
    nested = [_manifold(c, model, shapes) if isinstance(c, GeometryContact) else [c] for c in items]
    return tuple(c for several in nested for c in several)


def _manifold(c: GeometryContact, model: pin.Model, geometry: pin.GeometryModel) -> list[ManifoldContact]:
    """Return the contacts of one pair of shapes."""
    who = label(c)
    first, second = (shape_of(who, name, model, geometry) for name in (c.geometry1, c.geometry2))
    if first.frame == second.frame:
        raise InputError(f"{who}: both geometries are on the same body, which cannot touch itself")
    ground, thing = (first, second) if first.normal is not None else (second, first)
    base = c.name or f"{thing.name} on {ground.name}"
    options = {"mu": c.mu, "static_ratio": c.static_ratio, "restitution": c.restitution}
    return manifold(who, first, second, c.rounding, base, options)
