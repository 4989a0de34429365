"""Wrenches through fixed joints, against joints that are locked, and against Newton and Euler by hand."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, UnknownNameError

from ..support.mechanisms import body, empty
from ..support.refusals import refuses

# Two runs of one motion, each with rtol 1e-12, relative to the largest load.
SAME = 1e-9
TIGHT = {"rtol": 1e-13, "atol": 1e-14}


def link(name, mass, x, size=0.02):
    diagonal = " ".join(
        f'{key}="{value}"' for key, value in (("ixx", size), ("iyy", 1.3 * size), ("izz", 1.6 * size))
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="{x} 0.02 -0.01" rpy="0.1 0.2 0.3"/>'
        f'<mass value="{mass}"/>'
        f'<inertia {diagonal} ixy="0.001" ixz="0" iyz="0.002"/></inertial></link>'
    )


def joint(kind, name, parent, child, xyz, rpy="0 0 0", axis="0 1 0"):
    limits = '<limit lower="-3" upper="3" effort="100" velocity="100"/>' if kind != "fixed" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limits}</joint>'
    )


def robot(kind="fixed"):
    """An arm whose tool is fixed to the forearm, or held there by a joint that does not move."""
    return pin.buildModelFromXML(
        "".join(
            [
                '<robot name="arm">',
                '<link name="world"/>',
                link("mount", 3.0, 0.0),
                link("upper", 2.0, 0.2),
                link("fore", 1.0, 0.1),
                link("tool", 0.7, 0.05),
                link("tip", 0.2, 0.03),
                link("finger", 0.3, 0.02),
                link("camera", 0.4, -0.02),
                joint(kind, "foot", "world", "mount", "0.1 0 0.2", "0.1 0 0.4"),
                joint("revolute", "shoulder", "mount", "upper", "0 0 0.3", axis="0 1 0"),
                joint("revolute", "elbow", "upper", "fore", "0.4 0 0", axis="0.6 0 0.8"),
                joint(kind, "flange", "fore", "tool", "0.3 0.05 0", "0.3 -0.2 0.5", axis="0 0 1"),
                joint("fixed", "cone", "tool", "tip", "0.1 0 0.02", "0 0.4 0"),
                joint("prismatic", "grip", "tip", "finger", "0.02 0.03 0", "0.2 0 0", axis="0 1 0"),
                joint("fixed", "bracket", "fore", "camera", "0.1 -0.05 0.1"),
                "</robot>",
            ]
        )
    )


START = {"shoulder": 0.4, "elbow": -0.7, "grip": 0.05}
SPEED = {"shoulder": 1.0, "elbow": -2.0, "grip": 0.4}
WAVE = pn.Wrench("tip", lambda t: [np.sin(9.0 * t), 2.0, -1.0, 0.3, -0.2, 0.1 * t])


def forces(model):
    own = np.array([float(name in START) for name in list(model.names)[1:]])
    return {
        "forces": [
            WAVE,
            pn.Wrench("camera", [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]),
            pn.SpringDamper("tool", "camera", 200.0, 2.0, 0.1),
            pn.SpringDamper("finger", "world", 50.0, 1.0, 0.1),
            pn.SpringDamper("mount", "tip", 30.0, 1.0, 0.1),
            pn.JointSpring("grip", 80.0, 0.1, 0.5),
            pn.UserForce(lambda t, q, v: own * (0.3 * np.cos(t) - 0.1 * v)),
        ],
        "laws": [
            pn.Drag("tip", 0.8, 1.7),
            pn.Drag("fore", 0.5),
            pn.JointFriction("elbow", mu=0.1, radius=0.02, coulomb=0.1, viscous=0.1),
            pn.JointFriction("grip", coulomb=0.05, viscous=0.3),
        ],
    }


def place_of(model, name):
    """Placement of a frame at the start."""
    data, q = model.createData(), np.zeros(model.nq)
    for key, value in START.items():
        q[model.idx_qs[model.getJointId(key)]] = value
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(name)].copy()


def height_of(model, name):
    """Height of a frame at the start."""
    return float(place_of(model, name).translation[2])


def groove(model):
    """The tip slides on a plane as a bilateral contact, and the camera turns above a wheel on it."""
    contact = {"mu": 0.2, "torsional": 0.01, "unilateral": False}
    return {"contacts": [pn.PointContact("tip", height=height_of(model, "tip"), name="stylus", **contact)]}


def strike(model):
    """An ellipsoid on the tool and a ball on the forearm strike planes."""
    low, lower = height_of(model, "tool") - 0.1, height_of(model, "camera") - 0.12
    return {
        "contacts": [
            pn.EllipsoidContact(
                "tool", (0.02, 0.03, 0.01), mu=0.3, offset=(0.02, 0.01, 0.0), height=low, name="toe"
            ),
            pn.PointContact("camera", mu=0.1, radius=0.03, height=lower, name="heel"),
        ]
    }


def loops(model):
    """The tip is held at a distance from the world, and slides in the direction of its own axis."""
    return {"constraints": [pn.Distance("tip", "world", name="rod")]}


def anchors(model):
    """The tip is tied to a pin in the world, which leaves one freedom."""
    return {"constraints": [pn.PointAnchor("tip", axes="xz", name="tie")]}


LOADS = {"forces": forces, "groove": groove, "strike": strike, "rod": loops, "tie": anchors}


def scene(kind, loads):
    model = robot(kind)
    parts = LOADS[loads](model)
    if kind != "fixed":
        held = [pn.PrescribedMotion(name, pn.constant(0.0)) for name in ("foot", "flange")]
        parts["constraints"] = [*held, *parts.get("constraints", [])]
    return pn.Scene(model, q0=START, **parts)


@pytest.fixture(scope="module", params=list(LOADS))
def runs(request):
    """One motion of the arm with fixed joints, and with joints that are held still."""
    merged, held = scene("fixed", request.param), scene("revolute", request.param)
    q, v = merged.project(START, np.array(list(SPEED.values())))[:2]
    free = [held.model.idx_vs[held.model.getJointId(name)] for name in START]
    wide = [np.zeros(held.model.nv) for _ in range(2)]
    wide[0][free], wide[1][free] = q, v
    options = {"output_dt": 0.05, "record": "reactions", **TIGHT}
    both = pn.simulate(merged, 0.4, q, v, **options), pn.simulate(held, 0.4, *wide, **options)
    assert np.ptp(both[0].q, axis=0).max() > 0.1
    return [run.samples(run.grid) for run in both]


@pytest.mark.parametrize("axes", ["own", "world"])
@pytest.mark.parametrize("name", ["foot", "flange"])
def test_a_fixed_joint_carries_the_same_as_one_that_is_held_still(runs, name, axes):
    merged, held = (run.reaction(name, axes) for run in runs)
    np.testing.assert_allclose(merged, held, rtol=0.0, atol=SAME * np.abs(held).max())


def test_links_stand_for_their_joints(runs):
    merged, _ = runs
    for name, link_name in (("flange", "tool"), ("foot", "mount"), ("elbow", "fore"), ("cone", "tip")):
        np.testing.assert_array_equal(merged.reaction(link_name), merged.reaction(name))


def test_what_passes_the_cone_and_the_bracket_adds_up(runs):
    """Without loads between them, the flange carries the load of the cone and of its own link."""
    merged, _ = runs
    if merged.scene.forces or merged.scene.contacts:
        return
    model = merged.scene.model
    cone, flange = merged.reaction("cone", "world"), merged.reaction("flange", "world")
    own = model.frames[model.getFrameId("flange", pin.FrameType.FIXED_JOINT)].inertia
    tool = merged.frame("flange")
    for k in range(len(merged)):
        data = model.createData()
        pin.forwardKinematics(model, data, merged.q[k], merged.v[k], merged.a[k])
        index = model.getFrameId("flange")
        pin.updateFramePlacements(model, data)
        a = pin.getFrameAcceleration(model, data, index, pin.LOCAL)
        v = pin.getFrameVelocity(model, data, index, pin.LOCAL)
        R = tool.placement[k].rotation
        a.linear -= R.T @ model.gravity.linear
        momentum = own * a + v.cross(own * v)
        lever = merged.frame("cone").translation[k] - tool.translation[k]
        force = R @ momentum.linear + cone[k, :3]
        moment = R @ momentum.angular + cone[k, 3:] + np.cross(lever, cone[k, :3])
        np.testing.assert_allclose(
            flange[k], [*force, *moment], rtol=0.0, atol=SAME * np.abs(flange[k]).max()
        )


def test_the_hand_of_a_panda_by_newton_and_euler():
    """Hand and fingers as three bodies: m (a - g) and the rate of spin, from differences of momenta."""
    scene = pn.load("panda")
    model = scene.model
    rng = np.random.default_rng(2)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    q = lower + (upper - lower) * rng.uniform(0.3, 0.7, model.nq)
    v = rng.uniform(-1.0, 1.0, model.nv)
    run = pn.simulate(scene, 0.02, q, v, output_dt=0.01, record="reactions")
    hand = model.getFrameId("panda_hand_joint")
    bodies = [(hand, model.frames[hand].inertia)]
    for name in ("panda_finger_joint1", "panda_finger_joint2"):
        bodies.append((model.getFrameId(name), model.inertias[model.getJointId(name)]))
    gravity = np.array([0.0, 0.0, -9.81])
    for k in range(len(run)):
        q, v, a = run.q[k], run.v[k], run.a[k]

        def momenta(t, q=q, v=v, a=a):
            """Momentum and spin of all three about the world's origin, on the parabola of the state."""
            data = model.createData()
            pin.forwardKinematics(model, data, pin.integrate(model, q, v * t + 0.5 * a * t * t), v + a * t)
            pin.updateFramePlacements(model, data)
            total = np.zeros(6)
            for index, Y in bodies:
                place = data.oMf[index]
                twist = pin.getFrameVelocity(model, data, index, pin.LOCAL)
                R, com = place.rotation, place.act(Y.lever)
                speed = R @ (twist.linear + np.cross(twist.angular, Y.lever))
                spin = R @ (Y.inertia @ twist.angular)
                total[:3] += Y.mass * speed
                total[3:] += spin + np.cross(com, Y.mass * speed)
            return total

        step = 1e-3  # Richardson's differences of order 4
        rate = (8.0 * (momenta(step) - momenta(-step)) - momenta(2 * step) + momenta(-2 * step)) / (
            12.0 * step
        )
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        at = data.oMf[hand]
        force, moment = rate[:3].copy(), rate[3:].copy()
        for index, Y in bodies:
            weight = Y.mass * gravity
            force -= weight
            moment -= np.cross(data.oMf[index].act(Y.lever), weight)
        moment -= np.cross(at.translation, force)
        measured = run.reaction("panda_hand_joint", "world")[k]
        np.testing.assert_allclose(measured, [*force, *moment], rtol=0.0, atol=1e-8)
        own = np.concatenate([at.rotation.T @ force, at.rotation.T @ moment])
        np.testing.assert_allclose(run.reaction("panda_hand_joint")[k], own, rtol=0.0, atol=1e-8)


