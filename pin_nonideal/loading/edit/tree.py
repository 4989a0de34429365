"""Edits of the tree by a robot.yaml table: other joint types, another base, locked or fixed joints."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.description.constraints import Constraint, JointCoupling
from pin_nonideal.errors import LoadingError, short_repr
from pin_nonideal.loading.urdf.geometry_sources import Shapes
from pin_nonideal.loading.urdf.reader import RobotFile
from pin_nonideal.loading.urdf.xml import quote_names
from pin_nonideal.loading.yaml.initial_state import joint_index, vector
from pin_nonideal.loading.yaml.robot import check_keys, joint_types, names_in, pitches
from pin_nonideal.types import GeometryModel, Model, Table

from .model import ball_chains, edit_joints, reduced_model

# Maximum coordinate of a base [m or rad]; beyond it, floating-point rounding exceeds a tenth of a micrometer.
MAX_COORDINATE = 1e9


def exchange_joints(robot: RobotFile, table: Table, where: str, notes: list[str], merge: bool) -> None:
    """Change joint types as the table states, and merge revolute joints that form a ball joint.

    Args:
        robot: content of the robot's file; modified.
        table: content of robot.yaml.
        where: prefix of error messages that names the table.
        notes: receives a note on merged joints.
        merge: whether three revolute joints with massless links are merged into a ball joint.

    Raises:
        LoadingError: a joint of the table does not exist, or its type cannot be changed.
    """
    types, screws = joint_types(table, where), pitches(table, where)
    coupled = {n for c in robot.constraints for n in vars(c).values() if isinstance(n, str)}
    keep = names_in(table) | set(robot.motors) | coupled
    chains = ball_chains(robot.model, keep) if merge else []
    if not chains and not types and not screws:
        return
    if chains:
        balls = ", ".join(f'"{chain.name}"' for chain in chains)
        notes.append(f"three revolute joints in a row with massless links become one ball joint: {balls}")
    model = robot.model
    _exchange(robot, lambda geometries: edit_joints(model, geometries, chains, types, screws))
    robot.q0 = robot.v0 = None


def _exchange(
    robot: RobotFile, edit: Callable[[list[GeometryModel]], tuple[Model, Iterable[GeometryModel]]]
) -> None:
    """Replace the model and the geometries of a robot by edited ones."""
    robot.model, _ = edit([])
    _edit_shapes(robot, lambda geometry: next(iter(edit([geometry])[1])))


def _edit_shapes(robot: RobotFile, edit: Callable[[GeometryModel], GeometryModel]) -> None:
    """Edit the shapes of a robot; shapes that are not read yet are edited on reading."""
    for key in ("visual", "collision"):
        shapes = getattr(robot, key)
        if shapes is not None:
            setattr(robot, key, shapes.edited(edit) if isinstance(shapes, Shapes) else edit(shapes))


def place_base(robot: RobotFile, table: Table, where: str) -> None:
    """Place the base of a robot as `model: {base: {xyz: ..., rpy: ...}}` states, for example on a wall.

    Args:
        robot: content of the robot's file; modified.
        table: content of robot.yaml.
        where: prefix of error messages that names the table.

    Raises:
        LoadingError: the entry is not a placement.
    """
    entry = (table.get("model") or {}).get("base")
    if entry is None:
        return
    where = f"{where}: model: base"
    if not isinstance(entry, dict):
        raise LoadingError(f"{where} must be a table with the keys xyz, rpy; got {short_repr(entry)}")
    check_keys(entry, ("xyz", "rpy"), where)
    xyz, rpy = (np.array(vector(entry.get(k, [0, 0, 0]), 3, f"{where}: {k}")) for k in ("xyz", "rpy"))
    if np.abs([*xyz, *rpy]).max() > MAX_COORDINATE:
        raise LoadingError(
            f"{where}: xyz and rpy must be at most {MAX_COORDINATE:g} (m, rad); got {short_repr(entry)}"
        )
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


def lock(
    robot: RobotFile, table: Table, q0: NDArray[np.float64], v0: NDArray[np.float64], where: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fix the joints of `model: {locked: ...}` at their positions in the initial configuration.

    Args:
        robot: content of the robot's file; modified.
        table: content of robot.yaml.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        where: prefix of error messages that names the table.

    Returns:
        Configuration and velocity of the remaining joints.

    Raises:
        LoadingError: a joint does not exist, or the entry is not a list.
    """
    entry = table.get("model") or {}
    locked = entry.get("locked") or []
    if not isinstance(locked, list):
        raise LoadingError(f"{where}: model: locked must be a list of joint names; got {short_repr(locked)}")
    if not locked:
        return q0, v0
    indices = [joint_index(robot.model, n, f"{where}: model: locked") for n in locked]
    return _fix_joints(robot, indices, q0, v0)


