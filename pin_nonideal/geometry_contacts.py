"""Contacts of collision geometry: each pair of shapes as the contacts of its analytic manifold.

A half-space meets a sphere at one point, a capsule at its two ends, a box at its eight corners and a convex
mesh at its vertices, each a `PointContact`; spheres and capsules meet each other as a `CapsuleContact`.  A
box meets a sphere as a `BoxContact`, and another box or a capsule with corners on faces (`BoxContact`) and
edges on edges (`CapsuleContact`): no two boxes touch in any other way.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from .checks import fraction, label, nonnegative, optional_text, positive, text
from .contacts import PointContact
from .errors import InputError, LoadingError, UnknownNameError, nearest
from .files import file_path
from .laws import static_ratio as ratio_of_static
from .round_contacts import BoxContact, CapsuleContact, Segment
from .types import Array

__all__ = ["GeometryContact", "geometry_contacts"]

# Corners of a box of half edges 1.
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
# Part of the least edge to which boxes are rounded where nothing else is said.
LEAST_ROUNDING = 1e-3


@dataclass(frozen=True)
class GeometryContact:
    """Two shapes of a scene's collision model touch, with Coulomb friction there.

    Gap: the least distance of the shapes [m].  They become the contacts of their analytic manifold when the
    scene is made: a half-space with spheres, capsules (both ends), boxes (corners) and convex meshes
    (vertices); spheres and capsules with each other (one place); boxes with spheres, capsules and boxes
    (corners on faces, edges on edges).  Where boxes meet boxes their edges are rounded; the faces stay where
    they are.
    Rows: 1 for each place that is closed.  lam: the normal force there [N].

    Args:
        geometry1: name of a geometry object of the collision model.
        geometry2: name of another one, on another body.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction, at least 1.
        restitution: rate at which the gap opens after an impact over that at which it closed, 0 to 1.
        name: used in messages and results; several places are numbered.
        rounding: radius to which edges are rounded where a box meets a box [m]; a thousandth of the least
            edge of both when None.
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


@dataclass(frozen=True)
class _Shape:
    """Points on a body with a radius around them, or a half-space through its one point."""

    name: str
    frame: str
    points: Array  # (n, 3), in the axes of the frame
    radius: float = 0.0
    normal: Array | None = None  # of a half-space, through points[0]
    half: Array | None = None  # edges of a box, halved
    place: Any = None  # of a box in the axes of the frame, pinocchio.SE3

    @property
    def is_round(self) -> bool:
        return self.radius > 0.0


def geometry_contacts(
    model: pin.Model,
    collision_model: pin.GeometryModel,
    srdf: str | Path | None = None,
    *,
    mu: float = 0.0,
    static_ratio: float = 1.0,
    restitution: float = 0.0,
) -> list[PointContact | CapsuleContact | BoxContact]:
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
            raise InputError(f"geometry_contacts: {what} must be a pinocchio.{kind.__name__}; got {value!r}")
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


def _manifold(
    c: GeometryContact, model: pin.Model, geometry: pin.GeometryModel
) -> list[PointContact | CapsuleContact | BoxContact]:
    """The contacts of one pair of shapes."""
    who = label(c)
    first, second = (_shape(who, name, model, geometry) for name in (c.geometry1, c.geometry2))
    if first.frame == second.frame:
        raise InputError(f"{who}: both geometries are on the same body, which cannot touch itself")
    if first.normal is not None:
        first, second = second, first
    base = c.name or f"{first.name} on {second.name}"
    more: dict[str, Any] = {"mu": c.mu, "static_ratio": c.static_ratio, "restitution": c.restitution}
    if first.is_round and second.is_round:
        ends = _segment(first.points), _segment(second.points)
        return [
            CapsuleContact(first.frame, second.frame, *ends, first.radius, second.radius, name=base, **more)
        ]
    if first.half is not None and (second.half is not None or second.is_round):
        first, second = second, first
    if second.half is not None and (first.half is not None or first.is_round):
        return _box_manifold(who, first, second, c.rounding, base, more)
    if second.normal is None or first.normal is not None:
        raise InputError(
            f"{who}: no contacts are known for this pair of shapes; a half-space with a sphere, capsule, box"
            " or convex mesh is one, and so are spheres, capsules and boxes with each other: use PointContact"
            " for the places that touch"
        )
    points = np.unique(first.points, axis=0)
    return [
        PointContact(
            first.frame,
            plane=None if second.frame == "universe" else second.frame,
            normal=tuple(second.normal.tolist()),
            height=float(second.normal @ second.points[0]),
            offset=tuple(point.tolist()),
            radius=first.radius,
            name=base if len(points) == 1 else f"{base} {k + 1}",
            **more,
        )
        for k, point in enumerate(points)
    ]


