"""From a robot's file and a robot.yaml table to the arguments of a Scene.

Every joint that the table names is looked up here; the Scene looks up the frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.actuation import HoldPosition
from pin_nonideal.checks import nonnegative, number
from pin_nonideal.constraints import JointCoupling, PrescribedMotion
from pin_nonideal.errors import InputError, LoadingError, SingularMassError, nearest
from pin_nonideal.laws import JointFriction
from pin_nonideal.states.orders import remember_order
from pin_nonideal.types import GeometryModel, Model, Table

from .inertia import require_positive_mass
from .model_edit import ball_chains, edit_joints
from .robot_yaml import (
    ACTUATION,
    CONSTRAINTS,
    CONTACTS,
    FORCES,
    LAWS,
    build,
    check_keys,
    descriptions,
    joint_types,
    loops,
    names_in,
    one_entry,
    optional_string,
    pitches,
    strings,
)
from .shapes import Shapes
from .starts import Start, asked_start, initial_state, joint_index, vector
from .urdf import RobotFile
from .xml import listed

# Beyond this a base loses a tenth of a micrometer to floating-point numbers [m or rad].
FARTHEST = 1e9


def scene_arguments(
    robot: RobotFile,
    table: Table,
    name: str,
    *,
    merge: bool = True,
    start: Start = None,
    speed: Start = None,
) -> Table:
    """Keyword arguments of Scene.

    Args:
        robot: what the robot's file holds; consumed.
        table: content of robot.yaml, {} when there is none.
        name: name of the scene, also used in messages.
        merge: merge three revolutes with massless links between into ball joints.
        start: initial configuration in place of the file's: (nq,), by joint name, or the name of a reference
            configuration.
        speed: initial velocity in place of the file's: (nv,), or by joint name.

    Raises:
        LoadingError: a name in the table does not exist, or a value is refused.
        InputError: the start is refused.
        SingularMassError: M is not positive definite at the initial configuration.
    """
    where = f'robot.yaml of "{name}"'
    notes = [*robot.notes, *strings(table, "notes", where)]
    optional_string(table, "description", where)
    _change_joints(robot, table, where, notes, merge)
    _place_base(robot, table, where)
    if robot.model.nv == 0:  # what stands on nothing and has no joint was meant to float
        notes.append(f"nothing moves: {robot.to_float}" if robot.to_float else "nothing moves")
    if "gravity" in table:
        robot.model.gravity = pin.Motion(
            np.array(vector(table["gravity"], 3, f"{where}: gravity")), np.zeros(3)
        )
    remember_order(robot.model, robot.joint_order)
    q0, v0 = initial_state(robot, table.get("initial"), where, notes)
    q0, v0 = _lock(robot, table, q0, v0, where)
    q0, v0 = _fix_idle(robot, names_in(table), q0, v0, notes)
    remember_order(robot.model, robot.joint_order)  # of the model that is left
    q0, v0 = asked_start(robot, q0, v0, start, speed)
    robot.constraints = [c for c in robot.constraints if _still_moves(robot.model, c, where)]
    motors = strings(table, "name_mot", where) or [m for m in robot.motors if robot.model.existJointName(m)]
    for motor in motors:
        joint_index(robot.model, motor, f"{where}: name_mot")
    if motors:
        notes.append("actuated joints: " + ", ".join(motors))
    laws = descriptions(table.get("laws"), LAWS, f"{where}: laws")
    try:
        require_positive_mass(robot.model, q0, name)
    except SingularMassError as error:
        raise SingularMassError(f"{error}; {robot.advice}" if robot.advice else str(error)) from None
    return {
        "model": robot.model,
        "constraints": [
            *robot.constraints,
            *loops(table, where),
            *descriptions(table.get("constraints"), CONSTRAINTS, f"{where}: constraints"),
        ],
        "laws": [*laws, *robot.laws, *dissipation(robot.model, laws, robot.constraints, notes)],
        "contacts": descriptions(table.get("contacts"), CONTACTS, f"{where}: contacts"),
        "forces": [*robot.forces, *descriptions(table.get("forces"), FORCES, f"{where}: forces")],
        "actuation": robot.actuation
        if table.get("actuation") is None
        else _actuation(robot.model, table["actuation"], motors, f"{where}: actuation"),
        "q0": q0,
        "v0": v0,
        "visual_model": robot.visual,
        "collision_model": robot.collision,
        "name": name,
        "notes": tuple(notes),
        "source": optional_string(table, "source", where),
        "licence": optional_string(table, "licence", where),
        **({"impact": table["impact"]} if "impact" in table else {}),
    }


def dissipation(
    model: Model, taken: Sequence[Any], couplings: Sequence[Any], notes: list[str]
) -> list[JointFriction]:
    """Joint friction that the robot's file states, as laws.

    URDF has it in `<dynamics>`, MJCF in `damping` and `frictionloss`.  Pinocchio keeps these numbers in
    `model.damping` and `model.upperDryFrictionLimit` and its forward dynamics ignores them.  A mimic joint
    q = r q_leader + c hands its friction to its leader: dry friction times |r|, damping times r^2.

    Args:
        model: pinocchio.Model.
        taken: laws already given; a JointFriction among them replaces the file's numbers for its joint.
        couplings: constraints of the file; its mimic joints are `JointCoupling` or, when held,
            `PrescribedMotion`.
        notes: receives a note for each replacement, and for each joint that has several velocities.
    """
    given = {law.joint for law in taken if isinstance(law, JointFriction)}
    leaders = {c.joint1: (c.joint2, c.ratio) for c in couplings if isinstance(c, JointCoupling)}
    held = {c.joint for c in couplings if isinstance(c, PrescribedMotion)}
    dry: dict[str, float] = {}
    viscous: dict[str, float] = {}
    radius: dict[str, float] = {}
    replaced: dict[str, None] = {}
    for j in range(1, model.njoints):
        dofs = slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
        name, damping, friction = model.names[j], model.damping[dofs], model.upperDryFrictionLimit[dofs]
        if not (damping.any() or friction.any()):
            continue
        if model.nvs[j] != 1 and not _slides_and_turns(model, j, damping, friction, notes):
            continue
        ratio = 1.0
        for _ in leaders:
            if name in leaders:
                ratio *= leaders[name][1]
                name = leaders[name][0]
        if model.nvs[j] != 1:
            radius[name] = 1.0  # so that numbers are the same in both units
        if name in given:
            replaced[name] = None
        elif name not in held:
            dry[name] = dry.get(name, 0.0) + abs(ratio) * float(friction[0])
            viscous[name] = viscous.get(name, 0.0) + ratio**2 * float(damping[0])
    if replaced:
        notes.append(
            "laws given replace the damping and friction of the robot's file in " + ", ".join(replaced)
        )
    return [
        JointFriction(n, coulomb=dry[n], viscous=viscous[n], radius=radius.get(n, 0.0), name=f"{n} dynamics")
        for n in dry
    ]


def _slides_and_turns(
    model: Model, j: int, damping: NDArray[np.float64], friction: NDArray[np.float64], notes: list[str]
) -> bool:
    """Whether the file states one number for all velocities of a joint; notes what is made of it."""
    name, kind = model.names[j], model.joints[j].shortname()
    alike = np.ptp(damping) == 0.0 and np.ptp(friction) == 0.0
    if not alike or kind not in ("JointModelPlanar", "JointModelFreeFlyer"):
        notes.append(
            f'joint "{name}" has {model.nvs[j]} axes: damping and friction of the robot\'s file are left out'
        )
        return False
    notes.append(
        f'joint "{name}" slides and turns: damping {damping[0]:g} of the robot\'s file is taken in N s/m and '
        f"N m s/rad, friction {friction[0]:g} in N and N m"
    )
    return True


def _change_joints(robot: RobotFile, table: Table, where: str, notes: list[str], merge: bool) -> None:
    """Exchanges joint types as the table asks, and merges revolutes that make a ball joint."""
    types, screws = joint_types(table, where), pitches(table, where)
    coupled = {n for c in robot.constraints for n in vars(c).values() if isinstance(n, str)}
    keep = names_in(table) | set(robot.motors) | coupled
    chains = ball_chains(robot.model, keep) if merge else []
    if not chains and not types and not screws:
        return
    if chains:
        balls = ", ".join(f'"{chain.name}"' for chain in chains)
        notes.append(
            f"three revolute joints with massless links between are merged into a ball joint each: {balls}"
        )
    model = robot.model
    _exchange(robot, lambda geometries: edit_joints(model, geometries, chains, types, screws))
    robot.q0 = robot.v0 = None


def _exchange(robot: RobotFile, edit: Callable[[list[Any]], tuple[Any, Iterable[Any]]]) -> None:
    """Puts an edited model and its geometries in the place of the robot's own."""
    robot.model, _ = edit([])
    _edit_shapes(robot, lambda geometry: next(iter(edit([geometry])[1])))


