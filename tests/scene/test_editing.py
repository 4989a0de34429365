"""New scenes from a scene: parts replaced, added and removed, and robots put on the ground."""

from __future__ import annotations

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn


def test_nothing_replaced_is_the_same_scene():
    scene = pn.load("four_bar")
    again = scene.replace()
    one, other = (pn.simulate(each, 0.5, progress=False) for each in (scene, again))
    np.testing.assert_array_equal(one.q, other.q)
    assert again.report() == scene.report()
    assert again.visual_model.ngeoms == scene.visual_model.ngeoms


def test_laws_are_added_and_removed_by_name():
    scene = pn.load("four_bar")
    name = scene.law_names[0]
    without = scene.replace(remove=[name])
    assert without.law_names == scene.law_names[1:]
    assert without.constraint_slices == scene.constraint_slices
    damped = without.replace(add_laws=[pn.JointFriction("crank_joint", viscous=0.2, name="damper")])
    assert damped.law_names == [*scene.law_names[1:], "damper"]
    assert scene.law_names[0] == name  # the first scene stays as it is
    replaced = scene.replace(laws=[])
    assert replaced.law_names == []
    assert scene.replace(name="mine").name == "mine"


def test_the_new_scene_equals_one_made_by_hand():
    scene = pn.load("four_bar")
    laws = [pn.JointFriction("crank_joint", viscous=0.2)]
    edited = scene.replace(laws=laws, q0={"crank_joint": 0.4}, v0={"crank_joint": 2.0}, actuation=None)
    by_hand = pn.Scene(scene.model, constraints=scene.constraints, laws=laws, q0=scene.q0)
    state = by_hand.project({"crank_joint": 0.4}, {"crank_joint": 2.0})
    for one, other in zip(edited.initial_state(), state, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
    assert edited.initial_state()[1][0] == pytest.approx(2.0, rel=1e-12)  # a named entry stays
    one, other = pn.simulate(edited, 0.2, progress=False), pn.simulate(by_hand, 0.2, *state, progress=False)
    np.testing.assert_allclose(one.v[-1], other.v[-1], rtol=1e-6)
    assert edited.actuation is None


def test_pickled_and_copied():
    scene = pn.load("four_bar").replace(add_laws=[pn.JointFriction("crank_joint", viscous=0.2)])
    again = pickle.loads(pickle.dumps(scene))
    assert again.law_names == scene.law_names


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"remove": ["nothing here"]}, 'no constraint, law, contact or force "nothing here" to remove'),
        ({"add_laws": [pn.JointFriction("crank", viscous=1.0)]}, 'no joint or anchor "crank"'),
        ({"q0": {"crank": 1.0}}, 'replace: q0: no joint "crank"'),
    ],
)
def test_errors(change, message):
    with pytest.raises(pn.PinNonidealError) as error:
        pn.load("four_bar").replace(**change)
    assert message in str(error.value)


SHAPES = {
    "sphere": (lambda coal: coal.Sphere(0.2), lambda R: 0.2),
    "capsule": (lambda coal: coal.Capsule(0.1, 0.4), lambda R: 0.1 + 0.2 * abs(R[2, 2])),
    "box": (lambda coal: coal.Box(0.2, 0.4, 0.6), lambda R: np.abs(R[2]) @ [0.1, 0.2, 0.3]),
    "ellipsoid": (
        lambda coal: coal.Ellipsoid(0.1, 0.2, 0.3),
        lambda R: np.linalg.norm(R[2] * [0.1, 0.2, 0.3]),
    ),
    "cylinder": (
        lambda coal: coal.Cylinder(0.1, 0.4),
        lambda R: 0.2 * abs(R[2, 2]) + 0.1 * np.hypot(R[2, 0], R[2, 1]),
    ),
    "cone": (
        lambda coal: coal.Cone(0.1, 0.4),
        lambda R: max(-0.2 * R[2, 2], 0.2 * R[2, 2] + 0.1 * np.hypot(R[2, 0], R[2, 1])),
    ),
}


def one_body(shape, rotation):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3(rotation, np.array([0.3, 0.0, 0.1])), "body")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    shapes = pin.GeometryModel()
    shapes.addGeometryObject(pin.GeometryObject("shape", joint, pin.SE3.Identity(), shape))
    return model, shapes


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_lowest_shape_touches_the_ground(kind, seed):
    make, reach = SHAPES[kind]
    rng = np.random.default_rng(seed)
    turn, mount = (pin.Quaternion(rng.normal(size=4)).normalized().matrix() for _ in range(2))
    model, shapes = one_body(make(pin.coal if hasattr(pin, "coal") else __import__("coal")), mount)
    q0 = np.concatenate([rng.normal(size=3), pin.Quaternion(turn).coeffs()])
    scene = pn.Scene(model, collision_model=shapes, q0=q0).put_on_ground()
    data = model.createData()
    pin.forwardKinematics(model, data, scene.q0)
    place = data.oMi[1]
    assert place.translation[2] == pytest.approx(reach(place.rotation), abs=1e-12)
    before = pn.Scene(model, q0=q0).q0
    pin.forwardKinematics(model, data, before)
    np.testing.assert_allclose(data.oMi[1].translation[:2], place.translation[:2], atol=1e-12)


