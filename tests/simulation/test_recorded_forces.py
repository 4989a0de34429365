"""Recorded forces of laws, joints and anchors, against Pinocchio and Newton's laws."""

from __future__ import annotations

import dataclasses

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.reactions import CutTree
from pin_nonideal.errors import InputError, UnknownNameError

from ..core.friction.test_stiff_friction import sledge
from ..support.mechanisms import GRAVITY, body, empty, frame
from ..support.refusals import refuses
from ..support.same_run import assert_same_run
from ..support.scenes import kinds

# Difference of recursive Newton-Euler sums from the core's, relative to the largest.
ROUNDING = 1e-10
RECORD = ("a", "forces", "power", "energy", "reactions")


def arm(**parts):
    """Four bodies in a row and one aside: hinge, ball, slide, free axes, with forces and drags on them."""
    model = empty()
    place = pin.SE3(pin.utils.rpyToMatrix(0.2, -0.3, 0.1), np.array([0.1, 0.05, 0.3]))
    solid = np.diag([0.02, 0.03, 0.04])
    kinds = [pin.JointModelRY(), pin.JointModelSpherical(), pin.JointModelPX(), pin.JointModelRZ()]
    joint = 0
    for k, kind in enumerate(kinds):
        joint = body(
            model, joint, kind, f"j{k}", 1.0 + 0.3 * k, place=place, lever=(0.05, 0.02, 0.1), inertia=solid
        )
    body(model, 1, pin.JointModelRX(), "aside", 0.7, place=place, lever=(0.0, 0.1, 0.0), inertia=solid)
    frame(model, "tip", joint, pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3])))
    laws = [
        pn.JointFriction(
            "j0", mu=0.1, radius=0.02, axial_radius=0.01, coulomb=0.1, viscous=0.05, name="elbow"
        ),
        pn.JointFriction("j1", mu=0.2, radius=0.02, name="ball"),
        pn.JointFriction("j2", mu=0.3, static_ratio=1.1, name="rail"),
        pn.Drag("tip", 0.4, 1.5, name="air"),
        pn.LuGre("j3", stiffness=50.0, damping=0.3, coulomb=0.05, stiction=0.08, name="bristles"),
        pn.UserLaw(lambda t, q, v, r: -0.01 * v, reaction=None, name="mine"),
    ]
    forces = [pn.Wrench("tip", [1.0, -2.0, 0.5, 0.1, 0.2, -0.3])]
    q0 = pin.integrate(model, pin.neutral(model), 0.3 * np.arange(1, model.nv + 1) / model.nv)
    return pn.Scene(model, laws=laws, forces=forces, q0=q0, v0=0.4 * np.cos(np.arange(model.nv)), **parts)


def loop():
    """A four-bar whose closing hinge rubs, driven."""
    scene = pn.load("rough_four_bar")
    return pn.Scene(
        scene.model,
        constraints=scene.constraints,
        laws=scene.laws,
        actuation=lambda t, q, v: np.array([3.0 * np.sin(4.0 * t), 0.0, 0.0]),
        q0=scene.q0,
        v0=scene.v0,
    )


SCENES = {
    "arm": arm,
    "loop": loop,
    "sledge": sledge,
    "solo": lambda: pn.load("solo12_standing"),
    "worm": lambda: pn.load("worm_drive"),
    "delta": lambda: pn.load("delta"),
}


@pytest.fixture(scope="module", params=list(SCENES))
def run(request):
    return pn.simulate(SCENES[request.param](), 0.6, output_dt=0.05, record=RECORD, rtol=1e-10)


def test_laws_add_up_to_the_equation_of_motion(run):
    """C = F_ideal + F_nonideal - A^T lam, Eq. (39), and C is the sum over all laws."""
    scene = run.scene
    for k in range(len(run)):
        A = constraint_rows(scene, run, k)
        expected = run.F_ideal[k] + run.F_nonideal[k] - A.T @ run.lam[k]
        total = sum(run.law(name).force[k] for name in scene.law_names)
        size = np.abs(expected).max() + np.abs(A.T @ run.lam[k]).max(initial=0.0) + 1.0
        np.testing.assert_allclose(total, expected, rtol=0.0, atol=ROUNDING * size)