def test_the_stand_of_a_robot_at_rest_carries_its_weight():
    scene = pn.load("panda")
    run = pn.simulate(scene, 0.01, record="reactions")
    mass = sum(Y.mass for Y in scene.model.inertias)
    wrench = run.reaction("panda_link0", "world")
    joint = run.reaction("panda_joint1", "world")
    np.testing.assert_allclose(wrench[:, :3], joint[:, :3] + [0.0, 0.0, 9.81 * scene.model.inertias[0].mass])
    assert mass > 17.0


def test_wrenches_of_saved_runs_and_of_other_recordings(tmp_path):
    merged = scene("fixed", "forces")
    run = pn.simulate(merged, 0.05, output_dt=0.01, record=("reactions", "dense"))
    again = pn.Trajectory.load(run.save(tmp_path / "run.npz"), scene=merged)
    np.testing.assert_array_equal(run.reaction("flange"), again.reaction("flange"))
    dense = run.at([0.013, 0.027])
    assert dense.reaction("flange").shape == (2, 6)
    lost = pn.Trajectory.load(tmp_path / "run.npz", scene=None)
    with refuses("fixed joints need the scene of the run, which this one has lost", UnknownNameError):
        lost.reaction("flange")
    with refuses('no joint, frame, anchor or contact "flanje"; nearest: "flange"', UnknownNameError):
        run.reaction("flanje")
    with refuses('no joint, frame, anchor or contact "universe"', UnknownNameError):
        run.reaction("universe")


