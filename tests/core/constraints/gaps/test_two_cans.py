"""Contacts between cylinders and cones: gaps with a proof and by Coal, rest, rolling and flight."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn
from pin_nonideal.geometry.cylinder import DEFAULT_ROUNDING, FACE_CIRCLE_RATIO, SIDE_INSET

from ....geometry.test_cylinder_pairs import (
    CAN,
    HERE,
    LEVEL,
    LYING,
    assert_rows_are_differences_of_gaps,
    distance,
    free,
    point,
    segment,
)
from ....geometry.test_geometry_pairs import EXACT, by_coal, pair, placements, shape
from ....support.contact_points import point_loads, points_of
from ....support.mechanisms import GRAVITY, body, empty, frame
from ....support.same_run import assert_same_run

PAIRS = [("cylinder", "cylinder"), ("cylinder", "cone"), ("cone", "cone")]
ROUNDING = 0.01  # [m]
PROVED = 1e-13  # rounding of the separating planes that prove a gap [m]
COAL = 1e-6  # error of Coal's iterative distance of disks in 1 of 1,000 placements [m]
NEAR = 1e-4  # [m]: smaller distances of Coal are not compared
LINE = 1e-3  # radius of Coal's segments and points [m]
THIN = 1e-12  # [m]
# Difference between true shapes and their contacts, in radii of rounding.  Rims are inset and rounded, 1.3 at
# a right angle, and the tip by 1 / sin of half its angle, on both bodies.
ROUNDED_OFF = 6.0
DEPTH = 1e-10  # maximum penetration [m]
LEDGER = 1e-5  # energy error of default step control, of about 20 J [J]
CONE = coal.Cone(0.1, 0.3)
FLOOR = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


def at(frame, xyz, rpy, q):
    """Return the placement of a shape on a frame for the free body at q."""
    there = HERE if frame == "universe" else pin.XYZQUATToSE3(q)
    return there * pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))


def both(c, q):
    """Return both solids of a contact: half length, radii and placement."""
    places = at(c.frame1, c.xyz1, c.rpy1, q), at(c.frame2, c.xyz2, c.rpy2, q)
    return [
        (np.array(solid) * [0.5, 1.0, 1.0], at)
        for solid, at in zip((c.solid1, c.solid2), places, strict=True)
    ]


def reach(solid, place, direction):
    """Return the largest component of a solid's points along a direction, at its rims."""
    half, *radii = solid
    axis = place.rotation[:, 2]
    across = np.linalg.norm(direction - direction.dot(axis) * axis)
    ends = [end * direction.dot(axis) + r * across for end, r in zip((-half, half), radii, strict=True)]
    return direction.dot(place.translation) + max(ends)


@pytest.mark.parametrize("rounding", [None, ROUNDING])
@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kinds", PAIRS)
def test_gaps_with_a_proof(kinds, rounding, count):
    """At random placements, separating planes at the distance of the gap prove it; Coal agrees."""
    scene, _ = pair(*kinds, rounding=rounding)
    runner, compared = scene._compiled.program.runner(), 0
    chosen = [(i, c) for i, c in enumerate(points_of(scene)) if isinstance(c, pn.RevolvedContact)]
    for q in placements(np.random.default_rng(1), count):
        A, _, gaps, _ = runner.rows(q, np.zeros(6), 0.0)
        for i, c in chosen:
            *shapes, radius = as_coal(c, q)
            exact = distance(*shapes)
            if exact < NEAR:
                continue
            (solid1, place1), (solid2, place2) = both(c, q)
            # Sign of the normal: the row refers to the free body.
            sign = 1.0 if c.frame2 == "universe" else -1.0
            n = sign * (pin.XYZQUATToSE3(q).rotation @ A.reshape(-1, 6)[i, :3])
            between = -reach(solid1, place1, -n) - reach(solid2, place2, n)
            assert gaps[i] + radius == pytest.approx(between, abs=PROVED)
            assert between == pytest.approx(exact, abs=COAL)
            compared += 1
    assert compared > 0.8 * count * len(chosen)