def test_a_plane_of_its_own_and_a_robot_that_stands():
    scene = pn.load("solo12").put_on_ground()
    shapes, data = scene.collision_model, scene.model.createData()
    assert shapes is not None
    of_shapes = shapes.createData()
    pin.updateGeometryPlacements(scene.model, data, shapes, of_shapes, scene.q0)
    again = scene.put_on_ground()
    np.testing.assert_allclose(again.q0, scene.q0, atol=1e-12)


def test_a_tilted_plane_and_a_convex_mesh():
    """The lowest corner of a tetrahedron comes to lie in the plane of a frame on the world."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(4, 4)
    mesh.addVertices(corners)
    mesh.addTriangles(np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.uint64))
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    model, shapes = one_body(mesh.convex, np.eye(3))
    tilt = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.1), np.array([0.1, 0.2, 0.5]))
    model.addFrame(pin.Frame("slope", 0, 0, tilt, pin.FrameType.OP_FRAME), False)
    q0 = np.concatenate([[0.0, 0.0, 3.0], pin.Quaternion(0.8, 0.0, 0.6, 0.0).coeffs()])
    scene = pn.Scene(model, collision_model=shapes, q0=q0).put_on_ground("slope")
    data = model.createData()
    pin.forwardKinematics(model, data, scene.q0)
    heights = [tilt.actInv(data.oMi[1].act(corner))[2] for corner in corners]
    assert min(heights) == pytest.approx(0.0, abs=1e-12)


def scene_of_shapes(shapes):
    return pn.Scene(one_body(coal.Sphere(0.1), np.eye(3))[0], collision_model=shapes)


def on_the_ground():
    shapes = pin.GeometryModel()
    shapes.addGeometryObject(pin.GeometryObject("floor", 0, pin.SE3.Identity(), coal.Sphere(0.1)))
    return shapes


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pn.load("four_bar").put_on_ground(), "put_on_ground: model"),
        (lambda: pn.load("solo12").put_on_ground("nowhere"), 'put_on_ground: no frame "nowhere"'),
        (
            lambda: pn.load("solo12").put_on_ground("FL_FOOT"),
            'put_on_ground: plane "FL_FOOT" must be a frame on the world; it is on a moving body',
        ),
        (
            lambda: scene_of_shapes(None).put_on_ground(),
            'put_on_ground: model "" has no collision shapes; give collision_model=',
        ),
        (
            lambda: scene_of_shapes(on_the_ground()).put_on_ground(),
            'no collision shape of model "" is on a moving body',
        ),
        (
            lambda: scene_of_shapes(
                one_body(coal.Halfspace(np.eye(3)[2], 0.0), np.eye(3))[1]
            ).put_on_ground(),
            'shape "shape" is a Halfspace, which has no lowest point here; remove it',
        ),
    ],
)
def test_put_on_ground_says_what_it_needs(make, message):
    with pytest.raises(pn.PinNonidealError) as error:
        make()
    assert message in str(error.value)


def test_friction_for_all_joints_of_a_robot_leaves_mimic_joints_out():
    panda = pn.load("panda")
    laws = pn.JointFriction.for_joints(panda, coulomb=1.0)
    assert [law.joint for law in laws] == [*(f"panda_joint{k}" for k in range(1, 8)), "panda_finger_joint1"]
    panda.replace(add_laws=laws)


def test_friction_for_joints():
    model = pn.load("four_bar").model
    laws = pn.JointFriction.for_joints(model, mu=0.1, radius=0.02)
    assert [law.joint for law in laws] == ["crank_joint", "coupler_joint", "rocker_joint"]
    assert all(law.mu == 0.1 for law in laws)
    laws = pn.JointFriction.for_joints(
        model, {"crank_joint": 0.3, "rocker_joint": {"viscous": 0.2, "radius": 0.05}}, radius=0.02
    )
    assert [(law.coulomb, law.viscous, law.radius) for law in laws] == [(0.3, 0.0, 0.02), (0.0, 0.2, 0.05)]
    assert [law.joint for law in pn.JointFriction.for_joints(model, ["crank_joint"], coulomb=1.0)] == [
        "crank_joint"
    ]
    with pytest.raises(pn.UnknownNameError, match='no joint "crank"; nearest: "crank_joint"'):
        pn.JointFriction.for_joints(model, {"crank": 1.0})
