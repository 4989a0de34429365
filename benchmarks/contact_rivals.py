"""MuJoCo, Drake and Pinocchio's ADMM solver on contact cases, with their best settings.

MuJoCo and Drake (discrete solver SAP) have compliant contacts. The stiffness of both is the largest that the
step resolves. The contact of the bouncing ball has the damping of its restitution.
"""

from __future__ import annotations

import logging
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

import pin_nonideal as pn

from . import timing
from .contact_cases import Array, Case
from .mjcf_export import mjcf, numbers

BOUNCE_RATE = 0.1  # frequency of a bouncing contact times the step [rad]
REST_RATE = 2.0 * math.pi  # frequency of a resting contact times the step, the maximum of Drake [rad]
FOOT = 1e-2  # radius of the spheres at the corners of Drake's boxes [m]: Drake has one contact per box


@dataclass
class Run:
    """Run of one tool with one setting.

    Attributes:
        tool: name of the tool.
        setting: description of the setting.
        run: function that runs the case and returns the position of the body's center at the end.
    """

    tool: str
    setting: str
    run: Callable[[], Array]


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio of a compressive spring-damper that opens at zero force, for a restitution."""

    def excess(ratio: float) -> float:
        root = math.sqrt(1.0 - ratio**2)
        turn = math.pi - math.atan2(2.0 * ratio * root, 1.0 - 2.0 * ratio**2)
        return math.exp(-ratio / root * turn) - restitution

    return float(brentq(excess, 1e-12, 1.0 - 1e-12))


def with_ground(text: str, geoms: dict[str, list[dict[str, str]]], h: float, restitution: float) -> Any:
    """Return MuJoCo's model with shapes and a ground plane; contacts are as stiff as the step h allows."""
    import mujoco

    root = ET.fromstring(text)
    option = root.find("option")
    world = root.find("worldbody")
    assert option is not None
    assert world is not None
    option.attrib |= {"timestep": numbers(h), "cone": "elliptic", "impratio": "100", "tolerance": "1e-12"}
    solref = [2.0 * h, 1.0]
    if restitution > 0.0:  # negative numbers: stiffness and damping
        rate = BOUNCE_RATE / h
        solref = [-(rate**2), -2.0 * damping_ratio(restitution) * rate]
    soft = {"solref": numbers(solref), "solimp": "0.9999 0.9999 0.001 0.5 2"}
    ground = {"type": "plane", "size": "0 0 1", "friction": "0 0 0", "condim": "1"}
    ET.SubElement(world, "geom", ground | soft)
    for body in root.iter("body"):
        for geom in geoms.get(body.get("name", ""), ()):
            ET.SubElement(body, "geom", geom | soft)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def mujocos(case: Case, steps: Sequence[float]) -> list[Run]:
    import mujoco

    q0, v0 = case.scene.initial_state()
    text = mjcf(case.scene.model, q0)
    found = []
    for h in steps:
        mj = with_ground(text, {"body": [case.geom]}, h, case.restitution)
        data = mujoco.MjData(mj)

        def run(mj: Any = mj, data: Any = data, count: int = round(case.duration / h)) -> Array:
            mujoco.mj_resetData(mj, data)
            data.qpos[:3], data.qvel[:] = q0[:3], v0
            mujoco.mj_step(mj, data, nstep=count)
            return np.array(data.qpos[:3])

        found.append(Run("mujoco", f"Euler h {h:.0e}", run))
    return found


def drakes(case: Case, steps: Sequence[float]) -> list[Run]:
    """Return runs of Drake's discrete plant; a box has small spheres at its corners."""
    from pydrake.systems.analysis import Simulator

    logging.getLogger("drake").setLevel(logging.ERROR)  # warnings on half spaces and deformable bodies
    q0, v0 = case.scene.initial_state()
    place, speed = np.r_[q0[6], q0[3:6], q0[:3]], np.r_[v0[3:], v0[:3]]
    found = []
    for h in steps:
        plant, diagram = drake_plant(case, h)
        simulator = Simulator(diagram)
        context = simulator.get_mutable_context()
        state = plant.GetMyContextFromRoot(context)

        def run(
            plant: Any = plant, simulator: Any = simulator, context: Any = context, state: Any = state
        ) -> Array:
            context.SetTime(0.0)
            plant.SetPositions(state, place)
            plant.SetVelocities(state, speed)
            simulator.Initialize()
            simulator.AdvanceTo(case.duration)
            return np.array(plant.GetPositions(state)[4:])

        found.append(Run("drake", f"SAP h {h:.0e}", run))
    return found