# --- Undecidable parts --------------------------------------------------------------------------------------


def simple(tip_parent=None, inertia=None, kind=pin.FrameType.FIXED_JOINT, **parts):
    """A pendulum built by hand with a frame "weld" on it."""
    model = empty()
    body(model, 0, pin.JointModelRY(), "swing", 2.0, lever=(0.2, 0.0, 0.0), inertia=np.eye(3))
    parent = model.getFrameId("swing")
    place = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    own = pin.Inertia.Zero() if inertia is None else inertia
    weld = model.addFrame(pin.Frame("weld", 1, parent, place, kind, own), inertia is not None)
    if tip_parent is not None:
        above = {"weld": weld, "universe": 0, "swing": parent}[tip_parent]
        model.addFrame(pin.Frame("tip", 1, above, place, pin.FrameType.OP_FRAME), False)
    return pn.Scene(model, q0=[0.3], **parts)


CUP = pin.Inertia(0.5, np.array([0.1, 0.0, 0.0]), 0.01 * np.eye(3))


def reaction(made, name="weld"):
    return pn.simulate(made, 0.01, record="reactions").reaction(name)


def test_frames_without_inertia_are_refused():
    message = (
        'reaction("weld"): the model must give the inertia beyond the frame; it has only the inertia '
        'of the whole body of joint "swing"; make the frame a fixed joint with a link'
    )
    for kind in (pin.FrameType.FIXED_JOINT, pin.FrameType.OP_FRAME):
        with refuses(message, InputError):
            reaction(simple(kind=kind))