def fix_massless(
    robot: RobotFile, named: set[str], q0: NDArray[np.float64], v0: NDArray[np.float64], notes: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fix the joints that move no inertia, unless a loop or another joint depends on them.

    Args:
        robot: content of the robot's file; modified.
        named: names in robot.yaml.
        q0: initial configuration, (nq,).
        v0: initial velocity, (nv,).
        notes: receives a note on fixed joints.

    Returns:
        Configuration and velocity of the remaining joints.
    """
    model = robot.model
    massless_joints = [j for j in range(1, model.njoints) if _moves_no_inertia(model, j)]
    massless_joints = [j for j in massless_joints if not names_on(model, j) & named]
    leaders = {c.joint2 for c in robot.constraints if isinstance(c, JointCoupling)}
    names = {model.names[j] for j in massless_joints}
    followers = {c.joint1: c.joint2 for c in robot.constraints if isinstance(c, JointCoupling)}
    lead = {n for n in names & leaders if any(f not in names for f, to in followers.items() if to == n)}
    massless_joints = [j for j in massless_joints if model.names[j] not in lead]
    if not massless_joints or len(massless_joints) == model.njoints - 1:
        return q0, v0
    names = {str(model.names[j]) for j in massless_joints}
    notes.append(f"joints that move no inertia are fixed: {quote_names(sorted(names))}")
    robot.constraints = [c for c in robot.constraints if not names & set(map(str, vars(c).values()))]
    return _fix_joints(robot, massless_joints, q0, v0)


def _moves_no_inertia(model: Model, joint: int) -> bool:
    """Check if no link beyond a joint has mass or inertia, and no joint there has armature."""
    beyond = list(model.subtrees[joint])
    dofs = [i for j in beyond for i in range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])]
    is_massless = all(model.inertias[j].mass == 0.0 and not model.inertias[j].inertia.any() for j in beyond)
    return is_massless and not model.armature[dofs].any()


def names_on(model: Model, joint: int) -> set[str]:
    """Return the names of a joint and of all frames beyond it.

    Args:
        model: pinocchio.Model.
        joint: index of the joint.
    """
    beyond = set(model.subtrees[joint])
    return {str(f.name) for f in model.frames if f.parentJoint in beyond} | {str(model.names[joint])}


def _fix_joints(
    robot: RobotFile, indices: list[int], q0: NDArray[np.float64], v0: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fix joints at q0, and return the configuration and velocity of the others."""
    model = robot.model
    moving = [j for j in range(1, model.njoints) if j not in indices]
    empty = [np.zeros(0)]
    q = np.concatenate([q0[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]] for j in moving] or empty)
    v = np.concatenate([v0[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] for j in moving] or empty)
    _exchange(robot, lambda geometries: reduced_model(model, geometries, indices, q0))
    return q, v


def has_joints(model: Model, constraint: Constraint, where: str) -> bool:
    """Check if the joints of a constraint still exist; without these joints it is satisfied.

    Args:
        model: pinocchio.Model.
        constraint: constraint of the robot's file.
        where: prefix of error messages that names the table.

    Raises:
        LoadingError: one of two coupled joints is locked and the other is not.
    """
    keys = ("joint", "joint1", "joint2")
    names = [getattr(constraint, key) for key in keys if hasattr(constraint, key)]
    locked = [n for n in names if not model.existJointName(n)]
    if locked and len(locked) < len(names):
        left = next(n for n in names if n not in locked)
        raise LoadingError(
            f'{where}: joint "{left}" follows the locked joint "{locked[0]}"; lock both or neither'
        )
    return not locked
