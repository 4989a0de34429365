"""Trees whose joint friction follows the joints' loads, beside inverse dynamics by Pinocchio.

The oracle solves nothing: the motion of the core and Pinocchio's recursion give the wrench of each joint, the
wrench gives the friction of the law, and both must agree along each degree of freedom.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.random_trees import add, placement
from ...support.seeds import seeds

# Rounding of two recursions over a hundred bodies, relative to the loads of the joints.
ROUNDING = 1e-11
KINDS = (
    "revolute unaligned",
    "revolute z",
    "endless x",
    "prismatic unaligned",
    "prismatic y",
    "spherical",
    "planar",
)
# Axis of each kind of joint in its frame; spherical joints have none.
AXIS = np.array([0.36, 0.48, 0.8])
X, Y, Z = np.eye(3)
AXES = dict(zip(KINDS, (AXIS, Z, X, AXIS, Y, None, Z), strict=True))


def loaded_tree(rng, joints, branches=0.2, armature=False):
    """Return a scene of joints, their kinds and laws (None: no friction), and a state in motion."""
    model, kinds, laws = pin.Model(), [], []
    for k in range(joints):
        parent = k
        while parent > 0 and rng.uniform() < branches:
            parent = model.parents[parent]
        kinds.append(str(rng.choice(KINDS)))
        add(model, f"j{k}", kinds[-1], parent, rng, mass=float(rng.uniform(0.2, 3.0)))
        laws.append(None if rng.uniform() < 0.2 else bearing(rng, f"j{k}", kinds[-1]))
    model.gravity = pin.Motion(9.81 * AXIS, np.zeros(3))
    if armature:
        model.armature = rng.uniform(0.0, 0.2, model.nv)
    forces = []
    for k in range(0, joints, 3):
        model.addFrame(pin.Frame(f"hook{k}", k + 1, 0, placement(rng), pin.FrameType.OP_FRAME))
        forces.append(pn.Wrench(f"hook{k}", list(rng.normal(size=6))))
    scene = pn.Scene(model, laws=[law for law in laws if law], forces=forces)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    return scene, kinds, laws, q, rng.normal(size=model.nv)


def bearing(rng, joint, kind):
    sizes = {"mu": rng.uniform(0.02, 0.2), "coulomb": rng.uniform(0.0, 0.5) * (rng.uniform() < 0.3)}
    if not kind.startswith("prismatic"):
        sizes["radius"] = rng.uniform(0.005, 0.03)
    if kind != "spherical" and rng.uniform() < 0.6:
        sizes["span"] = rng.uniform(0.3, 1.0)
    if kind.startswith(("revolute", "endless")) and rng.uniform() < 0.6:
        sizes["axial_radius"] = rng.uniform(0.005, 0.03)
    if kind != "planar" and rng.uniform() < 0.3:
        sizes |= {"static_ratio": 1.5, "stribeck_velocity": rng.uniform(0.1, 1.0)}
    if rng.uniform() < 0.3:
        sizes["viscous"] = rng.uniform(0.0, 0.1)
    return pn.JointFriction(joint, **{key: float(size) for key, size in sizes.items()})


def friction(law, kind, wrench, v):
    """Return the friction along the velocities v of a joint that carries a wrench, in the joint's frame."""
    force, moment = wrench.linear, wrench.angular
    span = 1.0 / law.span if law.span else 0.0
    constant = law.coulomb + law.preload

    def resist(limit, v):
        speed, stribeck = np.linalg.norm(v), 0.0
        if law.stribeck_velocity:
            stribeck = (law.static_ratio - 1.0) * np.exp(-((speed / law.stribeck_velocity) ** 2))
        return -limit * (1.0 + stribeck) * v / speed

    if kind == "spherical":
        return resist(constant + law.mu * law.radius * np.linalg.norm(force), v) - law.viscous * v
    axis = AXES[kind]
    axial = force @ axis
    radial, bending = force - axial * axis, moment - (moment @ axis) * axis
    if kind == "planar":
        limit = constant + law.mu * (abs(axial) + span * np.linalg.norm(bending))
        slide, turn = resist(limit, v[:2]), resist(law.radius * limit, v[2:])
        return np.concatenate([slide - law.viscous * v[:2], turn - law.viscous * law.radius**2 * v[2:]])
    if kind.startswith("prismatic"):
        limit = constant + law.mu * (np.linalg.norm(radial) + span * np.linalg.norm(moment))
    else:
        load = law.radius * (
            np.linalg.norm(radial) + span * np.linalg.norm(bending)
        ) + law.axial_radius * abs(axial)
        limit = constant + law.mu * load
    return resist(limit, v) - law.viscous * v


