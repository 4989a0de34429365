"""Contacts of collision geometry: pairs of shapes, and the contacts of their analytic manifolds.

A half-space touches a sphere or an ellipsoid at one point, a capsule at its two ends, a box or a convex mesh
at its corners, and a cylinder or a cone at its rims, faces and tip. Spheres and capsules touch each other at
one point. Boxes and convex meshes touch spheres, capsules and each other with corners on faces and with edges
on edges. Cylinders and cones touch spheres, and they touch
capsules, boxes, convex meshes and each other with faces, sides, rims and tips.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import pinocchio as pin

from pin_nonideal.atomic_files import file_path
from pin_nonideal.description.contacts.pair_of_shapes import PairOfShapes, pair_name
from pin_nonideal.description.joint_friction import static_ratio as ratio_of_static
from pin_nonideal.errors import InputError, LoadingError, UnknownNameError, nearest, short_repr
from pin_nonideal.types import GeometryModel, GeometryObject, Model
from pin_nonideal.validation import (
    flag,
    fraction,
    label,
    nonnegative,
    optional_text,
    positive,
    sequence,
    text,
)

from .ground import ground as plain_ground
from .manifold import manifold
from .shapes import Shape, geometry_object, shape_of

__all__ = ["GeometryContact", "geometry_contacts", "ground_contacts"]


@dataclass(frozen=True)
class GeometryContact:
    """Contact of two shapes of a scene's collision model, with Coulomb friction.

    Gap: least distance of the shapes [m]. The pair is one contact of the scene and of its runs. In the core
    it has a contact for each point of its analytic manifold. A half-space touches spheres, ellipsoids,
    capsules (both ends), boxes and convex meshes (corners), cylinders and cones (rims, eight points of a
    face, tip). Spheres and capsules touch each other at one point. Boxes and convex meshes touch spheres,
    capsules and each other (corners on faces, edges on edges). Cylinders and cones touch all of these and
    each other (sides, rims, eight points of a face and the chords between them, tip). Edges that touch edges
    are rounded. The faces keep their positions.
    Rows: 1 for each closed contact point. lam: normal force at that point [N].

    Args:
        geometry1: name of a geometry object of the collision model.
        geometry2: name of a geometry object on another body, or a pinocchio.GeometryObject on the world that
            need not be in the collision model, such as `ground()`.
        mu: kinetic coefficient of friction.
        static_ratio: ratio of static to kinetic friction, at least 1.
        restitution: ratio of the opening rate of the gap after an impact to its closing rate before, 0 to 1.
        name: name in messages and results, by default "SHAPE on OTHER".
        rounding: radius of rounded edges [m], for boxes and convex meshes against each other and against
            cylinders or cones. The same length rounds the rims of two cylinders or cones, and is the inset of
            a cylinder's or cone's rim behind its face, except against spheres. None selects a thousandth of
            the shortest edge of both shapes, of the radius, or of the radius of the largest ball inside two
            cylinders or cones.
    """

    geometry1: str
    geometry2: str | GeometryObject
    mu: float = 0.0
    static_ratio: float = 1.0
    restitution: float = 0.0
    name: str | None = None
    rounding: float | None = None

    def __post_init__(self) -> None:
        optional_text("GeometryContact: name", self.name)
        who = label(self)
        text(f"{who}: geometry1", self.geometry1)
        if not isinstance(self.geometry2, pin.GeometryObject):
            text(f"{who}: geometry2", self.geometry2)
        elif self.geometry2.parentJoint:
            raise InputError(
                f'{who}: geometry2 as an object must be fixed to the world; "{self.geometry2.name}" is on a '
                "moving body: add it to the collision model, and give its name"
            )
        object.__setattr__(self, "mu", nonnegative(f"{who}: mu", self.mu))
        object.__setattr__(self, "static_ratio", ratio_of_static(who, self.static_ratio))
        object.__setattr__(self, "restitution", fraction(f"{who}: restitution", self.restitution))
        if self.rounding is not None:
            object.__setattr__(self, "rounding", positive(f"{who}: rounding", self.rounding))


def geometry_contacts(
    model: Model,
    collision_model: GeometryModel,
    srdf: str | Path | None = None,
    *,
    links: Sequence[str] | None = None,
    adjacent: bool = True,
    mu: float = 0.0,
    static_ratio: float = 1.0,
    restitution: float = 0.0,
) -> list[GeometryContact]:
    """Return a `GeometryContact` for each pair of shapes of a collision model that may touch.

    Args:
        model: pinocchio.Model.
        collision_model: pinocchio.GeometryModel. Its collision pairs are used, or all pairs on different
            bodies if it has no collision pairs.
        srdf: path of an SRDF file whose disabled pairs are excluded.
        links: names of links; only pairs with a shape on one of these links are used. The name of a joint
            selects all shapes that move with this joint. None selects all pairs.
        adjacent: whether the shapes of two bodies with a common joint may touch. The shapes of most robots
            overlap at their joints; an SRDF file disables these pairs by name.
        mu: kinetic coefficient of friction of all contacts.
        static_ratio: ratio of static to kinetic friction of all contacts, at least 1.
        restitution: coefficient of restitution of all contacts, 0 to 1.

    Returns:
        Descriptions for `Scene(contacts=)`.

    Raises:
        InputError: an argument is invalid, or a link has no shape.
        UnknownNameError: no link or joint has a name in `links`.
        LoadingError: the SRDF file cannot be read.
    """
    _check_models("geometry_contacts", model, collision_model)
    rubbing = _rubbing("geometry_contacts", mu, static_ratio, restitution)
    pairs = collision_model.copy()
    objects = list(pairs.geometryObjects)
    chosen = None if links is None else set(_shapes_of_links("geometry_contacts", links, model, objects))
    adjacent = flag("geometry_contacts: adjacent", adjacent)
    if len(pairs.collisionPairs) == 0:
        for i, j in combinations(range(len(objects)), 2):
            if objects[i].parentJoint != objects[j].parentJoint:
                pairs.addCollisionPair(pin.CollisionPair(i, j))
    if srdf is not None:
        path = file_path("geometry_contacts: srdf", srdf)
        if not path.is_file():
            raise LoadingError(f'geometry_contacts: srdf: no file "{path}"; give a path that exists')
        try:
            pin.removeCollisionPairs(model, pairs, str(path), False)
        except Exception as error:  # errors of Pinocchio and of its XML reader
            raise LoadingError(f'geometry_contacts: srdf "{path}" must be an SRDF file: {error}') from error
    contacts = []
    for pair in pairs.collisionPairs:
        ends = pair.first, pair.second
        if chosen is not None and chosen.isdisjoint(ends):
            continue
        if adjacent or not _share_a_joint(model, *(objects[i].parentJoint for i in ends)):
            contacts.append(GeometryContact(*(objects[i].name for i in ends), **rubbing))
    return contacts


def ground_contacts(
    model: Model,
    collision_model: GeometryModel,
    links: Sequence[str] | None = None,
    ground: str | GeometryObject | None = None,
    *,
    mu: float = 0.0,
    static_ratio: float = 1.0,
    restitution: float = 0.0,
) -> list[GeometryContact]:
    """Return a `GeometryContact` with the ground for each shape of some links, such as the feet of a robot.

    A link with one shape gives the contact its name, "LINK on GROUND"; else the names of the shapes do.

    Args:
        model: pinocchio.Model.
        collision_model: pinocchio.GeometryModel with the shapes of the links.
        links: names of links. The name of a joint selects all shapes that move with this joint. None selects
            the shapes of all moving bodies.
        ground: name of a shape of the collision model, or a pinocchio.GeometryObject on the world; None for
            `ground()`, the half-space z <= 0.
        mu: as in `geometry_contacts`.
        static_ratio: as in `geometry_contacts`.
        restitution: as in `geometry_contacts`.

    Returns:
        Descriptions for `Scene(contacts=)`.

    Raises:
        InputError: an argument is invalid, a link has no shape, or no shape is on a moving body.
        UnknownNameError: no link or joint has a name in `links`, or no shape is named `ground`.
    """
    who = "ground_contacts"
    _check_models(who, model, collision_model)
    rubbing = _rubbing(who, mu, static_ratio, restitution)
    objects = list(collision_model.geometryObjects)
    if ground is None:
        ground = plain_ground()
    elif not isinstance(ground, pin.GeometryObject):
        geometry_object(who, text(f"{who}: ground", ground), collision_model)
    below = str(ground.name if isinstance(ground, pin.GeometryObject) else ground)
    if links is None:
        shapes = {i: "" for i, item in enumerate(objects) if item.parentJoint and item.name != below}
        if not shapes:
            raise InputError(f"{who}: collision_model must have a shape on a moving body; it has none")
    else:
        shapes = _shapes_of_links(who, links, model, objects)
    single_links = [link for link in shapes.values() if link and list(shapes.values()).count(link) == 1]
    return [
        GeometryContact(
            objects[i].name, ground, name=pair_name(link, below) if link in single_links else None, **rubbing
        )
        for i, link in shapes.items()
    ]


def _check_models(who: str, model: object, collision_model: object) -> None:
    for what, value, kind in (
        ("model", model, pin.Model),
        ("collision_model", collision_model, pin.GeometryModel),
    ):
        if not isinstance(value, kind):
            hint = f"; pass scene.{what}" if hasattr(value, what) else ""
            raise InputError(
                f"{who}: {what} must be a pinocchio.{kind.__name__}; got {short_repr(value)}{hint}"
            )


def _rubbing(who: str, mu: object, static_ratio: object, restitution: object) -> dict[str, Any]:
    """Return the checked coefficients of contacts by name."""
    return {
        "mu": nonnegative(f"{who}: mu", mu),
        "static_ratio": ratio_of_static(who, static_ratio),
        "restitution": fraction(f"{who}: restitution", restitution),
    }


def _shapes_of_links(
    who: str, links: object, model: Model, objects: Sequence[GeometryObject]
) -> dict[int, str]:
    """Return the names of links by the indices of their shapes.

    Raises:
        InputError: the names are invalid, or a link has no shape.
        UnknownNameError: no link or joint has the name.
    """
    carriers = [set(_carriers(model, item)) for item in objects]
    known = [str(f.name) for f in model.frames if f.type == pin.FrameType.BODY] + list(model.names)[1:]
    link_of_shape: dict[int, str] = {}
    for link in sequence(f"{who}: links", links):
        indices = [i for i, names in enumerate(carriers) if text(f"{who}: link", link) in names]
        if not indices and link not in known:
            raise UnknownNameError(f'{who}: no link or joint "{link}" in the model{nearest(link, known)}')
        if not indices:
            raise InputError(
                f'{who}: link "{link}" has no shape in the collision model{_shaped(link, model, carriers)}'
            )
        link_of_shape |= {i: link for i in indices if i not in link_of_shape}
    return link_of_shape


def _shaped(link: str, model: Model, carriers: Sequence[set[str]]) -> str:
    """Return a text about the links with shapes that move with a link, or about links of similar names."""
    own_frames = [frame for frame in model.frames if frame.name == link]
    joint = str(model.names[own_frames[0].parentJoint]) if own_frames else link
    own = sorted(set().union(*(names for names in carriers if joint in names)) - {joint})
    if joint != "universe" and own:
        return f'; name "{own[0]}", which moves with it'
    return nearest(link, sorted(set().union(*carriers) - {"universe"}))


def _carriers(model: Model, item: GeometryObject) -> Iterator[str]:
    """Yield the names of the joint and of the link that carry a geometry object."""
    yield str(model.names[item.parentJoint])
    if item.parentFrame < model.nframes:
        yield str(model.frames[item.parentFrame].name)


def _share_a_joint(model: Model, first: int, second: int) -> bool:
    """Check if one of two moving bodies is the parent of the other."""
    return bool(first and second and (model.parents[first] == second or model.parents[second] == first))


def with_manifolds(contacts: Iterable[object], model: Model, geometry: object) -> tuple[Any, ...]:
    """Return contacts in which each `GeometryContact` is replaced by a `PairOfShapes` with its manifold.

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
    named: dict[str, Shape] = {}
    return tuple(_manifold(c, model, shapes, named) if isinstance(c, GeometryContact) else c for c in items)


def _manifold(
    c: GeometryContact, model: Model, geometry: GeometryModel, named: dict[str, Shape]
) -> PairOfShapes:
    """Return a pair of shapes with the contacts of its manifold. `named` keeps the shapes for other pairs."""
    who = label(c)
    first, second = (_shape(who, item, model, geometry, named) for item in (c.geometry1, c.geometry2))
    if first.frame == second.frame:
        raise InputError(f"{who}: both geometries are on the same body, which cannot touch itself")
    ground, thing = (first, second) if first.normal is not None else (second, first)
    base = c.name or pair_name(thing.name, ground.name)
    options = {"mu": c.mu, "static_ratio": c.static_ratio, "restitution": c.restitution}
    parts = manifold(who, first, second, c.rounding, base, options)
    return PairOfShapes(c, base, (first.name, second.name), parts)


def _shape(
    who: str, item: str | GeometryObject, model: Model, geometry: GeometryModel, named: dict[str, Shape]
) -> Shape:
    if isinstance(item, pin.GeometryObject):
        return shape_of(who, item, model)
    if item not in named:
        named[item] = shape_of(who, geometry_object(who, item, geometry), model)
    return named[item]