def as_coal(c, q):
    """Return a contact's two shapes for Coal, their placements, and the radius around both."""

    def revolved(solid):
        length, below, above = solid
        return coal.Cone(below, length) if above == 0.0 else coal.Cylinder(below, max(length, THIN))

    if isinstance(c, pn.RevolvedContact):
        (_, place1), (_, place2) = both(c, q)
        return revolved(c.solid1), place1, revolved(c.solid2), place2, c.radius1 + c.radius2
    where1, where2 = (at(frame, np.zeros(3), np.zeros(3), q) for frame in (c.frame1, c.frame2))

    def line(where, ends):
        made, place = segment(*np.array(ends))
        return made, where * place

    if isinstance(c, pn.CapsuleContact):
        radius = c.radius1 + c.radius2 - 2.0 * LINE
        return *line(where1, c.segment1), *line(where2, c.segment2), radius
    thing, place = point(c.offset) if c.end is None else segment(np.array(c.offset), np.array(c.end))
    solid = revolved((c.length, c.below, c.above))
    return thing, where1 * place, solid, at(c.frame2, c.xyz, c.rpy, q), c.radius1 + c.radius2 - LINE


@pytest.mark.parametrize("kinds", PAIRS)
def test_gaps_beside_coal(kinds):
    """Compare each contact point at random placements."""
    scene, _ = pair(*kinds, rounding=ROUNDING)
    runner, worst, compared = scene._compiled.program.runner(), 0.0, 0
    for q in placements(np.random.default_rng(3), 12):
        gaps = runner.rows(q, np.zeros(6), 0.0)[2]
        for gap, c in zip(gaps, points_of(scene), strict=True):
            *shapes, radius = as_coal(c, q)
            exact = distance(*shapes)
            if exact > NEAR:
                compared += 1
                worst = max(worst, abs(gap + radius - exact))
    assert compared > 10 * len(gaps)
    assert worst < COAL


@pytest.mark.parametrize("shift", [0.0, 1e-15, 1e-9, 0.05])
def test_gaps_of_solids_on_one_axis(shift):
    """The distance is even around the rim of the larger face; no point of this rim is the nearest one."""
    rng = np.random.default_rng(2)
    for _ in range(100):
        length1, length2 = rng.uniform(0.0, 0.5, 2)
        below1, above1, below2, above2 = rng.uniform(0.06, 0.4, 4)
        model, away = empty(), rng.uniform(1e-3, 0.3)
        joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0)
        frame(model, "solid", joint)
        contact = pn.RevolvedContact(
            "solid", "universe", (length1, below1, above1), (length2, below2, above2), 0.01, 0.002
        )
        runner = pn.Scene(model, contacts=[contact])._compiled.program.runner()
        up = 0.5 * (length1 + length2) + away
        for height, turn in ((up, np.eye(3)), (-up, np.eye(3)), (up, np.diag([1.0, -1.0, -1.0]))):
            way = rng.normal(size=2)
            place = np.array([*(shift * way / np.linalg.norm(way)), height])
            q = np.concatenate([place, pin.Quaternion(turn @ pin.exp3(np.array([0.0, 0.0, 1.0]))).coeffs()])
            A, _, gaps, _ = runner.rows(q, np.zeros(6), 0.0)
            assert gaps[0] == pytest.approx(away - 0.012, abs=PROVED)
            normal = pin.XYZQUATToSE3(q).rotation @ A.reshape(-1, 6)[0, :3]
            np.testing.assert_allclose(normal, [0.0, 0.0, np.sign(height)], atol=1e-12)


@pytest.mark.parametrize("kinds", PAIRS)
def test_nothing_is_left_out(kinds):
    """The distance of the true shapes is at least the contact gap, up to the rounding of rims."""
    scene, places = pair(*kinds)
    by = max(c.radius2 for c in points_of(scene))
    runner, less, most = scene._compiled.program.runner(), 0.0, 0.0
    for q in placements(np.random.default_rng(4), 1000):
        exact = by_coal(shape(kinds[0]), pin.XYZQUATToSE3(q) * places[0], shape(kinds[1]), places[1])[0]
        if exact < NEAR:
            continue
        off = runner.rows(q, np.zeros(6), 0.0)[2].min() - exact
        less, most = min(less, off), max(most, off)
    assert less > -EXACT
    assert most < ROUNDED_OFF * by


@pytest.mark.parametrize("kinds", PAIRS)
def test_rows_are_differences_of_gaps(kinds):
    assert_rows_are_differences_of_gaps(pair(*kinds)[0])


