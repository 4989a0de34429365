"""MJCF files (MuJoCo's XML): MuJoCo compiles them, and the compiled model becomes a scene.

The conversion is exact; unsupported features give a note or an error (`unsupported`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cache, partial
from pathlib import Path

import numpy as np

from pin_nonideal.loading.urdf.geometry_sources import Shapes
from pin_nonideal.loading.urdf.reader import Keyframe, RobotFile
from pin_nonideal.types import GeometryModel

from .actuators import Actuators, Control, can_produce_force, is_supported
from .compile import compile_mjcf, mujoco_module
from .equality import read_equality
from .forces import (
    GravityCompensation,
    floating_armature,
    fluid_forces,
    gravity_compensation,
    joint_resistance,
    joint_springs,
)
from .motion import Tendon
from .mujoco_types import MjModel, Mujoco
from .ranges import read_ranges
from .shapes import geom_names, read_shapes
from .tendons import read_tendons, tendon_forces
from .transmissions import read_transmission
from .tree import Tree, build_tree
from .unsupported import UnsupportedFeatures, report_unsupported


def read_mjcf(path: Path, *, allow: Collection[str] = (), ctrl: Control = None) -> RobotFile:
    """Read an MJCF file.

    Args:
        path: path of the file.
        allow: active features that may be ignored, from `unsupported.IGNORABLE_FEATURES`.
        ctrl: controls of the actuators, as in `Actuators.set_control`.

    Raises:
        LoadingError: MuJoCo rejects the file, or the file has an active unsupported feature.
        InputError, UnknownNameError: the controls do not fit the actuators.
    """
    mujoco = mujoco_module(path)
    compiled, absent, _, notes = compile_mjcf(path)
    unsupported = UnsupportedFeatures(f'"{path}"', allow, notes)
    robot, tree = translate(mujoco, compiled, path.stem, unsupported)
    unsupported.raise_if_active()
    later: list[str] = []
    again = cache(partial(_with_meshes, path, later))
    drawn, solid = (cache(partial(_shapes, mujoco, again, absent, visual=kind)) for kind in (True, False))
    robot.visual, robot.collision = Shapes(drawn, later), Shapes(solid, later)
    if robot.actuation is not None:
        robot.actuation.set_control(ctrl)
    for key, name in enumerate(tree.key_names):
        qpos, qvel = np.array(compiled.key_qpos[key]), np.array(compiled.key_qvel[key])
        apply = partial(_apply_key, robot.actuation, compiled, key, ctrl)
        robot.keyframes[name] = Keyframe(tree.q(qpos), tree.v(qpos, qvel), apply)
    return robot


def translate(
    mujoco: Mujoco, compiled: MjModel, name: str, unsupported: UnsupportedFeatures
) -> tuple[RobotFile, Tree]:
    """Return a compiled model as a robot.

    Args:
        mujoco: Python package.
        compiled: mujoco.MjModel.
        name: name of a model without a name.
        unsupported: receives the unsupported features.
    """
    flags, off = int(compiled.opt.disableflags), mujoco.mjtDisableBit
    springs, dampers = not flags & off.mjDSBL_SPRING, not flags & off.mjDSBL_DAMPER
    friction = not flags & (off.mjDSBL_FRICTIONLOSS | off.mjDSBL_CONSTRAINT)
    tree = build_tree(mujoco, compiled, name)
    tendons = read_tendons(tree)
    report_unsupported(mujoco, tree, tendons, unsupported)
    laws, forces = tendon_forces(tree, tendons, springs=springs, dampers=dampers, friction=friction)
    robot = RobotFile(tree.model, notes=unsupported.notes, q0=tree.q(compiled.qpos0))
    robot.laws = [*joint_resistance(tree, dampers=dampers, friction=friction), *laws]
    robot.forces = [*(joint_springs(tree) if springs else ()), *forces, *floating_armature(tree)]
    through_drives = None
    if springs or dampers:  # MuJoCo disables all passive forces if both flags are set
        compensation, through_drives = gravity_compensation(tree)
        robot.forces += compensation
        robot.laws += fluid_forces(tree)
    if not flags & (off.mjDSBL_EQUALITY | off.mjDSBL_CONSTRAINT):
        rows = [read_equality(tree, i, tendons) for i in np.flatnonzero(compiled.eq_active0).tolist()]
        robot.constraints = [row for row in rows if row is not None]
    elif compiled.neq:
        unsupported.add_note("the file's flags switch its equalities off")
    if compiled.nactuator and not flags & off.mjDSBL_ACTUATION:
        robot.actuation = _actuators(tree, tendons, through_drives, not flags & off.mjDSBL_CLAMPCTRL)
    robot.ranges = read_ranges(tree, tendons)
    robot.to_float = "give a body a <freejoint/>"
    robot.contact_friction = {
        name: (float(a), float(b), float(c))
        for name, (a, b, c) in zip(geom_names(compiled), compiled.geom_friction, strict=True)
    }
    return robot, tree


def _actuators(
    tree: Tree, tendons: list[Tendon | None], compensation: GravityCompensation | None, clamp: bool
) -> Actuators:
    m = tree.compiled
    working = [a for a in range(m.nactuator) if can_produce_force(m, a) and is_supported(m, a)]
    carried = [(a, read_transmission(tree, a, tendons)) for a in working]
    return Actuators(tree, [(a, t) for a, t in carried if t is not None], compensation, clamp)


def _apply_key(actuators: Actuators | None, compiled: MjModel, key: int, ctrl: Control) -> None:
    """Set the activations of a keyframe, and its controls if the user gave none."""
    if actuators is not None:
        actuators.set_control(compiled.key_ctrl[key] if ctrl is None else ctrl, compiled.key_act[key])


def _with_meshes(path: Path, notes: list[str]) -> tuple[Tree, frozenset[int]]:
    """Compile the file again with its meshes, which only the shapes need, and return the missing ones too."""
    compiled = compile_mjcf(path, meshes=True)
    notes += compiled.notes
    return build_tree(mujoco_module(path), compiled.model, path.stem), compiled.absent


def _shapes(
    mujoco: Mujoco, again: Callable[[], tuple[Tree, frozenset[int]]], absent: frozenset[int], *, visual: bool
) -> GeometryModel:
    tree, lost = again()
    return read_shapes(mujoco, tree, absent | lost, visual=visual)