def _box_manifold(
    who: str, first: _Shape, box: _Shape, rounding: float | None, base: str, more: dict[str, Any]
) -> list[PointContact | CapsuleContact | BoxContact]:
    """A box with a sphere, a capsule or another box: corners on faces, then edges on edges."""
    edge = 2.0 * min(float(s.half.min()) for s in (first, box) if s.half is not None)
    r2 = 0.0 if first.half is None else LEAST_ROUNDING * edge if rounding is None else rounding
    if not 2.0 * r2 < edge:
        raise InputError(f"{who}: rounding must be less than half the least edge {edge:g} m; got {r2:g} m")
    r1 = first.radius if first.half is None else r2
    found: list[Any] = []
    for ball, solid, radius in ((first, box, r1), (box, first, r2)):
        if solid.half is None or solid.place is None:
            continue
        size, rpy = (
            tuple((2.0 * solid.half).tolist()),
            tuple(pin.rpy.matrixToRpy(solid.place.rotation).tolist()),
        )
        xyz = tuple(solid.place.translation.tolist())
        for point in _core(ball, radius):
            at = tuple(point.tolist())
            found.append(
                BoxContact(ball.frame, solid.frame, size, radius, r2, offset=at, xyz=xyz, rpy=rpy, **more)
            )
    for one, other in product(_edges(_core(first, r1)), _edges(_core(box, r2))):
        found.append(CapsuleContact(first.frame, box.frame, one, other, r1, r2, **more))
    return [replace(c, name=base if len(found) == 1 else f"{base} {k + 1}") for k, c in enumerate(found)]


def _core(shape: _Shape, radius: float) -> Array:
    """The corners of a box less a radius on all sides; of others the points that the radius is around."""
    if shape.half is None:
        return np.unique(shape.points, axis=0)
    corners = CORNERS * (shape.half - radius)
    return np.asarray(corners @ shape.place.rotation.T + shape.place.translation)


def _edges(points: Array) -> list[Segment]:
    """The twelve edges of a box, or the one of a capsule."""
    if len(points) < len(CORNERS):
        return [_segment(points)] if len(points) == 2 else []
    pairs = combinations(range(len(CORNERS)), 2)
    return [_segment(points[[i, j]]) for i, j in pairs if (CORNERS[i] != CORNERS[j]).sum() == 1]


def _segment(points: Array) -> Segment:
    first, last = points[[0, -1]].tolist()
    return tuple(first), tuple(last)


def _shape(who: str, name: str, model: pin.Model, geometry: pin.GeometryModel) -> _Shape:
    """A geometry object as a shape of one of the known kinds."""
    known = [g.name for g in geometry.geometryObjects]
    if name not in known:
        raise UnknownNameError(f'{who}: no geometry "{name}" in the collision model{nearest(name, known)}')
    item = geometry.geometryObjects[known.index(name)]
    frame, shape, place = str(model.names[item.parentJoint]), item.geometry, item.placement
    kind = type(shape).__name__
    if kind == "Halfspace":
        normal = place.rotation @ np.array(shape.n)
        return _Shape(name, frame, (place.translation + shape.d * normal)[None, :], normal=normal)
    points, radius, half = np.zeros((1, 3)), 0.0, None
    if kind == "Sphere":
        radius = float(shape.radius)
    elif kind == "Capsule":
        points, radius = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]) * shape.halfLength, float(shape.radius)
    elif kind == "Box":
        half = np.array(shape.halfSide)
        points = CORNERS * half
    elif kind.startswith("Convex"):
        points = np.array([shape.point(i) for i in range(shape.num_points)]) * np.array(item.meshScale)
    else:
        is_mesh = "BVH" in kind
        reason = "is a mesh that need not be convex; make a convex one of it" if is_mesh else f"is a {kind}"
        raise InputError(
            f'{who}: geometry "{name}" {reason}; spheres, capsules, boxes, half-spaces and convex meshes do'
        )
    points = points @ place.rotation.T + place.translation
    return _Shape(name, frame, points, radius, half=half, place=place.copy())
