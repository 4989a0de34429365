"""Robots of example-robot-data, by name."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.description.constraints import Constraint
from pin_nonideal.errors import LoadingError, UnknownNameError, nearest
from pin_nonideal.loading.library.example_scripts import example_files
from pin_nonideal.loading.urdf.geometry_sources import Shapes, cached_models, cached_shapes, file_stamps
from pin_nonideal.loading.urdf.reader import RobotFile, read_mimics
from pin_nonideal.types import Model

# Files of the robots that example-robot-data has as SDF only, for messages.
MJCF_INSTEAD = {"cassie": ': pn.load("agility_cassie/cassie.xml"), a file of MuJoCo Menagerie'}


def example_names() -> Sequence[str]:
    """Return the names of example-robot-data, or an empty tuple if it is not installed."""
    try:
        from example_robot_data import robots_loader
    except ImportError:
        return ()
    return tuple(robots_loader.ROBOTS)


def example_robots() -> list[tuple[str, str]]:
    """Return the robots of example-robot-data that `load` reads, as (name, its file), in alphabetical order.

    Raises:
        LoadingError: example-robot-data is not installed.
    """
    try:
        from example_robot_data import robots_loader
    except ImportError as error:
        raise LoadingError(
            f"example-robot-data cannot be imported ({error}); pip install example-robot-data-loaders"
        ) from None
    kinds = sorted(robots_loader.ROBOTS.items())
    return [(name, kind.urdf_filename) for name, kind in kinds if not _is_sdf(kind)]


def _is_sdf(kind: type) -> bool:
    """Check if a robot of example-robot-data is an SDF file."""
    return bool(getattr(kind, "sdf_filename", "")) and not getattr(kind, "urdf_filename", "")


def example_robot(name: str, others: list[str]) -> RobotFile:
    """Return a robot of example-robot-data, with its reference posture.

    Raises:
        UnknownNameError: neither this package nor example-robot-data has the robot.
        LoadingError: example-robot-data has the robot but cannot load it.
    """
    try:
        from example_robot_data import robots_loader
    except ImportError as error:
        raise LoadingError(
            f'robot "{name}" may be one of example-robot-data, which cannot be imported ({error}); '
            "pip install example-robot-data-loaders"
        ) from None
    if name not in robots_loader.ROBOTS:
        if name in example_files():
            raise UnknownNameError(f'no robot "{name}"; it is an example: pin-nonideal example {name}')
        raise UnknownNameError(f'no robot "{name}"{nearest(name, [*others, *robots_loader.ROBOTS])}')
    kind = robots_loader.ROBOTS[name]
    if _is_sdf(kind):
        raise LoadingError(
            f'example-robot-data has "{name}" as an SDF file only ({kind.sdf_filename}), '
            "and SDF files are not read, since the pin wheel has no SDF parser; load the robot from MJCF or "
            f"URDF instead{MJCF_INSTEAD.get(name, '')}"
        )
    try:
        robot, path = _load_without_meshes(robots_loader, name)
    except Exception as error:  # any error of the loaders' parsers
        raise LoadingError(
            f'example-robot-data cannot load "{name}": {" ".join(str(error).split())}'
        ) from error
    try:
        mimics = read_mimics(path)
    except LoadingError as error:
        mimics = []
        robot.notes.append(f"mimic joints are left free: {error}")
    robot.constraints = [c for c in mimics if _has_joints(robot.model, c)]
    return robot


def _load_without_meshes(robots_loader: Any, name: str) -> tuple[RobotFile, Path]:
    """Return a robot of example-robot-data, whose meshes are read on first use, and the path of its file.

    If the class of the robot has its own `__init__`, it also loads the meshes.
    """
    kind = robots_loader.ROBOTS[name]
    if kind.__init__ is not robots_loader.RobotLoader.__init__ or not kind.urdf_filename:
        loader = robots_loader.loader(name)
        robot = loader.robot
        loaded = RobotFile(robot.model, robot.visual_model, robot.collision_model, q0=np.array(robot.q0))
        return loaded, Path(loader.df_path)
    inside = os.path.join(kind.path, kind.urdf_subpath, kind.urdf_filename)
    base = kind.model_path or robots_loader.getModelPath(inside, False)
    file, root = os.path.join(base, inside), pin.JointModelFreeFlyer() if kind.free_flyer else None
    content = (*file_stamps([file]), kind.free_flyer)
    read = partial(pin.buildModelFromUrdf, file, *([root] if root else []))
    model = cached_models(content, read).copy()
    q0, srdf = pin.neutral(model), None
    if kind.srdf_filename:
        srdf = os.path.join(base, kind.path, kind.srdf_subpath, kind.srdf_filename)
        q0 = robots_loader.readParamsFromSrdf(model, srdf, False, kind.has_rotor_parameters, kind.ref_posture)
    if kind.free_flyer:
        model.upperPositionLimit[:7], model.lowerPositionLimit[:7] = 1.0, -1.0
    read = partial(_example_shapes, model.copy(), file, os.path.join(base, "../.."), srdf)
    shapes = partial(cached_shapes, (*content, *file_stamps([srdf] if srdf else [])), read)
    visual, collision = (Shapes(cache(lambda k=k: shapes()[k].copy())) for k in range(2))
    return RobotFile(model, visual, collision, q0=np.array(q0)), Path(file)


def _example_shapes(model: Model, file: str, packages: str, srdf: str | None) -> tuple[object, object]:
    """Return visual and collision shapes of a robot of example-robot-data, with the pairs of its SRDF."""
    import coal

    kinds = (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION)
    loader = coal.CachedMeshLoader()  # most robots collide with the meshes that are drawn
    visual, collision = (
        pin.buildGeomFromUrdf(model, file, kind, package_dirs=[packages], mesh_loader=loader)
        for kind in kinds
    )
    if srdf is not None:
        collision.addAllCollisionPairs()
        pin.removeCollisionPairs(model, collision, srdf, False)
    return visual, collision


def _has_joints(model: Model, constraint: Constraint) -> bool:
    names = [getattr(constraint, key, None) for key in ("joint", "joint1", "joint2")]
    return all(model.existJointName(n) for n in names if n is not None)