def _edit_shapes(robot: RobotFile, edit: Callable[[GeometryModel], GeometryModel]) -> None:
    """Edits the robot's shapes, those that are not read yet when they are."""
    for key in ("visual", "collision"):
        shapes = getattr(robot, key)
        if shapes is not None:
            setattr(robot, key, shapes.edited(edit) if isinstance(shapes, Shapes) else edit(shapes))


def _place_base(robot: RobotFile, table: Table, where: str) -> None:
    """Mounts the robot where `model: {base: {xyz: ..., rpy: ...}}` says: on a wall, or from the ceiling."""
    entry = (table.get("model") or {}).get("base")
    if entry is None:
        return
    where = f"{where}: model: base"
    if not isinstance(entry, dict):
        raise LoadingError(f"{where} must be a table with the keys xyz, rpy; got {entry!r}")
    check_keys(entry, ("xyz", "rpy"), where)
    xyz, rpy = (np.array(vector(entry.get(k, [0, 0, 0]), 3, f"{where}: {k}")) for k in ("xyz", "rpy"))
    if np.abs([*xyz, *rpy]).max() > FARTHEST:
        raise LoadingError(f"{where}: xyz and rpy must be at most {FARTHEST:g} (m, rad); got {entry!r}")
    base, model = pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz), robot.model
    for j in range(1, model.njoints):
        if model.parents[j] == 0:
            model.jointPlacements[j] = base * model.jointPlacements[j]
    for frame in list(model.frames)[1:]:
        if frame.parentJoint == 0:
            frame.placement = base * frame.placement

    def mounted(geometry: GeometryModel) -> GeometryModel:
        for shape in geometry.geometryObjects:
            if shape.parentJoint == 0:
                shape.placement = base * shape.placement
        return geometry

    _edit_shapes(robot, mounted)