def test_inertias_that_are_not_part_of_their_body_are_refused():
    made = simple(inertia=CUP)
    model = made.model.copy()
    model.inertias[1] = pin.Inertia(0.3, np.zeros(3), 0.02 * np.eye(3))
    with refuses('reaction("weld"): the inertia beyond the frame (0.5 kg) must be part of', InputError):
        reaction(pn.Scene(model, q0=[0.3]))


PUSH = pn.Wrench("tip", [1.0, 0.0, 2.0, 0.0, 0.5, 0.0])


def test_loads_on_frames_without_order_are_refused():
    free = reaction(simple("weld", CUP))
    pushed, above = (reaction(simple(side, CUP, forces=[PUSH])) for side in ("weld", "swing"))
    assert np.abs(pushed - free)[0].max() > 0.5
    assert np.abs(above - pushed)[0].max() > 0.5
    message = (
        'reaction("weld"): the scene must show on which side of the frame the Wrench at "tip" acts; it is '
        'attached to "tip", which belongs to no link of this body; attach it to the frame of a link'
    )
    with refuses(message, InputError):
        reaction(simple("universe", CUP, forces=[PUSH]))


def test_anchors_without_frame_names_are_refused():
    made = simple("weld", CUP)
    model = made.model
    anchor = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_3D,
        model,
        1,
        pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])),
        0,
        pin.SE3(np.eye(3), np.array([0.3 * np.cos(0.3), 0.0, -0.3 * np.sin(0.3)])),
    )
    with refuses("acts; it has no frame name", InputError):
        reaction(pn.Scene(model, constraints=[anchor], q0=[0.3]))


