"""Cylinders and cones with capsules, boxes and convex meshes, beside Coal's distances and closed forms."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import pin_nonideal as pn
from pin_nonideal.description.contacts.convex_hull import shrunk
from pin_nonideal.geometry.cylinder import DEFAULT_ROUNDING, FACE_CIRCLE_RATIO, FACE_POINTS, SIDE_INSET

from ..support.contact_points import point_loads, points_of
from ..support.mechanisms import GRAVITY, body, empty
from ..support.same_run import assert_same_run
from .test_geometry_pairs import EXACT, HALF, RADIUS, SIZE, by_coal, cloud, convex, modelled, pair, placements
from .test_geometry_pairs import shape as any_shape

REVOLVED, OTHERS = ("cylinder", "cone"), ("capsule", "box", "convex mesh")
ROUNDING = 0.01  # [m]: cores are separate for small penetration
# Corners of a box of edges 2.
CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
# [m]: smaller distances of Coal are not compared.
NEAR = 1e-4
LINE = 1e-3  # radius of Coal's segments and points [m]
BEHIND = 1e-4  # [m]
THIN = 1e-12  # [m]
HERE = pin.SE3.Identity()
DEPTH = 1e-10  # maximum penetration [m]
LEDGER = 1e-5  # energy error of default step control, of about 20 J [J]
REACH = 0.8  # [m], beyond which nothing touches
STEP = 1e-6  # [s], of differences
SMOOTH = 1e-10  # [m], by which a gap bends over it at the most where its slope is one


def raised(z):
    return pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))


def shape(kind):
    return (coal.Cone if kind == "cone" else coal.Cylinder)(RADIUS, 2.0 * HALF)


def octagons(kind):
    """Return octagons of the face points, as pyramids with an apex close behind the face."""
    turns = 2.0 * np.pi / FACE_POINTS * np.arange(FACE_POINTS)
    ring = FACE_CIRCLE_RATIO * RADIUS * np.column_stack([np.cos(turns), np.sin(turns), np.zeros(FACE_POINTS)])
    ends = [-HALF] if kind == "cone" else [-HALF, HALF]
    ways = np.array([[0.0, 0.0, end] for end in ends])
    return [convex(np.vstack([ring + way, (1.0 - BEHIND / HALF) * way])) for way in ways]


def stood_back(kind, back, by=0.0):
    """Return the solid with its faces and side moved inward, and the placement of the solid."""
    length, radius = 2.0 * HALF, RADIUS - by
    if kind == "cone":
        return coal.Cone(radius * (1.0 - back / length), length - back), raised(0.5 * back)
    return coal.Cylinder(radius, length - 2.0 * back), HERE


def disks(kind, back):
    """Return the rims of the inset solid, thinner than Coal's resolution, and their placements."""
    radius = RADIUS * (1.0 - back / (2.0 * HALF)) if kind == "cone" else RADIUS
    made = coal.Cylinder(radius, 2.0 * THIN)
    ends = [-1.0] if kind == "cone" else [-1.0, 1.0]
    return [(made, raised(end * (HALF - back - THIN))) for end in ends]


def slices(kind, back):
    """Return the outline of the inset solid from the axis over both faces: (radius, height)."""
    heights = [(-HALF + back, -HALF + 2.0 * back)]
    if kind == "cylinder":
        heights.append((HALF - 2.0 * back, HALF - back))
    radii = [
        [RADIUS * ((HALF - z) / (2.0 * HALF) if kind == "cone" else 1.0) for z in both] for both in heights
    ]
    return [
        np.array([[0.0, a], [p, a], [q, b], [0.0, b]]) for (a, b), (p, q) in zip(heights, radii, strict=True)
    ]


