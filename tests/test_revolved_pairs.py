"""Cylinders and cones with capsules, boxes and convex meshes, beside Coal's distances and closed forms."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.hulls import convex_hull, shrunk
from pin_nonideal.manifolds import FACE_CIRCLE, FACE_POINTS, LEAST_ROUNDING, PASSED_ON

from .test_geometry_pairs import EXACT, HALF, RADIUS, SIZE, by_coal, cloud, convex, modelled, pair, placements

REVOLVED, OTHERS = ("cylinder", "cone"), ("capsule", "box", "convex mesh")
ROUNDING = 0.01  # [m], so that cores are apart where shapes have entered each other a little
# Corners of a box of edges 2.
CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
# [m]: Coal's distances of what is nearer are asked for no digits.
NEAR = 1e-4
LINE = 1e-3  # [m], radius of what Coal takes for a segment or a point
BEHIND = 1e-4  # [m]
HERE = pin.SE3.Identity()


def raised(z):
    return pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))


def shape(kind):
    return (coal.Cone if kind == "cone" else coal.Cylinder)(RADIUS, 2.0 * HALF)


def octagons(kind):
    """Of the points that carry faces: pyramids to a place close behind, which nothing reaches from there."""
    turns = 2.0 * np.pi / FACE_POINTS * np.arange(FACE_POINTS)
    ring = FACE_CIRCLE * RADIUS * np.column_stack([np.cos(turns), np.sin(turns), np.zeros(FACE_POINTS)])
    ends = [-HALF] if kind == "cone" else [-HALF, HALF]
    ways = np.array([[0.0, 0.0, end] for end in ends])
    return [convex(np.vstack([ring + way, (1.0 - BEHIND / HALF) * way])) for way in ways]


def stood_back(kind, back):
    """The solid whose faces lie that much deeper, and where it is."""
    length = 2.0 * HALF
    if kind == "cone":
        return coal.Cone(RADIUS * (1.0 - back / length), length - back), raised(0.5 * back)
    return coal.Cylinder(RADIUS, length - 2.0 * back), HERE


def disks(kind):
    """What carries a capsule's ends: within the radius of these points, nearly as deep as rims stand back."""
    made = coal.Cylinder(FACE_CIRCLE * RADIUS, 2.0 * BEHIND)
    ends = [-1.0] if kind == "cone" else [-1.0, 1.0]
    return [(made, raised(end * (HALF - BEHIND))) for end in ends]


def flat(other, edge):
    """A box or mesh less an edge on all sides: Coal's shape, its corners, and its edges as pairs of these."""
    points = shrunk(0.5 * SIZE * CUBE if other == "box" else cloud(), edge, other)
    hull = convex_hull(points, other)
    return convex(points), hull.points, hull.points[hull.edges[:, :2]]


def point(at):
    return coal.Sphere(LINE), pin.SE3(np.eye(3), np.array(at))


def distance(first, at1, second, at2):
    """Coal's, in both orders: in one it takes some pairs that are apart for touching ones."""
    return max(by_coal(first, at1, second, at2)[0], by_coal(second, at2, first, at1)[0])


def segment(first, last):
    """A thin capsule, and where it is."""
    way = last - first
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).matrix()
    return coal.Capsule(LINE, float(np.linalg.norm(way))), pin.SE3(turn, 0.5 * (first + last))


class Modelled:
    """The distance of two shapes as their contacts stand for them, part by part, by Coal.

    Each part is one of either shape, where they are, and the radius around both.
    """

    def __init__(self, other, kind, edge, rounder, back):
        inner, plates = stood_back(kind, back), [(plate, HERE) for plate in octagons(kind)]
        if other == "capsule":
            ends = np.array([[0.0, 0.0, -HALF], [0.0, 0.0, HALF]])
            line = segment(*ends)
            self.parts = [(line, part, RADIUS - LINE) for part in (inner, *plates)]
            self.parts += [(point(end), disk, RADIUS - LINE) for end in ends for disk in disks(kind)]
            return
        core, corners, edges = flat(other, edge)
        self.parts = [((core, HERE), plate, edge) for plate in plates]
        self.parts.append(((flat(other, rounder)[0], HERE), inner, rounder))
        self.parts += [(point(at), (shape(kind), HERE), edge - LINE) for at in corners]
        if kind == "cone":
            self.parts.append(((core, HERE), point([0.0, 0.0, HALF]), edge - LINE))
        for first, last in edges:
            step = PASSED_ON * edge * (last - first) / np.linalg.norm(last - first)
            self.parts.append((segment(first + step, last - step), inner, edge - LINE))

    def apart(self, at_other, at_solid):
        """That of what the radii are around, and of all with these."""
        found = [
            (distance(first, at_other * place1, second, at_solid * place2), radius)
            for (first, place1), (second, place2), radius in self.parts
        ]
        return min(d for d, _ in found), min(d - radius for d, radius in found)


def modelled_as(scene, other, kind, rounding=None):
    """What the contacts of a scene stand for."""
    edge, rounder = (
        max((c.radius2 for c in scene.contacts if isinstance(c, kinds)), default=0.0)
        for kinds in (pn.BoxContact | pn.HullContact, pn.RimContact)
    )
    return Modelled(other, kind, edge, rounder, LEAST_ROUNDING * RADIUS if rounding is None else rounding)


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("kind", REVOLVED)
@pytest.mark.parametrize("rounding", [None, ROUNDING])
def test_gaps_beside_coal(kind, other, rounding):
    """At 1,000 random placements, those included that have entered each other by less than their rounding."""
    scene, places = pair(kind, other, rounding=rounding)
    oracle = modelled_as(scene, other, kind, rounding)
    compared, worst = 0, 0.0
    for q in placements(np.random.default_rng(1), 1000):
        cores, exact = oracle.apart(places[1], pin.XYZQUATToSE3(q) * places[0])
        if cores < NEAR:
            continue
        compared += 1
        worst = max(worst, abs(modelled(scene, q)[0] - exact))
    print(compared, worst)
    assert compared > 800
    assert worst < EXACT
