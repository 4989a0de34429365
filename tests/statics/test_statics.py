"""Scenes at rest and torques of a motion, beside closed forms, a catenary and a Gough platform."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import fsolve

import pin_nonideal as pn

from ..support.refusals import refuses

G = 9.81
FEW = 4  # starts of searches that end without a state of rest


def bar(model, parent, place, name, length, mass=1.0):
    """A uniform bar along x of its joint about y."""
    joint = model.addJoint(parent, pin.JointModelRY(), place, name)
    inertia = np.diag([1e-4, mass * length**2 / 12.0, mass * length**2 / 12.0])
    model.appendBodyToJoint(
        joint, pin.Inertia(mass, np.array([0.5 * length, 0.0, 0.0]), inertia), pin.SE3.Identity()
    )
    return joint, pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))


def chain(links, span):
    """A chain of even links of 1 m in all that hangs between two points at one height."""
    model, joint, place = pin.Model(), 0, pin.SE3.Identity()
    for k in range(links):
        joint, place = bar(model, joint, place, f"link{k}", 1.0 / links, 1.0 / links)
    model.addFrame(pin.Frame("end", joint, 0, place, pin.FrameType.OP_FRAME))
    model.addFrame(
        pin.Frame("nail", 0, 0, pin.SE3(np.eye(3), np.array([span, 0, 0])), pin.FrameType.OP_FRAME)
    )
    return pn.Scene(model, constraints=[pn.PointAnchor("end", "nail", axes="xz", name="nailed")])


@pytest.mark.parametrize("links", [3, 8, pytest.param(25, marks=pytest.mark.slow)])
def test_a_hanging_chain_is_the_discrete_catenary(links):
    """tan(theta_i) of the links grows evenly, by the weight of one over the horizontal pull."""
    scene, length, span = chain(links, 0.6), 1.0 / links, 0.6
    weight = G / links

    def gaps(x):
        down = np.arctan((x[1] - weight * (np.arange(links) + 0.5)) / x[0])
        return [length * np.cos(down).sum() - span, length * np.sin(down).sum()]

    pull, start = fsolve(gaps, [0.3 * G, 0.5 * G], xtol=1e-14)
    found = pn.equilibrium(scene)
    slopes = np.cumsum(found.q)  # about y: positive turns down
    np.testing.assert_allclose(
        slopes, np.arctan((start - weight * (np.arange(links) + 0.5)) / pull), atol=1e-10
    )
    assert found.stable is True
    assert found.rates.real.min() > 0.0
    np.testing.assert_allclose(np.abs(found.lam), [pull, abs(start - G)], rtol=1e-9)
    still = pn.simulate(scene, 0.5, q=found.q)
    np.testing.assert_allclose(still.q, np.tile(found.q, (len(still), 1)), rtol=0, atol=1e-8)


def pendulum():
    model = pin.Model()
    bar(model, 0, pin.SE3.Identity(), "swing", 1.0)
    return pn.Scene(model, q0=[0.3])


def test_a_pendulum_hangs_or_stands():
    hangs = pn.equilibrium(pendulum())
    np.testing.assert_allclose(hangs.q, [0.5 * np.pi], rtol=0, atol=1e-12)
    assert hangs.stable is True
    np.testing.assert_allclose(hangs.rates, [1.5 * G], rtol=1e-8)  # rate of a bar: 3 g / (2 l)
    stands = pn.equilibrium(pendulum(), {"swing": -1.4}, stable=False)
    np.testing.assert_allclose(stands.q, [-0.5 * np.pi], rtol=0, atol=1e-12)
    assert stands.stable is False
    np.testing.assert_allclose(stands.rates, [-1.5 * G], rtol=1e-8)
    held = pn.equilibrium(pendulum(), tau={"swing": -0.25 * G})
    np.testing.assert_allclose(np.cos(held.q), [0.5], rtol=0, atol=1e-12)


def test_a_spring_carries_a_weight():
    """x = m g / k below its rest, stiffness k; a wheel beside it is free to turn."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "lift")
    model.appendBodyToJoint(1, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    spring = pn.JointSpring("lift", stiffness=500.0)
    found = pn.equilibrium(pn.Scene(model, forces=[spring]))
    np.testing.assert_allclose(found.q, [-2.0 * G / 500.0], rtol=1e-12)
    np.testing.assert_allclose(found.stiffness, [[500.0]], rtol=1e-8)
    np.testing.assert_allclose(found.rates, [250.0], rtol=1e-8)
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(2, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    neutral = pn.equilibrium(pn.Scene(model, forces=[spring]))
    np.testing.assert_allclose(neutral.q, [-2.0 * G / 500.0, 0.0], rtol=1e-10, atol=1e-10)
    assert neutral.stable is None


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_a_slide_finds_its_spring_in_any_unit(unit):
    """The spring balances the weight 1.9 m from the start, also where a meter is ten thousand units."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -G * unit])
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    spring = pn.JointSpring("slide", stiffness=50.0, rest=1.9 * unit + 2.0 * G * unit / 50.0)
    found = pn.equilibrium(pn.Scene(model, forces=[spring]), starts=1)
    assert found.q[0] == pytest.approx(1.9 * unit, rel=1e-9)
    assert found.stable is True


def test_what_falls_has_no_rest():
    model = pin.Model()
    model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "fall")
    model.appendBodyToJoint(1, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    with refuses(
        "was found from 2 starts: along motions that the constraints allow, forces of 20", pn.EquilibriumError
    ):
        pn.equilibrium(pn.Scene(model), starts=2)


def test_a_drive_stronger_than_the_weight_is_named():
    """A bar of 1 kg and 1 m turns under 20 N m, and its weight holds 4.905 of them at most."""
    drives = 'the drive of joint "swing", 20 (N or N m), exceeds all resistance: at the smallest '
    held = (
        "unbalanced force the drives push with 20 along a motion that the constraints allow, and all other "
        "forces resist with 4.9"
    )
    with refuses(drives + held + "; reduce the drive, or add resistance", pn.EquilibriumError):
        pn.equilibrium(pendulum(), tau=[20.0], starts=FEW)
    driven = pn.Scene(pendulum().model, actuation=[20.0], laws=[pn.JointFriction("swing", coulomb=30.0)])
    with refuses("dry friction is ignored here, and `rest` includes it", pn.EquilibriumError):
        pn.equilibrium(driven, starts=FEW)
    assert pn.rest(driven).rests
    weightless = pendulum().model
    weightless.gravity = pin.Motion.Zero()
    with refuses('joint "swing", 1e-06 (N or N m), exceeds all resistance', pn.EquilibriumError):
        pn.equilibrium(pn.Scene(weightless), tau=[1e-6], starts=FEW)


@pytest.mark.parametrize(
    "stiffness", [1e3, *(pytest.param(k, marks=pytest.mark.slow) for k in (1e6, 1e9)), 1e11]
)
def test_a_stiff_spring_hides_nothing_that_is_soft(stiffness):
    """A bar on a spring carries one that hangs as without it; driven beyond its weight, it rests nowhere."""
    model = pin.Model()
    joint, place = bar(model, 0, pin.SE3.Identity(), "held", 1.0)
    bar(model, joint, place, "swing", 1.0)
    scene = pn.Scene(model, forces=[pn.JointSpring("held", stiffness=stiffness)], q0=[0.0, 0.3])
    found = pn.equilibrium(scene)
    bent = 1.5 * G / stiffness  # by the weight of both, to first order
    np.testing.assert_allclose(found.q, [bent, 0.5 * np.pi - bent], rtol=0, atol=1e-9 + bent**2)
    assert found.stable is True
    assert found.left < 1e-10 * max(1.0, stiffness * bent) + 1e-15 * stiffness
    held = pn.equilibrium(scene, tau={"swing": -0.25 * G})
    assert np.cos(held.q.sum()) == pytest.approx(0.5, abs=1e-9)
    for push in (4.95, 20.0):
        with refuses(f'the drive of joint "swing", {push:g} (N or N m), exceeds', pn.EquilibriumError):
            pn.equilibrium(scene, tau={"swing": push}, starts=FEW)


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "delta", "andrews_squeezer"])
def test_robots_rest_where_they_are_found(name):
    scene = pn.load(name)
    bare = pn.Scene(scene.model, constraints=scene.constraints, forces=scene.forces, q0=scene.q0)
    found = pn.equilibrium(bare)
    a = bare.acceleration(found.q, np.zeros(bare.model.nv))
    scale = max(np.abs(bare.acceleration(bare.initial_state()[0], np.zeros(bare.model.nv))).max(), 1.0)
    assert np.abs(a).max() < 1e-7 * scale
    if found.stable:  # pushed a little, it stays near
        run = pn.simulate(bare, 2.0, q=found.q, v=bare.project(found.q, 1e-3 * np.ones(bare.model.nv))[1])
        apart = [pin.difference(bare.model, found.q, q) for q in run.q]
        assert np.abs(apart).max() < 0.1


# --- Rest --------------------------------------------------------------------------------------------------


def block(angle, mu, push=(0.0, 0.0, 0.0), **friction):
    """A block of 2 kg on an incline, as a point that moves in space."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(1, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.gravity = pin.Motion(G * np.array([np.sin(angle), 0.0, -np.cos(angle)]), np.zeros(3))
    contact = pn.PointContact("block", mu=mu, name="ground", **friction)
    return pn.Scene(model, contacts=[contact], forces=[pn.Wrench("block", np.append(push, np.zeros(3)))])


@pytest.mark.parametrize("angle", [0.0, 0.2, 0.4, 0.6])
def test_a_block_on_an_incline(angle):
    found = pn.rest(block(angle, 0.5))
    assert found.margin == pytest.approx(1.0 - np.tan(angle) / 0.5, abs=1e-7)
    assert found.rests == (np.tan(angle) <= 0.5)
    np.testing.assert_allclose(found.lam, [2.0 * G * np.cos(angle)], rtol=1e-8)
    np.testing.assert_allclose(
        found.friction["ground"][np.abs(found.friction["ground"]) > 1e-6],
        -2.0 * G * np.sin(angle) if angle else [],
        rtol=1e-6,
    )


def test_the_cone_is_round():
    """With a lateral force the norm of the tangential force counts, in every direction."""
    for turn in np.linspace(0.0, 2.0 * np.pi, 7):
        push = 5.0 * np.array([np.cos(turn), np.sin(turn), 0.0])
        found = pn.rest(block(0.2, 0.5, push))
        along = push[:2] + np.array([2.0 * G * np.sin(0.2), 0.0])
        limit = 0.5 * 2.0 * G * np.cos(0.2)
        assert found.margin == pytest.approx(1.0 - np.linalg.norm(along) / limit, abs=1e-6)


def test_a_contact_cannot_pull():
    found = pn.rest(block(0.0, 0.5, (0.0, 0.0, 3.0 * G)))
    assert (found.rests, found.margin, found.friction) == (False, -np.inf, {})


def test_static_friction_and_joints():
    scene = block(0.4, 0.5, static_ratio=1.2)
    assert pn.rest(scene).margin == pytest.approx(1.0 - np.tan(0.4) / 0.6, abs=1e-7)
    model = pin.Model()
    bar(model, 0, pin.SE3.Identity(), "swing", 1.0)
    held = pn.Scene(model, laws=[pn.JointFriction("swing", coulomb=10.0)])
    assert pn.rest(held).margin == pytest.approx(1.0 - 0.05 * G, abs=1e-7)
    assert pn.rest(held, tau={"swing": -0.5 * G}).margin == pytest.approx(1.0, abs=1e-7)
    loose = pn.Scene(model, laws=[pn.JointFriction("swing", coulomb=1.0)])
    assert pn.rest(loose).margin == pytest.approx(1.0 - 0.5 * G, abs=1e-6)


def test_rest_agrees_with_the_motion():
    """The simulation stays at rest if the margin is positive, and moves if it is negative."""
    for angle, mu in ((0.3, 0.4), (0.3, 0.28), (0.5, 0.6), (0.5, 0.5)):
        scene = block(angle, mu)
        assert pn.rest(scene).rests == (np.abs(pn.simulate(scene, 0.2).v).max() == 0.0)


# --- The mount, and drives ----------------------------------------------------------------------------------


def on_mount(scene, turn):
    """A scene whose model, gravity and ground are turned together."""
    model = scene.model.copy()
    for j in range(1, model.njoints):
        if model.parents[j] == 0:
            model.jointPlacements[j] = turn * model.jointPlacements[j]
    for k in range(1, model.nframes):
        if model.frames[k].parentJoint == 0:
            model.frames[k].placement = turn * model.frames[k].placement
    model.gravity = pin.Motion(turn.rotation @ model.gravity.linear, np.zeros(3))
    parts = {key: getattr(scene, key) for key in ("constraints", "laws", "forces", "actuation", "q0", "v0")}
    return pn.Scene(model, **parts)


def sled():
    """A body that slides in a level plane."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "sled")
    model.appendBodyToJoint(
        1, pin.Inertia(2.0, np.array([0.1, 0.0, 0.0]), 0.1 * np.eye(3)), pin.SE3.Identity()
    )
    return pn.Scene(model)


@pytest.mark.parametrize("seed", range(8))
def test_margins_of_rest_do_not_depend_on_the_mount(seed):
    turn = pin.SE3(pin.exp3(np.random.default_rng(seed).normal(size=3)), np.zeros(3))
    assert pn.rest(on_mount(sled(), turn)).margin == 1.0  # gravity across its plane moves nothing
    four_bar = pn.load("four_bar")
    margin = pn.rest(four_bar).margin
    assert pn.rest(on_mount(four_bar, turn)).margin == pytest.approx(margin, rel=1e-7)


def test_a_drive_that_accelerates_stands_still_in_statics():
    """A drive moves a joint with friction: statics use the position at the given time, without velocity."""
    model = pin.Model()
    bar(model, 0, pin.SE3.Identity(), "swing", 1.0)
    rubs = pn.JointFriction("swing", mu=0.2, radius=0.1)
    for drive in (pn.constant(0.3), pn.polynomial([0.3, 1.0, 5.0])):
        held = pn.Scene(
            model, constraints=[pn.PrescribedMotion("swing", drive, name="drive")], laws=[rubs], q0=[0.3]
        )
        found = pn.rest(held)
        assert (found.rests, found.margin) == (True, 1.0)
        np.testing.assert_allclose(found.lam, [-0.5 * G * np.cos(0.3)], rtol=1e-7)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_least_torques_do_not_depend_on_the_unit_of_length(unit):
    """A slide and a crank that lift one load together: each does half of the work, in any unit."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "crank")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), unit**2 * np.eye(3)), pin.SE3.Identity())
    model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(2, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.gravity = pin.Motion(unit * model.gravity.linear, np.zeros(3))
    belt = pn.JointCoupling("slide", "crank", ratio=0.3 * unit)
    found = pn.inverse_dynamics(pn.Scene(model, constraints=[belt]), *np.zeros((3, 2)))
    work = found.tau * [1.0, 0.3 * unit]
    np.testing.assert_allclose(work / work.sum(), [0.5, 0.5], rtol=1e-9)
    np.testing.assert_allclose(work.sum(), 0.3 * 2.0 * G * unit**2, rtol=1e-9)


# --- Inverse dynamics --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["four_bar", "rough_four_bar", "five_bar", "slider_crank", "delta", "worm_drive"]
)
@pytest.mark.parametrize("moves", [False, True])
def test_torques_give_the_motion_back(name, moves):
    scene = pn.load(name)
    rng = np.random.default_rng(3)
    q, v = scene.project(None, rng.standard_normal(scene.model.nv) if moves else np.zeros(scene.model.nv))
    a = scene.acceleration(q, v, tau=rng.standard_normal(scene.model.nv) * 5.0)
    found = pn.inverse_dynamics(scene, q, v, a)
    again = scene.acceleration(q, v, tau=found.tau)
    np.testing.assert_allclose(again, a, rtol=0, atol=1e-10 * max(1.0, np.abs(a).max()))
    assert found.left < 1e-9 * max(1.0, np.abs(found.tau).max())


def test_without_loops_it_is_the_recursive_newton_euler_algorithm():
    model = pin.buildSampleModelManipulator()
    rng = np.random.default_rng(0)
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    v, a = rng.standard_normal(model.nv), rng.standard_normal(model.nv)
    expected = pin.rnea(model, model.createData(), q, v, a)
    found = pn.inverse_dynamics(pn.Scene(model), q, v, a)
    np.testing.assert_allclose(found.tau, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def gough(load):
    """A platform on six legs that push: universal joints below, a ball above; a wrench on the platform."""
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    feet = [np.array([np.cos(x), np.sin(x), 0.0]) for x in np.deg2rad([0, 60, 120, 180, 240, 300])]
    tops = [
        0.6 * np.array([np.cos(x), np.sin(x), 0.0]) + [0, 0, 1.0]
        for x in np.deg2rad([25, 35, 145, 155, 265, 275])
    ]
    platform = model.addJoint(
        0, pin.JointModelFreeFlyer(), pin.SE3(np.eye(3), np.array([0, 0, 1.0])), "platform"
    )
    model.appendBodyToJoint(platform, pin.Inertia(5.0, np.zeros(3), 0.3 * np.eye(3)), pin.SE3.Identity())
    anchors, wrench = [], np.zeros((6, 6))
    for k, (foot, top) in enumerate(zip(feet, tops, strict=True)):
        along = (top - foot) / np.linalg.norm(top - foot)
        turn = pin.Quaternion.FromTwoVectors(np.array([0, 0, 1.0]), along).toRotationMatrix()
        below = model.addJoint(0, pin.JointModelRX(), pin.SE3(turn, foot), f"a{k}")
        across = model.addJoint(below, pin.JointModelRY(), pin.SE3.Identity(), f"b{k}")
        leg = model.addJoint(
            across,
            pin.JointModelPZ(),
            pin.SE3(np.eye(3), np.array([0, 0, np.linalg.norm(top - foot)])),
            f"leg{k}",
        )
        for joint in (below, across, leg):
            model.appendBodyToJoint(
                joint, pin.Inertia(0.1, np.zeros(3), 0.01 * np.eye(3)), pin.SE3.Identity()
            )
        model.addFrame(pin.Frame(f"tip{k}", leg, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
        place = pin.SE3(np.eye(3), top - [0, 0, 1.0])
        model.addFrame(pin.Frame(f"ball{k}", platform, 0, place, pin.FrameType.OP_FRAME))
        anchors.append(pn.PointAnchor(f"tip{k}", f"ball{k}", name=f"ball{k}"))
        wrench[:, k] = np.concatenate([along, np.cross(top - [0, 0, 1.0], along)])
    return pn.Scene(model, constraints=anchors, forces=[pn.Wrench("platform", load)]), wrench


def test_a_gough_platform_is_carried_by_its_legs():
    load = np.array([3.0, -7.0, -50.0, 2.0, 1.0, -4.0])
    scene, wrench = gough(load)
    zero = np.zeros(scene.model.nv)
    legs = [f"leg{k}" for k in range(6)]
    found = pn.inverse_dynamics(scene, scene.initial_state()[0], zero, zero, actuated=legs)
    forces = found.tau[[scene.model.idx_vs[scene.model.getJointId(leg)] for leg in legs]]
    np.testing.assert_allclose(forces, np.linalg.solve(wrench, -load), rtol=0, atol=1e-9)
    assert found.left < 1e-10
    assert np.count_nonzero(found.tau) == 6
    fewer = pn.inverse_dynamics(scene, scene.initial_state()[0], zero, zero, actuated=legs[:5])
    assert fewer.left > 1.0


def test_torques_within_bounds():
    """Two motors on one shaft share evenly, until one has reached its bound."""
    model = pin.Model()
    for name in ("motor1", "motor2"):
        j = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = pn.Scene(model, constraints=[pn.JointCoupling("motor1", "motor2", ratio=1.0)])
    a = [3.0, 3.0]
    np.testing.assert_allclose(pn.inverse_dynamics(scene, [0, 0], [0, 0], a).tau, [3.0, 3.0], atol=1e-12)
    bounded = pn.inverse_dynamics(scene, [0, 0], [0, 0], a, bounds=([-2.0, -10.0], [2.0, 10.0]))
    np.testing.assert_allclose(bounded.tau, [2.0, 4.0], atol=1e-11)
    assert bounded.left < 1e-11
    short = pn.inverse_dynamics(scene, [0, 0], [0, 0], a, bounds=(-2.0, 2.0))
    np.testing.assert_allclose(short.tau, [2.0, 2.0], atol=1e-12)
    assert short.left == pytest.approx(1.0)


def test_what_inverse_dynamics_refuses():
    scene = pn.load("four_bar")
    q, v = scene.initial_state()
    with refuses('inverse_dynamics: a must satisfy the constraints, A a = b; "', pn.InputError):
        pn.inverse_dynamics(scene, q, v, np.ones(scene.model.nv))
    for arguments, message, error in (
        ({"actuated": ["crnk"]}, 'inverse_dynamics: actuated: no joint "crnk"', pn.UnknownNameError),
        ({"actuated": "crank_joint"}, "actuated must be a list of joints; got 'crank_joint'", pn.InputError),
        ({"bounds": 3.0}, "bounds must be a pair (least, largest); got 3.0", pn.InputError),
        (
            {"bounds": (1.0, 0.0)},
            "bounds must leave room: each least torque below the largest",
            pn.InputError,
        ),
    ):
        with refuses(message, error):
            pn.inverse_dynamics(scene, q, v, np.zeros_like(v), **arguments)
    for call in (pn.equilibrium, pn.rest):
        with refuses(f"{call.__name__}: scene must be a Scene; got str", pn.InputError):
            call("four_bar")
