"""Contacts beside prescribed motions in time stepping: belts, lifts, turntables and grippers on lifts."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

GRAVITY = 9.81
SHORT, ALL = 6, 40
SEEDS = [seed if seed < SHORT else pytest.param(seed, marks=pytest.mark.slow) for seed in range(ALL)]
DT = 1e-3
TABLE_MASS, BOX = 5.0, (0.1, 0.08, 0.05)


def on_table(
    joint: object, motion: object, rate: float, places: list[pin.SE3], mu: float, rough: float = 0.0
) -> pn.Scene:
    """Return boxes that start at rest on a table of prescribed motion, which starts with a rate.

    `rough` is the dry friction of the table's joint.
    """
    model, shapes = pin.Model(), pin.GeometryModel()
    table = model.addJoint(0, joint, pin.SE3.Identity(), "table")
    model.appendBodyToJoint(table, pin.Inertia.FromBox(TABLE_MASS, 4.0, 4.0, 0.1), pin.SE3.Identity())
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05]))
    shapes.addGeometryObject(pin.GeometryObject("table", table, place, coal.Box(4.0, 4.0, 0.1)))
    for i, at in enumerate(places):
        pn.free_body(model, f"box {i}", coal.Box(*BOX), mass=1.0, collision_model=shapes, place=at)
    contacts = [pn.GeometryContact(f"box {i}", "table", mu=mu) for i in range(len(places))]
    v0 = np.r_[rate, np.zeros(6 * len(places))]
    moves = [pn.PrescribedMotion("table", motion, name="drive")]
    laws = [pn.JointFriction("table", coulomb=rough)] if rough > 0.0 else []
    return pn.Scene(model, contacts=contacts, collision_model=shapes, constraints=moves, laws=laws, v0=v0)


def in_a_row(count: int) -> list[pin.SE3]:
    return [pin.SE3(np.eye(3), np.array([0.0, 0.3 * i, BOX[2] / 2.0])) for i in range(count)]


@pytest.mark.parametrize("rough", [0.0, 2.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_belt_carries_boxes_along(seed: int, rough: float) -> None:
    """Boxes slide with the acceleration mu g until they have the speed of the belt.

    The force of the drive is the friction of all boxes while they slide, and of the joint.
    """
    rng = np.random.default_rng(seed)
    count, mu, speed = rng.integers(1, 4), rng.uniform(0.1, 0.5), rng.uniform(0.3, 0.8)
    start = pn.polynomial([0.0, speed])
    scene = on_table(pin.JointModelPX(), start, speed, in_a_row(count), mu, rough)
    caught = speed / (mu * GRAVITY)
    run = pn.simulate(scene, 1.5 * caught, method="moreau", dt=DT, record=("forces", "energy"))
    slides = (run.t > 0.0) & (run.t < caught - 2.0 * DT)
    np.testing.assert_allclose(run.joint("table").q, speed * run.t, rtol=0, atol=1e-13)
    for i in range(count):
        travel = run.joint(f"box {i}").q[:, 0]
        np.testing.assert_allclose(travel[slides], mu * GRAVITY * run.t[slides] ** 2 / 2.0, atol=1e-9)
        np.testing.assert_allclose(travel[-1], speed * (run.t[-1] - caught / 2.0), atol=speed * DT)
    np.testing.assert_allclose(run.lam[slides, 0], mu * GRAVITY * count + rough, rtol=1e-9)
    assert np.abs(run.energy["balance"]).max() < 1e-12
    work = count * mu * GRAVITY * speed * caught + rough * speed * run.t[-1]
    np.testing.assert_allclose(run.energy["constraints"][-1], work, rtol=2.0 * DT / caught)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_lift_carries_a_box_without_a_gap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    omega = rng.uniform(3.0, 10.0)
    height = rng.uniform(0.2, 0.9) * GRAVITY / omega**2
    scene = on_table(pin.JointModelPZ(), pn.sinusoid(height, omega), height * omega, in_a_row(1), mu=0.5)
    v0 = np.array(scene.v0)
    v0[3] = height * omega
    run = pn.simulate(scene, 1.0, v=v0, method="moreau", dt=DT, record=("a", "forces"))
    lift = run.joint("table")
    np.testing.assert_allclose(lift.q, height * np.sin(omega * run.t), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.joint("box 0").q[:, 2], lift.q, rtol=0, atol=1e-12)
    load = GRAVITY - height * omega**2 * np.sin(omega * run.t)
    np.testing.assert_allclose(run.contact("box 0 on table").normal_force, load, atol=1e-8)
    np.testing.assert_allclose(run.lam[:, 0], (TABLE_MASS + 1.0) * load, atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_turntable_turns_boxes_that_stick(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn, omega = rng.uniform(0.2, 0.6), rng.uniform(1.0, 2.0)
    places = [
        pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, rng.uniform(-3.0, 3.0)), np.array([0.3, y, BOX[2] / 2.0]))
        for y in (-0.2, 0.2)
    ]
    scene = on_table(pin.JointModelRZ(), pn.sinusoid(turn, omega, np.pi / 2.0), 0.0, places, mu=0.9)
    run = pn.simulate(scene, 1.0, method="moreau", dt=DT, output_dt=0.1)
    for i, place in enumerate(places):
        for q, angle in zip(
            run.joint(f"box {i}").q, run.joint("table").q - run.joint("table").q[0], strict=True
        ):
            now = place * pin.XYZQUATToSE3(q)
            carried = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, angle), np.zeros(3)) * place
            assert np.abs(pin.log6(now.actInv(carried)).vector).max() < 1e-6


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_box_slips_out_of_a_gripper_that_rises(seed: int, order: int) -> None:
    """Two driven fingers on a lift press too little to hold the box."""
    rng = np.random.default_rng(seed)
    mass, press, rise = rng.uniform(0.2, 1.0), rng.uniform(2.0, 8.0), rng.uniform(0.0, 3.0)
    mu = rng.uniform(0.1, 0.9) * mass * (GRAVITY + rise) / (2.0 * press)
    model, shapes = pin.Model(), pin.GeometryModel()
    lift = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "lift")
    above = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3]))
    model.appendBodyToJoint(lift, pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.1), above)
    for name, side in (("left", -1.0), ("right", 1.0)):
        place = pin.SE3(np.eye(3), np.array([side * 0.04, 0.0, 0.0]))
        joint = model.addJoint(lift, pin.JointModelPX(), place, name)
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(0.2, 0.02, 0.06, 0.3), pin.SE3.Identity())
        pad = pin.GeometryObject(name, joint, pin.SE3.Identity(), coal.Box(0.02, 0.06, 0.3))
        shapes.addGeometryObject(pad)
    solid = coal.Box(0.06, 0.05, 0.05)
    pn.free_body(model, "box", solid, mass=mass, collision_model=shapes, place=(0.0, 0.0, 0.1))
    scene = pn.Scene(
        model,
        contacts=[pn.GeometryContact(pad, "box", mu=mu) for pad in ("left", "right")[::order]],
        collision_model=shapes,
        actuation=pn.Table([0.0], {"left": [press], "right": [-press]}),
        constraints=[pn.PrescribedMotion("lift", pn.polynomial([0.0, 0.0, rise / 2.0]))],
    )
    run = pn.simulate(scene, 0.04, method="moreau", dt=DT, output_dt=0.01)
    expected = np.zeros((len(run), 6))
    expected[:, 2] = (2.0 * mu * press / mass - GRAVITY) * run.t
    np.testing.assert_allclose(run.joint("box").v, expected, atol=2e-6)


def arm_on_a_cart(joint: object, arm: object, hold: float = 0.0) -> pn.Scene:
    """Return a free or held arm on a driven cart, with a box at rest elsewhere and a ball on the cart."""
    model, shapes = pin.Model(), pin.GeometryModel()
    cart = model.addJoint(0, joint, pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(cart, pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.1), pin.SE3.Identity())
    link = model.addJoint(cart, arm, pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0])), "arm")
    place = pin.SE3(np.eye(3), np.array([0.1, 0.02, -0.1]))
    model.appendBodyToJoint(link, pin.Inertia.FromBox(0.3, 0.1, 0.05, 0.05), place)
    below = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.05]))
    shapes.addGeometryObject(pin.GeometryObject("floor", 0, below, coal.Box(9.0, 9.0, 0.1)))
    solid = coal.Box(0.1, 0.1, 0.1)
    pn.free_body(model, "box", solid, mass=1.0, collision_model=shapes, place=(2.0, 0.0, -0.95))
    return pn.Scene(
        model,
        contacts=[pn.GeometryContact("box", "floor", mu=0.3)],
        collision_model=shapes,
        constraints=[pn.PrescribedMotion("cart", pn.sinusoid(0.3, 6.0))],
        actuation=pn.HoldPosition(kp={"arm": hold}, kd={"arm": 0.1}) if hold > 0.0 else None,
        v0=np.r_[1.8, np.zeros(7)],
    )


JOINTS = {
    "slide": (pin.JointModelPX, pin.JointModelRY),
    "turntable": (pin.JointModelRZ, pin.JointModelRZ),
    "swing": (pin.JointModelRX, pin.JointModelRY),
    "unbounded": (pin.JointModelRUBZ, pin.JointModelPX),
}


@pytest.mark.parametrize("kind", JOINTS)
def test_an_arm_on_a_driven_cart_follows_to_second_order(kind: str) -> None:
    joint, arm = JOINTS[kind]
    scene = arm_on_a_cart(joint(), arm())
    nv = scene.model.joints[1].nq + 1
    exact = pn.simulate(scene, 1.0, rtol=1e-11, atol=1e-13, output_dt=1.0).q[-1, :nv]
    runs = [pn.simulate(scene, 1.0, method="moreau", dt=dt, output_dt=1.0) for dt in (2e-3, 1e-3)]
    coarse, fine = (np.abs(run.q[-1, :nv] - exact).max() for run in runs)
    assert coarse / fine > 3.6
    assert fine < 5e-5


@pytest.mark.parametrize("kind", JOINTS)
@pytest.mark.parametrize("hold", [0.0, 5.0])
def test_records_of_a_driven_arm_change_nothing_and_balance(kind: str, hold: float) -> None:
    joint, arm = JOINTS[kind]
    scene = arm_on_a_cart(joint(), arm(), hold)
    steps = {"method": "moreau", "dt": DT, "output_dt": 0.1}
    plain = pn.simulate(scene, 0.5, **steps)
    run = pn.simulate(scene, 0.5, record=("forces", "energy"), **steps)
    np.testing.assert_array_equal(run.q, plain.q)
    assert np.abs(run.energy["balance"]).max() < 1e-4
    assert np.abs(run.energy["projection"]).max() < 1e-2


@pytest.mark.parametrize("contact", ["limit", "floor"])
@pytest.mark.parametrize("method", ["dop853", "moreau"])
def test_a_motion_prescribed_into_a_contact_is_refused_by_name(method: str, contact: str) -> None:
    model, shapes = pin.Model(), pin.GeometryModel()
    lift = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "lift")
    model.appendBodyToJoint(lift, pin.Inertia.FromBox(5.0, 0.4, 0.4, 0.1), pin.SE3.Identity())
    shapes.addGeometryObject(pin.GeometryObject("table", lift, pin.SE3.Identity(), coal.Box(0.4, 0.4, 0.1)))
    shapes.addGeometryObject(pn.ground())
    floor = pn.GeometryContact("table", "ground", mu=0.5)
    contacts = [pn.JointLimit("lift", lower=0.05) if contact == "limit" else floor]
    drive = pn.PrescribedMotion("lift", pn.polynomial([0.3, -0.5]), name="drive")
    scene = pn.Scene(model, constraints=[drive], contacts=contacts, collision_model=shapes, q0=[0.3])
    step = {"dt": DT} if method == "moreau" else {}
    with pytest.raises(pn.InconsistentConstraintsError, match=r'cannot separate.*\("drive"\)') as told:
        pn.simulate(scene, 1.0, method=method, **step)
    if step:
        stepper = scene.stepper(1.0, method=method, **step)
        with pytest.raises(pn.InconsistentConstraintsError, match=r'cannot separate at.*\("drive"\)'):
            stepper.step()
        touch = 0.5 + 0.25 * DT
        with pytest.raises(pn.InconsistentConstraintsError, match=r"cannot separate at.*drive") as of_step:
            scene.step([0.3 - 0.5 * touch], [-0.5], None, DT, t=touch, method=method)
        assert 'method="moreau"' not in str(of_step.value)
    assert 'method="moreau"' not in str(told.value)
    assert abs(told.value.time - 0.5) <= 2.0 * DT


def test_friction_of_a_driven_joint_changes_its_mode_where_its_motion_does() -> None:
    """The joint stands, turns from 0.05 to 0.2 s and stands again, beside two joints that swing."""
    model, place = pin.Model(), pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3]))
    parent = 0
    for name in ("driven", "middle", "last"):
        parent = model.addJoint(parent, pin.JointModelRY(), place if parent else pin.SE3.Identity(), name)
        model.appendBodyToJoint(
            parent, pin.Inertia(1.0, place.translation, 0.01 * np.eye(3)), pin.SE3.Identity()
        )
    turn = pn.spline([0.05, 0.2], [0.0, 0.2])
    for motion, kinds in ((turn, ["slip", "stick"]), (pn.constant(0.0), [])):
        drive = pn.PrescribedMotion("driven", motion, name="drive")
        rough = pn.JointFriction("driven", coulomb=0.5)
        scene = pn.Scene(model, constraints=[drive], laws=[rough], v0=[0.0, -0.7, 0.3])
        run = pn.simulate(scene, 0.25, method="moreau", dt=DT)
        assert [event.kind for event in run.events] == kinds
