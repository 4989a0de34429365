"""Files of a robot: found by its name or by a path, and read."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from pin_nonideal.errors import InputError, LoadingError, nearest, short_repr
from pin_nonideal.loading.library.example_robots import example_names, example_robot
from pin_nonideal.loading.library.generators import GENERATORS
from pin_nonideal.loading.urdf.reader import RobotFile, read_urdf
from pin_nonideal.loading.yaml.robot import MODEL_KEYS, check_keys, optional_string, read_yaml
from pin_nonideal.types import Table
from pin_nonideal.validation import choice, positive, sequence

FILE_PARAMETERS = ("free_flyer", "package_dirs", "merge_ball_joints", "density")
MJCF_PARAMETERS = ("allow", "ctrl")
URDF, MJCF = (".urdf", ".xacro"), (".xml", ".mjcf")  # suffixes, in lower or upper case


class LoadedRobot(NamedTuple):
    """Content of a robot's file and of its robot.yaml.

    Attributes:
        robot: content of the robot's file.
        table: content of robot.yaml, {} if there is none.
        name: name of the scene.
        merge: whether three revolute joints with massless links are merged into a ball joint.
    """

    robot: RobotFile
    table: Table
    name: str
    merge: bool = False


def find_robot(name: str | os.PathLike[str], text: str, parameters: Table) -> LoadedRobot:
    """Return the content of a robot's files.

    Args:
        name: name of a robot, or a path, as given by the user.
        text: the same as text.
        parameters: parameters of the robot or of its file.

    Raises:
        UnknownNameError, LoadingError, InputError: see `load`.
    """
    path = Path(text).expanduser()
    folders = robot_folders()
    if text in folders:
        return _note_folder(_load_folder(folders[text], parameters), path)
    if path.is_dir() and (text not in example_names() or os.sep in text or isinstance(name, Path)):
        return _load_folder(path, parameters)
    if path.is_file() or path.suffix.lower() in (*URDF, *MJCF) or isinstance(name, Path) or os.sep in text:
        return _load_file(path, parameters)
    check_parameters(parameters, (), text)
    return _note_folder(LoadedRobot(example_robot(text, list(folders)), {}, text), path)


def _note_folder(loaded: LoadedRobot, path: Path) -> LoadedRobot:
    """Add a note to a robot found by its name, if a file or folder of that name exists too."""
    if path.exists():
        loaded.robot.notes.append(
            f'"{path}" of the working directory is not loaded, since it is the name of a robot; '
            f'write "./{path}" for the folder'
        )
    return loaded


def robots() -> list[tuple[str, str]]:
    """Return the robots of this package, as (name, one-line description), in alphabetical order."""
    return [
        (name, optional_string(read_yaml(folder / "robot.yaml"), "description", f'"{name}"') or "")
        for name, folder in sorted(robot_folders().items())
    ]


def robot_folders() -> dict[str, Path]:
    """Return the folders of this package's robots by name: of the installed package, or of the checkout."""
    package = Path(__file__).resolve().parent.parent
    for base in (package / "robots", package.parent / "robots"):
        if base.is_dir():
            return {p.name: p for p in sorted(base.iterdir()) if (p / "robot.yaml").is_file()}
    return {}


def check_parameters(parameters: Table, known: tuple[str, ...], name: str) -> None:
    """Check that a robot takes all given parameters.

    Raises:
        InputError: a parameter is unknown; the message has the nearest known name.
    """
    for key in parameters:
        if key not in known:
            raise InputError(f'robot "{name}" takes no parameter "{key}"{nearest(key, known)}')


def _file_options(parameters: Table, name: str) -> tuple[Table, bool]:
    check_parameters(parameters, FILE_PARAMETERS, name)
    for key in ("free_flyer", "merge_ball_joints"):
        if not isinstance(parameters.get(key, False), bool):
            raise InputError(f"{key} must be True or False; got {short_repr(parameters[key])}")
    options = {k: v for k, v in parameters.items() if k != "merge_ball_joints"}
    if isinstance(options.get("package_dirs"), (str, Path)):
        options["package_dirs"] = [options["package_dirs"]]
    if options.get("density") is not None:
        options["density"] = positive("density", options["density"])
    folders = sequence("package_dirs", options.get("package_dirs", []))
    if not all(isinstance(folder, (str, Path)) for folder in folders):
        raise InputError(f"package_dirs must be folders; got {short_repr(options['package_dirs'])}")
    return options, parameters.get("merge_ball_joints", True)


