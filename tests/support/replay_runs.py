"""Runs with known values for the replay and the figures, without simulation."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.compilation.constraints import lower_constraint
from pin_nonideal.compilation.contact_groups import Descriptions
from pin_nonideal.compilation.contacts import lower_contacts
from pin_nonideal.compilation.resolver import Resolver
from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import PointAnchor
from pin_nonideal.description.contacts.point_names import NO_POINTS
from pin_nonideal.states.joint_layout import joint_places
from pin_nonideal.trajectory.by_name import joint_record, law_record
from pin_nonideal.trajectory.columns import columns
from pin_nonideal.trajectory.records import Stats

STEP = 1e-6  # step of central differences for rates, with an error near 1e-9


class KnownRun(SimpleNamespace):
    """A run without simulation, with the records by name that a Trajectory has."""

    def joint(self, name: str) -> Any:
        return joint_record(self, name)

    def law(self, name: str) -> Any:
        return law_record(self, name)

    def recorded(self, field: str) -> bool:
        return getattr(self, field, None) is not None

    def columns(self) -> Any:
        return columns(self)


def run_of(model: pin.Model, t: Any, q: Callable[[float], Any], **fields: Any) -> Any:
    """Return a run that follows q(t), with the default fields of `simulate`, updated by `fields`."""
    t = np.asarray(t, dtype=float)
    configurations = np.array([q(x) for x in t])
    rates = [pin.difference(model, q(x - STEP), q(x + STEP)) / (2 * STEP) for x in t]
    held = [*fields.get("constraints", []), *fields.get("contacts", [])]
    names = [getattr(item, "name", None) or type(item).__name__ for item in held]
    contact_names = names[len(fields.get("constraints", [])) :]
    scene = SimpleNamespace(
        model=model,
        visual_model=fields.pop("visual_model", None),
        collision_model=None,
        name=fields.pop("name", model.name),
        constraints=fields.pop("constraints", []),
        laws=[],
        contacts=fields.pop("contacts", []),
        contact_names=contact_names,
        forces=fields.pop("given_forces", []),
        q0=configurations[0],
        v0=np.asarray(rates[0]),
        constraint_slices=fields.pop("constraint_slices", dict.fromkeys(names, slice(0, 0))),
    )
    scene._compiled = SimpleNamespace(
        model=model,
        q0=scene.q0,
        program=_program(scene, names),
        described=described(names, held),
        slices=scene.constraint_slices,
        rows=scene.constraint_slices,
        multipliers=SimpleNamespace(slices=scene.constraint_slices),
        spec=scene,
        points={},
        contact_of=NO_POINTS,
        contact=str,
    )
    values: dict[str, Any] = {
        "t": t,
        "q": configurations,
        "v": np.array(rates),
        "violation": np.zeros(len(t)),
        "violation_rate": np.zeros(len(t)),
        "modes": None,
        "element_names": [],
        "element_laws": [],
        "law_names": [],
        "name": scene.name,
        "events": [],
        "stats": Stats(steps=10, wall_s=0.001),
        "scene": scene,
    }
    values |= dict.fromkeys(("tau", "limits", "law_forces", "reactions"))
    values |= dict.fromkeys(("a", "F_ideal", "F_nonideal", "lam", "lam_ideal", "energy", "power", "z"))
    values["contact_forces"] = None
    values["joints"] = joint_places(model)
    values["rows"] = {name: (s.start, s.stop, False) for name, s in scene.constraint_slices.items()}
    return KnownRun(**values | fields)


def described(names: list[str], held: list[Any]) -> Descriptions:
    """Return descriptions by name, without pairs of shapes."""
    return Descriptions(dict(zip(names, held, strict=True)), (), NO_POINTS, names)


def _program(scene: Any, names: list[str]) -> Any:
    """Return the core's data of the constraints and contacts of a scene without analysis."""
    builder, where = core.Builder(scene.model), Resolver(scene.model, scene.q0)
    for name, c in zip(names, scene.constraints, strict=False):
        lower_constraint(c, name, builder, where)
    contacts = list(zip(names[len(scene.constraints) :], scene.contacts, strict=True))
    list(lower_contacts(contacts, NO_POINTS, builder, where))
    return builder.finish()


