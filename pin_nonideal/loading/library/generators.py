"""Robots that are generated from parameters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from pin_nonideal.description.constraints import PointAnchor
from pin_nonideal.loading.urdf.reader import RobotFile
from pin_nonideal.types import GeometryModel, Model, Placement
from pin_nonideal.validation import count, nonnegative, number, positive

THICKNESS = 0.03  # radius of a drawn rod, relative to its length
MAX_WINDOWS = 10_000  # more joints would take Pinocchio minutes to add


def n_four_bar(
    *, N: int = 2, m: float = 1.0, L: float = 1.0, g: float = 9.81, speed: float = 1.0
) -> RobotFile:
    """N four-bar windows side by side: N + 1 cranks on the ground and N couplers between their tips.

    All rods are uniform, with inertia m L^2 / 12 about the center. The cranks start upright and their tips
    move along +x. Each crank is a separate branch of the spanning tree and carries the coupler to its right,
    whose far end is anchored to the tip of the next crank. The motion is in the x-z plane, with gravity along
    -z.

    Joint "crank<i>" rotates about y: its angle is measured from the upward vertical towards +x. Frames:
    "crank<i>_tip", "coupler<i>_tip".

    Args:
        N: number of windows, from 1 to 10,000.
        m: mass of each rod [kg].
        L: length of each rod [m].
        g: gravity [m/s^2].
        speed: initial speed of the crank tips [m/s].

    Raises:
        InputError: a parameter is out of range.

    Source:
        IFToMM benchmark A02; Bayo and Avello, Nonlinear Dynamics 5 (1994) 209-231.
    """
    N = count("n_four_bar: N", N, min_value=1, max_value=MAX_WINDOWS)
    m, L = positive("n_four_bar: m", m), positive("n_four_bar: L", L)
    g, speed = nonnegative("n_four_bar: g", g), number("n_four_bar: speed", speed)
    model, visual = pin.Model(), pin.GeometryModel()
    model.name = "n_four_bar"
    model.gravity = pin.Motion(np.array([0.0, 0.0, -g]), np.zeros(3))
    constraints = []
    for i in range(N + 1):  # branch by branch, because Pinocchio's algorithms need this joint order
        crank = _rod(model, visual, 0, f"crank{i}", np.array([i * L, 0.0, 0.0]), "z", m, L)
        if i < N:
            _rod(model, visual, crank, f"coupler{i}", np.array([0.0, 0.0, L]), "x", m, L)
            constraints.append(
                PointAnchor(f"coupler{i}_tip", f"crank{i + 1}_tip", axes="xz", name=f"window{i}")
            )
    v0 = np.tile([speed / L, -speed / L], N + 1)[: model.nv]
    return RobotFile(model, visual, constraints=list(constraints), q0=np.zeros(model.nq), v0=v0)


def _rod(
    model: Model,
    visual: GeometryModel,
    parent: int,
    name: str,
    place: Placement,
    direction: str,
    m: float,
    L: float,
) -> int:
    """Add a uniform rod along its own x or z axis, hinged about y at `place`, and return its joint."""
    import coal

    e = np.array([1.0, 0.0, 0.0]) if direction == "x" else np.array([0.0, 0.0, 1.0])
    joint = int(model.addJoint(parent, pin.JointModelRY(), pin.SE3(np.eye(3), place), name))
    model.addJointFrame(joint)
    inertia = m * L**2 / 12.0 * (np.eye(3) - np.outer(e, e))
    model.appendBodyToJoint(joint, pin.Inertia(m, 0.5 * L * e, inertia), pin.SE3.Identity())
    frame = model.addBodyFrame(f"{name}_rod", joint, pin.SE3.Identity(), -1)
    tip = pin.Frame(f"{name}_tip", joint, frame, pin.SE3(np.eye(3), L * e), pin.FrameType.OP_FRAME)
    model.addFrame(tip, False)
    upright = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), e).matrix(), 0.5 * L * e)
    shape = pin.GeometryObject(f"{name}_rod_0", joint, frame, upright, coal.Capsule(THICKNESS * L, L))
    blue, orange = np.array([0.20, 0.45, 0.70, 1.0]), np.array([0.85, 0.50, 0.20, 1.0])
    shape.meshColor = orange if direction == "x" else blue
    visual.addGeometryObject(shape)
    return joint


GENERATORS: dict[str, Callable[..., RobotFile]] = {"n_four_bar": n_four_bar}