def turned(x=0.0, y=0.0, z=0.0):
    return pin.Quaternion(pin.rpy.rpyToMatrix(x, y, z)).coeffs()


def resting(thing, fixed, starts, mu=0.5):
    """Return free bodies of 1 kg with one shape that touch each other and a fixed shape."""
    model, geometry, contacts = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel(), []
    for i, (block, place) in enumerate(fixed):
        geometry.addGeometryObject(pin.GeometryObject(f"block{i}", 0, place, block))
    for k in range(len(starts)):
        joint = body(model, 0, pin.JointModelFreeFlyer(), f"free{k}", 1.0, inertia=0.02 * np.eye(3))
        geometry.addGeometryObject(pin.GeometryObject(f"thing{k}", joint, HERE, thing))
        contacts += [pn.GeometryContact(f"thing{k}", f"block{i}", mu=mu) for i in range(len(fixed))]
        contacts += [pn.GeometryContact(f"thing{k}", f"thing{k - 1}", mu=mu)] * (k > 0)
    scene = pn.Scene(model, contacts=contacts, collision_model=geometry)
    return pn.simulate(scene, 1.0, q=np.concatenate(starts), record="forces")


def lying(x=0.0, y=0.0):
    return pin.SE3(pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0), np.array([x, y, 0.0]))


BACK = 2.0 * SIDE_INSET * DEFAULT_ROUNDING * 0.1  # inset of both sides at their crossing [m]
# Shape, fixed shape, placement, and minimum number of contact points.
AT_REST = {
    "can on can": (CAN, coal.Cylinder(0.1, 0.4), HERE, [0.0, 0.0, 0.35, *LEVEL], 8),
    "can half on can": (CAN, coal.Cylinder(0.1, 0.4), HERE, [0.06, 0.03, 0.35, *LEVEL], 3),
    "small on large": (coal.Cylinder(0.05, 0.3), coal.Cylinder(0.3, 0.4), HERE, [0.1, 0.0, 0.35, *LEVEL], 3),
    "large on small": (coal.Cylinder(0.3, 0.3), coal.Cylinder(0.05, 0.4), HERE, [0.0, 0.01, 0.35, *LEVEL], 3),
    "cone on can": (CONE, coal.Cylinder(0.1, 0.4), HERE, [0.02, 0.01, 0.35, *LEVEL], 3),
    "can on its side": (CAN, coal.Cylinder(0.5, 0.4), HERE, [0.04, 0.02, 0.3, *LYING], 2),
    "can on its side on a narrow one": (CAN, coal.Cylinder(0.1, 0.4), HERE, [0.0, 0.02, 0.3, *LYING], 2),
    "can on one that lies": (CAN, CAN, lying(), [0.0, 0.02, 0.25, *LEVEL], 2),
    "coin on one that lies": (coal.Cylinder(0.1, 0.02), CAN, lying(), [0.0, 0.0, 0.11, *LEVEL], 2),
    "along one that lies": (CAN, CAN, lying(), [0.0, 0.05, 0.2, *LYING], 2),
    "crosswise": (CAN, CAN, lying(), [0.0, 0.0, 0.2 - BACK, *turned(y=0.5 * np.pi)], 1),
}


@pytest.mark.parametrize("what", AT_REST)
def test_what_rests(what):
    """The body stays at rest with zero velocity, and the contact force equals its weight."""
    thing, fixed, place, start, least = AT_REST[what]
    run = resting(thing, [(fixed, place)], [start])
    assert np.abs(run.v).max() == 0.0
    assert run.lam[-1].sum() == pytest.approx(GRAVITY, abs=1e-9)
    assert point_loads(run)[-1].min() >= 0.0
    assert (point_loads(run)[-1] > 0.0).sum() >= least


def test_a_can_in_the_valley_between_two():
    """The cans are parallel; the normals have the slope of a 3-4-5 triangle."""
    run = resting(CAN, [(CAN, lying(-0.12)), (CAN, lying(0.12, 0.05))], [[0.0, 0.02, 0.16, *LYING]], mu=0.0)
    assert np.abs(run.v).max() == 0.0
    assert 0.8 * run.lam[-1].sum() == pytest.approx(GRAVITY, abs=1e-9)
    assert (point_loads(run)[-1] > 0.0).sum() == 4