def test_runs_with_other_masses_are_refused():
    made = scene("fixed", "forces")
    (run,) = pn.rollout(made, None, None, 0.01, parameters={"elbow": {"mass": [3.0]}}, record="reactions")
    with refuses('reaction("flange"): masses and gravity of the run must be those of its scene', InputError):
        run.reaction("flange")
    (moon,) = pn.rollout(
        made, None, None, 0.01, parameters={"gravity": [[0.0, 0.0, -1.6]]}, record="reactions"
    )
    for name in ("flange", "foot"):
        with refuses("masses and gravity of the run must be those of its scene", InputError):
            moon.reaction(name)


def test_joints_that_were_locked():
    """A locked joint keeps the inertia of all of its links; frames on its body before the locked joint cannot
    be identified."""
    whole = pn.load("panda").model
    q = pin.neutral(whole)
    model = pin.buildReducedModel(whole, [whole.getJointId("panda_joint7")], q)
    held = pn.Scene(whole, constraints=[pn.PrescribedMotion("panda_joint7", pn.constant(0.0))], q0=q)
    options = {"record": "reactions", "output_dt": 0.01, **TIGHT}
    for name in ("panda_joint7", "panda_hand_joint"):
        locked = pn.simulate(pn.Scene(model, q0=pin.neutral(model)), 0.02, **options).reaction(name)
        wanted = pn.simulate(held, 0.02, **options).reaction(name)
        np.testing.assert_allclose(locked, wanted, rtol=0.0, atol=1e-8)
    arm = robot()
    arm = pin.buildReducedModel(arm, [arm.getJointId("grip")], pin.neutral(arm))
    run = pn.simulate(pn.Scene(arm), 0.01, record="reactions")
    assert run.reaction("grip").shape == (len(run), 6)
    with refuses('link "grip" lies; its parent frame leads to no joint, as behind a joint that', InputError):
        run.reaction("flange")


def test_joints_that_a_robot_file_locks():
    """The fingers of this arm are locked: each keeps its place behind the hand and its own inertia."""
    locked, whole = pn.load("panda_friction"), pn.load("panda").model
    fixed = locked.model
    hand = fixed.frames[fixed.getFrameId("panda_hand")].placement
    q, fingers = pin.neutral(whole), []
    q[:7] = locked.q0
    for name in ("panda_finger_joint1", "panda_finger_joint2"):
        index = whole.getJointId(name)
        own = fixed.frames[fixed.getFrameId(name)]
        assert fixed.frames[own.parentFrame].name == "panda_hand"
        np.testing.assert_allclose(own.inertia.matrix(), whole.inertias[index].matrix(), atol=1e-15)
        at_hand = whole.frames[whole.getFrameId("panda_hand")].placement
        rest = (at_hand.inverse() * whole.jointPlacements[index]).inverse() * (hand.inverse() * own.placement)
        q[whole.idx_qs[index]] = np.linalg.norm(rest.translation)
        fingers.append(pn.PrescribedMotion(name, pn.constant(q[whole.idx_qs[index]])))
    options = {"record": "reactions", "output_dt": 0.01, **TIGHT}
    merged = pn.simulate(pn.Scene(fixed, q0=locked.q0), 0.03, **options)
    held = pn.simulate(pn.Scene(whole, constraints=fingers, q0=q), 0.03, **options)
    for name in ("panda_hand_joint", "panda_finger_joint1", "panda_joint7"):
        wanted = held.reaction(name, "world")
        error = np.abs(merged.reaction(name, "world") - wanted).max()
        assert error <= 1e-8 * np.abs(held.reaction("panda_joint1")).max(), name