def from_slice(outline, at):
    """Return the distance of an outside point from the solid of revolution of an outline."""
    place = np.array([np.hypot(at[0], at[1]), at[2]])
    first, way = outline[:-1], np.diff(outline, axis=0)
    part = np.clip(((place - first) * way).sum(axis=1) / (way**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(first + part[:, None] * way - place, axis=1).min()


def flat(other, edge):
    """A box or mesh less an edge on all sides: Coal's shape, and its corners."""
    points = shrunk(0.5 * SIZE * CUBE if other == "box" else cloud(), edge, other)
    return convex(points), points


def point(at):
    return coal.Sphere(LINE), pin.SE3(np.eye(3), np.array(at))


def distance(first, at1, second, at2):
    """Return Coal's distance, the larger one of both orders: in one order some separate pairs touch."""
    return max(by_coal(first, at1, second, at2)[0], by_coal(second, at2, first, at1)[0])


def segment(first, last):
    """A thin capsule, and where it is."""
    way = last - first
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).matrix()
    return coal.Capsule(LINE, float(np.linalg.norm(way))), pin.SE3(turn, 0.5 * (first + last))


def free(thing, fixed, *, inertia=None, gravity=(0.0, 0.0, -GRAVITY), **more):
    """A free body of 1 kg with one shape, and another shape that is fixed in the world."""
    model, geometry = empty(gravity), pin.GeometryModel()
    about = 0.02 * np.eye(3) if inertia is None else inertia
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0, inertia=about)
    geometry.addGeometryObject(pin.GeometryObject("thing", joint, HERE, thing))
    geometry.addGeometryObject(pin.GeometryObject("block", 0, HERE, fixed))
    contact = pn.GeometryContact("thing", "block", **more)
    return pn.Scene(model, contacts=[contact], collision_model=geometry)


class Modelled:
    """Distance by Coal of the parts of two shapes that their contacts represent.

    Each part is one of either shape, where they are, and the radius around both; of a segment and the rims
    that stand back by a search along it.
    """

    def __init__(self, other, kind, edge, back):
        side = stood_back(kind, back, SIDE_INSET * (edge or back))
        plates, whole = [(plate, HERE) for plate in octagons(kind)], (shape(kind), HERE)
        self.slices = []
        if other == "capsule":
            ends = np.array([[0.0, 0.0, -HALF], [0.0, 0.0, HALF]])
            self.parts = [(segment(*ends), part, RADIUS - LINE) for part in (side, *plates)]
            self.parts += [(point(end), whole, RADIUS - LINE) for end in ends]
            self.slices = slices(kind, back)
            return
        core, corners = flat(other, edge)
        self.parts = [((core, HERE), part, edge) for part in (side, *plates, *disks(kind, back))]
        self.parts += [(point(at), whole, edge - LINE) for at in corners]
        if kind == "cone":
            self.parts.append(((core, HERE), point([0.0, 0.0, HALF]), edge - LINE))

    def apart(self, at_other, at_solid):
        """Return the distance of the cores, and the distance including the radii."""
        found = [
            (distance(first, at_other * place1, second, at_solid * place2), radius)
            for (first, place1), (second, place2), radius in self.parts
        ]
        there = at_solid.actInv(at_other)
        for outline in self.slices:
            along = minimize_scalar(
                lambda z, outline=outline: from_slice(outline, there.act(np.array([0.0, 0.0, z]))),
                bounds=(-HALF, HALF),
                options={"xatol": 1e-10},
            )
            found.append((along.fun, RADIUS))
        return min(d for d, _ in found), min(d - radius for d, radius in found)


def modelled_as(scene, other, kind, rounding=None):
    """Return the modeled shapes of the contacts of a scene."""
    edge = max((c.radius2 for c in points_of(scene) if isinstance(c, pn.RimContact)), default=0.0)
    return Modelled(other, kind, edge, DEFAULT_ROUNDING * RADIUS if rounding is None else rounding)


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("kind", REVOLVED)
@pytest.mark.parametrize("rounding", [None, ROUNDING])
@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_gaps_beside_coal(kind, other, rounding, count):
    """Gaps agree with Coal at random placements, also if shapes penetrate by less than their rounding."""
    scene, places = pair(kind, other, rounding=rounding)
    oracle = modelled_as(scene, other, kind, rounding)
    compared, worst = 0, 0.0
    for q in placements(np.random.default_rng(1), count):
        cores, exact = oracle.apart(places[1], pin.XYZQUATToSE3(q) * places[0])
        if cores < NEAR:
            continue
        compared += 1
        worst = max(worst, abs(modelled(scene, q)[0] - exact))
    assert compared > 0.8 * count
    assert worst < EXACT