def constraint_rows(scene, run, k):
    runner = scene._compiled.program.runner()
    A = runner.rows(run.q[k], run.v[k], run.t[k])[0]
    return np.array(A).reshape(-1, scene.model.nv)


def test_power_of_a_law_is_its_force_times_the_velocity(run):
    for name in run.scene.law_names:
        law = run.law(name)
        column = name if name in run.power else f"law {name}"
        expected = np.einsum("ij,ij->i", law.force, run.v)
        np.testing.assert_array_equal(law.power, run.power[column])
        np.testing.assert_allclose(
            law.power, expected, rtol=0, atol=ROUNDING * (1.0 + np.abs(expected).max())
        )


def test_what_sticks_is_within_its_limit_and_what_slips_is_at_it(run):
    limited = [name for k, name in enumerate(run.scene.law_names) if k in run.element_laws]
    assert bool(limited) == bool(run.scene.element_names)
    for name in limited:
        law = run.law(name)
        assert law.limit.shape == law.mode.shape == (len(run),)
        assert (law.limit >= 0.0).all()
        assert set(np.unique(law.mode)) <= {-1, 0, 1}


def frame_names(scene, name):
    """Frames of an anchor or contact: frame1, and frame2 or None for the world."""
    model = scene.model
    for key, first, second in scene.anchor_frames:
        if key == name:
            return model.frames[first].name, None if second is None else model.frames[second].name
    contact = next(c for c in scene.contacts if name_of(c) == name)
    return contact.frame, contact.plane


def test_joint_wrenches_are_those_of_pinocchio(run):
    """Joint wrenches equal those of the cut tree with loop and contact forces, including friction."""
    scene, model = run.scene, run.scene.model
    names = [model.names[i] for i in range(1, model.njoints)]
    for k in range(0, len(run), 3):
        tree = CutTree(model, run.q[k], run.v[k], run.a[k])
        for anchor in run.reactions:
            if anchor not in names:
                tree.push_frames(*frame_names(scene, anchor), run.reaction(anchor, axes="world")[k])
        for force in scene.forces:
            if isinstance(force, pn.Wrench):
                place = tree.placement(force.frame)
                wrench = np.asarray(force.value(run.t[k]) if callable(force.value) else force.value)
                tree.push(tree.joint(force.frame), wrench, place.translation)
        for law in scene.laws:
            if isinstance(law, pn.Drag):
                u = tree.velocity(law.frame)
                drag = -law.coefficient * np.linalg.norm(u) ** (law.exponent - 1.0) * u
                tree.push(
                    tree.joint(law.frame), [*drag, 0.0, 0.0, 0.0], tree.placement(law.frame).translation
                )
        expected = tree.joint_wrenches()
        measured = np.array([run.reaction(name)[k] for name in names])
        size = np.abs(expected).max() + 1.0
        np.testing.assert_allclose(measured, expected, rtol=0, atol=ROUNDING * size)
        in_world = np.array([run.reaction(name, axes="world")[k] for name in names])
        for i in range(1, model.njoints):
            R = tree.data.oMi[i].rotation
            turned = np.concatenate([R @ expected[i - 1, :3], R @ expected[i - 1, 3:]])
            np.testing.assert_allclose(in_world[i - 1], turned, rtol=0, atol=ROUNDING * size)


def test_wrenches_of_anchors_are_their_multipliers_and_friction(run):
    """On virtual displacements: the wrench on both bodies does A^T lam, and the forces of the laws there."""
    scene, model = run.scene, run.scene.model
    joints = set(model.names)
    for k in range(0, len(run), 3):
        A = constraint_rows(scene, run, k)
        tree = CutTree(model, run.q[k], run.v[k], run.a[k])
        for anchor in run.reactions:
            if anchor in joints:
                continue
            rows = scene.constraint_slices[anchor]
            expected = A[rows].T @ run.lam[k][rows]
            rubbing = [law for law in scene.laws if getattr(law, "joint", None) == anchor]
            rubbing += [contact for contact in scene.contacts if name_of(contact) == anchor and contact.mu]
            for law in rubbing:
                expected = expected + run.law(name_of(law)).force[k]
            wrench = run.reaction(anchor, axes="world")[k]
            measured = tree.generalized(*frame_names(scene, anchor), wrench)
            np.testing.assert_allclose(
                measured, expected, rtol=0, atol=ROUNDING * (1.0 + np.abs(A).max() * np.abs(run.lam[k]).max())
            )