@pytest.mark.parametrize("name", ["solo12_dropped", "panda_settling", "panda_friction"])
def test_every_fixed_joint_of_a_robot(name):
    """Also in free fall, where all forces cancel, and on a turned mount."""
    scene = pn.load(name)
    run = pn.simulate(scene, 0.02, output_dt=0.01, record="reactions")
    fixed = [f for f in list(scene.model.frames)[1:] if f.type == pin.FrameType.FIXED_JOINT]
    assert fixed
    for one in fixed:
        assert np.isfinite(run.reaction(one.name)).all()


def test_a_turned_mount_carries_the_weight():
    scene = pn.load("panda_settling")
    run = pn.simulate(scene, 0.01, record="reactions")
    base, first = (run.reaction(name, "world") for name in ("panda_link0", "panda_joint1"))
    lift = 9.81 * scene.model.frames[scene.model.getFrameId("panda_link0")].inertia.mass
    np.testing.assert_allclose(
        base[:, :3] - first[:, :3], np.tile([0.0, 0.0, lift], (len(run), 1)), atol=1e-9
    )


def test_shapes_know_their_links():
    """Contacts of collision shapes name the moving joint; the shape has the name of its link."""
    import coal

    model = robot()
    ground = pin.GeometryObject(
        "ground", 0, pin.SE3.Identity(), coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    )
    for name in ("tip", "fore"):
        shapes = pin.GeometryModel()
        index = model.getFrameId(name, pin.FrameType.BODY)
        at, radius = model.frames[index], height_of(model, name)
        ball = coal.Sphere(radius)
        shapes.addGeometryObject(pin.GeometryObject("ball", at.parentJoint, index, at.placement, ball))
        shapes.addGeometryObject(ground)

        def wrench(*contacts, shapes=shapes, **parts):
            made = pn.Scene(model, contacts=contacts, collision_model=shapes, q0=START, **parts)
            return pn.simulate(made, 0.01, record="reactions").reaction("flange", "world")[0]

        by_frame = wrench(pn.PointContact(name, radius=radius))
        for own_name in (None, "touch"):
            by_shape = wrench(pn.GeometryContact("ball", "ground", name=own_name))
            np.testing.assert_allclose(by_shape, by_frame, rtol=0.0, atol=1e-9 * np.abs(by_frame).max())
        assert np.abs(by_frame - wrench()).max() > 1.0


def test_the_wrench_of_a_pair_of_shapes_is_that_of_its_points():
    """A box that touches with corners, beside a contact at each of its corners."""
    import coal

    model = robot()
    index = model.getFrameId("tip", pin.FrameType.BODY)
    at, sizes = model.frames[index], np.array([0.05, 0.04, 0.06])
    corners = [tuple(0.5 * sizes * signs) for signs in itertools.product((-1.0, 1.0), repeat=3)]
    height = min(place_of(model, "tip").act(np.array(corner))[2] for corner in corners)
    shapes = pin.GeometryModel()
    shapes.addGeometryObject(
        pin.GeometryObject("block", at.parentJoint, index, at.placement, coal.Box(*sizes))
    )

    def wrench(*contacts):
        made = pn.Scene(model, contacts=contacts, collision_model=shapes, q0=START)
        run = pn.simulate(made, 0.01, record="reactions")
        return run.reaction("flange", "world")[0]

    by_points = wrench(*(pn.PointContact("tip", offset=c, height=height, mu=0.5) for c in corners))
    by_shape = wrench(pn.GeometryContact("block", pn.ground(height=height), mu=0.5))
    np.testing.assert_allclose(by_shape, by_points, rtol=0.0, atol=1e-9 * np.abs(by_points).max())
    assert np.abs(by_points - wrench()).max() > 1.0