@pytest.mark.parametrize("thing", [CAN, CONE], ids=["cans", "cones"])
def test_they_stand_side_by_side(thing):
    run = resting(thing, [(FLOOR, HERE)], [[0.0, 0.0, 0.15, *LEVEL], [0.2, 0.0, 0.15, *LEVEL]])
    assert np.abs(run.v).max() == 0.0
    assert run.lam[-1].sum() == pytest.approx(2.0 * GRAVITY, abs=1e-9)


def test_they_lie_side_by_side():
    run = resting(CAN, [(FLOOR, HERE)], [[0.0, 0.0, 0.1, *LYING], [0.2, 0.05, 0.1, *LYING]])
    assert np.abs(run.v).max() == 0.0
    assert run.lam[-1].sum() == pytest.approx(2.0 * GRAVITY, abs=1e-9)


def test_a_stack_of_three():
    starts = [[0.0, 0.0, 0.15, *LEVEL], [0.02, 0.01, 0.45, *LEVEL], [0.03, -0.02, 0.75, *LEVEL]]
    run = resting(CAN, [(FLOOR, HERE)], starts)
    assert np.abs(run.v).max() == 0.0
    loads = sorted(load for load in run.lam[-1] if load > 0.0)
    assert loads == pytest.approx([GRAVITY, 2.0 * GRAVITY, 3.0 * GRAVITY], abs=1e-9)


@pytest.mark.parametrize(("part", "falls"), [(0.99, False), pytest.param(1.05, True, marks=pytest.mark.slow)])
def test_a_can_over_the_rim_of_another(part, falls):
    """The can stands while its weight acts inside chords of both faces, and falls beyond the rim."""
    turn = np.pi / 8.0  # rotates the chords across the direction to the rim
    reach = 0.1 if falls else FACE_CIRCLE_RATIO * 0.1 * np.cos(turn)
    below = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, turn), np.zeros(3))
    run = resting(CAN, [(CAN, below)], [[part * reach, 0.0, 0.3, *turned(z=turn)]])
    if falls:
        assert pin.XYZQUATToSE3(run.q[-1]).rotation[2, 2] < 0.99
    else:
        assert np.abs(run.v).max() == 0.0


@pytest.mark.parametrize("lean", [0.3, -0.5])
def test_a_can_stands_on_the_rim_of_another(lean):
    """A can on a vertical slide comes to rest with its lower rim on the upper rim of a tilted can."""
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelPZ(), "slide", 1.0, inertia=0.02 * np.eye(3))
    geometry.addGeometryObject(pin.GeometryObject("can", joint, HERE, CAN))
    below = pin.SE3(pin.rpy.rpyToMatrix(0.0, lean, 0.0), np.array([0.15 * np.sign(lean), 0.0, -0.3]))
    geometry.addGeometryObject(pin.GeometryObject("block", 0, below, CAN))
    scene = pn.Scene(model, contacts=[pn.GeometryContact("can", "block")], collision_model=geometry)
    run = pn.simulate(scene, 1.0, q=[0.1], record="forces")
    assert np.abs(run.v[-1]).max() == 0.0
    (carried,) = np.flatnonzero(point_loads(run)[-1])
    row = scene.jacobian("can on block", run.q[-1])[
        scene._compiled.points["can on block"].index(run.points.names[carried])
    ]
    assert run.lam[-1, 0] * row[0] == pytest.approx(GRAVITY, abs=1e-9)
    exact = distance(CAN, pin.SE3(np.eye(3), np.array([0.0, 0.0, run.q[-1, 0]])), CAN, below)
    assert abs(exact) < ROUNDED_OFF * DEFAULT_ROUNDING * 0.1