def name_of(thing):
    """The name that a law, an anchor or a contact has in its scene."""
    place = getattr(thing, "joint", None) or getattr(thing, "frame", None)
    return thing.name or f"{type(thing).__name__}({place})"


def test_a_joint_carries_the_same_wherever_the_loop_is_cut():
    """Hinges of a four-bar have the same wrenches if the loop is cut at the coupler or at the ground."""
    lengths, ground = (0.3, 0.8, 0.6), 0.7
    ahead, back = closed_at_ground(lengths, ground), closed_at_coupler(lengths, ground)
    run = pn.simulate(ahead, 0.5, rtol=1e-12, output_dt=0.1, record="reactions")
    q, v = run.q[0], run.v[0]
    other = pn.simulate(
        back, 0.5, [*q[:2], q.sum()], [*v[:2], v.sum()], rtol=1e-12, output_dt=0.1, record="reactions"
    )
    assert np.ptp(run.q[:, 0]) > 0.1
    np.testing.assert_allclose(run.q[:, 0], other.q[:, 0], atol=1e-9)
    for mine, theirs in (("crank", "crank"), ("pin", "pin"), ("close", "rocker"), ("joint", "close")):
        a, b = run.reaction(mine, axes="world"), other.reaction(theirs, axes="world")
        sign = -1.0 if (mine, theirs) == ("joint", "close") else 1.0
        planar = [0, 2, 4]  # out-of-plane loads of a planar mechanism with spatial closure are not unique
        size = np.abs(a).max()
        np.testing.assert_allclose(a[:, planar], sign * b[:, planar], rtol=0, atol=1e-7 * size, err_msg=mine)


TOUCHING = {name: make for name, make in kinds().items() if name.startswith("touching")}


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4", "semi_implicit_euler", "moreau"])
@pytest.mark.parametrize("name", TOUCHING)
def test_open_contacts_have_no_force(name, method):
    """A body falls, rebounds and comes to rest; between its impacts no force acts."""
    case = TOUCHING[name]()
    steps = {"dt": 1e-3} if method in ("rk4", "semi_implicit_euler", "moreau") else {}
    run = pn.simulate(case.scene, 0.15, case.q0, case.v0, method=method, record="forces", **steps)
    is_open = ~run.closed.any(axis=1)
    assert is_open.any()
    assert run.events
    for values in (run.lam, run.F_nonideal, *run.contact_forces.values()):
        assert not np.any(values[is_open])


def bar(model, parent, name, length, x=0.0):
    place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
    inertia = np.diag([1e-3, length**2 / 12.0, length**2 / 12.0])
    joint = body(
        model,
        parent,
        pin.JointModelRY(),
        name,
        1.0,
        place=place,
        lever=(0.5 * length, 0.0, 0.0),
        inertia=inertia,
    )
    frame(model, f"{name} end", joint, pin.SE3(np.eye(3), np.array([length, 0.0, 0.0])))
    return joint


def friction(*names):
    return [pn.JointFriction(name, coulomb=0.2, viscous=0.05) for name in names]


def closed_at_ground(lengths, ground):
    """Crank, coupler and rocker in a row, whose end is hinged to the ground."""
    model, joint = empty(), 0
    for k, (name, length) in enumerate(zip(("crank", "pin", "joint"), lengths, strict=True)):
        joint = bar(model, joint, name, length, x=lengths[k - 1] if k else 0.0)
    frame(model, "ground", 0, pin.SE3(np.eye(3), np.array([ground, 0.0, 0.0])))
    hinge = pn.HingeAnchor("joint end", "ground", axis="y", name="close")
    return pn.Scene(
        model,
        constraints=[hinge],
        laws=friction("crank", "pin", "joint", "close"),
        q0=[-1.2, 0.9, 1.4],
        v0=[3.0, 0.0, 0.0],
    )