def drake_plant(case: Case, h: float) -> tuple[Any, Any]:
    """Return the plant of the body and the ground, and its diagram."""
    from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
    from pydrake.multibody.tree import SpatialInertia, UnitInertia
    from pydrake.systems.framework import DiagramBuilder

    inertia = case.scene.model.inertias[1]
    contacts = case.scene.contacts
    lifts = [[0.0, 0.0, 0.0 if contact.radius else FOOT] for contact in contacts]
    spheres = [(np.add(c.offset, lift), c.radius or FOOT) for c, lift in zip(contacts, lifts, strict=True)]
    if case.restitution:
        rate = BOUNCE_RATE / h
        # The implicit scheme adds a damping ratio of half the rate times the step.
        relaxation = 2.0 * (damping_ratio(case.restitution) - 0.5 * BOUNCE_RATE) / rate
    else:
        rate, relaxation = REST_RATE / h, h  # as Drake's documentation recommends

    def material(stiffness: float, relaxation: float) -> Any:
        made = ProximityProperties()
        friction = CoulombFriction(contacts[0].mu, contacts[0].mu)
        AddContactMaterial(friction=friction, point_stiffness=stiffness, properties=made)
        made.AddProperty("material", "relaxation_time", relaxation)
        return made

    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=h, discrete_contact_approximation="sap", contact_model="point")
    plant, _ = AddMultibodyPlant(config, builder)
    turns = UnitInertia(*(np.diag(inertia.inertia) / inertia.mass))
    body = plant.AddRigidBody("body", SpatialInertia(inertia.mass, np.zeros(3), turns))
    plant.mutable_gravity_field().set_gravity_vector(case.scene.model.gravity.linear)
    ground = material(1e14, 0.0)  # rigid: stiffnesses act in series, relaxation times add up
    plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "ground", ground)
    soft = material(inertia.mass * rate**2 / len(spheres), relaxation)
    for k, (middle, radius) in enumerate(spheres):
        plant.RegisterCollisionGeometry(body, RigidTransform(middle), Sphere(radius), f"sphere {k}", soft)
    plant.Finalize()
    return plant, builder.Build()


class Stepping:
    """Time stepping with Pinocchio's ADMM solver, as in its Python examples."""

    def __init__(self, scene: pn.Scene, h: float) -> None:
        self.model, self.h = scene.model, h
        self.data = self.model.createData()
        self.models, self.datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for contact in scene.contacts:
            frame = self.model.frames[self.model.getFrameId(contact.frame)]
            place = frame.placement * pin.SE3(np.eye(3), np.array(contact.offset))
            constraint = pin.PointContactConstraintModel(self.model, frame.parentJoint, place)
            constraint.set = pin.CoulombFrictionCone(contact.mu)
            self.models.append(pin.ConstraintModel(constraint))
            self.datas.append(self.models[-1].createData())
        self.solver, self.result = pin.ADMMConstraintSolver(), pin.ADMMSolverResult()
        self.settings = pin.ADMMSolverSettings()

    def step(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Compute one step from (q, v) with all contacts closed."""
        model, data = self.model, self.data
        free = v + self.h * pin.aba(model, data, q, v, tau)
        pin.crba(model, data, q, pin.Convention.WORLD)
        pin.computeJointJacobians(model, data, q)
        for constraint, its in zip(self.models, self.datas, strict=True):
            constraint.calc(model, data, its)
        factor = pin.ConstraintCholeskyDecomposition(model, data, self.models, self.datas)
        factor.compute(model, data, self.models, self.datas, 0.0)
        J = pin.getConstraintsJacobian(model, data, self.models, self.datas)
        delassus = factor.getDelassusOperatorCholeskyExpression()
        self.solver.solve(delassus, J @ free, self.models, self.datas, self.settings, self.result)
        impulse = self.result.retrieveConstraintImpulses()
        v = free + pin.cholesky.solve(model, data, J.T @ impulse)
        return pin.integrate(model, q, self.h * v), v


def mujoco_steps(scene: pn.Scene, q: Array, h: float) -> timing.Batch:
    """Return a batch of mj_step for the same quadruped with spherical feet."""
    import mujoco

    model = scene.model
    gains = tuple(gain * np.r_[np.zeros(6), np.ones(12)] for gain in (12.0, 0.4))
    geoms: dict[str, list[dict[str, str]]] = {}
    for contact in scene.contacts:
        foot = model.frames[model.getFrameId(contact.frame)]
        geoms.setdefault(model.names[foot.parentJoint], []).append(
            {
                "type": "sphere",
                "size": numbers(contact.radius),
                "pos": numbers(foot.placement.translation),
                "condim": "3",
                "friction": numbers([contact.mu, 0.0, 0.0]),
            }
        )
    mj = with_ground(mjcf(model, scene.q0, hold=gains), geoms, h, 0.0)
    mj.opt.tolerance = 1e-8  # MuJoCo's default
    data = mujoco.MjData(mj)
    data.qpos[:] = q[[0, 1, 2, 6, 3, 4, 5, *range(7, model.nq)]]
    mujoco.mj_step(mj, data, nstep=2000)

    def batch(count: int) -> float:
        begin = timing.clock()
        mujoco.mj_step(mj, data, nstep=count)
        return (timing.clock() - begin) / count

    return batch