def assert_rows_are_differences_of_gaps(scene):
    """Assert the row of every contact point along a random motion, by central differences."""
    rng, runner, compared = np.random.default_rng(2), scene._compiled.program.runner(), 0
    for q in placements(rng, 30):
        v = rng.normal(size=6)
        A, _, gaps, _ = runner.rows(q, v, 0.0)
        before, after = (
            runner.rows(pin.integrate(scene.model, q, by * v), v, 0.0)[2] for by in (-STEP, STEP)
        )
        # The slope is discontinuous if two features are equally near, or inside an inset solid.
        smooth = (np.abs(before + after - 2.0 * gaps) < SMOOTH) & (gaps > 0.0)
        rates = A.reshape(-1, 6) @ v
        assert rates[smooth] == pytest.approx(((after - before) / (2.0 * STEP))[smooth], abs=1e-7)
        compared += smooth.sum()
    assert compared > 0.9 * 30 * len(gaps)


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("kind", REVOLVED)
def test_rows_are_differences_of_gaps(kind, other):
    assert_rows_are_differences_of_gaps(pair(kind, other)[0])


CAN = coal.Cylinder(0.1, 0.3)
TABLES = [coal.Box(1.0, 1.2, 0.4), convex(0.5 * CUBE * [1.0, 1.2, 0.4])]
LYING = pin.Quaternion(pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0)).coeffs()
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
# Shape, fixed shape, height over its center, and orientation.
AT_REST = {
    "can on box": (CAN, TABLES[0], 0.35, LEVEL),
    "can on mesh": (CAN, TABLES[1], 0.35, LEVEL),
    "cone on box": (coal.Cone(0.1, 0.3), TABLES[0], 0.35, LEVEL),
    "box on can": (coal.Box(0.3, 0.2, 0.1), coal.Cylinder(0.5, 0.4), 0.25, LEVEL),
    "box on narrow can": (coal.Box(0.3, 0.2, 0.1), coal.Cylinder(0.06, 0.4), 0.25, LEVEL),
    "mesh on can": (convex(0.5 * CUBE * [0.3, 0.2, 0.1]), coal.Cylinder(0.5, 0.4), 0.25, LEVEL),
    "capsule on can": (coal.Capsule(0.05, 0.3), coal.Cylinder(0.5, 0.4), 0.25, LYING),
    "capsule across can": (coal.Capsule(0.05, 0.3), coal.Cylinder(0.1, 0.4), 0.25, LYING),
    "lying can": (CAN, TABLES[0], 0.3, LYING),
    "lying can on mesh": (CAN, TABLES[1], 0.3, LYING),
    "lying can across box": (CAN, coal.Box(1.0, 0.1, 0.4), 0.3 - SIDE_INSET * DEFAULT_ROUNDING * 0.1, LYING),
    "can half on box": (coal.Cylinder(0.1, 0.3), coal.Box(0.23, 0.9, 0.4), 0.35, LEVEL),
}


@pytest.mark.parametrize("what", AT_REST)
def test_what_rests(what):
    """The body stays at rest with zero velocity, and the contact force equals its weight."""
    thing, fixed, height, turn = AT_REST[what]
    run = pn.simulate(free(thing, fixed, mu=0.5), 1.0, q=[0.04, 0.02, height, *turn], record="forces")
    assert np.abs(run.v).max() == 0.0
    assert run.lam[-1].sum() == pytest.approx(GRAVITY, abs=1e-9)
    assert point_loads(run)[-1].min() >= 0.0
    assert (point_loads(run)[-1] > 0.0).sum() >= 2


