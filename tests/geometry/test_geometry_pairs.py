"""All pairs of shapes of collision models: supported pairs, gaps and normals against Coal's."""

from __future__ import annotations

from itertools import combinations_with_replacement

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description.contacts.convex_hull import shrunk
from pin_nonideal.geometry.manifold import DEFAULT_ROUNDING

from ..support.contact_points import points_of
from ..support.mechanisms import body, empty, frame

# Difference from Coal's gaps if both are exact [m].
EXACT = 1e-9
# Difference of normals on a cone: Coal iterates (GJK), to the root of the distance error.
ROOT = 1e-5
RADIUS, HALF, SIZE = 0.15, 0.2, np.array([0.3, 0.5, 0.4])
SHAPES = ("sphere", "capsule", "box", "convex mesh", "cylinder", "cone", "ellipsoid", "half-space")
SOLIDS = ("sphere", "capsule", "box", "convex mesh")
KNOWN = {(shape, "half-space") for shape in SHAPES[:-1]} | set(combinations_with_replacement(SOLIDS, 2))
KNOWN |= {("sphere", "cylinder"), ("sphere", "cone")}
# The parts of these pairs are compared in test_cylinder_pairs.py.
IN_PARTS = {
    (shape, revolved) for shape in (*SOLIDS[1:], "cylinder", "cone") for revolved in ("cylinder", "cone")
}


def convex(points, scale=1.0):
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(1, len(points))
    mesh.addVertices(scale * np.asarray(points, dtype=float))
    mesh.addTriangle(*(scale * np.asarray(points[:3], dtype=float)))
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def cloud(seed=3, count=8):
    """Points of a lumpy solid about the origin."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return HALF * points / np.linalg.norm(points, axis=1)[:, None]


def shape(kind):
    return {
        "sphere": lambda: coal.Sphere(RADIUS),
        "capsule": lambda: coal.Capsule(RADIUS, 2.0 * HALF),
        "box": lambda: coal.Box(*SIZE),
        "convex mesh": lambda: convex(cloud()),
        "cylinder": lambda: coal.Cylinder(RADIUS, 2.0 * HALF),
        "cone": lambda: coal.Cone(RADIUS, 2.0 * HALF),
        "ellipsoid": lambda: coal.Ellipsoid(0.1, 0.2, 0.3),
        "half-space": lambda: coal.Halfspace(np.array([0.0, 0.6, 0.8]), 0.1),
    }[kind]()


def as_modelled(kind, other, edge):
    """Return the modeled shape of a contact, its local placement, and the radius around it.

    Rims of a cylinder or cone are inset behind its faces; pairs of solids with flat faces are rounded.
    """
    if kind in ("cylinder", "cone") and other == "half-space":
        back = DEFAULT_ROUNDING * RADIUS
        up = 0.0 if kind == "cylinder" else 0.5 * back
        make = coal.Cylinder if kind == "cylinder" else coal.Cone
        return make(RADIUS, 2.0 * HALF - (2.0 * back if kind == "cylinder" else back)), up, 0.0
    if kind in ("box", "convex mesh") and other in ("box", "convex mesh"):
        if kind == "box":
            return coal.Box(*(SIZE - 2.0 * edge)), 0.0, edge
        return convex(shrunk(cloud(), edge, "mesh")), 0.0, edge
    return shape(kind), 0.0, 0.0


def pair(one, other, **more):
    """A free body with one shape, and the other on the world, each away from its frame."""
    model, geometry = empty((0.0, 0.0, -9.81)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0, inertia=0.02 * np.eye(3))
    frame(model, "middle", joint)
    rng = np.random.default_rng(5)
    places = [pin.SE3(pin.exp3(rng.normal(size=3)), 0.1 * rng.normal(size=3)) for _ in range(2)]
    geometry.addGeometryObject(pin.GeometryObject("thing", joint, places[0], shape(one)))
    geometry.addGeometryObject(pin.GeometryObject("block", 0, places[1], shape(other)))
    contact = pn.GeometryContact("thing", "block", **more)
    return pn.Scene(model, contacts=[contact], collision_model=geometry), places


@pytest.mark.parametrize(("one", "other"), list(combinations_with_replacement(SHAPES, 2)))
def test_which_pairs_are_known(one, other):
    """Pairs are known in both orders; unsupported pairs raise an error that names them."""
    for first, second in {(one, other), (other, one)}:
        if (one, other) in KNOWN | IN_PARTS:
            assert pair(first, second)[0].contacts
        else:
            with pytest.raises(pn.InputError, match="this pair of shapes is not supported, a"):
                pair(first, second)


def placements(rng, count):
    """Yield placements far and near; few are deep inside each other."""
    for _ in range(count):
        toward = rng.normal(size=3)
        at = rng.uniform(0.35, 1.2) * toward / np.linalg.norm(toward)
        yield np.concatenate([at, pin.Quaternion(pin.exp3(3.0 * rng.normal(size=3))).coeffs()])


def by_coal(first, at1, second, at2):
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance, request.gjk_max_iterations = 1e-12, 1000
    places = (coal.Transform3s(at.rotation, at.translation) for at in (at1, at2))
    distance = coal.distance(first, next(places), second, next(places), request, result)
    return distance, np.array(result.normal)


def modelled(scene, q):
    """Return the smallest gap of all contact points, and its direction from the block to the thing."""
    A, _, gaps, _ = scene._compiled.program.runner().rows(q, np.zeros(6), 0.0)
    k = gaps.argmin()
    return gaps[k], pin.XYZQUATToSE3(q).rotation @ A.reshape(-1, 6)[k, :3]


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("one", "other"), sorted(KNOWN))
def test_gaps_and_normals_beside_coal(one, other, count):
    """Gaps and normals agree with Coal at random placements of separate shapes."""
    scene, places = pair(one, other)
    edge = max((getattr(c, "radius2", 0.0) for c in points_of(scene)), default=0.0)
    (first, up1, r1), (second, up2, r2) = as_modelled(one, other, edge), as_modelled(other, one, edge)
    shift1, shift2 = (pin.SE3(np.eye(3), np.array([0.0, 0.0, up])) for up in (up1, up2))
    rng, compared, worst = np.random.default_rng(1), 0, np.zeros(2)
    for q in placements(rng, count):
        at1, at2 = pin.XYZQUATToSE3(q) * places[0] * shift1, places[1] * shift2
        distance, normal = by_coal(first, at1, second, at2)
        if distance < r1 + r2 + 1e-3:
            continue
        gap, direction = modelled(scene, q)
        compared += 1
        worst = np.maximum(worst, [abs(gap - distance + r1 + r2), np.abs(direction + normal).max()])
    assert compared > 3 * count // 10
    assert worst[0] < EXACT
    assert worst[1] < (ROOT if other == "cone" else EXACT)