def jointed(*joints: Any, name: str = "chain", lever: float = 0.2) -> pin.Model:
    """Return a chain of joints along x, 0.4 m apart, with bodies of 1 kg."""
    model = pin.Model()
    model.name = name
    parent, place = 0, pin.SE3.Identity()
    for number, joint in enumerate(joints):
        parent = model.addJoint(parent, joint, place, f"j{number}")
        inertia = pin.Inertia(1.0, np.array([lever, 0.0, 0.0]), 0.01 * np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0]))
    return model


def add_frame(model: pin.Model, name: str, joint: int, place: Any, turn: Any = None) -> None:
    """Add a frame fixed to a joint."""
    placement = pin.SE3(np.eye(3) if turn is None else turn, np.asarray(place, dtype=float))
    model.addFrame(pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME))


def panda(count: int = 31, duration: float = 0.5) -> Any:
    """Return a run of the Panda arm with meshes on a smooth path, with friction torques and a mode change."""
    import example_robot_data

    robot = example_robot_data.load("panda")
    model, visual_model = pin.buildReducedModel(robot.model, robot.visual_model, [8, 9], robot.q0)
    start, sweep = np.array([0.0, -0.5, 0.0, -1.5, 0.0, 1.2, 0.0]), np.linspace(0.3, 1.0, 7)
    t = np.linspace(0.0, duration, count)
    kinetic = 0.5 * np.sin(3.0 * t) ** 2
    return run_of(
        model,
        t,
        lambda x: start + sweep * np.sin(3.0 * x),
        name="panda",
        visual_model=visual_model,
        F_nonideal=-np.outer(np.cos(3.0 * t), sweep),
        energy={"kinetic": kinetic, "potential": 2.0 - kinetic, "total": np.full(count, 2.0), "friction": -t},
        modes=np.array([[0 if x < 0.2 else 1] for x in t], dtype=np.int8),
        element_names=["panda_joint2"],
        events=[SimpleNamespace(time=0.2, kind="slip", element="panda_joint2")],
    )


CRANK, COUPLER, ROCKER, GROUND = 0.3, 0.8, 0.6, 0.9


def four_bar(count: int = 61, duration: float = 1.0) -> Any:
    """Return a run of a planar four-bar without geometry in closed form, with a known reaction."""
    model = pin.Model()
    model.name = "four_bar"
    for name, parent, x in (("crank", 0, 0.0), ("coupler", 1, CRANK), ("rocker", 0, GROUND)):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        joint = model.addJoint(parent, pin.JointModelRY(), place, name)
        body = pin.Inertia(1.0, np.array([0.2, 0.0, 0.0]), 0.01 * np.eye(3))
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    add_frame(model, "coupler_tip", 2, [COUPLER, 0.0, 0.0])
    add_frame(model, "rocker_tip", 3, [ROCKER, 0.0, 0.0])

    def closed(t: float) -> Any:
        angle = 0.6 + 0.9 * np.sin(3.0 * t)
        pin_at = CRANK * np.exp(1j * angle)
        reach = GROUND - pin_at  # from the crank's pin to the rocker's pivot
        length = abs(reach)
        turn = np.arccos((COUPLER**2 + length**2 - ROCKER**2) / (2.0 * COUPLER * length))
        tip = pin_at + COUPLER * reach / length * np.exp(1j * turn)
        # Positive angles about y rotate x towards -z.
        return np.array([-angle, -np.angle((tip - pin_at) / np.exp(1j * angle)), -np.angle(tip - GROUND)])

    t = np.linspace(0.0, duration, count)
    lam = np.column_stack([10.0 + t, np.zeros(count), 3.0 * np.sin(t)])
    return run_of(
        model,
        t,
        closed,
        constraints=[PointAnchor("coupler_tip", "rocker_tip", name="loop")],
        constraint_slices={"loop": slice(0, 3)},
        lam=lam,
        lam_ideal=0.75 * lam,
        F_ideal=np.zeros((count, 3)),
        F_nonideal=np.column_stack([0.1 + t, np.zeros(count), -0.2 * t]),
        violation=np.full(count, 3e-15),
    )