@pytest.mark.parametrize("fixed", TABLES, ids=["box", "mesh"])
@pytest.mark.parametrize("beyond", [-0.02, 0.01])
def test_a_can_over_an_edge(fixed, beyond):
    """A can stands as long as its weight acts inside the table, and tips over otherwise."""
    run = pn.simulate(free(CAN, fixed, mu=0.5), 0.5, q=[0.5 + beyond, 0.1, 0.35, 0, 0, 0, 1])
    if beyond < 0.0:
        assert np.abs(run.v).max() == 0.0
    else:
        assert pin.XYZQUATToSE3(run.q[-1]).rotation[2, 2] < 0.99


@pytest.mark.parametrize("fixed", TABLES, ids=["box", "mesh"])
def test_a_can_lands_on_its_face(fixed):
    run = pn.simulate(free(CAN, fixed, mu=0.5), 1.0, q=[0.1, 0.05, 0.55, 0, 0, 0, 1])
    impact = next(event.time for event in run.events if event.kind == "impact")
    assert impact == pytest.approx(np.sqrt(0.4 / GRAVITY), abs=1e-11)
    assert run.q[-1] == pytest.approx([0.1, 0.05, 0.35, 0, 0, 0, 1], abs=1e-10)


@pytest.mark.parametrize("fixed", [coal.Box(4.0, 1.0, 0.4), convex(0.5 * CUBE * [4.0, 1.0, 0.4])], ids=type)
def test_a_can_rolls_down_a_face(fixed):
    """A lying can rolls with 2/3 g sin of the slope."""
    slope, across = 0.3, (3.0 * 0.1**2 + 0.3**2) / 12.0
    gravity = GRAVITY * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    scene = free(CAN, fixed, mu=0.5, inertia=np.diag([across, across, 0.5 * 0.1**2]), gravity=gravity)
    run = pn.simulate(scene, 0.8, q=[-1.0, 0.1, 0.3, *LYING])
    assert run.q[:, 0] + 1.0 == pytest.approx(GRAVITY * np.sin(slope) / 3.0 * run.t**2, abs=1e-8)
    assert run.q[:, [1, 2]] == pytest.approx(np.tile([0.1, 0.3], (len(run.t), 1)), abs=1e-10)


def test_a_plank_rocks_on_a_lying_cylinder():
    """A plank without slip has the motion of a block on a cylinder, by a separate integration."""
    size, thick, inertia = 0.4, 0.1, 0.03
    radius = size - SIDE_INSET * DEFAULT_ROUNDING * thick  # effective radius of the side for edges

    def rate(_, y):
        angle, spin = y
        moment = radius**2 * angle * spin**2 + GRAVITY * (
            radius * angle * np.cos(angle) - 0.5 * thick * np.sin(angle)
        )
        return [spin, -moment / (inertia + (radius * angle) ** 2 + 0.25 * thick**2)]

    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0, inertia=inertia * np.eye(3))
    place = pin.SE3(pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0), np.zeros(3))
    plank, roll = coal.Box(0.6, 0.3, thick), coal.Cylinder(size, 2.0)
    geometry.addGeometryObject(pin.GeometryObject("plank", joint, HERE, plank))
    geometry.addGeometryObject(pin.GeometryObject("roll", 0, place, roll))
    contact = pn.GeometryContact("plank", "roll", mu=2.0)
    scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
    start = 0.2
    turn = pin.rpy.rpyToMatrix(0.0, start, 0.0)
    at = (radius + 0.5 * thick) * turn[:, 2] - radius * start * turn[:, 0]
    run = pn.simulate(scene, 1.0, q=[*at, *pin.Quaternion(turn).coeffs()], rtol=1e-10, atol=1e-11)
    exact = solve_ivp(rate, (0.0, 1.0), [start, 0.0], t_eval=[1.0], rtol=1e-11, atol=1e-12).y[0, -1]
    turned = pin.rpy.matrixToRpy(pin.XYZQUATToSE3(run.q[-1]).rotation)
    assert turned == pytest.approx([0.0, exact, 0.0], abs=1e-7)
    assert {event.kind for event in run.events} <= {"stick"}