def closed_at_coupler(lengths, ground):
    """Crank and coupler in a row, and the rocker from the ground, hinged together."""
    model = empty()
    crank = bar(model, 0, "crank", lengths[0])
    bar(model, crank, "pin", lengths[1], x=lengths[0])
    rocker = pin.SE3(np.eye(3), np.array([ground, 0.0, 0.0]))
    inertia = np.diag([1e-3, lengths[2] ** 2 / 12.0, lengths[2] ** 2 / 12.0])
    joint = body(
        model,
        0,
        pin.JointModelRY(),
        "rocker",
        1.0,
        place=rocker,
        lever=(-0.5 * lengths[2], 0.0, 0.0),
        inertia=inertia,
    )
    frame(model, "rocker end", joint, pin.SE3(np.eye(3), np.array([-lengths[2], 0.0, 0.0])))
    hinge = pn.HingeAnchor("pin end", "rocker end", axis="y", name="close")
    return pn.Scene(model, constraints=[hinge], laws=friction("crank", "pin", "close", "rocker"))


# --- Recorded, saved and requested --------------------------------------------------------------------------


def held_box(seed, fixed=False):
    """Return a box between two pads that press too little to hold it, its mass and its acceleration.

    One pad is `fixed` by a prescribed motion, or presses too.
    """
    rng = np.random.default_rng(seed)
    mass, press = rng.uniform(0.8, 1.5), rng.uniform(3.0, 6.0)
    mu = rng.uniform(0.1, 0.9) * mass * GRAVITY / (2.0 * press)
    model, shapes = pin.Model(), pin.GeometryModel()
    for name, side in (("left", -1.0), ("right", 1.0)):
        place = pin.SE3(np.eye(3), np.array([side * 0.04, 0.0, 0.0]))
        joint = model.addJoint(0, pin.JointModelPX(), place, name)
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(0.2, 0.02, 0.06, 0.3), pin.SE3.Identity())
        pad = pin.GeometryObject(name, joint, pin.SE3.Identity(), coal.Box(0.02, 0.06, 0.3))
        shapes.addGeometryObject(pad)
    pn.free_body(
        model, "box", coal.Box(0.06, 0.05, 0.05), mass=mass, collision_model=shapes, place=(0, 0, 0.1)
    )
    contacts = [pn.GeometryContact(pad, "box", mu=mu) for pad in ("left", "right")]
    pressing = pn.Table([0.0], {"left": [press], "right": [-press]})
    fixing = [pn.PrescribedMotion("left", pn.polynomial([0.0]))] if fixed else []
    scene = pn.Scene(model, contacts=contacts, collision_model=shapes, actuation=pressing, constraints=fixing)
    return scene, mass, 2.0 * mu * press / mass - GRAVITY


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize(("method", "dt"), [("dop853", None), ("moreau", 1e-3)])
@pytest.mark.parametrize("seed", range(6))
def test_a_box_slips_out_of_pads_as_its_friction_says(seed, method, dt, fixed):
    """Slip has no direction at the start, and has one from the first step on."""
    scene, mass, acceleration = held_box(seed, fixed)
    run = pn.simulate(scene, 0.02, method=method, dt=dt, output_dt=1e-3, record=("a", "forces"))
    np.testing.assert_allclose(run.joint("box").a[:, 2], acceleration, rtol=1e-9)
    friction = sum(
        (1.0 if run.contact(name).bodies[0] == "box" else -1.0) * run.contact_forces[name]
        for name in scene.contact_names
    )
    np.testing.assert_allclose(friction[:, 2], mass * (acceleration + GRAVITY), rtol=1e-9)


def test_nothing_is_recorded_that_was_not_asked_for():
    scene = SCENES["loop"]()
    plain = pn.simulate(scene, 0.1)
    assert not plain.law_forces
    assert not plain.recorded("limits")
    assert not plain.reactions
    law = plain.law(scene.law_names[0])
    assert not law.force
    assert not law.power
    assert not law.limit
    only = pn.simulate(scene, 0.1, record="laws")
    assert not only.recorded("lam")
    assert only.law(scene.law_names[0]).force.shape == only.v.shape
    powers = pn.simulate(scene, 0.1, record="power")
    assert powers.law(scene.law_names[0]).power.shape == powers.t.shape
    with refuses('reaction("crank_joint") needs a run with record="reactions"', InputError):
        plain.reaction("crank_joint")


