"""Free bodies, the ground, and contacts of links: helpers of contact scenes, against closed forms."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.visualization.page.body_overlays import colored_collisions
from pin_nonideal.visualization.page.contact_surfaces import ground_of, planes_of
from pin_nonideal.visualization.page.visuals import LINK_COLORS

from ..support.contact_points import points_of
from ..support.mechanisms import GRAVITY
from ..support.refusals import refuses
from .test_geometry_pairs import convex

CUBE = np.array([[x, y, z] for x in (0.0, 0.2) for y in (0.0, 0.3) for z in (0.0, 0.4)])
VOLUME = np.pi * 0.01 * 0.4 / 3.0  # of the cone [m^3]
ROUNDING = 1e-14


def table(height=0.0):
    """Return an empty model, and a collision model with the ground."""
    shapes = pin.GeometryModel()
    shapes.addGeometryObject(pn.ground(height=height))
    return pin.Model(), shapes


@pytest.mark.parametrize(
    ("shape", "mass", "expected"),
    [
        (coal.Box(0.2, 0.3, 0.4), 24.0, pin.Inertia.FromBox(24.0, 0.2, 0.3, 0.4)),
        (coal.Sphere(0.1), 4e3 / 3.0 * np.pi * 1e-3, pin.Inertia.FromSphere(4e3 / 3.0 * np.pi * 1e-3, 0.1)),
        (coal.Cylinder(0.1, 0.4), 4.0 * np.pi, pin.Inertia.FromCylinder(4.0 * np.pi, 0.1, 0.4)),
        (
            coal.Ellipsoid(0.1, 0.2, 0.3),
            8.0 * np.pi,
            pin.Inertia.FromEllipsoid(8.0 * np.pi, 0.1, 0.2, 0.3),
        ),
        (
            coal.Capsule(0.1, 0.4),
            1e3 * np.pi * (4e-3 + 4e-3 / 3.0),
            pin.Inertia.FromCapsule(1e3 * np.pi * (4e-3 + 4e-3 / 3.0), 0.1, 0.4),
        ),
        (
            coal.Cone(0.1, 0.4),
            1e3 * VOLUME,
            pin.Inertia(
                1e3 * VOLUME,
                np.array([0.0, 0.0, -0.1]),
                1e3 * VOLUME * np.diag([0.0075, 0.0075, 0.003]),
            ),
        ),
        (
            convex(CUBE),
            24.0,
            pin.Inertia(24.0, np.array([0.1, 0.15, 0.2]), pin.Inertia.FromBox(24.0, 0.2, 0.3, 0.4).inertia),
        ),
    ],
    ids=["box", "sphere", "cylinder", "ellipsoid", "capsule", "cone", "mesh"],
)
def test_inertia_is_that_of_the_shape(shape, mass, expected):
    model, shapes = table()
    joint = pn.free_body(model, "thing", shape, density=1e3, collision_model=shapes)
    got = model.inertias[joint]
    assert got.mass == pytest.approx(mass, rel=ROUNDING)
    np.testing.assert_allclose(got.lever, expected.lever, atol=1e-15)
    np.testing.assert_allclose(got.inertia, expected.inertia, rtol=1e-13, atol=1e-13 * mass)
    heavy = pn.free_body(model, "heavy", shape, mass=3.0 * mass)
    np.testing.assert_allclose(model.inertias[heavy].inertia, 3.0 * got.inertia, rtol=1e-13, atol=1e-16)


def test_joint_frame_and_shapes_have_the_name():
    model, shapes = table()
    visual, place = (
        pin.GeometryModel(),
        pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0])),
    )
    more = {"collision_model": shapes, "visual_model": visual}
    joint = pn.free_body(
        model, "box", coal.Box(0.2, 0.2, 0.2), mass=1.0, place=place, color=(1.0, 0.5, 0.0), **more
    )
    assert (model.names[joint], model.nq, model.nv) == ("box", 7, 6)
    frame = model.frames[model.getFrameId("box")]
    assert (frame.parentJoint, frame.placement) == (joint, pin.SE3.Identity())
    assert model.jointPlacements[joint] == place
    assert [item.name for item in shapes.geometryObjects] == ["ground", "box"]
    assert [item.name for item in visual.geometryObjects] == ["box"]
    assert visual.geometryObjects[0].parentJoint == joint
    np.testing.assert_array_equal(visual.geometryObjects[0].meshColor, [1.0, 0.5, 0.0, 1.0])
    second = pn.free_body(
        model,
        "ball",
        coal.Sphere(0.1),
        mass=1.0,
        place=[0, 0, 2],
        collision_model=visual,
        visual_model=visual,
    )
    np.testing.assert_array_equal(model.jointPlacements[second].translation, [0.0, 0.0, 2.0])
    assert visual.ngeoms == 2


def test_a_replay_draws_shapes_in_their_own_colors():
    """Without a visual model it draws collision shapes: in the given color, or in that of the link."""
    model, shapes = table()
    box = coal.Box(0.2, 0.2, 0.2)
    pn.free_body(model, "red", box, mass=1.0, collision_model=shapes, color=(1.0, 0.0, 0.0))
    pn.free_body(model, "plain", box, mass=1.0, collision_model=shapes)
    contacts = pn.ground_contacts(model, shapes)
    drawn = colored_collisions(pn.Scene(model, contacts=contacts, collision_model=shapes).collision_model)
    colors = {visual.name: visual.color for visual in drawn}
    assert colors == {"red": (1.0, 0.0, 0.0, 1.0), "plain": LINK_COLORS[2]}


@pytest.mark.parametrize("ground", [None, "ground"])
def test_a_replay_draws_the_floor(ground):
    """The grid of a replay lies at the height of the ground, as an object or as a shape of the scene."""
    model, shapes = table(height=-0.5)
    pn.free_body(model, "ball", coal.Sphere(0.1), mass=1.0, collision_model=shapes)
    given = pn.ground(height=-0.5) if ground is None else ground
    contacts = pn.ground_contacts(model, shapes, ["ball"], given)
    scene = pn.Scene(model, contacts=contacts, collision_model=shapes)
    assert scene.contact_names == ["ball on ground"]
    floor = ground_of(planes_of(scene._compiled), np.array([0.0, 0.0, 1.0]))
    assert floor is not None
    assert floor.point[2] == pytest.approx(-0.5)


def test_a_body_falls_on_the_ground_and_rests():
    model, shapes = table(height=0.5)
    pn.free_body(model, "box", coal.Box(0.2, 0.2, 0.4), 500.0, collision_model=shapes, place=(0.0, 0.0, 1.0))
    scene = pn.Scene(model, contacts=[pn.GeometryContact("box", "ground", mu=0.5)], collision_model=shapes)
    run = pn.simulate(scene, 1.0, record="forces")
    impact = next(event.time for event in run.events if event.kind == "impact")
    assert impact == pytest.approx(np.sqrt(0.6 / GRAVITY), abs=1e-11)
    assert run.q[-1, :3] == pytest.approx([0.0, 0.0, -0.3], abs=1e-10)
    assert run.lam[-1].sum() == pytest.approx(8.0 * GRAVITY, rel=1e-12)


def test_the_ground_itself_may_be_given():
    """A contact with the ground as an object equals the one with a shape of the collision model."""
    model, shapes = table()
    pn.free_body(model, "box", coal.Box(0.2, 0.2, 0.4), 500.0, collision_model=shapes)
    bare = pin.GeometryModel()
    bare.addGeometryObject(shapes.geometryObjects[1])
    named, given = (
        pn.Scene(model, contacts=[pn.GeometryContact("box", ground, mu=0.5)], collision_model=geometry)
        for ground, geometry in (("ground", shapes), (pn.ground(), bare))
    )
    assert points_of(named) == points_of(given)
    slope = pn.ground("slope", normal=(0.6, 0.0, 0.8), height=-1.0)
    contacts = points_of(pn.Scene(model, contacts=[pn.GeometryContact("box", slope)], collision_model=bare))
    assert {c.name for c in contacts} == {f"box on slope {k + 1}" for k in range(8)}
    assert contacts[0].normal == pytest.approx((0.6, 0.0, 0.8))
    assert contacts[0].height == pytest.approx(-1.0)


@pytest.fixture(scope="module")
def quadruped():
    return pn.load("hyq")


FEET = ["lf_foot", "rf_foot", "lh_foot", "rh_foot"]


class TestContactsOfLinks:
    def test_feet_on_the_ground(self, quadruped):
        """Four feet carry the weight of the robot, from one line."""
        contacts = pn.ground_contacts(quadruped.model, quadruped.collision_model, FEET, mu=0.7)
        assert [c.name for c in contacts] == [f"{foot} on ground" for foot in FEET]
        scene = quadruped.put_on_ground()
        scene = scene.replace(add_contacts=contacts, actuation=pn.HoldPosition(1e4, 100.0))
        run = pn.simulate(scene, 1.0, method="moreau", dt=1e-3, output_dt=0.1, record=("a", "forces"))
        weight = pin.computeTotalMass(scene.model) * GRAVITY
        carried = sum(run.contact_forces[c.name][-1, 2] for c in contacts)
        data = scene.model.createData()
        pin.centerOfMass(scene.model, data, run.q[-1], run.v[-1], run.a[-1])
        assert carried == pytest.approx(weight * (1.0 + data.acom[0][2] / GRAVITY), rel=1e-6)
        assert run.closed[-1].all()

    def test_pairs_of_the_srdf(self, quadruped):
        """A loaded robot has all pairs that its SRDF does not disable; names of links select some pairs."""
        model, shapes = quadruped.model, quadruped.collision_model
        pairs = pn.geometry_contacts(model, shapes, mu=0.2)
        assert len(pairs) == len(shapes.collisionPairs) > 0
        left = pn.geometry_contacts(model, shapes, links=["lf_foot"])
        assert 0 < len(left) < len(pairs)
        assert all("lf_foot_0" in (c.geometry1, c.geometry2) for c in left)

    def test_the_name_of_a_joint_selects_all_its_shapes(self, quadruped):
        model, shapes = quadruped.model, quadruped.collision_model
        contacts = pn.ground_contacts(model, shapes, ["lf_kfe_joint"])
        moved = [g.name for g in shapes.geometryObjects if model.names[g.parentJoint] == "lf_kfe_joint"]
        assert len(moved) > 1
        assert [c.geometry1 for c in contacts] == moved
        assert {c.name for c in contacts} == {None}

    def test_adjacent_bodies(self):
        """In three links in a row only the outer two are not adjacent."""
        model, shapes, joint = pin.Model(), pin.GeometryModel(), 0
        for k in range(3):
            joint = model.addJoint(joint, pin.JointModelRY(), pin.SE3(np.eye(3), 0.3 * np.eye(3)[0]), f"j{k}")
            model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
            shapes.addGeometryObject(pin.GeometryObject(f"s{k}", joint, pin.SE3.Identity(), coal.Sphere(0.1)))
        shapes.addGeometryObject(pn.ground(height=-1.0))

        def pairs(**more):
            found = pn.geometry_contacts(model, shapes, **more)
            return {(c.geometry1, c.geometry2) for c in found}

        apart = {("s0", "s2"), ("s0", "ground"), ("s1", "ground"), ("s2", "ground")}
        assert pairs(adjacent=False) == apart
        assert pairs() == apart | {("s0", "s1"), ("s1", "s2")}
        assert pairs(links=["j2"], adjacent=False) == {("s0", "s2"), ("s2", "ground")}
        bare = pn.ground_contacts(model, shapes, mu=0.3)
        assert [c.geometry1 for c in bare] == ["s0", "s1", "s2", "ground"][:3]
        assert pn.ground_contacts(model, shapes, ground="ground")[0].geometry2 == "ground"


BOX = coal.Box(0.1, 0.1, 0.1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda m, g: pn.free_body(3, "a", BOX, 1.0), "free_body: model must be a pinocchio.Model; got 3"),
        (lambda m, g: pn.free_body(m, "", BOX, 1.0), "free_body: name must be a name; got an empty string"),
        (
            lambda m, g: pn.free_body(m, "a", BOX),
            'free_body "a": exactly one of density and mass must be given; got neither',
        ),
        (
            lambda m, g: pn.free_body(m, "a", BOX, 1.0, mass=1.0),
            'free_body "a": exactly one of density and mass must be given; got both',
        ),
        (lambda m, g: pn.free_body(m, "a", BOX, -1.0), 'free_body "a": density must be positive; got -1'),
        (lambda m, g: pn.free_body(m, "a", BOX, mass=0.0), 'free_body "a": mass must be positive; got 0'),
        (
            lambda m, g: pn.free_body(m, "a", pn.ground().geometry, 1.0),
            'free_body "a": shape must enclose a volume; got a Halfspace of 0 m^3: give a solid, or',
        ),
        (
            lambda m, g: pn.free_body(m, "a", coal.Box(-1.0, 1.0, 1.0), 1.0),
            'free_body "a": shape: edges of a Box must be positive and finite [m]; got [-1.0, 1.0, 1.0]',
        ),
        (
            lambda m, g: pn.free_body(m, "a", coal.Cylinder(-0.1, 1.0), 1.0),
            'free_body "a": shape: radius of a Cylinder must be positive and finite [m]; got -0.1',
        ),
        (
            lambda m, g: pn.free_body(m, "a", "box", 1.0),
            "free_body \"a\": shape must be a shape of coal, such as coal.Box; got 'box'",
        ),
        (
            lambda m, g: pn.free_body(m, "universe", BOX, 1.0),
            'free_body "universe": model has a joint or frame of this name already; give another name',
        ),
        (
            lambda m, g: pn.free_body(m, "ground", BOX, 1.0, collision_model=g),
            'free_body "ground": collision_model has a shape of this name already; give the body another',
        ),
        (
            lambda m, g: pn.free_body(m, "a", BOX, 1.0, visual_model=3),
            'free_body "a": visual_model must be a pinocchio.GeometryModel; got 3',
        ),
        (
            lambda m, g: pn.free_body(m, "a", BOX, 1.0, place=(0.0, 1.0)),
            'free_body "a": place must have shape (3,); got shape (2,)',
        ),
        (
            lambda m, g: pn.free_body(m, "a", BOX, 1.0, color=(0.0, 1.0, 2.0)),
            'free_body "a": color must be red, green, blue and optionally opacity, each from 0 to 1; got',
        ),
        (lambda m, g: pn.ground(height="low"), "ground: height must be a number; got 'low'"),
        (lambda m, g: pn.ground(normal=(0.0, 0.0, 0.0)), "ground: normal must have a direction; got three"),
        (lambda m, g: pn.ground_contacts(m, 3), "ground_contacts: collision_model must be a pinocchio.Geom"),
        (
            lambda m, g: pn.ground_contacts(m, g),
            "ground_contacts: collision_model must have a shape on a moving body; it has none",
        ),
        (lambda m, g: pn.ground_contacts(m, g, "feet"), "ground_contacts: links must be a list; got 'feet'"),
    ],
)
def test_bad_arguments(make, message):
    with refuses(message, pn.InputError):
        make(*table())


def test_names_that_are_wrong(quadruped):
    model, shapes = quadruped.model, quadruped.collision_model
    with refuses(
        'ground_contacts: no link or joint "lf_fot" in the model; nearest: "lf_foot"', pn.UnknownNameError
    ):
        pn.ground_contacts(model, shapes, ["lf_fot"])
    with refuses('ground_contacts: no geometry "floor" in the collision model', pn.UnknownNameError):
        pn.ground_contacts(model, shapes, FEET, "floor")
    with refuses('geometry_contacts: link "base_link" has no shape in the collision model', pn.InputError):
        pn.geometry_contacts(model, shapes, links=["base_link"])
    moving = shapes.geometryObjects[0]
    with refuses("GeometryContact: geometry2 as an object must be fixed to the world", pn.InputError):
        pn.GeometryContact("a", moving)


def test_models_of_a_scene_and_links_without_shapes_are_named() -> None:
    """A scene in place of its models, and a sole that is a frame of the foot, are usual slips."""
    talos = pn.load("talos")
    got = 'got <Scene "talos": nv 38, 0 constraints, 20 laws, 0 contacts>; pass scene.model'
    with refuses(f"ground_contacts: model must be a pinocchio.Model; {got}", pn.InputError):
        pn.ground_contacts(talos, talos)
    message = 'ground_contacts: link "left_sole_link" has no shape in the collision model; '
    message += 'name "leg_left_6_link", which moves with it'
    with refuses(message, pn.InputError):
        pn.ground_contacts(talos.model, talos.collision_model, ["left_sole_link"])