def _load_mjcf(path: Path, parameters: Table) -> LoadedRobot:
    # Imported on use, since most programs load no MJCF file.
    from pin_nonideal.loading.mjcf.reader import read_mjcf
    from pin_nonideal.loading.mjcf.unsupported import IGNORABLE_FEATURES

    check_parameters(parameters, MJCF_PARAMETERS, path.name)
    allow = parameters.get("allow", ())
    allow = (allow,) if isinstance(allow, str) else tuple(sequence("allow", allow))
    for key in allow:
        choice("allow", key, IGNORABLE_FEATURES)
    return LoadedRobot(read_mjcf(path, **{**parameters, "allow": allow}), {}, path.stem)


def _load_file(path: Path, parameters: Table) -> LoadedRobot:
    if not path.is_file():
        raise LoadingError(f'no file or folder "{path}"; give a path that exists, or the name of a robot')
    if path.suffix.lower() in URDF:
        options, merge = _file_options(parameters, path.name)
        return LoadedRobot(read_urdf(path, **options), {}, path.stem, merge)
    if path.suffix.lower() in MJCF:
        return _load_mjcf(path, parameters)
    raise LoadingError(
        f'"{path}" must be a folder, a .urdf file or a .xml file (MJCF); got "{path.suffix or path.name}"'
    )


def _load_folder(folder: Path, parameters: Table) -> LoadedRobot:
    """Load a folder with robot.yaml, robot.urdf, or both."""
    name = folder.resolve().name
    yaml_path = folder / "robot.yaml"
    table = read_yaml(yaml_path) if yaml_path.is_file() else {}
    entry = table.get("model") or {}
    if not isinstance(entry, dict):
        raise LoadingError(
            f'"{yaml_path}": model must be a table with keys out of {", ".join(MODEL_KEYS)}; '
            f"got {short_repr(entry)}"
        )
    check_keys(entry, MODEL_KEYS, f'"{yaml_path}": model')
    entry = {key: value for key, value in entry.items() if value is not None}
    kinds = [k for k in ("urdf", "example_robot_data", "generator") if k in entry]
    if len(kinds) > 1:
        raise LoadingError(
            f'"{yaml_path}": model must name one of urdf, example_robot_data, generator; '
            f"got {', '.join(kinds)}"
        )
    for key in kinds:
        optional_string(entry, key, f'"{yaml_path}": model')
    if "generator" in entry:
        return _generate(entry, table, parameters, name, yaml_path)
    if "example_robot_data" in entry:
        check_parameters(parameters, (), name)
        robot = example_robot(entry["example_robot_data"], [])
        return LoadedRobot(robot, table, name)
    return _from_urdf(folder, entry, table, parameters, name)


def _from_urdf(folder: Path, entry: Table, table: Table, parameters: Table, name: str) -> LoadedRobot:
    urdf = folder / entry.get("urdf", "robot.urdf")
    if not urdf.resolve().is_relative_to(folder.resolve()):
        raise LoadingError(f'model: urdf must lie in the folder "{folder}"; got "{entry["urdf"]}"')
    if not urdf.is_file():
        files = sorted(p for p in folder.iterdir() if p.suffix.lower() in (*URDF, *MJCF))
        others = ", ".join(f'"{p}"' for p in files[:3])
        hint = f"; load {others} by its path" if others else ""
        raise LoadingError(f'"{folder}" must hold a {urdf.name}; there is none{hint}')
    options, merge = _file_options(parameters, name)
    options.setdefault("free_flyer", _flag(entry, "free_flyer", name))
    return LoadedRobot(read_urdf(urdf, **options), table, name, merge)


def _flag(entry: Table, key: str, name: str) -> bool:
    value = entry.get(key, False)
    if not isinstance(value, bool):
        raise LoadingError(
            f'robot.yaml of "{name}": model: {key} must be true or false; got {short_repr(value)}'
        )
    return value


def _generate(entry: Table, table: Table, parameters: Table, name: str, path: Path) -> LoadedRobot:
    """Return a robot that a function of this package builds from parameters."""
    key = entry["generator"]
    if key not in GENERATORS:
        raise LoadingError(f'"{path}": no generator "{key}"{nearest(key, GENERATORS)}')
    defaults = entry.get("parameters") or {}
    if not isinstance(defaults, dict):
        raise LoadingError(f'"{path}": model: parameters must be a table; got {short_repr(defaults)}')
    generator: Callable[..., RobotFile] = GENERATORS[key]
    known = tuple(generator.__kwdefaults__ or ())
    check_keys(defaults, known, f'"{path}": model: parameters')
    check_parameters(parameters, known, name)
    return LoadedRobot(generator(**{**defaults, **parameters}), table, name, True)