@pytest.mark.parametrize("mu", [0.0, 0.5])
@pytest.mark.parametrize("turn", [0.0, 1e-9, 0.01])
def test_a_can_falls_on_two_rails(mu, turn):
    """The edges along its side carry it at its rims, and the energy ledger closes at all times."""
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0, inertia=0.01 * np.eye(3))
    across = pin.SE3(pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0), np.zeros(3))
    geometry.addGeometryObject(pin.GeometryObject("can", joint, across, CAN))
    for name, x in (("left", -0.16), ("right", 0.16)):
        rail = pin.SE3(np.eye(3), np.array([x, 0.0, -0.1]))
        geometry.addGeometryObject(pin.GeometryObject(name, 0, rail, coal.Box(0.2, 2.0, 0.2)))
    contacts = [pn.GeometryContact("can", name, mu=mu) for name in ("left", "right")]
    scene = pn.Scene(model, contacts=contacts, collision_model=geometry)
    q = [0.0, 0.1, 0.1, *pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, turn)).coeffs()]
    run = pn.simulate(scene, 1.0, q=q, record=("energy", "forces"))
    edge = DEFAULT_ROUNDING * 0.2
    height = np.sqrt((0.1 + edge) ** 2 - (0.06 + edge) ** 2) - edge
    assert run.q[-1, [0, 2]] == pytest.approx([0.0, height], abs=1e-9)
    assert point_loads(run)[-1].min() >= 0.0
    assert (point_loads(run)[-1] > 0.0).sum() == 4
    assert np.abs(run.energy["balance"]).max() < 1e-9


@pytest.mark.parametrize("length", [0.2, 0.5])
@pytest.mark.parametrize("turn", [0.0, 1e-4])
def test_a_capsule_falls_on_a_lying_can(length, turn):
    """A capsule along the can rests on two points: its ends if it is shorter, else the can's rims."""
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "free", 1.0, inertia=0.02 * np.eye(3))
    lying = pin.SE3(pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0), np.zeros(3))
    geometry.addGeometryObject(pin.GeometryObject("capsule", joint, lying, coal.Capsule(0.05, length)))
    geometry.addGeometryObject(pin.GeometryObject("can", 0, lying, CAN))
    contact = pn.GeometryContact("capsule", "can", mu=0.5)
    scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
    q = [0.0, 0.01, 0.151, *pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, turn)).coeffs()]
    run = pn.simulate(scene, 0.3, q=q, record=("energy", "forces"))
    assert run.q[-1, :3] == pytest.approx([0.0, 0.01, 0.15], abs=1e-5)
    assert (point_loads(run)[-1] > 0.0).sum() == 2
    assert np.abs(run.energy["balance"]).max() < 1e-9


def test_cones_of_any_size_are_made():
    """Truncation of a cone keeps radii nonnegative despite rounding."""
    rng = np.random.default_rng(4)
    for _ in range(40):
        radius = 10.0 ** rng.uniform(-3.0, 1.0)
        length = radius * 10.0 ** rng.uniform(-2.0, 2.0)
        for rounding in (None, 0.01 * min(radius, length)):
            scene = free(coal.Capsule(0.1, 0.2), coal.Cone(radius, length), rounding=rounding)
            assert min(c.above for c in points_of(scene) if isinstance(c, pn.CylinderContact)) >= 0.0


TUBE = """<robot name="r">
<link name="base"><collision><geometry><box size="1 1 0.2"/></geometry></collision></link>
<link name="arm"><inertial><origin xyz="0.3 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0.3 0 0" rpy="0 1.5707963267948966 0"/>
<geometry><cylinder radius="0.05" length="0.4"/></geometry></collision></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="-0.3 0 0.4"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint></robot>"""