@pytest.mark.parametrize("order", [1, -1])
def test_a_can_rolls_over_a_can_that_lies_crosswise(order):
    """Rolling without slip; the reference is a separate integration of a block on a cylinder."""
    size, thick, inertia = 0.4, 0.1, 0.03
    by = SIDE_INSET * DEFAULT_ROUNDING * thick  # inset of the sides
    radius, half = size - by, thick - by

    def rate(_, y):
        angle, spin = y
        moment = radius**2 * angle * spin**2 + GRAVITY * (
            radius * angle * np.cos(angle) - half * np.sin(angle)
        )
        return [spin, -moment / (inertia + (radius * angle) ** 2 + half**2)]

    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0, inertia=inertia * np.eye(3))
    along = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.5 * np.pi, 0.0), np.zeros(3))
    geometry.addGeometryObject(pin.GeometryObject("can", joint, along, coal.Cylinder(thick, 0.6)))
    geometry.addGeometryObject(pin.GeometryObject("roll", 0, lying(), coal.Cylinder(size, 2.0)))
    contact = pn.GeometryContact(*("can", "roll")[::order], mu=2.0)
    scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
    start = 0.2
    turn = pin.rpy.rpyToMatrix(0.0, start, 0.0)
    where = (radius + half) * turn[:, 2] - radius * start * turn[:, 0]
    run = pn.simulate(scene, 1.0, q=[*where, *pin.Quaternion(turn).coeffs()], rtol=1e-10, atol=1e-11)
    exact = solve_ivp(rate, (0.0, 1.0), [start, 0.0], t_eval=[1.0], rtol=1e-11, atol=1e-12).y[0, -1]
    found = pin.rpy.matrixToRpy(pin.XYZQUATToSE3(run.q[-1]).rotation)
    assert found == pytest.approx([0.0, exact, 0.0], abs=1e-7)
    assert {event.kind for event in run.events} <= {"stick"}


def thrown(kinds, seed):
    """Return the scene with either body free, and the start."""
    rng = np.random.default_rng(seed)
    toward = rng.normal(size=3)
    toward /= np.linalg.norm(toward)
    turn = pin.Quaternion(pin.exp3(rng.normal(size=3)))
    v = np.concatenate([turn.toRotationMatrix().T @ (6.0 * toward), rng.normal(size=3) * 8.0])
    shapes = [shape(kind) for kind in kinds][:: 1 if seed % 2 else -1]
    e, mu = float(rng.choice([0.0, 0.4])), rng.uniform(0.0, 0.8)
    return free(*shapes, mu=mu, restitution=e), {"q": np.concatenate([-1.2 * toward, turn.coeffs()]), "v": v}


@pytest.mark.parametrize("kinds", PAIRS)
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(200), marks=pytest.mark.stress)], ids=len)
def test_thrown_bodies_do_not_enter(kinds, seeds):
    """No contact point of a spinning body penetrates, and the energy ledger closes; repeated bit by bit."""
    struck = 0
    for seed in seeds:
        scene, start = thrown(kinds, seed)
        run = pn.simulate(scene, 0.5, output_dt=0.002, max_steps=20000, record="energy", **start)
        struck += any(event.kind == "impact" for event in run.events)
        assert np.abs(run.energy["balance"]).max() < LEDGER
        runner = scene._compiled.program.runner()
        assert min(runner.rows(q, np.zeros(6), 0.0)[2].min() for q in run.q) > -DEPTH
        if seed == 0:
            again = pn.simulate(scene, 0.5, output_dt=0.002, max_steps=20000, record="energy", **start)
            assert_same_run(run, again)
    assert struck > len(seeds) // 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pn.RevolvedContact("a", "a", (1, 1, 1), (1, 1, 1), 0.1), 'differ; both are "a"'),
        (lambda: pn.RevolvedContact("a", "b", (1, 1, 1), (1, 1, 1), 0.0), "radius1 must be positive; got 0"),
        (
            lambda: pn.RevolvedContact("a", "b", (1, 0, 0), (1, 1, 1), 0.1),
            "solid1 must be a length and two radii, none negative and one radius positive; without a length "
            "the radii must be equal; got [1.0, 0.0, 0.0]",
        ),
        (lambda: pn.RevolvedContact("a", "b", (1, 1, 1), (0, 1, 2), 0.1), "got [0.0, 1.0, 2.0]"),
        (lambda: pn.CylinderContact("a", "b", 0.1, 0.1, 0.0), "radius1 must be positive; got 0"),
        (
            lambda: pair("cylinder", "cone", rounding=0.1),
            "rounding must be less than 0.4 of the largest ball inside both, of radius",
        ),
    ],
)
def test_bad_descriptions(make, message):
    with pytest.raises(pn.InputError) as error:
        make()
    assert message in str(error.value)