def _lock(
    robot: RobotFile, table: Table, q0: NDArray[np.float64], v0: NDArray[np.float64], where: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fixes the joints that `model: {locked: ...}` names where the initial configuration has them."""
    entry = table.get("model") or {}
    locked = entry.get("locked") or []
    if not isinstance(locked, list):
        raise LoadingError(f"{where}: model: locked must be a list of joint names; got {locked!r}")
    if not locked:
        return q0, v0
    indices = [joint_index(robot.model, n, f"{where}: model: locked") for n in locked]
    return _reduced(robot, indices, q0, v0)


def _fix_idle(
    robot: RobotFile, named: set[str], q0: NDArray[np.float64], v0: NDArray[np.float64], notes: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fixes the joints that move no inertia at all, where neither a loop nor another joint hangs on them."""
    model = robot.model
    idle = [j for j in range(1, model.njoints) if _moves_nothing(model, j)]
    idle = [j for j in idle if not names_on(model, j) & named]
    leaders = {c.joint2 for c in robot.constraints if isinstance(c, JointCoupling)}
    names = {model.names[j] for j in idle}
    followers = {c.joint1: c.joint2 for c in robot.constraints if isinstance(c, JointCoupling)}
    lead = {n for n in names & leaders if any(f not in names for f, to in followers.items() if to == n)}
    idle = [j for j in idle if model.names[j] not in lead]
    if not idle or len(idle) == model.njoints - 1:
        return q0, v0
    names = {str(model.names[j]) for j in idle}
    notes.append(f"joints that move no inertia are fixed: {listed(sorted(names))}")
    robot.constraints = [c for c in robot.constraints if not names & set(map(str, vars(c).values()))]
    return _reduced(robot, idle, q0, v0)


def _moves_nothing(model: Model, joint: int) -> bool:
    """Whether no link beyond a joint has mass or inertia, and no joint there a rotor's."""
    beyond = list(model.subtrees[joint])
    dofs = [i for j in beyond for i in range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])]
    bare = all(model.inertias[j].mass == 0.0 and not model.inertias[j].inertia.any() for j in beyond)
    return bare and not model.armature[dofs].any()


