"""Assembly of a robot's file and a robot.yaml table into the arguments of a Scene.

Names of joints in the table are resolved here; the Scene resolves names of frames.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pin_nonideal.errors import SingularMassError
from pin_nonideal.loading.edit.tree import exchange_joints, fix_massless, has_joints, lock, place_base
from pin_nonideal.loading.urdf.damping_friction import dissipation
from pin_nonideal.loading.urdf.inertia import require_positive_mass
from pin_nonideal.loading.urdf.reader import RobotFile
from pin_nonideal.states.joint_order import remember_order
from pin_nonideal.types import Table

from .actuation import actuation_of
from .initial_state import Start, initial_state, joint_index, requested_state, vector
from .robot import (
    CONSTRAINTS,
    CONTACTS,
    FORCES,
    LAWS,
    descriptions,
    loops,
    names_in,
    optional_string,
    strings,
)


def scene_arguments(
    robot: RobotFile,
    table: Table,
    name: str,
    *,
    merge: bool = True,
    start: Start = None,
    speed: Start = None,
) -> Table:
    """Return the keyword arguments of Scene.

    Args:
        robot: content of the robot's file; consumed.
        table: content of robot.yaml, {} if there is none.
        name: name of the scene, also used in messages.
        merge: whether three revolute joints with massless links are merged into a ball joint.
        start: initial configuration that replaces the file's: (nq,), by joint name, or the name of a
            reference configuration.
        speed: initial velocity that replaces the file's: (nv,), or by joint name.

    Raises:
        LoadingError: a name in the table does not exist, or a value is invalid.
        InputError: the initial state is invalid.
        SingularMassError: M is not positive definite at the initial configuration.
    """
    where = f'robot.yaml of "{name}"'
    notes = [*robot.notes, *strings(table, "notes", where)]
    optional_string(table, "description", where)
    exchange_joints(robot, table, where, notes, merge)
    place_base(robot, table, where)
    if robot.model.nv == 0:  # a robot without joints and base is probably a floating robot
        notes.append(f"nothing moves: {robot.to_float}" if robot.to_float else "nothing moves")
    if "gravity" in table:
        robot.model.gravity = pin.Motion(
            np.array(vector(table["gravity"], 3, f"{where}: gravity")), np.zeros(3)
        )
    remember_order(robot.model, robot.joint_order)
    q0, v0 = initial_state(robot, table.get("initial"), where, notes)
    q0, v0 = lock(robot, table, q0, v0, where)
    q0, v0 = fix_massless(robot, names_in(table), q0, v0, notes)
    remember_order(robot.model, robot.joint_order)  # for the remaining model
    q0, v0 = requested_state(robot, q0, v0, start, speed)
    robot.constraints = [c for c in robot.constraints if has_joints(robot.model, c, where)]
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
        else actuation_of(robot.model, table["actuation"], motors, f"{where}: actuation"),
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