def test_a_file_with_a_tube_that_falls_on_its_base(tmp_path):
    """As URDF files have them: the arm comes to rest with its rim on the box; the run is saved and shown."""
    (tmp_path / "robot.urdf").write_text(TUBE)
    (tmp_path / "robot.yaml").write_text(
        "contacts:\n  - GeometryContact: {geometry1: arm_0, geometry2: base_0, mu: 0.4}\n"
    )
    scene = pn.load(tmp_path)
    run = pn.simulate(scene, 1.5, record="forces")
    (angle,) = run.q[-1]
    # The rim's lowest point, at 0.5 along the arm and 0.05 beside it, is at the height of the face.
    reach = 0.5 - DEFAULT_ROUNDING * 0.05
    assert reach * np.sin(angle) + 0.05 * np.cos(angle) == pytest.approx(0.3, abs=1e-9)
    assert run.v[-1] == 0.0
    run.save(tmp_path / "run.npz")
    again = pn.Trajectory.load(tmp_path / "run.npz", scene=scene)
    np.testing.assert_array_equal(again.lam, run.lam)
    pn.replay(run, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size > 0


def thrown(kind, other, seed):
    """Return a scene of two bodies, one thrown at the other, and its start."""
    rng = np.random.default_rng(seed)
    toward = rng.normal(size=3)
    toward /= np.linalg.norm(toward)
    turn = pin.Quaternion(pin.exp3(rng.normal(size=3)))
    v = np.concatenate([turn.toRotationMatrix().T @ (6.0 * toward), rng.normal(size=3) * 8.0])
    shapes = [any_shape(kind), any_shape(other)][:: 1 if seed % 2 else -1]
    e, mu = float(rng.choice([0.0, 0.4])), rng.uniform(0.0, 0.8)
    start = {"q": np.concatenate([-1.2 * toward, turn.coeffs()]), "v": v}
    return free(*shapes, mu=mu, restitution=e), start


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("kind", REVOLVED)
@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(60), marks=pytest.mark.stress)], ids=len)
def test_thrown_bodies_do_not_enter(kind, other, seeds):
    """Bodies with spin do not penetrate by Coal, and the energy ledger closes; one run is repeated."""
    struck = 0
    for seed in seeds:
        scene, start = thrown(kind, other, seed)
        oracle = modelled_as(scene, other, kind)
        run = pn.simulate(scene, 0.5, output_dt=0.002, max_steps=20000, record="energy", **start)
        struck += any(event.kind == "impact" for event in run.events)
        assert np.abs(run.energy["balance"]).max() < LEDGER
        places = [pin.XYZQUATToSE3(q) for q in run.q if np.linalg.norm(q[:3]) < REACH]
        sides = [(at, HERE) if seed % 2 == 0 else (HERE, at) for at in places]
        assert min((oracle.apart(*both)[1] for both in sides), default=1.0) > -DEPTH
        if seed == 0:
            again = pn.simulate(scene, 0.5, output_dt=0.002, max_steps=20000, record="energy", **start)
            assert_same_run(run, again)
    assert struck > len(seeds) // 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pn.RimContact("a", "b", CUBE[:4], 0.1, 0.1), "points must span a solid"),
        (lambda: pn.RimContact("a", "b", CUBE, 0.0, 0.1), "rim must be positive; got 0"),
        (lambda: pn.RimContact("a", "b", CUBE, 0.1, 0.0), "radius2 must be positive; got 0"),
        (lambda: pn.RimContact("a", "a", CUBE, 0.1, 0.1), 'frame1 and frame2 must differ; both are "a"'),
        (
            lambda: pn.CylinderContact("a", "b", 0.1, 0.1, 0.1, end=(0.0, 0.0, 0.0)),
            "end and offset must differ; leave end out for a sphere",
        ),
    ],
)
def test_bad_descriptions(make, message):
    with pytest.raises(pn.InputError) as error:
        make()
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("other", "rounding", "message"),
    [
        ("box", 0.16, "rounding must be less than half the least edge 0.3 m; got 0.16 m"),
        ("capsule", 0.2, "rounding must be less than half the length 0.4 m; got 0.2 m"),
    ],
)
def test_a_rounding_that_leaves_nothing(other, rounding, message):
    with pytest.raises(pn.InputError, match=message):
        pair("cylinder", other, rounding=rounding)