def assert_laws(scene, kinds, laws, q, v, a):
    """Assert that each joint carries its friction and no other force along its motion."""
    model = scene.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    external = [pin.Force.Zero() for _ in range(model.njoints)]
    for wrench in scene.forces:
        frame = model.frames[model.getFrameId(wrench.frame)]
        world = pin.SE3(data.oMf[model.getFrameId(wrench.frame)].rotation.T, np.zeros(3))
        external[frame.parentJoint] += frame.placement.act(world.act(pin.Force(np.array(wrench.value))))
    carried = pin.rnea(model, data, q, v, a, external).copy()
    scale = max(np.abs(force.vector).max() for force in data.f)
    for k, (kind, law) in enumerate(zip(kinds, laws, strict=True)):
        joint = model.joints[k + 1]
        own = slice(joint.idx_v, joint.idx_v + joint.nv)
        expected = friction(law, kind, data.f[k + 1], v[own]) if law else np.zeros(joint.nv)
        np.testing.assert_allclose(
            carried[own], expected, rtol=0, atol=ROUNDING * scale, err_msg=f"j{k}, {kind}"
        )


@pytest.mark.parametrize("seed", seeds(range(40)))
def test_joints_carry_the_friction_of_their_loads(seed):
    rng = np.random.default_rng(seed)
    joints = int(rng.integers(2, 25)) if seed % 2 else int(rng.integers(42, 90))
    case = loaded_tree(rng, joints, branches=0.2 if seed % 2 else 0.02, armature=bool(seed % 3 == 0))
    scene, *_, q, v = case
    assert_laws(*case, scene.acceleration(q, v))


@pytest.mark.parametrize("seed", seeds(range(40, 60)))
def test_joints_carry_the_friction_of_their_loads_during_runs(seed):
    # Each evaluation starts from the wrenches of the last one.
    rng = np.random.default_rng(seed)
    joints = int(rng.integers(2, 25)) if seed % 2 else int(rng.integers(42, 70))
    case = loaded_tree(rng, joints, branches=0.2 if seed % 2 else 0.02)
    scene, kinds, laws, q, v = case
    dt = 0.02 / np.abs(v).max()
    grid = {"dt": dt, "output_dt": dt}
    run = pn.simulate(scene, 4 * dt, q, v, method="rk4", record="a", progress=False, **grid)
    first_event = min((event.time for event in run.events), default=np.inf)
    for k in np.flatnonzero(run.t < first_event):
        assert_laws(scene, kinds, laws, run.q[k], run.v[k], run.a[k])
    assert len(run.t) > 1


@pytest.mark.parametrize("joints", [5, 60])
def test_motion_takes_few_sweeps(joints):
    rng = np.random.default_rng(joints)
    model, parent = pin.Model(), 0
    link = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), 0.1 * np.eye(3))
    for k in range(joints):
        place = pin.SE3(np.eye(3), np.array([1.0 if k else 0.0, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"j{k}")
        model.appendBodyToJoint(parent, link, pin.SE3.Identity())
    scene = pn.Scene(model, laws=[pn.JointFriction(f"j{k}", mu=0.05, radius=0.01) for k in range(joints)])
    q = rng.normal(scale=0.1, size=joints)
    v = rng.uniform(1.5, 2.5, joints) * (-1.0) ** np.arange(joints)
    run = pn.simulate(scene, 3e-3, q, v, method="rk4", dt=5e-5, output_dt=3e-3, progress=False)
    assert not run.events
    # A proof of uniqueness takes a sweep for each joint, in every sixtieth step of 60 joints.
    assert run.stats.iterations <= 3 * run.stats.evaluations