def test_recording_changes_nothing_else():
    scene = SCENES["arm"]()
    plain, full = pn.simulate(scene, 0.4), pn.simulate(scene, 0.4, record=RECORD)
    for key in ("t", "q", "v"):
        np.testing.assert_array_equal(getattr(plain, key), getattr(full, key))
    assert plain.events == full.events


def test_unknown_names():
    run = pn.simulate(SCENES["arm"](), 0.01, record="reactions")
    with refuses('no law "elbov" in this run; nearest: "elbow"', UnknownNameError):
        run.law("elbov")
    with refuses('no joint, frame, anchor or contact "asside"; nearest: "aside"', UnknownNameError):
        run.reaction("asside")
    with refuses("reaction: axes must be one of 'own', 'world'; got 'local'", InputError):
        run.reaction("aside", axes="local")


def test_files_and_batches_keep_them(tmp_path):
    scene, contact = SCENES["sledge"](), "PointContact(f1)"
    options = {"record": RECORD, "output_dt": 0.1}
    run = pn.simulate(scene, 0.5, **options)
    loaded = pn.Trajectory.load(run.save(tmp_path / "run.npz"))
    assert_same_run(run, loaded)
    np.testing.assert_array_equal(run.law(contact).force, loaded.law(contact).force)
    np.testing.assert_array_equal(run.reaction(contact), loaded.reaction(contact))
    start = scene.initial_state()
    batch = pn.rollout(scene, np.array([start[0]] * 2), np.array([start[1]] * 2), 0.5, jobs=2, **options)
    assert_same_run(run, batch[1])
    swept = pn.sweep(sledge, [{}], 0.5, jobs=1, **options)
    assert_same_run(run, swept[0])
    path = tmp_path / "kept.npz"
    assert_same_run(run, pn.simulate(scene, 0.5, checkpoint=path, **options))
    assert_same_run(run, pn.resume(path, scene))
    part = run.first(3)
    assert part.law(contact).force.shape == (3, scene.model.nv)
    assert part.reaction(contact).shape == (3, 6)


@pytest.mark.parametrize("method", ["Radau", "rk4", "moreau"])
def test_other_methods_record_them(method):
    dt = {} if method == "Radau" else {"dt": 1e-3}
    run = pn.simulate(SCENES["loop"](), 0.2, method=method, output_dt=0.1, record=RECORD, **dt)
    test_power_of_a_law_is_its_force_times_the_velocity(run)
    assert np.isfinite(run.reaction(run.scene.model.names[1])).all()


def test_slip_velocity_of_friction_in_joints_and_anchors():
    """Positive in mode +1 beyond rounding at reversals; in a joint it is the velocity of the joint."""
    panda = pn.simulate(pn.load("panda_friction"), 0.3, output_dt=0.01, record="laws")
    for k, name in enumerate(panda.law_names):
        law = panda.law(name)
        np.testing.assert_array_equal(law.slip_velocity, panda.v[:, k])
        moving = np.abs(law.slip_velocity) > 1e-6
        np.testing.assert_array_equal(np.sign(law.slip_velocity[moving]), law.mode[moving])
    pins = pn.simulate(pn.load("rough_four_bar"), 0.5, output_dt=0.01, record=("laws", "power"))
    for name in pins.law_names:
        law = pins.law(name)
        moving = np.abs(law.slip_velocity) > 1e-6
        np.testing.assert_array_equal(np.sign(law.slip_velocity[moving]), law.mode[moving])
        np.testing.assert_allclose(law.power, -law.limit * np.abs(law.slip_velocity), rtol=1e-9, atol=1e-12)


def test_slip_velocity_of_a_contact():
    """A particle that slides in the plane has the velocity of its joint."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), 0.1 * np.eye(3)), pin.SE3.Identity())
    scene = pn.Scene(model, contacts=[pn.PointContact("body", mu=0.4, name="foot")], v0=[2.0, 1.0, 0.0])
    run = pn.simulate(scene, 0.1, record="laws")
    slip = run.law("foot").slip_velocity
    assert slip.shape == (len(run.t), 2)
    np.testing.assert_allclose(slip, run.v[:, :2], rtol=0.0, atol=1e-14)
    assert dataclasses.replace(run, scene=None).law("foot").slip_velocity is None
