"""Convex meshes, cylinders and cones that touch other shapes: closed forms, boxes, and Coal's distances."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description.contacts.convex_hull import convex_hull, shrunk
from pin_nonideal.geometry.manifold import DEFAULT_ROUNDING

from ..support.contact_points import closed_points, point_loads
from ..support.mechanisms import GRAVITY, body, empty, frame
from ..support.same_run import assert_same_run
from .test_cylinder_pairs import distance
from .test_geometry_pairs import cloud, convex

DEPTH = 1e-10  # maximum penetration [m]
# Corners of a box of edges 1, in an order that is not that of the package's own boxes.
CUBE = np.array([[x, y, z] for z in (0.5, -0.5) for x in (-0.5, 0.5) for y in (0.5, -0.5)])
MESH, STONE = cloud(3, 6), 0.7 * cloud(8, 5)


def pair(shape, fixed, at=None, inertia=0.02, **more):
    """A free body of 1 kg with one shape, and another shape that is fixed in the world."""
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0, inertia=inertia * np.eye(3))
    frame(model, "middle", joint)
    geometry.addGeometryObject(pin.GeometryObject("thing", joint, pin.SE3.Identity(), shape))
    geometry.addGeometryObject(pin.GeometryObject("block", 0, at or pin.SE3.Identity(), fixed))
    contact = pn.GeometryContact("thing", "block", **more)
    return pn.Scene(model, contacts=[contact], collision_model=geometry)


@pytest.mark.parametrize(
    ("shape", "height"),
    [(coal.Sphere(0.1), 0.1), (coal.Capsule(0.1, 0.4), 0.3), (coal.Box(0.2, 0.3, 0.4), 0.2)],
    ids=["sphere", "capsule", "box"],
)
def test_a_mesh_of_a_box_is_that_box(shape, height):
    """Falling bodies with spin have equal motions on the mesh and the box, by different formulas."""
    size = np.array([1.0, 1.2, 0.4])
    q = [0.05, -0.03, 0.35 + height, *pin.Quaternion(pin.exp3(np.array([0.2, 0.1, 0.0]))).coeffs()]
    v = [0.3, 0.1, 0.0, 1.0, 0.5, -0.3]
    runs = [
        pn.simulate(pair(shape, fixed, mu=0.4, restitution=0.3), 0.3, q=q, v=v)
        for fixed in (coal.Box(*size), convex(CUBE * size))
    ]
    first, second = ([e.time for e in run.events if e.kind == "impact"][:3] for run in runs)
    assert first == pytest.approx(second, abs=1e-9)
    assert runs[0].q[-1] == pytest.approx(runs[1].q[-1], abs=1e-7)


@pytest.mark.parametrize(
    "fixed",
    [coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.2), coal.Box(2.0, 2.0, 0.4), convex(CUBE * [2.0, 2.0, 0.4])],
)
def test_a_foot_stands(fixed):
    """A mesh of a foot, six corners in its sole: they carry the weight, and nothing drifts."""
    sole = [[0.13, 0.03], [0.13, -0.03], [0.0, -0.05], [-0.1, -0.03], [-0.1, 0.03], [0.0, 0.05]]
    foot = [[*corner, -0.04] for corner in sole] + [
        [0.04, 0.03, 0.04],
        [0.04, -0.03, 0.04],
        [-0.06, 0.0, 0.06],
    ]
    run = pn.simulate(
        pair(convex(foot), fixed, mu=0.6), 5.0, q=[0.1, 0.05, 0.24, 0, 0, 0, 1], record="forces"
    )
    assert np.abs(run.q - run.q[0]).max() < 1e-12
    assert np.abs(run.v).max() == 0.0
    assert run.lam[-1].sum() == pytest.approx(GRAVITY, abs=1e-9)
    assert point_loads(run)[-1].min() >= 0.0


LYING = pin.SE3(pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0), np.zeros(3))


@pytest.mark.parametrize(("mu", "cosine"), [(0.0, 2.0 / 3.0), (1e6, 10.0 / 17.0)])
def test_a_ball_leaves_a_lying_cylinder(mu, cosine):
    """The ball leaves at cos = 2/3 without friction, and at 10/17 if it rolls, for a start on top."""
    r, start = 0.1, 0.2
    spin = 0.4 if mu else 0.0
    scene = pair(coal.Sphere(r), coal.Cylinder(0.9, 4.0), LYING, inertia=0.4 * r * r, mu=mu)
    speed = np.sqrt(2.0 * GRAVITY * (1.0 - np.cos(start)) / (1.0 + spin))
    v = speed * np.array([np.cos(start), 0.0, -np.sin(start), 0.0, (1.0 / r if mu else 0.0), 0.0])
    q = [np.sin(start), 0.3, np.cos(start), 0, 0, 0, 1]
    run = pn.simulate(scene, 1.0, q=q, v=v, rtol=1e-11, atol=1e-12)
    leaves = next(event.time for event in run.events if event.kind == "lift_off")
    x, y, z = run.q[np.argmin(np.abs(run.t - leaves)), :3]
    assert y == pytest.approx(0.3, abs=1e-10)
    assert z / np.hypot(x, z) == pytest.approx(cosine, abs=1e-6)


def test_a_ball_rolls_down_a_cone():
    """A ball rolls along the side with 5/7 g sin of the slope."""
    r, base, height = 0.05, 1.0, 0.8
    scene = pair(coal.Sphere(r), coal.Cone(base, height), inertia=0.4 * r * r, mu=0.9)
    length = np.hypot(base, height)
    out = np.array([height, 0.0, base]) / length
    down = np.array([base, 0.0, -height]) / length
    start = np.array([0.2, 0.0, 0.5 * height - 0.2 * height / base]) + r * out
    run = pn.simulate(scene, 0.4, q=[*start, 0, 0, 0, 1])
    along = (run.q[:, :3] - start) @ down
    assert along == pytest.approx(0.5 * 5.0 / 7.0 * GRAVITY * height / length * run.t**2, abs=1e-8)


def test_a_ball_rests_on_a_tip():
    """A ball stands in unstable rest over the tip of a cone and on the corner of a mesh."""
    for fixed in (
        coal.Cone(0.3, 0.4),
        convex([[0, 0, 0.2], [0.3, 0, -0.2], [-0.2, 0.2, -0.2], [-0.2, -0.2, -0.2]]),
    ):
        run = pn.simulate(
            pair(coal.Sphere(0.1), fixed, mu=0.5), 0.2, q=[0, 0, 0.3, 0, 0, 0, 1], record="forces"
        )
        assert np.abs(run.q[-1, :3] - [0.0, 0.0, 0.3]).max() < 1e-12
        assert run.lam[-1].sum() == pytest.approx(GRAVITY, abs=1e-9)


@pytest.mark.parametrize(
    "fixed", [coal.Box(1.0, 1.0, 0.4), convex(CUBE * [1.0, 1.0, 0.4]), coal.Cylinder(0.5, 0.4)], ids=type
)
@pytest.mark.parametrize(
    ("radius", "speed"), [(1e-2, 1.0), (1e-4, 1.0), (1e-4, 3.0), (1e-5, 1.0), (1e-6, 1.0), (1e-7, 3.0)]
)
def test_what_slides_over_an_edge_flies_off(fixed, radius, speed):
    """At the rounded edge v^2/r is 10 to 1e7 times g, so the body falls freely without friction."""
    scene = pair(coal.Sphere(radius), fixed)
    run = pn.simulate(scene, 0.5, q=[0.2, 0.1, 0.2 + radius, 0, 0, 0, 1], v=[speed, 0, 0, 0, 0, 0])
    edge = np.sqrt(0.25 - 0.01) if isinstance(fixed, coal.Cylinder) else 0.5
    assert [event.kind for event in run.events] == ["lift_off"]
    leaves = run.events[0].time
    assert leaves == pytest.approx((edge - 0.2) / speed, abs=1e-12)
    fallen = 0.5 * GRAVITY * (run.t[-1] - leaves) ** 2
    assert run.q[-1, :3] == pytest.approx([0.2 + 0.5 * speed, 0.1, 0.2 + radius - fallen], abs=1e-8)


@pytest.mark.parametrize("fixed", [coal.Box(1.0, 1.0, 0.4), convex(CUBE * [1.0, 1.0, 0.4])], ids=type)
@pytest.mark.parametrize("mu", [0.05, 0.5])
def test_what_rolls_over_an_edge_flies_off(fixed, mu):
    """The ball sticks until the edge, where friction and load jump, without slip or chatter."""
    radius, speed = 1e-4, 7.0
    scene = pair(coal.Sphere(radius), fixed, mu=mu, inertia=0.4 * radius**2)
    v = [speed, 0, 0, 0, speed / radius, 0]
    run = pn.simulate(scene, 0.05, q=[0.2, 0.1, 0.2 + radius, 0, 0, 0, 1], v=v)
    assert [event.kind for event in run.events] == ["lift_off"]
    assert run.events[0].time == pytest.approx(0.3 / speed, abs=1e-8)


@pytest.mark.parametrize("seed", [2, 19])
def test_bricks_that_slide_over_edges(seed):
    """Bricks collide so that a corner slides from a face over its edge, and the run continues."""
    rng = np.random.default_rng(seed)
    toward = rng.normal(size=3)
    toward /= np.linalg.norm(toward)
    turn = pin.Quaternion(pin.exp3(rng.normal(size=3)))
    v = np.concatenate([turn.toRotationMatrix().T @ (6.0 * toward), rng.normal(size=3) * 8.0])
    e, mu = float(rng.choice([0.0, 0.4])), rng.uniform(0.0, 0.8)
    q = np.concatenate([-1.2 * toward, turn.coeffs()])
    for fixed in (coal.Box(0.5, 0.3, 0.4), convex(MESH)):
        run = pn.simulate(pair(coal.Box(0.3, 0.4, 0.2), fixed, mu=mu, restitution=e), 0.5, q=q, v=v)
        assert any(event.kind == "impact" for event in run.events)


# Pairs of shapes, and the rounding of edges of solids with flat faces.
BRICK = CUBE * [0.3, 0.4, 0.2]


def min_edge(*clouds):
    hulls = [convex_hull(points, "hull") for points in clouds]
    return min(np.linalg.norm(h.points[e[0]] - h.points[e[1]]) for h in hulls for e in h.edges)


THROWN = {
    "sphere at mesh": (coal.Sphere(0.05), convex(MESH), 0.0),
    "capsule at mesh": (coal.Capsule(0.04, 0.3), convex(MESH), 0.0),
    "sphere at cylinder": (coal.Sphere(0.05), coal.Cylinder(0.15, 0.3), 0.0),
    "sphere at cone": (coal.Sphere(0.05), coal.Cone(0.2, 0.4), 0.0),
    "box at mesh": (BRICK, MESH, DEFAULT_ROUNDING * min_edge(BRICK, MESH)),
    "mesh at mesh": (STONE, MESH, DEFAULT_ROUNDING * min_edge(STONE, MESH)),
}


def thrown(kind, seed):
    """The scene, both shapes less their rounding, and the start."""
    first, second, edge = THROWN[kind]
    rng = np.random.default_rng(seed)
    toward = rng.normal(size=3)
    toward /= np.linalg.norm(toward)
    turn = pin.Quaternion(pin.exp3(rng.normal(size=3)))
    v = np.concatenate([turn.toRotationMatrix().T @ (6.0 * toward), rng.normal(size=3) * 8.0])
    start = {"q": np.concatenate([-1.2 * toward, turn.coeffs()]), "v": v}
    cores = [shape if edge == 0.0 else convex(shrunk(shape, edge, "mesh")) for shape in (first, second)]
    shapes = [shape if edge == 0.0 else convex(shape) for shape in (first, second)]
    restitution = float(rng.choice([0.0, 0.4]))
    return pair(*shapes, mu=rng.uniform(0.0, 0.8), restitution=restitution), cores, edge, start


@pytest.mark.parametrize("kind", THROWN)
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(60), marks=pytest.mark.stress)], ids=len)
def test_thrown_bodies_do_not_enter(kind, seeds):
    """Bodies with spin do not penetrate by Coal without rounding; one run is repeated bit by bit."""
    struck = 0
    for seed in seeds:
        scene, (first, second), edge, start = thrown(kind, seed)
        run = pn.simulate(scene, 0.5, output_dt=0.002, max_steps=20000, **start)
        assert np.isfinite(run.q).all()
        struck += any(event.kind == "impact" for event in run.events)
        world = pin.SE3.Identity()
        depths = [distance(first, pin.XYZQUATToSE3(q), second, world) for q in run.q]
        assert min(depths) > 2.0 * edge - DEPTH
        if seed == 0:
            assert_same_run(run, pn.simulate(scene, 0.5, output_dt=0.002, max_steps=20000, **start))
    assert struck > len(seeds) // 2


@pytest.mark.parametrize(
    ("kind", "seed"), [("box at mesh", 2), ("box at mesh", 73), ("box at mesh", 107), ("mesh at mesh", 92)]
)
def test_a_corner_comes_to_an_edge(kind, seed):
    """The load of a corner jumps from several newtons to zero at the edge, where it lifts off at once."""
    scene, _, _, start = thrown(kind, seed)
    run = pn.simulate(scene, 0.5, **start)
    assert run.t[-1] == 0.5
    assert not any(event.kind == "chatter" for event in run.events)
    assert run.events[-1].kind == "lift_off"


def test_a_corner_lands_beside_one_that_slides():
    """A corner lands slowly before another one leaves in the same step: its impact is found."""
    scene, (first, second), edge, start = thrown("mesh at mesh", 168)
    run = pn.simulate(scene, 0.25, output_dt=1e-4, **start)
    assert closed_points(run).shape[1] > 1
    assert sum(event.kind == "impact" for event in run.events) > 1
    depths = [distance(first, pin.XYZQUATToSE3(q), second, pin.SE3.Identity()) for q in run.q]
    assert min(depths) > 2.0 * edge - DEPTH


def test_faces_move_inward():
    """Each face moves by the same distance; corners of more than three faces split."""
    inner = convex_hull(shrunk(cloud(), 0.01, "mesh"), "inner")
    outer = convex_hull(cloud(), "outer")
    for plane in inner.planes:
        k = np.abs(outer.planes[:, :3] - plane[:3]).sum(axis=1).argmin()
        assert outer.planes[k] - plane == pytest.approx([0.0, 0.0, 0.0, 0.01], abs=1e-9)
    with pytest.raises(pn.InputError, match="mesh is too thin to round its edges by"):
        shrunk(cloud(), 0.1, "mesh")


def test_a_cube_has_six_faces():
    cube = convex_hull(CUBE, "cube")
    assert (len(cube.points), len(cube.planes), len(cube.edges)) == (8, 6, 12)


def test_meshes_of_many_edges_are_refused():
    round_stone = convex(cloud(1, 60))
    with pytest.raises(
        pn.InputError, match="two shapes may have at most 1000 contact points, and these have"
    ):
        pair(round_stone, round_stone)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: pn.HullContact("a", "b", CUBE[:4], 0.1),
            "points must span a solid, at least four points out of",
        ),
        (lambda: pn.HullContact("a", "b", CUBE, 0.0), "one of radius1 and radius2 must be positive"),
        (lambda: pn.HullContact("a", "a", CUBE, 0.1), 'frame1 and frame2 must differ; both are "a"'),
        (lambda: pn.CylinderContact("a", "b", 0.1, 0.0, 0.1), "one of below and above must be positive"),
        (lambda: pn.CylinderContact("a", "b", 0.0, 0.1, 0.1), "length must be positive; got 0"),
        (lambda: pn.CylinderContact("a", "a", 0.1, 0.1, 0.1), 'frame1 and frame2 must differ; both are "a"'),
    ],
)
def test_bad_descriptions(make, message):
    with pytest.raises(pn.InputError) as error:
        make()
    assert message in str(error.value)
