"""Loading of a scene by the name of a robot or by a path."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pin_nonideal.compilation.contacts import has_stops
from pin_nonideal.description.contacts import JointLimit, UserContact
from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.loading.library.example_robots import example_names
from pin_nonideal.loading.robot_files import LoadedRobot, find_robot, robot_folders
from pin_nonideal.loading.urdf.loop_tolerance import remove_dependent_rows
from pin_nonideal.loading.urdf.xml import quote_names
from pin_nonideal.loading.yaml.assembly import scene_arguments
from pin_nonideal.loading.yaml.initial_state import Start, held_entries
from pin_nonideal.scene.scene import Scene, compiled_scene, with_origin
from pin_nonideal.states.held_entries import Held
from pin_nonideal.types import Table
from pin_nonideal.validation import flag

ASSEMBLY_TOLERANCE = 1e-6  # accuracy of the loop frames in CAD exports [m or rad], with a margin


def load(
    name: str | os.PathLike[str],
    *,
    terms: str = "core",
    q0: Start = None,
    v0: Start = None,
    assembly_tolerance: float = ASSEMBLY_TOLERANCE,
    limits: bool = False,
    **parameters: object,
) -> Scene:
    """Load a robot as a scene.

    `name` is one of the following:

    - a robot of this package (`robots()` lists them), such as "four_bar";
    - a path to a folder with robot.urdf and, beside it, robot.yaml (loops, laws, contacts, initial state);
    - a path to a .urdf file, or to a .xml file in MJCF;
    - a robot of example-robot-data, such as "panda".

    URDF damping and friction become `JointFriction` laws, and mimic joints become `JointCoupling`. Three
    revolute joints that form a ball joint around massless links become one spherical joint. `scene.notes`
    lists these changes.

    Args:
        name: name of a robot, or a path, as above.
        terms: implementation of M(q) and the bias forces, "core" or "pinocchio", see `Scene`.
        q0: initial configuration that replaces the file's: numbers (nq,), a table of joints to change by
            name (see `Scene`), or the name of a reference configuration. The keyframe of an MJCF file
            also sets velocities and controls.
        v0: initial velocity that replaces the file's: numbers (nv,), or a table by joint name. Projection
            onto the constraints holds the entries of these tables, or of the file's tables if none are given.
        assembly_tolerance: accuracy of the frames of the file's loops [m or rad], for rounded CAD exports.
            Rows that depend on others to this tolerance are removed and listed in `notes`.
        limits: whether the position limits of the file become stops of the joints, each a `JointLimit`
            without restitution; `notes` lists unused limits. Ranges of ball joints and tendons of MJCF files
            become stops too, each a `UserContact`.
        **parameters: parameters of a generated robot, such as N for "n_four_bar". URDF files and folders:
            `free_flyer` (bool, a floating base), `package_dirs` (folders for package:// paths),
            `merge_ball_joints` (bool, True), `density` (density of links without an inertia [kg/m^3], to
            compute it from their shapes). MJCF files: `allow` (active features that may be ignored, such as
            ("fluid", "muscle")), `ctrl` (controls of the actuators: numbers (nu,), a table by actuator name,
            or a function (t, q, v) -> (nu,); default zero).

    Returns:
        Scene of the robot, for `simulate`.

    Raises:
        UnknownNameError: no robot or joint has that name.
        LoadingError: a file is missing, truncated, malformed, or has an unsupported feature.
        SingularMassError: the mass matrix at the initial configuration is not positive definite.
        InputError: a parameter is unknown, or its value is invalid.
    """
    text = os.fspath(name) if isinstance(name, (str, os.PathLike)) else None
    if not isinstance(text, str) or not text or "\0" in text:
        raise InputError(f"name must be the name of a robot or a path; got {short_repr(name)}")
    try:
        Path(text).expanduser().is_dir()
    except (
        OSError,
        RuntimeError,
        ValueError,
    ) as error:  # too long, or of an unknown user
        raise InputError(
            f"name must be the name of a robot or a path; got {short_repr(name)}: "
            f"{getattr(error, 'strerror', None) or error}"
        ) from None
    loaded = find_robot(name, text, parameters)
    arguments = scene_arguments(
        loaded.robot, loaded.table, loaded.name, merge=loaded.merge, start=q0, speed=v0
    )
    recorded = dict(parameters)
    if terms != "core":
        recorded["terms"] = terms
    for key, state in (("q0", q0), ("v0", v0)):
        if state is not None:
            recorded[key] = state if isinstance(state, (str, Mapping)) else np.asarray(state).tolist()
    if assembly_tolerance != ASSEMBLY_TOLERANCE:
        recorded["assembly_tolerance"] = assembly_tolerance
    if flag("load: limits", limits):
        recorded["limits"] = True
    _add_limits(arguments, limits, loaded.robot.ranges)
    _warn_of_open_loops(arguments, loaded.robot.open_loops)
    arguments["terms"] = terms
    scene = Scene(**arguments, assembly_tolerance=assembly_tolerance)
    parts = remove_dependent_rows(compiled_scene(scene), assembly_tolerance)
    if parts is not None:
        arguments.update(model=parts.model, constraints=parts.constraints, q0=parts.q)
        arguments["notes"] = (*scene.notes, parts.note)
        scene = Scene(**arguments, assembly_tolerance=assembly_tolerance)
    held = held_entries(loaded.robot, loaded.table, q0, v0)
    return _with_origin(scene, _origin(text, recorded), loaded, held)


def _warn_of_open_loops(arguments: Table, loops: Sequence[str]) -> None:
    """Warn of loops that only elements of other tools declare, unless robot.yaml declares constraints."""
    if not loops:
        return
    note = f"loops that elements of other tools declare are not read, so they are open: {', '.join(loops)}"
    arguments["notes"] = (*arguments.get("notes", ()), note)
    if not arguments["constraints"]:
        warnings.warn(
            f"load: {note}; close them by constraints in a robot.yaml beside the URDF, or by "
            "scene.replace(add_constraints=...)",
            UserWarning,
            stacklevel=3,
        )


def _add_limits(arguments: Table, used: bool, ranges: Sequence[UserContact]) -> None:
    """Add stops to the joints and tendons with limits, or a note that such limits exist."""
    model = arguments["model"]
    single = [(i, j.idx_q) for i, j in enumerate(model.joints) if i and j.nq == j.nv == 1]
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    bounded = [str(model.names[i]) for i, at in single if has_stops(model, at) and low[at] < high[at]]
    empty = [str(model.names[i]) for i, at in single if low[at] >= high[at]]
    if used:
        if empty:
            note = f"joints without a range (their bounds are equal) get no stops: {quote_names(empty)}"
            arguments["notes"] = (*arguments.get("notes", ()), note)
        stops = [JointLimit(name) for name in bounded]
        arguments["contacts"] = (*arguments.get("contacts", ()), *stops, *ranges)
        return
    unused = [f"the positions of {len(bounded)} joints"] if bounded else []
    if ranges:
        unused.append(f"ball joints and tendons ({quote_names([str(one.name) for one in ranges])})")
    if unused:
        note = f"bounds of {' and of '.join(unused)} are not used; limits=True makes them stops"
        arguments["notes"] = (*arguments.get("notes", ()), note)


def load_from_origin(origin: Table) -> Scene:
    """Load the scene of an origin again, as `load` created it.

    Args:
        origin: name and parameters of `load`.
    """
    return load(origin["name"], **origin["parameters"])


@dataclass(frozen=True)
class ShapeReader:
    """Function that reads the shapes of a loaded robot again, in a process that does not have them.

    Attributes:
        origin: name and parameters of `load`.
        kind: "visual_model" or "collision_model".
    """

    origin: Table
    kind: str

    def __call__(self) -> object:
        """Return the shapes."""
        return getattr(load_from_origin(self.origin), self.kind)


def _with_origin(scene: Scene, origin: Table | None, loaded: LoadedRobot, held: Held) -> Scene:
    """Return the scene with its origin, the name and parameters of the call of `load`."""
    sources = None
    if origin is not None:
        kinds = {"visual_model": loaded.robot.visual, "collision_model": loaded.robot.collision}
        visual, collision = (
            ShapeReader(origin, kind) if shapes is not None else None for kind, shapes in kinds.items()
        )
        sources = visual, collision
    return with_origin(scene, origin, shapes=sources, friction=loaded.robot.contact_friction, held=held)


def _origin(text: str, parameters: Table) -> Table | None:
    """Return name and parameters that load the scene from any folder, or None if JSON cannot encode them."""
    recorded, path = dict(parameters), Path(text).expanduser()
    folders = recorded.get("package_dirs")
    if folders is not None:
        quote_names = [folders] if isinstance(folders, (str, Path)) else folders
        recorded["package_dirs"] = [str(Path(folder).resolve()) for folder in quote_names]
    is_library_name = text in (*robot_folders(), *example_names()) or not path.exists()
    try:
        return dict(
            json.loads(
                json.dumps({"name": text if is_library_name else str(path.resolve()), "parameters": recorded})
            )
        )
    except (TypeError, ValueError):
        return None