def names_on(model: Model, joint: int) -> set[str]:
    """Names of a joint and of all frames beyond it.

    Args:
        model: pinocchio.Model.
        joint: index.
    """
    beyond = set(model.subtrees[joint])
    return {str(f.name) for f in model.frames if f.parentJoint in beyond} | {str(model.names[joint])}


def _reduced(
    robot: RobotFile, indices: list[int], q0: NDArray[np.float64], v0: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fixes joints where they are at q0; returns the configuration and velocity of the others."""
    model = robot.model
    kept = [j for j in range(1, model.njoints) if j not in indices]
    none = [np.zeros(0)]
    q = np.concatenate([q0[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]] for j in kept] or none)
    v = np.concatenate([v0[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] for j in kept] or none)
    _exchange(robot, lambda geometries: pin.buildReducedModel(model, geometries, indices, q0))
    return q, v


def _still_moves(model: Model, constraint: Any, where: str) -> bool:
    """Whether a constraint of the robot's file still has its joints; without them it is met already.

    Raises:
        LoadingError: one of two coupled joints is locked and the other is not.
    """
    keys = ("joint", "joint1", "joint2")
    names = [getattr(constraint, key) for key in keys if hasattr(constraint, key)]
    gone = [n for n in names if not model.existJointName(n)]
    if gone and len(gone) < len(names):
        left = next(n for n in names if n not in gone)
        raise LoadingError(
            f'{where}: joint "{left}" follows the locked joint "{gone[0]}"; lock both or neither'
        )
    return not gone


def _actuation(model: Model, entry: Any, motors: Sequence[str], where: str) -> Any:
    """Torques from the table: `torques` by joint name, HoldPosition or Table."""
    if entry is None:
        return None
    kind, values = one_entry(entry, where)
    if kind == "torques":
        if not isinstance(values, dict):
            raise LoadingError(f"{where}: torques must be a table by joint name; got {values!r}")
        return _by_joint(model, values, f"{where}: torques", signed=True)
    if kind in ("SampledControl", "function"):
        raise LoadingError(
            f"{where}: {kind} holds a Python function, which a file cannot; pass it to Scene in Python"
        )
    if kind not in ACTUATION:
        raise LoadingError(f'{where}: unknown kind "{kind}"{nearest(kind, ("torques", *ACTUATION))}')
    if ACTUATION[kind] is HoldPosition and isinstance(values, dict):
        values = {
            k: _gain(model, v, motors, f"{where}: {k}") if k in ("kp", "kd") else v for k, v in values.items()
        }
    return build(ACTUATION[kind], values, where)


def _gain(model: Model, gain: Any, motors: Sequence[str], where: str) -> Any:
    """A gain by joint name, or one number for the motors (for all joints when no motor is named)."""
    if isinstance(gain, dict):
        return _by_joint(model, gain, where, signed=False)
    if motors and not isinstance(gain, list):
        return _by_joint(model, dict.fromkeys(motors, gain), where, signed=False)
    return gain


def _by_joint(model: Model, table: Mapping[Any, Any], where: str, *, signed: bool) -> NDArray[np.float64]:
    """An array of shape (nv,) from values by joint name."""
    result = np.zeros(model.nv)
    for name, value in table.items():
        j = joint_index(model, name, where)
        what = f'{where} of "{name}"'
        try:
            result[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = (
                number(what, value) if signed else nonnegative(what, value)
            )
        except InputError as error:
            raise LoadingError(str(error)) from None
    return result
